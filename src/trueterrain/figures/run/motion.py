"""Motion of the body and of the laser over time."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.figures import canvas
from trueterrain.figures.run import groups

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Motion = xr.DataTree | xr.Dataset | Mapping[str, npt.ArrayLike]
Component = Literal["up", "pitch", "roll"]

_NAMES = {"up": "heave", "pitch": "pitch, nose down +", "roll": "roll"}
_MAX_SAMPLES = 200_000  # of a line
_MARGIN = 1.15  # ratio of the range of an axis to that of its line


def body_motion(
    motion: Motion,
    *,
    source: Literal["truth", "navigation"] | None = None,
    components: Sequence[Component] = ("up", "pitch", "roll"),
    ax: "Axes | None" = None,
) -> "Axes":
    """Heave, pitch and roll of the body over time (Fig. 2-5 of Smith 2009: driving off a kerb).

    Parameters
    ----------
    motion : xarray.DataTree, xarray.Dataset or mapping of str to array_like
        A run, navigation, or arrays ``time`` [s] and the components [m], [rad].
    source : {"truth", "navigation"}, optional
        Group of a run to draw; by default the truth if there is one.
    components : sequence of str
        Components to draw, of ``"up"``, ``"pitch"`` and ``"roll"``.
    ax : Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    Axes
        Time [s] and height above that at the start [m]; a second axis on the right has the angles.

    Raises
    ------
    SchemaError
        If `source` is "truth" and the run holds none, or an array is missing.
    ValueError
        If a component is unknown.

    Examples
    --------
    >>> time = np.linspace(0.0, 2.0, 100)
    >>> ax = body_motion({"time": time, "up": 0.01 * np.sin(9 * time)}, components=["up"])
    >>> ax.get_ylabel()
    'Heave [mm]'
    """
    unknown = [name for name in components if name not in _NAMES]
    if unknown or not components:
        message = f"components must be some of {', '.join(_NAMES)}, got {list(components)}."
        raise ValueError(message)
    table, what = _body_motion(motion, source)
    values = groups.equal_columns(table, ("time", *components), what)
    every = -(-values["time"].size // _MAX_SAMPLES)
    time = values["time"][::every]
    ax = canvas.axes_or_new(ax)
    angles = [name for name in components if name != "up"]
    if "up" in components:
        up = values["up"][::every] - values["up"][0]
        ax.plot(time, up, color=canvas.COLOURS[0], linewidth=1.3, label=_NAMES["up"])
        canvas.scale_axis(ax.yaxis, canvas.height_scale(up), "Heave")
    angle_axes = ax.twinx() if angles and "up" in components else ax
    for number, name in enumerate(angles, start=1):
        angle_axes.plot(
            time, values[name][::every], color=canvas.COLOURS[number], linewidth=1.1, label=name
        )
        ax.plot([], [], color=canvas.COLOURS[number], linewidth=1.1, label=_NAMES[name])
    if angles:
        canvas.degree_axis(angle_axes.yaxis, " and ".join(angles).capitalize())
    ax.set_xlabel("Time [s]")
    _complete_axes(ax)
    if angle_axes is not ax:
        _align_zeros(ax, angle_axes)
    if isinstance(motion, xr.DataTree):
        canvas.annotate_axes(ax, what)
    canvas.legend_above(ax)
    return ax


def laser_displacement(
    motion: Motion, *, begin: float = -np.inf, end: float = np.inf, ax: "Axes | None" = None
) -> "Axes":
    """Height of the laser over time (Fig. 3-20 of Smith 2009), from the truth of a run.

    Parameters
    ----------
    motion : xarray.DataTree, xarray.Dataset or mapping of str to array_like
        A simulated run, or arrays ``time`` [s] and ``up`` [m].
    begin, end : float
        Times between which to draw [s].
    ax : Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    Axes
        Time [s] and height above that at the start [m]; the span from peak to peak is printed.

    Raises
    ------
    SchemaError
        If the run holds no truth, or an array is missing.
    ValueError
        If there is no sample between the times.

    Examples
    --------
    >>> ax = laser_displacement({"time": [0.0, 0.1, 0.2], "up": [2.0, 2.03, 1.99]})
    >>> ax.texts[0].get_text()
    'laser, 40.0 mm from peak to peak'
    """
    tree = isinstance(motion, xr.DataTree)
    table = groups.run_group(motion, "truth/scanner") if isinstance(motion, xr.DataTree) else motion
    values = groups.equal_columns(
        table, ("time", "up"), "true motion of the laser" if tree else "motion"
    )
    inside = (values["time"] >= begin) & (values["time"] <= end)
    if not inside.any():
        message = f"begin and end must enclose a sample, got {begin} s and {end} s."
        raise ValueError(message)
    time, up = values["time"][inside], values["up"][inside]
    up = up - up[0]
    every = -(-time.size // _MAX_SAMPLES)
    ax = canvas.axes_or_new(ax, height=2.8)
    ax.plot(time[::every], up[::every], color=canvas.COLOURS[0], linewidth=1.3)
    canvas.scale_axis(ax.yaxis, canvas.height_scale(up), "Displacement")
    ax.set_xlabel("Time [s]")
    _complete_axes(ax)
    canvas.annotate_axes(ax, f"laser, {1000 * np.ptp(up):.1f} mm from peak to peak")
    return ax


def _body_motion(motion: Motion, source: str | None) -> tuple[Any, str]:
    if not isinstance(motion, xr.DataTree):
        return motion, "motion"
    if source is None:
        source = "truth" if groups.has_group(motion, "truth/body") else "navigation"
    return (
        (groups.run_group(motion, "truth/body"), "true motion of the body")
        if source == "truth"
        else (groups.run_group(motion, "navigation"), "motion by navigation")
    )


def _complete_axes(ax: "Axes") -> None:
    ax.margins(x=0)
    canvas.draw_grid(ax)


def _align_zeros(ax: "Axes", other: "Axes") -> None:
    """Set the limits of both axes so that their zeros are at the same place."""
    spans = [np.array(each.dataLim.intervaly) for each in (ax, other)]
    spans = [np.array([min(low, 0.0), max(high, 0.0)]) * _MARGIN for low, high in spans]
    largest = [float(np.ptp(span)) or 1e-3 for span in spans]
    below = max(-span[0] / size for span, size in zip(spans, largest, strict=True))
    above = max(span[1] / size for span, size in zip(spans, largest, strict=True))
    if below + above == 0.0:  # no motion
        below = above = 0.5
    for each, size in zip((ax, other), largest, strict=True):
        each.set_ylim(-below * size, above * size)
