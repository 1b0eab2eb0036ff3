"""Predicted response of a vehicle that crosses an event, and its energy by modes."""

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

_MODES = ("heave", "pitch", "roll", "hop", "tramp")  # front and rear of equal frequency are mixed
_MIN_RATE = 500.0  # [Hz] of the samples, at any speed


@dataclass(frozen=True, kw_only=True, eq=False)
class EventResponse:
    """Motion of a vehicle over an event; made by `cross_event`."""

    time: Floats
    "Time since the front axle was at distance 0, shape (n,) [s]."

    freedoms: tuple[str, ...]
    "Names of the seven degrees of freedom."

    displacement: Floats
    "Displacements of the degrees of freedom, shape (n, 7) [m or rad]."

    laser: Floats
    "Height of the laser above its height at rest, shape (n,) [m]."

    laser_acceleration: Floats
    "Upward acceleration of the laser, shape (n,) [m/s²]."

    energy: Mapping[str, float] = field(default_factory=dict)
    """Fraction of the time integral of kinetic energy in the undamped modes: heave, pitch, roll,
    hop (wheels of an axle in phase), tramp (in antiphase) [1]."""

    def span(self, name: str) -> float:
        """Peak-to-peak displacement, by the name in `freedoms` [m or rad].

        Raises
        ------
        ValueError
            If `freedoms` does not hold that name.
        """
        if name not in self.freedoms:
            message = f"name must be one of {', '.join(self.freedoms)}, got {name!r}."
            raise ValueError(message)
        return float(np.ptp(self.displacement[:, self.freedoms.index(name)]))

    @property
    def laser_span(self) -> float:
        """Peak-to-peak displacement of the laser [m]."""
        return float(np.ptp(self.laser))

    @property
    def strongest(self) -> str:
        """Mode of the body (heave, pitch or roll) with most energy."""
        return max(("heave", "pitch", "roll"), key=lambda name: self.energy[name])


def cross_event(
    car: FullCarParameters,
    height: TrueHeight,
    speed: float,
    *,
    length: float,
    laser: tuple[float, float] = (-2.25, 0.0),
    tyre: Tyre = Tyre(),
    run_out: float = 3.0,
    spacing: float = 0.001,
) -> EventResponse:
    """Simulate the straight crossing of an event, from equilibrium on level ground.

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
        Distance at which the event ends [m].
    laser : tuple of float
        Position of the laser from the centre of gravity: x forward, y left [m].
    tyre : Tyre
        Contact patch.
    run_out : float
        Time that the simulation continues after the rear wheels have left the event [s].
    spacing : float
        Distance between the heights along the paths of the wheels [m].

    Returns
    -------
    EventResponse
        Displacements, motion of the laser, and energy by modes.

    Raises
    ------
    ValueError
        If speed, length, run_out or spacing is not greater than 0.
    CoverageError
        If there is no ground under a wheel.

    Notes
    -----
    The undamped modes of modal mass 1 split the kinetic energy of the linear vehicle without
    remainder: each has half the square of its modal velocity. The integral over time shows which
    modes an event excites. Wheel hop is fast and has much energy at small displacements.

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
        ("run_out", run_out, "s"),
        ("spacing", spacing, "m"),
    ):
        if not 0 < value < math.inf:
            message = f"{name} must be finite and greater than 0 {unit}, got {value}."
            raise ValueError(message)
    step = min(spacing, speed / _MIN_RATE)
    model = linear_model(car)
    begin = -tyre.patch_length - 0.5
    end = length + car.wheelbase + tyre.patch_length + run_out * speed
    front: Floats = begin + step * np.arange(math.ceil((end - begin) / step), dtype=np.float64)
    wheels = _wheel_heights(car, height, front, step, tyre)
    moved = simulate_response(model, step / speed, wheels)
    lever = np.array([1.0, -laser[0], laser[1]])
    # modal velocities: shapes are orthonormal with respect to the mass matrix
    modes = vehicle_modes(model)
    modal_velocity = moved.velocity @ (model.mass @ modes.undamped_shape.T)
    kinetic = dict(zip(modes.names, (modal_velocity**2).sum(axis=0).tolist(), strict=True))
    total = sum(kinetic.values())
    if not total > 0:
        message = "height must move the vehicle, but its cleats are too small."
        raise ValueError(message)
    by_mode = {
        name: sum(value for mode, value in kinetic.items() if mode.endswith(name))
        for name in _MODES
    }
    return EventResponse(
        time=front / speed,
        freedoms=model.freedoms,
        displacement=moved.displacement,
        laser=moved.displacement[:, :3] @ lever,
        laser_acceleration=moved.acceleration[:, :3] @ lever,
        energy={name: value / total for name, value in by_mode.items()},
    )


def _wheel_heights(
    car: FullCarParameters, height: TrueHeight, front: Floats, step: float, tyre: Tyre
) -> Floats:
    """Heights of the wheels with the front axle at `front`, shape (n, 4) [m]."""
    margin = contact_margin(step, tyre.patch_length)
    along = front[0] + step * np.arange(-margin, front.size + margin)
    out = np.empty((front.size, 4))
    for wheel, (x, y) in enumerate(car.wheel_positions):
        strip = height(
            *np.broadcast_arrays((along + x - car.front_axle)[:, None], (y + tyre.offsets)[None, :])
        )
        out[:, wheel] = contact_heights(strip, step, tyre.patch_length)
    return out
