"""Search areas: the patch of ground around a path point whose heights count (thesis 5.2.2)."""

from dataclasses import dataclass
from enum import IntEnum

#: Tolerance of the edge of a search area [m], so that a grid node on the edge is not lost to
#: the round-off of coordinates of thousands of kilometres.
EDGE_TOLERANCE = 1e-8

_MAX_SIZE = 2.0  # [m] the largest tyres, of mining trucks, are 1.5 m wide, and their patch as long
_MAX_PLAUSIBLE = 0.5  # [m] the contact patch of a truck's tyre is about 0.3 m long and wide


class AreaShape(IntEnum):
    """Codes of the shapes for the kernels."""

    ELLIPSE = 0
    RECTANGLE = 1


@dataclass(frozen=True, kw_only=True)
class Disc:
    """Disc around the path point: the thesis's search area."""

    radius: float = 0.025
    "Radius of the disc [m]."

    def __post_init__(self) -> None:
        """Check the radius."""
        _require_size("radius", self.radius, _MAX_SIZE / 2)

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
    """Ellipse aligned with the path."""

    length: float
    "Extent along the path [m]."

    width: float
    "Extent across the path [m]."

    def __post_init__(self) -> None:
        """Check the extents."""
        _require_size("length", self.length, _MAX_SIZE)
        _require_size("width", self.width, _MAX_SIZE)

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
    """Rectangle aligned with the path: the contact patch of a tyre."""

    length: float
    "Extent along the path [m]."

    width: float
    "Extent across the path [m]."

    def __post_init__(self) -> None:
        """Check the extents."""
        _require_size("length", self.length, _MAX_SIZE)
        _require_size("width", self.width, _MAX_SIZE)

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
    """Radius of the circle around a search area [m].

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
    """Flag of a search area that is larger than the contact patch of a road tyre.

    Parameters
    ----------
    area : Disc, Ellipse or Rectangle
        The search area.

    Returns
    -------
    str or None
        One sentence if it is longer or wider than 0.5 m, else None.

    Examples
    --------
    >>> print(area_flag(Disc(radius=0.5)))
    the search area is 1 m long and 1 m wide, ... shorter waves are lost
    >>> area_flag(Disc())
    """
    along, across = (2 * half for half in area.half_axes)
    if max(along, across) <= _MAX_PLAUSIBLE:
        return None
    return (
        f"the search area is {along:g} m long and {across:g} m wide, the contact patch of a "
        "truck's tyre about 0.3 m: shorter waves are lost"
    )


def require_positive(name: str, value: float) -> None:
    """Raise ValueError if a length is not finite and greater than 0 m."""
    if not 0 < value < float("inf"):
        message = f"{name} must be greater than 0 m, got {value}."
        raise ValueError(message)


def _require_size(name: str, value: float, max_size: float) -> None:
    require_positive(name, value)
    if value > max_size:
        message = (
            f"{name} must be at most {max_size:g} m, since no tyre's contact patch is longer or "
            f"wider than {_MAX_SIZE:g} m, got {value:g}; is it in millimetres?"
        )
        raise ValueError(message)
