"""Wheel hop on cleats: the wheel as a base-excited oscillator."""

import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

_LENGTH, _RIDE, _HOP = 2.44, 1.1, 11.0  # [m], [Hz], [Hz] of the thesis's event

#: Model of the oscillator; see `hop_transmissibility`.
HopModel = Literal["base-excited", "thesis"]


@dataclass(frozen=True, kw_only=True)
class Erratum:
    """A value printed in the thesis, and the corrected one."""

    place: str
    "Equation or section of Smith (2009)."

    quantity: str
    "Name of the quantity."

    printed: float
    "Value as printed, or from the printed formula."

    right: float
    "Corrected value."

    unit: str
    "Unit of both."

    why: str
    "Reason, in a sentence."


def hop_transmissibility(
    ratio: npt.ArrayLike,
    damping: float,
    *,
    model: HopModel = "base-excited",
    tyre_stiffness_fraction: float = 1.0,
) -> Floats:
    """Transmissibility of a wheel near wheel hop: its amplitude over that of the ground.

    Parameters
    ----------
    ratio : array_like
        Frequency of the ground over the undamped frequency of wheel hop [1].
    damping : float
        Damping ratio of wheel hop [1].
    model : {"base-excited", "thesis"}
        See Notes.
    tyre_stiffness_fraction : float
        Stiffness of the tyre over the sum of those of tyre and suspension; 1, the default, neglects
        the suspension [1].

    Returns
    -------
    numpy.ndarray
        Amplitude ratio [1].

    Raises
    ------
    ValueError
        If a ratio or the damping is not greater than 0, or the fraction is not from 0 to 1.

    Notes
    -----
    In wheel hop the body is almost at rest, and the damper acts between wheel and body. The ground
    acts through the tyre alone, so that T = p / sqrt((1 - r²)² + (2 z r)²) with p = kt / (ks + kt).
    Eq. 3-7 of Smith (2009) has the damper between wheel and road, with the numerator
    sqrt(1 + (2 z r)²): this is model "thesis".

    Examples
    --------
    >>> print(hop_transmissibility([0.5, 1.0], 0.3))
    [1.238 1.667]
    >>> print(hop_transmissibility([0.5, 1.0], 0.3, model="thesis"))
    [1.292 1.944]
    """
    r = np.asarray(ratio, dtype=float)
    if not (np.isfinite(r) & (r >= 0)).all():
        message = f"ratio must be finite and at least 0, got {ratio!r}."
        raise ValueError(message)
    _check_inputs(damping, model, tyre_stiffness_fraction)
    above = (
        tyre_stiffness_fraction if model == "base-excited" else np.sqrt(1 + (2 * damping * r) ** 2)
    )
    out: Floats = above / np.hypot(1 - r**2, 2 * damping * r)
    return out


def hop_lag(ratio: float, damping: float, *, model: HopModel = "base-excited") -> float:
    """Phase lag of a wheel behind the ground near wheel hop, as a fraction of a wavelength.

    Parameters
    ----------
    ratio : float
        Frequency of the ground over the undamped frequency of wheel hop [1].
    damping : float
        Damping ratio of wheel hop [1].
    model : {"base-excited", "thesis"}
        Oscillator; see `hop_transmissibility`.

    Returns
    -------
    float
        Fraction of a wavelength, that is of the spacing of cleats, from 0 to 0.5 [1].

    Raises
    ------
    ValueError
        If the ratio is negative, or the damping not between 0 and 1.

    Examples
    --------
    >>> print(hop_lag(1.0, 0.3), round(hop_lag(1.0, 0.3, model="thesis"), 3))
    0.25 0.164
    """
    if not 0 <= ratio < math.inf:
        message = f"ratio must be finite and at least 0, got {ratio}."
        raise ValueError(message)
    _check_inputs(damping, model, 1.0)
    lag = math.atan2(2 * damping * ratio, 1 - ratio**2)
    if model == "thesis":  # the damper to the road advances the excitation
        lag -= math.atan(2 * damping * ratio)
    return lag / (2 * math.pi)


