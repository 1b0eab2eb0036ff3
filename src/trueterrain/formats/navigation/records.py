"""Binary files of equal records of doubles without a header, SBET and SMRMSG; checks of times."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from trueterrain.core.errors import FormatError
from trueterrain.core.schemas.navigation import TimeChecker
from trueterrain.formats.signature import open_regular

Floats = npt.NDArray[np.float64]

#: Length of the GPS week [s].
WEEK = 604_800.0

BLOCK = 1 << 16  # records


def file_records(
    path: Path, fields: int, name: str, size: int = BLOCK
) -> Iterator[tuple[int, Floats]]:
    """Read the records of a file block by block.

    The file is read, not mapped into memory: a mapped file that is truncated meanwhile would end
    the process with a bus error instead of an exception.

    Yields
    ------
    first : int
        Index of the first record of the block.
    values : numpy.ndarray, shape (field, record)
        Values of the fields.
    """
    if size < 1:
        message = f"size must be at least 1 record, got {size}."
        raise ValueError(message)
    record = 8 * fields
    with open_regular(path) as stream:
        length = stream.seek(0, os.SEEK_END)
        if length == 0:
            raise FormatError("is empty", path=path, cure="Copy or export it again.")
        if length % record:
            raise FormatError(
                f"has {length} bytes, which is no multiple of the {record} bytes of a {name} "
                "record",
                path=path,
                place=f"record {length // record + 1}",
                cure=f"The file was cut off, or is no {name} file; copy or export it again.",
            )
        stream.seek(0)
        for first in range(0, length // record, size):
            count = min(size, length // record - first)
            content = stream.read(count * record)
            if len(content) < count * record:
                raise FormatError(
                    f"had {length} bytes when reading began, and was cut since",
                    path=path,
                    place=f"record {first + len(content) // record + 1}",
                    cure="Read it when it is whole.",
                )
            yield (
                first,
                np.array(np.frombuffer(content, dtype="<f8").reshape(-1, fields).T, order="C"),
            )


class WeekUnwrapper:
    """Seconds of the GPS week made continuous: after a rollover they count on beyond the week."""

    def __init__(self, path: Path) -> None:
        self._clock = TimeChecker(path=path, place="time")
        self._last: float | None = None
        self._weeks = 0
        self.rollovers: list[int] = []  # records at which a week began

    def continued(self, time: Floats) -> Floats:
        """Continuous times of the next block [s]; raises a SchemaError if they do not ascend."""
        last = time[:1] if self._last is None else np.array([self._last])
        steps = np.diff(time, prepend=last)
        # a step back by more than half a week is a rollover, a smaller one an error of the file
        rollovers = np.flatnonzero(steps < -WEEK / 2)
        self.rollovers += [self._clock.count + int(index) for index in rollovers]
        weeks = self._weeks + np.cumsum(steps < -WEEK / 2)
        continuous: Floats = time + WEEK * weeks
        self._clock.check(continuous)
        self._last, self._weeks = float(time[-1]), int(weeks[-1])
        return continuous


def refuse_value(
    path: Path, name: str, rule: str, values: Floats, bad: Any, first: int, cure: str
) -> None:
    """Raise a FormatError for the first value that breaks a rule."""
    if bad.any():
        index = int(np.flatnonzero(bad)[0])
        raise FormatError(
            f"{rule}, got {values[index]:g}",
            path=path,
            place=f"record {first + index + 1}, {name}",
            cure=cure,
        )


def describe_intervals(time: Floats) -> dict[str, Any]:
    """Rate, jitter and gaps of ascending times."""
    intervals = IntervalStatistics()
    intervals.add(time)
    return intervals.to_dict()


class IntervalStatistics:
    """Median interval between times, its jitter, and gaps, in one pass and flat memory.

    The median is that of the first block. Jitter is the rms deviation of the intervals that are no
    gaps from the median.
    """

    _LISTED = 16  # gaps that are listed individually
    _SAMPLE = 1_000_000  # intervals of which the median is taken
    _GAP = 1.5  # intervals longer than this multiple of the median are gaps

    def __init__(self) -> None:
        self.count = 0
        self.start = self.end = np.nan
        self.gaps: list[dict[str, float]] = []
        self.gap_count = 0
        self.max_gap = 0.0
        self.falls = 0
        self.median = np.nan
        self._squares = 0.0
        self._regular = 0

    def add(self, time: Floats) -> None:
        """Add the times of the next block [s]."""
        if time.size == 0:
            return
        if self.count == 0:
            self.start = float(time[0])
        before = time[:0] if self.count == 0 else np.array([self.end])
        steps = np.diff(np.concatenate([before, time]))
        if np.isnan(self.median) and steps.size:
            self.median = float(np.median(steps[: self._SAMPLE]))
        self.falls += int(np.count_nonzero(steps <= 0))
        self._find_gaps(steps, np.concatenate([before, time]))
        self.count += time.size
        self.end = float(time[-1])

    def _find_gaps(self, steps: Floats, time: Floats) -> None:
        is_gap = steps > self._GAP * self.median
        regular = steps[~is_gap & (steps > 0)]
        self._squares += float(np.sum((regular - self.median) ** 2))
        self._regular += regular.size
        for at in np.flatnonzero(is_gap):
            self.gap_count += 1
            self.max_gap = max(self.max_gap, float(steps[at]))
            if len(self.gaps) < self._LISTED:
                self.gaps.append({"start": float(time[at]), "length": float(steps[at])})

    def to_dict(self) -> dict[str, Any]:
        """Count, time [s], rate [1/s], jitter [s] and gaps [s], in plain types."""
        known = self.count > 1 and self.median > 0
        jitter = float(np.sqrt(self._squares / self._regular)) if self._regular else None
        return {
            "count": self.count,
            "time": [self.start, self.end] if self.count else None,
            "rate": 1 / self.median if known else None,
            "jitter": jitter,
            "gap_count": self.gap_count,
            "max_gap": self.max_gap if self.gap_count else None,
            "gaps": self.gaps,
        }

    def problems(self, name: str) -> list[str]:
        """Messages about gaps and about times that do not ascend."""
        found = []
        if self.gap_count:
            first = self.gaps[0]
            found.append(
                f"{name}: {self.gap_count} gap{'s' if self.gap_count > 1 else ''} in time, the "
                f"longest {self.max_gap:.6g} s, the first of {first['length']:.6g} s at "
                f"{first['start']:.6f} s"
            )
        if self.falls:
            found.append(f"{name}: time does not run forward at {self.falls} places")
        return found
