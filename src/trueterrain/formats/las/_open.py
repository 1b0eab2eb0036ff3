"""Open LAS, LAZ and COPC files safely: sizes are checked, damage gives a one-line FormatError."""

import logging
import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import accumulate
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import laspy
import lazrs
import numpy as np

from trueterrain.core.errors import FormatError, TrueTerrainError
from trueterrain.formats.signature import open_regular

# laspy raises errors and logs them, too; without a handler the log goes to stderr
logging.getLogger("laspy").addHandler(logging.NullHandler())

_EXPORT = "The file is damaged or cut off: copy or export it again."
_SHORTEST_HEADER = 227  # [bytes]
_WITH_EVLRS = 4  # minor version of LAS from which on there are extended records
_POINTER = 8  # [bytes] before compressed points: position of the table of chunks
_VERSION = 4  # [bytes] at the start of that table, before the number of chunks

_ITEMS = struct.Struct("<12xI16xH")  # of the LASzip record: points in a chunk, number of items
_ITEM = struct.Struct("<HH2x")  # kind and size
_LAYERS = {10: 9, 11: 1, 12: 2, 13: 1}  # layers of each kind of item that is compressed in layers
_BYTES = 14  # kind of item of extra bytes, with one layer for each byte
_LARGEST_CHUNK = 1 << 20  # points of a chunk that are always accepted


class LasChunk(NamedTuple):
    """One chunk of compressed points, by the table of chunks."""

    start: int
    size: int  # [bytes]
    points: int


class _RecordLayout(NamedTuple):
    """Layout of the variable length records before and after the points [bytes]."""

    name: str
    header: int
    length_at: int
    length_size: int


_VLR = _RecordLayout("record", 54, 20, 2)
_EVLR = _RecordLayout("extended record", 60, 20, 8)


@contextmanager
def open_reader(path: str | Path, selection: Any = None) -> Iterator[Any]:
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
            read_chunk_table(path, header)
        _require_scales(path, header)
        yield reader


@contextmanager
def damage_named(path: Path, place: str) -> Iterator[None]:
    """Turn exceptions of laspy and lazrs over damaged files into a FormatError with a place."""
    try:
        yield
    except (TrueTerrainError, FileNotFoundError, PermissionError):
        raise
    except Exception as error:  # of many types; panics of pyo3 are BaseExceptions, see below
        raise FormatError(
            f"cannot be read ({error})", path=path, place=place, cure=_EXPORT
        ) from None
    except BaseException as error:
        if type(error).__name__ != "PanicException":
            raise
        raise FormatError(
            f"cannot be read ({error})", path=path, place=place, cure=_EXPORT
        ) from None


