"""Tables of points and profiles in text: header, blocks of columns, checks of every row."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from trueterrain.core.errors import FormatError, name_file_in_errors
from trueterrain.formats._text_head import find_head, number_of, split_line
from trueterrain.formats._text_rows import GAPS, TextRows, is_content
from trueterrain.formats.signature import open_regular
from trueterrain.formats.table._cells import bare_texts
from trueterrain.formats.table._columns import (
    TableColumn,
    TableLayout,
    layout_of,
    layout_without_header,
    names_columns,
)

Values = dict[TableColumn, npt.NDArray[np.float64] | npt.NDArray[np.str_]]

_TAIL = 1 << 16  # [bytes] at the end of a file in which its last line is searched


@dataclass(frozen=True, kw_only=True)
class TextTable:
    """Header of a text table: its rows and the meaning of its columns."""

    rows: TextRows
    "Where the rows of data begin, and how they are divided."

    layout: TableLayout
    "Meaning of the columns."

    named: bool
    "Whether the file names its columns."


def open_text(path: Path, *, kind: str | None = None) -> TextTable:
    """Read the header of a text table, and check its last line."""
    encoding = _detect_encoding(path)
    with path.open(encoding=encoding, newline=None) as stream, name_file_in_errors(path):
        head = find_head(stream, names_columns)
    if head is None:
        raise FormatError("is empty", path=path, place="line 1", cure="Copy or export it again.")
    labels = list(head.labels)
    if head.named:
        layout = layout_of(labels, path, kind=kind)
    else:
        layout = layout_without_header(len(labels), path, kind=kind)
    rows = TextRows(
        path=path,
        separator=head.separator,
        decimal=head.decimal,
        first=head.first,
        fields=len(labels),
        encoding=encoding,
    )
    _check_last_line(rows)
    return TextTable(rows=rows, layout=layout, named=head.named)


def text_blocks(table: TextTable, size: int | None = None) -> Iterator[Values]:
    """Yield the columns in SI units, `size` rows at a time; every row is checked."""
    rows, columns = table.rows, table.layout.columns
    labels = {column.index: column for column in columns}

    def explain() -> None:
        rows.check(
            lambda number, index, text: _check_cell(table, number, labels[index], text), labels
        )

    numeric = {column.index for column in columns if column.name != "track"}
    empty, explained = True, False
    for frame in rows.frames(numeric, size, explain):
        empty = False
        values = {c: frame[c.index].to_numpy() for c in columns}
        if not explained and _has_gaps(values):
            explain()
            explained = True  # the whole file has been checked
        yield {
            c: bare_texts(array.astype(str)) if c.name == "track" else array * c.scale
            for c, array in values.items()
        }
    if empty:
        raise FormatError(
            "has a header but no rows",
            path=rows.path,
            place=f"line {rows.first}",
            cure="Copy or export it again.",
        )


def _has_gaps(values: Values) -> bool:
    """Whether values are missing: on purpose, or because a line was cut off."""
    return any(
        column.name != "track" and not np.isfinite(array.astype(float)).all()
        for column, array in values.items()
    )


def _check_cell(table: TextTable, number: int, column: TableColumn, text: str) -> None:
    if column.name == "track":
        return
    value = math.nan if text.strip() in GAPS else number_of(text, table.rows.decimal)
    if value is None:
        cure = ""
        if number_of(text.replace(",", ".")) is not None:
            cure = "Write all numbers with a decimal point, or all with a comma."
        raise table.rows.number_error(number, column.label, text, cure)
    if math.isinf(value) or (math.isnan(value) and table.layout.must_be_finite(column)):
        raise FormatError(
            f"must be a finite number, got {text.strip() or 'nothing'!r}",
            path=table.rows.path,
            place=f"line {number}, column {column.label!r}",
            cure="Remove the line, or fill in the number.",
        )


def line_of_row(rows: TextRows, row: int) -> int:
    """Number of the line that holds a row of data; the first row is 0, the first line 1."""
    for index, (number, _) in enumerate(rows.numbered()):
        if index == row:
            return number
    return rows.first + row


def _check_last_line(rows: TextRows) -> None:
    """Raise if the last line is cut off, before anything else is read."""
    with rows.path.open("rb") as stream:
        size = stream.seek(0, 2)
        stream.seek(max(0, size - _TAIL))
        tail = stream.read().decode(rows.encoding, errors="replace")
    lines = [line for line in tail.splitlines() if is_content(line)]
    last = split_line(lines[-1], rows.separator, rows.path) if lines else []
    if len(last) not in (0, rows.fields):
        number = sum(1 for _ in rows.numbered())
        rows.check_count(line_of_row(rows, number - 1), len(last))


def _detect_encoding(path: Path) -> str:
    with open_regular(path) as stream:
        while block := stream.read(1 << 20):
            if b"\0" in block:
                raise FormatError(
                    "is binary, not text",
                    path=path,
                    place="start of the file",
                    cure="See with `trueterrain info` what the file is.",
                )
            if not block.isascii():
                break
        else:
            return "ascii"
    try:
        with path.open(encoding="utf-8-sig") as text:
            while text.read(1 << 20):
                pass
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8-sig"
