"""Base class of grounds, and their sum."""

import dataclasses
from abc import ABC, abstractmethod
from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

_SEED_LIMIT = 2**63


class Ground(ABC):
    """Ground with a height at any point; ``a + b`` is the sum of the heights of two grounds.

    The height at a point depends only on the parameters of the ground: it is the same to the last
    bit for any other points, any order of them, and any shape of the arrays.

    Examples
    --------
    >>> from trueterrain.simulate.ground import Plane, Step
    >>> ramp_with_kerb = Plane(slope=0.01) + Step(position=5.0, rise=0.12)
    >>> ramp_with_kerb.height([0.0, 10.0], 0.0)
    array([0.  , 0.22])
    """

    def height(self, x: npt.ArrayLike, y: npt.ArrayLike) -> Floats:
        """Height of the ground.

        Parameters
        ----------
        x, y : array_like
            Easting and northing [m], of any shapes that broadcast.

        Returns
        -------
        ndarray of float64
            Height [m], of the common shape; NaN where `x` or `y` is not finite, or
            outside a measured ground.
        """
        east, north = np.broadcast_arrays(
            np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
        )
        shape = east.shape
        east, north = np.ascontiguousarray(east).ravel(), np.ascontiguousarray(north).ravel()
        finite = np.isfinite(east) & np.isfinite(north)
        if finite.all():
            return self._height(east, north).reshape(shape)
        out = np.full(east.size, np.nan)
        out[finite] = self._height(east[finite], north[finite])
        return out.reshape(shape)

    @abstractmethod
    def _height(self, x: Floats, y: Floats) -> Floats:
        """Height at finite points in contiguous arrays of one dimension."""

    def to_dict(self) -> dict[str, Any]:
        """Kind and parameters of the ground, for provenance."""
        names = getattr(self, "__dataclass_fields__", {})
        return {"kind": type(self).__name__, **{name: getattr(self, name) for name in names}}

    def __add__(self, other: object) -> "Sum":
        if not isinstance(other, Ground):
            return NotImplemented
        return Sum(parts=(*_ground_parts(self), *_ground_parts(other)))


@dataclasses.dataclass(frozen=True, kw_only=True)
class Sum(Ground):
    """Sum of the heights of several grounds, added in the order given.

    Examples
    --------
    >>> from trueterrain.simulate.ground import Plane
    >>> Sum(parts=(Plane(elevation=1.0), Plane(elevation=0.5))).height(0.0, 0.0)
    array(1.5)
    """

    parts: tuple[Ground, ...]
    "The grounds, from bottom to top."

    def __post_init__(self) -> None:
        if not self.parts:
            raise ValueError("parts must hold at least one ground, got none.")

    def _height(self, x: Floats, y: Floats) -> Floats:
        total = self.parts[0]._height(x, y)
        for part in self.parts[1:]:
            total = total + part._height(x, y)
        return total

    def to_dict(self) -> dict[str, Any]:
        """Kind of the ground and descriptions of its parts."""
        return {"kind": "Sum", "parts": [part.to_dict() for part in self.parts]}


def rotate_axes(x: Floats, y: Floats, direction: float) -> tuple[Floats, Floats]:
    """Coordinates along a direction and to its left [m].

    Parameters
    ----------
    x, y : ndarray
        Easting and northing [m].
    direction : float
        Counter-clockwise from east [rad].
    """
    if direction == 0.0:
        return x, y
    c, s = np.cos(direction), np.sin(direction)
    return c * x + s * y, c * y - s * x


def check_finite(ground: object, *names: str) -> None:
    """Raise ValueError unless the named fields are finite."""
    for name in names:
        value = getattr(ground, name)
        if not np.isfinite(value):
            raise ValueError(f"{name} must be finite, got {value}.")


def check_positive(ground: object, *names: str) -> None:
    """Raise ValueError unless the named fields are finite and greater than 0."""
    for name in names:
        value = getattr(ground, name)
        if not (np.isfinite(value) and value > 0):
            raise ValueError(f"{name} must be greater than 0, got {value}.")


def check_not_negative(ground: object, *names: str) -> None:
    """Raise ValueError unless the named fields are finite and at least 0."""
    for name in names:
        value = getattr(ground, name)
        if not (np.isfinite(value) and value >= 0):
            raise ValueError(f"{name} must be at least 0, got {value}.")


def check_fraction(ground: object, *names: str) -> None:
    """Raise ValueError unless the named fields are from 0 to 1."""
    for name in names:
        value = getattr(ground, name)
        if not 0 <= value <= 1:
            raise ValueError(f"{name} must be from 0 to 1, got {value}.")


def check_seed(seed: int) -> None:
    """Raise ValueError unless the seed is a whole number that fits 63 bits."""
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer):
        raise ValueError(f"seed must be a whole number, got {seed!r}.")  # noqa: TRY004 - one rule
    if not 0 <= seed < _SEED_LIMIT:
        raise ValueError(f"seed must be at least 0 and less than 2**63, got {seed}.")


def _ground_parts(ground: Ground) -> tuple[Ground, ...]:
    return ground.parts if isinstance(ground, Sum) else (ground,)
