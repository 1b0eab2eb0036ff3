"""Inspection of point clouds: counts, extent and times of each number of points in a file."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain import formats
from trueterrain.alignment.observations.sparse_sums import SparseSums
from trueterrain.core.errors import CoverageError, name_file_in_errors
from trueterrain.core.schemas import COORDINATES
from trueterrain.formats import PointFilter
from trueterrain.formats.point_filter import ReturnCounts, classes_needed

WEEK = 604_800.0  # [s]

#: Variables besides coordinates: the time of a point and the number of its pass.
HEIGHTS = ("time", "lane")

CELL = 1.0  # [m] side of the squares in which points are counted


@dataclass(kw_only=True)
class CloudInspection:
    """Summary of the points of one number: counts, extent, times."""

    crs: str
    numbers: tuple[int, ...]
    variables: tuple[str, ...]
    lost: frozenset[str] = frozenset()
    "Variables that only some of the points have."
    classes: ReturnCounts = field(default_factory=ReturnCounts)
    count: int = 0
    untimed: int = 0
    zeros: int = 0
    span: tuple[float, float] = (np.inf, -np.inf)
    "First and last time that is not 0."
    low: tuple[float, float] = (np.inf, np.inf)
    high: tuple[float, float] = (-np.inf, -np.inf)
    squares: SparseSums = field(default_factory=lambda: SparseSums(1))

    def add(self, block: xr.Dataset) -> None:
        """Count points of a block."""
        x, y = block["easting"].values, block["northing"].values
        self.count += x.size
        self.classes.add(block)
        good = np.isfinite(x) & np.isfinite(y)
        if good.any():
            place = np.stack([x[good], y[good]])
            self.low = _elementwise_min(self.low, place.min(axis=1))
            self.high = _elementwise_max(self.high, place.max(axis=1))
            self.squares.add(*np.floor(place / CELL).astype(np.int64))
        if "time" in block:
            self._add_times(np.asarray(block["time"], dtype=np.float64))

    def _add_times(self, time: npt.NDArray[np.float64]) -> None:
        known = time[np.isfinite(time)]
        some = known[known != 0]
        self.untimed += time.size - known.size
        self.zeros += known.size - some.size
        if some.size:
            self.span = (min(self.span[0], float(some.min())), max(self.span[1], float(some.max())))

    @property
    def times(self) -> tuple[float, float] | None:
        """First and last time; None if the times are invalid."""
        if "time" not in self.variables or self.span[0] > self.span[1]:
            return None
        # 0 is a valid time in seconds from a start, but a missing one among GPS times
        first = min(self.span[0], 0.0) if self.zeros and not self.zeros_missing else self.span[0]
        return (first, self.span[1]) if first < self.span[1] or self.count == 1 else None

    @property
    def zeros_missing(self) -> bool:
        """Whether a time of 0 means that it is missing."""
        return self.zeros > 0 and abs(self.span[0]) > WEEK


def _elementwise_min(
    one: tuple[float, float], other: npt.NDArray[np.float64]
) -> tuple[float, float]:
    return min(one[0], float(other[0])), min(one[1], float(other[1]))


def _elementwise_max(
    one: tuple[float, float], other: npt.NDArray[np.float64]
) -> tuple[float, float]:
    return max(one[0], float(other[0])), max(one[1], float(other[1]))


def inspect_file(
    path: Path, crs: str | None, only: PointFilter | None
) -> dict[int, CloudInspection]:
    """Summary of each number in a file."""
    found: dict[int, CloudInspection] = {}
    needed = (*HEIGHTS, *classes_needed(only))
    with name_file_in_errors(path):
        known = (*COORDINATES, *formats.point_variables(path))
        for block in formats.point_blocks(path, crs=crs, variables=needed, only=only):
            cloud = block["lane"].values if "lane" in block else np.zeros(block.sizes["point"])
            for number in np.unique(cloud):
                mine = np.flatnonzero(cloud == number)
                part = block if mine.size == cloud.size else block.isel(point=mine)
                look = found.setdefault(
                    int(number),
                    CloudInspection(
                        crs=str(block.attrs.get("crs", "")),
                        numbers=(int(number),),
                        variables=known,
                    ),
                )
                look.add(part)
        if not found:
            raise CoverageError("holds no points", path=path, cure="Leave it out.")
    return found


def combine_inspections(looks: Sequence[CloudInspection]) -> CloudInspection:
    """Sum of several summaries."""
    first = looks[0]
    whole = CloudInspection(
        crs=first.crs,
        variables=first.variables,
        numbers=tuple(sorted({number for look in looks for number in look.numbers})),
    )
    for look in looks:
        some = {*whole.variables} ^ {*look.variables}
        whole.lost |= look.lost | some
        whole.variables = tuple(name for name in whole.variables if name in look.variables)
        whole.classes.merge(look.classes)
        whole.count += look.count
        whole.untimed += look.untimed
        whole.zeros += look.zeros
        whole.span = (min(whole.span[0], look.span[0]), max(whole.span[1], look.span[1]))
        whole.low = _elementwise_min(whole.low, np.array(look.low))
        whole.high = _elementwise_max(whole.high, np.array(look.high))
        column, row, _ = look.squares.sums()
        whole.squares.add(column, row)
    return whole
