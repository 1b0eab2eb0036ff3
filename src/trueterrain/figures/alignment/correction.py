"""Figures of the corrections of passes, with the reported standard deviations."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np
import numpy.typing as npt

from trueterrain.figures import canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from trueterrain.alignment import SplineCorrection

Floats = npt.NDArray[np.float64]

#: Argument of corrections: the time of a pass, or the station along the road.
Along = Literal["time", "station"]

_PER_KNOT = 8  # samples from one knot to the next
_MAX_SAMPLES = 20_000  # maximum number of samples of a line
_DASH = 5.0  # [points] length of the dashes of reported standard deviations
_HATCHES = ("///", "\\\\\\", "|||", "---")
_NAMES = {"east": "Correction to east", "north": "Correction to north"}
_ANGLES = ("roll", "pitch")


def pass_correction(
    corrections: "SplineCorrection | Sequence[SplineCorrection]",
    *,
    component: str = "height",
    navigation_sd: Mapping[str, tuple[npt.ArrayLike, npt.ArrayLike]] | None = None,
    along: Along = "time",
    ax: "Axes | None" = None,
) -> "Axes":
    """Corrections of passes with their standard deviations, and those that navigation reports.

    Parameters
    ----------
    corrections : SplineCorrection or sequence of Correction
        Corrections of the network adjustment.
    component : str
        One of height, roll, pitch, east and north.
    navigation_sd : mapping of str to (time, sd), optional
        By the name of the pass: times [s], and reported standard deviations of the component [m]
        or [rad]. If they are realistic, corrections seldom exceed them.
    along : {"time", "station"}
        Whether corrections are functions of time [s], drawn from the start of each, or of station
        [m].
    ax : Axes, optional
        Where to draw; by default a new figure.

    Returns
    -------
    Axes
        Time [s] or station [m], and correction [m] or [rad], with a band of one standard deviation,
        whose median is in the legend. Spans without other passes over the same ground are hatched:
        there the correction is extrapolated.

    Raises
    ------
    ValueError
        If there is no correction, the component was not estimated, or the reported standard
        deviations belong to no pass or do not match their times.

    Examples
    --------
    >>> from trueterrain.alignment import adjust_passes, make_pass_cells
    >>> cell, time = np.arange(400), np.arange(400) * 0.1
    >>> found = adjust_passes([
    ...     make_pass_cells(name, cell, time, up + np.sin(cell), variance=1e-6, easting=0.5 * cell)
    ...     for name, up in (("east", 0.005), ("west", -0.005))])
    >>> pass_correction(found.corrections).get_ylabel()
    'Correction of height [mm]'
    """
    drawn = as_corrections(corrections, component)
    reported = navigation_sd or {}
    for name in reported:
        if name not in [one.name for one in drawn]:
            message = f"navigation_sd must be of a pass that is drawn, got {name!r}."
            raise ValueError(message)
    ax = canvas.axes_or_new(ax, height=3.4)
    ax.axhline(0.0, color="0.5", linewidth=0.8)
    drawn_values = []
    for number, one in enumerate(drawn):
        colour = canvas.COLOURS[number % len(canvas.COLOURS)]
        origin = one.knots.begin if along == "time" else 0.0
        drawn_values.append(_draw_correction(ax, one, component, colour, origin))
        if one.name in reported:
            time, sd = _navigation_sd(one, *reported[one.name])
            position = (number, len(drawn))
            drawn_values.append(_draw_reported_sd(ax, time - origin, sd, colour, position))
        _shade_unsupported(ax, one, number, colour, origin)
    if reported:
        ax.plot(
            [],
            [],
            color="0.3",
            linewidth=1.0,
            linestyle=(0, (_DASH, _DASH)),
            label="± 1 sd reported by navigation",
        )
    if component in _ANGLES:
        canvas.scale_axis(
            ax.yaxis, canvas.LengthScale(factor=1e3, unit="mrad"), f"Correction of {component}"
        )
    else:
        name = _NAMES.get(component, f"Correction of {component}")
        canvas.scale_axis(ax.yaxis, canvas.height_scale(*drawn_values), name)
    ax.set_xlabel(
        "Time since the start of each correction [s]" if along == "time" else "Station [m]"
    )
    ax.margins(x=0)
    canvas.draw_grid(ax)
    canvas.legend_above(ax, columns=3, notes=False)
    return ax


def as_corrections(
    corrections: "SplineCorrection | Sequence[SplineCorrection]", component: str
) -> "list[SplineCorrection]":
    """Corrections as a list, checked to hold the component."""
    drawn = list(corrections) if isinstance(corrections, Sequence) else [corrections]
    if not drawn:
        message = "corrections must hold at least 1 correction, got none."
        raise ValueError(message)
    for one in drawn:
        if component not in one.components:
            message = (
                f"component must be one of {', '.join(one.components)}, those of the correction "
                f"of {one.name}, got {component!r}."
            )
            raise ValueError(message)
    return drawn


def component_sd(correction: "SplineCorrection", time: Floats, component: str) -> Floats:
    """Standard deviation of one component, without the residual standard deviation."""
    interval, weights = correction.knots.basis(time)
    first = 4 * correction.components.index(component)
    blocks = correction.covariance[:, first : first + 4, first : first + 4]
    variance = np.einsum("ni,nij,nj->n", weights, blocks[interval], weights, optimize=True)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


def _draw_correction(
    ax: "Axes", one: "SplineCorrection", component: str, colour: str, origin: float
) -> Floats:
    samples = min(_PER_KNOT * one.knots.intervals, _MAX_SAMPLES) + 1
    time = np.linspace(one.knots.begin, one.knots.end, samples)
    value = one(time, component)
    sd = component_sd(one, time, component)
    if component == "height":  # as in `SplineCorrection.sd`
        sd = np.hypot(sd, one.residual_sd)
    ax.fill_between(time - origin, value - sd, value + sd, color=colour, alpha=0.3, linewidth=0)
    factor, unit = (1e6, "µrad") if component in _ANGLES else (1e3, "mm")
    ax.plot(
        time - origin,
        value,
        color=colour,
        linewidth=1.5,
        label=f"{one.name}, band ± 1 sd: {factor * np.median(sd):.2g} {unit}",
    )
    return np.concatenate([value - sd, value + sd])


def _navigation_sd(
    one: "SplineCorrection", time: npt.ArrayLike, sd: npt.ArrayLike
) -> tuple[Floats, Floats]:
    """Reported standard deviations within the span of a correction."""
    times, sds = np.asarray(time, dtype=np.float64), np.asarray(sd, dtype=np.float64)
    if times.ndim != 1 or times.shape != sds.shape:
        message = (
            f"navigation_sd of {one.name} must hold one standard deviation for each time, got the "
            f"shapes {times.shape} and {sds.shape}."
        )
        raise ValueError(message)
    within = (times >= one.knots.begin) & (times <= one.knots.end)
    if not within.any():
        message = (
            f"navigation_sd of {one.name} must hold times from {one.knots.begin:g} to "
            f"{one.knots.end:g}, those of its correction, got none."
        )
        raise ValueError(message)
    times, sds = times[within], sds[within]
    stride = -(-times.size // _MAX_SAMPLES)
    return times[::stride], sds[::stride]


def _draw_reported_sd(
    ax: "Axes", time: Floats, sd: Floats, colour: str, position: tuple[int, int]
) -> Floats:
    """Dashed lines at ± 1 sd; dashes of several passes alternate, so equal ones stay visible."""
    number, total = position
    gap = _DASH * max(total - 1, 1)
    for side in (-1, 1):
        ax.plot(
            time,
            side * sd,
            color=colour,
            linewidth=1.0,
            linestyle=((_DASH + gap) - _DASH * number, (_DASH, gap)),
        )
    return np.concatenate([sd, -sd])


def _shade_unsupported(
    ax: "Axes", one: "SplineCorrection", number: int, colour: str, origin: float
) -> None:
    label: str | None = f"{one.name}: extrapolated"
    for begin, end in one.unsupported:
        ax.axvspan(
            begin - origin,
            end - origin,
            facecolor="none",
            edgecolor=colour,
            alpha=0.4,
            hatch=_HATCHES[number % len(_HATCHES)],
            linewidth=0,
            label=label,
        )
        label = None
