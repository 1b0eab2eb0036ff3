"""Selection and counts of points by class and return number.

Airborne and mobile clouds hold roofs, trees, wires and noise besides the ground. A height statistic
of all points is not a height of the ground, so every reader of points accepts a `PointFilter`.

Source: ASPRS LAS 1.4 R15, table 17 (standard classes).
"""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from trueterrain.core.errors import FormatError

if TYPE_CHECKING:
    import xarray as xr

#: Names of the standard classes.
CLASS_NAMES = {
    0: "never classified",
    1: "unassigned",
    2: "ground",
    3: "low vegetation",
    4: "medium vegetation",
    5: "high vegetation",
    6: "building",
    7: "low noise",
    8: "model key point",
    9: "water",
    10: "rail",
    11: "road surface",
    12: "overlap",
    13: "wire guard",
    14: "wire conductor",
    15: "transmission tower",
    16: "wire connector",
    17: "bridge deck",
    18: "high noise",
    19: "overhead structure",
    20: "ignored ground",
    21: "snow",
    22: "temporal exclusion",
}

#: Classes of objects on or above the ground, and of noise.
ABOVE_GROUND = (3, 4, 5, 6, 7, 13, 14, 15, 16, 18, 19)

#: Classes of surfaces that vehicles drive on.
GROUND = (2, 11, 17)

_CLASSES = 256  # values of one byte
_RETURNS = 16  # values of four bits


@dataclass(frozen=True, kw_only=True)
class PointFilter:
    """Selection of points of a cloud by class and return number."""

    classes: tuple[int, ...] = ()
    "Classes to take, e.g. 2 (ground) and 11 (road surface); by default all."

    returns: Literal["first", "last"] | int | None = None
    "Return of each pulse to take: first, last, or its number from 1 on; by default all."

    def __post_init__(self) -> None:
        """Check the values."""
        bad = [one for one in self.classes if not 0 <= one < _CLASSES]
        if bad:
            message = f"classes must be whole numbers from 0 to {_CLASSES - 1}, got {bad[0]}."
            raise ValueError(message)
        number = isinstance(self.returns, int) and 1 <= self.returns < _RETURNS
        if self.returns is not None and not number and self.returns not in ("first", "last"):
            message = (
                f"returns must be first, last or a number from 1 to {_RETURNS - 1}, got "
                f"{self.returns!r}."
            )
            raise ValueError(message)

    @property
    def variables(self) -> tuple[str, ...]:
        """Names of the variables of points that the filter needs."""
        needed = {
            "classification": bool(self.classes),
            "return_number": self.returns is not None,
            "number_of_returns": self.returns == "last",
        }
        return tuple(name for name, is_needed in needed.items() if is_needed)

    def require(self, known: "Collection[str] | xr.Dataset") -> None:
        """Raise if points lack a variable that the filter needs.

        Parameters
        ----------
        known : xarray.Dataset or collection of str
            Points, or the names of their variables.

        Raises
        ------
        FormatError
            Naming the variable.
        """
        for name in self.variables:
            if name not in known:
                raise FormatError(
                    "is missing, so that points cannot be chosen by it",
                    place=f"variable {name}",
                    cure="Take all points, or classify them first (--class, --return).",
                )

    def apply(self, points: "xr.Dataset") -> "xr.Dataset":
        """Take the points that pass the filter.

        Parameters
        ----------
        points : xarray.Dataset
            Points, or a block of them.

        Returns
        -------
        xarray.Dataset
            Points that pass; `points` itself if all do.

        Raises
        ------
        FormatError
            If they lack a variable that the filter needs.

        Examples
        --------
        >>> from trueterrain.core.schemas import make_points
        >>> points = make_points([0.0, 1.0], [0.0] * 2, [5.0, 9.0], classification=[2, 6])
        >>> PointFilter(classes=(2, 11)).apply(points).up.values
        array([5.])
        """
        self.require(points)
        taken = np.ones(points.sizes["point"], np.bool_)
        if self.classes:
            taken &= np.isin(points["classification"].values, self.classes)
        if self.returns is not None:
            number = points["return_number"].values
            if self.returns == "last":
                taken &= number >= points["number_of_returns"].values
            elif self.returns == "first":
                taken &= number <= 1  # 0 where it is not set
            else:
                taken &= number == self.returns
        return points if taken.all() else points.isel(point=np.flatnonzero(taken))

    def __str__(self) -> str:
        texts = []
        if self.classes:
            texts.append(f"class {', '.join(map(str, self.classes))}")
        if self.returns is not None:
            texts.append(f"return {self.returns}")
        return " and ".join(texts) or "all"


