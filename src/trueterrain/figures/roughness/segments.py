"""Roughness of segments as steps: IRI, Ride Number, and RMS by band of wavelength."""

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.figures import canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_RIDE_NUMBERS = (0.0, 5.0)  # from impassable to perfect
_STYLES = ("-", "--", ":", "-.")  # of tracks; bands differ by colour


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
    edges = _segment_edges(index)
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
    ax.set_ylim(0, 1.08 * max(float(index.segment_iri.max()), float(index.iri.max())))
    ax.set_ylabel("IRI [m/km]")
    return _frame_segments(ax, edges, "segments of {:g} m")


def ride_number_segments(rated: xr.Dataset, *, ax: "Axes | None" = None) -> "Axes":
    """Ride Number of each segment as steps, with that of the whole profile.

    Parameters
    ----------
    rated : xarray.Dataset
        Result of `trueterrain.roughness.ride_number` with a segment length.
    ax : Axes, optional
        Where to draw; by default a new figure.

    Returns
    -------
    Axes
        Distance along the path [m] and Ride Number, from 0 to 5; that of the whole is in the
        legend.

    Raises
    ------
    ValueError
        If there are no segments.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_profile
    >>> from trueterrain.roughness import ride_number
    >>> s = np.arange(0.0, 60.0, 0.1)
    >>> road = make_profile(s, 0.001 * np.sin(2 * np.pi * s / 5))
    >>> ride_number_segments(ride_number(road, segment=20.0)).get_ylabel()
    'Ride Number'
    """
    if "segment_rn" not in rated:
        message = "rated must hold segments: call ride_number(profile, segment=...), got none."
        raise ValueError(message)
    ax = canvas.axes_or_new(ax, height=3.0)
    edges = _segment_edges(rated)
    several = rated.sizes["track"] > 1
    for number, track in enumerate(rated["track"].values):
        colour = canvas.COLOURS[number % len(canvas.COLOURS)]
        one = rated.sel(track=track)
        name = f"{track}, " if several else ""
        ax.stairs(one["segment_rn"].values, edges, color=colour, linewidth=1.6, baseline=None)
        whole = one["rn"].item()
        ax.axhline(
            whole, color=colour, linewidth=1.0, linestyle="--", label=f"{name}whole {whole:.2f}"
        )
    ax.set_ylim(*_RIDE_NUMBERS)
    ax.set_ylabel("Ride Number")
    return _frame_segments(ax, edges, "segments of {:g} m; 5 is perfectly smooth")


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
    edges = _segment_edges(rated)
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
    ax.set_ylim(0, 1.08 * highest or 1e-3)
    canvas.scale_axis(ax.yaxis, canvas.LengthScale(factor=1000.0, unit="mm"), "RMS")
    note = "bands of wavelength, segments of {:g} m"
    return _frame_segments(ax, edges, note, columns=rated.sizes["band"])


def _segment_edges(rated: xr.Dataset) -> npt.NDArray[Any]:
    """Starts of the segments and the end of the last one [m]."""
    return np.append(rated["start"].values, rated["end"].values[-1:])


def _frame_segments(ax: "Axes", edges: npt.NDArray[Any], note: str, *, columns: int = 4) -> "Axes":
    """Scale, label and legend of axes over segments; the note states their length."""
    ax.set_xlim(edges[0], edges[-1])
    ax.set_xlabel("Distance along the path s [m]")
    canvas.draw_grid(ax, "y")
    canvas.annotate_axes(ax, note.format(float(edges[1] - edges[0])))
    canvas.legend_above(ax, columns)
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
