"""Point profiles parallel to a path and the tyre profile (as thesis Fig. 5-6)."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import xarray as xr

from trueterrain.core.schemas import check_profile
from trueterrain.figures import canvas
from trueterrain.figures.profile.profiles import draw_profile, label_profile_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LINES_MAP = "Blues"


def parallel_profiles(
    lines: Mapping[float, xr.Dataset], tyre: xr.Dataset, *, ax: "Axes | None" = None
) -> "Axes":
    """Point profiles at several lateral offsets, and the tyre profile.

    Parameters
    ----------
    lines : mapping of float to xarray.Dataset
        Point profiles and their offsets from the path, left positive [m].
    tyre : xarray.Dataset
        Tyre profile.
    ax : Axes, optional
        Where to draw; by default a new figure.

    Returns
    -------
    Axes
        Distance along the path and height, both in metres; the vertical exaggeration is printed.

    Raises
    ------
    ValueError
        If there are no lines.
    SchemaError
        If the data are no profiles.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_profile
    >>> line = make_profile([0.0, 1.0, 2.0], [0.0, 0.01, 0.0])
    >>> len(parallel_profiles({-0.01: line, 0.01: line}, line).lines)
    3
    """
    if not lines:
        message = "lines must hold at least one point profile, got none."
        raise ValueError(message)
    import matplotlib as mpl

    ax = canvas.axes_or_new(ax)
    offsets = sorted(lines)
    shades = mpl.colormaps[_LINES_MAP]
    for number, offset in enumerate(offsets):
        shade = shades(0.35 + 0.5 * number / max(len(offsets) - 1, 1))
        line = check_profile(lines[offset])
        name = f"offset {1000 * offset:+.0f} mm" if offset else "on the path"
        name = name.replace("-", canvas.MINUS)
        ax.plot(line.s, line.height, color=shade, linewidth=0.9, label=name)
    draw_profile(ax, check_profile(tyre).drop_vars("sd", errors="ignore"), "tyre", "#D55E00", 2.0)
    label_profile_axes(ax, *[line.height for line in lines.values()], tyre.height)
    canvas.legend_above(ax, columns=3)
    return ax
