"""Modal identification: frequency and damping of ride and wheel hop from accelerations."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares
from scipy.special import digamma, polygamma
from scipy.stats import t as student

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
_MIN_FREQUENCY, _MAX_FREQUENCY = 0.3, 40.0  # [Hz] of the modes that are searched for
_LEAKAGE = 0.03  # [1] relative error of a power ratio by the leakage of finite segments
_MAX_LOG = 50.0  # [1] bound of the logarithmic half width of an interval
_MAX_CHANGE = 4.0  # [1] bound of the change of a parameter's logarithm from its start value
_WINDOW_BINS, _LINES = 1.75, 15  # bins of a Hann window to either side, and lines that sample it
_TINY = 1e-9
_STEP = 1e-4  # [1] step of the logarithms in central differences
_SIGNALS = {"body": 0, "wheel": 1}  # degrees of freedom of a quarter car


@dataclass(frozen=True, kw_only=True, eq=False)
class ModeRecording:
    """Accelerations of a vehicle on a shaker or on a road.

    They must have passed an anti-aliasing filter before sampling: on a road, a wheel vibrates at
    hundreds of hertz, which would alias into the band of the modes.

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
    """Acceleration of the ground or shaker under the wheels, shape (n,) [m/s²]; None if it was not
    recorded. Then its spectrum is assumed to follow `waviness`."""

    waviness: float = 0.0
    """Waviness of the excitation: the displacement density falls as f^-waviness; 2 on roads, 0 for
    a sweep of constant rate in Hz/s and constant amplitude [1]."""

    band: tuple[float, float] = (0.7, 25.0)
    "Band of frequencies that were excited [Hz]."

    segment: float | None = None
    "Length of the segments of Welch's method [s]; by default 8 s, or a quarter if that is shorter."

    def __post_init__(self) -> None:
        """Check the values."""
        if not 0 < self.rate < math.inf:
            message = f"rate must be finite and greater than 0 Hz, got {self.rate}."
            raise ValueError(message)
        if not self.accelerations or not set(self.accelerations) <= set(_SIGNALS):
            message = f"accelerations must be of body, wheel or both, got {[*self.accelerations]}."
            raise ValueError(message)
        signals = dict(self.accelerations)
        if self.excitation is not None:
            signals["excitation"] = self.excitation
        sizes = {name: np.asarray(values).shape for name, values in signals.items()}
        for name, shape in sizes.items():
            if len(shape) != 1 or shape != next(iter(sizes.values())):
                message = f"accelerations must all have one length, got {shape} of {name}."
                raise ValueError(message)
            if not np.isfinite(np.asarray(signals[name], dtype=float)).all():
                message = f"accelerations must be finite; {name} has gaps."
                raise ValueError(message)
            if np.ptp(np.asarray(signals[name], dtype=float)) == 0:
                message = f"accelerations must vary; {name} is constant."
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
    """A mode identified in recordings, with standard uncertainties."""

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
    """Ride and hop, and the fit of a quarter car to the spectra; made by `identify_modes`."""

    ride: IdentifiedMode
    "Primary ride."

    hop: IdentifiedMode
    "Wheel hop."

    scatter: float
    "Scatter of the spectra about the fit over its expected value; 1 if a quarter car suffices."

    confidence: float
    "Confidence level of the intervals."

    car: QuarterCarParameters
    "The fitted quarter car, with a sprung mass of 1 kg."

    spectra: Mapping[str, VelocitySpectrum] = field(default_factory=dict)
    "Velocity density of each signal, by number of the recording and name."


