"""Parts of a calibration plate: cleats, the plate that carries them, and their steep sides."""

import math
from dataclasses import asdict, dataclass
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

#: Profile of a cleat; "edge" is a low bar with sharp edges.
CleatShape = Literal["rectangle", "semicircle", "triangle", "edge"]

#: Densities [kg/m³] of what plates are made of.
DENSITIES = {"aluminium": 2700.0, "steel": 7850.0}

_LARGEST = 1.0  # [m] of a cleat on a plate that two people carry
_LARGEST = 10.0  # [m] of a plate and what stands on it
_FACE = 1e-6  # [m] along the profile from the foot of an upright face to its top
_CHORD = 1e-6  # [m] by which a polygon may depart from an arc
EDGE_RISE = 0.015  # [m] of the bar with sharp edges
_BORDER = 0.02  # [m] from the middle of a hole to the rim of the plate


@dataclass(frozen=True, kw_only=True)
class PlateCleat:
    """A cleat bolted to the plate.

    Raises
    ------
    ValueError
        If a value breaks its rule.

    Examples
    --------
    >>> print(PlateCleat(shape="triangle", width=0.08, rise=0.04).outline())
    [[0.   0.04 0.08]
     [0.   0.04 0.  ]]
    """

    shape: CleatShape
    "Profile: rectangle, semicircle (half an ellipse if not half as high as wide), triangle, edge."

    hole: int = 0
    "Row of holes on which its middle lies, from the middle of the plate."

    width: float = 0.076
    "Extent along the profile [m]."

    rise: float = 0.038
    "Height above the plate [m]."

    def __post_init__(self) -> None:
        """Check the values."""
        if self.shape not in get_args(CleatShape):
            message = f"shape must be one of {', '.join(get_args(CleatShape))}, got {self.shape!r}."
            raise ValueError(message)
        if not (0 < self.width <= _LARGEST and 0 < self.rise <= _LARGEST):
            message = (
                f"width and rise must be greater than 0 m and at most {_LARGEST:g} m, got "
                f"{self.width} and {self.rise}."
            )
            raise ValueError(message)

    @property
    def area(self) -> float:
        """Cross-section [m²]."""
        share = {"rectangle": 1.0, "edge": 1.0, "triangle": 0.5, "semicircle": math.pi / 4}
        return share[self.shape] * self.width * self.rise

    def outline(self) -> Floats:
        """Place from its left foot, and height above the plate, shape (2, n) [m]."""
        width, rise = self.width, self.rise
        if self.shape == "triangle":
            return np.array([[0.0, width / 2, width], [0.0, rise, 0.0]])
        if self.shape == "semicircle":
            largest = max(width / 2, rise)
            parts = math.ceil(math.pi / (2 * math.acos(1 - min(_CHORD / largest, 1.0))))
            turn = np.linspace(0, math.pi, parts + 1)
            heights = rise * np.sin(turn)
            heights[[0, -1]] = 0.0
            return np.array([width / 2 * (1 - np.cos(turn)), heights])
        return np.array([[0.0, _FACE, width - _FACE, width], [0.0, rise, rise, 0.0]])


