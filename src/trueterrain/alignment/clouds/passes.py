"""Passes in point clouds: which points of which files belong to each, read in blocks."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from trueterrain import formats
from trueterrain.alignment.clouds.inspection import (
    CELL,
    HEIGHTS,
    WEEK,
    CloudInspection,
    combine_inspections,
    inspect_file,
)
from trueterrain.core.errors import SchemaError
from trueterrain.core.progress import Progress, no_progress
from trueterrain.formats import PointFilter

_REMNANT = 0.005  # fraction of the points of a file below which a number is no pass
_PERCELL = 15.0  # target number of points of each pass in a cell
_SIZES = (0.1, 0.2, 0.25, 0.5, 1.0, 2.0)  # [m]
_MIN_AREA = 0.01  # of a pass over that of the largest, to count for the size of cells


@dataclass(frozen=True, kw_only=True, eq=False)
class CloudPass:
    """One pass in point clouds. Calling it yields its points in blocks."""

    name: str
    "Name of the pass."

    files: tuple[Path, ...]
    "Files that hold its points."

    number: int | None
    "Its ``lane`` in these files (point_source_id); None for all points."

    label: int
    "Number in ``lane`` after the correction, unique to the pass."

    numbers: tuple[int, ...]
    "All numbers (point_source_id) of its points."

    override: str | None
    "Coordinate reference system that replaces that of the files."

    only: PointFilter | None
    "Filter of the points."

    crs: str
    "Coordinate reference system; empty if it is not known."

    count: int
    "Number of points."

    area: float
    "Area of the squares of 1 m that contain points [m²]."

    extent: tuple[float, float, float, float]
    "West, south, east and north of its points [m]."

    time: tuple[float, float] | None
    "First and last time [s]; None if its points have none."

    variables: tuple[str, ...]
    "Variables that all of its points have."

    classes: Mapping[str, int]
    "Number of points by class, if they are classified and not filtered by class."

    flags: tuple[str, ...]
    "Warnings."

    @property
    def density(self) -> float:
        """Points per covered area [1/m²]."""
        return self.count / self.area

    @property
    def time_kind(self) -> str:
        """Kind of its times: ``week seconds``, ``standard``, or empty without times."""
        if self.time is None:
            return ""
        first, last = self.time
        return "week seconds" if first >= 0 and last <= WEEK else "standard"

    def __call__(self) -> Iterator[xr.Dataset]:
        """Points in blocks."""
        for _, block in blocks_of([self]):
            yield block

    def heights(self) -> Iterator[xr.Dataset]:
        """Points in blocks, coordinates and time only, which is faster."""
        for _, block in blocks_of([self], HEIGHTS):
            yield block

    def part(self, block: xr.Dataset) -> xr.Dataset:
        """Its points in a block, without those of invalid time."""
        mine = np.ones(block.sizes["point"], np.bool_)
        if self.number is not None and "lane" in block:
            mine &= block["lane"].values == self.number
        if self.time is not None:
            time = block["time"].values
            mine &= (time >= self.time[0]) & (time <= self.time[1])
        return block if mine.all() else block.isel(point=np.flatnonzero(mine))


def blocks_of(
    passes: Collection[CloudPass], variables: Collection[str] | None = None
) -> Iterator[tuple[CloudPass, xr.Dataset]]:
    """Points of several passes in blocks; each file is read once.

    Parameters
    ----------
    passes : collection of CloudPass
        The passes.
    variables : collection of str, optional
        Variables that are read; by default all.

    Yields
    ------
    CloudPass
        The pass of the block.
    xarray.Dataset
        Some of its points.
    """
    for file in dict.fromkeys(file for cloud in passes for file in cloud.files):
        mine = [cloud for cloud in passes if file in cloud.files]
        for block in formats.point_blocks(
            file, crs=mine[0].override, variables=variables, only=mine[0].only
        ):
            for cloud in mine:
                part = cloud.part(block)
                if part.sizes["point"]:
                    yield cloud, part


def find_cloud_passes(
    files: Sequence[str | Path],
    *,
    split: bool | None = None,
    crs: str | None = None,
    only: PointFilter | None = None,
    progress: Progress = no_progress,
) -> dict[str, CloudPass]:
    """Find the passes in point clouds: one for each file, or for each number of their points.

    Parameters
    ----------
    files : sequence of str or Path
        LAS, LAZ, COPC, CSV or Parquet files, or Zarr stores, of points.
    split : bool, optional
        Whether ``lane`` (point_source_id) separates passes, also across files, which may be tiles;
        by default for a single file.
    crs : str, optional
        EPSG code or WKT that replaces that of the files.
    only : PointFilter, optional
        Filter of the points; by default all.
    progress : callable, optional
        Called with a task, the amount done and the total.

    Returns
    -------
    dict of CloudPass
        By name: that of the file without its ending, or the number.

    Raises
    ------
    ValueError
        If there is no file, one is given twice, or two passes would have one name.
    SchemaError
        If files have different coordinate reference systems.
    CoverageError
        If a file holds no points.
    FormatError
        If a file is damaged, or holds no points.

    Examples
    --------
    >>> import tempfile
    >>> from trueterrain.core.schemas import make_points
    >>> points = make_points([1.0, 2.0, 3.0], [0.0] * 3, [7.0] * 3, lane=[4, 4, 9],
    ...                      time=[10.0, 10.1, 200.0])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     formats.write(points, Path(folder) / "road.laz")
    ...     passes = find_cloud_passes([Path(folder) / "road.laz"])
    >>> [(one.name, one.count, one.time) for one in passes.values()]
    [('4', 2, (10.0, 10.1)), ('9', 1, (200.0, 200.0))]
    """
    paths = [Path(file) for file in files]
    if not paths:
        message = "files must name at least one file."
        raise ValueError(message)
    for path in paths:
        if sum(other.resolve() == path.resolve() for other in paths) > 1:
            message = f"{path} is given twice; name each pass once."
            raise ValueError(message)
    split = len(paths) == 1 if split is None else split
    looks: dict[Path, dict[int, CloudInspection]] = {}
    for number, path in enumerate(paths):
        progress("look at clouds", number, len(paths))
        looks[path] = inspect_file(path, crs, only)
    progress("look at clouds", len(paths), len(paths))
    _require_one_crs({path: next(iter(found.values())).crs for path, found in looks.items()})
    if split:
        by_number: dict[int, dict[Path, CloudInspection]] = {}
        for path, found in looks.items():
            for number, look in found.items():
                by_number.setdefault(number, {})[path] = look
        without_source = _without_source(by_number)
        single = len(by_number) == 1
        found_passes = [
            _cloud_pass(
                next(iter(parts)).stem if single else str(number),
                number,
                number,
                parts,
                crs,
                only,
                without_source if number == min(by_number) else (),
            )
            for number, parts in sorted(by_number.items())
        ]
    else:
        found_passes = _one_each(looks, crs, only)
    return {cloud.name: cloud for cloud in found_passes}


def suggested_cell(passes: Mapping[str, CloudPass]) -> float:
    """Suggest a size of cells in which the sparsest pass has some 15 points.

    Parameters
    ----------
    passes : mapping of str to CloudPass
        The passes; those of negligible area are ignored.

    Returns
    -------
    float
        0.1, 0.2, 0.25, 0.5, 1 or 2 m.

    Raises
    ------
    ValueError
        If there are no passes.
    """
    if not passes:
        message = "there must be at least one pass."
        raise ValueError(message)
    min_area = _MIN_AREA * max(cloud.area for cloud in passes.values())
    target = max(
        np.sqrt(_PERCELL / cloud.density) for cloud in passes.values() if cloud.area >= min_area
    )
    return min(_SIZES, key=lambda size: abs(np.log(size / target)))


def _without_source(by_number: dict[int, dict[Path, CloudInspection]]) -> list[str]:
    """Remove number 0 if it is no pass; returns warnings.

    In LAS files 0 means that a point has no source; synthetic points have neither source nor time.
    """
    none = by_number.get(0, {})
    others = [look for number in by_number if number for look in by_number[number].values()]
    if not none or not others or any(look.times for look in none.values()):
        return []
    if any(look.times is None for look in others):
        return []
    del by_number[0]
    count = sum(look.count for look in none.values())
    return [f"{count} points of source 0 are left out: they have no time, so they are no pass"]


def _require_one_crs(known: Mapping[Path, str]) -> None:
    (first, crs), *others = known.items()
    for path, other in others:
        if other != crs:
            raise SchemaError(
                f"has the coordinate reference system {_crs_text(other)}, but that of "
                f"{first.name} is {_crs_text(crs)}",
                path=path,
                cure="Transform all passes to one, or state it with --crs.",
            )


def _crs_text(crs: str) -> str:
    return repr(crs if len(crs) < 40 else crs[:36] + " ...") if crs else "unknown"


def _one_each(
    looks: Mapping[Path, dict[int, CloudInspection]], crs: str | None, only: PointFilter | None
) -> list[CloudPass]:
    """One pass for each file."""
    stems = [path.stem for path in looks]
    names = {
        path: path.stem if stems.count(path.stem) == 1 else f"{path.parent.name}-{path.stem}"
        for path in looks
    }
    for name in names.values():
        if list(names.values()).count(name) > 1:
            message = f"files must have names that differ, got {name} twice; rename one."
            raise ValueError(message)
    numbers = [next(iter(found)) for found in looks.values() if len(found) == 1]
    kept = len(set(numbers)) == len(looks) and 0 not in numbers
    passes = []
    for order, path in enumerate(sorted(looks, key=lambda one: names[one]), 1):
        found = looks[path]
        whole = combine_inspections(list(found.values()))
        several = [n for n, look in found.items() if look.count >= _REMNANT * whole.count]
        flags = []
        if len(several) > 1:
            sources = ", ".join(str(number) for number in sorted(several))
            flags.append(
                f"{names[path]} holds points of several passes (point_source_id {sources}), which "
                "are treated as one: use the number to separate them"
            )
        label = next(iter(found)) if kept else order
        passes.append(_cloud_pass(names[path], None, label, {path: whole}, crs, only, flags))
    return passes


def _cloud_pass(
    name: str,
    number: int | None,
    label: int,
    parts: Mapping[Path, CloudInspection],
    crs: str | None,
    only: PointFilter | None,
    flags: Sequence[str] = (),
) -> CloudPass:
    whole = combine_inspections(list(parts.values()))
    times = whole.times
    found = list(flags)
    if whole.lost:
        lost = ", ".join(sorted(whole.lost))
        found.append(f"{name}: {lost} are left out, since not all of its files have them")
    if times is not None:
        dropped = whole.untimed + (whole.zeros if whole.zeros_missing else 0)
        if dropped:
            found.append(f"{name}: {dropped} of {whole.count} points have no time and are left out")
            whole.count -= dropped
    return CloudPass(
        name=name,
        files=tuple(parts),
        number=number,
        numbers=whole.numbers,
        label=label,
        override=crs,
        only=only,
        crs=whole.crs,
        classes=whole.classes.classes,
        count=whole.count,
        area=whole.squares.sums()[0].size * CELL**2,
        extent=(*whole.low, *whole.high),
        time=times,
        variables=whole.variables,
        flags=tuple(found),
    )
