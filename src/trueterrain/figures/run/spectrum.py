"""Power spectral densities of recorded signals, with confidence intervals."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from trueterrain.core.spectral_density import density_interval, welch_density
from trueterrain.figures import canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = npt.NDArray[np.float64]

_MIN_SAMPLES = 8  # of a segment
_MIN_DENSITY = 1e-7  # ratio of the lowest density of the axis to the highest


def spectrum(
    signal: npt.ArrayLike | Mapping[str, npt.ArrayLike],
    rate: float,
    *,
    segment: float | None = None,
    confidence: float = 0.95,
    peaks: Mapping[str, tuple[float, float]] | None = None,
    frequencies: tuple[float, float] | None = None,
    name: str = "Acceleration",
    unit: str = "m/s²",
    ax: "Axes | None" = None,
) -> "Axes":
    """Power spectral density by Welch's method, its confidence interval, and marked peaks.

    Parameters
    ----------
    signal : array_like, shape (n,), or mapping of str to array_like
        Equally spaced samples, or several signals by name.
    rate : float
        Sampling rate [Hz].
    segment : float, optional
        Length of the segments, Hann windows that overlap by half and are levelled each [s]; by
        default a quarter of the signal. The resolution is about 1.5 / segment.
    confidence : float
        Confidence level of the band; see Notes.
    peaks : mapping of str to tuple of float, optional
        Names of peaks, and the frequencies between which each is searched [Hz]. The highest value
        of the first signal there is marked.
    frequencies : tuple of float, optional
        Frequencies to draw [Hz].
    name, unit : str
        Name and unit of the signal.
    ax : Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    Axes
        Frequency [Hz] and density [unit²/Hz], both logarithmic.

    Raises
    ------
    ValueError
        If the rate, the segment or the confidence is invalid, or there is no frequency between
        those of a peak.

    Notes
    -----
    For random signals whose spectrum is flat across the resolution, the ratio of estimate and
    density has a chi² distribution with v degrees of freedom, divided by v; v for overlapping
    segments is that of Welch (1967). For a single event, which is not such a signal, the band only
    shows the number of segments.

    Examples
    --------
    >>> time = np.arange(4000) / 100
    >>> ax = spectrum(np.sin(2 * np.pi * 11 * time), 100.0, peaks={"wheel hop": (9, 13)})
    >>> ax.texts[0].get_text()
    'wheel hop 11.0 Hz'
    """
    if not rate > 0:
        message = f"rate must be greater than 0 Hz, got {rate}."
        raise ValueError(message)
    if not 0 < confidence < 1:
        message = f"confidence must be between 0 and 1, got {confidence}."
        raise ValueError(message)
    named = signal if isinstance(signal, Mapping) else {"": signal}
    ax = canvas.axes_or_new(ax, height=3.8)
    notes: list[str] = []
    peak_densities: list[float] = []
    for number, (label, values) in enumerate(named.items()):
        frequency, density, degrees, length = _signal_density(values, rate, segment, label)
        low, high = density_interval(degrees, confidence)
        colour = canvas.COLOURS[number % len(canvas.COLOURS)]
        shown = _select_frequencies(frequency, frequencies)
        frequency, density = frequency[shown], density[shown]
        ax.fill_between(
            frequency, low * density, high * density, color=colour, alpha=0.2, linewidth=0
        )
        ax.plot(frequency, density, color=colour, linewidth=1.3, label=label or None)
        if number == 0:
            _mark_peaks(ax, frequency, density, peaks or {})
        peak_densities.append(float(density.max()))
        notes.append(f"Welch, {length:.3g} s, {degrees:.0f} degrees of freedom")
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_ylim(bottom=max(ax.get_ylim()[0], _MIN_DENSITY * max(peak_densities)))
    canvas.plain_log_axis(ax.xaxis)
    ax.set_xlabel("Frequency [Hz]")
    ax.set_ylabel(f"{name} [({unit})²/Hz]")
    ax.margins(x=0)
    ax.grid(which="major", color="0.85", linewidth=0.6)
    ax.grid(which="minor", color="0.94", linewidth=0.4)
    ax.set_axisbelow(True)
    same = notes[0] if len(set(notes)) == 1 else "Welch"
    canvas.annotate_axes(ax, f"{same}; band {100 * confidence:g} % confidence")
    canvas.legend_above(ax)
    return ax


def _signal_density(
    values: npt.ArrayLike, rate: float, segment: float | None, label: str
) -> tuple[Floats, Floats, float, float]:
    """Frequency, density, degrees of freedom and length of a segment [s]; without frequency 0."""
    samples = np.asarray(values, dtype=np.float64)
    place = f"signal {label}" if label else "signal"
    if samples.ndim != 1 or not np.isfinite(samples).all():
        message = f"{place} must have one dimension and be finite, got shape {samples.shape}."
        raise ValueError(message)
    size = samples.size // 4 if segment is None else round(segment * rate)
    if not _MIN_SAMPLES <= size <= samples.size:
        message = (
            f"segment must be from {_MIN_SAMPLES / rate:g} s to the {samples.size / rate:g} s of "
            f"the {place}, got {size / rate:g} s."
        )
        raise ValueError(message)
    frequency, density, degrees = welch_density(samples, samples, rate, size)
    return frequency, density.real, degrees, size / rate


def _select_frequencies(
    frequency: Floats, limits: tuple[float, float] | None
) -> npt.NDArray[np.bool_]:
    low, high = (0.0, np.inf) if limits is None else limits
    inside: npt.NDArray[np.bool_] = (frequency >= low) & (frequency <= high)
    if not inside.any():
        message = f"frequencies must hold one of the signal's, got {low:g} Hz to {high:g} Hz."
        raise ValueError(message)
    return inside


def _mark_peaks(
    ax: "Axes", frequency: Floats, density: Floats, peaks: Mapping[str, tuple[float, float]]
) -> None:
    for name, (low, high) in peaks.items():
        inside = np.flatnonzero((frequency >= low) & (frequency <= high))
        if inside.size == 0:
            message = (
                f"peak {name!r} must be searched where there is a frequency, "
                f"got {low} to {high} Hz."
            )
            raise ValueError(message)
        top = inside[np.argmax(density[inside])]
        ax.plot(
            frequency[top],
            density[top],
            "v",
            color="black",
            markersize=6,
            zorder=4,
            markeredgecolor="white",
        )
        ax.annotate(
            f"{name} {frequency[top]:.1f} Hz",
            (frequency[top], density[top]),
            (0, 7),
            textcoords="offset points",
            ha="center",
            va="bottom",
            fontsize="small",
        )
