"""Read the numbers of an OpenCRG file, with checks of their count and size.

The reference implementations decode any bytes. Line ends that a transfer converted inside binary
numbers, or a truncated file, then give heights of 1e15 m without a message; here they are errors.
"""

import os
import re

import numpy as np
import numpy.typing as npt

from trueterrain.core.errors import FormatError
from trueterrain.core.row_blocks import row_blocks
from trueterrain.formats.opencrg._header import NUMBER_FORMATS, CrgHeader, station_count

Floats = npt.NDArray[np.float64]

_RECORD = 80  # [bytes]
#: Largest plausible height of a road [m]; damaged numbers are nearly always larger.
HIGHEST = 1e5
_LARGEST_CHANNEL = {"phi": 1e3, "slope": 1e2, "banking": 1e2}  # [rad, m/m]
_CONVERTED = (
    "Copy it again as binary: a transfer converted its line ends (in git, put `*.crg binary` into "
    ".gitattributes)."
)
_CUT = "The file is cut off or damaged: copy or export it again."


class CrgPayload:
    """Numbers of an OpenCRG file; blocks of cross-sections are read on demand.

    Parameters
    ----------
    header : CrgHeader
        Header of the file.
    offsets : ndarray
        Offset of each long section [m], in the order of the file.

    Raises
    ------
    FormatError
        If there are too few or too many, if one is implausible, or if text is not a number.
    """

    def __init__(self, header: CrgHeader, offsets: Floats) -> None:
        self._header = header
        self._table: Floats | None = None
        self._dtype = np.dtype(">f8" if header.number_format == "KDBI" else ">f4")
        if header.is_binary:
            self.rows = _require_length(header, self._dtype.itemsize)
        else:
            with header.path.open("rb") as stream:
                stream.seek(header.data_offset)
                self._table = _from_text(header, stream.read())
            self.rows = len(self._table)
        sections = [k for k, kind in enumerate(header.channels) if kind == "section"]
        order = np.argsort(offsets)
        self._columns = np.array(sections)[order]
        self._others = np.delete(np.arange(len(header.channels)), sections)
        limits = [_LARGEST_CHANNEL.get(kind, HIGHEST) for kind in header.channels]
        others = np.array([kind == "other" for kind in header.channels])
        self._limits = np.where(others, np.inf, limits)

    @property
    def shape(self) -> tuple[int, int]:
        """Count of cross-sections and of long sections."""
        return self.rows, self._columns.size

    def __getitem__(self, rows: slice) -> tuple[Floats, Floats]:
        """Channels of the reference line, and heights above it [m] from right to left."""
        values = self._values(rows)
        first, count = int(self._columns[0]), self._columns.size
        if (self._columns == np.arange(first, first + count)).all():
            grid = values[:, first : first + count]  # no copy
        else:
            grid = values[:, self._columns]
        return values[:, self._others], grid

    def require_possible(self) -> None:
        """Raise a FormatError if any of the numbers is implausible."""
        for rows in row_blocks((self.rows, len(self._header.channels))):
            self._values(rows)

    def _values(self, rows: slice) -> Floats:
        if self._table is not None:
            values = self._table[rows]
        else:
            columns = len(self._header.channels)
            values = np.fromfile(
                self._header.path,
                dtype=self._dtype,
                count=(rows.stop - rows.start) * columns,
                offset=self._header.data_offset + rows.start * columns * self._dtype.itemsize,
            )
            with np.errstate(invalid="ignore"):  # damage can make NaN of a kind that warns
                values = values.astype(np.float64).reshape(-1, columns)
        _require_possible(self._header, values, self._limits, rows.start)
        return values


