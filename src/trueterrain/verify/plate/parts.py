"""Parts of a calibration plate: cleats, plate, and flanks of the cleats."""

import math
from dataclasses import asdict, dataclass
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

#: Profile of a cleat; "edge" is a low bar with sharp edges.
CleatShape = Literal["rectangle", "semicircle", "triangle", "edge"]

#: Densities of plate materials [kg/m³].
DENSITIES = {"aluminium": 2700.0, "steel": 7850.0}

_MAX_SIZE = 10.0  # [m] of a plate and its cleats
_FACE = 1e-6  # [m] along the profile from the foot of an upright face to its top
_CHORD = 1e-6  # [m] largest deviation of a polygon from an arc
EDGE_RISE = 0.015  # [m] of the bar with sharp edges
_BORDER = 0.02  # [m] smallest distance of a hole's centre from the rim of the plate


@dataclass(frozen=True, kw_only=True)
class PlateCleat:
    """A cleat bolted to the plate.

    Raises
    ------
    ValueError
        If a value is out of its bounds.

    Examples
    --------
    >>> print(PlateCleat(shape="triangle", width=0.08, rise=0.04).outline())
    [[0.   0.04 0.08]
     [0.   0.04 0.  ]]
    """

    shape: CleatShape
    "Profile: rectangle, semicircle (half an ellipse if not half as high as wide), triangle, edge."

    hole: int = 0
    "Row of holes of its centre, counted from the centre of the plate."

    width: float = 0.076
    "Extent along the profile [m]."

    rise: float = 0.038
    "Height above the plate [m]."

    def __post_init__(self) -> None:
        """Check the values."""
        if self.shape not in get_args(CleatShape):
            message = f"shape must be one of {', '.join(get_args(CleatShape))}, got {self.shape!r}."
            raise ValueError(message)
        if not (0 < self.width <= _MAX_SIZE and 0 < self.rise <= _MAX_SIZE):
            message = (
                f"width and rise must be greater than 0 m and at most {_MAX_SIZE:g} m, got "
                f"{self.width} and {self.rise}."
            )
            raise ValueError(message)

    @property
    def area(self) -> float:
        """Cross-section [m²]."""
        fill = {"rectangle": 1.0, "edge": 1.0, "triangle": 0.5, "semicircle": math.pi / 4}
        return fill[self.shape] * self.width * self.rise

    def outline(self) -> Floats:
        """Coordinates from its left foot and heights above the plate, shape (2, n) [m]."""
        width, rise = self.width, self.rise
        if self.shape == "triangle":
            return np.array([[0.0, width / 2, width], [0.0, rise, 0.0]])
        if self.shape == "semicircle":
            # sagitta of a chord: r (1 - cos(angle / 2)) is at most _CHORD
            radius = max(width / 2, rise)
            parts = math.ceil(math.pi / (2 * math.acos(1 - min(_CHORD / radius, 1.0))))
            angle = np.linspace(0, math.pi, parts + 1)
            heights = rise * np.sin(angle)
            heights[[0, -1]] = 0.0
            return np.array([width / 2 * (1 - np.cos(angle)), heights])
        return np.array([[0.0, _FACE, width - _FACE, width], [0.0, rise, rise, 0.0]])


@dataclass(frozen=True, kw_only=True)
class PlateDesign:
    """A plate with cleats across it.

    Raises
    ------
    ValueError
        If a value is out of its bounds, cleats overlap, or one does not fit.

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
    "Thickness of the plate [m]."

    pitch: float = 0.152
    "Distance between holes [m]; 6 inches."

    hole: float = 0.010
    "Diameter of a hole [m]."

    tolerance: float = 0.0001
    "Tolerance of the machined profile, of either sign [m]."

    bands: tuple[tuple[str, float], ...] = (("black", 0.05), ("grey", 0.3), ("white", 0.8))
    "Surfaces side by side across the profile, with their reflectivity from 0 to 1."

    def __post_init__(self) -> None:
        """Check the values, and that the cleats fit."""
        for name in ("length", "width", "thickness", "pitch", "hole", "tolerance"):
            value = getattr(self, name)
            if not 0 < value <= _MAX_SIZE:
                message = (
                    f"{name} must be greater than 0 m and at most {_MAX_SIZE:g} m, got {value}."
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
                f"length must hold all cleats, {1000 * (end - self.length):.0f} mm more, "
                f"got {self.length} m."
            )
            raise ValueError(message)

    def foot(self, cleat: PlateCleat) -> float:
        """Start of a cleat along the profile [m]."""
        return 0.5 * self.length + cleat.hole * self.pitch - 0.5 * cleat.width

    def vertices(self) -> Floats:
        """Corners of the profile: coordinates from the left end and heights, shape (2, n) [m].

        Straight lines join them. An upright face has a width of 1 micrometre; arcs deviate from
        their chords by at most as much. Heights count from the ground under the plate.
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
        """Coordinates of holes along and across the profile, from the centre of the plate [m]."""
        return self._row(self.length), self._row(self.width)

    def _row(self, extent: float) -> Floats:
        count = math.floor((0.5 * extent - _BORDER) / self.pitch)
        row: Floats = self.pitch * np.arange(-count, count + 1, dtype=np.float64)
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
        """Number of panels into which the plate is cut, so that each can be carried.

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
        """Numbers and strings, ready for JSON; lengths in m, masses in kg."""
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
    """Flanks of all cleats, from left to right.

    Parameters
    ----------
    plate : PlateDesign
        The plate.

    Returns
    -------
    tuple of Flank
        Two for each cleat: "right" as seen by the scanner, at the smaller s, then "left".

    Examples
    --------
    >>> triangle = cleat_flanks(PlateDesign())[4]
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
