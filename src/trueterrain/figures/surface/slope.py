"""Maximum slope of a face that a scanner sees."""

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
    """Maximum visible slope of a face that falls away from the scanner, over the offset.

    A beam that hits the ground at an offset y from a laser at height h has the slope h / y. It
    grazes a face of that slope; a steeper face is in its own shadow (Figs. 3-13 and 3-14 of Smith,
    "Improving the Quality of Terrain Measurement", Virginia Tech, 2009). Faces that rise away from
    the scanner are visible up to the vertical and beyond.

    Parameters
    ----------
    height : float
        Height of the laser above the ground [m].
    half_width : float
        Maximum offset [m].
    found : mapping of str to (offset, angle), optional
        Measured limits by name: arrays of offsets [m] and angles [rad].
    ax : Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    Axes
        Offset, left positive [m], and limit of the angle of a face from level [deg].

    Raises
    ------
    ValueError
        If height or half width is not greater than 0.

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
    for number, (name, (position, angle)) in enumerate((found or {}).items(), start=1):
        ax.plot(
            np.asarray(position),
            np.rad2deg(np.asarray(angle)),
            "o",
            markersize=4,
            label=name,
            color=canvas.COLOURS[number % len(canvas.COLOURS)],
        )
    ax.set_ylim(min(40.0, float(limit.min()) - 5), 90.0)
    ax.set_xlabel("Offset from the scanner, left + [m]")
    ax.set_ylabel("Steepest visible face [deg]")
    ax.margins(x=0)
    canvas.draw_grid(ax)
    canvas.annotate_axes(ax, f"laser {height:g} m above the ground")
    canvas.legend_above(ax)
    return ax
