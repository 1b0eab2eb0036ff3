"""Write heights into an OpenCRG file, block by block.

The header and the rounded reference line come from pycrg: it writes a file with only the two
outermost long sections, all zero. The lines of all long sections, which pycrg writes into a second
small file, are inserted into that header.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pycrg
import xarray as xr

from trueterrain.core.row_blocks import height_blocks, load_heights, row_blocks
from trueterrain.formats.opencrg._header import CrgHeader, read_header
from trueterrain.formats.opencrg._offsets import section_offsets
from trueterrain.formats.opencrg._payload import CrgPayload

Floats = npt.NDArray[np.float64]

_END = b"$" * 72 + b"\n"  # of the header
_LINES = re.MULTILINE | re.IGNORECASE
_LEFT = re.compile(rb"^long_section_v_left .*\n", _LINES)
_INCREMENT = re.compile(rb"^long_section_v_increment .*\n", _LINES)  # follows _LEFT, if any
_SECTIONS = re.compile(rb"(?:^D:long section .*\n)+", _LINES)
_RECORD = 80  # [bytes]


@dataclass(frozen=True, kw_only=True, eq=False)
class FlatRoad:
    """Reference line as rounded in a file, and the header of that file."""

    header: bytes
    "Header of a file with the two outermost long sections."
    channels: Floats
    "Channels before the heights of each cross-section, rounded as in the file."
    grid: pycrg.CrgGrid
    "Reference line that results from them."

    def heights(self, v: Floats, rows: slice) -> Floats:
        """Heights of the reference line and its banking [m], to be broadcast to the grid."""
        base = self.grid.ref_z[rows, None]
        if self.grid.bank.any():
            base = base + self.grid.bank[rows, None] * v
        return np.asarray(base)


def flat_road(path: Path, road: xr.Dataset, keywords: Mapping[str, Any]) -> FlatRoad:
    """Write the reference line with pycrg to a path, and read it with the C-API."""
    pycrg.write(path, np.zeros((road.sizes["u"], 2)), v=road["v"].values[[0, -1]], **keywords)
    header = read_header(path)
    numbers = CrgPayload(header, section_offsets(header))
    channels, _ = numbers[slice(0, numbers.rows)]
    with pycrg.DataSet.open(path, apply_modifiers=False) as data:
        return FlatRoad(header=_header_bytes(path), channels=channels, grid=data.grid())


def number_type(fmt: str) -> np.dtype[Any]:
    """Data type of a binary format."""
    return np.dtype(">f4" if fmt == "KRBI" else ">f8")


def with_sections(header: bytes, v: Floats, fmt: str, path: Path) -> bytes:
    """Header with other long sections between the same edges; `path` is used temporarily."""
    pycrg.write(path, np.zeros((2, v.size)), 1.0, v, fmt=fmt)
    example = _header_bytes(path)
    # free text is kept apart: it may contain lines that look like those to be replaced
    end_of_text = header.index(b"\n$\n")
    text, rest = header[:end_of_text], header[end_of_text:]
    increment, sections = (b"".join(lines.findall(example)) for lines in (_INCREMENT, _SECTIONS))
    rest = _INCREMENT.sub(b"", rest)
    rest = _LEFT.sub(lambda left: left.group() + increment, rest)
    return text + _SECTIONS.sub(sections, rest)


def write_whole(road: xr.Dataset, flat: FlatRoad, path: Path, keywords: Mapping[str, Any]) -> None:
    """Write the heights as text, all at once."""
    v = np.asarray(road["v"])
    every = slice(0, road.sizes["u"])
    pycrg.write(path, load_heights(road, every) - flat.heights(v, every), v=v, **keywords)


def write_blocks(road: xr.Dataset, flat: FlatRoad, path: Path, fmt: str) -> None:
    """Write the heights as bytes, block by block.

    Raises
    ------
    ValueError
        If the file would begin with a byte that the C-API takes for a line break.
    """
    v = np.asarray(road["v"])
    header = with_sections(flat.header, v, fmt, path)
    before = flat.channels.shape[1]
    with path.open("wb") as stream:
        stream.write(header)
        for rows, block in height_blocks(road):
            table = np.empty((len(block), before + v.size), dtype=number_type(fmt))
            table[:, :before] = flat.channels[rows]
            rest = block - flat.heights(v, rows)
            # all missing heights are written as the same NaN, so that files are reproducible
            np.copyto(rest, np.nan, where=np.isnan(rest))
            table[:, before:] = rest
            content = table.tobytes()
            if rows.start == 0 and content[:1] in (b"\n", b"\r"):
                message = "the first height is so small that OpenCRG would misread it; make it 0"
                raise ValueError(message)
            stream.write(content)
        stream.write(record_padding(stream.tell() - len(header), fmt))


def copy_sections(header: CrgHeader, part: Path, kept: npt.NDArray[np.int64], v: Floats) -> None:
    """Copy a binary file with some of its long sections, number by number.

    Parameters
    ----------
    header : CrgHeader
        Header of the file.
    part : Path
        File to write.
    kept : ndarray of int
        Numbers of the sections, from right to left.
    v : ndarray
        Offsets of all sections, from right to left [m].
    """
    fmt = header.number_format or ""
    numbers = CrgPayload(header, section_offsets(header))
    with header.path.open("rb") as source:
        text = with_sections(source.read(header.data_offset), v[kept], fmt, part)
    with part.open("wb") as stream:
        stream.write(text)
        for rows in row_blocks(numbers.shape):
            channels, grid = numbers[rows]
            table = np.concatenate([channels, grid[:, kept]], axis=1)
            stream.write(table.astype(number_type(fmt)).tobytes())
        stream.write(record_padding(stream.tell() - len(text), fmt))


def record_padding(length: int, fmt: str) -> bytes:
    """Bytes that fill up the last record after `length` bytes of numbers: NaN."""
    number = number_type(fmt)
    return np.full(-length % _RECORD // number.itemsize, np.nan, dtype=number).tobytes()


def _header_bytes(path: Path) -> bytes:
    content = path.read_bytes()
    return content[: content.index(_END) + len(_END)]
