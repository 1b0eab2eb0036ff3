"""Tables as text: fast where the text is good, exact about the line where it is not."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pandas as pd

from trueterrain.core.errors import FormatError, name_file_in_errors
from trueterrain.formats._text_head import find_head, number_of, split_line
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

# pandas reads every bit of a number by itself since 3.1, and before that when told to
_PANDAS = tuple(int(part) for part in pd.__version__.split(".")[:2])
_EXACT = {} if _PANDAS >= (3, 1) else {"float_precision": "round_trip"}

_GAPS = ("", "nan", "NaN", "NAN", "NA", "null")
_TAIL = 1 << 16  # [bytes] in which the last line is looked for


@dataclass(frozen=True, kw_only=True)
class TextTable:
    """A text file whose head has been read."""

    path: Path
    separator: str | None  # None: blanks
    decimal: str
    encoding: str
    named: bool  # whether the file names its columns
    first: int  # number of the first line of data, from 1
    fields: int
    layout: TableLayout


def open_text(path: Path, *, kind: str | None = None) -> TextTable:
    """Read the head of a text table."""
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
    table = TextTable(
        path=path,
        separator=head.separator,
        decimal=head.decimal,
        encoding=encoding,
        named=head.named,
        first=head.first,
        fields=len(labels),
        layout=layout,
    )
    _check_last_line(table)
    return table


def text_blocks(table: TextTable, size: int | None = None) -> Iterator[Values]:
    """Columns in SI, `size` rows at a time; every row is checked."""
    columns = table.layout.columns
    # all columns are read, since pandas overlooks surplus fields when told to use some only
    numbers = {column.index for column in columns if column.name != "track"}
    dtypes = {i: float if i in numbers else str for i in range(table.fields)}
    explained = False
    try:
        reader = pd.read_csv(
            table.path,
            sep=table.separator or r"\s+",
            decimal=table.decimal,
            header=None,
            skiprows=table.first - 1,
            dtype=dtypes,
            chunksize=size or (1 << 62),
            encoding=table.encoding,
            keep_default_na=False,
            na_values=list(_GAPS),
            skipinitialspace=True,
            skip_blank_lines=True,
            comment="#",
            **_EXACT,
        )
        with reader:
            for frame in reader:
                values = {c: frame[c.index].to_numpy() for c in columns}
                if not explained and _has_gaps(values):
                    _explain_rows(table)
                    explained = True  # the whole file has been gone through
                yield {
                    c: bare_texts(array.astype(str)) if c.name == "track" else array * c.scale
                    for c, array in values.items()
                }
    except pd.errors.EmptyDataError:
        raise FormatError(
            "has a header but no rows",
            path=table.path,
            place=f"line {table.first}",
            cure="Copy or export it again.",
        ) from None
    except ValueError as error:  # pandas' own parser errors are ValueErrors, too
        _explain_rows(table)
        raise FormatError(
            f"cannot be read as a table ({error})",
            path=table.path,
            cure="Export it again as plain CSV.",
        ) from None


def _has_gaps(values: Values) -> bool:
    """Whether there are gaps: they may be meant, or be the trace of a line that was cut off."""
    return any(
        column.name != "track" and not np.isfinite(array.astype(float)).all()
        for column, array in values.items()
    )


def _explain_rows(table: TextTable) -> None:
    """Go through the file line by line and raise at the first that breaks a rule."""
    for number, row in numbered_rows(table):
        if len(row) != table.fields:
            raise _wrong_count(table, number, len(row))
        for column in table.layout.columns:
            _check_cell(table, number, column, row[column.index])


def _check_cell(table: TextTable, number: int, column: TableColumn, text: str) -> None:
    if column.name == "track":
        return
    value = math.nan if text.strip() in _GAPS else number_of(text, table.decimal)
    place = f"line {number}, column {column.label!r}"
    if value is None:
        cure = "Correct the line, or export the file again."
        if number_of(text.replace(",", ".")) is not None:
            cure = "Write all numbers with a decimal point, or all with a comma."
        raise FormatError(
            f"must be a number, got {text[:80]!r}", path=table.path, place=place, cure=cure
        )
    if math.isinf(value) or (math.isnan(value) and table.layout.must_be_finite(column)):
        raise FormatError(
            f"must be a finite number, got {text.strip() or 'nothing'!r}",
            path=table.path,
            place=place,
            cure="Remove the line, or fill in the number.",
        )


def line_of_row(table: TextTable, row: int) -> int:
    """Number of the line that holds a row of data, both counted from the start of the file."""
    for index, (number, _) in enumerate(numbered_rows(table)):
        if index == row:
            return number
    return table.first + row


def numbered_rows(table: TextTable) -> Iterator[tuple[int, list[str]]]:
    """Lines of data with their numbers from 1, split into fields."""
    with table.path.open(encoding=table.encoding, errors="replace", newline=None) as stream:
        for number, line in enumerate(stream, start=1):
            if number >= table.first and _is_content(line):
                yield number, split_line(line, table.separator, table.path)


def _check_last_line(table: TextTable) -> None:
    with table.path.open("rb") as stream:
        size = stream.seek(0, 2)
        stream.seek(max(0, size - _TAIL))
        tail = stream.read().decode(table.encoding, errors="replace")
    lines = [line for line in tail.splitlines() if _is_content(line)]
    last = split_line(lines[-1], table.separator, table.path) if lines else []
    found = len(last) or table.fields
    if found != table.fields:
        number = sum(1 for _ in numbered_rows(table))
        raise _wrong_count(table, line_of_row(table, number - 1), found)


def _wrong_count(table: TextTable, number: int, found: int) -> FormatError:
    return FormatError(
        f"has {found} of {table.fields} fields",
        path=table.path,
        place=f"line {number}",
        cure="Complete or remove the line; if it is the last, the file was cut off.",
    )


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


def _is_content(line: str) -> bool:
    return bool(line.strip()) and not line.startswith("#")
