"""Evenness: deviation of the ground from a rolling straightedge."""

from typing import TYPE_CHECKING

import xarray as xr

from trueterrain.core.provenance import provenance_steps
from trueterrain.figures import canvas
from trueterrain.roughness.stretches import find_stretches

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def straightedge_deviation(
    beam: xr.Dataset, *, threshold: float | None = None, ax: "Axes | None" = None
) -> "Axes":
    """Deviation of the ground from a rolling straightedge, with rings at peaks beyond a threshold.

    Parameters
    ----------
    beam : xarray.Dataset
        Result of `trueterrain.roughness.rolling_straightedge`.
    threshold : float, optional
        Largest permitted deviation, above or below [m].
    ax : Axes, optional
        Where to draw; by default a new figure.

    Returns
    -------
    Axes
        Midpoint of the straightedge and deviation, both in metres; a ring is at the peak of each
        stretch beyond the threshold.

    Examples
    --------
    >>> import numpy as np
    >>> from trueterrain.core.schemas import make_profile
    >>> from trueterrain.roughness import rolling_straightedge
    >>> s = np.arange(0.0, 50.0, 0.05)
    >>> bump = make_profile(s, 0.006 * np.exp(-((s - 25.0) ** 2)))
    >>> ax = straightedge_deviation(rolling_straightedge(bump), threshold=0.004)
    >>> [text.get_text() for text in ax.get_legend().get_texts()]
    ['beyond 4 mm']
    """
    ax = canvas.axes_or_new(ax, height=3.0)
    several = beam.sizes["track"] > 1
    for number, track in enumerate(beam["track"].values):
        colour = canvas.COLOURS[number % len(canvas.COLOURS)]
        values = beam["deviation"].sel(track=track)
        name = f"{track}" if several else None
        ax.plot(beam["s"], values, color=colour, linewidth=0.9, label=name)
    ax.axhline(0.0, color="0.3", linewidth=0.6)
    largest = float(abs(beam["deviation"]).max())
    if threshold is not None:
        _draw_threshold(ax, beam, threshold)
        largest = max(largest, threshold)
    midpoint = beam["s"].values
    ax.set_xlim(midpoint[0], midpoint[-1] if midpoint.size > 1 else midpoint[0] + 1.0)
    ax.set_ylim(-1.1 * largest or -1e-3, 1.1 * largest or 1e-3)
    ax.set_xlabel("Midpoint of the straightedge s [m]")
    canvas.scale_axis(ax.yaxis, canvas.LengthScale(factor=1000.0, unit="mm"), "Ground above it")
    canvas.draw_grid(ax, "y")
    canvas.annotate_axes(
        ax,
        f"straightedge of {provenance_steps(beam)[-1]['parameters']['length']:g} m on two wheels",
    )
    canvas.legend_above(ax)
    return ax


def _draw_threshold(ax: "Axes", beam: xr.Dataset, threshold: float) -> None:
    """Draw limits on both sides, and a ring at the peak of each stretch beyond them."""
    for limit in (-threshold, threshold):
        ax.axhline(limit, color="0.3", linewidth=1.0, linestyle="--")
    found = find_stretches(abs(beam["deviation"]), threshold)
    if found.sizes["stretch"] == 0:
        return
    peaks = beam["deviation"].sel(track=found["track"], s=found["peak_at"])
    ax.plot(
        found["peak_at"],
        peaks,
        "o",
        color="black",
        markerfacecolor="none",
        markersize=6,
        markeredgewidth=0.9,
        label=f"beyond {1000.0 * threshold:.4g} mm",
    )
