"""When runs were recorded, as far as their own times tell, beside what a crew states.

GPS counts seconds of the week, from the midnight that begins Sunday, or seconds since 6 January
1980. The former tell the day of the week and the time of day, the latter the date; neither knows
leap seconds, of which UTC has had 18 since 2017.
"""

import datetime as dt
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

_EPOCH = dt.datetime(1980, 1, 6)  # of GPS, a Sunday; without zone, as GPS time has none
_WEEK = 604_800.0  # [s]
_ROLLED = 2 * _WEEK  # [s] seconds of the week that count on after it
_SINCE_1980 = 1e9  # [s] from 2011-09-14 on; what is less may be seconds since any other moment
# leap seconds from these GPS seconds on, for times that `_SINCE_1980` admits; none is announced
_LEAPS = {1_025_136_016.0: 16, 1_119_744_017.0: 17, 1_167_264_018.0: 18}
_FIRST_LEAPS = 15
_DAYS = ["Monday", "Tuesday", "Wednesday", "Thursday", "Friday", "Saturday", "Sunday"]
_APART = 1  # [d] by which a stated date may differ: zones, and tests about midnight


@dataclass(frozen=True, kw_only=True)
class RecordingTime:
    """When a file was recorded."""

    name: str
    "Name of the file."

    begin: str | None
    "Date and time of its first epoch, or day of the week and time; None if its times tell neither."

    end: str | None
    "The same of its last epoch."

    scale: str
    "What the times are: UTC, GPS time of the week, or why nothing is told."

    seconds: tuple[float, float] | None = None
    "GPS seconds of begin and end, since 1980 or of the week [s]."

    def to_dict(self) -> dict[str, Any]:
        """The same as plain numbers and words, as for JSON."""
        return {
            "name": self.name,
            "begin": self.begin,
            "end": self.end,
            "scale": self.scale,
            "seconds": None if self.seconds is None else list(self.seconds),
        }


def recorded_run(path: str | Path) -> RecordingTime:
    """When a run was recorded.

    Parameters
    ----------
    path : str or Path
        Run, NAME.zarr.

    Returns
    -------
    Recorded
        Times of the first and the last epoch of its navigation.

    Raises
    ------
    FormatError
        If it is no run.
    """
    from trueterrain.formats.run import open_run

    path = Path(path)
    tree = open_run(path)
    ends = tree["navigation"].to_dataset()["time"].isel(epoch=[0, -1]).values
    attrs = {str(name): value for name, value in tree.attrs.items()}
    return recording_time(path.name, attrs, (float(ends[0]), float(ends[1])))


def recording_time(
    name: str, attrs: Mapping[str, Any], seconds: tuple[float, float] | None = None
) -> RecordingTime:
    """When data were recorded, by what they are counted from.

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
    Recorded
        In UTC where the date is known.

    Examples
    --------
    >>> recorded("a.zarr", {"time_reference": "gps"}, (1_457_338_518.0, 1_457_338_538.0)).begin
    '2026-03-12 08:15:00'
    >>> recorded("a.zarr", {"time_reference": "gps"}, (375_318.0, 375_338.0)).begin
    'Thursday 08:15:18'
    >>> recorded("a.zarr", {"time_reference": "run"}, (0.0, 20.0)).scale
    'not in the data: times count from any moment'
    """

    def untold(why: str) -> RecordingTime:
        return RecordingTime(name=name, begin=None, end=None, scale=f"not in the data: {why}")

    if seconds is None:
        return untold("profiles hold no times")
    if attrs.get("time_reference") != "gps":
        return untold("times count from any moment")
    if seconds[0] >= 0 and seconds[1] < _ROLLED:
        moments = [_EPOCH + dt.timedelta(seconds=one) for one in seconds]
        begin, end = (f"{_DAYS[one.weekday()]} {one:%H:%M:%S}" for one in moments)
        scale = "GPS time; the week is not in the data"
    elif seconds[0] >= _SINCE_1980:
        begin, end = (f"{_gps_to_utc(one):%Y-%m-%d %H:%M:%S}" for one in seconds)
        scale = "UTC"
    else:
        return untold("times are seconds neither of the GPS week nor since 1980")
    return RecordingTime(name=name, begin=begin, end=end, scale=scale, seconds=seconds)


def date_contradictions(stated: str, found: tuple[RecordingTime, ...]) -> list[str]:
    """Where the stated date is not that of the data.

    Parameters
    ----------
    stated : str
        Date; looked at only if it is written as 2026-03-12.
    found : tuple of Recorded
        What the data tell.

    Returns
    -------
    list of str
        A sentence for each file that differs by more than a day.

    Examples
    --------
    >>> run = recorded("a.zarr", {"time_reference": "gps"}, (375_318.0, 375_338.0))
    >>> contradictions("2026-03-12", (run,)), len(contradictions("2026-03-15", (run,)))
    ([], 1)
    """
    try:
        day = dt.date.fromisoformat(stated.strip()[:10])
    except ValueError:
        return []
    return [
        f"{one.name} was recorded on {one.begin} ({one.scale}), {apart} days from the date that is "
        f"stated, {day}. Correct the date, or name the right run."
        for one in found
        if one.seconds is not None and (apart := _days_apart(day, one.seconds)) > _APART
    ]


def _days_apart(day: dt.date, seconds: tuple[float, float]) -> int:
    """Days between a date and the recording, in the week that is nearest to it if none is known."""
    if seconds[0] >= _SINCE_1980:
        first, last = (_gps_to_utc(one).date() for one in seconds)
        return max(0, (first - day).days, (day - last).days)
    first, last = ((_EPOCH + dt.timedelta(seconds=one)).date() for one in seconds)
    length = (last - first).days
    after = (day - first).days % 7  # days of the stated date after the begin
    return 0 if after <= length else min(after - length, 7 - after)


def _gps_to_utc(seconds: float) -> dt.datetime:
    passed = [leaps for since, leaps in _LEAPS.items() if seconds >= since]
    return _EPOCH + dt.timedelta(seconds=seconds - max([_FIRST_LEAPS, *passed]))
