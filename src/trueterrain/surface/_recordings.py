"""Stored scans of recorded runs, read in the background while earlier ones are gridded."""

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import CoverageError
from trueterrain.formats.run import StoredArray, open_run
from trueterrain.georeference import ScanGeometry, mounting_of
from trueterrain.surface.pass_record import PassRecord

Index = npt.NDArray[np.intp]

_REACH = 10.0  # [m] range that few returns exceed, if the type of the ranges gives no limit
_PREFETCHED = 2  # blocks that are read in advance


def origin_of(tree: xr.DataTree) -> tuple[float, ...]:
    """Longitude [deg], latitude [deg] and height [m] of the origin of a run's local frame."""
    return tuple(float(part) for part in tree.attrs["origin"])


class Recording:
    """Scans of a pass; only their time stamps are kept in memory.

    Parameters
    ----------
    record : PassRecord
        The run and its motion.
    with_intensity : bool
        Whether intensities are read, if they were recorded.
    """

    def __init__(self, record: PassRecord, *, with_intensity: bool) -> None:
        tree = open_run(record.path)
        mounting = record.mounting or mounting_of(tree, path=record.path)
        scans = tree["scans"]
        self.path = record.path
        self.origin = origin_of(tree)
        self._arrays: dict[str, StoredArray] = {}
        self.time = self._read("time", slice(None))
        self.geometry = ScanGeometry(record.trajectory, mounting, scans["angle"], scans["delay"])
        if not self.geometry.covers(self.time).any():
            knots = record.trajectory.time
            raise CoverageError(
                f"the motion, {knots[0]:.3f} s to {knots[-1]:.3f} s, covers none of the "
                f"{self.time.size} scans",
                path=record.path,
                place="scans",
                cure="Compare the clocks of scanner and navigation: `trueterrain info`.",
            )
        self._names = ["range"]
        if with_intensity and "intensity" in scans:
            self._names.append("intensity")
        ranges = self._array("range")
        self.scale = float(ranges.attrs.get("scale_factor", 1.0))
        self.missing = ranges.attrs.get("_FillValue")
        whole = ranges.dtype.kind in "iu"
        self.furthest = float(np.iinfo(ranges.dtype).max) * self.scale if whole else _REACH

    def read(self, index: Index) -> tuple[Any, Any]:
        """Stored ranges and intensities of scans that are close together."""
        first = int(index[0])
        rows = slice(first, int(index[-1]) + 1)
        found = [self._read(name, rows) for name in self._names]
        if index.size < rows.stop - first:
            found = [values[index - first] for values in found]
        ranges, intensity = (*found, None)[:2]
        return ranges, intensity

    def blocks(self, index: Index | None, size: int) -> Iterator[Index]:
        """Numbers of the given scans, or of all, split at every `size` scans of the store."""
        index = np.arange(self.time.size) if index is None else index
        ends = np.searchsorted(index, np.arange(size, self.time.size, size))
        yield from (some for some in np.split(index, ends) if some.size)

    def _read(self, name: str, rows: slice) -> npt.NDArray[Any]:
        """Stored numbers: decoding them to metres would take longer than gridding."""
        return self._array(name).read(rows)

    def _array(self, name: str) -> StoredArray:
        if name not in self._arrays:
            self._arrays[name] = StoredArray(Path(self.path), f"scans/{name}")
        return self._arrays[name]


def read_ahead(
    recordings: Sequence[Recording], wanted: Iterable[tuple[int, Index]]
) -> Iterator[tuple[int, Index, Any, Any]]:
    """Blocks of scans in order; the next ones are read in the background.

    Parameters
    ----------
    recordings : sequence of Recording
        The scans.
    wanted : iterable of tuple
        Number of a recording, and of some of its scans.

    Yields
    ------
    tuple
        The same, ranges and intensities.
    """
    waiting: deque[tuple[int, Index, Future[tuple[Any, Any]]]] = deque()

    def first() -> tuple[int, Index, Any, Any]:
        number, index, read = waiting.popleft()
        return number, index, *read.result()

    with ThreadPoolExecutor(1) as pool:
        for number, index in wanted:
            waiting.append((number, index, pool.submit(recordings[number].read, index)))
            if len(waiting) > _PREFETCHED:
                yield first()
        while waiting:
            yield first()
