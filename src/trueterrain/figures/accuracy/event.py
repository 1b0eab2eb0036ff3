"""Drawings of an excitation event: plan, side view, and the waves for which it is designed."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from trueterrain.figures import canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = npt.NDArray[np.float64]

_LUMBER, _BOARD, _GROUND = "#D9B382", "#EFE0C8", "0.35"
_TYRE = 0.18  # [m] width of the tyre tracks
_SIZES = ("number", "spacing", "width", "rise")


def event_plan(
    event: Mapping[str, Any], *, across: float = 2.5, track: float = 1.6, ax: "Axes | None" = None
) -> "Axes":
    """Dimensioned plan of an excitation event (as Fig. 3-10 of Smith 2009).

    Parameters
    ----------
    event : mapping
        ``number``, ``spacing``, ``width`` and ``rise`` [m] of the cleats; optional ``base`` and
        ``stagger`` [m], ``placement``: as by `trueterrain.verify.event.design.EventDesign.to_dict`.
    across : float
        Length of a cleat across the whole lane [m].
    track : float
        Distance between the wheels of an axle [m].
    ax : Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    Axes
        Along and across the lane [m], at equal scale.

    Raises
    ------
    ValueError
        If a size is missing or not greater than 0.

    Examples
    --------
    >>> ax = event_plan({"number": 5, "spacing": 0.488, "width": 0.17, "rise": 0.038})
    >>> len(ax.patches) - 2  # besides the tracks of the wheels
    5
    """
    number, spacing, width, _ = _event_sizes(event)
    ax = canvas.axes_or_new(ax, height=4.2)
    stagger, half = float(event.get("stagger", 0.0)), 0.5 * across
    placement = event.get("placement", "across")
    length = number * spacing
    for side in (-1, 1):
        _draw_box(
            ax,
            -0.25 * length,
            0.5 * side * track - 0.5 * _TYRE,
            1.5 * length + stagger,
            _TYRE,
            "0.92",
            zorder=0,
        )
    # parts of the lane: right edge, width, and longitudinal shift of the cleats [m]
    parts = [(-half, across, 0.0)]
    if placement != "across" or stagger:
        parts = [(0.0, half, 0.0)]
        if placement != "one side":
            parts.append((-half, half, stagger))
    for bottom, extent, shift in parts:
        if event.get("base", 0.0):
            _draw_box(ax, shift, bottom, length, extent, _BOARD)
        for centre in shift + (np.arange(number) + 0.5) * spacing:
            _draw_box(ax, centre - 0.5 * width, bottom, width, extent, _LUMBER)
    top, low = half, min(bottom for bottom, _, _ in parts)
    first = 0.5 * spacing
    _horizontal_dimension(ax, first, first + spacing, top + 0.18, f"a = {spacing:.3f} m")
    _horizontal_dimension(ax, 0.0, length, top + 0.5, f"{number} a = {length:.2f} m")
    _horizontal_dimension(
        ax, first - 0.5 * width, first + 0.5 * width, low - 0.2, f"w = {width:.3f} m", outside=True
    )
    if stagger:
        _horizontal_dimension(ax, 0.0, stagger, low - 0.55, f"{stagger:.2f} m behind")
    _vertical_dimension(
        ax, parts[0][0], parts[0][0] + parts[0][1], -0.12 * length, f"{parts[0][1]:.2f} m"
    )
    ax.annotate(
        "",
        (1.25 * length + stagger, 0.0),
        (1.05 * length + stagger, 0.0),
        arrowprops={"arrowstyle": "-|>", "color": "black"},
    )
    ax.set_aspect("equal")
    ax.set_xlim(-0.3 * length, 1.3 * length + stagger)
    ax.set_ylim(-half - 0.9, half + 0.95)
    ax.set_xlabel("Along the lane [m]")
    ax.set_ylabel("Across, left + [m]")
    canvas.annotate_axes(ax, f"from above; wheels {track:.2f} m apart; driven to the right")
    return ax


def event_side(event: Mapping[str, Any], *, ax: "Axes | None" = None) -> "Axes":
    """Dimensioned side view of an excitation event (as Fig. 3-10 of Smith 2009).

    Parameters
    ----------
    event : mapping
        As for `event_plan`.
    ax : Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    Axes
        Along the lane [m] and height [mm].

    Raises
    ------
    ValueError
        If a size is missing or not greater than 0.

    Examples
    --------
    >>> ax = event_side({"number": 5, "spacing": 0.488, "width": 0.17, "rise": 0.038})
    >>> [text.get_text() for text in ax.texts if "=" in text.get_text()]
    ['h = 38 mm', 'a = 0.488 m', 'a = 0.488 m']
    """
    number, spacing, width, rise = _event_sizes(event)
    base = float(event.get("base", 0.0))
    length = number * spacing
    ax = canvas.axes_or_new(ax, height=2.2)
    _draw_cleats(ax, event)
    centre = (number - 0.5) * spacing
    x = centre + 0.5 * width + 0.05 * length
    _vertical_dimension(ax, base, base + rise, x, f"h = {1000 * rise:.0f} mm", left=False)
    top = base + rise
    _horizontal_dimension(ax, 0.5 * spacing, 1.5 * spacing, top * 1.35, f"a = {spacing:.3f} m")
    _horizontal_dimension(ax, 1.5 * spacing, 2.5 * spacing, top * 1.35, f"a = {spacing:.3f} m")
    if base:
        _vertical_dimension(ax, 0.0, base, -0.06 * length, f"{1000 * base:.0f} mm")
    ax.set_xlim(-0.3 * length, 1.3 * length)
    ax.set_ylim(-0.3 * top, 2.0 * top)
    canvas.scale_axis(ax.yaxis, canvas.LengthScale(factor=1000.0, unit="mm"), "Height")
    ax.set_xlabel("Along the lane [m]")
    canvas.note_exaggeration(ax)
    return ax


def event_waves(event: Mapping[str, Any], *, ax: "Axes | None" = None) -> "Axes":
    """Event with its design waves: half a wave of the body mode, one wave of hop for each cleat.

    As Figs. 3-3 and 3-4 of Smith (2009), where the crests of hop are at the cleats; at resonance
    the response of a wheel actually lags by a quarter of a wave.

    Parameters
    ----------
    event : mapping
        As for `event_plan`.
    ax : Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    Axes
        Along the lane [m] and height [mm].

    Raises
    ------
    ValueError
        If a size is missing or not greater than 0.

    Examples
    --------
    >>> ax = event_waves({"number": 5, "spacing": 0.488, "width": 0.17, "rise": 0.038})
    >>> [line.get_label() for line in ax.lines if not line.get_label().startswith("_")]
    ['half a wave of the body, 2.44 m', 'waves of hop, 0.488 m']
    """
    number, spacing, _, rise = _event_sizes(event)
    base = float(event.get("base", 0.0))
    length = number * spacing
    ax = canvas.axes_or_new(ax, height=3.0)
    _draw_cleats(ax, event)
    x = np.linspace(0.0, length, 600)
    ax.plot(
        x,
        base + 2.5 * rise * np.sin(np.pi * x / length),
        color=canvas.COLOURS[0],
        label=f"half a wave of the body, {length:.2f} m",
    )
    ax.plot(
        x,
        base + 0.5 * rise - 0.5 * rise * np.cos(2 * np.pi * x / spacing),
        color=canvas.COLOURS[1],
        label=f"waves of hop, {spacing:.3f} m",
    )
    ax.set_xlim(-0.1 * length, 1.1 * length)
    ax.set_ylim(-0.3 * rise, base + 3.0 * rise)
    canvas.scale_axis(ax.yaxis, canvas.LengthScale(factor=1000.0, unit="mm"), "Height")
    ax.set_xlabel("Along the lane [m]")
    canvas.annotate_axes(ax, "amplitudes of the waves are not to scale")
    canvas.legend_above(ax)
    return ax


def cleat_crossing(
    width_ratio: float, gain: float, *, lag: float = 0.0, ax: "Axes | None" = None
) -> "Axes":
    """Wheel in hop over two cleats: derivation of the width of a cleat.

    The wheel moves by the gain times half the height of a cleat, around half that height. It
    touches both edges of the cleat if the width is acos(1 / gain) / pi of the spacing (the "line of
    oscillation" in section 3.3 of Smith 2009). At resonance the motion actually lags.

    Parameters
    ----------
    width_ratio : float
        Width of a cleat over the spacing [1].
    gain : float
        Amplitude of the wheel over that of the ground [1].
    lag : float
        Phase lag of the wheel in waves, a quarter at its resonance [1].
    ax : Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    Axes
        Position over the spacing, and height over that of a cleat [1].

    Raises
    ------
    ValueError
        If the width is not between 0 and 1, or the gain not greater than 0.

    Examples
    --------
    >>> ax = cleat_crossing(0.306, 1.7471, lag=0.25)
    >>> [line.get_label() for line in ax.lines if line.get_label()[0] != "_"]
    ['wheel in step', 'wheel as it lags']
    """
    if not (0 < width_ratio < 1 and gain > 0):
        message = (
            f"width_ratio must be between 0 and 1 and gain greater than 0, "
            f"got {width_ratio} and {gain}."
        )
        raise ValueError(message)
    ax = canvas.axes_or_new(ax, height=3.0)
    _draw_cleats(ax, {"number": 2, "spacing": 1.0, "width": width_ratio, "rise": 1.0})
    x = np.linspace(-0.1, 2.1, 800)
    for number, (delay, label) in enumerate(((0.0, "wheel in step"), (lag, "wheel as it lags"))):
        if number and not lag:
            continue
        ax.plot(
            x,
            0.5 - 0.5 * gain * np.cos(2 * np.pi * (x - delay)),
            color=canvas.COLOURS[number],
            linestyle="-" if number == 0 else "--",
            label=label,
        )
    ax.axhline(1.0, color="0.6", linewidth=0.8, linestyle=":")
    ax.set_xlim(-0.1, 2.1)
    ax.set_xlabel("Position over spacing, x / a [1]")
    ax.set_ylabel("Height over that of a cleat [1]")
    canvas.annotate_axes(ax, f"w / a = {width_ratio:.3f}, amplified {gain:.2f} times")
    canvas.legend_above(ax)
    return ax


def _event_sizes(event: Mapping[str, Any]) -> tuple[int, float, float, float]:
    for name in _SIZES:
        value = event.get(name)
        if value is None or not 0 < value < np.inf:
            message = f"event must hold {', '.join(_SIZES)}, each above 0; {name} is {value}."
            raise ValueError(message)
    spacing, width, rise = (float(event[name]) for name in _SIZES[1:])
    return int(event["number"]), spacing, width, rise


def _draw_cleats(ax: "Axes", event: Mapping[str, Any]) -> None:
    number, spacing, width, rise = _event_sizes(event)
    base = float(event.get("base", 0.0))
    ax.axhline(0.0, color=_GROUND, linewidth=1.2)
    if base:
        _draw_box(ax, 0.0, 0.0, number * spacing, base, _BOARD)
    for centre in (np.arange(number) + 0.5) * spacing:
        _draw_box(ax, centre - 0.5 * width, base, width, rise, _LUMBER)


def _draw_box(
    ax: "Axes", x: float, y: float, width: float, height: float, colour: str, zorder: float = 1
) -> None:
    from matplotlib.patches import Rectangle

    line = 0.8 if zorder else 0.0
    ax.add_patch(
        Rectangle(
            (x, y),
            width,
            height,
            facecolor=colour,
            edgecolor="black",
            linewidth=line,
            zorder=zorder,
        )
    )


def _horizontal_dimension(
    ax: "Axes", begin: float, end: float, y: float, text: str, *, outside: bool = False
) -> None:
    """Dimension along x; its text above it, or next to it if there is no space."""
    ax.annotate(
        "",
        (begin, y),
        (end, y),
        arrowprops={"arrowstyle": "<->", "linewidth": 0.8, "shrinkA": 0, "shrinkB": 0},
    )
    anchor, align = ((end, y), "left") if outside else ((0.5 * (begin + end), y), "center")
    ax.annotate(
        text,
        anchor,
        (4 if outside else 0, -3 if outside else 2),
        textcoords="offset points",
        ha=align,
        va="bottom",
        fontsize="small",
    )


def _vertical_dimension(
    ax: "Axes", begin: float, end: float, x: float, text: str, *, left: bool = True
) -> None:
    """Dimension along y; its text next to it."""
    ax.annotate(
        "",
        (x, begin),
        (x, end),
        arrowprops={"arrowstyle": "<->", "linewidth": 0.8, "shrinkA": 0, "shrinkB": 0},
    )
    ax.annotate(
        text,
        (x, 0.5 * (begin + end)),
        (-4 if left else 4, 0),
        textcoords="offset points",
        ha="right" if left else "left",
        va="center",
        fontsize="small",
        rotation=90 if left and end - begin > 1 else 0,
    )
