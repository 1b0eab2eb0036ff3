"""How stiff corrections were chosen to be, and which waves they hold."""

from collections.abc import Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from trueterrain.figures import canvas
from trueterrain.figures.alignment.correction import Along, as_corrections

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from trueterrain.alignment import Adjustment, ModelTrial, SplineCorrection

Floats = npt.NDArray[np.float64]

_CONSTANT = 10.0**-0.75  # of the least strength, where that of 0 is drawn
_MARKERS = "osD^vP"
_ORDERS = {"second": ("-", "smooth wandering"), "first": ("--", "rough wandering")}
_GREY = "0.35"  # of what holds for all colours
_PER_KNOT = 8  # samples from one knot to the next
_MOST = 1 << 20  # samples
_BEYOND = 8.0  # times the highest frequency that knots hold, up to which it is known what remains
_DECADES = 1e-8  # of the highest density, below which nothing is drawn
_BELOW = 1e-3  # of the density that remains
_LOWEST = 1e-30  # [m² s] density below which nothing is said


def strength_choice(
    adjustment: "Adjustment", *, along: Along = "time", ax: "Axes | None" = None
) -> "Axes":
    """How well cells held back are predicted, from corrections too stiff to such as are too loose.

    Parameters
    ----------
    adjustment : Adjustment
        With its trials.
    along : {"time", "station"}
        Whether knots are spaced in seconds or in metres.
    ax : Axes, optional
        Where to draw; by default a new figure.

    Returns
    -------
    Axes
        Strength, the standard deviation by which heights may wander [m], logarithmic but for 0,
        a constant; and root mean square of the differences of passes in cells held back [m].
        Colours tell the components apart, symbols the spacing of the knots, and dashes the rough
        Gauss-Markov process from the smooth one. Of trials that predict equally well, up to chance,
        the most likely one was taken, so the lowest point need not be that chosen. Trials of other
        iterations, in which cells weighed differently, do not compare and are only counted.

    Examples
    --------
    >>> from trueterrain.alignment import adjust, lane_cells
    >>> cell, time = np.arange(400), np.arange(400) * 0.1
    >>> found = adjust([
    ...     lane_cells(name, cell, time, up + np.sin(cell), variance=1e-6, easting=0.5 * cell)
    ...     for name, up in (("east", 0.005), ("west", -0.005))])
    >>> strength_choice(found).get_ylabel()
    'RMSE in cells held back [mm]'
    """
    ax = canvas.axes_or_new(ax, height=3.8)
    unit = "s" if along == "time" else "m"
    chosen = adjustment.chosen
    trials = sorted(
        (one for one in adjustment.trials if one.round == chosen.round), key=_trial_kind
    )
    zero = _CONSTANT * min((one.strength for one in trials if one.strength > 0), default=1e-3)
    looks = _TrialStyle(trials, unit)
    for kind, some in groupby(trials, key=_trial_kind):
        x, y = _best_of_each([*some])
        ax.plot(np.where(x > 0, x, zero), y, markersize=4.5, linewidth=1.1, **looks.of(*kind))
    looks.explain(ax)
    what = "constant" if chosen.strength == 0 else f"{1e3 * chosen.strength:.3g} mm"
    ax.plot(
        chosen.strength or zero,
        chosen.held_out,
        "*",
        markersize=15,
        color="black",
        zorder=4,
        markeredgecolor="white",
        linestyle="none",
        label=f"chosen: {what}",
    )
    _strength_axis(ax, zero, [one.strength for one in trials])
    canvas.scale_axis(
        ax.yaxis, canvas.LengthScale(factor=1000.0, unit="mm"), "RMSE in cells held back"
    )
    ax.grid(color="0.9", linewidth=0.6)
    ax.set_axisbelow(True)
    before = len(adjustment.trials) - len(trials)
    others = f"; {before} trials of other iterations" if before else ""
    canvas.annotate_axes(ax, f"RMSE of that chosen {1e3 * chosen.held_out:.3g} mm{others}")
    canvas.legend_above(ax, columns=4)
    return ax


