"""Velocity and its spectral density from recorded accelerations, free of integration drift."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

from trueterrain.core.spectral_density import density_interval, welch_density
from trueterrain.vehicle.model import Array

_MIN_SEGMENT = 16  # samples of a segment
_PAD = 5.0  # [1] length of the tapers at both ends, in periods of the corner frequency
_ORDER = 4  # of the high-pass filter


@dataclass(frozen=True, kw_only=True, eq=False)
class VelocitySpectrum:
    """Spectral density of velocity with its confidence interval; made by `velocity_spectrum`."""

    frequency: Array
    "Shape (n,) [Hz]."

    density: Array
    "Shape (n,) [(m/s)²/Hz]."

    low: Array
    "Lower end of the confidence interval, shape (n,) [(m/s)²/Hz]."

    high: Array
    "Upper end of the confidence interval, shape (n,) [(m/s)²/Hz]."

    degrees: float
    "Degrees of freedom of each estimate."


def integrate_acceleration(
    acceleration: npt.ArrayLike, rate: float, *, corner: float = 0.3
) -> Array:
    """Velocity from acceleration by integration in the frequency domain, with a high-pass filter.

    Plain integration of a recorded acceleration drifts, as its bias grows without bound. Use this
    for the vibration of a body or a wheel.

    Parameters
    ----------
    acceleration : array_like, shape (n,)
        Acceleration [m/s²].
    rate : float
        Samples per second [Hz].
    corner : float
        Frequency at which the filter passes half of the velocity; 6 % at half of it, 94 % at twice
        of it [Hz].

    Returns
    -------
    numpy.ndarray, shape (n,)
        Velocity without its slow part, without phase shift at any frequency [m/s].

    Raises
    ------
    ValueError
        If the rate or the corner is not greater than 0, or the acceleration has gaps.

    Notes
    -----
    The transform is multiplied by 1 / (2 pi i f) and by the filter 1 / (1 + (fc / f)^4). This is
    exact up to half the sampling rate, where the trapezoidal rule attenuates, and removes bias and
    drift. Both ends are tapered to zero over some periods of the corner; within one such period of
    an end the velocity is less accurate.

    Examples
    --------
    >>> t = np.arange(0, 60, 0.005)
    >>> velocity = integrate_acceleration(np.cos(2 * np.pi * 2.0 * t) + 0.05, 200.0)
    >>> error = velocity - np.sin(2 * np.pi * 2.0 * t) / (2 * np.pi * 2.0)
    >>> print(f"{abs(error[2000:-2000]).max() / abs(velocity).max():.4f}")
    0.0005
    """
    values = np.asarray(acceleration, dtype=float)
    if not 0 < corner < rate / 2 < math.inf:
        message = f"corner must be from 0 Hz to half the rate of {rate:g} Hz, got {corner:g} Hz."
        raise ValueError(message)
    if values.ndim != 1 or values.size < 2 or not np.isfinite(values).all():
        message = f"acceleration must have one dimension and no gap, got shape {values.shape}."
        raise ValueError(message)
    pad = math.ceil(_PAD * rate / corner)
    size = next_fast_len(values.size + 2 * pad)
    fade = 0.5 - 0.5 * np.cos(np.pi * np.arange(pad) / pad)
    levelled = values - values.mean()
    padded = np.zeros(size)
    # odd extension: the record is mirrored with its sign reversed, so that it has no step at the
    # ends and the tapers do not ring
    inner = min(pad, values.size - 1)
    padded[pad - inner : pad] = -levelled[inner:0:-1]
    padded[pad : pad + values.size] = levelled
    padded[pad + values.size : pad + values.size + inner] = -levelled[-2 : -2 - inner : -1]
    padded[:pad] *= fade
    padded[pad + values.size : 2 * pad + values.size] *= fade[::-1]
    frequency = rfftfreq(size, 1 / rate)
    weight = np.zeros(frequency.size, dtype=complex)
    f = frequency[1:]
    # integration is a division by 2 pi i f; the filter removes the pole at f = 0
    weight[1:] = 1 / (2j * np.pi * f * (1 + (corner / f) ** _ORDER))
    out: Array = irfft(weight * rfft(padded), size)[pad : pad + values.size]
    return out


def velocity_spectrum(
    acceleration: npt.ArrayLike,
    rate: float,
    *,
    segment: float | None = None,
    confidence: float = 0.95,
    corner: float = 0.3,
) -> VelocitySpectrum:
    """Spectral density of velocity from acceleration, by Welch's method.

    Parameters
    ----------
    acceleration : array_like, shape (n,)
        Acceleration [m/s²].
    rate : float
        Samples per second [Hz].
    segment : float, optional
        Length of the segments, which overlap by half and have Hann windows [s]; by default 8 s, or
        a quarter of the record if that is shorter.
    confidence : float
        Fraction of repeats in which the interval holds the density.
    corner : float
        Corner frequency of `integrate_acceleration`; the density is divided by the response of that
        filter [Hz].

    Returns
    -------
    VelocitySpectrum
        At the frequencies above the corner.

    Raises
    ------
    ValueError
        If the segment, the confidence, the rate or the corner is out of its bounds.

    Examples
    --------
    >>> noise = np.random.default_rng(1).standard_normal(20000)
    >>> found = velocity_spectrum(noise, 200.0)
    >>> print(f"{found.degrees:.0f} degrees of freedom")
    46 degrees of freedom
    """
    if not 0 < confidence < 1:
        message = f"confidence must be between 0 and 1, got {confidence}."
        raise ValueError(message)
    velocity = integrate_acceleration(acceleration, rate, corner=corner)
    size = segment_size(velocity.size, rate, segment)
    frequency, density, degrees = welch_density(velocity, velocity, rate, size)
    keep = frequency > corner
    frequency = frequency[keep]
    # the square of the filter is taken out, so that the density is unbiased near the corner
    power: Array = density.real[keep] * (1 + (corner / frequency) ** _ORDER) ** 2
    low, high = density_interval(degrees, confidence)
    return VelocitySpectrum(
        frequency=frequency,
        density=power,
        low=low * power,
        high=high * power,
        degrees=degrees,
    )


def segment_size(samples: int, rate: float, segment: float | None) -> int:
    """Number of samples of a segment of given length [s]; by default 8 s, or a quarter of all."""
    length = min(8.0, samples / rate / 4) if segment is None else segment
    size = round(length * rate)
    if not _MIN_SEGMENT <= size <= samples:
        message = (
            f"segment must be from {_MIN_SEGMENT / rate:g} s to the {samples / rate:g} s recorded, "
            f"got {length:g} s."
        )
        raise ValueError(message)
    return size
