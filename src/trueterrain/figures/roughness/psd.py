"""Displacement spectra of roads with the classes of ISO 8608."""

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from trueterrain.figures import canvas
from trueterrain.roughness.iso8608 import CLASS_LIMITS, N0

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_CLASS_WAVINESS = 2.0  # with which the standard draws its classes
_LINES = 2000  # at most drawn of the unsmoothed spectrum
_BELOW = 0.2  # how far below the smoothed spectrum the unsmoothed one is shown


def road_spectrum(spectrum: xr.Dataset, *, ax: "Axes | None" = None) -> "Axes":
    """Smoothed spectrum of each track, its confidence interval and fit, and the road classes.

    Parameters
    ----------
    spectrum : xarray.Dataset
        Result of `trueterrain.roughness.psd`.
    ax : Axes, optional
        Where to draw; by default a new figure.

    Returns
    -------
    Axes
        Spatial frequency [1/m] and displacement spectrum [m³], both logarithmic; class, Gd(n0) and
        waviness of each track are in the legend. Grey lines are the limits of the classes.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_profile
    >>> from trueterrain.roughness import psd
    >>> heights = np.cumsum(np.random.default_rng(1).standard_normal(5000)) * 1e-3
    >>> road_spectrum(psd(make_profile(0.1 * np.arange(5000), heights))).get_xscale()
    'log'
    """
    ax = canvas.axes_or_new(ax, height=4.4)
    several = spectrum.sizes["track"] > 1
    centre = spectrum["centre"].values
    for number, track in enumerate(spectrum["track"].values):
        colour = canvas.COLOURS[number % len(canvas.COLOURS)]
        one = spectrum.sel(track=track)
        n, density = _thin_lines(spectrum["n"].values, one["density"].values)
        ax.plot(n, density, color=colour, alpha=0.25, linewidth=0.5)
        ax.fill_between(
            centre, one["smoothed_low"], one["smoothed_high"], color=colour, alpha=0.25, linewidth=0
        )
        text = (
            f"class {one['road_class'].item()}, "
            f"Gd(n0) {1e6 * one['gd_n0'].item():.3g}·10⁻⁶ m³, w {one['waviness'].item():.2f}"
        )
        ax.plot(
            centre,
            one["smoothed"],
            color=colour,
            linewidth=1.5,
            label=f"{track}: {text}" if several else text,
        )
        used = centre[spectrum["fitted"].values][[0, -1]]
        fit = one["gd_n0"].item() * (used / N0) ** -one["waviness"].item()
        ax.plot(used, fit, color="black", linewidth=1.0, linestyle="--")
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_xlim(spectrum["lower"].values[0], spectrum["upper"].values[-1])
    smoothed = spectrum["smoothed_low"].values
    ax.set_ylim(_BELOW * smoothed[smoothed > 0].min(), 2 * spectrum["smoothed_high"].values.max())
    _draw_classes(ax)
    ax.set_xlabel("Spatial frequency n [1/m]")
    ax.set_ylabel("Displacement spectrum Gd [m³]")
    ax.grid(which="major", color="0.92", linewidth=0.6)
    ax.set_axisbelow(True)
    canvas.annotate_axes(
        ax, "smoothed as in ISO 8608; band: confidence; dashed: fit; grey: classes"
    )
    canvas.legend_above(ax, columns=1)
    return ax


def _draw_classes(ax: "Axes") -> None:
    """Draw the limits of the classes, and their letters at the right edge."""
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    ends = np.array([left, right])
    fall = (ends / N0) ** -_CLASS_WAVINESS
    letter_at = right * (left / right) ** 0.02
    for name, (_, mean, upper) in CLASS_LIMITS.items():
        if np.isfinite(upper):
            ax.plot(ends, upper * fall, color="0.6", linewidth=0.7, zorder=0.5)
        height = mean * (letter_at / N0) ** -_CLASS_WAVINESS
        if bottom < height < top:
            ax.text(letter_at, height, name, color="0.45", ha="center", va="center")


def _thin_lines(n: np.ndarray, density: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Select lines evenly over the decades, since a figure cannot resolve millions of them."""
    if n.size <= _LINES:
        return n, density
    kept = np.unique(np.geomspace(1, n.size, _LINES).astype(int) - 1)
    return n[kept], density[kept]