def correction_spectrum(
    corrections: "SplineCorrection | Sequence[SplineCorrection]",
    *,
    along: Along = "time",
    speed: float | None = None,
    ax: "Axes | None" = None,
) -> "Axes":
    """Power spectral density of corrections of height, and what they leave unresolved.

    Parameters
    ----------
    corrections : Correction or sequence of Correction
        Corrections of the network adjustment.
    along : {"time", "station"}
        Whether they follow time [s] or station [m].
    speed : float, optional
        Speed of the passes, by which times become distances [m/s].
    ax : Axes, optional
        Where to draw; by default a new figure.

    Returns
    -------
    Axes
        Frequency [Hz] and density [m²/Hz], or wavelength [m] and density [m²/(cycle/m)] if
        corrections follow the station or the speed is given; both logarithmic. Grey is what is
        too fine for the knots; the dashed level there holds what remains, as if it were even.

    Raises
    ------
    ValueError
        If there is no correction, or the speed is not greater than 0 or has no meaning.

    Notes
    -----
    The periodogram of the whole correction, its mean taken off, with a Hann window: of one record,
    so it shows the shape of the spectrum, not a statistic. Waves longer than half of the record
    are not resolved.

    Examples
    --------
    >>> from trueterrain.alignment import adjust, lane_cells
    >>> cell, time = np.arange(400), np.arange(400) * 0.1
    >>> found = adjust([
    ...     lane_cells(name, cell, time, up * np.sin(0.5 * time), variance=1e-6, easting=0.5 * cell)
    ...     for name, up in (("east", 0.005), ("west", -0.005))])
    >>> correction_spectrum(found.corrections).get_xlabel()
    'Frequency [Hz]'
    """
    drawn = as_corrections(corrections, "height")
    if speed is not None and along == "station":
        message = "speed goes with corrections along time."
        raise ValueError(message)
    if speed is not None and not speed > 0:
        message = f"speed must be greater than 0 m/s, got {speed}."
        raise ValueError(message)
    rate = 1.0 if speed is None else speed  # distance, or time, per unit of the knots
    ax = canvas.axes_or_new(ax, height=3.8)
    finest = 0.5 / (rate * min(one.knots.spacing for one in drawn))  # that knots can hold
    levels: list[float] = []
    for number, one in enumerate(drawn):
        colour = canvas.COLOURS[number % len(canvas.COLOURS)]
        ax.plot(*_periodogram(one, rate), color=colour, linewidth=1.3, label=one.name)
        if one.left > 0:
            held = 0.5 / (rate * one.knots.spacing)
            levels.append(one.left**2 / ((_BEYOND - 1.0) * held))
            ax.plot(
                [held, _BEYOND * held],
                2 * [levels[-1]],
                color=colour,
                linewidth=1.4,
                linestyle=(3.0 * number, (3.0, 3.0 * max(len(drawn) - 1, 1))),
                label=f"{one.name}: remains, sd {1e3 * one.left:.2g} mm",
            )
    ax.axvspan(finest, _BEYOND * finest, color="0.92", zorder=0.5, label="finer than the knots")
    ax.set(xscale="log", yscale="log")
    top = max(float(np.max(line.get_ydata())) for line in ax.lines)
    ax.set_ylim(max(_DECADES * top, _BELOW * min(levels, default=0.0)), 3.0 * top)
    _frequency_axis(ax, _BEYOND * finest, lengths=speed is not None or along == "station")
    ax.grid(which="major", color="0.88", linewidth=0.6)
    ax.set_axisbelow(True)
    canvas.annotate_axes(ax, "periodogram of the whole correction, Hann window")
    canvas.legend_above(ax, columns=3)
    return ax


