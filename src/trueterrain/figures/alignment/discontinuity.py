"""Figures of discontinuity vectors of two passes, and of the heights behind them."""

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from trueterrain.figures import canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from trueterrain.alignment.discontinuity.alignment import DiscontinuityVectors, PairAlignment

Floats = npt.NDArray[np.float64]

_MAX_POINTS = 20_000  # maximum number of reference points of a line
_HATCH_COLOUR = "0.45"  # of hatched gaps


def discontinuity_vectors(
    data: "PairAlignment | DiscontinuityVectors",
    *,
    cut_off: float | None = None,
    ax: "Axes | None" = None,
) -> "Axes":
    """Discontinuity vectors of two passes, raw and filtered.

    Parameters
    ----------
    data : PairAlignment or Discontinuity
        Two passes along their reference path.
    cut_off : float, optional
        Cut-off wavelength of the filter, printed in the figure [m].
    ax : Axes, optional
        Where to draw; by default a new figure.

    Returns
    -------
    Axes
        Station of the reference path and height of each pass less the reference height, both in
        metres, in the manner of Figs. 4-5 and 4-6 of Smith, "Improving the Quality of Terrain
        Measurement", Virginia Tech, 2009. Dots are raw; the filtered line is the correction,
        which is subtracted. Gaps, over which it is interpolated, are grey.

    Raises
    ------
    ValueError
        If the cut-off is not greater than 0.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_points
    >>> from trueterrain.alignment.discontinuity.alignment import align_along_paths
    >>> x, y = (at.ravel() for at in np.meshgrid(np.arange(0, 20, 0.05), np.arange(0, 3, 0.05)))
    >>> found = align_along_paths(
    ...     {"left": make_points(x, y, 0 * x + 0.012), "right": make_points(x, y - 2, 0 * x)})
    >>> ax = discontinuity_vectors(found.pairs[0])
    >>> ax.get_legend().get_texts()[1].get_text()
    'left, filtered: median 6.0 mm'
    """
    if cut_off is not None and not cut_off > 0:
        message = f"cut_off must be greater than 0 m, got {cut_off}."
        raise ValueError(message)
    from trueterrain.alignment.discontinuity.alignment import PairAlignment

    found = data.discontinuity if isinstance(data, PairAlignment) else data
    stride = -(-found.station.size // _MAX_POINTS)
    station = found.station[::stride]
    ax = canvas.axes_or_new(ax, height=3.2)
    ax.axhline(0.0, color="0.5", linewidth=0.8)
    for side, name in enumerate(found.names):
        colour = canvas.COLOURS[side]
        raw, filtered = found.raw[side], found.filtered[side]
        ax.plot(
            station,
            raw[::stride],
            ".",
            color=colour,
            markersize=4.5,
            alpha=0.6,
            markeredgewidth=0,
            label=f"{name}, raw",
        )
        ax.plot(
            station,
            filtered[::stride],
            color=colour,
            linewidth=1.5,
            label=f"{name}, filtered: median {1e3 * np.median(filtered):.1f} mm".replace(
                " -", f" {canvas.MINUS}"
            ),
        )
    _shade_gaps(ax, found)
    canvas.scale_axis(
        ax.yaxis, canvas.height_scale(found.raw, found.filtered), "Pass less reference height"
    )
    ax.set_xlabel("Station of the reference path [m]")
    ax.margins(x=0)
    canvas.draw_grid(ax)
    if cut_off is not None:
        canvas.annotate_axes(ax, f"waves shorter than {cut_off:g} m filtered out")
    canvas.legend_above(ax, columns=3, notes=cut_off is not None)
    return ax


def pass_histograms(
    discontinuity: "DiscontinuityVectors", *, station: float, ax: "Axes | None" = None
) -> "Axes":
    """Histograms of the heights of two passes in one search area, and the reference height.

    Parameters
    ----------
    discontinuity : DiscontinuityVectors
        Two passes along their reference path.
    station : float
        Station of the reference point, which is the nearest one [m].
    ax : Axes, optional
        Where to draw; by default a new figure.

    Returns
    -------
    Axes
        Height [m] and heights in each bin, with the mean (or median) of each pass and the reference
        height, in the manner of Fig. 4-4 of Smith, "Improving the Quality of Terrain Measurement",
        Virginia Tech, 2009.

    Raises
    ------
    ValueError
        If the station lies more than half a step beyond the ends of the path, or neither pass has
        heights there.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_points
    >>> from trueterrain.alignment.discontinuity.alignment import align_along_paths
    >>> x, y = (at.ravel() for at in np.meshgrid(np.arange(0, 20, 0.05), np.arange(0, 3, 0.05)))
    >>> found = align_along_paths(
    ...     {"left": make_points(x, y, 0 * x + 0.012), "right": make_points(x, y - 2, 0 * x)})
    >>> pass_histograms(found.pairs[0].discontinuity, station=10.0).get_ylabel()
    'Heights per bin of 1 mm'
    """
    found = discontinuity
    k = _reference_point(found, station)
    ax = canvas.axes_or_new(ax, height=3.4)
    shown = [one[k][0] for one in found.histograms]
    scale = canvas.height_scale(*shown)
    for side, (name, histogram) in enumerate(zip(found.names, found.histograms, strict=True)):
        edges, quantity = histogram[k]
        colour = canvas.COLOURS[side]
        if quantity.size:
            ax.stairs(
                quantity,
                edges,
                fill=True,
                color=colour,
                alpha=0.35,
                label=f"{name}: {found.count[side, k]} heights",
            )
            ax.stairs(quantity, edges, color=colour, linewidth=0.9)
    for side, name in enumerate(found.names):
        what = f"{_statistic_name(found, side)} of {name}"
        _mark_height(ax, found.height[side, k], scale, what, canvas.COLOURS[side], "-")
    _mark_height(ax, found.reference_height[k], scale, "reference height", "black", "--")
    ax.set_ylim(bottom=0)
    canvas.scale_axis(ax.xaxis, scale, "Height")
    bin_width = 1e3 * found.histograms[0].bin_width
    ax.set_ylabel(f"Heights per bin of {bin_width:g} mm")
    canvas.draw_grid(ax, "y")
    gap = ": a gap" if found.gap[k] else ""
    canvas.annotate_axes(ax, f"search area at station {found.station[k]:.2f} m{gap}")
    canvas.legend_above(ax, columns=3)
    return ax


def _shade_gaps(ax: "Axes", found: "DiscontinuityVectors") -> None:
    """Gaps in two greys: where the search area leaves the overlap, and where heights are few."""
    half = 0.5 * float(found.station[1] - found.station[0])
    kinds = (
        (found.gap & found.thin, "0.78", "gap: overlap too thin"),
        (found.gap & ~found.thin, "0.9", "gap: few heights"),
    )
    for gap, grey, why in kinds:
        label: str | None = why
        turns = np.flatnonzero(np.diff(np.concatenate([[0], gap, [0]])))
        for first, past in zip(turns[::2], turns[1::2], strict=True):
            ax.axvspan(
                max(found.station[first] - half, found.station[0]),
                min(found.station[past - 1] + half, found.station[-1]),
                color=grey,
                linewidth=0,
                zorder=0.5,
                label=label,
            )
            label = None


def _reference_point(found: "DiscontinuityVectors", station: float) -> int:
    half = 0.5 * float(found.station[1] - found.station[0])
    first, last = float(found.station[0]), float(found.station[-1])
    if not first - half <= station <= last + half:
        message = f"station must be from {first:g} to {last:g} m, got {station}."
        raise ValueError(message)
    k = int(np.argmin(np.abs(found.station - station)))
    if not found.count[:, k].any():
        message = (
            f"station must be one at which a pass has heights, got {station}: there are none in "
            f"the search area at {found.station[k]:g} m."
        )
        raise ValueError(message)
    return k


def _statistic_name(found: "DiscontinuityVectors", side: int) -> str:
    """Name of the statistic of the heights: mean or median."""
    median = found.histograms[side].median
    return "median" if np.array_equal(found.height[side], median, equal_nan=True) else "mean"


def _mark_height(
    ax: "Axes", height: float, scale: canvas.LengthScale, what: str, colour: str, style: str
) -> None:
    if np.isfinite(height):
        ax.axvline(
            height,
            color=colour,
            linewidth=1.6,
            linestyle=style,
            label=f"{what} {scale.text(height, 1)} {scale.unit}",
        )
