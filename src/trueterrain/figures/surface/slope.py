"""The steepest slope across a scan that can be seen."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from trueterrain.figures import canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def measurable_slope(
    height: float = 2.0,
    half_width: float = 2.0,
    *,
    found: Mapping[str, tuple[npt.ArrayLike, npt.ArrayLike]] | None = None,
    ax: "Axes | None" = None,
) -> "Axes":
    """Steepest face falling away from the scanner that it sees, over the offset from it.

    A beam that comes down at an offset y from a laser at height h has the slope h / y: it glances
    off a face of that slope, and a steeper one is in its own shadow (Figs. 3-13 and 3-14 of Smith,
    "Improving the Quality of Terrain Measurement", Virginia Tech, 2009). Faces that rise away from
    the scanner are seen up to the vertical and beyond.

    Parameters
    ----------
    height : float
        Height of the laser above the ground [m].
    half_width : float
        Largest offset [m].
    found : mapping of str to (offset, angle), optional
        Limits found in measurements: offsets [m] and angles [rad], each an array.
    ax : Axes, optional
        Where to draw; by default a new figure.

    Returns
    -------
    Axes
        Offset, left positive [m], and limit of the angle of a face from level [deg].

    Raises
    ------
    ValueError
        If height or half width are not greater than 0.

    Examples
    --------
    >>> ax = measurable_slope(2.0)
    >>> offset, angle = ax.lines[0].get_data()
    >>> print(angle[[0, 200]])
    [45. 90.]
    """
    if not (height > 0 and half_width > 0):
        message = f"height and half_width must be greater than 0 m, got {height} and {half_width}."
        raise ValueError(message)
    offset = np.linspace(-half_width, half_width, 401)
    limit = np.rad2deg(np.arctan2(height, np.abs(offset)))
    ax = canvas.axes_or_new(ax, height=3.2)
    line = ax.plot(offset, limit, color=canvas.COLOURS[0], linewidth=1.6, label="slope of the beam")
    ax.fill_between(
        offset,
        limit,
        90.0,
        color=canvas.HOLE_COLOUR,
        linewidth=0,
        label="not seen",
        zorder=line[0].get_zorder() - 1,
    )
    for number, (name, (where, angle)) in enumerate((found or {}).items(), start=1):
        ax.plot(
            np.asarray(where),
            np.rad2deg(np.asarray(angle)),
            "o",
            markersize=4,
            label=name,
            color=canvas.COLOURS[number % len(canvas.COLOURS)],
        )
    ax.set_ylim(min(40.0, float(limit.min()) - 5), 90.0)
    ax.set_xlabel("Offset from the scanner, left + [m]")
    ax.set_ylabel("Steepest face seen [deg]")
    ax.margins(x=0)
    ax.grid(color="0.9", linewidth=0.6)
    ax.set_axisbelow(True)
    canvas.annotate_axes(ax, f"laser {height:g} m above the ground")
    canvas.legend_above(ax)
    return ax
