"""The command ``trueterrain calibrate``: boresight, lever arm and clock of the scanner."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from trueterrain.cli._console import progress_bar, write_json, write_line, write_note
from trueterrain.cli._motion import process_and_note, require_run
from trueterrain.cli._options import flatten_settings
from trueterrain.core.errors import SchemaError
from trueterrain.georeference.screening import Screening
from trueterrain.georeference.settings import CalibrationSettings
from trueterrain.georeference.settings import Parameter as Name
from trueterrain.motion.settings import FusionSettings
from trueterrain.survey import MountingOverride

if TYPE_CHECKING:
    from trueterrain.formats.run import Mounting, Run
    from trueterrain.georeference import Calibration

_FIELDS = {
    "scanner_position": (("lever_x", "lever_y", "lever_z"), "Forward, left, up", "m"),
    "scanner_rotation": (("roll", "pitch", "yaw"), "Roll, pitch, yaw", "rad"),
    "scanner_clock": (("clock",), "Clock", "s"),
}
_DIGITS = 9  # decimals that are written [rad, m, s]: far below any standard deviation

_ESTIMATION = flatten_settings("Estimation", omit=["parameters", "unobservable", "screening"])
_START = flatten_settings(
    "Mounting from which the estimation starts, by default that of the runs", sort_key=2
)
_RETURNS = flatten_settings("Returns", sort_key=3)
_MOTION = flatten_settings("Motion", omit=["drift_time"], sort_key=4)  # a name of the estimation


def calibrate(
    first: Annotated[Path, Parameter(name="RUN")],
    second: Annotated[Path, Parameter(name="RUN2")],
    /,
    *more: Annotated[Path, Parameter(name="MORE")],
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    parameter: Annotated[tuple[Name, ...] | None, Parameter(group=_ESTIMATION.group)] = None,
    unobservable: Annotated[
        Literal["refuse", "hold"] | None, Parameter(group=_ESTIMATION.group)
    ] = None,
    settings: Annotated[CalibrationSettings, _ESTIMATION] = CalibrationSettings(),
    start: Annotated[MountingOverride, _START] = MountingOverride(),
    screening: Annotated[Screening, _RETURNS] = Screening(),
    motion: Annotated[FusionSettings, _MOTION] = FusionSettings(),
    json: bool = False,
    force: bool = False,
) -> None:
    """Estimate boresight, lever arm and clock of the scanner from passes over the same ground.

    Record steps in the ground in both directions, at different speeds and at different lateral
    offsets: an error of the mounting moves the ground by another amount in each pass. The mounting
    is adjusted until the heights agree. Each parameter has a standard deviation; for one that
    these passes do not determine, the output states which passes would.

    Example: `trueterrain calibrate there.zarr back.zarr -o calibration.toml`

    Parameters
    ----------
    first
        Recorded run, NAME.zarr.
    second
        Another run over the same ground, in the opposite direction.
    more
        More runs.
    output
        File for the mounting as TOML, with standard deviations as comments: the table that the
        [[runs]] of survey.toml take.
    parameter
        Parameter to estimate; may be given several times: roll, pitch, yaw (of the scanner),
        lever_x, lever_y, lever_z (forward, left, up), clock. By default all that are observable.
    unobservable
        Treatment of a parameter that the passes do not determine. refuse: an error; hold: it keeps
        its value. By default refuse if --parameter names it, else hold.
    json
        Print one JSON document {"runs", "mounting", "before", "value", "sd", "correlation",
        "condition", "held", "sensitivity", "not_observable", "offset", "offset_sd", "residual",
        "correspondences", "iterations", "output"}, in rad, m and s.
    force
        Replace the output if it exists.
    """
    from trueterrain.core import require_writable
    from trueterrain.formats.run import open_run
    from trueterrain.georeference import calibrate_mounting
    from trueterrain.surface.runs import require_one_frame

    runs = [first, second, *more]
    if output is not None:
        require_writable(output, force=force, inputs=runs)
    settings = replace(
        settings,
        parameters=parameter or settings.parameters,
        unobservable=unobservable or ("refuse" if parameter else "hold"),
        screening=screening,
    )
    _check_runs(runs)
    opened = [open_run(run) for run in runs]
    mounting = _start_mounting(opened, start)
    require_one_frame(opened)
    with progress_bar() as progress:
        found = calibrate_mounting(
            opened,
            [process_and_note(run, motion).trajectory for run in opened],
            mounting=mounting,
            settings=settings,
            progress=progress,
        )
    if output is not None:
        _write_mounting(output, found, runs, force=force)
    if json:
        write_json(
            {
                "runs": [str(run) for run in runs],
                "before": _estimable_values(mounting),
                **found.to_dict(),
                "output": None if output is None else str(output),
            }
        )
        return
    for text in _summary_lines(found, mounting, runs):
        write_line(text)
    if output is not None:
        write_note(f"{output}: the mounting for survey.toml")


def _check_runs(runs: list[Path]) -> None:
    seen: set[Path] = set()
    for run in runs:
        require_run(run)
        if run.resolve() in seen:
            message = f"{run} is named twice; name passes that differ."
            raise ValueError(message)
        seen.add(run.resolve())


def _start_mounting(runs: "list[Run]", override: MountingOverride) -> "Mounting":
    """Mounting from which the estimation starts; it must be the same for all runs."""
    stated = [override.over(run.mounting) for run in runs]
    for run, other in zip(runs, stated, strict=True):
        if _estimable_values(other) != _estimable_values(stated[0]):
            raise SchemaError(
                f"differs from that of {runs[0].source}",
                path=run.source,
                place="attribute mounting",
                cure="Calibrate runs of one mounting, or name it: --scanner-position and so on.",
            )
    return stated[0]


def _estimable_values(mounting: "Mounting") -> dict[str, float]:
    """Parameters that can be estimated, by name [rad, m, s]."""
    values: dict[str, float] = {}
    for field, (names, *_) in _FIELDS.items():
        given = getattr(mounting, field)
        values |= zip(names, given if isinstance(given, tuple) else [given], strict=True)
    return values


def _summary_lines(found: "Calibration", start: "Mounting", runs: list[Path]) -> Iterator[str]:
    yield from _parameter_rows(found, start)
    yield f"condition number {found.condition:.3g}"
    yield from _correlated_pairs(found)
    yield from _held_influences(found)
    for name, reason in zip(found.not_observable, found.reasons, strict=True):
        yield f"{name} is not observable: {reason}"
    before, after = 1e3 * found.residual_before, 1e3 * found.residual_after
    yield (
        f"heights differ by {before:.3g} mm (rms) before, {after:.3g} mm after, at "
        f"{found.correspondences:,} independent pairs; {found.iterations} iterations"
    )
    for run, offset, sd in zip(runs[1:], found.offset[1:], found.offset_sd[1:], strict=True):
        side = "above" if offset > 0 else "below"
        height = f"{1e3 * abs(offset):.1f} mm (sd {1e3 * sd:.1g})"
        yield f"{run.name} lies {height} {side} {runs[0].name}"


def _parameter_rows(found: "Calibration", start: "Mounting") -> Iterator[str]:
    """Each parameter with its standard deviation and its value before, in practical units."""
    from trueterrain.georeference.observability import parameter_unit

    sd = dict(zip(found.parameters, found.sd.tolist(), strict=True))
    old = _estimable_values(start)
    yield f"{'parameter':<10}{'found':>12} {'sd':>11}{'before':>13}"
    for name, value in _estimable_values(found.mounting).items():
        unit, scale = parameter_unit(name)
        known = f"{scale * sd[name]:11.4f}" if name in sd else f"{'held':>11}"
        yield f"{name:<10}{scale * value:12.4f} {known}{scale * old[name]:13.4f} {unit}"


def _correlated_pairs(found: "Calibration") -> Iterator[str]:
    """Pairs of parameters that these passes hardly separate."""
    from trueterrain.georeference.observability import MIN_CORRELATION

    for k, name in enumerate(found.parameters):
        for j in range(k):
            correlation = float(found.correlation[k, j])
            if abs(correlation) > MIN_CORRELATION:
                yield f"{found.parameters[j]} and {name}: correlation {correlation:+.2f}"


def _held_influences(found: "Calibration") -> Iterator[str]:
    """Effect of errors of held parameters on the estimates, where it exceeds their sd."""
    from trueterrain.georeference.observability import format_parameter, survey_tolerance

    for k, name in enumerate(found.parameters):
        for j, held in enumerate(found.held):
            error = survey_tolerance(held)
            caused = float(found.sensitivity[k, j]) * error
            if abs(caused) > found.sd[k]:
                yield (
                    f"{name} depends on {held}, which is held: an error of "
                    f"{format_parameter(held, error)} there changes {name} by "
                    f"{format_parameter(name, caused)}"
                )


def _write_mounting(output: Path, found: "Calibration", runs: list[Path], *, force: bool) -> None:
    """Write the mounting as the table that a survey takes."""
    from trueterrain import __version__
    from trueterrain.core import whole_output

    lines = [
        f"# Mounting of the scanner by calibration (trueterrain {__version__}) from",
        *(f"#   {run.name}" for run in runs),
        "# In survey.toml it belongs below the [[runs]] to which it applies.",
        "[runs.mounting]",
    ]
    values = _estimable_values(found.mounting)
    sd: dict[str, Any] = dict(zip(found.parameters, found.sd.tolist(), strict=True))
    for field, (names, title, unit) in _FIELDS.items():
        known = ", ".join(f"{sd[name]:.1e}" if name in sd else "held" for name in names)
        written = [repr(round(values[name], _DIGITS)) for name in names]
        text = f"[{', '.join(written)}]" if len(names) > 1 else written[0]
        lines += [f"# {title} [{unit}]; standard deviation: {known}", f"{field} = {text}"]
    with whole_output(output, force=force) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