class ReturnCounts:
    """Counts of points by class and by return number, accumulated block by block in flat memory."""

    def __init__(self) -> None:
        self._counts: dict[str, dict[str, int]] = {"returns": {}, "classes": {}}

    def add(self, columns: "Mapping[Any, Any]") -> None:
        """Count points.

        Parameters
        ----------
        columns : mapping of str to array_like
            Columns, or points; without classes and return numbers nothing is counted.
        """
        for key, name in (("returns", "return_number"), ("classes", "classification")):
            if name in columns:
                for value, number in _count_values(np.asarray(columns[name])):
                    label = f"{value:g}"
                    self._counts[key][label] = self._counts[key].get(label, 0) + number

    def merge(self, other: "ReturnCounts") -> None:
        """Add the counts of another block.

        Parameters
        ----------
        other : ReturnCounts
            Counts of other points.
        """
        for key, found in other._counts.items():
            for label, number in found.items():
                self._counts[key][label] = self._counts[key].get(label, 0) + number

    @property
    def classes(self) -> dict[str, int]:
        """Points by class."""
        return self._counts["classes"]

    def counts(self) -> dict[str, dict[str, int]]:
        """Numbers of points by ``returns`` and ``classes``, sorted; without empty tables.

        Returns
        -------
        dict
            Plain types that JSON can hold.
        """
        return {
            key: dict(sorted(found.items(), key=lambda one: float(one[0])))
            for key, found in self._counts.items()
            if found
        }


def classes_needed(only: PointFilter | None) -> tuple[str, ...]:
    """Variables of points that `flag_of_classes` needs: none if classes were selected.

    Parameters
    ----------
    only : PointFilter, optional
        Selection of the points.

    Returns
    -------
    tuple of str
        ``classification``, or nothing.
    """
    return () if only is not None and only.classes else ("classification",)


def flag_of_classes(classes: Mapping[str, int]) -> str:
    """Warning about points that by their class are not ground, in words.

    Parameters
    ----------
    classes : mapping of str to int
        Points by class, as `ReturnCounts` counts them.

    Returns
    -------
    str
        One line that names the option to use; empty if all points may be ground.

    Examples
    --------
    >>> flag_of_classes({"2": 900, "6": 100})
    '100 points are no ground by their class: building (6) 100; take the ground alone: --class 2'
    """
    found = {int(float(name)): number for name, number in classes.items()}
    above = {one: number for one, number in found.items() if one in ABOVE_GROUND}
    if not above:
        return ""
    named = ", ".join(
        f"{CLASS_NAMES[one]} ({one}) {number:,}"
        for one, number in sorted(above.items(), key=lambda item: -item[1])
    )
    ground = ",".join(str(one) for one in GROUND if one in found) or "2"
    return (
        f"{sum(above.values()):,} points are no ground by their class: {named}; take the ground "
        f"alone: --class {ground}"
    )


def _count_values(values: Any) -> Iterator[tuple[float, int]]:
    """Each value, and how often it occurs."""
    if values.dtype == np.uint8:  # the type in LAS files: bincount needs no sorting
        numbers = np.bincount(values)
        found = np.flatnonzero(numbers)
        yield from zip(found.tolist(), numbers[found].tolist(), strict=True)
        return
    values = values[np.isfinite(values)]
    yield from zip(*(one.tolist() for one in np.unique(values, return_counts=True)), strict=True)