def _require_length(header: CrgHeader, size: int) -> int:
    """Number of cross-sections; raises if the count of numbers differs from the header."""
    rows, columns = station_count(header), len(header.channels)
    assert rows is not None  # binary files must announce it
    needed = rows * columns * size
    padded = -(-needed // _RECORD) * _RECORD
    with header.path.open("rb") as stream:
        length = stream.seek(0, os.SEEK_END) - header.data_offset
        if length not in (needed, padded):
            stream.seek(header.data_offset)
            _raise_wrong_length(header, stream.read(), rows, needed, padded)
        stream.seek(header.data_offset + needed)
        tail = np.frombuffer(stream.read(), dtype=f">f{size}")
    if not np.isnan(tail).all():
        raise FormatError(
            "the last record must be filled with NaN, but holds numbers",
            path=header.path,
            place="data, last record",
            cure=_CUT,
        )
    if length < padded:
        header.problems.append(f"the last record is not filled up to {_RECORD} bytes")
    return rows


def _raise_wrong_length(
    header: CrgHeader, payload: bytes, rows: int, needed: int, padded: int
) -> None:
    row = needed // rows
    where = f"cross-section {min(len(payload) // row + 1, rows)} of {rows}"
    cure = _CUT
    if len(payload) > padded:
        where = "end of data"
        if b"\n" in payload and payload.count(b"\n") == payload.count(b"\r\n"):
            cure = _CONVERTED
    elif (
        header.line_ends == "LF" and b"\r\n" not in payload and padded - len(payload) < padded / 99
    ):
        cure = f"{_CUT} {_CONVERTED}"
    kind = ""
    if payload and not payload.translate(None, bytes(range(32, 127)) + b"\r\n\t"):
        kind = f", and they are text although #: says {header.number_format}"
        cure = "Export the file again, or correct the line #:."
    raise FormatError(
        f"the data must be {padded} bytes long ({rows} cross-sections of {row} bytes in records of "
        f"{_RECORD}), got {len(payload)}{kind}",
        path=header.path,
        place=where,
        cure=cure,
    )


def _from_text(header: CrgHeader, payload: bytes) -> Floats:
    width, per_line = NUMBER_FORMATS[header.number_format or "LRFI"]
    columns = len(header.channels)
    if payload.translate(None, bytes(range(32, 127)) + b"\r\n\t"):
        raise FormatError(
            f"the data must be text, since #: says {header.number_format}, but they are not",
            path=header.path,
            place="data",
            cure="Export the file again, or correct the line #:.",
        )
    ended = payload.endswith((b"\n", b"\r"))
    lines = [line.rstrip() for line in payload.splitlines()]
    while lines and not lines[-1]:
        lines.pop()
    lengths = [width * per_line] * (columns // per_line)
    if columns % per_line:
        lengths.append(width * (columns % per_line))
    rows = _require_lines(header, lines, lengths, ended)
    joined = b"".join(
        line.ljust(length) for line, length in zip(lines, lengths * rows, strict=True)
    )
    return _parse_fields(header, np.frombuffer(joined, dtype=f"S{width}")).reshape(rows, columns)


def _require_lines(header: CrgHeader, lines: list[bytes], lengths: list[int], ended: bool) -> int:
    """Number of cross-sections; raises if number or length of the lines are wrong."""
    per_row = len(lengths)
    rows, rest = divmod(len(lines), per_row)
    announced = station_count(header)
    if rest or rows < 2 or (announced is not None and rows != announced):
        expected = f"{announced}" if announced is not None else "2 or more"
        raise FormatError(
            f"must hold {expected} cross-sections of {per_row} lines, got {len(lines)} lines",
            path=header.path,
            place=f"data, cross-section {rows + 1}",
            cure=_CUT,
        )
    for at, (line, length) in enumerate(zip(lines, lengths * rows, strict=True)):
        if len(line) > length or (at == len(lines) - 1 and not ended):
            raise FormatError(
                f"must be {length} characters long and end with a line break, got {len(line)}"
                f"{'' if ended else ' and no line break'}",
                path=header.path,
                place=f"data, line {at + 1}",
                cure=_CUT,
            )
    return rows


def _parse_fields(header: CrgHeader, fields: npt.NDArray[np.bytes_]) -> Floats:
    # a field with a star holds no number: *missing*, **unused** or stars alone
    missing = np.char.find(fields, b"*") >= 0
    values = np.full(fields.size, np.nan)
    try:
        values[~missing] = fields[~missing].astype(np.float64)
    except ValueError:
        number = re.compile(rb"\s*[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?\s*", re.IGNORECASE)
        at = next(
            k for k, text in enumerate(fields) if not missing[k] and not number.fullmatch(text)
        )
        row, column = divmod(at, len(header.channels))
        raise FormatError(
            f"must be a number, got {bytes(fields[at]).decode().strip()!r}",
            path=header.path,
            place=f"data, cross-section {row + 1}, column {column + 1}",
            cure=_CUT,
        ) from None
    return values


def _require_possible(header: CrgHeader, values: Floats, limits: Floats, first: int) -> None:
    """Raise if a number of the cross-sections from `first` on is too large, or missing."""
    line = [k for k, kind in enumerate(header.channels) if kind in _LARGEST_CHANNEL]
    largest = np.fmax(np.fmax.reduce(values), -np.fmin.reduce(values))
    if not (largest > limits).any() and not np.isnan(values[:, line]).any():
        return
    wrong = np.abs(values) > limits
    for column in line:
        # NaN is allowed in heights only; the first phi and slope belong to no chord
        wrong[:, column] |= np.isnan(values[:, column])
        if header.channels[column] != "banking" and first == 0:
            wrong[0, column] = False
    if wrong.any():
        column = int(np.flatnonzero(wrong.any(axis=0))[0])
        row = int(np.flatnonzero(wrong[:, column])[0])
        kind = header.channels[column]
        raise FormatError(
            f"{'height' if kind == 'section' else kind} must be at most {limits[column]:g} in "
            f"size, got {values[row, column]:g}",
            path=header.path,
            place=f"data, cross-section {first + row + 1}, column {column + 1}",
            cure=f"The numbers are damaged. {_CONVERTED}",
        )
