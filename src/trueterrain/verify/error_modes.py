"""Error of a profile by frequency bands of the vehicle's modes, and its coherence with the motion.

The body rides on its suspension at 1 to 2 Hz, and its wheels hop at 10 to 15 Hz. The band of an
error and the motion with which it is coherent indicate its cause: slow errors come from navigation,
errors coherent with pitch from lever arms and angles, errors coherent with no motion from the
scanner.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from trueterrain.verify.motion_rejection import HALF_BANDWIDTH, TAPERS, tapered_transforms

Floats = npt.NDArray[np.float64]
Complexes = npt.NDArray[np.complex128]

_LEVEL = 0.99  # probability that errors independent of the motion stay below the threshold
_SLOW = "slow"
_SMALL = 1e-9  # [m, rad] root mean square below which a motion counts as none
_LARGE = 0.05  # fraction of the error above which its cause is worth a report

#: Squared coherence that errors independent of the motion exceed in one of 100 cases.
COHERENCE_THRESHOLD = 1 - (1 - _LEVEL) ** (1 / (TAPERS - 1))


@dataclass(frozen=True, kw_only=True)
class ErrorMode:
    """Part of the error in a band of frequencies, and its coherence with the motion."""

    name: str
    "Primary ride, wheel hop, or the band below, between or above."

    low: float
    "Lowest frequency [Hz]."

    high: float
    "Highest frequency [Hz]."

    fraction: float | None
    "Fraction of the mean square of the error, 0 to 1; None if the record is too short."

    rms: float | None
    "Root mean square of the error in the band [m]; None if the record is too short."

    coherence: dict[str, float]
    "Squared coherence of the error with heave, pitch, roll and the laser's height, 0 to 1."

    threshold: float
    "Squared coherence that errors independent of the motion exceed in one of 100 cases."

    moves_with: str | None
    "Motion of greatest coherence with the error; None if it is below the threshold."

    meaning: str
    "The result in a sentence."

    def to_dict(self) -> dict[str, Any]:
        """Numbers and strings, ready for JSON."""
        return {
            "name": self.name,
            "low": self.low,
            "high": self.high,
            "fraction": self.fraction,
            "rms": self.rms,
            "coherence": dict(self.coherence),
            "threshold": self.threshold,
            "moves_with": self.moves_with,
            "meaning": self.meaning,
        }


def split_by_mode(
    time: Floats,
    error: Floats,
    motion: Mapping[str, Floats],
    *,
    ride: tuple[float, float],
    hop: tuple[float, float],
) -> tuple[ErrorMode, ...]:
    """Split the mean square of an error into the frequency bands of the vehicle's modes.

    Parameters
    ----------
    time : numpy.ndarray, shape (n,)
        Equally spaced times [s].
    error : numpy.ndarray, shape (n,)
        Error of the profile at these times [m].
    motion : mapping of numpy.ndarray
        Motions of the body at the same times, such as heave [m], pitch and roll [rad].
    ride, hop : tuple of float
        Bands of primary ride and wheel hop [Hz].

    Returns
    -------
    tuple of ErrorMode
        From low to high frequencies; fractions add up to 1. Periods longer than the record are not
        resolved.

    Notes
    -----
    Fractions are those of the discrete cosine transform of the record without its linear trend; it
    preserves the sum of squares and has no discontinuity at the ends. Coherence is that of spectra
    by four Slepian tapers (Thomson 1982) after a high-pass filter, averaged over the band with the
    power of the error as weight. With K tapers, independent errors exceed 1 - p^(1 / (K - 1)) with
    probability p at a single frequency, and more rarely in a mean of several.

    Examples
    --------
    >>> time = np.linspace(0, 4, 2000, endpoint=False)
    >>> pitch = 0.01 * np.sin(2 * np.pi * 1.5 * time)
    >>> bands = {"ride": (0.5, 3.0), "hop": (8.0, 16.0)}
    >>> modes = split_by_mode(time, 0.1 * pitch, {"pitch": pitch}, **bands)
    >>> modes[1].meaning
    '99 % of the error lies at the primary ride (0.5 to 3 Hz) and moves with pitch.'
    """
    duration = (time[-1] - time[0]) * time.size / (time.size - 1)
    fractions, line = _power_fractions(error, duration)
    slow = max(ride[0], 1.0 / duration)
    tapered = tapered_transforms(_high_pass(error, slow, duration))
    frequency = np.fft.rfftfreq(time.size, duration / time.size)
    power = np.mean(np.abs(tapered) ** 2, axis=0)
    coherent = {
        name: _squared_coherence(tapered, tapered_transforms(_high_pass(values, slow, duration)))
        for name, values in motion.items()
        if float(np.std(values)) > _SMALL
    }
    rms = float(np.sqrt(np.mean(_detrend_record(error) ** 2)))
    found = []
    for name, low, high in _mode_bands(ride, hop, 1.0 / duration, 0.5 * time.size / duration):
        if name != _SLOW and high <= 1.0 / duration:
            found.append(_unresolved_mode(name, low, high, duration))
            continue
        fraction = float(fractions[(line >= low) & (line < high)].sum())
        inside = (frequency >= low) & (frequency < high)
        within: dict[str, float] = {}
        if name != _SLOW and high > HALF_BANDWIDTH / duration and power[inside].any():
            within = {
                one: float(np.average(values[inside], weights=power[inside]))
                for one, values in coherent.items()
            }
        follows = max(within, key=within.__getitem__) if within else None
        if follows is not None and within[follows] <= COHERENCE_THRESHOLD:
            follows = None
        found.append(
            ErrorMode(
                name=name,
                low=low,
                high=high,
                fraction=fraction,
                rms=rms * math.sqrt(fraction),
                coherence=within,
                threshold=COHERENCE_THRESHOLD,
                moves_with=follows,
                meaning=_meaning_text(name, low, high, fraction, follows, compared=bool(within)),
            )
        )
    return tuple(found)


def main_error_source(modes: tuple[ErrorMode, ...]) -> str:
    """Sentence on the main source of an error among the vehicle's modes.

    Parameters
    ----------
    modes : tuple of ErrorMode
        Parts of the error.

    Returns
    -------
    str
        The largest part that is coherent with the motion, or that there is none.

    Examples
    --------
    >>> main_error_source(())
    'Nothing of the error moves with the body.'
    """
    moved = [one for one in modes if one.moves_with and (one.fraction or 0.0) >= _LARGE]
    if moved:
        return max(moved, key=lambda one: one.fraction or 0.0).meaning
    resolved = [one for one in modes if one.fraction is not None]
    if not resolved:
        return "Nothing of the error moves with the body."
    largest = max(resolved, key=lambda one: one.fraction or 0.0)
    return (
        "Nothing of the error moves with the body; most of it, "
        f"{100 * (largest.fraction or 0.0):.0f} %, lies "
        f"{_band_text(largest.name, largest.low, largest.high)}."
    )


def _power_fractions(error: Floats, duration: float) -> tuple[Floats, Floats]:
    """Fractions of the mean square of a detrended record by frequency, and the frequencies [Hz]."""
    from scipy.fft import dct

    square = np.square(dct(_detrend_record(error), norm="ortho"))
    total = max(float(square.sum()), np.finfo(float).tiny)
    return np.asarray(square / total), np.arange(error.size) / (2 * duration)


def _high_pass(values: Floats, frequency: float, duration: float) -> Floats:
    """High-pass filter of a record: leakage of slow errors would hide the neighbouring band."""
    from scipy.fft import dct, idct

    parts = dct(_detrend_record(values), norm="ortho")
    parts[np.arange(values.size) < 2 * duration * frequency] = 0.0
    return np.asarray(idct(parts, norm="ortho"))


def _mode_bands(
    ride: tuple[float, float], hop: tuple[float, float], coarse: float, highest: float
) -> list[tuple[str, float, float]]:
    """Names and bounds of the bands; frequencies that the record does not resolve are slow."""
    begin = max(ride[0], coarse)
    bands = [
        (_SLOW, 0.0, begin),
        ("primary ride", *ride),
        ("between ride and hop", ride[1], hop[0]),
        ("wheel hop", *hop),
        ("above wheel hop", hop[1], max(highest, hop[1])),
    ]
    return [
        (name, low if name == _SLOW or high <= begin else max(low, begin), high)
        for name, low, high in bands
        if high > low
    ]


def _unresolved_mode(name: str, low: float, high: float, duration: float) -> ErrorMode:
    return ErrorMode(
        name=name,
        low=low,
        high=high,
        fraction=None,
        rms=None,
        coherence={},
        threshold=COHERENCE_THRESHOLD,
        moves_with=None,
        meaning=f"A record of {duration:.2f} s does not resolve frequencies below "
        f"{1 / duration:.1f} Hz: add floor before and after the plate to resolve the error "
        f"{_band_text(name, low, high)}.",
    )


def _squared_coherence(first: Complexes, second: Complexes) -> Floats:
    """Squared coherence over frequency, from the transforms of all tapers."""
    tiny = np.finfo(float).tiny
    cross = np.abs(np.mean(first * np.conj(second), axis=0)) ** 2
    both = np.mean(np.abs(first) ** 2, axis=0) * np.mean(np.abs(second) ** 2, axis=0)
    return np.asarray(cross / np.maximum(both, tiny))


def _detrend_record(values: Floats) -> Floats:
    from scipy.signal import detrend

    return np.asarray(detrend(values))


def _meaning_text(
    name: str, low: float, high: float, fraction: float, follows: str | None, *, compared: bool
) -> str:
    moves = f"moves with {follows}" if follows else "moves with no motion of the body"
    if not compared:
        moves = "cannot be compared with the motion in so short a record"
    return f"{100 * fraction:.0f} % of the error lies {_band_text(name, low, high)} and {moves}."


def _band_text(name: str, low: float, high: float) -> str:
    band = f"({low:.2g} to {high:.3g} Hz)"
    words = {
        _SLOW: f"below {high:.2g} Hz",
        "primary ride": f"at the primary ride {band}",
        "wheel hop": f"at wheel hop {band}",
        "above wheel hop": f"above {low:.3g} Hz",
    }
    return words.get(name, f"between both modes {band}")
