"""Opening LAS, LAZ and COPC files, and saying in one line what is wrong with damaged ones."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import laspy

from trueterrain.errors import FormatError

# laspy logs what it raises as well; without a handler that ends up on stderr
logging.getLogger("laspy").addHandler(logging.NullHandler())

Bounds = tuple[float, float, float, float]

_EXPORT = "The file is damaged or cut off: copy or export it again."
_EVLR_HEADER, _EVLR_LENGTH = 60, 20  # [bytes] size of an extended record's header; its length field
_POINTER = 8  # [bytes] in front of compressed points: where the table of chunks begins

# what laspy and lazrs raise on damaged files; pyo3 panics are no Exception and handled by name
_DAMAGE = (laspy.LaspyException, RuntimeError, ValueError, LookupError, OverflowError, EOFError,
           MemoryError, AssertionError, TypeError)  # fmt: skip


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
        _require_last_records(path, header, size)
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
        start = stream.read(4)
        size = stream.seek(0, 2)
    if start != b"LASF":
        found = "is empty" if not start else f"begins with {start!r}"
        raise FormatError(
            f"is no LAS or LAZ file: it must begin with LASF, but {found}",
            path=path,
            place="byte 1",
            cure="See with `trueterrain info` what the file is.",
        )
    return size


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
    # writers that cannot seek leave -1 here, and the pointer in the last bytes
    if table != -1 and not header.offset_to_point_data < table < size:
        raise FormatError(
            f"ends at byte {size}, but its table of chunks should begin at byte {table}",
            path=path,
            place=f"byte {size}",
            cure=_EXPORT,
        )


def _require_last_records(path: Path, header: Any, size: int) -> None:
    """COPC keeps its hierarchy behind the points; what is cut off there would not be missed."""
    start = header.start_of_first_evlr
    with path.open("rb") as stream:
        for number in range(header.number_of_evlrs):
            stream.seek(start + _EVLR_LENGTH)
            start += _EVLR_HEADER + int.from_bytes(stream.read(8), "little")
            if start > size:
                raise FormatError(
                    f"ends at byte {size}, but its extended record {number + 1} of "
                    f"{header.number_of_evlrs} should end at byte {start}",
                    path=path,
                    place=f"byte {size}",
                    cure=_EXPORT,
                )
