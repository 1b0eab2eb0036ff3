"""Verify a written file with two independent readers.

This package reads every number back and compares it with the surface. The ASAM C-API loads the file
as well and evaluates it: all nodes of the reference line, and the centre of every cell or, if there
are more, of 200,000 cells spaced over the file. Since the C-API holds a file twice in memory, it
gets a copy of a file beyond 64 MB with all cross-sections but only some of the long sections. In
general these have unequal spacing; there are at most half as many as the steps of the table by
which the C-API finds them, since it overlooks sections within one step.
"""

import math
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pycrg
import xarray as xr

from trueterrain.core.errors import OutputError
from trueterrain.core.row_blocks import height_blocks
from trueterrain.formats.opencrg import _rules
from trueterrain.formats.opencrg._header import CrgHeader, read_header, station_count
from trueterrain.formats.opencrg._offsets import section_offsets
from trueterrain.formats.opencrg._payload import CrgPayload
from trueterrain.formats.opencrg._stream import FlatRoad, copy_sections, number_type

Floats = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

_SAME = 1e-9  # [m] tolerance of u and v
_SAME_PLACE = 1e-7  # [m] tolerance of coordinates up to 1e7 m: rounding in double precision
_ROUND_OFF = 1e-9  # [m] tolerance of heights up to some km: rounding in double precision
# rounding of a number in each format: absolute, and relative to its size. Text has 9 or 19
# characters for a number, of which the sign and the point leave 7 or 17 digits to one below 1.
_ROUNDING = {"KRBI": (0, 1.2e-7), "KDBI": (0, 1e-15), "LRFI": (5e-8, 1e-6), "LDFI": (0, 1e-15)}
_C_API_ROUNDING = 1.2e-7  # relative: the C-API holds heights as float32
_MAX_CELLS = 200_000  # cells to evaluate, so that checking takes less time than writing
_MAX_BYTES = 64_000_000  # of numbers for the C-API, which needs twice as much memory
_MAX_SECTIONS = (_rules.LOOKED_UP + 1) // 2  # long sections of a copy


