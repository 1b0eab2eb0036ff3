"""Whether bytes can be an SBET or SMRMSG file: neither has a header to go by."""

import math
import struct

_WEEK = 604_800.0  # [s]
_HIGHEST = 100_000.0  # [m]
_TINY = 1e-9  # [s, rad, m, m/s] what is less was not measured


def is_sbet(start: bytes, size: int) -> bool:
    r"""Whether a file can be an SBET.

    Parameters
    ----------
    start : bytes
        Its first bytes, 272 at least if it has so many.
    size : int
        Its size [bytes]; a file that was cut off within its last record is still recognised.

    Returns
    -------
    bool
        True if its first records hold a time, a latitude, a longitude, a height and angles that
        can be such.

    Examples
    --------
    >>> is_sbet(struct.pack("<17d", 400825.0, 0.66, -2.08, 6991.6, *[0.0] * 13), 136)
    True
    >>> is_sbet(b"\0" * 136, 136)
    False
    """
    records = _records(start, size, 17)
    return bool(records) and all(map(_can_be_sbet, records)) and _forward(records)


def is_smrmsg(start: bytes, size: int) -> bool:
    """Whether a file can be an SMRMSG.

    Parameters
    ----------
    start : bytes
        Its first bytes, 160 at least if it has so many.
    size : int
        Its size [bytes].

    Returns
    -------
    bool
        True if its first records hold a time and nine errors that can be such.

    Examples
    --------
    >>> is_smrmsg(struct.pack("<10d", 536258.0, *[0.05] * 9), 80)
    True
    """
    records = _records(start, size, 10)
    return bool(records) and all(map(_can_be_smrmsg, records)) and _forward(records)


def _records(start: bytes, size: int, fields: int) -> list[tuple[float, ...]]:
    length = 8 * fields
    # text, read as doubles, may well be tiny numbers
    if all(32 <= byte < 127 or byte in b"\t\r\n" for byte in start[:length]):
        return []
    whole = min(len(start), size) // length
    return [struct.unpack_from(f"<{fields}d", start, length * i) for i in range(min(whole, 2))]


def _forward(records: list[tuple[float, ...]]) -> bool:
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
