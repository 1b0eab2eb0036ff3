"""Ranges as an image over scans and beams."""

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from trueterrain.core.errors import CoverageError
from trueterrain.figures import canvas
from trueterrain.figures.run import groups

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MAX_SCANS = 1600  # in an image
_BLOCK = 64  # scans that are read at a time if only some are shown
_MAX_MARKS = 60_000  # of missing returns; of more, one of every n is marked
_LOST = "#D55E00"


def range_image(
    run: xr.DataTree,
    *,
    begin: float | None = None,
    end: float | None = None,
    below: bool = False,
    ax: "Axes | None" = None,
) -> "Axes":
    """Image of the ranges of all beams over time, with the beams without return marked.

    Parameters
    ----------
    run : xarray.DataTree
        The run.
    begin, end : float, optional
        Time stamps between which scans are shown [s]; by default all. Of many scans, one of every n
        is read, and noted in the figure.
    below : bool
        Show the depth of each return below the scanner (range times the cosine of the angle), which
        is constant on level ground, instead of the range.
    ax : Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    Axes
        Time [s] and angle from straight down, left positive [deg]; colour is the range [m].

    Raises
    ------
    CoverageError
        If there is no scan between these times.
    """
    scans = groups.run_group(run, "scans")
    time = scans["time"].values
    low = time[0] if begin is None and time.size else begin
    high = time[-1] if end is None and time.size else end
    inside = np.flatnonzero((time >= low) & (time <= high)) if time.size else np.empty(0, int)
    if inside.size == 0:
        span = f"from {time[0]:.6g} s to {time[-1]:.6g} s" if time.size else "none"
        raise CoverageError(
            f"there is no scan from {begin} s to {end} s",
            place="group scans",
            cure=f"The scans are {span}.",
        )
    every = -(-inside.size // _MAX_SCANS)
    chosen = inside[::every]
    image = _read_ranges(scans, chosen, every)
    angle = scans["angle"].values
    degrees = np.rad2deg(angle)
    shown = image * np.cos(angle) if below else image
    ax = canvas.axes_or_new(ax, height=3.8)
    low_range, high_range = _colour_limits(shown)
    edges = time[chosen[0]], time[min(chosen[-1] + every, time.size - 1)]
    picture = ax.imshow(
        shown.T,
        origin="lower",
        aspect="auto",
        cmap=canvas.HEIGHT_MAP,
        interpolation="nearest",
        extent=(edges[0], max(edges[1], edges[0] + 1e-6), *_angle_limits(degrees)),
        vmin=low_range,
        vmax=high_range,
    )
    name = "Distance below the scanner" if below else "Range"
    canvas.colour_bar(
        picture, ax, canvas.height_scale(shown) if below else canvas.LengthScale(), name
    )
    _mark_lost(ax, image, time[chosen], degrees)
    ax.set_xlim(edges[0], max(edges[1], edges[0] + 1e-6))
    ax.set_ylim(_angle_limits(degrees))
    ax.set_xlabel("Time [s]")
    ax.set_ylabel("Angle from straight down, left + [deg]")
    canvas.annotate_axes(ax, f"1 of {every} scans shown" if every > 1 else "every scan shown")
    canvas.legend_above(ax)
    return ax


def _read_ranges(scans: xr.Dataset, chosen: np.ndarray, every: int) -> np.ndarray:
    """Ranges of the chosen scans; besides them, only one block is held in memory."""
    if every == 1:
        ranges: np.ndarray = scans["range"].isel(scan=slice(chosen[0], chosen[-1] + 1)).values
        return ranges
    parts = []
    for first in range(0, chosen.size, _BLOCK):
        some = chosen[first : first + _BLOCK]
        block = scans["range"].isel(scan=slice(some[0], some[-1] + 1, every)).values
        parts.append(block)
    return np.concatenate(parts)


def _angle_limits(degrees: np.ndarray) -> tuple[float, float]:
    half = 0.5 * (degrees[-1] - degrees[0]) / max(degrees.size - 1, 1)
    return float(degrees[0] - half), float(degrees[-1] + half)


def _colour_limits(shown: np.ndarray) -> tuple[float, float]:
    """Limits of the colours: minimum and maximum without 0.1 % of outliers at each end."""
    known = shown[np.isfinite(shown)]
    if known.size == 0:
        return 0.0, 1.0
    low, high = np.percentile(known, [0.1, 99.9])
    return float(low), float(high)


def _mark_lost(ax: "Axes", image: np.ndarray, time: np.ndarray, degrees: np.ndarray) -> None:
    """Draw a dot for each beam without return: single pixels of the image would not be visible."""
    scan, beam = np.nonzero(~np.isfinite(image))
    if scan.size == 0:
        return
    some = slice(None, None, -(-scan.size // _MAX_MARKS))
    label = f"no return, {100 * scan.size / image.size:.2g} %"
    ax.scatter(
        time[scan[some]],
        degrees[beam[some]],
        s=4,
        color=_LOST,
        linewidths=0,
        label=label,
        rasterized=True,
    )