class _TrialStyle:
    """Colours of components, symbols of spacings, and dashes of what is rough."""

    def __init__(self, trials: "Sequence[ModelTrial]", unit: str) -> None:
        self._unit = unit
        self._components = list(dict.fromkeys(one.components for one in trials))
        self._spacings = sorted({one.knot_spacing for one in trials}, reverse=True)
        self._orders = [name for name in _ORDERS if any(one.order == name for one in trials)]

    def of(self, components: tuple[str, ...], spacing: float, order: str) -> dict[str, Any]:
        """Properties of a line."""
        return {
            "color": canvas.COLOURS[self._components.index(components) % len(canvas.COLOURS)],
            "marker": _MARKERS[self._spacings.index(spacing) % len(_MARKERS)],
            "linestyle": _ORDERS[order][0],
            "markerfacecolor": "white",
            "markeredgewidth": 1.1,
        }

    def explain(self, ax: "Axes") -> None:
        """Entries of the legend: what each colour, symbol and dash stands for."""
        first, coarse = self._components[0], self._spacings[0]
        for one in self._components:
            look = self.of(one, coarse, "second")
            ax.plot([], [], color=look["color"], linewidth=2.5, label=_component_text(one))
        for spacing in self._spacings:
            look = self.of(first, spacing, "second") | {"color": _GREY, "linestyle": "none"}
            ax.plot([], [], **look, label=f"knots {spacing:g} {self._unit}")
        for order in self._orders:
            style, name = _ORDERS[order]
            ax.plot([], [], color=_GREY, linestyle=style, linewidth=1.1, label=name)


def _trial_kind(trial: "ModelTrial") -> tuple[tuple[str, ...], float, str]:
    return trial.components, trial.knot_spacing, trial.order


def _best_of_each(trials: "Sequence[ModelTrial]") -> tuple[Floats, Floats]:
    """Strengths, ascending, and the least root mean square at each, whatever the rest."""
    best: dict[float, float] = {}
    for one in trials:
        best[one.strength] = min(one.held_out, best.get(one.strength, np.inf))
    strengths = sorted(best)
    return np.array(strengths), np.array([best[one] for one in strengths])


def _component_text(components: tuple[str, ...]) -> str:
    """Components in few words."""
    text = " + ".join(components)
    return text.replace("east + north", "shift")


def _strength_axis(ax: "Axes", zero: float, strengths: Sequence[float]) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    constant = 0.0 in strengths

    def text(value: float, _: Any) -> str:
        if constant and np.isclose(value, zero, rtol=1e-3):
            return "0: constant"
        return f"{1e3 * value:g}"

    ax.set_xscale("log")
    ax.margins(x=0.06)
    low, high = ax.get_xlim()
    least = max(low, 2 * zero) if any(strengths) else np.inf
    ticks = [one for one in LogLocator().tick_values(low, high) if least <= one <= high]
    ax.set_xticks([zero, *ticks] if constant else ticks)
    ax.xaxis.set_major_formatter(FuncFormatter(text))
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.set_xlim(low, high)
    ax.set_xlabel("← too stiff    Strength: sd by which heights may wander [mm]    too loose →")


def _periodogram(one: "SplineCorrection", rate: float) -> tuple[Floats, Floats]:
    """Frequencies and densities."""
    import scipy.signal

    samples = min(_PER_KNOT * one.knots.intervals, _MOST) + 1
    time = np.linspace(one.knots.begin, one.knots.end, samples)
    frequency, density = scipy.signal.periodogram(
        one(time), 1.0 / (rate * (time[1] - time[0])), window="hann", detrend="constant"
    )
    shown = (frequency > 0) & (frequency <= _BEYOND * 0.5 / (rate * one.knots.spacing))
    return frequency[shown], np.maximum(density[shown], _LOWEST)


def _frequency_axis(ax: "Axes", highest: float, *, lengths: bool) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    lowest = min(float(np.min(line.get_xdata())) for line in ax.lines)
    ax.set_xlim(lowest, highest)
    ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    ax.xaxis.set_minor_formatter(NullFormatter())
    if lengths:
        ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{1.0 / value:.3g}"))
        ax.set_xlabel("Wavelength [m]")
        ax.set_ylabel("Correction of height [m²/(cycle/m)]")
    else:
        ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        ax.set_xlabel("Frequency [Hz]")
        ax.set_ylabel("Correction of height [m²/Hz]")