@dataclass(frozen=True, kw_only=True)
class PlateDesign:
    """A plate with cleats across it.

    Raises
    ------
    ValueError
        If a value breaks its rule, cleats overlap, or one does not fit.

    Examples
    --------
    >>> plate = PlateDesign()
    >>> [(cleat.shape, cleat.hole) for cleat in plate.cleats]
    [('rectangle', -3), ('semicircle', -1), ('triangle', 1), ('edge', 3)]
    >>> print(f"{plate.mass('aluminium'):.0f} kg, {plate.mass('steel'):.0f} kg")
    72 kg, 208 kg
    """

    cleats: tuple[PlateCleat, ...] = (
        PlateCleat(shape="rectangle", hole=-3),
        PlateCleat(shape="semicircle", hole=-1),
        PlateCleat(shape="triangle", hole=1),
        PlateCleat(shape="edge", hole=3, rise=EDGE_RISE),
    )
    "The cleats, from left to right."

    length: float = 1.2
    "Extent along the profile [m]."

    width: float = 1.2
    "Extent of plate and cleats across the profile [m]."

    thickness: float = 0.012
    "Of the plate [m]."

    pitch: float = 0.152
    "From hole to hole [m]; 6 inches."

    hole: float = 0.010
    "Diameter of a hole [m]."

    tolerance: float = 0.0001
    "By how much the machined profile may be off, either way [m]."

    bands: tuple[tuple[str, float], ...] = (("black", 0.05), ("grey", 0.3), ("white", 0.8))
    "Surfaces side by side across the profile, and their reflectivity from 0 to 1."

    def __post_init__(self) -> None:
        """Check the values, and that the cleats fit."""
        for name in ("length", "width", "thickness", "pitch", "hole", "tolerance"):
            value = getattr(self, name)
            if not 0 < value <= _LARGEST:
                message = (
                    f"{name} must be greater than 0 m and at most {_LARGEST:g} m, got {value}."
                )
                raise ValueError(message)
        if not self.cleats or not self.bands:
            message = "cleats and bands must each hold at least one."
            raise ValueError(message)
        for name, reflectivity in self.bands:
            if not 0 <= reflectivity <= 1:
                message = f"the reflectivity of {name} must be from 0 to 1, got {reflectivity}."
                raise ValueError(message)
        end, before = 0.0, "the rim of the plate"
        for cleat in self.cleats:
            begin = self.foot(cleat)
            if begin < end:
                message = (
                    f"cleats must lie in order without touching; the {cleat.shape} at hole "
                    f"{cleat.hole} begins {1000 * (end - begin):.0f} mm before the end of {before}."
                )
                raise ValueError(message)
            end, before = begin + cleat.width + 2 * _FACE, f"the {cleat.shape}"
        if end > self.length:
            message = (
                f"length must leave room for the cleats, {1000 * (end - self.length):.0f} mm more, "
                f"got {self.length} m."
            )
            raise ValueError(message)

    def foot(self, cleat: PlateCleat) -> float:
        """Where a cleat begins along the profile [m]."""
        return 0.5 * self.length + cleat.hole * self.pitch - 0.5 * cleat.width

    def vertices(self) -> Floats:
        """Corners of the profile: place from the left end and height, shape (2, n) [m].

        Straight lines join them. An upright face takes 1 micrometre, arcs depart from their chords
        by as much at most. Heights count from the ground on which the plate lies.
        """
        parts = [np.array([[0.0], [0.0]])]
        for cleat in self.cleats:
            outline = cleat.outline()
            outline[0] += self.foot(cleat)
            parts.append(outline)
        parts.append(np.array([[self.length], [0.0]]))
        corners = np.concatenate(parts, axis=1)
        corners[1] += self.thickness
        return corners

    def holes(self) -> tuple[Floats, Floats]:
        """Rows of holes along the profile and across it, from the middle of the plate [m]."""
        return self._row(self.length), self._row(self.width)

    def _row(self, extent: float) -> Floats:
        most = math.floor((0.5 * extent - _BORDER) / self.pitch)
        row: Floats = self.pitch * np.arange(-most, most + 1, dtype=np.float64)
        return row

    def mass(self, material: str) -> float:
        """Mass of plate and cleats [kg].

        Raises
        ------
        ValueError
            If the material is neither aluminium nor steel.
        """
        return self.mass_of_plate(material) + sum(
            self.mass_of_cleat(cleat, material) for cleat in self.cleats
        )

    def mass_of_plate(self, material: str) -> float:
        """Mass of the plate without cleats, less its holes [kg]."""
        along, across = self.holes()
        bored = along.size * across.size * math.pi / 4 * self.hole**2
        return _material_density(material) * self.thickness * (self.length * self.width - bored)

    def mass_of_cleat(self, cleat: PlateCleat, material: str) -> float:
        """Mass of a cleat [kg]."""
        return _material_density(material) * cleat.area * self.width

    def panels(self, material: str, carried: float = 25.0) -> int:
        """Panels into which the plate is to be cut for each to be carried.

        Parameters
        ----------
        material : str
            aluminium or steel.
        carried : float
            Largest mass of a panel [kg].

        Raises
        ------
        ValueError
            If the mass is not greater than 0.
        """
        if not 0 < carried < math.inf:
            message = f"carried must be greater than 0 kg, got {carried}."
            raise ValueError(message)
        return math.ceil(self.mass_of_plate(material) / carried)

    def to_dict(self) -> dict[str, Any]:
        """All of it as plain numbers and words, as for JSON; lengths in m, masses in kg."""
        along, across = self.holes()
        return {
            **asdict(self),
            "holes": [along.size, across.size],
            "mass": {material: self.mass(material) for material in DENSITIES},
            "panels": {material: self.panels(material) for material in DENSITIES},
        }


@dataclass(frozen=True, kw_only=True)
class Flank:
    """One side of a cleat, where it is steepest."""

    name: str
    "Cleat and side."

    foot: float
    "Where it stands on the plate [m]."

    top: float
    "Where it ends [m]."

    rise: float
    "Height from foot to top [m]."

    slope: float
    "Its greatest steepness [rad]."

    @property
    def begin(self) -> float:
        """The smaller of foot and top [m]."""
        return min(self.foot, self.top)

    @property
    def end(self) -> float:
        """The greater of foot and top [m]."""
        return max(self.foot, self.top)


def cleat_flanks(plate: PlateDesign) -> tuple[Flank, ...]:
    """Sides of all cleats, from left to right.

    Parameters
    ----------
    plate : PlateDesign
        The plate.

    Returns
    -------
    tuple of Flank
        The side at the smaller place first ("right" of the scanner's view), then the other.

    Examples
    --------
    >>> triangle = flanks(PlateDesign())[4]
    >>> print(triangle.name, round(math.degrees(triangle.slope), 3))
    triangle, right 45.0
    """
    out = []
    for cleat in plate.cleats:
        begin, half = plate.foot(cleat), 0.5 * cleat.width
        slope = math.pi / 2
        inset = _FACE
        if cleat.shape == "triangle":
            slope, inset = math.atan2(cleat.rise, half), half
        elif cleat.shape == "semicircle":
            inset = half
        for side, foot, sign in (("right", begin, 1), ("left", begin + cleat.width, -1)):
            out.append(
                Flank(
                    name=f"{cleat.shape}, {side}",
                    foot=foot,
                    top=foot + sign * inset,
                    rise=cleat.rise,
                    slope=slope,
                )
            )
    return tuple(out)


def _material_density(material: str) -> float:
    if material not in DENSITIES:
        message = f"material must be one of {', '.join(DENSITIES)}, got {material!r}."
        raise ValueError(message)
    return DENSITIES[material]
