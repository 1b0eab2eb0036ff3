"""Vehicle parameters, and named sets of them with their sources."""

from dataclasses import dataclass, fields
from difflib import get_close_matches
from typing import Literal

import numpy as np
import numpy.typing as npt

# Units of the fields by the suffix of their names; the first match holds
_UNITS = {
    "anti_roll_stiffness": "N m/rad",
    "mass": "kg",
    "inertia": "kg m²",
    "stiffness": "N/m",
    "damping": "N s/m",
    "axle": "m",
    "track": "m",
    "height": "m",
}

# Fields that may be 0, by the suffix of their names: statics does not need them
_MAY_BE_ZERO = ("damping", "anti_roll_stiffness")


@dataclass(frozen=True, kw_only=True)
class QuarterCarParameters:
    """Parameters of a quarter car: one wheel and the part of the body that it carries.

    Raises
    ------
    ValueError
        If a parameter is not finite, or not positive where it must be.

    Examples
    --------
    >>> GOLDEN_QUARTER_CAR.tyre_stiffness / GOLDEN_QUARTER_CAR.sprung_mass
    653.0
    """

    sprung_mass: float
    "Part of the body that the wheel carries [kg]."

    unsprung_mass: float
    "Wheel, brake and the part of the suspension that moves with them [kg]."

    suspension_stiffness: float
    "Spring between body and wheel, reduced to the wheel [N/m]."

    suspension_damping: float
    "Damper between body and wheel, reduced to the wheel [N s/m]."

    tyre_stiffness: float
    "Vertical spring between wheel and ground [N/m]."

    tyre_damping: float = 0.0
    "Damper between wheel and ground [N s/m]."

    def __post_init__(self) -> None:
        _check_parameters(self)


@dataclass(frozen=True, kw_only=True)
class FullCarParameters:
    """Parameters of a full car: a rigid body on four wheels, symmetric about its xz plane.

    Masses, stiffness and damping of suspension and tyre are those of one wheel, reduced to it.

    Raises
    ------
    ValueError
        If a parameter is not finite, or not positive where it must be.

    Examples
    --------
    >>> van = named_vehicle("van")
    >>> print(f"{van.wheelbase:.3f} m, {van.total_mass:.0f} kg")
    2.472 m, 1479 kg
    """

    sprung_mass: float
    "Mass of the body [kg]."

    pitch_inertia: float
    "Of the body, about the transverse axis through its centre of gravity [kg m²]."

    roll_inertia: float
    "Of the body, about the longitudinal axis through its centre of gravity [kg m²]."

    front_axle: float
    "Distance of the front axle ahead of the body's centre of gravity [m]."

    rear_axle: float
    "Distance of the rear axle behind the body's centre of gravity [m]."

    front_track: float
    "Distance between the front wheels [m]."

    rear_track: float
    "Distance between the rear wheels [m]."

    front_unsprung_mass: float
    "Of one front wheel [kg]."

    rear_unsprung_mass: float
    "Of one rear wheel [kg]."

    front_suspension_stiffness: float
    "Spring of one front wheel [N/m]."

    rear_suspension_stiffness: float
    "Spring of one rear wheel [N/m]."

    front_suspension_damping: float
    "Damper of one front wheel [N s/m]."

    rear_suspension_damping: float
    "Damper of one rear wheel [N s/m]."

    front_tyre_stiffness: float
    "Vertical, of one front wheel [N/m]."

    rear_tyre_stiffness: float
    "Vertical, of one rear wheel [N/m]."

    front_tyre_damping: float = 0.0
    "Vertical, of one front wheel [N s/m]."

    rear_tyre_damping: float = 0.0
    "Vertical, of one rear wheel [N s/m]."

    front_anti_roll_stiffness: float = 0.0
    "Moment of the front anti-roll bar over the roll of the body relative to the axle [N m/rad]."

    rear_anti_roll_stiffness: float = 0.0
    "Moment of the rear anti-roll bar over the roll of the body relative to the axle [N m/rad]."

    cg_height: float = 0.6
    "Height of the body's centre of gravity above the ground at rest; for placing instruments [m]."

    def __post_init__(self) -> None:
        _check_parameters(self)

    @property
    def wheelbase(self) -> float:
        """Distance between the axles [m]."""
        return self.front_axle + self.rear_axle

    @property
    def total_mass(self) -> float:
        """Mass of body and four wheels [kg]."""
        return self.sprung_mass + 2 * (self.front_unsprung_mass + self.rear_unsprung_mass)

    @property
    def wheel_positions(self) -> npt.NDArray[np.float64]:
        """Coordinates (x, y) of the wheels from the centre of gravity, shape (4, 2) [m].

        Examples
        --------
        >>> print(named_vehicle("golden car").wheel_positions)
        [[ 1.35  0.75]
         [ 1.35 -0.75]
         [-1.35  0.75]
         [-1.35 -0.75]]
        """
        front, rear = self.front_track / 2, self.rear_track / 2
        return np.array(
            [
                [self.front_axle, front],
                [self.front_axle, -front],
                [-self.rear_axle, rear],
                [-self.rear_axle, -rear],
            ]
        )

    def corner(self, axle: Literal["front", "rear"]) -> QuarterCarParameters:
        """Quarter car of one wheel, with the part of the body that the wheel carries at rest.

        Parameters
        ----------
        axle : {"front", "rear"}
            Axle of the wheel.

        Returns
        -------
        QuarterCarParameters
            The wheel, its suspension, and its part of the body, without anti-roll bars.

        Raises
        ------
        ValueError
            If there is no such axle.

        Examples
        --------
        >>> named_vehicle("golden car").corner("rear") == GOLDEN_QUARTER_CAR
        True
        """
        if axle not in ("front", "rear"):
            message = f"axle must be 'front' or 'rear', got {axle!r}"
            raise ValueError(message)
        other = self.rear_axle if axle == "front" else self.front_axle
        return QuarterCarParameters(
            sprung_mass=self.sprung_mass / 2 * (other / self.wheelbase),
            unsprung_mass=getattr(self, f"{axle}_unsprung_mass"),
            suspension_stiffness=getattr(self, f"{axle}_suspension_stiffness"),
            suspension_damping=getattr(self, f"{axle}_suspension_damping"),
            tyre_stiffness=getattr(self, f"{axle}_tyre_stiffness"),
            tyre_damping=getattr(self, f"{axle}_tyre_damping"),
        )


