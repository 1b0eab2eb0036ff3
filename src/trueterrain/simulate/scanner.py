"""Virtual scanning laser: geometry of the beams, returns, and errors of ranges and intensities.

A mirror sweeps a beam across the road. Each beam starts at its own time from the position of the
laser at that time, and ends at its first intersection with the ground. Shadows, the steepest
visible slope and the uneven spacing of the points follow from that.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trueterrain.formats.run import Mounting
from trueterrain.simulate._kernels import beam_rays, receive_beams
from trueterrain.simulate.casting import cast_beams
from trueterrain.simulate.clock import SimulatedClock, check_next
from trueterrain.simulate.ground import Ground
from trueterrain.simulate.noise import named_generator
from trueterrain.simulate.pose import PoseKnots, quintic_coefficients
from trueterrain.simulate.raster import Raster
from trueterrain.simulate.rotation import body_to_ground

Float = npt.NDArray[np.float64]

_BEAM_STRIDE = 97  # [1] every 97th beam finds the tiles that are needed; no divisor of 940


@dataclass(frozen=True, kw_only=True)
class Reflectivity:
    """Reflectivity of the ground: uniform, or with painted stripes."""

    ground: float = 0.3
    "Reflectivity of the ground, 0 to 1."

    stripe: float = 0.8
    "Reflectivity of the stripes, 0 to 1."

    period: float = 0.0
    "Distance between stripes [m]; 0 for none."

    width: float = 0.1
    "Width of a stripe [m]."

    direction: float = 0.0
    "Direction across the stripes, counter-clockwise from east [rad]."

    def __post_init__(self) -> None:
        """Check the values."""
        for name in ("ground", "stripe"):
            if not 0 <= getattr(self, name) <= 1:
                message = f"{name} must be from 0 to 1, got {getattr(self, name)}."
                raise ValueError(message)
        if not (self.period >= 0 and self.width > 0):
            message = "period must be at least 0 m and width greater than 0 m."
            raise ValueError(message)

    def at(self, x: Float, y: Float) -> Float:
        """Reflectivity at points.

        Parameters
        ----------
        x, y : numpy.ndarray
            Easting and northing [m].

        Returns
        -------
        numpy.ndarray
            Values from 0 to 1.
        """
        if not self.period:
            return np.full(np.shape(x), self.ground)
        along = x * np.cos(self.direction) + y * np.sin(self.direction)
        return np.where(np.mod(along, self.period) < self.width, self.stripe, self.ground)


@dataclass(frozen=True, kw_only=True)
class Scanner:
    """Settings of a scanning laser; the defaults are those of the thesis's system (section 2.2)."""

    beams: int = 940
    "Beams per scan."

    rate: float = 1000.0
    "Scans per second [Hz]."

    swath: float = 4.0
    "Width that the beams cover on level ground at the nominal height [m]."

    nominal_height: float = 2.0
    "Height of the laser above level ground for which the swath holds [m]."

    duty: float = 0.8
    "Fraction of the time between scans in which the mirror sweeps across the ground."

    furthest: float = 6.0
    "Maximum range [m]; beyond it there is no return."

    range_noise: float = 0.0005
    "Standard deviation of a range [m]."

    quantum: float = 0.0001
    "Step of the ranges [m]; 0 for none."

    spot_length: float = 0.010
    "Extent of the spot along the direction of travel [m] (thesis: 1.5 mm x 10 mm)."

    spot_width: float = 0.0015
    "Extent of the spot along the scan [m]."

    spot_rays: int = 5
    "Rays over the spot whose ranges are averaged, an odd number; 1 for a point."

    gain: float = 30000.0
    "Intensity of a white surface at normal incidence at the nominal height [counts]."

    intensity_noise: float = 50.0
    "Standard deviation of an intensity [counts]."

    floor: float = 500.0
    "Returns with less intensity are lost [counts]."

    saturation: float = 20000.0
    "Intensity above which the receiver saturates [counts]."

    saturation_bias: float = -0.002
    "Error of a range at twice the saturation [m]; it grows linearly from 0 at the saturation."

    dropouts: float = 0.0005
    "Fraction of returns lost at random."

    def __post_init__(self) -> None:
        """Check the values."""
        for name in ("rate", "swath", "nominal_height", "furthest", "gain", "saturation"):
            _require_parameter(getattr(self, name) > 0, name, "greater than 0", getattr(self, name))
        for name in ("range_noise", "quantum", "spot_length", "spot_width", "intensity_noise"):
            _require_parameter(getattr(self, name) >= 0, name, "at least 0", getattr(self, name))
        _require_parameter(self.beams >= 2, "beams", "at least 2", self.beams)
        is_odd = self.spot_rays >= 1 and self.spot_rays % 2 == 1
        _require_parameter(is_odd, "spot_rays", "odd and at least 1", self.spot_rays)
        _require_parameter(0 < self.duty <= 1, "duty", "greater than 0 and at most 1", self.duty)
        _require_parameter(
            0 <= self.dropouts < 1, "dropouts", "from 0 to less than 1", self.dropouts
        )

    @property
    def angle(self) -> Float:
        """Angle of each beam from straight down, left positive, shape (beam,) [rad]."""
        half = float(np.arctan(0.5 * self.swath / self.nominal_height))
        return np.linspace(-half, half, self.beams, dtype=np.float64)

    @property
    def delay(self) -> Float:
        """Time of each beam after the first one of its scan, shape (beam,) [s]."""
        return np.arange(self.beams, dtype=float) * (self.duty / self.rate / self.beams)


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedScans:
    """Consecutive scans: recorded values and the truth."""

    time: Float
    "Stamp of each scan's first beam, shape (scan,) [s]."

    range: Float
    "Recorded ranges, NaN without return, shape (scan, beam) [m]."

    intensity: npt.NDArray[np.uint16]
    "Recorded intensities, shape (scan, beam) [counts]."

    true_range: Float
    "Exact ranges, NaN without an intersection, shape (scan, beam) [m]."

    bias: Float
    "Error of each range by saturation, shape (scan, beam) [m]."