def read_chunks(reader: Any, path: Path, size: int) -> Iterator[Any]:
    """Yield the point records of an open file, `size` at a time; all that the header states."""
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
    with open_regular(path) as stream:
        start = stream.read(247)
        size = stream.seek(0, 2)
        if start[:4] != b"LASF":
            found = "is empty" if not start else f"begins with {start[:4]!r}"
            raise FormatError(
                f"is not a LAS or LAZ file: it must begin with LASF, but {found}",
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
        # laspy reads as many records as the header states, for hours if that is damaged; and the
        # hierarchy of COPC lies after the points, where no other check notices a truncated file
        begin, points, count = struct.unpack_from("<HLL", start, 94)
        _require_records(stream, path, _VLR, begin, count, min(points, size))
        if start[25] >= _WITH_EVLRS:
            begin, count = struct.unpack_from("<QL", start.ljust(247, b"\0"), 235)
            _require_records(stream, path, _EVLR, begin, count, size)
    return size


def _require_records(
    stream: BinaryIO, path: Path, record: _RecordLayout, begin: int, count: int, end: int
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


def _require_scales(path: Path, header: Any) -> None:
    for name, values in (("scales", header.scales), ("offsets", header.offsets)):
        if not (np.isfinite(values).all() and (name == "offsets" or (values != 0).all())):
            rule = "must be finite" + ("" if name == "offsets" else " and not 0")
            found = ", ".join(f"{value:g}" for value in values)
            raise FormatError(
                f"{name} of the coordinates {rule}, got {found}",
                path=path,
                place="header",
                cure=_EXPORT,
            )


def read_chunk_table(path: Path, header: Any, record: Any = None) -> list[LasChunk]:
    """Read the table of chunks, and check that no chunk is larger than the file.

    lazrs allocates the sizes that chunks, layers and the table of chunks state, and aborts the
    process if memory does not suffice. `record` is the LASzip record; by default that of the
    header.
    """
    records = header.vlrs.get("LasZipVlr") if record is None else [record]
    if not records:
        raise FormatError(
            "the record that describes the compression is missing",
            path=path,
            place="header",
            cure=_EXPORT,
        )
    about, first = records[0].record_data, header.offset_to_point_data + _POINTER
    with path.open("rb") as stream, damage_named(path, "table of chunks"):
        end = _table_start(path, stream, header)
        layers = _require_items(path, about, header)
        stream.seek(header.offset_to_point_data)
        found = lazrs.read_chunk_table(stream, lazrs.LazVlr(about))
        per_chunk, _ = _ITEMS.unpack_from(about)
        is_fixed = not lazrs.LazVlr(about).uses_variable_size_chunks()
        starts = [first, *(first + total for total in accumulate(size for _, size in found))]
        chunks = [
            LasChunk(start, size, per_chunk if is_fixed else points)
            for start, (points, size) in zip(starts, found, strict=False)
        ]
        largest = max(header.point_count, _LARGEST_CHUNK)
        for number, chunk in enumerate(chunks, start=1):
            if chunk.start + chunk.size > end:
                how = f"should end at byte {chunk.start + chunk.size}, but they end at byte {end}"
            elif not 0 < chunk.points <= largest:
                how = f"announces {chunk.points} points, the file {header.point_count}"
            elif layers and (needed := _layered_size(stream, chunk, header, layers)) > chunk.size:
                how = f"has {chunk.size} bytes, but its layers announce {needed}"
            else:
                continue
            raise FormatError(
                f"chunk {number} of {len(chunks)} {how}",
                path=path,
                place=f"byte {chunk.start}",
                cure=_EXPORT,
            )
        held = sum(chunk.points for chunk in chunks)
        if held < header.point_count:
            raise FormatError(
                f"must hold the {header.point_count} points that its header announces, but its "
                f"chunks have {held}",
                path=path,
                place="table of chunks",
                cure=_EXPORT,
            )
    return chunks


def _table_start(path: Path, stream: BinaryIO, header: Any) -> int:
    """Byte at which the table of chunks begins."""
    size = stream.seek(0, os.SEEK_END)
    stream.seek(header.offset_to_point_data)
    table = int.from_bytes(stream.read(_POINTER), "little", signed=True)
    if table == -1:  # writers that cannot seek put the position into the last bytes of the file
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
    if chunks * header.point_format.size > size:  # each chunk begins with one uncompressed point
        raise FormatError(
            f"cannot hold the {chunks} chunks of points that it announces in {size} bytes",
            path=path,
            place=f"byte {table}",
            cure=_EXPORT,
        )
    return table


def _require_items(path: Path, about: bytes, header: Any) -> int:
    """Number of layers in each chunk (0: no layers); the items must add up to a point."""
    _, count = _ITEMS.unpack_from(about)
    items = [_ITEM.unpack_from(about, _ITEMS.size + i * _ITEM.size) for i in range(count)]
    size = sum(size for _, size in items)
    if size != header.point_format.size:
        raise FormatError(
            f"must describe points of {header.point_format.size} bytes, but its items have {size}",
            path=path,
            place="record of the compression",
            cure=_EXPORT,
        )
    return sum(size if kind == _BYTES else _LAYERS.get(kind, 0) for kind, size in items)


def _layered_size(stream: BinaryIO, chunk: LasChunk, header: Any, layers: int) -> int:
    """Size of a chunk [bytes]: first point, number of points, sizes of the layers, layers."""
    head = int(header.point_format.size) + 4 + 4 * layers
    stream.seek(chunk.start)
    start = stream.read(head)
    if len(start) < head:
        return head
    sizes = np.frombuffer(start, dtype="<u4", offset=head - 4 * layers)
    return head + int(sizes.sum(dtype=np.int64))