def _check_parameters(parameters: QuarterCarParameters | FullCarParameters) -> None:
    for field in fields(parameters):
        value = getattr(parameters, field.name)
        may_be_zero = field.name.endswith(_MAY_BE_ZERO)
        if not (np.isfinite(value) and (value > 0 or (value == 0 and may_be_zero))):
            unit = next(unit for end, unit in _UNITS.items() if field.name.endswith(end))
            rule = "at least" if may_be_zero else "greater than"
            message = f"{field.name} must be finite and {rule} 0 {unit}, got {value}"
            raise ValueError(message)


#: The golden car of the International Roughness Index: stiffness 63.3 and 653 1/s², damping 6 1/s,
#: mass ratio 0.15 (Sayers, Transportation Research Record 1501, 1995). These are ratios to the
#: sprung mass, which does not change the motion; 250 kg is a quarter of a mid-sized car.
GOLDEN_QUARTER_CAR = QuarterCarParameters(
    sprung_mass=250.0,
    unsprung_mass=0.15 * 250.0,
    suspension_stiffness=63.3 * 250.0,
    suspension_damping=6.0 * 250.0,
    tyre_stiffness=653.0 * 250.0,
)

# A full car whose four corners are golden cars. No standard defines it: wheelbase 2.7 m and track
# 1.5 m are those of a mid-sized car, the inertias 0.9 m a b in pitch and 0.7 m (t/2)² in roll. With
# both factors 1, the body above each wheel would move as an independent golden car.
_GOLDEN_CAR = FullCarParameters(
    sprung_mass=1000.0,
    pitch_inertia=0.9 * 1000.0 * 1.35**2,
    roll_inertia=0.7 * 1000.0 * 0.75**2,
    front_axle=1.35,
    rear_axle=1.35,
    front_track=1.5,
    rear_track=1.5,
    front_unsprung_mass=GOLDEN_QUARTER_CAR.unsprung_mass,
    rear_unsprung_mass=GOLDEN_QUARTER_CAR.unsprung_mass,
    front_suspension_stiffness=GOLDEN_QUARTER_CAR.suspension_stiffness,
    rear_suspension_stiffness=GOLDEN_QUARTER_CAR.suspension_stiffness,
    front_suspension_damping=GOLDEN_QUARTER_CAR.suspension_damping,
    rear_suspension_damping=GOLDEN_QUARTER_CAR.suspension_damping,
    front_tyre_stiffness=GOLDEN_QUARTER_CAR.tyre_stiffness,
    rear_tyre_stiffness=GOLDEN_QUARTER_CAR.tyre_stiffness,
)

