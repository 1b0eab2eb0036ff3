"""What an excitation event is designed from: frequencies, damping and size of a vehicle."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

from trueterrain.vehicle import FullCarParameters, linear_model, vehicle_modes

#: Mode of the body that the event as a whole shall excite.
Target = Literal["heave", "pitch", "roll"]

#: Tolerances unless told otherwise: how far spectra are read, and boards are laid.
_TOLERANCES = {"ride": 0.05, "hop": 0.5, "damping": 0.05, "length": 0.005}


@dataclass(frozen=True, kw_only=True)
class EventInputs:
    """What an event is designed from.

    Raises
    ------
    ValueError
        If a value breaks its rule.

    Examples
    --------
    >>> EventInputs().hop
    11.0
    """

    ride: float = 1.1
    "Frequency of the mode of the body that the event as a whole shall excite: f1 [Hz]."

    hop: float = 11.0
    "Undamped frequency of wheel hop: f2 [Hz]."

    damping: float = 0.3
    "Damping ratio of wheel hop [1]."

    tyre_share: float = 1.0
    "Stiffness of the tyre over that of tyre and suspension together; 1 is a soft suspension [1]."

    wheelbase: float | None = None
    "Distance between the axles [m]; None if it is not known."

    track: float = 1.6
    "Greatest distance between the wheels of an axle [m]."

    tolerances: Mapping[str, float] = field(default_factory=lambda: dict(_TOLERANCES))
    """By how much `ride` [Hz], `hop` [Hz], `damping` [1] and the length of the event [m] may be
    off; those not named are taken as exact."""

    def __post_init__(self) -> None:
        """Check the values."""
        for name, unit in (("ride", "Hz"), ("hop", "Hz"), ("track", "m"), ("wheelbase", "m")):
            value = getattr(self, name)
            if value is not None and not 0 < value < math.inf:
                message = f"{name} must be finite and greater than 0 {unit}, got {value}."
                raise ValueError(message)
        if not 0 < self.damping < 1:
            message = f"damping must be greater than 0 and less than 1, got {self.damping}."
            raise ValueError(message)
        if not 0 < self.tyre_share <= 1:
            message = f"tyre_share must be greater than 0 and at most 1, got {self.tyre_share}."
            raise ValueError(message)
        if self.hop <= self.ride:
            message = f"hop must be above ride, {self.ride:g} Hz, got {self.hop:g} Hz."
            raise ValueError(message)
        for name, value in self.tolerances.items():
            if name not in _TOLERANCES:
                message = f"tolerances must be of {', '.join(_TOLERANCES)}, got one of {name!r}."
                raise ValueError(message)
            if not 0 <= value < math.inf:
                message = f"the tolerance of {name} must be finite and at least 0, got {value}."
                raise ValueError(message)
            room = min(self.damping, 1 - self.damping) if name == "damping" else math.inf
            if value >= min(getattr(self, name, math.inf), room):
                message = f"the tolerance of {name} must leave it within its bounds, got {value}."
                raise ValueError(message)
        if self.hop - self.tolerances.get("hop", 0) <= self.ride + self.tolerances.get("ride", 0):
            message = "the tolerances of hop and ride must leave hop above ride."
            raise ValueError(message)


def event_inputs(car: FullCarParameters, target: Target = "heave") -> EventInputs:
    """What an event for a vehicle is designed from.

    Parameters
    ----------
    car : FullCarParameters
        The vehicle.
    target : {"heave", "pitch", "roll"}
        Mode of the body that the event as a whole shall excite.

    Returns
    -------
    EventInputs
        Undamped frequency of that mode; mean frequency, damping ratio and share of the tyre of the
        hop of both axles; wheelbase and track. The tolerance of the hop covers both axles.

    Raises
    ------
    ValueError
        If the target is unknown.

    Examples
    --------
    >>> from trueterrain.vehicle import named_vehicle
    >>> van = event_inputs(named_vehicle("van"), "pitch")
    >>> print(f"{van.ride:.2f} {van.hop:.2f} Hz, {van.damping:.2f}, {van.tyre_share:.3f}")
    1.41 12.48 Hz, 0.43, 0.854
    """
    check_choice("target", target, Target)
    found = vehicle_modes(linear_model(car))
    front, rear = found.names.index("front hop"), found.names.index("rear hop")
    hops = found.undamped_frequency[[front, rear]]
    dampings = found.damping_ratio[[front, rear]]
    shares = [
        tyre / (tyre + spring)
        for tyre, spring in (
            (car.front_tyre_stiffness, car.front_suspension_stiffness),
            (car.rear_tyre_stiffness, car.rear_suspension_stiffness),
        )
    ]
    spread = {"hop": float(hops.std()), "damping": float(dampings.std())}
    return EventInputs(
        ride=float(found.undamped_frequency[found.names.index(target)]),
        hop=float(hops.mean()),
        damping=float(dampings.mean()),
        tyre_share=sum(shares) / 2,
        wheelbase=car.wheelbase,
        track=max(car.front_track, car.rear_track),
        tolerances={name: max(_TOLERANCES[name], spread.get(name, 0.0)) for name in _TOLERANCES},
    )


def check_choice(name: str, value: object, choices: Any) -> None:
    """Raise ValueError unless a value is one of the choices of a Literal."""
    if value not in get_args(choices):
        message = f"{name} must be one of {', '.join(get_args(choices))}, got {value!r}."
        raise ValueError(message)
