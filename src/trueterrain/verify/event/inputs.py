"""Inputs of the design of an excitation event: frequencies, damping and size of a vehicle."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

from trueterrain.vehicle import FullCarParameters, linear_model, vehicle_modes

#: Mode of the body that the event as a whole is to excite.
Target = Literal["heave", "pitch", "roll"]

#: Default tolerances: resolution of spectra, and placing of boards.
_TOLERANCES = {"ride": 0.05, "hop": 0.5, "damping": 0.05, "length": 0.005}


@dataclass(frozen=True, kw_only=True)
class EventInputs:
    """Inputs of the design of an event, with their tolerances.

    Raises
    ------
    ValueError
        If a value is out of its bounds.

    Examples
    --------
    >>> EventInputs().hop
    11.0
    """

    ride: float = 1.1
    "Frequency of the mode of the body that the event as a whole is to excite: f1 [Hz]."

    hop: float = 11.0
    "Undamped frequency of wheel hop: f2 [Hz]."

    damping: float = 0.3
    "Damping ratio of wheel hop [1]."

    tyre_stiffness_fraction: float = 1.0
    """Stiffness of the tyre over the sum of those of tyre and suspension; 1 neglects the suspension
    [1]."""

    wheelbase: float | None = None
    "Distance between the axles [m]; None if it is not known."

    track: float = 1.6
    "Greatest distance between the wheels of an axle [m]."

    tolerances: Mapping[str, float] = field(default_factory=lambda: dict(_TOLERANCES))
    """Tolerances of `ride` [Hz], `hop` [Hz], `damping` [1] and the `length` of the event [m];
    inputs not named are exact."""

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
        if not 0 < self.tyre_stiffness_fraction <= 1:
            message = (
                "tyre_stiffness_fraction must be greater than 0 and at most 1, got "
                f"{self.tyre_stiffness_fraction}."
            )
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
            bound = min(self.damping, 1 - self.damping) if name == "damping" else math.inf
            if value >= min(getattr(self, name, math.inf), bound):
                message = f"the tolerance of {name} must leave it within its bounds, got {value}."
                raise ValueError(message)
        if self.hop - self.tolerances.get("hop", 0) <= self.ride + self.tolerances.get("ride", 0):
            message = "the tolerances of hop and ride must leave hop above ride."
            raise ValueError(message)


def event_inputs(car: FullCarParameters, target: Target = "heave") -> EventInputs:
    """Inputs of the design of an event, from the parameters of a vehicle.

    Parameters
    ----------
    car : FullCarParameters
        The vehicle.
    target : {"heave", "pitch", "roll"}
        Mode of the body that the event as a whole is to excite.

    Returns
    -------
    EventInputs
        Undamped frequency of that mode; frequency, damping ratio and stiffness fraction of the tyre
        as means over the hop of both axles; wheelbase and track. The tolerance of hop covers both
        axles.

    Raises
    ------
    ValueError
        If the target is unknown.

    Examples
    --------
    >>> from trueterrain.vehicle import named_vehicle
    >>> van = event_inputs(named_vehicle("van"), "pitch")
    >>> fraction = van.tyre_stiffness_fraction
    >>> print(f"{van.ride:.2f} {van.hop:.2f} Hz, {van.damping:.2f}, {fraction:.3f}")
    1.41 12.48 Hz, 0.43, 0.854
    """
    check_choice("target", target, Target)
    modes = vehicle_modes(linear_model(car))
    front, rear = modes.names.index("front hop"), modes.names.index("rear hop")
    hops = modes.undamped_frequency[[front, rear]]
    dampings = modes.damping_ratio[[front, rear]]
    fractions = [
        tyre / (tyre + spring)
        for tyre, spring in (
            (car.front_tyre_stiffness, car.front_suspension_stiffness),
            (car.rear_tyre_stiffness, car.rear_suspension_stiffness),
        )
    ]
    scatter = {"hop": float(hops.std()), "damping": float(dampings.std())}
    return EventInputs(
        ride=float(modes.undamped_frequency[modes.names.index(target)]),
        hop=float(hops.mean()),
        damping=float(dampings.mean()),
        tyre_stiffness_fraction=sum(fractions) / 2,
        wheelbase=car.wheelbase,
        track=max(car.front_track, car.rear_track),
        tolerances={name: max(_TOLERANCES[name], scatter.get(name, 0.0)) for name in _TOLERANCES},
    )


def check_choice(name: str, value: object, choices: Any) -> None:
    """Raise ValueError unless a value is one of the choices of a Literal."""
    if value not in get_args(choices):
        message = f"{name} must be one of {', '.join(get_args(choices))}, got {value!r}."
        raise ValueError(message)
