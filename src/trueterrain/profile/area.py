"""Search areas: the patch of ground around each path point that counts (thesis 5.2.2)."""

from dataclasses import dataclass
from enum import IntEnum

#: A point this little outside of a search area still counts [m], so that a grid node exactly on
#: the edge is not lost to the round-off of coordinates of thousands of kilometres.
EDGE_TOLERANCE = 1e-8


class Shape(IntEnum):
    """Shapes as the kernels know them."""

    ELLIPSE = 0
    RECTANGLE = 1


@dataclass(frozen=True, kw_only=True)
class Disc:
    """A disc around the path point: the thesis's search area."""

    radius: float = 0.025
    "Radius of the disc [m]."

    def __post_init__(self) -> None:
        """Check the radius."""
        _require_positive("radius", self.radius)

    @property
    def half_axes(self) -> tuple[float, float]:
        """Half length along and half width across the path [m]."""
        return self.radius, self.radius

    @property
    def shape(self) -> Shape:
        """Shape for the kernels."""
        return Shape.ELLIPSE


@dataclass(frozen=True, kw_only=True)
class Ellipse:
    """An ellipse aligned with the path."""

    length: float
    "Extent along the path [m]."

    width: float
    "Extent across the path [m]."

    def __post_init__(self) -> None:
        """Check the extents."""
        _require_positive("length", self.length)
        _require_positive("width", self.width)

    @property
    def half_axes(self) -> tuple[float, float]:
        """Half length along and half width across the path [m]."""
        return self.length / 2, self.width / 2

    @property
    def shape(self) -> Shape:
        """Shape for the kernels."""
        return Shape.ELLIPSE


@dataclass(frozen=True, kw_only=True)
class Rectangle:
    """A rectangle aligned with the path: the contact patch of a tyre."""

    length: float
    "Extent along the path [m]."

    width: float
    "Extent across the path [m]."

    def __post_init__(self) -> None:
        """Check the extents."""
        _require_positive("length", self.length)
        _require_positive("width", self.width)

    @property
    def half_axes(self) -> tuple[float, float]:
        """Half length along and half width across the path [m]."""
        return self.length / 2, self.width / 2

    @property
    def shape(self) -> Shape:
        """Shape for the kernels."""
        return Shape.RECTANGLE


SearchArea = Disc | Ellipse | Rectangle


def reach(area: SearchArea) -> float:
    """Distance of the farthest point that may belong to a search area [m].

    Parameters
    ----------
    area : Disc, Ellipse or Rectangle
        The search area.

    Returns
    -------
    float
        Half diagonal of a rectangle, longer half axis of an ellipse, plus `EDGE_TOLERANCE`.
    """
    along, across = area.half_axes
    if area.shape is Shape.RECTANGLE:
        return float((along**2 + across**2) ** 0.5) + 2 * EDGE_TOLERANCE
    return max(along, across) + EDGE_TOLERANCE


def _require_positive(name: str, value: float) -> None:
    if not 0 < value < float("inf"):
        message = f"{name} must be greater than 0 m, got {value}."
        raise ValueError(message)
