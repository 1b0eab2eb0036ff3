"""Agreement of profiles: overlay of filtered profiles, and the matrix of ratings."""

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from trueterrain.core.json_values import printable_text
from trueterrain.figures import canvas
from trueterrain.figures.names import draw_names

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MIN_RATING = 0.8  # at the low end of the colour scale, unless a pair is rated lower
_DARK = 0.6  # of the colour scale, below which numbers are white


def agreement_overlay(
    filtered: xr.Dataset, *, length: float | None = 60.0, ax: "Axes | None" = None
) -> "Axes":
    """Overlay of filtered profiles at their best shift.

    Parameters
    ----------
    filtered : xarray.Dataset
        Result of `trueterrain.roughness.agreement.filtered_profiles`.
    length : float, optional
        Length of the stretch that is drawn [m], the one in which the profiles differ most; None for
        the whole.
    ax : Axes, optional
        Where to draw; by default a new figure.

    Returns
    -------
    Axes
        Distance along the path [m] and slope [mm/m], or height [mm]; rating, shift and scale of
        each profile are in the legend.

    Raises
    ------
    ValueError
        If `length` is not greater than 0.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_profile
    >>> from trueterrain.roughness.agreement import filtered_profiles
    >>> s = np.arange(0.0, 100.0, 0.05)
    >>> both = {"R": make_profile(s, np.sin(s) / 90), "A": make_profile(s, np.sin(s - 0.2) / 90)}
    >>> ax = agreement_overlay(filtered_profiles(both))
    >>> ax.get_legend().get_texts()[1].get_text()
    'A: 100.0 %, shift 200 mm'
    """
    if length is not None and not length > 0:
        message = f"length must be greater than 0 m, got {length}"
        raise ValueError(message)
    first, last = (0, filtered.sizes["s"]) if length is None else _worst_stretch(filtered, length)
    shown = filtered.isel(s=slice(first, last))
    whole = shown.sizes["s"] == filtered.sizes["s"]
    ax = canvas.axes_or_new(ax, height=3.2)
    for number, name in enumerate(shown["profile"].values):
        one = shown.sel(profile=name)
        ax.plot(
            one["s"],
            one["filtered"],
            color=canvas.COLOURS[(number - 1) % len(canvas.COLOURS)],
            linewidth=2.2 if number == 0 else 1.0,
            alpha=0.45 if number == 0 else 1.0,
            label=f"{name}" if number == 0 else _profile_label(one),
        )
    slope = shown["filtered"].attrs["units"] == "m/m"
    unit, name = ("mm/m", "Filtered slope") if slope else ("mm", "Filtered height")
    canvas.scale_axis(ax.yaxis, canvas.LengthScale(factor=1000.0, unit=unit), name)
    ax.set_xlabel("Distance along the path s [m]")
    ax.margins(x=0)
    canvas.draw_grid(ax)
    canvas.annotate_axes(ax, "" if whole else f"{length:g} m in which they differ most")
    canvas.legend_above(ax, columns=2 if shown["scale"].any() else 3)
    return ax


def agreement_matrix(
    found: xr.Dataset, *, track: str | None = None, ax: "Axes | None" = None
) -> "Axes":
    """Matrix of the ratings of all pairs of profiles.

    Parameters
    ----------
    found : xarray.Dataset
        Result of `trueterrain.roughness.agreement.profile_agreement`.
    track : str, optional
        Name of the track; by default the first.
    ax : Axes, optional
        Where to draw; by default a new figure.

    Returns
    -------
    Axes
        One cell for each pair, with its rating [%]; the reference is marked by a star.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_profile
    >>> from trueterrain.roughness.agreement import profile_agreement
    >>> s = np.arange(0.0, 100.0, 0.05)
    >>> one, two = (make_profile(s, np.sin(s**1.2) / high) for high in (90, 100))
    >>> ax = agreement_matrix(profile_agreement({"1": one, "2": two}))
    >>> [text.get_text() for text in ax.texts][:2]
    ['', '90.0']
    """
    one = found.isel(track=0) if track is None else found.sel(track=track)
    rating = one["rating"].values
    count = rating.shape[0]
    reference = found.attrs.get("reference")
    names = [
        printable_text(f"{name} *" if name == reference else str(name))
        for name in one["first"].values
    ]
    side = float(np.clip(0.62 * count + 1.6, 3.4, 9.0))
    ax = canvas.axes_or_new(ax, width=side + 1.0, height=side)
    ratings = np.where(np.eye(count, dtype=bool), np.nan, rating)  # without the diagonal
    low = min(_MIN_RATING, float(np.nanmin(ratings)))
    image = ax.imshow(ratings, vmin=low, vmax=1.0, cmap=canvas.HEIGHT_MAP)
    for (row, column), value in np.ndenumerate(ratings):
        text = "" if np.isnan(value) else f"{100 * value:.1f}".replace("-", canvas.MINUS)
        bright = (value - low) / (1.0 - low) > _DARK
        ax.text(
            column,
            row,
            text,
            ha="center",
            va="center",
            color="black" if bright else "white",
            fontsize="small" if count > 6 else "medium",
        )
    ax.set_xticks(range(count), names, rotation=30 if max(map(len, names)) > 6 else 0)
    ax.set_yticks(range(count), names)
    draw_names([*ax.get_xticklabels(), *ax.get_yticklabels()])
    ax.tick_params(length=0)
    ax.spines[:].set_visible(False)
    canvas.colour_bar(image, ax, canvas.LengthScale(factor=100.0, unit="%"), "Rating")
    notes = f"track {one.track.item()}" if found.sizes["track"] > 1 else ""
    star = "" if reference is None else "* reference"
    canvas.annotate_axes(ax, ", ".join(text for text in (notes, star) if text))
    return ax


def _worst_stretch(filtered: xr.Dataset, length: float) -> tuple[int, int]:
    """Samples of the stretch in which the profiles differ most from the first one."""
    values = filtered["filtered"].values
    squares = np.nan_to_num((values[1:] - values[0]) ** 2).sum(axis=0)
    s = filtered["s"].values
    samples = round(length / (s[1] - s[0])) + 1
    if samples >= s.size:
        return 0, s.size
    sums = np.concatenate([[0.0], np.cumsum(squares)])
    first = int(np.argmax(sums[samples:] - sums[:-samples]))
    return first, first + samples


def _profile_label(one: xr.Dataset) -> str:
    shift = f"{1000 * float(one['best_shift']):.3g}".replace("-", canvas.MINUS)
    scale = float(one["scale"])
    percent = f"{round(100 * scale, 3) + 0.0:+.3f}".replace("-", canvas.MINUS)
    scaled = f", distance {percent} %" if scale else ""
    rating = f"{100 * float(one['rating']):.1f}".replace("-", canvas.MINUS)
    return f"{one.profile.item()}: {rating} %, shift {shift} mm{scaled}"