# The next three: parameter sets 1, 2 and 3 (Ford Escort, BMW 320i, VW Vanagon) of the package
# commonroad-vehicle-models 3.0.2 (BSD-3-Clause); Althoff and Würsching, "CommonRoad: Vehicle
# Models" (2020), table 6. They state the unsprung mass of an axle, twice that of a wheel, and the
# anti-roll stiffness with the opposite sign.
_COMPACT = FullCarParameters(
    sprung_mass=1094.542720,
    pitch_inertia=1342.259769,
    roll_inertia=244.0472307,
    front_axle=0.88392,
    rear_axle=1.50876,
    front_track=1.389888,
    rear_track=1.423416,
    front_unsprung_mass=65.67256322 / 2,
    rear_unsprung_mass=65.67256322 / 2,
    front_suspension_stiffness=21898.33243,
    rear_suspension_stiffness=21898.33243,
    front_suspension_damping=1459.390294,
    rear_suspension_damping=1459.390294,
    front_tyre_stiffness=189785.5477,
    rear_tyre_stiffness=189785.5477,
    front_anti_roll_stiffness=12880.27051,
    rear_anti_roll_stiffness=0.0,
    cg_height=0.59436,
)
_SEDAN = FullCarParameters(
    sprung_mass=965.7108099,
    pitch_inertia=1565.817879,
    roll_inertia=207.2652456,
    front_axle=1.156195706,
    rear_axle=1.422717094,
    front_track=1.38684,
    rear_track=1.36398,
    front_unsprung_mass=63.79218261 / 2,
    rear_unsprung_mass=63.79218261 / 2,
    front_suspension_stiffness=24453.13788,
    rear_suspension_stiffness=19635.50475,
    front_suspension_damping=1786.244100,
    rear_suspension_damping=1649.083303,
    front_tyre_stiffness=158294.1398,
    rear_tyre_stiffness=158294.1398,
    front_anti_roll_stiffness=6914.881688,
    rear_anti_roll_stiffness=2643.600952,
    cg_height=0.61373004,
)
_VAN = FullCarParameters(
    sprung_mass=1316.608655,
    pitch_inertia=2204.322716,
    roll_inertia=479.8843058,
    front_axle=1.150791602,
    rear_axle=1.321136398,
    front_track=1.574292,
    rear_track=1.543812,
    front_unsprung_mass=81.14428941 / 2,
    rear_unsprung_mass=81.14428941 / 2,
    front_suspension_stiffness=33577.44306,
    rear_suspension_stiffness=39125.02061,
    front_suspension_damping=2405.564100,
    rear_suspension_damping=2769.727219,
    front_tyre_stiffness=212641.5672,
    rear_tyre_stiffness=212641.5672,
    front_anti_roll_stiffness=33948.21714,
    rear_anti_roll_stiffness=7731.374238,
    cg_height=0.804490644,
)
_BY_NAME = {"compact": _COMPACT, "golden car": _GOLDEN_CAR, "sedan": _SEDAN, "van": _VAN}


def vehicle_names() -> tuple[str, ...]:
    """Names of the parameter sets of `named_vehicle`.

    Returns
    -------
    tuple of str
        In alphabetical order.

    Examples
    --------
    >>> vehicle_names()
    ('compact', 'golden car', 'sedan', 'van')
    """
    return tuple(sorted(_BY_NAME))


def named_vehicle(name: str) -> FullCarParameters:
    """Parameters of a full car by name.

    Parameters
    ----------
    name : str
        "golden car", whose four corners are the golden car of the International Roughness Index;
        "compact", a Ford Escort; "sedan", a BMW 320i; "van", a VW Vanagon.

    Returns
    -------
    FullCarParameters
        The full car; its `corner` is the quarter car.

    Raises
    ------
    ValueError
        If no vehicle has that name.

    Notes
    -----
    Compact, sedan and van: Althoff and Würsching, "CommonRoad: Vehicle Models" (2020), table 6,
    from the package commonroad-vehicle-models 3.0.2 (BSD-3-Clause).

    Examples
    --------
    >>> named_vehicle("van").front_track
    1.574292
    """
    if name in _BY_NAME:
        return _BY_NAME[name]
    close = get_close_matches(str(name).lower(), _BY_NAME, n=1)
    hint = f"; did you mean {close[0]!r}?" if close else ""
    message = f"vehicle must be one of {', '.join(vehicle_names())}, got {name!r}{hint}"
    raise ValueError(message)
