"""Histogram of the International Roughness Index."""

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from trueterrain.figures import canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_BAR = 0.8  # width of the bars of a class, as a fraction of the class


def roughness_histogram(histogram: xr.Dataset, *, ax: "Axes | None" = None) -> "Axes":
    """Fraction of the length of each track in classes of roughness, as bars.

    Parameters
    ----------
    histogram : xarray.Dataset
        Result of `trueterrain.roughness.iri_histogram`.
    ax : Axes, optional
        Where to draw; by default a new figure.

    Returns
    -------
    Axes
        Classes of the index [m/km] and fraction of the length [%].

    Examples
    --------
    >>> from trueterrain.core.schemas import make_profile
    >>> from trueterrain.roughness import iri, iri_histogram
    >>> heights = np.cumsum(np.random.default_rng(1).standard_normal(5000)) * 5e-4
    >>> road = make_profile(0.1 * np.arange(5000), heights)
    >>> ax = roughness_histogram(iri_histogram(iri(road, segment=20.0), [1.0, 2.0, 3.0]))
    >>> [tick.get_text() for tick in ax.get_xticklabels()]
    ['< 1', '1–2', '2–3', '> 3']
    """
    ax = canvas.axes_or_new(ax, height=3.0)
    count = histogram.sizes["track"]
    place = np.arange(histogram.sizes["class"])
    width = _BAR / count
    for number, track in enumerate(histogram["track"].values):
        ax.bar(
            place + (number - 0.5 * (count - 1)) * width,
            100 * histogram["fraction"].sel(track=track).values,
            width,
            color=canvas.COLOURS[number % len(canvas.COLOURS)],
            label=f"{track}" if count > 1 else None,
        )
    edges = zip(histogram["above"].values, histogram["below"].values, strict=True)
    ax.set_xticks(place, [_class_name(above, below) for above, below in edges])
    ax.set_xlabel("IRI [m/km]")
    ax.set_ylabel("Fraction of the length [%]")
    canvas.draw_grid(ax, "y")
    canvas.legend_above(ax, notes=False)
    return ax


def _class_name(above: float, below: float) -> str:
    if above == 0:
        return f"< {below:.3g}"
    return f"> {above:.3g}" if np.isinf(below) else f"{above:.3g}–{below:.3g}"
