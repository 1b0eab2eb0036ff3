"""International Roughness Index of segments."""

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from trueterrain.figures import canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def iri_segments(index: xr.Dataset, *, ax: "Axes | None" = None) -> "Axes":
    """IRI of each segment as steps, with that of the whole profile.

    Parameters
    ----------
    index : xarray.Dataset
        Result of `trueterrain.roughness.iri.iri` with a segment length.
    ax : Axes, optional
        Where to draw; by default a new figure.

    Returns
    -------
    Axes
        Distance along the path [m] and index [m/km]; the index of the whole is in the legend. A
        last segment that is shorter than the others is shaded.

    Raises
    ------
    ValueError
        If the index has no segments.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_profile
    >>> from trueterrain.roughness import iri
    >>> s = np.arange(0.0, 60.0, 0.1)
    >>> road = make_profile(s, 0.005 * np.sin(2 * np.pi * s / 5))
    >>> iri_segments(iri(road, segment=20.0)).get_ylabel()
    'IRI [m/km]'
    """
    if "segment_iri" not in index:
        message = "index must hold segments: call iri(profile, segment=...), got none."
        raise ValueError(message)
    ax = canvas.axes_or_new(ax, height=3.0)
    edges = np.append(index.start.values, index.end.values[-1:])
    several = index.sizes["track"] > 1
    for number, track in enumerate(index.track.values):
        colour = canvas.COLOURS[number % len(canvas.COLOURS)]
        values = index.segment_iri.sel(track=track).values
        whole = float(index.iri.sel(track=track))
        name = f"{track}, whole {whole:.2f} m/km" if several else f"whole {whole:.2f} m/km"
        if not several:
            ax.stairs(values, edges, fill=True, color=colour, alpha=0.25)
        ax.stairs(values, edges, color=colour, linewidth=1.6, label=f"{track}" if several else None)
        ax.axhline(whole, color=colour, linewidth=1.0, linestyle="--", label=name)
    _shade_incomplete(ax, index)
    ax.set_xlim(edges[0], edges[-1])
    ax.set_ylim(0, 1.08 * max(float(index.segment_iri.max()), float(index.iri.max())))
    ax.set_xlabel("Distance along the path s [m]")
    ax.set_ylabel("IRI [m/km]")
    ax.grid(axis="y", color="0.9", linewidth=0.6)
    ax.set_axisbelow(True)
    canvas.annotate_axes(ax, f"segments of {float(edges[1] - edges[0]):g} m")
    canvas.legend_above(ax)
    return ax


def _shade_incomplete(ax: "Axes", index: xr.Dataset) -> None:
    if index.complete.all():
        return
    last = index.isel(segment=~index.complete.values)
    for start, end in zip(last.start.values, last.end.values, strict=True):
        ax.axvspan(
            start,
            end,
            facecolor="none",
            edgecolor="0.7",
            hatch="///",
            linewidth=0,
            label="shorter segment",
        )
