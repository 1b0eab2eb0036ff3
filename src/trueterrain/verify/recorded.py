"""Recording times from the time stamps of runs, and their contradictions to a stated date.

GPS time counts seconds of the week from the midnight before Sunday, or seconds since 6 January
1980. The former give the day of the week and the time of day, the latter the date. Neither has leap
seconds; UTC has been 18 s behind GPS time since 2017.
"""

import datetime as dt
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from trueterrain.formats.run import open_run

_EPOCH = dt.datetime(1980, 1, 6)  # of GPS, a Sunday; without zone, as GPS time has none
_WEEK = 604_800.0  # [s]
_ROLLED = 2 * _WEEK  # [s] bound of seconds of the week, which may continue past its end
_SINCE_1980 = 1e9  # [s] 2011-09-14; smaller values may count from any other epoch
# leap seconds from these GPS seconds on, for times after `_SINCE_1980`; no further one is announced
_LEAPS = {1_025_136_016.0: 16, 1_119_744_017.0: 17, 1_167_264_018.0: 18}
_FIRST_LEAPS = 15
_DAYS = ["Monday", "Tuesday", "Wednesday", "Thursday", "Friday", "Saturday", "Sunday"]
_MAX_DIFFERENCE = 1  # [d] of a stated date: time zones, and tests around midnight


@dataclass(frozen=True, kw_only=True)
class RecordingTime:
    """Recording time of a file."""

    name: str
    "Name of the file."

    begin: str | None
    "Date and time, or day of the week and time, of its first epoch; None if not in the data."

    end: str | None
    "The same for its last epoch."

    scale: str
    "Time scale: UTC, GPS time of the week, or why the data do not state it."

    seconds: tuple[float, float] | None = None
    "GPS seconds of begin and end, since 1980 or of the week [s]."

    def to_dict(self) -> dict[str, Any]:
        """Numbers and strings, ready for JSON."""
        return {
            "name": self.name,
            "begin": self.begin,
            "end": self.end,
            "scale": self.scale,
            "seconds": None if self.seconds is None else list(self.seconds),
        }


def recorded_run(path: str | Path) -> RecordingTime:
    """Recording time of a run, from its navigation.

    Parameters
    ----------
    path : str or Path
        Run, NAME.zarr.

    Returns
    -------
    RecordingTime
        Times of the first and the last epoch of its navigation.

    Raises
    ------
    FormatError
        If it is not a run.
    """
    path = Path(path)
    tree = open_run(path)
    ends = tree["navigation"].to_dataset()["time"].isel(epoch=[0, -1]).values
    attrs = {str(name): value for name, value in tree.attrs.items()}
    return recording_time(path.name, attrs, (float(ends[0]), float(ends[1])))


def recording_time(
    name: str, attrs: Mapping[str, Any], seconds: tuple[float, float] | None = None
) -> RecordingTime:
    """Recording time of data, by the time reference in their attributes.

    Parameters
    ----------
    name : str
        Name of the file.
    attrs : mapping
        Its attributes, with ``time_reference`` if it has times.
    seconds : tuple of float, optional
        First and last time [s].

    Returns
    -------
    RecordingTime
        In UTC if the date is known.

    Examples
    --------
    >>> gps = {"time_reference": "gps"}
    >>> recording_time("a.zarr", gps, (1_457_338_518.0, 1_457_338_538.0)).begin
    '2026-03-12 08:15:00'
    >>> recording_time("a.zarr", gps, (375_318.0, 375_338.0)).begin
    'Thursday 08:15:18'
    >>> recording_time("a.zarr", {"time_reference": "run"}, (0.0, 20.0)).scale
    'not in the data: times count from any moment'
    """

    def unknown(why: str) -> RecordingTime:
        return RecordingTime(name=name, begin=None, end=None, scale=f"not in the data: {why}")

    if seconds is None:
        return unknown("profiles hold no times")
    if attrs.get("time_reference") != "gps":
        return unknown("times count from any moment")
    if seconds[0] >= 0 and seconds[1] < _ROLLED:
        moments = [_EPOCH + dt.timedelta(seconds=one) for one in seconds]
        begin, end = (f"{_DAYS[one.weekday()]} {one:%H:%M:%S}" for one in moments)
        scale = "GPS time; the week is not in the data"
    elif seconds[0] >= _SINCE_1980:
        begin, end = (f"{_gps_to_utc(one):%Y-%m-%d %H:%M:%S}" for one in seconds)
        scale = "UTC"
    else:
        return unknown("times are seconds neither of the GPS week nor since 1980")
    return RecordingTime(name=name, begin=begin, end=end, scale=scale, seconds=seconds)


def date_contradictions(stated: str, found: tuple[RecordingTime, ...]) -> list[str]:
    """Contradictions between the stated date and the recording times.

    Parameters
    ----------
    stated : str
        Date; checked only if it is written as 2026-03-12.
    found : tuple of RecordingTime
        Recording times of the files.

    Returns
    -------
    list of str
        A sentence for each file that differs by more than a day.

    Examples
    --------
    >>> run = recording_time("a.zarr", {"time_reference": "gps"}, (375_318.0, 375_338.0))
    >>> date_contradictions("2026-03-12", (run,))
    []
    >>> len(date_contradictions("2026-03-15", (run,)))
    1
    """
    try:
        day = dt.date.fromisoformat(stated.strip()[:10])
    except ValueError:
        return []
    return [
        f"{one.name} was recorded on {one.begin} ({one.scale}), {apart} days from the stated date, "
        f"{day}. Correct the date, or name the right run."
        for one in found
        if one.seconds is not None and (apart := _days_apart(day, one.seconds)) > _MAX_DIFFERENCE
    ]


def _days_apart(day: dt.date, seconds: tuple[float, float]) -> int:
    """Days between a date and the recording; without a date, in the week nearest to it."""
    if seconds[0] >= _SINCE_1980:
        first, last = (_gps_to_utc(one).date() for one in seconds)
        return max(0, (first - day).days, (day - last).days)
    first, last = ((_EPOCH + dt.timedelta(seconds=one)).date() for one in seconds)
    length = (last - first).days
    after = (day - first).days % 7  # days of the stated date after the begin
    return 0 if after <= length else min(after - length, 7 - after)


def _gps_to_utc(seconds: float) -> dt.datetime:
    leap_seconds = [leaps for since, leaps in _LEAPS.items() if seconds >= since]
    return _EPOCH + dt.timedelta(seconds=seconds - max([_FIRST_LEAPS, *leap_seconds]))
