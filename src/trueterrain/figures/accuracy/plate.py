"""Drawings of a calibration plate, and its view from the scanner."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from trueterrain.figures import canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_METAL, _PLATE = "#9FB4C7", "0.9"


def plate_plan(
    cleats: Mapping[str, tuple[float, float]],
    *,
    length: float,
    width: float,
    holes: tuple[npt.ArrayLike, npt.ArrayLike],
    bands: Sequence[tuple[str, float]] = (),
    ax: "Axes | None" = None,
) -> "Axes":
    """Dimensioned plan of a calibration plate.

    Parameters
    ----------
    cleats : mapping of str to (begin, end)
        Start and end of each cleat along the profile, from the left end [m].
    length, width : float
        Extent of the plate along and across the profile [m].
    holes : (along, across)
        Rows of holes, from the centre of the plate [m].
    bands : sequence of (name, reflectivity)
        Bands of surface across the profile; reflectivity from 0 to 1.
    ax : Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    Axes
        Along and across the profile [m], at equal scale.

    Raises
    ------
    ValueError
        If the size is not greater than 0.

    Examples
    --------
    >>> ax = plate_plan({"rectangle": (0.1, 0.176)}, length=1.2, width=1.2,
    ...                 holes=([-0.152, 0.0, 0.152], [0.0]))
    >>> len(ax.collections[-1].get_offsets())
    3
    """
    from matplotlib.patches import Rectangle

    if not (length > 0 and width > 0):
        message = f"length and width must be greater than 0 m, got {length} and {width}."
        raise ValueError(message)
    ax = canvas.axes_or_new(ax, height=6.0)
    surfaces = list(bands) or [("", 0.9)]
    strip = width / len(surfaces)
    for number, (name, bright) in enumerate(surfaces):
        bottom = number * strip
        grey = str(0.25 + 0.7 * bright)
        ax.add_patch(Rectangle((0, bottom), length, strip, facecolor=grey, edgecolor="none"))
        if name:
            ax.annotate(
                f"{name}, {100 * bright:.0f} %",
                (length, bottom + 0.5 * strip),
                (5, 0),
                textcoords="offset points",
                va="center",
                fontsize="small",
                rotation=90,
            )
    ax.add_patch(Rectangle((0, 0), length, width, fill=False, linewidth=1.2))
    along, across = (np.asarray(rows, dtype=float) for rows in holes)
    # names are centred between two rows of holes
    shift = 0.5 * (across[1] - across[0]) if across.size > 1 else 0.0
    for name, (begin, end) in cleats.items():
        ax.add_patch(
            Rectangle(
                (begin, 0),
                end - begin,
                width,
                facecolor=_METAL,
                edgecolor="black",
                linewidth=0.8,
                alpha=0.75,
            )
        )
        ax.annotate(
            name,
            (0.5 * (begin + end), 0.5 * width + shift),
            ha="center",
            va="center",
            rotation=90,
            fontsize="small",
        )
    x, y = np.meshgrid(along + 0.5 * length, across + 0.5 * width)
    ax.scatter(x.ravel(), y.ravel(), s=7, facecolor="white", edgecolor="black", linewidth=0.7)
    if along.size > 1:
        _horizontal_dimension(
            ax, x[0, 0], x[0, 1], -0.05 * width, f"{1000 * (along[1] - along[0]):.0f} mm"
        )
    _horizontal_dimension(ax, 0.0, length, -0.13 * width, f"{1000 * length:.0f} mm")
    _vertical_dimension(ax, 0.0, width, -0.06 * length, f"{1000 * width:.0f} mm")
    ax.set_xlim(-0.16 * length, 1.1 * length)
    ax.set_ylim(-0.2 * width, 1.05 * width)
    ax.set_aspect("equal")
    ax.set_xlabel("Along the profile [m]")
    ax.set_ylabel("Across the profile [m]")
    canvas.annotate_axes(ax, f"from above; {along.size} x {across.size} holes")
    return ax


def plate_section(
    s: npt.ArrayLike,
    height: npt.ArrayLike,
    *,
    thickness: float,
    cleats: Mapping[str, tuple[float, float]],
    ax: "Axes | None" = None,
) -> "Axes":
    r"""Dimensioned section of a calibration plate along its profile.

    Parameters
    ----------
    s, height : array_like, shape (n,)
        Machined profile: distance from the left end, and height above the ground [m].
    thickness : float
        Thickness of the plate [m].
    cleats : mapping of str to (begin, end)
        Start and end of each cleat along the profile [m].
    ax : Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    Axes
        Along the profile [m] and height [mm].

    Raises
    ------
    ValueError
        If the profile is not two arrays of one length.

    Examples
    --------
    >>> ax = plate_section([0.0, 0.1, 0.2], [0.012, 0.05, 0.012], thickness=0.012,
    ...                    cleats={"triangle": (0.0, 0.2)})
    >>> ax.texts[0].get_text()
    'triangle\n200 x 38 mm'
    """
    x, z = _profile_arrays(s, height)
    ax = canvas.axes_or_new(ax, height=2.4)
    ax.fill_between(x, np.minimum(z, thickness), color=_PLATE, linewidth=0)
    ax.fill_between(x, thickness, z, where=z > thickness, color=_METAL, linewidth=0)
    outline = np.column_stack([np.r_[x[0], x, x[-1]], np.r_[0.0, z, 0.0]])
    ax.plot(*outline.T, color="black", linewidth=1.0)
    ax.axhline(0.0, color="0.35", linewidth=1.0)
    top = float(z.max())
    for name, (begin, end) in cleats.items():
        inside = (x >= begin) & (x <= end)
        rise = float(z[inside].max()) - thickness if inside.any() else 0.0
        ax.annotate(
            f"{name}\n{1000 * (end - begin):.0f} x {1000 * rise:.0f} mm",
            (0.5 * (begin + end), thickness + rise),
            (0, 4),
            textcoords="offset points",
            ha="center",
            va="bottom",
            fontsize="small",
        )
    ax.set_ylim(-0.1 * top, 2.0 * top)
    ax.margins(x=0.03)
    canvas.scale_axis(ax.yaxis, canvas.LengthScale(factor=1000.0, unit="mm"), "Height")
    ax.set_xlabel("Along the profile [m]")
    canvas.note_exaggeration(ax)
    return ax


def plate_view(
    s: npt.ArrayLike,
    height: npt.ArrayLike,
    *,
    returns: tuple[npt.ArrayLike, npt.ArrayLike],
    shadows: Sequence[tuple[float, float]] = (),
    ax: "Axes | None" = None,
) -> "Axes":
    """View of a calibration plate from the scanner: returns and shadows.

    Parameters
    ----------
    s, height : array_like, shape (n,)
        Machined profile [m].
    returns : (s, height)
        Points at which beams hit it [m].
    shadows : sequence of (begin, end)
        Stretches in shadow [m].
    ax : Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    Axes
        Along the profile [m] and height [mm].

    Raises
    ------
    ValueError
        If the profile or the returns are not two arrays of one length.

    Examples
    --------
    >>> ax = plate_view([0.0, 1.0], [0.012, 0.012], returns=([0.2, 0.4], [0.012, 0.012]),
    ...                 shadows=[(0.5, 0.6)])
    >>> [line.get_label() for line in ax.lines]
    ['machined profile', '2 returns']
    """
    x, z = _profile_arrays(s, height)
    return_s, return_height = _profile_arrays(*returns)
    ax = canvas.axes_or_new(ax, height=2.6)
    for number, (begin, end) in enumerate(shadows):
        label = "shadow" if number == 0 else None
        ax.axvspan(begin, end, color=canvas.HOLE_COLOUR, linewidth=0, label=label)
    ax.plot(x, z, color="0.45", linewidth=1.0, label="machined profile")
    ax.plot(
        return_s,
        return_height,
        ".",
        color=canvas.COLOURS[1],
        markersize=2.5,
        linestyle="none",
        label=f"{return_s.size} returns",
    )
    ax.set_ylim(0.0, 1.25 * float(z.max()))
    ax.margins(x=0.01)
    canvas.scale_axis(ax.yaxis, canvas.LengthScale(factor=1000.0, unit="mm"), "Height")
    ax.set_xlabel("Along the profile [m]")
    canvas.note_exaggeration(ax)
    canvas.legend_above(ax)
    return ax


def _profile_arrays(x: npt.ArrayLike, y: npt.ArrayLike) -> tuple[Any, Any]:
    first, second = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    if first.ndim != 1 or first.shape != second.shape or not first.size:
        message = f"a profile must be two arrays of one length, got {first.shape}, {second.shape}."
        raise ValueError(message)
    return first, second


def _horizontal_dimension(ax: "Axes", begin: float, end: float, y: float, text: str) -> None:
    _draw_arrow(ax, (begin, y), (end, y))
    ax.annotate(
        text,
        (0.5 * (begin + end), y),
        (0, -2),
        textcoords="offset points",
        ha="center",
        va="top",
        fontsize="small",
    )


def _vertical_dimension(ax: "Axes", begin: float, end: float, x: float, text: str) -> None:
    _draw_arrow(ax, (x, begin), (x, end))
    ax.annotate(
        text,
        (x, 0.5 * (begin + end)),
        (-3, 0),
        textcoords="offset points",
        ha="right",
        va="center",
        fontsize="small",
        rotation=90,
    )


def _draw_arrow(ax: "Axes", begin: tuple[float, float], end: tuple[float, float]) -> None:
    style = {"arrowstyle": "<->", "linewidth": 0.8, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", begin, end, arrowprops=style)