class ScannerStream:
    """Simulator of the scans of one pass, recorded block by block.

    Parameters
    ----------
    scanner : Scanner
        The scanner.
    mounting : Mounting
        True pose in the body frame, and the clock.
    ground : Ground
        True ground. A `Raster` is fast and exact; for other ground, ranges are exact to 1e-9 m
        and slow.
    reflectivity : Reflectivity
        Reflectivity of the ground.
    seed : int
        Seed of noise and lost returns.
    pass_number : int
        Number of the pass, from 0: each has its own noise.
    begin : float
        True time at which the pass begins [s].
    """

    def __init__(
        self,
        scanner: Scanner,
        mounting: Mounting,
        ground: Ground,
        *,
        reflectivity: Reflectivity = Reflectivity(),
        seed: int,
        pass_number: int = 0,
        begin: float = 0.0,
    ) -> None:
        self.scanner = scanner
        self.mounting = mounting
        self._clock = SimulatedClock(offset=mounting.scanner_clock)
        self._end = begin
        self.ground = ground
        self.reflectivity = reflectivity
        self._noise, self._speckle, self._loss = (
            named_generator(seed, "scanner", f"pass {pass_number}", name)
            for name in ("range", "intensity", "loss")
        )
        self._tiles: set[tuple[int, int]] = set()
        self._typical_range = 0.0  # [m] median range of the last block

    def record(self, knots: PoseKnots, begin: float, end: float) -> SimulatedScans:
        """Scans whose first beam has a true time in [begin, end).

        Parameters
        ----------
        knots : PoseKnots
            Motion of the body, from `begin` to one scan beyond `end`.
        begin, end : float
            True times [s]; `begin` must be the end of the last block.

        Returns
        -------
        SimulatedScans
            Recorded and true ranges. Stamps are whole multiples of the time between scans.

        Raises
        ------
        ValueError
            If the block does not follow the last one, or the knots do not cover it.
        """
        scanner = self.scanner
        check_next(self._end, begin, end)
        stamp = self._clock.ticks(begin, end, scanner.rate) / scanner.rate
        shape = (stamp.size, scanner.beams)
        rays = self._beams(knots, self._clock.true(stamp))
        self._end = end
        origin, direction, forward = (ray.reshape(-1, 3) for ray in rays)
        true_range, slope = self._cast(origin, direction, forward)
        ranges, counts, bias = self._receive(true_range, origin, direction, slope)
        return SimulatedScans(
            time=stamp,
            range=ranges.reshape(shape),
            intensity=counts.reshape(shape),
            true_range=true_range.reshape(shape),
            bias=bias.reshape(shape),
        )

    def _beams(self, knots: PoseKnots, time: Float) -> tuple[Float, Float, Float]:
        """Origin and direction of every beam, and the scanner's forward axis."""
        scanner = self.scanner
        step = float(knots.time[1] - knots.time[0])
        if time.size and time[-1] + scanner.delay[-1] > knots.time[-1]:
            message = f"the motion ends at {knots.time[-1]} s, before the last beam."
            raise ValueError(message)
        coefficients = np.stack(
            quintic_coefficients(
                knots.pose[:-1],
                step * knots.rate[:-1],
                step**2 * knots.acceleration[:-1],
                knots.pose[1:],
                step * knots.rate[1:],
                step**2 * knots.acceleration[1:],
            ),
            axis=1,
        )
        origin, direction, forward = (np.empty((time.size, scanner.beams, 3)) for _ in range(3))
        beam_rays(
            time,
            float(knots.time[0]),
            step,
            coefficients,
            np.array(self.mounting.scanner_position),
            body_to_ground(self.mounting.scanner_rotation),
            scanner.angle,
            scanner.delay,
            origin,
            direction,
            forward,
        )
        return origin, direction, forward

    def _cast(self, origin: Float, direction: Float, forward: Float) -> tuple[Float, Float]:
        """Ranges averaged over the spot, and the slope of the ground at its centre."""
        scanner = self.scanner
        self._request_tiles(origin, direction)
        distance, slope = cast_beams(
            self.ground,
            origin,
            direction,
            max_distance=scanner.furthest,
            known=self._tiles,
            forward=forward,
            spot=_spot_directions(scanner),
        )
        sampled = distance[::_BEAM_STRIDE]
        self._typical_range = (
            float(np.median(sampled[np.isfinite(sampled)])) if np.isfinite(sampled).any() else 0
        )
        return distance, slope

    def _request_tiles(self, origin: Float, direction: Float) -> None:
        """Request the tiles that beams of the typical range will enter, to avoid a second cast."""
        if isinstance(self.ground, Raster) and self._typical_range:
            point = origin[::_BEAM_STRIDE, :2] + self._typical_range * direction[::_BEAM_STRIDE, :2]
            self._tiles |= {tuple(tile) for tile in self.ground.tile_of(*point.T).tolist()}

    def _receive(
        self, true_range: Float, origin: Float, direction: Float, slope: Float
    ) -> tuple[Float, npt.NDArray[np.uint16], Float]:
        """Recorded ranges and intensities, and the bias by saturation."""
        scanner, size = self.scanner, true_range.size
        if self.reflectivity.period:
            point = (origin[:, c] + true_range * direction[:, c] for c in (0, 1))
            reflectivity = self.reflectivity.at(*point)
        else:
            reflectivity = np.array([self.reflectivity.ground])
        ranges, counts, bias = np.empty(size), np.empty(size, np.uint16), np.empty(size)
        receive_beams(
            true_range,
            direction,
            slope,
            reflectivity,
            self._speckle.standard_normal(size),
            self._noise.standard_normal(size),
            self._loss.random(size),
            scanner.nominal_height,
            scanner.gain,
            scanner.intensity_noise,
            scanner.floor,
            scanner.saturation,
            scanner.saturation_bias,
            scanner.range_noise,
            scanner.quantum,
            scanner.dropouts,
            ranges,
            counts,
            bias,
        )
        return ranges, counts, bias


def _spot_directions(scanner: Scanner) -> Float:
    """Rotations of the rays of the spot along and across the direction of travel [rad].

    The rays form a rank-1 lattice: equally spaced over both length and width of the spot.
    """
    half = scanner.spot_rays // 2
    longitudinal = np.arange(-half, half + 1)
    lateral = np.mod(2 * longitudinal + half, scanner.spot_rays) - half
    extent = np.array([scanner.spot_length, scanner.spot_width])
    rotation = extent / (scanner.spot_rays * scanner.nominal_height)
    return np.stack([longitudinal, lateral], axis=1) * rotation


def _require_parameter(holds: bool, name: str, rule: str, value: object) -> None:
    if not holds:
        message = f"{name} must be {rule}, got {value}."
        raise ValueError(message)