def peak_ratio(damping: float, *, model: HopModel = "base-excited") -> float:
    """Frequency of greatest transmissibility over the undamped frequency of wheel hop.

    Parameters
    ----------
    damping : float
        Damping ratio of wheel hop [1].
    model : {"base-excited", "thesis"}
        Oscillator.

    Returns
    -------
    float
        Ratio [1]; 0 if damping is so large that the transmissibility has no peak.

    Notes
    -----
    r² = 1 - 2 z² for the base-excited model. Smith (2009) uses the same for Eq. 3-7, but the peak
    of that equation is at r² = (sqrt(1 + 8 z²) - 1) / (2 z)², for any damping.

    Examples
    --------
    >>> print(peak_ratio(0.3), peak_ratio(0.3, model="thesis"))
    0.9055 0.9302
    """
    _check_inputs(damping, model, 1.0)
    if model == "base-excited":
        return math.sqrt(max(1 - 2 * damping**2, 0.0))
    return math.sqrt(math.sqrt(1 + 8 * damping**2) - 1) / (2 * damping)


def cleat_ratio(
    damping: float,
    *,
    model: HopModel = "base-excited",
    tyre_stiffness_fraction: float = 1.0,
    ratio: float | None = None,
) -> float:
    """Width of a cleat over the spacing for which a wheel in hop touches both of its edges.

    Parameters
    ----------
    damping : float
        Damping ratio of wheel hop [1].
    model : {"base-excited", "thesis"}
        "thesis" is Eq. 3-13 of Smith (2009) as printed, "base-excited" the corrected one.
    tyre_stiffness_fraction : float
        See `hop_transmissibility`; the thesis neglects it [1].
    ratio : float, optional
        Frequency at which a wheel meets cleats over that of wheel hop; by default that of the
        greatest motion, for which the thesis takes sqrt(1 - 2 z²) [1].

    Returns
    -------
    float
        w / a [1].

    Raises
    ------
    ValueError
        If the transmissibility is not greater than 1: then no wheel touches both edges.

    Notes
    -----
    On ground of amplitude h/2 the wheel oscillates with amplitude T h/2 about half the height of
    the cleats. It is above the edges during the fraction of a period in which T cos(pi x / a) > 1,
    so that w / a = acos(1 / T) / pi. Eqs. 3-9 to 3-13 of the thesis let the wheel oscillate at the
    *damped natural* frequency, which divides the result by sqrt(1 - z²); but a steady response has
    the frequency of the excitation. Both neglect the phase lag of the wheel.

    This is a rule of construction, not an optimum: hop grows with w / a as the first harmonic of
    the cleats, 2 h / pi sin(pi w / a), up to w / a = 0.5.

    Examples
    --------
    >>> print(round(cleat_ratio(0.3, model="thesis"), 4), round(cleat_ratio(0.3), 4))
    0.3483 0.306
    """
    _check_inputs(damping, model, tyre_stiffness_fraction)
    frequency = peak_ratio(damping) if ratio is None else ratio
    gain = float(
        hop_transmissibility(
            frequency, damping, model=model, tyre_stiffness_fraction=tyre_stiffness_fraction
        )
    )
    if gain <= 1:
        message = (
            f"damping must let a wheel in hop move more than the ground, "
            f"got {damping:g} (amplified {gain:.3g} times)."
        )
        raise ValueError(message)
    stretched = math.sqrt(1 - damping**2) if model == "thesis" else 1.0
    return math.acos(1 / gain) / (math.pi * stretched)


