"""Evenness: deviation from a rolling straightedge, and RMS in bands of wavelength."""

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from trueterrain.core.provenance import provenance_steps
from trueterrain.figures import canvas
from trueterrain.roughness.stretches import find_stretches

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_STYLES = ("-", "--", ":", "-.")  # of tracks; bands differ by colour


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
    ax.grid(axis="y", color="0.9", linewidth=0.6)
    ax.set_axisbelow(True)
    canvas.annotate_axes(
        ax,
        f"straightedge of {provenance_steps(beam)[-1]['parameters']['length']:g} m on two wheels",
    )
    canvas.legend_above(ax)
    return ax


def waveband_segments(rated: xr.Dataset, *, ax: "Axes | None" = None) -> "Axes":
    """Root mean square of each band in each segment, as steps.

    Parameters
    ----------
    rated : xarray.Dataset
        Result of `trueterrain.roughness.waveband_rms` with a segment length.
    ax : Axes, optional
        Where to draw; by default a new figure.

    Returns
    -------
    Axes
        Distance along the path and RMS, both in metres; bands differ by colour, tracks by the style
        of the line.

    Raises
    ------
    ValueError
        If there are no segments.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_profile
    >>> from trueterrain.roughness import waveband_rms
    >>> s = np.arange(0.0, 300.0, 0.1)
    >>> road = make_profile(s, 0.005 * np.sin(2 * np.pi * s / 5))
    >>> waveband_segments(waveband_rms(road, segment=100.0)).get_ylabel()
    'RMS [mm]'
    """
    if "segment_rms" not in rated:
        message = "rated must hold segments: call waveband_rms(profile, segment=...), got none."
        raise ValueError(message)
    ax = canvas.axes_or_new(ax, height=3.0)
    edges = np.append(rated["start"].values, rated["end"].values[-1:])
    several = rated.sizes["track"] > 1
    for number, band in enumerate(rated["band"].values):
        for row, track in enumerate(rated["track"].values):  # the rows of the legend
            one = rated.sel(track=track, band=band)
            label = f"{band}, {track}" if several else f"{band}"
            ax.stairs(
                one["segment_rms"].values,
                edges,
                baseline=None,
                linewidth=1.6,
                label=label,
                color=canvas.COLOURS[number % len(canvas.COLOURS)],
                linestyle=_STYLES[row % len(_STYLES)],
            )
    highest = float(rated["segment_rms"].max())
    ax.set_xlim(edges[0], edges[-1])
    ax.set_ylim(0, 1.08 * highest or 1e-3)
    ax.set_xlabel("Distance along the path s [m]")
    canvas.scale_axis(ax.yaxis, canvas.LengthScale(factor=1000.0, unit="mm"), "RMS")
    ax.grid(axis="y", color="0.9", linewidth=0.6)
    ax.set_axisbelow(True)
    canvas.annotate_axes(ax, f"bands of wavelength, segments of {float(edges[1] - edges[0]):g} m")
    canvas.legend_above(ax, columns=rated.sizes["band"])
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
