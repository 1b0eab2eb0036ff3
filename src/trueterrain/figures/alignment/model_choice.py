"""Figures of the choice of the stochastic model, and of the spectrum of corrections."""

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

_CONSTANT = 10.0**-0.75  # position of strength 0, over the minimum strength
_MARKERS = "osD^vP"
_ORDERS = {"second": ("-", "second order (smooth)"), "first": ("--", "first order (rough)")}
_GREY = "0.35"  # of legend entries for all colours
_PER_KNOT = 8  # samples from one knot to the next
_MAX_SAMPLES = 1 << 20
_BEYOND = 8.0  # width of the unresolved band over the Nyquist frequency of the knots
_DECADES = 1e-8  # minimum density drawn, over the maximum
_BELOW = 1e-3  # minimum density drawn, over the residual one
_MIN_DENSITY = 1e-30  # [m² s]


def strength_choice(
    adjustment: "Adjustment", *, along: Along = "time", ax: "Axes | None" = None
) -> "Axes":
    """Prediction error of held-out cells as a function of the strength of the corrections.

    Shows whether the chosen model is at the minimum, between too stiff and too flexible.

    Parameters
    ----------
    adjustment : Adjustment
        Adjustment with its trials.
    along : {"time", "station"}
        Whether knots are spaced in seconds or in metres.
    ax : Axes, optional
        Where to draw; by default a new figure.

    Returns
    -------
    Axes
        Strength, the standard deviation of the drift of heights [m], logarithmic except for 0, a
        constant; and root mean square of the differences of passes in held-out cells [m]. Colours
        are components, symbols the spacing of the knots, and dashes the order of the Gauss-Markov
        process. Of trials that predict equally well within the standard error the most likely one
        is chosen, which need not be the lowest. Trials of other iterations, with other weights, do
        not compare and are only counted.

    Examples
    --------
    >>> from trueterrain.alignment import adjust_passes, make_pass_cells
    >>> cell, time = np.arange(400), np.arange(400) * 0.1
    >>> found = adjust_passes([
    ...     make_pass_cells(name, cell, time, up + np.sin(cell), variance=1e-6, easting=0.5 * cell)
    ...     for name, up in (("east", 0.005), ("west", -0.005))])
    >>> strength_choice(found).get_ylabel()
    'RMSE in held-out cells [mm]'
    """
    ax = canvas.axes_or_new(ax, height=3.8)
    unit = "s" if along == "time" else "m"
    chosen = adjustment.chosen
    trials = sorted(
        (one for one in adjustment.trials if one.round == chosen.round), key=_trial_kind
    )
    zero = _CONSTANT * min((one.strength for one in trials if one.strength > 0), default=1e-3)
    styles = _TrialStyle(trials, unit)
    for kind, some in groupby(trials, key=_trial_kind):
        x, y = _best_of_each([*some])
        ax.plot(np.where(x > 0, x, zero), y, markersize=4.5, linewidth=1.1, **styles.of(*kind))
    styles.explain(ax)
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
        ax.yaxis, canvas.LengthScale(factor=1000.0, unit="mm"), "RMSE in held-out cells"
    )
    canvas.draw_grid(ax)
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
    """Power spectral density of corrections of height, and of the residual drift.

    Parameters
    ----------
    corrections : SplineCorrection or sequence of Correction
        Corrections of the network adjustment.
    along : {"time", "station"}
        Whether they are functions of time [s] or station [m].
    speed : float, optional
        Speed of the passes, to convert times to distances [m/s].
    ax : Axes, optional
        Where to draw; by default a new figure.

    Returns
    -------
    Axes
        Frequency [Hz] and density [m²/Hz], or wavelength [m] and density [m²/(cycle/m)] for
        corrections by station or with a speed; both logarithmic. The band that the knots do not
        resolve is grey; the dashed level there is the residual variance, taken as white.

    Raises
    ------
    ValueError
        If there is no correction, or the speed is not greater than 0 or has no meaning.

    Notes
    -----
    Periodogram of the whole correction without its mean, with a Hann window. One record gives the
    shape of the spectrum, not its confidence. Waves longer than half of the record
    are not resolved.

    Examples
    --------
    >>> from trueterrain.alignment import adjust_passes, make_pass_cells
    >>> cell, time = np.arange(400), np.arange(400) * 0.1
    >>> found = adjust_passes([
    ...     make_pass_cells(name, cell, time, up * np.sin(0.5 * time), variance=1e-6,
    ...                     easting=0.5 * cell)
    ...     for name, up in (("east", 0.005), ("west", -0.005))])
    >>> correction_spectrum(found.corrections).get_xlabel()
    'Frequency [Hz]'
    """
    drawn = as_corrections(corrections, "height")
    if speed is not None and along == "station":
        message = "speed needs corrections along time."
        raise ValueError(message)
    if speed is not None and not speed > 0:
        message = f"speed must be greater than 0 m/s, got {speed}."
        raise ValueError(message)
    rate = 1.0 if speed is None else speed  # distance or time per unit of the knots
    ax = canvas.axes_or_new(ax, height=3.8)
    finest = 0.5 / (
        rate * min(one.knots.spacing for one in drawn)
    )  # Nyquist frequency of the knots
    levels: list[float] = []
    for number, one in enumerate(drawn):
        colour = canvas.COLOURS[number % len(canvas.COLOURS)]
        ax.plot(*_periodogram(one, rate), color=colour, linewidth=1.3, label=one.name)
        if one.residual_sd > 0:
            nyquist = 0.5 / (rate * one.knots.spacing)
            levels.append(one.residual_sd**2 / ((_BEYOND - 1.0) * nyquist))
            ax.plot(
                [nyquist, _BEYOND * nyquist],
                2 * [levels[-1]],
                color=colour,
                linewidth=1.4,
                linestyle=(3.0 * number, (3.0, 3.0 * max(len(drawn) - 1, 1))),
                label=f"{one.name}: residual sd {1e3 * one.residual_sd:.2g} mm",
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
    """Styles of trials: colours of components, symbols of spacings, dashes of orders."""

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
            style = self.of(one, coarse, "second")
            ax.plot([], [], color=style["color"], linewidth=2.5, label=_component_text(one))
        for spacing in self._spacings:
            style = self.of(first, spacing, "second") | {"color": _GREY, "linestyle": "none"}
            ax.plot([], [], **style, label=f"knots {spacing:g} {self._unit}")
        for order in self._orders:
            dash, name = _ORDERS[order]
            ax.plot([], [], color=_GREY, linestyle=dash, linewidth=1.1, label=name)


def _trial_kind(trial: "ModelTrial") -> tuple[tuple[str, ...], float, str]:
    return trial.components, trial.knot_spacing, trial.order


def _best_of_each(trials: "Sequence[ModelTrial]") -> tuple[Floats, Floats]:
    """Strengths, ascending, and the minimum root mean square at each."""
    best: dict[float, float] = {}
    for one in trials:
        best[one.strength] = min(one.held_out, best.get(one.strength, np.inf))
    strengths = sorted(best)
    return np.array(strengths), np.array([best[one] for one in strengths])


def _component_text(components: tuple[str, ...]) -> str:
    """Short text for components."""
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
    lowest = max(low, 2 * zero) if any(strengths) else np.inf
    ticks = [one for one in LogLocator().tick_values(low, high) if lowest <= one <= high]
    ax.set_xticks([zero, *ticks] if constant else ticks)
    ax.xaxis.set_major_formatter(FuncFormatter(text))
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.set_xlim(low, high)
    ax.set_xlabel("← too stiff    Strength: sd of the drift of heights [mm]    too flexible →")


def _periodogram(one: "SplineCorrection", rate: float) -> tuple[Floats, Floats]:
    """Frequencies and densities."""
    import scipy.signal

    samples = min(_PER_KNOT * one.knots.intervals, _MAX_SAMPLES) + 1
    time = np.linspace(one.knots.begin, one.knots.end, samples)
    frequency, density = scipy.signal.periodogram(
        one(time), 1.0 / (rate * (time[1] - time[0])), window="hann", detrend="constant"
    )
    shown = (frequency > 0) & (frequency <= _BEYOND * 0.5 / (rate * one.knots.spacing))
    return frequency[shown], np.maximum(density[shown], _MIN_DENSITY)


def _frequency_axis(ax: "Axes", highest: float, *, lengths: bool) -> None:
    from matplotlib.ticker import FuncFormatter

    lowest = min(float(np.min(line.get_xdata())) for line in ax.lines)
    ax.set_xlim(lowest, highest)
    canvas.plain_log_axis(ax.xaxis)
    if lengths:
        ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{1.0 / value:.3g}"))
        ax.set_xlabel("Wavelength [m]")
        ax.set_ylabel("Correction of height [m²/(cycle/m)]")
    else:
        ax.set_xlabel("Frequency [Hz]")
        ax.set_ylabel("Correction of height [m²/Hz]")
