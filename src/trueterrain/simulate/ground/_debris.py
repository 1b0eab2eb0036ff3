"""Debris and distress of a road: stones and cracks."""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from trueterrain.simulate.ground import _kernels
from trueterrain.simulate.ground._ground import (
    Floats,
    Ground,
    check_finite,
    check_fraction,
    check_not_negative,
    check_positive,
    check_seed,
    rotate_axes,
)

CrackPattern = Literal["transverse", "alligator"]

_GOLDEN_FRACTION = 0.6180339887498949  # fractional parts of its multiples are equidistributed
_MAX_MEANDER = 0.2  # [1] of the spacing, so that neighbouring cracks cannot cross


@dataclass(frozen=True, kw_only=True)
class Stone(Ground):
    """One stone on level ground: half an ellipsoid.

    Examples
    --------
    >>> Stone(x=1.0, diameter=0.025, rise=0.01).height([1.0, 1.01, 1.02], 0.0)
    array([0.01 , 0.006, 0.   ])
    """

    x: float = 0.0
    "Easting of its centre [m]."
    y: float = 0.0
    "Northing of its centre [m]."
    diameter: float = 0.025
    "Diameter of the circle that it covers [m]."
    rise: float = 0.0125
    "Height of its top [m]."

    def __post_init__(self) -> None:
        check_finite(self, "x", "y", "rise")
        check_positive(self, "diameter")

    def _height(self, x: Floats, y: Floats) -> Floats:
        radius = 0.5 * self.diameter
        inside = 1.0 - ((x - self.x) ** 2 + (y - self.y) ** 2) / radius**2
        return self.rise * np.sqrt(np.maximum(inside, 0.0))


@dataclass(frozen=True, kw_only=True)
class Stones(Ground):
    """Unbounded field of stones: half-ellipsoids that do not overlap.

    The ground is divided into square cells of area ``1 / density``, with one stone inside each. The
    cells are rotated by an angle from the seed, so that no line along the road lies between them.
    Diameters are uniform on a logarithmic scale.

    Examples
    --------
    >>> grit = Stones(density=50.0, diameter_min=0.01, diameter_max=0.03, seed=4)
    >>> bool(grit.height(*np.random.default_rng(1).uniform(0.0, 9.0, (2, 1000))).max() <= 0.015)
    True
    """

    density: float = 10.0
    "Number of stones per area [1/m^2]."
    diameter_min: float = 0.008
    "Diameter of the smallest stones [m]."
    diameter_max: float = 0.03
    "Diameter of the largest stones [m]."
    height_ratio: float = 0.5
    "Height of a stone over its diameter [1]; 0.5 is half a sphere."
    seed: int = 0
    "Seed of all random numbers."

    def __post_init__(self) -> None:
        check_positive(self, "density", "diameter_min", "diameter_max", "height_ratio")
        if self.diameter_max < self.diameter_min:
            raise ValueError(
                f"diameter_max must be at least diameter_min {self.diameter_min} m, "
                f"got {self.diameter_max} m."
            )
        if self.diameter_max > self._cell:
            raise ValueError(
                f"diameter_max must be at most {self._cell:.4g} m, so that {self.density:g} stones "
                f"per square metre fit, got {self.diameter_max} m."
            )
        check_seed(self.seed)

    @property
    def _cell(self) -> float:
        return float(self.density**-0.5)

    @property
    def _turn(self) -> float:
        """Angle of the cells [rad], from 10 to 35 degrees: oblique to the axes of the road."""
        return float(np.deg2rad(10.0 + 25.0 * ((self.seed * _GOLDEN_FRACTION) % 1.0)))

    def _height(self, x: Floats, y: Floats) -> Floats:
        sizes = (self._cell, self.diameter_min, self.diameter_max, self.height_ratio)
        cos, sin = np.cos(self._turn), np.sin(self._turn)
        return np.asarray(
            _kernels.stone_heights(self.seed, *sizes, cos * x + sin * y, cos * y - sin * x)
        )


@dataclass(frozen=True, kw_only=True)
class Cracks(Ground):
    """Unbounded pattern of narrow cracks in level ground.

    Transverse cracks meander across the road; alligator cracks divide the ground into cells (the
    Voronoi cells of one random point per square of side `spacing`). The cross-section of a crack
    is a parabola of the given width and depth.

    Examples
    --------
    >>> cracks = Cracks(spacing=2.0, depth=0.01, width=0.008, seed=2)
    >>> bool(cracks.height(np.linspace(0.0, 8.0, 8001), 0.3).min() < -0.009)
    True
    """

    pattern: CrackPattern = "transverse"
    '``"transverse"`` or ``"alligator"``.'
    spacing: float = 3.0
    "Mean distance between cracks, or size of the cells [m]."
    width: float = 0.006
    "Width of a crack [m]."
    depth: float = 0.01
    "Depth of a crack at its centre [m]."
    meander: float = 0.1
    "Maximum lateral deviation of a crack from a straight line [m]."
    share: float = 1.0
    "Fraction of the length of transverse cracks, or of the edges of cells, that is open [1]."
    piece: float = 1.0
    "Length of the pieces of a transverse crack that are open or closed [m]."
    direction: float = 0.0
    "Direction of the road, which transverse cracks cross, counter-clockwise from east [rad]."
    seed: int = 0
    "Seed of all random numbers."

    def __post_init__(self) -> None:
        if self.pattern not in get_args(CrackPattern):
            raise ValueError(
                f"pattern must be one of {', '.join(get_args(CrackPattern))}, got {self.pattern!r}."
            )
        check_positive(self, "spacing", "width", "piece")
        check_not_negative(self, "depth", "meander")
        check_fraction(self, "share")
        check_finite(self, "direction")
        if self.width > 0.1 * self.spacing:
            raise ValueError(
                f"width must be at most a tenth of the spacing {self.spacing} m, "
                f"got {self.width} m."
            )
        if self.meander > _MAX_MEANDER * self.spacing:
            raise ValueError(
                f"meander must be at most {_MAX_MEANDER:g} of the spacing {self.spacing} m, "
                f"got {self.meander} m."
            )
        check_seed(self.seed)

    def _height(self, x: Floats, y: Floats) -> Floats:
        u, v = rotate_axes(x, y, self.direction)
        if self.pattern == "transverse":
            sizes = (self.spacing, self.meander, self.share, self.piece, self.width)
            opened = _kernels.transverse_cracks(self.seed, *sizes, u, v)
        else:
            shape = (self.spacing, self.meander, self.share, self.width)
            opened = _kernels.alligator_cracks(self.seed, *shape, u, v)
        return np.asarray(0.0 - self.depth * opened)  # 0.0 instead of -0.0 beside cracks
