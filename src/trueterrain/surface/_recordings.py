"""Stored scans of recorded runs, read in the background while earlier ones are gridded."""

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import numpy as np
import numpy.typing as npt

from trueterrain.core.errors import CoverageError
from trueterrain.georeference import ScanGeometry
from trueterrain.surface.pass_record import PassRecord

Index = npt.NDArray[np.intp]

_REACH = 10.0  # [m] range that few returns exceed, if the type of the ranges gives no limit
_PREFETCHED = 2  # blocks that are read in advance


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
        run, scans = record.run, record.run["scans"]
        self.name = run.file_name.removesuffix(".zarr")
        self.time = run.stored["scans/time"].read()
        self.geometry = ScanGeometry(
            record.trajectory, record.mounting, scans["angle"], scans["delay"]
        )
        if not self.geometry.covers(self.time).any():
            knots = record.trajectory.time
            raise CoverageError(
                f"the motion, {knots[0]:.3f} s to {knots[-1]:.3f} s, covers none of the "
                f"{self.time.size} scans",
                path=run.source,
                place="scans",
                cure="Compare the clocks of scanner and navigation: `trueterrain info`.",
            )
        # stored integers: decoding them to metres would take longer than gridding
        ranges = run.stored["scans/range"]
        self._arrays = [ranges]
        if with_intensity and "intensity" in scans:
            self._arrays.append(run.stored["scans/intensity"])
        self.scale = float(ranges.attrs.get("scale_factor", 1.0))
        self.missing = ranges.attrs.get("_FillValue")
        whole = ranges.dtype.kind in "iu"
        self.furthest = float(np.iinfo(ranges.dtype).max) * self.scale if whole else _REACH

    def read(self, index: Index) -> tuple[Any, Any]:
        """Stored ranges and intensities of scans that are close together."""
        first = int(index[0])
        rows = slice(first, int(index[-1]) + 1)
        found = [array.read(rows) for array in self._arrays]
        if index.size < rows.stop - first:
            found = [values[index - first] for values in found]
        ranges, intensity = (*found, None)[:2]
        return ranges, intensity

    def blocks(self, index: Index | None, size: int) -> Iterator[Index]:
        """Numbers of the given scans, or of all, split at every `size` scans of the store."""
        index = np.arange(self.time.size) if index is None else index
        ends = np.searchsorted(index, np.arange(size, self.time.size, size))
        yield from (some for some in np.split(index, ends) if some.size)


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
