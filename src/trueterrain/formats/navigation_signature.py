"""Recognise navigation: SBET and SMRMSG by their bytes, tables by the names of their columns."""

import math
import re
import struct
from collections.abc import Sequence

#: Required columns of Boreas poses.
BOREAS_COLUMNS = (
    "GPSTime",
    "easting",
    "northing",
    "altitude",
    "vel_east",
    "vel_north",
    "vel_up",
    "roll",
    "pitch",
    "heading",
)

#: Names of a column of time: GPS time, Time_s, SOW, seconds of week, t.
TIME = re.compile(r"(gps|utc|unix)?[ _]?(time|sow|sec(ond)?s|timestamp)|t$", re.IGNORECASE)
_NAMED = (
    TIME,
    re.compile(r"e(ast)?(ing)?$|e(ast)?(ing)?[^a-z]|lat|pos|x$|x[^a-z]", re.IGNORECASE),
    *(
        re.compile(rf"(platform|true|sbet)?[ _]?({name})", re.IGNORECASE)
        for name in ("roll", "pitch", "yaw|heading|azimuth")
    ),
)
_SBET_FIELDS = 17

_WEEK = 604_800.0  # [s]
_HIGHEST = 100_000.0  # [m]
_TINY = 1e-9  # [s, rad, m, m/s] smaller values are not measurements


def is_sbet(start: bytes, size: int) -> bool:
    r"""Whether a file can be an SBET, by the plausibility of its first records.

    Parameters
    ----------
    start : bytes
        First bytes of the file, at least 272 if it is long enough.
    size : int
        Size of the file [bytes]; a file whose last record is cut off is still recognised.

    Returns
    -------
    bool
        True if time, latitude, longitude, height and angles of the first records are plausible.

    Examples
    --------
    >>> is_sbet(struct.pack("<17d", 400825.0, 0.66, -2.08, 6991.6, *[0.0] * 13), 136)
    True
    >>> is_sbet(b"\0" * 136, 136)
    False
    """
    records = _read_records(start, size, _SBET_FIELDS)
    return bool(records) and all(map(_can_be_sbet, records)) and _times_ascend(records)


def is_smrmsg(start: bytes, size: int) -> bool:
    """Whether a file can be an SMRMSG, by the plausibility of its first records.

    Parameters
    ----------
    start : bytes
        First bytes of the file, at least 160 if it is long enough.
    size : int
        Size of the file [bytes].

    Returns
    -------
    bool
        True if the time and the nine errors of the first records are plausible.

    Examples
    --------
    >>> is_smrmsg(struct.pack("<10d", 536258.0, *[0.05] * 9), 80)
    True
    """
    records = _read_records(start, size, 10)
    return bool(records) and all(map(_can_be_smrmsg, records)) and _times_ascend(records)


def is_sbet_text(fields: Sequence[str]) -> bool:
    """Whether a line of text can be a record of an SBET.

    Parameters
    ----------
    fields : sequence of str
        Fields of the line.

    Returns
    -------
    bool
        True if they are 17 numbers with plausible values.

    Examples
    --------
    >>> is_sbet_text("400825.0 0.66 -2.08 691.6 0 0 0 0 0 0 0 0 0 0 0 0 0".split())
    True
    """
    try:
        record = tuple(float(field) for field in fields)
    except ValueError:
        return False
    return len(record) == _SBET_FIELDS and _can_be_sbet(record)


def is_boreas(names: Sequence[str]) -> bool:
    """Whether the columns of a table are those of Boreas poses.

    Parameters
    ----------
    names : sequence of str
        Names of the columns.

    Returns
    -------
    bool
        True if none is missing.
    """
    return set(BOREAS_COLUMNS) <= {name.strip() for name in names}


def is_navigation(names: Sequence[str]) -> bool:
    """Whether the columns of a table are those of navigation, by the usual names.

    Parameters
    ----------
    names : sequence of str
        Names of the columns.

    Returns
    -------
    bool
        True if there are a time, a position, roll, pitch, and a yaw angle or heading.

    Examples
    --------
    >>> is_navigation(["GPS Time (s)", "Lat", "Lon", "Roll", "Pitch", "Platform Heading"])
    True
    >>> is_navigation(["x", "y", "z", "time"])
    False
    """
    return all(any(kind.match(name.strip()) for name in names) for kind in _NAMED)


def _read_records(start: bytes, size: int, fields: int) -> list[tuple[float, ...]]:
    length = 8 * fields
    # the bytes of text, taken as doubles, can be tiny numbers that look plausible
    if all(32 <= byte < 127 or byte in b"\t\r\n" for byte in start[:length]):
        return []
    whole = min(len(start), size) // length
    return [struct.unpack_from(f"<{fields}d", start, length * i) for i in range(min(whole, 2))]


def _times_ascend(records: list[tuple[float, ...]]) -> bool:
    # steps of up to a minute, or back to the start of a GPS week
    step = records[-1][0] - records[0][0]
    return len(records) == 1 or 0 < step < 60 or step < -_WEEK / 2


def _can_be_sbet(record: tuple[float, ...]) -> bool:
    time, latitude, longitude, height = record[:4]
    return (
        all(map(math.isfinite, record))
        and _TINY < time < 2 * _WEEK
        and _TINY < abs(latitude) <= math.pi / 2
        and _TINY < abs(longitude) <= 2 * math.pi
        and abs(height) < _HIGHEST
        and all(abs(angle) <= math.pi for angle in record[7:9])
        and all(abs(angle) <= 4 * math.pi for angle in record[9:11])
    )


def _can_be_smrmsg(record: tuple[float, ...]) -> bool:
    return _TINY < record[0] < 2 * _WEEK and all(_TINY < error < 1e4 for error in record[1:])
