"""Common parts of the commands that rate profiles: reading, warnings, tables, pictures."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from trueterrain.cli._console import write_line, write_note
from trueterrain.cli._recordings import refuse_recording
from trueterrain.core.errors import SchemaError, name_file_in_errors

if TYPE_CHECKING:
    import xarray as xr

    from trueterrain.roughness import QuarterCarSettings

_WIDTH, _HEIGHT, _TITLE = 8.0, 3.2, 0.3  # [inches] width of a picture; height of panel, title
_MAX_STRETCHES = 20  # printed for each track


def read_profile(path: Path) -> "xr.Dataset":
    """Profile from a file, with a warning for each implausible property."""
    from trueterrain import formats
    from trueterrain.core.schemas import kind_of
    from trueterrain.roughness import flag_profile

    refuse_recording(path, formats.kind_of_file(path), "a profile")
    data = formats.open(path)
    kind = kind_of(data)
    if kind != "profile":
        found = "is a surface" if kind == "surface" else "holds points"
        raise SchemaError(
            f"{found}, not a profile",
            path=path,
            cure=f"Extract a profile first: trueterrain profile {path} ... -o FILE.erd",
        )
    with name_file_in_errors(path):
        for flag in flag_profile(data):
            write_warning(f"{path}: {flag}")
    return data


def warn_of_rating(path: Path, profile: "xr.Dataset", settings: "QuarterCarSettings") -> None:
    """Warn of properties of a profile that make its index inaccurate."""
    from trueterrain.roughness.plausible import rating_flags

    for flag in rating_flags(profile, settings):
        write_warning(f"{path}: {flag}.")


def write_warning(text: str) -> None:
    """Write a warning about a result to stderr."""
    write_note(f"trueterrain: warning: {text}")


def write_table(rows: list[list[str]]) -> None:
    """Write right-aligned columns; a row may end with remarks that belong to no column."""
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    for row in rows:
        cells = [cell.rjust(width) for cell, width in zip(row, widths, strict=False)]
        write_line("  ".join([*cells, *row[len(widths) :]]))


def worst_stretches(found: Sequence[dict[str, float]]) -> tuple[list[dict[str, float]], str]:
    """Stretches with the largest peaks, in order of station, and a line on the others."""
    largest = sorted(found, key=lambda one: -abs(one["peak"]))[:_MAX_STRETCHES]
    kept = sorted(largest, key=lambda one: one["start"])
    others = len(found) - len(kept)
    return kept, f"  and {others} others that are less; --json lists all" if others else ""


def check_picture(output: Path | None, *, force: bool, inputs: Sequence[Path]) -> None:
    """Raise an error if a picture is asked for that cannot be written."""
    if output is not None:
        from trueterrain import figures

        figures.require_picture(output, force=force, inputs=inputs)


def draw_panels(
    titles: Sequence[str],
    panels: Sequence[Sequence[Callable[[Any], object]]],
    output: Path,
    *,
    force: bool,
    height: float = _HEIGHT,
) -> None:
    """Draw the panels of all files below each other in one picture."""
    import matplotlib.pyplot as plt

    from trueterrain import figures

    heights = [height * len(column) + _TITLE for column in panels]
    figure = plt.figure(figsize=(_WIDTH, sum(heights)), layout="constrained")
    parts = figure.subfigures(len(panels), 1, squeeze=False, height_ratios=heights)[:, 0]
    for title, part, column in zip(titles, parts, panels, strict=True):
        figures.head_figure(part, title)
        for panel, ax in zip(column, part.subplots(len(column), squeeze=False)[:, 0], strict=True):
            panel(ax)
    figures.save_figure(figure, output, force=force)
    write_note(f"{output}: written")


def explain_run(settings: "QuarterCarSettings", start: str) -> str:
    """Text on the conventions of a quarter car: they change the index."""
    length = "" if settings.window == "none" else f" ({settings.window_length:g} m)"
    run = "a new car in every segment" if settings.restart else "one run over the whole profile"
    speed = 3.6 * settings.speed
    return f"at {speed:g} km/h; window {settings.window}{length}; start {start}; {run}."
