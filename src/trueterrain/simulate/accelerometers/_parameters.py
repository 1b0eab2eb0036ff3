"""Settings of the virtual accelerometers."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trueterrain.simulate.clock import SimulatedClock
from trueterrain.simulate.noise import check_not_negative, check_positive

Float = npt.NDArray[np.float64]
Position = tuple[float, float, float]

#: Gravity by definition of the standard acceleration (CGPM 1901) [m/s^2].
STANDARD_GRAVITY = 9.80665


def sensor_triangle(centre: Position, radius: float = 0.5) -> tuple[Position, Position, Position]:
    """Positions of three coplanar sensors: one in front of a centre, two behind it, left and right.

    Parameters
    ----------
    centre : tuple of float
        Centre in the body, such as the position of the laser [m].
    radius : float
        Distance of the sensors from the centre [m].

    Returns
    -------
    tuple
        Position of each sensor in the body [m].

    Raises
    ------
    ValueError
        If the radius is not greater than 0.

    Examples
    --------
    >>> sensor_triangle((-2.0, 0.0, 1.0))[0]
    (-1.5, 0.0, 1.0)
    """
    check_positive(radius=radius)
    x, y, z = centre
    back, side = 0.5 * radius, math.sqrt(0.75) * radius
    return (x + radius, y, z), (x - back, y + side, z), (x - back, y - side, z)


@dataclass(frozen=True, kw_only=True)
class Accelerometers:
    """Accelerometers with their sensitive axes along z of the body, and their errors.

    Noise, bias and scale are those of industrial MEMS sensors: 50 ug/sqrt(Hz), 5 mg, 0.1 %. The
    bias walk, the tilt of the axes, the range and the filter are assumptions for the same class.

    A constant error of a sensor is the sum of a given value (``bias``, ``scale``, ``tilt``) and a
    random one from the seed (``bias_sd``, ``scale_sd``, ``tilt_sd``), the same in all passes.
    """

    positions: tuple[Position, ...] = sensor_triangle((0.0, 0.0, 0.0))
    "Position of each sensor in the body [m]; by default a triangle around its origin."

    rate: float = 2000.0
    "Samples per second [Hz]."

    noise_density: float = 50e-6 * STANDARD_GRAVITY
    "White noise, one-sided, before the filter [m/s^2/sqrt(Hz)]."

    bias_sd: float = 5e-3 * STANDARD_GRAVITY
    "Standard deviation of the constant bias over sensors [m/s^2]."

    bias: tuple[float, ...] = ()
    "Given bias of each sensor [m/s^2]; empty for none."

    bias_walk: float = 2e-5
    "Standard deviation of the random walk of the bias after 1 s [m/s^2/sqrt(s)]."

    scale_sd: float = 0.001
    "Standard deviation of the scale error over sensors [1]."

    scale: tuple[float, ...] = ()
    "Given scale error of each sensor [1]; empty for none."

    tilt_sd: float = 0.001
    "Standard deviation of each of the two tilts of an axis over sensors [rad]."

    tilt: tuple[tuple[float, float], ...] = ()
    """Given tilt of each axis [rad], empty for none: the z axis of the body, rotated by the second
    angle about y, then by the first about x."""

    clock_offset: float = 0.0
    "True time less stamp, at the beginning [s]."

    clock_rate: float = 0.0
    "Growth of the clock, true time less stamp, per second [s/s]."

    filter_order: int = 4
    "Order of the anti-alias filter, a causal Butterworth filter; 0 for none."

    filter_cutoff: float = 500.0
    "Cut-off frequency, at half power [Hz]."

    oversampling: int = 4
    "Inner samples, before the filter, per recorded sample."

    full_scale: float = 10.0 * STANDARD_GRAVITY
    "Maximum magnitude of a reading [m/s^2]; infinite for no limit."

    quantum: float = 0.0
    "Step of the readings [m/s^2]; 0 for none."

    gravity: float = STANDARD_GRAVITY
    "Gravity, straight down [m/s^2]."

    def __post_init__(self) -> None:
        """Check the values."""
        check_positive(rate=self.rate, gravity=self.gravity)
        check_not_negative(
            noise_density=self.noise_density,
            bias_sd=self.bias_sd,
            bias_walk=self.bias_walk,
            scale_sd=self.scale_sd,
            tilt_sd=self.tilt_sd,
            quantum=self.quantum,
        )
        shape = np.shape(self.positions)
        if len(shape) != 2 or shape[0] < 1 or shape[1] != 3:
            message = f"positions must be of shape (sensor, 3), got {shape}."
            raise ValueError(message)
        for name, expected in (
            ("positions", (shape[0], 3)),
            ("bias", (shape[0],)),
            ("scale", (shape[0],)),
            ("tilt", (shape[0], 2)),
        ):
            values = np.asarray(getattr(self, name), dtype=np.float64)
            if values.size and values.shape != expected:
                message = f"{name} must be of shape {expected}, got {values.shape}."
                raise ValueError(message)
            if not np.isfinite(values).all():
                message = f"{name} must be finite."
                raise ValueError(message)
        if not self.full_scale > 0:
            message = f"full_scale must be greater than 0 m/s^2, got {self.full_scale}."
            raise ValueError(message)
        SimulatedClock(offset=self.clock_offset, rate=self.clock_rate)
        self._check_filter()

    def _check_filter(self) -> None:
        for name, minimum in (("filter_order", 0), ("oversampling", 1)):
            value = getattr(self, name)
            if isinstance(value, bool) or value != int(value) or value < minimum:
                message = f"{name} must be a whole number of at least {minimum}, got {value}."
                raise ValueError(message)
        if self.filter_order:
            check_positive(filter_cutoff=self.filter_cutoff)
            if not self.filter_cutoff < 0.5 * self.rate * self.oversampling:
                message = (
                    "filter_cutoff must be below half of rate times oversampling, "
                    f"{0.5 * self.rate * self.oversampling} Hz, got {self.filter_cutoff} Hz."
                )
                raise ValueError(message)

    @property
    def group_delay(self) -> float:
        """Group delay of the filter at 0 Hz [s].

        A reading with the stamp t shows motion at t less this delay. The delay grows towards the
        cut-off.

        Examples
        --------
        >>> round(1000 * Accelerometers().group_delay, 3)
        0.821
        """
        if not self.filter_order:
            return 0.0
        step = 1.0 / (self.rate * self.oversampling)
        # The delay of a pole p at 0 Hz is Re(-1 / p). The bilinear transform preserves it, but
        # shifts the cut-off, which is pre-warped for that reason.
        cutoff = 2.0 / step * math.tan(math.pi * self.filter_cutoff * step)
        order = self.filter_order
        angles = [math.pi * (2 * k + 1) / (2 * order) for k in range(order)]
        return sum(math.sin(angle) for angle in angles) / cutoff
