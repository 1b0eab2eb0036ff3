"""Curves behind the design of excitation events: gains, cleat widths, energies of modes."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from trueterrain.figures import canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Curves by name: x and y, arrays of one length.
Curves = Mapping[str, tuple[npt.ArrayLike, npt.ArrayLike]]

_STYLES = ("-", "--", "-.", ":")


def vehicle_gain(
    gains: Curves, *, modes: Mapping[str, float] | None = None, ax: "Axes | None" = None
) -> "Axes":
    """Gain from ground to body and wheel over frequency.

    Parameters
    ----------
    gains : mapping of str to (frequency, gain)
        Frequencies [Hz] and amplitude ratios [m/m] by name.
    modes : mapping of str to float, optional
        Frequencies of modes to mark [Hz].
    ax : Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    Axes
        Frequency [Hz] and amplitude ratio [1], both logarithmic.

    Raises
    ------
    ValueError
        If there is no curve, or the arrays of a curve differ in shape.

    Examples
    --------
    >>> from trueterrain.vehicle import GOLDEN_QUARTER_CAR, frequency_response, linear_model
    >>> f = np.geomspace(0.3, 30, 200)
    >>> gain = abs(frequency_response(linear_model(GOLDEN_QUARTER_CAR), f))[:, :, 0]
    >>> ax = vehicle_gain({"body": (f, gain[:, 0]), "wheel": (f, gain[:, 1])}, modes={"ride": 1.2})
    >>> ax.texts[0].get_text()
    'ride 1.2 Hz'
    """
    ax = _draw_curves(gains, ax, height=3.4)
    for name, frequency in (modes or {}).items():
        ax.axvline(frequency, color="0.5", linewidth=0.9, linestyle=":")
        ax.annotate(
            f"{name} {frequency:.3g} Hz",
            (frequency, 0.03),
            xycoords=("data", "axes fraction"),
            xytext=(3, 0),
            textcoords="offset points",
            fontsize="small",
            color="0.35",
        )
    ax.set_xscale("log")
    ax.set_yscale("log")
    canvas.plain_log_axis(ax.xaxis)
    ax.set_xlabel("Frequency [Hz]")
    ax.set_ylabel("Motion over that of the ground [1]")
    canvas.legend_above(ax, notes=False)
    return ax


def hop_gain(
    gains: Curves,
    *,
    peaks: Mapping[str, tuple[float, float]] | None = None,
    ax: "Axes | None" = None,
) -> "Axes":
    """Gain from ground to wheel near wheel hop (as Fig. 3-5 of Smith 2009).

    Parameters
    ----------
    gains : mapping of str to (ratio, gain)
        Frequencies over that of wheel hop, and amplitude ratios, by name [1].
    peaks : mapping of str to (ratio, gain), optional
        Points to mark [1].
    ax : Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    Axes
        Frequency ratio and amplitude ratio [1].

    Raises
    ------
    ValueError
        If there is no curve, or the arrays of a curve differ in shape.

    Examples
    --------
    >>> from trueterrain.verify.event.design import hop_transmissibility
    >>> r = np.linspace(0, 2, 101)
    >>> ax = hop_gain({"damping 0.3": (r, hop_transmissibility(r, 0.3))})
    >>> print(ax.lines[0].get_ydata()[50])
    1.667
    """
    ax = _draw_curves(gains, ax, height=3.4)
    for name, (ratio, gain) in (peaks or {}).items():
        ax.plot(ratio, gain, "o", color="black", markersize=4, zorder=4)
        ax.annotate(
            f"{name} ({ratio:.3f}, {gain:.3f})",
            (ratio, gain),
            (6, 4),
            textcoords="offset points",
            fontsize="small",
        )
    ax.axhline(1.0, color="0.6", linewidth=0.8, linestyle=":")
    ax.set_ylim(bottom=0.0)
    ax.margins(x=0)
    ax.set_xlabel("Frequency of the ground over that of hop, r [1]")
    ax.set_ylabel("Motion over that of the ground, T [1]")
    canvas.legend_above(ax, columns=3, notes=False)
    return ax


def cleat_ratios(
    ratios: Curves,
    *,
    used: Mapping[str, tuple[float, float]] | None = None,
    ax: "Axes | None" = None,
) -> "Axes":
    """Ratio of cleat width to spacing over damping (as Fig. 3-6 of Smith 2009).

    Parameters
    ----------
    ratios : mapping of str to (damping, ratio)
        Damping ratios of hop and widths over spacing, by name [1].
    used : mapping of str to (damping, ratio), optional
        Points to mark [1].
    ax : Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    Axes
        Damping ratio and w / a [1].

    Raises
    ------
    ValueError
        If there is no curve, or the arrays of a curve differ in shape.

    Examples
    --------
    >>> ax = cleat_ratios({"thesis": ([0.2, 0.3], [0.40, 0.348])}, used={"thesis": (0.3, 0.348)})
    >>> ax.texts[0].get_text()
    'thesis 0.348'
    """
    ax = _draw_curves(ratios, ax, height=3.4)
    for name, (damping, ratio) in (used or {}).items():
        ax.plot(damping, ratio, "o", color="black", markersize=4, zorder=4)
        ax.annotate(
            f"{name} {ratio:.3f}",
            (damping, ratio),
            (6, 3),
            textcoords="offset points",
            fontsize="small",
        )
    ax.set_ylim(0.0, 0.5)
    ax.margins(x=0)
    ax.set_xlabel("Damping ratio of hop [1]")
    ax.set_ylabel("Width over spacing, w / a [1]")
    canvas.legend_above(ax, columns=2, notes=False)
    return ax


def passage_gains(
    gains: Curves,
    *,
    event: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
    speed: float,
    ax: "Axes | None" = None,
) -> "Axes":
    """Gains of heave, pitch and hop at a speed, and the spectrum of the event.

    Parameters
    ----------
    gains : mapping of str to (frequency, gain)
        Frequencies [Hz] and motion over that of the ground [m/m], by name.
    event : (frequency, spectrum), optional
        Amplitude spectrum of the event [m s]; drawn as an area at its own scale.
    speed : float
        Speed, for the note [m/s].
    ax : Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    Axes
        Frequency [Hz], logarithmic, and motion over that of the ground [1].

    Raises
    ------
    ValueError
        If there is no curve, or the arrays of a curve differ in shape.

    Examples
    --------
    >>> f = np.geomspace(0.3, 20, 50)
    >>> ax = passage_gains({"heave": (f, 1 / f)}, event=(f, f * 0 + 0.01), speed=5.0)
    >>> ax.get_xlabel()
    'Frequency [Hz]'
    """
    ax = _draw_curves(gains, ax, height=3.4)
    if event is not None:
        frequency, spectrum = (np.asarray(each, dtype=float) for each in event)
        top = max(float(np.max(line.get_ydata())) for line in ax.lines)
        ax.fill_between(
            frequency,
            top * spectrum / spectrum.max(),
            color=canvas.HOLE_COLOUR,
            linewidth=0,
            zorder=0,
            label=f"event, up to {1000 * spectrum.max():.2g} mm s",
        )
    ax.set_xscale("log")
    canvas.plain_log_axis(ax.xaxis)
    ax.set_ylim(bottom=0.0)
    ax.margins(x=0)
    ax.set_xlabel("Frequency [Hz]")
    ax.set_ylabel("Motion over that of the ground [1]")
    canvas.annotate_axes(ax, f"at {speed:.2f} m/s")
    canvas.legend_above(ax)
    return ax


def mode_energies(
    energies: Mapping[str, Mapping[str, float]], *, ax: "Axes | None" = None
) -> "Axes":
    """Fraction of the kinetic energy in each mode, for one or several events.

    Parameters
    ----------
    energies : mapping of str to mapping of str to float
        By event, the fraction of each mode from 0 to 1.
    ax : Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    Axes
        Fraction [%], a bar for each event.

    Raises
    ------
    ValueError
        If there is no event.

    Examples
    --------
    >>> ax = mode_energies({"printed": {"heave": 0.03, "pitch": 0.05, "hop": 0.92}})
    >>> len(ax.patches)
    3
    """
    if not energies:
        message = "energies must hold at least one event."
        raise ValueError(message)
    ax = canvas.axes_or_new(ax, height=1.3 + 0.35 * len(energies))
    names = list(dict.fromkeys(mode for each in energies.values() for mode in each))
    left = np.zeros(len(energies))
    for number, name in enumerate(names):
        width = 100 * np.array([each.get(name, 0.0) for each in energies.values()])
        ax.barh(
            list(energies),
            width,
            left=left,
            height=0.6,
            label=name,
            edgecolor="white",
            color=canvas.COLOURS[number % len(canvas.COLOURS)],
        )
        for row, value in enumerate(width):
            if value >= 4:
                ax.annotate(
                    f"{value:.0f}",
                    (left[row] + 0.5 * value, row),
                    ha="center",
                    va="center",
                    fontsize="small",
                    color="white",
                )
        left = left + width
    ax.invert_yaxis()
    ax.set_xlim(0, 100)
    ax.set_xlabel("Fraction of the kinetic energy [%]")
    canvas.legend_above(ax, columns=6, notes=False)
    return ax


def _draw_curves(curves: Curves, ax: "Axes | None", *, height: float) -> "Axes":
    if not curves:
        message = "there must be at least one curve."
        raise ValueError(message)
    ax = canvas.axes_or_new(ax, height=height)
    for number, (name, pair) in enumerate(curves.items()):
        x, y = (np.asarray(values, dtype=float) for values in pair)
        if x.ndim != 1 or x.shape != y.shape:
            message = (
                f"the curve {name!r} must be two arrays of one length, got {x.shape}, {y.shape}."
            )
            raise ValueError(message)
        ax.plot(
            x,
            y,
            color=canvas.COLOURS[number % len(canvas.COLOURS)],
            linewidth=1.5,
            label=name,
            linestyle=_STYLES[number % len(_STYLES)],
        )
    canvas.draw_grid(ax)
    return ax
