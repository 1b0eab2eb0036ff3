"""Parameters of typical tyres of passenger cars and trucks, for the envelopes."""

import math
from dataclasses import dataclass
from typing import Literal

TyreName = Literal["passenger", "truck"]


@dataclass(frozen=True, kw_only=True)
class TyreData:
    """Size and stiffness of a tyre at its rated load.

    Notes
    -----
    Contact patch and cams follow from the factors that parameter files of the MF-Swift tyre model
    hold (``Q_RA1``, ``Q_RA2``, ``Q_RB1``, ``Q_RB2``, ``ELLIPS_SHIFT``, ``ELLIPS_LENGTH``,
    ``ELLIPS_HEIGHT``), with the deflection d = load / stiffness and the free radius R:

    - half length a = R (Q_RA1 sqrt(d / R) + Q_RA2 d / R),
    - half width b = section width (Q_RB1 (d / R)^(1/3) + Q_RB2 d / R),
    - distance of the cams 2 a ELLIPS_SHIFT, their half axes R ELLIPS_LENGTH and R ELLIPS_HEIGHT.

    The files name the terms (square root, cube root, linear; scaling of the distance); the
    equations could not be checked against the manual of the model.

    Examples
    --------
    >>> print(f"{PASSENGER_TYRE.deflection:.4f} {PASSENGER_TYRE.contact_length:.3f}")
    0.0191 0.132
    """

    name: str
    "Size and inflation pressure."

    radius: float
    "Free radius [m]."

    section_width: float
    "Width of the inflated section [m]."

    load: float
    "Rated vertical load [N]."

    stiffness: float
    "Vertical stiffness, rated load over deflection on a level ground [N/m]."

    length_factors: tuple[float, float]
    "Square root and linear term of the half length of the patch (Q_RA1, Q_RA2)."

    width_factors: tuple[float, float]
    "Cube root and linear term of the half width of the patch (Q_RB1, Q_RB2)."

    cam_factors: tuple[float, float, float]
    "Distance, half length and half height of the cams (ELLIPS_SHIFT, _LENGTH, _HEIGHT)."

    cam_order: float
    "Exponent of the cams (ELLIPS_ORDER); 2 is an ellipse."

    @property
    def deflection(self) -> float:
        """Deflection on a level ground under the rated load [m]."""
        return self.load / self.stiffness

    @property
    def contact_length(self) -> float:
        """Length of the contact patch on a level ground under the rated load [m]."""
        ratio = self.deflection / self.radius
        root, linear = self.length_factors
        return 2 * self.radius * (root * math.sqrt(ratio) + linear * ratio)

    @property
    def contact_width(self) -> float:
        """Width of the contact patch on a level ground under the rated load [m]."""
        ratio = self.deflection / self.radius
        root, linear = self.width_factors
        return 2 * self.section_width * (root * math.cbrt(ratio) + linear * ratio)


#: Passenger car, 205/60 R15: the parameter set with which Besselink, Schmeitz and Pacejka (2010,
#: "An improved Magic Formula/Swift tyre model that can handle inflation pressure changes",
#: Vehicle System Dynamics 48, S1) demonstrate their model, from public files; the paper itself was
#: not read. Its cams are fitted to measurements. VERTICAL_STIFFNESS is used as load over
#: deflection.
PASSENGER_TYRE = TyreData(
    name="passenger car, 205/60 R15 at 2.2 bar",
    radius=0.3135,
    section_width=0.205,
    load=4000.0,
    stiffness=209_651.0,
    length_factors=(0.671, 0.733),
    width_factors=(1.059, -1.1878),
    cam_factors=(0.8335, 1.471, 0.9622),
    cam_order=1.5174,
)

#: Truck, 315/80 R22.5: size, load and stiffness of "a typical truck tire (Pacejka book)" in the
#: file CityBus_Pac02Tire.tir of the project Chrono (BSD-3-Clause). That file has no patch and no
#: cams: the values are defaults of public readers of such files, not fitted to any truck tyre.
TRUCK_TYRE = TyreData(
    name="truck, 315/80 R22.5 at 8 bar",
    radius=0.548,
    section_width=0.318,
    load=35_000.0,
    stiffness=1.0e6,
    length_factors=(0.5, 1.0),
    width_factors=(1.0, -1.0),
    cam_factors=(0.8, 1.0, 1.0),
    cam_order=1.8,
)

_BY_NAME: dict[str, TyreData] = {"passenger": PASSENGER_TYRE, "truck": TRUCK_TYRE}


def named_tyre(name: TyreName) -> TyreData:
    """Typical tyre by its name.

    Parameters
    ----------
    name : {"passenger", "truck"}
        Kind of vehicle.

    Returns
    -------
    TyreData
        Its size and stiffness.

    Raises
    ------
    ValueError
        If the name is unknown.

    Examples
    --------
    >>> named_tyre("truck").radius
    0.548
    """
    if name not in _BY_NAME:
        message = f"tyre must be one of {', '.join(_BY_NAME)}, got {name!r}."
        raise ValueError(message)
    return _BY_NAME[name]
