"""Opening LAS, LAZ and COPC files, and saying in one line what is wrong with damaged ones."""

import logging
import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import laspy

from trueterrain.errors import FormatError

# laspy logs what it raises as well; without a handler that ends up on stderr
logging.getLogger("laspy").addHandler(logging.NullHandler())

Bounds = tuple[float, float, float, float]

_EXPORT = "The file is damaged or cut off: copy or export it again."
_SHORTEST_HEADER = 227  # [bytes]
_WITH_EVLRS = 4  # minor version from which on there are extended records
_POINTER = 8  # [bytes] in front of compressed points: where the table of chunks begins
_VERSION = 4  # [bytes] at the start of that table, in front of the count of chunks

# what laspy and lazrs raise on damaged files; pyo3 panics are no Exception and handled by name
_DAMAGE = (laspy.LaspyException, RuntimeError, ValueError, LookupError, OverflowError, EOFError,
           MemoryError, AssertionError, TypeError)  # fmt: skip


class _Record(NamedTuple):
    """How the records before and behind the points are laid out [bytes]."""

    name: str
    header: int
    length_at: int
    length_size: int


_VLR = _Record("record", 54, 20, 2)
_EVLR = _Record("extended record", 60, 20, 8)


@contextmanager
def opened(path: str | Path, selection: Any = None) -> Iterator[Any]:
    """Yield a `laspy.LasReader` of a file whose size fits its header."""
    path = Path(path)
    size = _require_las(path)
    with damage_named(path, "header"):
        reader = laspy.open(
            path, decompression_selection=selection or laspy.DecompressionSelection.all()
        )
    with reader:
        header = reader.header
        if header.point_count and not header.are_points_compressed:
            _require_all_points(path, header, size)
        elif header.point_count:
            _require_chunk_table(path, header, size)
        yield reader


@contextmanager
def damage_named(path: Path, place: str) -> Iterator[None]:
    """Turn what laspy and lazrs raise on damaged files into a FormatError with a place."""
    try:
        yield
    except FormatError:
        raise
    except _DAMAGE as error:
        raise FormatError(
            f"cannot be read ({error})", path=path, place=place, cure=_EXPORT
        ) from None
    except BaseException as error:
        if type(error).__name__ != "PanicException":
            raise
        raise FormatError(
            f"cannot be read ({error})", path=path, place=place, cure=_EXPORT
        ) from None


def chunks(reader: Any, path: Path, size: int) -> Iterator[Any]:
    """Yield the point records of an open file, `size` at a time; all that the header announces."""
    count = reader.header.point_count
    done = 0
    while done < count:
        last = min(done + size, count)
        with damage_named(path, f"points {done + 1} to {last} of {count}"):
            points = reader.read_points(size)
        if len(points) < last - done:
            raise FormatError(
                f"must hold the {count} points that its header announces, but ends after "
                f"{done + len(points)}",
                path=path,
                place="points",
                cure=_EXPORT,
            )
        done = last
        yield points


def _require_las(path: Path) -> int:
    with path.open("rb") as stream:
        start = stream.read(247)
        size = stream.seek(0, 2)
        if start[:4] != b"LASF":
            found = "is empty" if not start else f"begins with {start[:4]!r}"
            raise FormatError(
                f"is no LAS or LAZ file: it must begin with LASF, but {found}",
                path=path,
                place="byte 1",
                cure="See with `trueterrain info` what the file is.",
            )
        if len(start) < _SHORTEST_HEADER:
            raise FormatError(
                f"ends at byte {size}, within its header",
                path=path,
                place=f"byte {size}",
                cure=_EXPORT,
            )
        # laspy reads as many records as a damaged header announces, for hours if need be; and COPC
        # keeps its hierarchy behind the points, where nothing else would miss what is cut off
        begin, points, count = struct.unpack_from("<HLL", start, 94)
        _require_records(stream, path, _VLR, begin, count, min(points, size))
        if start[25] >= _WITH_EVLRS:
            begin, count = struct.unpack_from("<QL", start.ljust(247, b"\0"), 235)
            _require_records(stream, path, _EVLR, begin, count, size)
    return size


def _require_records(
    stream: BinaryIO, path: Path, record: _Record, begin: int, count: int, end: int
) -> None:
    for number in range(1, count + 1):
        if begin + record.header <= end:
            stream.seek(begin + record.length_at)
            begin += int.from_bytes(stream.read(record.length_size), "little")
        begin += record.header
        if begin > end:
            behind = "the file ends" if record is _EVLR else "the points begin or the file ends"
            raise FormatError(
                f"{record.name} {number} of {count} should end at byte {begin}, but {behind} at "
                f"byte {end}",
                path=path,
                place=f"byte {end}",
                cure=_EXPORT,
            )


def _require_all_points(path: Path, header: Any, size: int) -> None:
    record = header.point_format.size
    held = max(0, size - header.offset_to_point_data) // record
    if held < header.point_count:
        raise FormatError(
            f"must hold the {header.point_count} points that its header announces, but ends "
            f"after {held}",
            path=path,
            place=f"byte {size}",
            cure=_EXPORT,
        )


def _require_chunk_table(path: Path, header: Any, size: int) -> None:
    if not header.vlrs.get("LasZipVlr"):
        raise FormatError(
            "the record that describes the compression is missing",
            path=path,
            place="header",
            cure=_EXPORT,
        )
    with path.open("rb") as stream:
        stream.seek(header.offset_to_point_data)
        table = int.from_bytes(stream.read(_POINTER), "little", signed=True)
        if table == -1:  # writers that cannot seek leave the pointer in the last bytes
            stream.seek(-_POINTER, os.SEEK_END)
            table = int.from_bytes(stream.read(_POINTER), "little", signed=True)
        if not header.offset_to_point_data < table < size:
            raise FormatError(
                f"ends at byte {size}, but its table of chunks should begin at byte {table}",
                path=path,
                place=f"byte {size}",
                cure=_EXPORT,
            )
        stream.seek(table + _VERSION)
        chunks = int.from_bytes(stream.read(4), "little")
    # lazrs makes room for all of them, and ends the process if there is not enough; every chunk
    # holds one whole point at least
    if chunks * header.point_format.size > size:
        raise FormatError(
            f"cannot hold the {chunks} chunks of points that it announces in {size} bytes",
            path=path,
            place=f"byte {table}",
            cure=_EXPORT,
        )
