"""Ride and wheel hop from recorded accelerations: frequency and damping, and how sure they are."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from trueterrain.core.spectral_density import welch_density
from trueterrain.vehicle._velocity import (
    VelocitySpectrum,
    integrate_acceleration,
    segment_size,
    velocity_spectrum,
)
from trueterrain.vehicle.model import Array, LinearModel, frequency_response, linear_model
from trueterrain.vehicle.modes import vehicle_modes
from trueterrain.vehicle.parameters import QuarterCarParameters

__all__ = [
    "IdentifiedMode",
    "IdentifiedModes",
    "ModeRecording",
    "VelocitySpectrum",
    "identify_modes",
    "integrate_acceleration",
    "velocity_spectrum",
]

_HANN_CORRELATION = 1.94  # [1] sum of the correlations of power between bins of a Hann window
_SLOWEST, _FASTEST = 0.3, 40.0  # [Hz] between which modes are looked for
_LEAKAGE = 0.03  # [1] of power, what finite segments do to the ratio of two signals besides
_BOUNDLESS = 50.0  # [1] logarithm from which an interval has no end worth a number
_FARTHEST = 4.0  # [1] logarithm by which parameters may leave those that are begun with
_SEEN, _LINES = 1.75, 15  # bins to either side that a Hann window sees, and parts of them
_TINY = 1e-9
_STEP = 1e-4  # [1] of logarithms, over which derivatives are taken
_FREEDOMS = {"body": 0, "wheel": 1}  # of a quarter car


@dataclass(frozen=True, kw_only=True, eq=False)
class ModeRecording:
    """Accelerations of a vehicle on a shaker or on a road.

    They must have been filtered against aliasing before they were sampled: on a road, a wheel moves
    hundreds of times a second, which would be taken for slow motion.

    Examples
    --------
    >>> drive = ModeRecording(accelerations={"body": np.arange(4000) % 2}, rate=200.0, waviness=2.0)
    >>> drive.duration
    20.0
    """

    accelerations: Mapping[str, npt.ArrayLike]
    """Upwards, of the body above the wheel ("body"), of the wheel ("wheel") or both, each of shape
    (n,) [m/s²]."""

    rate: float
    "Samples per second [Hz]."

    excitation: npt.ArrayLike | None = None
    """Acceleration of what shakes the wheels, shape (n,) [m/s²]; None if it was not recorded. Then
    its spectrum is taken to fall as that of `waviness`."""

    waviness: float = 0.0
    """How the density of the height under the wheels falls with frequency: f^-waviness; 2 on roads,
    0 for a sweep at a steady rate in Hz/s and of steady amplitude [1]."""

    band: tuple[float, float] = (0.7, 25.0)
    "Frequencies that were excited [Hz]."

    segment: float | None = None
    "Length of the segments of Welch's method [s]; by default 8 s, or a quarter if that is shorter."

    def __post_init__(self) -> None:
        """Check the values."""
        if not 0 < self.rate < math.inf:
            message = f"rate must be finite and greater than 0 Hz, got {self.rate}."
            raise ValueError(message)
        if not self.accelerations or not set(self.accelerations) <= set(_FREEDOMS):
            message = f"accelerations must be of body, wheel or both, got {[*self.accelerations]}."
            raise ValueError(message)
        signals = dict(self.accelerations)
        if self.excitation is not None:
            signals["excitation"] = self.excitation
        sizes = {name: np.asarray(values).shape for name, values in signals.items()}
        for name, shape in sizes.items():
            if len(shape) != 1 or shape != next(iter(sizes.values())):
                message = f"accelerations must have one and the same length, got {shape} of {name}."
                raise ValueError(message)
            if not np.isfinite(np.asarray(signals[name], dtype=float)).all():
                message = f"accelerations must be finite; {name} has gaps."
                raise ValueError(message)
            if np.ptp(np.asarray(signals[name], dtype=float)) == 0:
                message = f"accelerations must show a motion; {name} does not move."
                raise ValueError(message)
        low, high = self.band
        if not 0 < low < high < self.rate / 2:
            message = (
                f"band must ascend between 0 and half the rate, {self.rate / 2:g} Hz, "
                f"got {low:g} to {high:g} Hz."
            )
            raise ValueError(message)

    @property
    def duration(self) -> float:
        """Length of the recording [s]."""
        return len(np.asarray(next(iter(self.accelerations.values())))) / self.rate


@dataclass(frozen=True, kw_only=True)
class IdentifiedMode:
    """A mode as found in recordings, with standard uncertainties."""

    name: str
    "ride or hop."

    frequency: float
    "Natural frequency: modulus of the eigenvalue over 2 pi [Hz]."

    frequency_sd: float
    "Its standard uncertainty [Hz]."

    damping: float
    "Damping ratio [1]."

    damping_sd: float
    "Its standard uncertainty [1]."

    frequency_interval: tuple[float, float]
    "Confidence interval of the frequency [Hz]."

    damping_interval: tuple[float, float]
    "Confidence interval of the damping ratio [1]."


@dataclass(frozen=True, kw_only=True, eq=False)
class IdentifiedModes:
    """Ride and hop, and how well a quarter car explains the spectra; made by `identify_modes`."""

    ride: IdentifiedMode
    "Primary ride."

    hop: IdentifiedMode
    "Wheel hop."

    scatter: float
    "Scatter of the spectra about the fit over what it should be; 1 if a quarter car suffices."

    confidence: float
    "Confidence of the intervals."

    car: QuarterCarParameters
    "The quarter car that was fitted, of a sprung mass of 1 kg."

    spectra: Mapping[str, VelocitySpectrum] = field(default_factory=dict)
    "Density of velocity of each signal, by number of the recording and name."


def identify_modes(
    recordings: ModeRecording | Sequence[ModeRecording],
    *,
    confidence: float = 0.95,
    start: tuple[float, float] = (1.3, 11.0),
) -> IdentifiedModes:
    """Frequency and damping of primary ride and wheel hop from accelerations.

    Parameters
    ----------
    recordings : ModeRecording or sequence of ModeRecording
        One or several recordings of one vehicle, such as two sweeps of a shaker. Modes are the
        surer, the more of body, wheel and what shook them was recorded.
    confidence : float
        Confidence of the intervals.
    start : tuple of float
        Where ride and hop are looked for first [Hz].

    Returns
    -------
    IdentifiedModes
        Both modes with their uncertainties.

    Raises
    ------
    ValueError
        If confidence or start break their rule, or there is less to fit than is to be found.

    Notes
    -----
    Smith (2009, section 3.3.1) reads the peaks of the density of velocity from two sweeps (Figs.
    3-8 and 3-9). The peak of a mode that is damped by 0.3 is wide, and not where the mode is. Here
    a quarter car is fitted to the logarithms of the power of all signals at once, and the modes are
    its modes. If what shook the wheels was recorded, signals are taken over it. Otherwise the power
    of the first signal is fitted with a gain of its own, and what the other signal is to it, which
    the unknown excitation does not touch. Weights are those of chi² and of the coherence. If the
    spectra scatter more about the fit than that, as those of vehicles with more modes do,
    uncertainties grow in proportion.

    Examples
    --------
    >>> from trueterrain.vehicle import GOLDEN_QUARTER_CAR, linear_model, respond
    >>> rng = np.random.default_rng(1)
    >>> road = np.cumsum(rng.standard_normal(200000)) * 2e-4  # waviness 2
    >>> moved = respond(linear_model(GOLDEN_QUARTER_CAR), 1 / 1000, road)
    >>> signals = dict(zip(("body", "wheel"), moved.acceleration.T))
    >>> found = identify_modes(ModeRecording(accelerations=signals, rate=1000.0, waviness=2.0))
    >>> for mode in (found.ride, found.hop):
    ...     print(f"{mode.frequency:.2f} +- {mode.frequency_sd:.2f} Hz, "
    ...           f"damping {mode.damping:.2f} +- {mode.damping_sd:.2f}")
    1.24 +- 0.00 Hz, damping 0.33 +- 0.00
    10.81 +- 0.06 Hz, damping 0.31 +- 0.01
    """
    if not 0 < confidence < 1:
        message = f"confidence must be between 0 and 1, got {confidence}."
        raise ValueError(message)
    if not _SLOWEST < start[0] < start[1] < _FASTEST:
        message = f"start must ascend from {_SLOWEST} to {_FASTEST} Hz, got {start}."
        raise ValueError(message)
    several = [recordings] if isinstance(recordings, ModeRecording) else list(recordings)
    if not several:
        message = "recordings must hold at least one recording."
        raise ValueError(message)
    powers = [power for number, one in enumerate(several) for power in _signal_powers(one, number)]
    return _fit_modes(powers, start, confidence, _signal_spectra(several, confidence))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Power:
    """Power of a signal over that of the excitation, or of another signal."""

    signal: str
    over: str | None
    free: bool  # its gain is not known
    recording: int
    waviness: float
    bin: float
    frequency: Array
    log: Array
    sd: Array


def _signal_spectra(
    several: Sequence[ModeRecording], confidence: float
) -> dict[str, VelocitySpectrum]:
    return {
        f"{number}: {name}": velocity_spectrum(
            values, one.rate, segment=one.segment, confidence=confidence
        )
        for number, one in enumerate(several, start=1)
        for name, values in one.accelerations.items()
    }


def _signal_powers(one: ModeRecording, number: int) -> list[_Power]:
    """Each signal over the excitation; if that is not known, over the first signal.

    Signals that come from one road scatter alike, so that what they are to each other is known far
    better than any of them: only the first one is taken by itself.
    """
    from scipy.special import digamma, polygamma

    signals = {name: np.asarray(values, dtype=float) for name, values in one.accelerations.items()}
    first = next(iter(signals))
    size = segment_size(signals[first].size, one.rate, one.segment)
    over = None if one.excitation is None else np.asarray(one.excitation, dtype=float)
    out = []
    for name, signal in signals.items():
        if over is None and name == first:
            frequency, density, degrees = welch_density(signal, signal, one.rate, size)
            log = np.log(density.real)
            log -= float(digamma(degrees / 2)) - math.log(degrees / 2)
            sd = np.full(frequency.size, math.sqrt(float(polygamma(1, degrees / 2))))
        else:
            base = signals[first] if over is None else over
            frequency, cross, degrees = welch_density(base, signal, one.rate, size)
            power = welch_density(base, base, one.rate, size)[1].real
            own = welch_density(signal, signal, one.rate, size)[1].real
            log = 2 * np.log(np.abs(cross) / power)
            incoherence = np.maximum(power * own / np.abs(cross) ** 2 - 1, 0.0)
            # noise of the base makes the ratio too small, by as much as incoherence at most
            sd = np.sqrt(4 * incoherence / degrees + incoherence**2 + _LEAKAGE**2)
        inside = (frequency >= one.band[0]) & (frequency <= one.band[1])
        out.append(
            _Power(
                signal=name,
                over=first if over is None and name != first else None,
                free=over is None and name == first,
                recording=number,
                waviness=one.waviness,
                bin=one.rate / size,
                frequency=frequency[inside],
                log=log[inside],
                sd=sd[inside],
            )
        )
    return out


def _fit_modes(
    powers: Sequence[_Power],
    start: tuple[float, float],
    confidence: float,
    spectra: Mapping[str, VelocitySpectrum],
) -> IdentifiedModes:
    from scipy.optimize import least_squares
    from scipy.stats import t as student

    free = sorted({power.recording for power in powers if power.free})
    unknowns = 4 + len(free)
    values = sum(power.frequency.size for power in powers)
    if values < 4 * unknowns:
        message = (
            f"recordings must hold at least {4 * unknowns} values of spectra within their bands, "
            f"got {values}; choose longer segments or wider bands."
        )
        raise ValueError(message)

    def residuals(unknown: Array) -> Array:
        gains = dict(zip(free, unknown[4:], strict=True))
        model = linear_model(_quarter_car(unknown[:4]))
        parts = []
        for power in powers:
            gain = gains[power.recording] if power.free else 0.0
            parts.append((power.log - _log_power(model, power) - gain) / power.sd)
        return np.concatenate(parts)

    begin = np.concatenate([_start_parameters(start), np.zeros(len(free))])
    for at, recording in enumerate(free, start=4):
        model = linear_model(_quarter_car(begin[:4]))
        begin[at] = np.mean(
            [
                (power.log - _log_power(model, power)).mean()
                for power in powers
                if power.free and power.recording == recording
            ]
        )
    reach = np.concatenate([np.full(4, _FARTHEST), np.full(len(free), np.inf)])
    found = least_squares(residuals, begin, bounds=(begin - reach, begin + reach), x_scale="jac")
    degrees = values - unknowns
    scatter = float(np.sqrt((found.fun**2).sum() / degrees))
    covariance = np.linalg.pinv(found.jac.T @ found.jac)[:4, :4]
    covariance *= max(scatter, 1.0) ** 2 * _HANN_CORRELATION
    slope = _mode_derivatives(found.x[:4])
    sd = np.sqrt(np.diag(slope @ covariance @ slope.T))
    far = float(student.ppf(0.5 + confidence / 2, degrees / _HANN_CORRELATION))
    logs = _log_modes(found.x[:4])
    ride, hop = (
        _identified_mode(name, logs[at : at + 2], sd[at : at + 2], far)
        for name, at in (("ride", 0), ("hop", 2))
    )
    return IdentifiedModes(
        ride=ride,
        hop=hop,
        scatter=scatter,
        confidence=confidence,
        spectra=spectra,
        car=_quarter_car(found.x[:4]),
    )


def _start_parameters(start: tuple[float, float]) -> Array:
    """Logarithms of the parameters of a quarter car with about these frequencies."""
    ride, hop = (2 * math.pi * frequency for frequency in start)
    share = 0.15
    return np.log([share, ride**2, 0.7 * ride, share * hop**2])


def _quarter_car(logs: Array) -> QuarterCarParameters:
    unsprung, spring, damper, tyre = np.exp(logs).tolist()
    return QuarterCarParameters(
        sprung_mass=1.0,
        unsprung_mass=unsprung,
        suspension_stiffness=spring,
        suspension_damping=damper,
        tyre_stiffness=tyre,
    )


def _log_power(model: LinearModel, power: _Power) -> Array:
    """Logarithm of the power of a signal, or of it over the excitation or the other signal.

    Each bin of a Hann window sees three bins: so does the model, weighted as the excitation is.
    """
    offsets = np.linspace(-_SEEN, _SEEN, _LINES)
    single = np.abs(np.abs(offsets) - 1) < _TINY  # where the formula is 0 / 0
    window = (np.sinc(offsets) / np.where(single, 1.0, 1 - offsets**2)) ** 2
    window[single] = 0.25
    frequency = np.abs(power.frequency[:, None] + power.bin * offsets)
    weight = window / window.sum() * frequency ** (4 - power.waviness)  # of acceleration
    gain = frequency_response(model, frequency)[..., 0]
    own = gain[..., _FREEDOMS[power.signal]]
    if power.free:
        return np.asarray(np.log((weight * np.abs(own) ** 2).sum(axis=1)))
    over = np.ones(1) if power.over is None else gain[..., _FREEDOMS[power.over]]
    cross = (weight * own * np.conj(over)).sum(axis=1)
    return np.asarray(2 * np.log(np.abs(cross) / (weight * np.abs(over) ** 2).sum(axis=1)))


def _log_modes(logs: Array) -> Array:
    """Logarithms of frequency and damping ratio of ride and hop."""
    found = vehicle_modes(linear_model(_quarter_car(logs)))
    return np.log(np.column_stack([found.natural_frequency, found.damping_ratio]).ravel())


def _mode_derivatives(logs: Array) -> Array:
    """Derivatives of the modes by the parameters, shape (4, 4)."""
    columns = []
    for at in range(4):
        step = np.zeros(4)
        step[at] = _STEP
        columns.append((_log_modes(logs + step) - _log_modes(logs - step)) / (2 * _STEP))
    return np.array(columns).T


def _identified_mode(name: str, logs: Array, sd: Array, reach: float) -> IdentifiedMode:
    frequency, damping = np.exp(logs).tolist()
    far = np.minimum(reach * sd, _BOUNDLESS)
    ends = np.exp([logs - far, logs + far])
    return IdentifiedMode(
        name=name,
        frequency=frequency,
        frequency_sd=frequency * float(sd[0]),
        damping=damping,
        damping_sd=damping * float(sd[1]),
        frequency_interval=(float(ends[0, 0]), float(ends[1, 0])),
        damping_interval=(float(ends[0, 1]), float(ends[1, 1])),
    )
