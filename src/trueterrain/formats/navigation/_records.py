"""Files that are nothing but records of doubles: SBET and SMRMSG."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from trueterrain.core.errors import FormatError
from trueterrain.formats.navigation._schema import TimeChecker
from trueterrain.formats.signature import open_regular

Floats = npt.NDArray[np.float64]

#: Length of the week that Applanix and GPS count seconds in [s].
WEEK = 604_800.0

BLOCK = 1 << 16  # records


def file_records(
    path: Path, fields: int, name: str, size: int = BLOCK
) -> Iterator[tuple[int, Floats]]:
    """Number of the first record and the fields (field, record) of block after block of a file.

    They are read, never mapped into memory: a file that is cut meanwhile is an error, and does not
    end the process.
    """
    if size < 1:
        message = f"size must be at least 1 record, got {size}."
        raise ValueError(message)
    record = 8 * fields
    with open_regular(path) as stream:
        held = stream.seek(0, os.SEEK_END)
        if held == 0:
            raise FormatError("is empty", path=path, cure="Copy or export it again.")
        if held % record:
            raise FormatError(
                f"has {held} bytes, which is no multiple of the {record} bytes of a {name} record",
                path=path,
                place=f"record {held // record + 1}",
                cure=f"The file was cut off, or is no {name} file; copy or export it again.",
            )
        stream.seek(0)
        for first in range(0, held // record, size):
            wanted = min(size, held // record - first)
            content = stream.read(wanted * record)
            if len(content) < wanted * record:
                raise FormatError(
                    f"had {held} bytes when reading began, and was cut since",
                    path=path,
                    place=f"record {first + len(content) // record + 1}",
                    cure="Read it when it is whole.",
                )
            yield (
                first,
                np.array(np.frombuffer(content, dtype="<f8").reshape(-1, fields).T, order="C"),
            )


class WeekUnwrapper:
    """Seconds of the week made continuous: after a rollover, they count on beyond the week."""

    def __init__(self, path: Path) -> None:
        self._clock = TimeChecker(path=path, place="time")
        self._last: float | None = None
        self._weeks = 0
        self.rollovers: list[int] = []  # records at which a week began

    def continued(self, time: Floats) -> Floats:
        """Times of the next block [s]; raises if they do not run forward."""
        last = time[:1] if self._last is None else np.array([self._last])
        steps = np.diff(time, prepend=last)
        falls = np.flatnonzero(steps < -WEEK / 2)
        self.rollovers += [self._clock.count + int(fall) for fall in falls]
        weeks = self._weeks + np.cumsum(steps < -WEEK / 2)
        continuous: Floats = time + WEEK * weeks
        self._clock.check(continuous)
        self._last, self._weeks = float(time[-1]), int(weeks[-1])
        return continuous


def refuse_value(
    path: Path, name: str, rule: str, values: Floats, bad: Any, first: int, cure: str
) -> None:
    """Raise a FormatError for the first value that is bad."""
    if bad.any():
        index = int(np.flatnonzero(bad)[0])
        raise FormatError(
            f"{rule}, got {values[index]:g}",
            path=path,
            place=f"record {first + index + 1}, {name}",
            cure=cure,
        )


def describe_intervals(time: Floats) -> dict[str, Any]:
    """Rate, jitter and gaps of times that run forward, for descriptions."""
    tally = IntervalStatistics()
    tally.add(time)
    return tally.to_dict()


class IntervalStatistics:
    """Median interval, its jitter, and gaps, found in one pass with flat memory."""

    _LISTED = 16  # gaps that are told one by one
    _SAMPLE = 1_000_000  # intervals that the median is taken from
    _GAP = 1.5  # intervals longer than so many medians are gaps

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
        """Count the times of the next block."""
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
        """Count, time [s], rate [1/s], jitter [s] and gaps [s], as JSON takes them."""
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
        """Gaps and times that do not run forward, in words."""
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