def require_same(road: xr.Dataset, path: Path, fmt: str, flat: FlatRoad) -> None:
    """Raise unless a file holds a surface.

    Parameters
    ----------
    road : xarray.Dataset
        Surface that was written.
    path : Path
        The file.
    fmt : str
        Format of the numbers.
    flat : FlatRoad
        Reference line that was written.

    Raises
    ------
    FormatError
        If the file cannot be read.
    OutputError
        If positions, heights or the values between the nodes differ.
    """
    header = read_header(path)
    offsets = section_offsets(header)
    v = np.sort(offsets)
    _compare_positions(road, header, v, flat, path)
    numbers = CrgPayload(header, offsets)
    kept = np.arange(v.size)
    if header.is_binary and path.stat().st_size - header.data_offset > _MAX_BYTES:
        size = number_type(fmt).itemsize
        count = min(max(2, _MAX_BYTES // (size * numbers.rows)), _MAX_SECTIONS)
        kept = np.unique(np.linspace(0, v.size - 1, count).astype(int))
    cells = _CheckCells(numbers.rows, kept)
    largest = _compare_numbers(road, numbers, flat, cells, path, fmt)
    with _evaluate_file(path, header, kept, v) as crg:
        _compare_line(crg, road, flat, path)
        _compare_evaluation(crg, road, cells, path, _ROUND_OFF + 2 * _C_API_ROUNDING * largest)


def _compare_positions(
    road: xr.Dataset, header: CrgHeader, v: Floats, flat: FlatRoad, path: Path
) -> None:
    rows = station_count(header) or road.sizes["u"]
    u = header.start + header.increment * np.arange(rows)
    for axis, found in (("u", u), ("v", v)):
        if road.sizes[axis] != found.size:
            raise _difference_error(f"{found.size} of {road.sizes[axis]} nodes", axis, path)
        off = float(np.abs(road[axis].values - found).max())
        if off > _SAME:
            raise _difference_error(f"differences of {off:.3g} m", axis, path)
    moved = np.hypot(
        road["easting"].values - flat.grid.x,
        road["northing"].values - flat.grid.y,
    )
    if not moved.max() <= _rules.TOLERANCE:
        raise OutputError(
            f"nodes would move by up to {moved.max() * 1e3:.3g} mm, since the file holds rounded "
            "headings and chords of exactly equal length",
            path=path,
            place=f"reference line, node {int(np.argmax(moved))}",
            cure="Resample the reference line with chords of equal length, or write fmt='KDBI'.",
        )


def _compare_line(crg: pycrg.RoadSurface, road: xr.Dataset, flat: FlatRoad, path: Path) -> None:
    u, v = road["u"].values, road["v"].values
    ranges = np.array([crg.u_range(), crg.v_range()])
    if np.abs(ranges - [u[[0, -1]], v[[0, -1]]]).max() > _SAME:
        raise _difference_error(f"the ranges {ranges.tolist()}", "u and v", path)
    if crg.header.modifiers != {}:
        raise _difference_error(f"the modifiers {crg.header.modifiers}", "modifiers", path)
    x, y = crg.uv_to_xy_many(u, np.zeros(u.size))
    off = float(np.hypot(x - flat.grid.x, y - flat.grid.y).max())
    if not off <= _SAME_PLACE:
        raise _difference_error(f"nodes {off:.3g} m elsewhere", "reference line", path)


class _CheckCells:
    """Cells all over the road, and the heights in the middle of them that the file should give."""

    def __init__(self, rows: int, kept: Index) -> None:
        self.kept = kept  # long sections that bound the cells
        self._columns = kept.size - 1
        self._step = _sampling_step((rows - 1) * self._columns, self._columns)
        self._found: list[tuple[Index, Index, Floats]] = []

    def add(self, rows: slice, height: Floats) -> None:
        """Take up the cells before each cross-section of a block; `height` has one row more."""
        first = -(-max(rows.start - 1, 0) * self._columns // self._step) * self._step
        chosen = np.arange(first, (rows.stop - 1) * self._columns, self._step)
        i, j = np.divmod(chosen, self._columns)
        k, right, left = i - (rows.start - 1), self.kept[j], self.kept[j + 1]
        corners = height[k, right] + height[k + 1, right] + height[k, left] + height[k + 1, left]
        self._found.append((i, j, corners / 4))

    def all(self) -> tuple[Index, Index, Floats]:
        """Number of each cell along and across, and its height [m]."""
        i, j, height = zip(*self._found, strict=True)
        return np.concatenate(i), np.concatenate(j), np.concatenate(height)


def _sampling_step(cells: int, columns: int) -> int:
    """Step between evaluated cells, coprime with the columns, so that all columns are covered."""
    step = -(-cells // _MAX_CELLS)
    while math.gcd(step, columns) > 1:
        step += 1
    return step


def _compare_numbers(
    road: xr.Dataset, numbers: CrgPayload, flat: FlatRoad, cells: _CheckCells, path: Path, fmt: str
) -> float:
    """Compare every number of the file; return the largest absolute height in it [m]."""
    if numbers.shape != road["height"].shape:
        raise _difference_error(f"{numbers.shape} heights", "height", path)
    v = road["v"].values
    difference = largest = 0.0
    height = np.full((1, v.size), np.nan)
    for rows, should in height_blocks(road):
        line, grid = numbers[rows]
        if not np.array_equal(line, flat.channels[rows], equal_nan=True):
            raise _difference_error("other headings, slopes or bankings", "reference line", path)
        # the last cross-section of the previous block comes first, for the cells between both
        height = np.concatenate([height[-1:], grid])
        height[1:] += flat.heights(v, rows)
        difference = max(difference, _max_difference(height[1:], should, path))
        largest = max(largest, np.fmax.reduce(grid, axis=None), -np.fmin.reduce(grid, axis=None))
        cells.add(rows, height)
    step, rounding = _ROUNDING[fmt]
    if difference > _ROUND_OFF + step + rounding * largest:
        raise _difference_error(f"differences of {difference:.3g} m", "height", path)
    return largest


def _compare_evaluation(
    crg: pycrg.RoadSurface, road: xr.Dataset, cells: _CheckCells, path: Path, tolerance: float
) -> None:
    i, j, should = cells.all()
    u, v = road["u"].values, road["v"].values[cells.kept]
    found = crg.uv_to_z_many((u[i] + u[i + 1]) / 2, (v[j] + v[j + 1]) / 2)
    differ = np.isnan(should) != np.isnan(found)
    differ |= np.abs(should - found) > tolerance
    if differ.any():
        at = int(np.flatnonzero(differ)[0])
        raise _difference_error(
            f"{found[at]:.9g} m, not {should[at]:.9g} m",
            f"cell ({i[at]}, {cells.kept[j[at]]})",
            path,
        )


def _max_difference(found: Floats, should: Floats, path: Path) -> float:
    """Largest difference of heights [m]; raises unless the same nodes are missing."""
    off = np.abs(found - should)
    difference = float(off.max())
    if math.isnan(difference):
        if (np.isnan(found) != np.isnan(should)).any():
            raise _difference_error(
                "heights where there should be none, or none where they should be", "height", path
            )
        difference = float(np.nanmax(off))
    return difference


@contextmanager
def _evaluate_file(
    path: Path, header: CrgHeader, kept: Index, v: Floats
) -> Iterator[pycrg.RoadSurface]:
    """Open the file in the C-API, or a copy with some of its long sections."""
    if kept.size == v.size:
        with pycrg.RoadSurface.open(path, apply_modifiers=False) as crg:
            yield crg
        return
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=".") as folder:
        part = Path(folder) / "part.crg"
        copy_sections(header, part, kept, v)
        with pycrg.RoadSurface.open(part, apply_modifiers=False) as crg:
            yield crg


def _difference_error(found: str, place: str, path: Path) -> OutputError:
    return OutputError(
        f"the file differs from the surface when it is read back: {found}",
        path=path,
        place=place,
        cure="Nothing is left of the file; please report this.",
    )