def identify_modes(
    recordings: ModeRecording | Sequence[ModeRecording],
    *,
    confidence: float = 0.95,
    start: tuple[float, float] = (1.3, 11.0),
) -> IdentifiedModes:
    """Identify frequency and damping of primary ride and wheel hop from accelerations.

    Use it to design an excitation event for a vehicle whose parameters are not known.

    Parameters
    ----------
    recordings : ModeRecording or sequence of ModeRecording
        One or several recordings of one vehicle, such as two sweeps of a shaker. Uncertainty is
        least if body, wheel and excitation were all recorded.
    confidence : float
        Confidence level of the intervals.
    start : tuple of float
        Start values of the frequencies of ride and hop [Hz].

    Returns
    -------
    IdentifiedModes
        Both modes with their uncertainties.

    Raises
    ------
    ValueError
        If confidence or start is out of its bounds, or the spectra have too few values.

    Notes
    -----
    Smith (2009, section 3.3.1) reads the peaks of the velocity density from two sweeps (Figs. 3-8
    and 3-9). The peak of a mode with a damping ratio of 0.3 is wide and lies beside the frequency
    of the mode. Here a quarter car is fitted to the logarithms of the power of all signals at once,
    and the modes are its modes. If the excitation was recorded, the signals are divided by it.
    Otherwise the power of the first signal is fitted with a free gain, and the ratio of the other
    signal to it, which does not depend on the unknown excitation. Weights follow from the
    chi-square distribution of the power and from the coherence. If the spectra scatter more about
    the fit than these weights predict, as those of vehicles with more modes do, the uncertainties
    are enlarged in proportion.

    Examples
    --------
    >>> from trueterrain.vehicle import GOLDEN_QUARTER_CAR, linear_model, simulate_response
    >>> rng = np.random.default_rng(1)
    >>> road = np.cumsum(rng.standard_normal(200000)) * 2e-4  # waviness 2
    >>> moved = simulate_response(linear_model(GOLDEN_QUARTER_CAR), 1 / 1000, road)
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
    if not _MIN_FREQUENCY < start[0] < start[1] < _MAX_FREQUENCY:
        message = f"start must ascend from {_MIN_FREQUENCY} to {_MAX_FREQUENCY} Hz, got {start}."
        raise ValueError(message)
    several = [recordings] if isinstance(recordings, ModeRecording) else list(recordings)
    if not several:
        message = "recordings must hold at least one recording."
        raise ValueError(message)
    powers = [power for number, one in enumerate(several) for power in _signal_powers(one, number)]
    return _fit_modes(powers, start, confidence, _signal_spectra(several, confidence))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Power:
    """Power of a signal, or its ratio to the power of the excitation or of another signal."""

    signal: str
    over: str | None
    free: bool  # its gain is unknown, as that of the excitation
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
    """Power of each signal over that of the excitation or, without it, over that of the first one.

    Signals from one road have correlated scatter, so that their ratio is known far better than
    either of them: only the first signal is used by itself.
    """
    signals = {name: np.asarray(values, dtype=float) for name, values in one.accelerations.items()}
    first = next(iter(signals))
    size = segment_size(signals[first].size, one.rate, one.segment)
    over = None if one.excitation is None else np.asarray(one.excitation, dtype=float)
    out = []
    for name, signal in signals.items():
        if over is None and name == first:
            frequency, density, degrees = welch_density(signal, signal, one.rate, size)
            # mean and variance of the logarithm of chi-square over its degrees of freedom: digamma
            # and trigamma functions (Bartlett and Kendall 1946)
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
            # variance of a gain estimate by its coherence (Bendat and Piersol 2010, ch. 9); noise
            # in the base makes the ratio too small, at most by the incoherence, which is added
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

    # start values: a quarter car of about these frequencies, and the mean log ratio as free gains
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
    bound = np.concatenate([np.full(4, _MAX_CHANGE), np.full(len(free), np.inf)])
    found = least_squares(residuals, begin, bounds=(begin - bound, begin + bound), x_scale="jac")
    # bins of a Hann window are correlated: fewer degrees of freedom, and a larger covariance
    degrees = values - unknowns
    scatter = float(np.sqrt((found.fun**2).sum() / degrees))
    covariance = np.linalg.pinv(found.jac.T @ found.jac)[:4, :4]
    covariance *= max(scatter, 1.0) ** 2 * _HANN_CORRELATION
    jacobian = _mode_derivatives(found.x[:4])
    sd = np.sqrt(np.diag(jacobian @ covariance @ jacobian.T))
    quantile = float(student.ppf(0.5 + confidence / 2, degrees / _HANN_CORRELATION))
    logs = _log_modes(found.x[:4])
    ride, hop = (
        _identified_mode(name, logs[at : at + 2], sd[at : at + 2], quantile)
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
    """Logarithms of the parameters of a quarter car with about these frequencies [Hz]."""
    ride, hop = (2 * math.pi * frequency for frequency in start)
    mass_ratio = 0.15
    return np.log([mass_ratio, ride**2, 0.7 * ride, mass_ratio * hop**2])


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
    """Logarithm of the modelled power of a signal, or of its ratio to that of its base.

    A Hann window spreads each line over about three bins. The model is averaged over the same
    window, weighted by the power of the excitation.
    """
    offsets = np.linspace(-_WINDOW_BINS, _WINDOW_BINS, _LINES)
    # spectral window of the Hann taper: (sinc(x) / (1 - x²))², with the limit 1/4 at x = ±1
    single = np.abs(np.abs(offsets) - 1) < _TINY
    window = (np.sinc(offsets) / np.where(single, 1.0, 1 - offsets**2)) ** 2
    window[single] = 0.25
    frequency = np.abs(power.frequency[:, None] + power.bin * offsets)
    weight = window / window.sum() * frequency ** (4 - power.waviness)  # of acceleration
    gain = frequency_response(model, frequency)[..., 0]
    own = gain[..., _SIGNALS[power.signal]]
    if power.free:
        return np.asarray(np.log((weight * np.abs(own) ** 2).sum(axis=1)))
    over = np.ones(1) if power.over is None else gain[..., _SIGNALS[power.over]]
    cross = (weight * own * np.conj(over)).sum(axis=1)
    return np.asarray(2 * np.log(np.abs(cross) / (weight * np.abs(over) ** 2).sum(axis=1)))


def _log_modes(logs: Array) -> Array:
    """Logarithms of frequency and damping ratio of ride and hop."""
    found = vehicle_modes(linear_model(_quarter_car(logs)))
    return np.log(np.column_stack([found.natural_frequency, found.damping_ratio]).ravel())


def _mode_derivatives(logs: Array) -> Array:
    """Jacobian of the logarithms of the modes by those of the parameters, shape (4, 4)."""
    columns = []
    for at in range(4):
        step = np.zeros(4)
        step[at] = _STEP
        columns.append((_log_modes(logs + step) - _log_modes(logs - step)) / (2 * _STEP))
    return np.array(columns).T


def _identified_mode(name: str, logs: Array, sd: Array, quantile: float) -> IdentifiedMode:
    """Mode from the logarithms of frequency and damping; intervals are symmetric in these."""
    frequency, damping = np.exp(logs).tolist()
    half_width = np.minimum(quantile * sd, _MAX_LOG)
    ends = np.exp([logs - half_width, logs + half_width])
    return IdentifiedMode(
        name=name,
        frequency=frequency,
        frequency_sd=frequency * float(sd[0]),
        damping=damping,
        damping_sd=damping * float(sd[1]),
        frequency_interval=(float(ends[0, 0]), float(ends[1, 0])),
        damping_interval=(float(ends[0, 1]), float(ends[1, 1])),
    )
