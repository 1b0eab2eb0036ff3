"""Readings of the virtual accelerometers, block by block."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from trueterrain.simulate.accelerometers import _kernels
from trueterrain.simulate.accelerometers._parameters import STANDARD_GRAVITY, Accelerometers
from trueterrain.simulate.clock import SimulatedClock, check_next
from trueterrain.simulate.noise import RandomWalk, White, named_generator
from trueterrain.simulate.pose import PoseKnots

Float = npt.NDArray[np.float64]
Block = dict[str, Float]

#: Inner samples computed at a time, which bounds memory; results do not depend on it.
_CHUNK = 32768

#: Periods of the cut-off after which the transient of the filter has decayed.
_DECAY_PERIODS = 20.0


def specific_force(
    knots: PoseKnots,
    time: npt.ArrayLike,
    positions: npt.ArrayLike,
    *,
    axes: npt.ArrayLike = (0.0, 0.0, 1.0),
    gravity: float = STANDARD_GRAVITY,
) -> Float:
    """Specific force at positions in the body, as error-free accelerometers measure it.

    Parameters
    ----------
    knots : PoseKnots
        True motion of the body.
    time : array_like, shape (n,)
        True times [s].
    positions : array_like, shape (sensor, 3)
        Position of each sensor in the body [m].
    axes : array_like, shape (3,) or (sensor, 3)
        Unit vector of the sensitive axis in the body.
    gravity : float
        Gravity, straight down [m/s^2].

    Returns
    -------
    numpy.ndarray, shape (n, sensor)
        Specific force along the axis [m/s^2].

    Raises
    ------
    ValueError
        If a time lies outside the knots, or shapes do not match.

    Examples
    --------
    >>> still = PoseKnots(time=np.array([0.0, 1.0]), pose=np.zeros((2, 6)), rate=np.zeros((2, 6)),
    ...                   acceleration=np.zeros((2, 6)))
    >>> specific_force(still, [0.5], [[1.0, 0.0, 0.0]])
    array([[9.80665]])
    """
    times = np.ascontiguousarray(time, dtype=np.float64)
    place = np.ascontiguousarray(positions, dtype=np.float64)
    if times.ndim != 1 or place.ndim != 2 or place.shape[1] != 3:
        message = (
            f"time must be of shape (n,) and positions of shape (sensor, 3), "
            f"got {times.shape} and {place.shape}."
        )
        raise ValueError(message)
    if times.size and not (knots.time[0] <= times.min() and times.max() <= knots.time[-1]):
        message = (
            f"time must be from {knots.time[0]} s to {knots.time[-1]} s, "
            f"got {times.min()} s to {times.max()} s."
        )
        raise ValueError(message)
    axis = np.ascontiguousarray(np.broadcast_to(np.asarray(axes, dtype=np.float64), place.shape))
    motion = (
        np.ascontiguousarray(part, dtype=np.float64)
        for part in (knots.time, knots.pose, knots.rate, knots.acceleration)
    )
    return np.asarray(_kernels.specific_force(times, *motion, place, axis, float(gravity)))


class AccelerometerBlock(NamedTuple):
    """Readings of the accelerometers over an interval of time, and the truth."""

    recorded: Block
    "``time`` (sample,) [s] and ``acceleration`` (sample, sensor) [m/s^2]."

    truth: Block
    """``true_time`` (sample,) [s]; ``specific_force`` (sample, sensor) [m/s^2], along the tilted
    axis at the true time of the stamp, without noise, filter or any other error; ``bias`` (sample,
    sensor) [m/s^2]."""


class AccelerometerStream:
    """Simulator of the accelerometers in one pass, recorded block by block.

    A reading is the specific force along the tilted axis, scaled, with white noise, filtered, plus
    the bias, limited and rounded. The filter starts in its steady state at the first force. The
    readings are the same to the last bit for any division of the pass into blocks.

    Parameters
    ----------
    parameters : Accelerometers
        The instrument.
    seed : int
        Seed of all random numbers.
    pass_number : int
        Number of the pass, from 0: each has its own noise, and the same constant errors.
    begin : float
        True time at which the pass begins [s].

    Attributes
    ----------
    bias, scale : numpy.ndarray, shape (sensor,)
        Constant errors [m/s^2], [1].
    tilt : numpy.ndarray, shape (sensor, 2)
        Tilts of the axis [rad].
    axes : numpy.ndarray, shape (sensor, 3)
        Unit vector of each axis in the body.
    group_delay : float
        Group delay of the filter at 0 Hz [s].

    Examples
    --------
    >>> still = PoseKnots(time=np.array([0.0, 1.0]), pose=np.zeros((2, 6)), rate=np.zeros((2, 6)),
    ...                   acceleration=np.zeros((2, 6)))
    >>> stream = AccelerometerStream(Accelerometers(bias_sd=0.0, scale_sd=0.0), seed=1)
    >>> recorded, truth = stream.record(still, 0.0, 1.0)
    >>> recorded["acceleration"].shape
    (2000, 3)
    >>> recorded["acceleration"].mean()
    np.float64(9.81)
    """

    def __init__(
        self, parameters: Accelerometers, *, seed: int, pass_number: int = 0, begin: float = 0.0
    ) -> None:
        p = parameters
        self.parameters = p
        self.group_delay = p.group_delay
        self._positions = np.array(p.positions, dtype=np.float64)
        sensors = len(self._positions)
        self.bias = _constant_error(p.bias, p.bias_sd, (sensors,), seed, "bias")
        self.scale = _constant_error(p.scale, p.scale_sd, (sensors,), seed, "scale")
        self.tilt = _constant_error(p.tilt, p.tilt_sd, (sensors, 2), seed, "tilt")
        self.axes = _tilted_axes(self.tilt)
        self._clock = SimulatedClock(offset=p.clock_offset, rate=p.clock_rate, begin=begin)
        self._end = begin
        # without a filter no inner sample affects a reading
        self._inner = int(p.oversampling) if p.filter_order else 1
        name = f"pass {pass_number}"
        frequency = p.rate * self._inner
        self._noise = White(
            rng=named_generator(seed, "accelerometers", name, "noise"),
            sd=np.full(sensors, p.noise_density * np.sqrt(0.5 * frequency)),
        )
        self._walk = RandomWalk(
            rng=named_generator(seed, "accelerometers", name, "bias walk"),
            density=np.full(sensors, p.bias_walk),
            rate=p.rate,
        )
        self._filter = _Filter(p, frequency, self._noise) if p.filter_order else None

    def record(self, knots: PoseKnots, begin: float, end: float) -> AccelerometerBlock:
        """Samples with true times in [begin, end).

        Parameters
        ----------
        knots : PoseKnots
            True motion, from `begin` to `end` at least.
        begin, end : float
            True times [s]; `begin` must be the end of the last block.

        Returns
        -------
        AccelerometerBlock
            Readings and truth. Stamps are whole multiples of 1 / rate.

        Raises
        ------
        ValueError
            If the block does not follow the last one, or the knots do not cover it.
        """
        check_next(self._end, begin, end)
        p = self.parameters
        ticks = self._clock.ticks(begin, end, p.rate * self._inner)
        inner_time = self._clock.true(ticks / (p.rate * self._inner))
        if ticks.size and not (knots.time[0] <= inner_time[0] and inner_time[-1] <= knots.time[-1]):
            message = (
                f"knots must cover {inner_time[0]} s to {inner_time[-1]} s, "
                f"got {knots.time[0]} s to {knots.time[-1]} s."
            )
            raise ValueError(message)
        self._end = end
        forces, readings = [], []
        for first in range(0, max(ticks.size, 1), _CHUNK):
            part = slice(first, first + _CHUNK)
            recorded = ticks[part] % self._inner == 0
            force, reading = self._read(knots, inner_time[part])
            forces.append(force[recorded])
            readings.append(reading[recorded])
        stamp = (ticks[ticks % self._inner == 0] // self._inner) / p.rate
        bias = self.bias + self._walk.next(stamp.size)
        reading = np.clip(np.concatenate(readings) + bias, -p.full_scale, p.full_scale)
        if p.quantum:
            reading = np.round(reading / p.quantum) * p.quantum
        return AccelerometerBlock(
            {"time": stamp, "acceleration": reading},
            {
                "true_time": self._clock.true(stamp),
                "specific_force": np.concatenate(forces),
                "bias": bias,
            },
        )

    def _read(self, knots: PoseKnots, time: Float) -> tuple[Float, Float]:
        """Exact and filtered specific force at the inner samples."""
        force = specific_force(
            knots, time, self._positions, axes=self.axes, gravity=self.parameters.gravity
        )
        reading = (1.0 + self.scale) * force + self._noise.next(time.size)
        if self._filter is not None and time.size:
            reading = self._filter.next(reading, (1.0 + self.scale) * force[0])
        return force, reading


class _Filter:
    """Causal Butterworth filter that starts in the steady state of force and noise."""

    def __init__(self, parameters: Accelerometers, frequency: float, noise: White) -> None:
        from scipy.signal import butter, sosfilt, sosfilt_zi

        p = parameters
        self._sections = butter(p.filter_order, p.filter_cutoff, fs=frequency, output="sos")
        self._rest = sosfilt_zi(self._sections)[:, :, None]
        before = noise.next(int(np.ceil(_DECAY_PERIODS * frequency / p.filter_cutoff)))
        none = np.zeros((len(self._sections), 2, before.shape[1]))
        _, self._state = sosfilt(self._sections, before, axis=0, zi=none)
        self._started = False

    def next(self, samples: Float, rest: Float) -> Float:
        """Filtered samples; `rest` is the constant input before the first sample."""
        from scipy.signal import sosfilt

        if not self._started:
            self._state = self._state + self._rest * rest
            self._started = True
        filtered, self._state = sosfilt(self._sections, samples, axis=0, zi=self._state)
        return np.asarray(filtered)


def _constant_error(
    given: "tuple[float, ...] | tuple[tuple[float, float], ...]",
    sd: float,
    shape: tuple[int, ...],
    seed: int,
    name: str,
) -> Float:
    """Constant error of each sensor: the sum of the given and the random value."""
    drawn = sd * named_generator(seed, "accelerometers", name).standard_normal(shape)
    return drawn + np.array(given, dtype=np.float64) if len(given) else drawn


def _tilted_axes(tilt: Float) -> Float:
    """Unit vectors ``Rx(first) Ry(second) z``."""
    about_x, about_y = tilt[:, 0], tilt[:, 1]
    return np.stack(
        [np.sin(about_y), -np.sin(about_x) * np.cos(about_y), np.cos(about_x) * np.cos(about_y)],
        axis=1,
    )
