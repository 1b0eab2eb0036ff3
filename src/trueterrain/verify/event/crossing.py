"""What a vehicle does when it drives over an event, and in which modes."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from trueterrain.vehicle import (
    FullCarParameters,
    Tyre,
    contact_heights,
    contact_margin,
    linear_model,
    simulate_response,
    vehicle_modes,
)
from trueterrain.verify.truth import TrueHeight

Floats = npt.NDArray[np.float64]

_MODES = ("heave", "pitch", "roll", "hop", "tramp")  # front and rear, if alike, mix at will
_LEAST_RATE = 500.0  # [Hz] of the samples, whatever the speed


@dataclass(frozen=True, kw_only=True, eq=False)
class EventResponse:
    """Motion of a vehicle over an event; made by `cross_event`."""

    time: Floats
    "Since the front axle was at distance 0, shape (n,) [s]."

    freedoms: tuple[str, ...]
    "Names of the seven freedoms."

    displacement: Floats
    "Of each freedom, shape (n, 7) [m or rad]."

    laser: Floats
    "Height of the laser above that at rest, shape (n,) [m]."

    laser_acceleration: Floats
    "Upwards, of the laser, shape (n,) [m/s²]."

    energy: Mapping[str, float] = field(default_factory=dict)
    """Share of the kinetic energy over the whole time that the undamped modes have: heave, pitch,
    roll, hop (wheels of an axle together), tramp (against each other) [1]."""

    def span(self, freedom: str) -> float:
        """Motion of a freedom from peak to peak [m or rad].

        Raises
        ------
        ValueError
            If there is no such freedom.
        """
        if freedom not in self.freedoms:
            message = f"freedom must be one of {', '.join(self.freedoms)}, got {freedom!r}."
            raise ValueError(message)
        return float(np.ptp(self.displacement[:, self.freedoms.index(freedom)]))

    @property
    def laser_span(self) -> float:
        """Motion of the laser from peak to peak [m]."""
        return float(np.ptp(self.laser))

    @property
    def strongest(self) -> str:
        """Mode of the body (heave, pitch or roll) that has most of the energy."""
        return max(("heave", "pitch", "roll"), key=lambda name: self.energy[name])


def cross_event(
    car: FullCarParameters,
    height: TrueHeight,
    speed: float,
    *,
    length: float,
    laser: tuple[float, float] = (-2.25, 0.0),
    tyre: Tyre = Tyre(),
    settle: float = 3.0,
    spacing: float = 0.001,
) -> EventResponse:
    """Drive a vehicle straight over an event, from rest on level ground.

    Parameters
    ----------
    car : FullCarParameters
        The vehicle.
    height : callable
        Height of the ground [m] at easting and northing [m]; the vehicle drives east along
        northing 0, and the ground is level before easting 0.
    speed : float
        Speed [m/s].
    length : float
        Where the event ends [m].
    laser : tuple of float
        Place of the laser in the body from its centre of gravity: x forward, y left [m].
    tyre : Tyre
        Contact patch.
    settle : float
        Time that is driven on after the rear wheels have left the event [s].
    spacing : float
        Distance between the heights along the paths of the wheels [m].

    Returns
    -------
    EventResponse
        The motion.

    Raises
    ------
    ValueError
        If speed, length, settle or spacing are not greater than 0.
    CoverageError
        If there is no ground under a wheel.

    Notes
    -----
    Undamped modes of mass 1 part the kinetic energy of the linear vehicle without rest: each has
    half the square of its own velocity. Its integral over time says which modes an event excites;
    wheel hop moves fast, so that it has much energy while it moves little.

    Examples
    --------
    >>> from trueterrain.simulate.ground import ExcitationEvent
    >>> from trueterrain.vehicle import named_vehicle
    >>> event = ExcitationEvent()
    >>> moved = cross_event(named_vehicle("golden car"), event.height, 5.4, length=event.length)
    >>> print(f"laser {1000 * moved.laser_span:.0f} mm, body most in {moved.strongest}")
    laser 41 mm, body most in pitch
    """
    for name, value, unit in (
        ("speed", speed, "m/s"),
        ("length", length, "m"),
        ("settle", settle, "s"),
        ("spacing", spacing, "m"),
    ):
        if not 0 < value < math.inf:
            message = f"{name} must be finite and greater than 0 {unit}, got {value}."
            raise ValueError(message)
    step = min(spacing, speed / _LEAST_RATE)
    model = linear_model(car)
    begin = -tyre.patch_length - 0.5
    end = length + car.wheelbase + tyre.patch_length + settle * speed
    front: Floats = begin + step * np.arange(math.ceil((end - begin) / step), dtype=np.float64)
    wheels = _wheel_heights(car, height, front, step, tyre)
    moved = simulate_response(model, step / speed, wheels)
    lever = np.array([1.0, -laser[0], laser[1]])
    found = vehicle_modes(model)
    own = moved.velocity @ (model.mass @ found.undamped_shape.T)
    kinetic = dict(zip(found.names, (own**2).sum(axis=0).tolist(), strict=True))
    total = sum(kinetic.values())
    if not total > 0:
        message = "height must move the vehicle, but its cleats are too small to do so."
        raise ValueError(message)
    parted = {
        name: sum(value for mode, value in kinetic.items() if mode.endswith(name))
        for name in _MODES
    }
    return EventResponse(
        time=front / speed,
        freedoms=model.freedoms,
        displacement=moved.displacement,
        laser=moved.displacement[:, :3] @ lever,
        laser_acceleration=moved.acceleration[:, :3] @ lever,
        energy={name: value / total for name, value in parted.items()},
    )


def _wheel_heights(
    car: FullCarParameters, height: TrueHeight, front: Floats, step: float, tyre: Tyre
) -> Floats:
    """Height of each wheel while the front axle is at `front`, shape (n, 4)."""
    margin = contact_margin(step, tyre.patch_length)
    along = front[0] + step * np.arange(-margin, front.size + margin)
    out = np.empty((front.size, 4))
    for wheel, (x, y) in enumerate(car.wheel_positions):
        strip = height(
            *np.broadcast_arrays((along + x - car.front_axle)[:, None], (y + tyre.offsets)[None, :])
        )
        out[:, wheel] = contact_heights(strip, step, tyre.patch_length)
    return out