def event_errata(
    damping: float = 0.3, tyre_stiffness_fraction: float = 0.912
) -> tuple[Erratum, ...]:
    """Errata of the event's design in Smith (2009), section 3.3, in numbers.

    Parameters
    ----------
    damping : float
        Damping ratio of wheel hop [1].
    tyre_stiffness_fraction : float
        Stiffness of the tyre over the sum of those of tyre and suspension [1].

    Returns
    -------
    tuple of Erratum
        Printed and corrected values; NaN if a wheel in hop moves less than the ground, so that the
        rule has no solution.

    Examples
    --------
    >>> for one in event_errata()[:3]:
    ...     print(f"{one.place}: {one.quantity}: {one.printed:.4f}, right {one.right:.4f}")
    3-7: ratio of the peak: 0.9055, right 0.9302
    3-7: amplification at the peak: 1.9884, right 1.9946
    3-5: amplification at V = a f2: 1.9884, right 1.9437
    """
    thesis, shown = peak_ratio(damping, model="thesis"), peak_ratio(damping)

    def gain(ratio: float) -> float:
        return float(hop_transmissibility(ratio, damping, model="thesis"))

    def right(fraction: float, ratio: float | None = None) -> float:
        try:
            return cleat_ratio(damping, tyre_stiffness_fraction=fraction, ratio=ratio)
        except ValueError:  # the wheel moves less than the ground
            return math.nan

    printed = cleat_ratio(damping, model="thesis")
    rows = (
        (
            "3-7",
            "ratio of the peak",
            shown,
            thesis,
            "sqrt(1 - 2 z²) is the peak under a force, not on moving ground.",
        ),
        ("3-7", "amplification at the peak", gain(shown), gain(thesis), "The same, in amplitude."),
        (
            "3-5",
            "amplification at V = a f2",
            gain(shown),
            gain(1.0),
            "V = a f2 means r = 1, not the peak.",
        ),
        (
            "3-13",
            "w/a without the factor of damping",
            printed,
            math.acos(1 / gain(shown)) / math.pi,
            "The wheel oscillates as it meets cleats, not at its damped frequency.",
        ),
        (
            "3-13",
            "w/a at the peak of 3-7",
            printed,
            math.acos(1 / gain(thesis)) / math.pi,
            "Both of these.",
        ),
        (
            "3-14",
            "w/a, damper on the body, soft suspension",
            printed,
            right(1.0),
            "The damper acts on the body, which stands still, not on the road.",
        ),
        (
            "3-14",
            "w/a, damper on the body",
            printed,
            right(tyre_stiffness_fraction),
            "The suspension holds the wheel as well.",
        ),
        (
            "3-14",
            "w/a, damper on the body, V = a f2",
            printed,
            right(tyre_stiffness_fraction, 1.0),
            "The same at V = a f2.",
        ),
        (
            "3-9",
            "lag over spacing, at the printed peak",
            0.0,
            hop_lag(shown, damping, model="thesis"),
            "The crest of the wheel comes after the cleat.",
        ),
        (
            "3-9",
            "lag over spacing, damper on the body, V = a f2",
            0.0,
            hop_lag(1.0, damping),
            "The same; a quarter of a wave at resonance.",
        ),
    )
    speed, spacing = 2 * _LENGTH * _RIDE, 2 * _LENGTH * _RIDE / _HOP
    sizes = (
        (
            "3.5.2",
            "speed for 2.44 m and 1.1 Hz",
            5.79,
            speed,
            "m/s",
            "13 miles per hour are for a ride of 1.19 Hz.",
        ),
        (
            "3-15",
            "spacing for that speed and 11 Hz",
            0.567,
            spacing,
            "m",
            "1.86 feet are not the 0.49 m before them.",
        ),
        (
            "3-16",
            "speed of that spacing and 10.3 Hz",
            5.84,
            speed,
            "m/s",
            "Wheel hop is 11 Hz before, and the spacing another.",
        ),
    )
    return tuple(
        Erratum(place=place, quantity=name, printed=old, right=new, unit=unit, why=why)
        for place, name, old, new, unit, why in (*((*row[:4], "1", row[4]) for row in rows), *sizes)
    )


def _check_inputs(damping: float, model: str, tyre_stiffness_fraction: float) -> None:
    if not 0 < damping < 1:
        message = f"damping must be greater than 0 and less than 1, got {damping}."
        raise ValueError(message)
    if model not in get_args(HopModel):
        message = f"model must be one of {', '.join(get_args(HopModel))}, got {model!r}."
        raise ValueError(message)
    if not 0 < tyre_stiffness_fraction <= 1:
        message = (
            "tyre_stiffness_fraction must be greater than 0 and at most 1, got "
            f"{tyre_stiffness_fraction}."
        )
        raise ValueError(message)
