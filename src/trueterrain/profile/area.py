"""Search areas: the patch of ground around each path point that counts (thesis 5.2.2)."""

from dataclasses import dataclass
from enum import IntEnum

#: A point this little outside of a search area still counts [m], so that a grid node exactly on
#: the edge is not lost to the round-off of coordinates of thousands of kilometres.
EDGE_TOLERANCE = 1e-8

_LARGEST = 2.0  # [m] the largest tyres, of mining trucks, are 1.5 m wide, and their patch as long
_LARGE = 0.5  # [m] the contact patch of a truck's tyre is about 0.3 m long and wide


class AreaShape(IntEnum):
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
        _require_size("radius", self.radius, _LARGEST / 2)

    @property
    def half_axes(self) -> tuple[float, float]:
        """Half length along and half width across the path [m]."""
        return self.radius, self.radius

    @property
    def shape(self) -> AreaShape:
        """Shape for the kernels."""
        return AreaShape.ELLIPSE


@dataclass(frozen=True, kw_only=True)
class Ellipse:
    """An ellipse aligned with the path."""

    length: float
    "Extent along the path [m]."

    width: float
    "Extent across the path [m]."

    def __post_init__(self) -> None:
        """Check the extents."""
        _require_size("length", self.length, _LARGEST)
        _require_size("width", self.width, _LARGEST)

    @property
    def half_axes(self) -> tuple[float, float]:
        """Half length along and half width across the path [m]."""
        return self.length / 2, self.width / 2

    @property
    def shape(self) -> AreaShape:
        """Shape for the kernels."""
        return AreaShape.ELLIPSE


@dataclass(frozen=True, kw_only=True)
class Rectangle:
    """A rectangle aligned with the path: the contact patch of a tyre."""

    length: float
    "Extent along the path [m]."

    width: float
    "Extent across the path [m]."

    def __post_init__(self) -> None:
        """Check the extents."""
        _require_size("length", self.length, _LARGEST)
        _require_size("width", self.width, _LARGEST)

    @property
    def half_axes(self) -> tuple[float, float]:
        """Half length along and half width across the path [m]."""
        return self.length / 2, self.width / 2

    @property
    def shape(self) -> AreaShape:
        """Shape for the kernels."""
        return AreaShape.RECTANGLE


SearchArea = Disc | Ellipse | Rectangle


def area_reach(area: SearchArea) -> float:
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
    if area.shape is AreaShape.RECTANGLE:
        return float((along**2 + across**2) ** 0.5) + 2 * EDGE_TOLERANCE
    return max(along, across) + EDGE_TOLERANCE


def area_flag(area: SearchArea) -> str | None:
    """Why a search area is no contact patch of a tyre on a road, None if it can be.

    Parameters
    ----------
    area : Disc, Ellipse or Rectangle
        The search area.

    Returns
    -------
    str or None
        One sentence if it is longer or wider than 0.5 m.

    Examples
    --------
    >>> print(area_flag(Disc(radius=0.5)))
    the search area is 1 m long and 1 m wide, ... shorter waves are lost
    >>> area_flag(Disc())
    """
    along, across = (2 * half for half in area.half_axes)
    if max(along, across) <= _LARGE:
        return None
    return (
        f"the search area is {along:g} m long and {across:g} m wide, the contact patch of a "
        "truck's tyre about 0.3 m: shorter waves are lost"
    )


def _require_positive(name: str, value: float) -> None:
    if not 0 < value < float("inf"):
        message = f"{name} must be greater than 0 m, got {value}."
        raise ValueError(message)


def _require_size(name: str, value: float, largest: float) -> None:
    _require_positive(name, value)
    if value > largest:
        message = (
            f"{name} must be at most {largest:g} m, since no tyre's contact patch is longer or "
            f"wider than {_LARGEST:g} m, got {value:g}; is it in millimetres?"
        )
        raise ValueError(message)
