"""Which mode of the body the error of a profile comes from.

The body rides on its suspension at 1 to 2 Hz, and its wheels hop at 10 to 15 Hz. Where the error
has its power, and what motion it follows there, says what to look at: slow errors are those of
navigation, errors that follow pitch those of levers and angles, errors that follow no motion the
scanner's own.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from trueterrain.verify.motion_rejection import HALF_BANDWIDTH, TAPERS
from trueterrain.verify.motion_rejection import turned_by_tapers as _tapered

Floats = npt.NDArray[np.float64]
Complexes = npt.NDArray[np.complex128]

_SURE = 0.99  # share of errors that do not move with the body and whose coherence stays below
_SLOW = "slow"
_SMALL = 1e-9  # [m, rad] root mean square of a motion that is none
_LARGE = 0.05  # share of the error of which it is worth to say where it comes from

#: Squared coherence that errors without a share in the motion reach in one of 100 cases.
THRESHOLD = 1 - (1 - _SURE) ** (1 / (TAPERS - 1))


@dataclass(frozen=True, kw_only=True)
class ErrorMode:
    """How much of the error lies in a band of frequencies, and what it moves with."""

    name: str
    "Primary ride, wheel hop, or what lies below, between and above."

    low: float
    "Lowest frequency [Hz]."

    high: float
    "Highest frequency [Hz]."

    share: float | None
    "Share of the mean square of the error, 0 to 1; None where the record is too short to tell."

    rms: float | None
    "Root mean square of the error in the band [m]; None as before."

    coherence: dict[str, float]
    "Squared coherence of the error with heave, pitch, roll and the laser's height, 0 to 1."

    threshold: float
    "Coherence that errors which do not move with the body reach in one of 100 cases."

    moves_with: str | None
    "The motion that the error follows most surely; None if it follows none."

    meaning: str
    "One sentence."

    def to_dict(self) -> dict[str, Any]:
        """The same as plain numbers and words, as for JSON."""
        return {
            "name": self.name,
            "low": self.low,
            "high": self.high,
            "share": self.share,
            "rms": self.rms,
            "coherence": dict(self.coherence),
            "threshold": self.threshold,
            "moves_with": self.moves_with,
            "meaning": self.meaning,
        }


def modes_of(
    time: Floats,
    error: Floats,
    motion: Mapping[str, Floats],
    *,
    ride: tuple[float, float],
    hop: tuple[float, float],
) -> tuple[ErrorMode, ...]:
    """Split an error by the modes of the body.

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
    tuple of Mode
        From low to high frequencies; shares add up to 1. What is slower than one period in the
        record is not resolved.

    Notes
    -----
    Shares are those of the cosine transform of the record without its trend, which keeps its sum of
    squares and has no jump at the ends. Coherence is that of spectra by four tapers of Slepian
    (Thomson 1982) of what is not slow, averaged over the band with the power of the error as
    weight. Of K tapers, errors without a share in the motion reach 1 - p^(1 / (K - 1)) with the
    probability p at a single frequency, and more rarely in a mean of several.

    Examples
    --------
    >>> time = np.linspace(0, 4, 2000, endpoint=False)
    >>> pitch = 0.01 * np.sin(2 * np.pi * 1.5 * time)
    >>> modes = modes_of(time, 0.1 * pitch, {"pitch": pitch}, ride=(0.5, 3.0), hop=(8.0, 16.0))
    >>> modes[1].meaning
    '99 % of the error lies at the primary ride (0.5 to 3 Hz) and moves with pitch.'
    """
    duration = (time[-1] - time[0]) * time.size / (time.size - 1)
    shares, at = _power_fractions(error, duration)
    slow = max(ride[0], 1.0 / duration)
    tapered = _tapered(_high_pass(error, slow, duration))
    frequency = np.fft.rfftfreq(time.size, duration / time.size)
    power = np.mean(np.abs(tapered) ** 2, axis=0)
    coherent = {
        name: _squared_coherence(tapered, _tapered(_high_pass(values, slow, duration)))
        for name, values in motion.items()
        if float(np.std(values)) > _SMALL
    }
    rms = float(np.sqrt(np.mean(_detrend_record(error) ** 2)))
    found = []
    for name, low, high in _mode_bands(ride, hop, 1.0 / duration, 0.5 * time.size / duration):
        if name != _SLOW and high <= 1.0 / duration:
            found.append(_unresolved_mode(name, low, high, duration))
            continue
        share = float(shares[(at >= low) & (at < high)].sum())
        inside = (frequency >= low) & (frequency < high)
        within: dict[str, float] = {}
        if name != _SLOW and high > HALF_BANDWIDTH / duration and power[inside].any():
            within = {
                one: float(np.average(values[inside], weights=power[inside]))
                for one, values in coherent.items()
            }
        follows = max(within, key=within.__getitem__) if within else None
        if follows is not None and within[follows] <= THRESHOLD:
            follows = None
        found.append(
            ErrorMode(
                name=name,
                low=low,
                high=high,
                share=share,
                rms=rms * math.sqrt(share),
                coherence=within,
                threshold=THRESHOLD,
                moves_with=follows,
                meaning=_meaning_text(name, low, high, share, follows, told=bool(within)),
            )
        )
    return tuple(found)


def source_of(modes: tuple[ErrorMode, ...]) -> str:
    """Which mode an error comes from, in a sentence.

    Parameters
    ----------
    modes : tuple of Mode
        Its parts.

    Returns
    -------
    str
        The largest part that moves with the body, or that none does.

    Examples
    --------
    >>> source_of(())
    'Nothing of the error moves with the body.'
    """
    moved = [one for one in modes if one.moves_with and (one.share or 0.0) >= _LARGE]
    if moved:
        return max(moved, key=lambda one: one.share or 0.0).meaning
    told = [one for one in modes if one.share is not None]
    if not told:
        return "Nothing of the error moves with the body."
    most = max(told, key=lambda one: one.share or 0.0)
    return (
        "Nothing of the error moves with the body; most of it, "
        f"{100 * (most.share or 0.0):.0f} %, lies {_band_text(most.name, most.low, most.high)}."
    )


def _power_fractions(error: Floats, duration: float) -> tuple[Floats, Floats]:
    """Shares of the mean square of a record without its trend, and their frequencies."""
    from scipy.fft import dct

    square = np.square(dct(_detrend_record(error), norm="ortho"))
    total = max(float(square.sum()), np.finfo(float).tiny)
    return np.asarray(square / total), np.arange(error.size) / (2 * duration)


def _high_pass(values: Floats, frequency: float, duration: float) -> Floats:
    """A record without what is slower, whose leakage would hide what is beside it."""
    from scipy.fft import dct, idct

    parts = dct(_detrend_record(values), norm="ortho")
    parts[np.arange(values.size) < 2 * duration * frequency] = 0.0
    return np.asarray(idct(parts, norm="ortho"))


def _mode_bands(
    ride: tuple[float, float], hop: tuple[float, float], coarse: float, highest: float
) -> list[tuple[str, float, float]]:
    """Names and ends of the bands; what the record does not resolve is slow."""
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
        share=None,
        rms=None,
        coherence={},
        threshold=THRESHOLD,
        moves_with=None,
        meaning=f"A record of {duration:.2f} s tells nothing apart below {1 / duration:.1f} Hz: "
        f"add floor beside the plate to see the error {_band_text(name, low, high)}.",
    )


def _squared_coherence(first: Complexes, second: Complexes) -> Floats:
    """Squared coherence over frequency, from spectra of every taper."""
    tiny = np.finfo(float).tiny
    cross = np.abs(np.mean(first * np.conj(second), axis=0)) ** 2
    both = np.mean(np.abs(first) ** 2, axis=0) * np.mean(np.abs(second) ** 2, axis=0)
    return np.asarray(cross / np.maximum(both, tiny))


def _detrend_record(values: Floats) -> Floats:
    from scipy.signal import detrend

    return np.asarray(detrend(values))


def _meaning_text(
    name: str, low: float, high: float, share: float, follows: str | None, *, told: bool
) -> str:
    moves = f"moves with {follows}" if follows else "moves with no motion of the body"
    if not told:
        moves = "cannot be compared with the motion in so short a record"
    return f"{100 * share:.0f} % of the error lies {_band_text(name, low, high)} and {moves}."


def _band_text(name: str, low: float, high: float) -> str:
    band = f"({low:.2g} to {high:.3g} Hz)"
    words = {
        _SLOW: f"below {high:.2g} Hz",
        "primary ride": f"at the primary ride {band}",
        "wheel hop": f"at wheel hop {band}",
        "above wheel hop": f"above {low:.3g} Hz",
    }
    return words.get(name, f"between both modes {band}")
