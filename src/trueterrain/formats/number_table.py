"""Columns of numbers by name from a CSV or Parquet table, block by block.

Used for navigation, scans and accelerometers: tables of recordings, whose columns the user names.
Points and profiles, whose columns have names of their own, are read by `trueterrain.formats.table`.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from trueterrain.core.errors import FormatError, name_file_in_errors, suggest_name
from trueterrain.formats._parquet import import_pyarrow, parquet_damage_named, require_numbers
from trueterrain.formats._text_head import Head, find_head, number_of
from trueterrain.formats._text_rows import GAPS, TextRows
from trueterrain.formats.navigation_signature import is_navigation
from trueterrain.formats.signature import open_regular

Floats = npt.NDArray[np.float64]

ROWS = 1_000_000  # rows in a block by default


def table_columns(path: str | Path) -> list[str]:
    """Names of the columns of a table.

    Parameters
    ----------
    path : str or Path
        CSV (or other separated text) with a header, or Parquet.

    Returns
    -------
    list of str
        Names in the order of the file.

    Raises
    ------
    FormatError
        If the file is empty, damaged or has no header.
    """
    return list(_open_table(Path(path)).columns)


def table_whole(path: str | Path, names: Sequence[str]) -> dict[str, Floats]:
    """Read columns of a table, all rows at once; see `table_blocks`."""
    parts = list(table_blocks(path, names))
    return {name: np.concatenate([part[name] for part in parts]) for name in names}


def table_blocks(
    path: str | Path, names: Sequence[str], size: int = ROWS, *, head: Head | None = None
) -> Iterator[dict[str, Floats]]:
    """Read columns of a table block by block.

    Parameters
    ----------
    path : str or Path
        CSV (or other separated text) with a header, or Parquet.
    names : sequence of str
        Columns to read.
    size : int
        Largest number of rows at a time.
    head : Head, optional
        Header of a text whose columns have no names.

    Yields
    ------
    dict of numpy.ndarray, shape (row,)
        Numbers of each column; NaN where a cell is empty.

    Raises
    ------
    FormatError
        Naming line and column: a missing column, a cell that is not a number, a wrong number of
        fields.
    """
    table = _open_table(Path(path)) if head is None else _text_table(Path(path), head)
    for name in names:
        if name not in table.columns:
            raise FormatError(
                f"has no column {name!r}{suggest_name(name, table.columns)}; it has "
                f"{', '.join(table.columns[:12])}{', ...' if len(table.columns) > 12 else ''}",
                path=path,
                place="header",
            )
    columns = list(dict.fromkeys(names))
    read = _parquet_blocks if table.file is not None else _text_blocks
    rows = 0
    for block in read(table, columns, size):
        rows += len(block[columns[0]])
        yield block
    if rows == 0:
        raise FormatError("has no rows", path=path, cure="Copy or export it again.")


@dataclass(frozen=True, kw_only=True)
class _NumberTable:
    path: Path
    columns: tuple[str, ...]
    rows: TextRows | None = None  # of text
    file: Any = None  # of Parquet: the open file of pyarrow


def _open_table(path: Path) -> _NumberTable:
    with open_regular(path) as stream:
        start = stream.read(4)
    if start == b"PAR1":
        return _open_parquet(path)
    with (
        path.open(encoding="utf-8-sig", errors="replace", newline=None) as text,
        name_file_in_errors(path),
    ):
        head = find_head(text, is_navigation)
    if head is None:
        raise FormatError("is empty", path=path, place="line 1", cure="Copy or export it again.")
    if any("\0" in name for name in head.labels):
        raise FormatError(
            "is binary, not a table", path=path, cure="See with `trueterrain info` what it is."
        )
    if not head.named:
        raise FormatError(
            "begins with numbers, not with the names of the columns",
            path=path,
            place=f"line {head.first}",
            cure="Add a first line with the names.",
        )
    return _text_table(path, head)


def _text_table(path: Path, head: Head) -> _NumberTable:
    return _NumberTable(
        path=path,
        columns=tuple(name.strip() for name in head.labels),
        rows=TextRows(
            path=path,
            separator=head.separator,
            decimal=head.decimal,
            first=head.first,
            fields=len(head.labels),
        ),
    )


def _text_blocks(table: _NumberTable, names: list[str], size: int) -> Iterator[dict[str, Floats]]:
    rows = table.rows
    assert rows is not None
    indices = {table.columns.index(name): name for name in names}

    def check_cell(number: int, index: int, text: str) -> None:
        """Raise if a cell is neither a finite number nor empty."""
        value = number_of(text, rows.decimal)
        if text.strip() not in GAPS and (value is None or math.isinf(value)):
            raise rows.number_error(number, indices[index], text)

    def explain() -> None:
        rows.check(check_cell, indices)

    for frame in rows.frames(indices, size, explain):
        # pandas fills a line that was cut off as if its last cells were empty
        if frame.shape[1] != rows.fields or frame.iloc[:, -1].isna().any():
            explain()
        yield {name: frame[i].to_numpy(dtype=np.float64) for i, name in indices.items()}


def _open_parquet(path: Path) -> _NumberTable:
    _, pq = import_pyarrow(path)
    with parquet_damage_named(path):
        file = pq.ParquetFile(path, page_checksum_verification=True)
        return _NumberTable(path=path, columns=tuple(file.schema_arrow.names), file=file)


def _parquet_blocks(
    table: _NumberTable, names: list[str], size: int
) -> Iterator[dict[str, Floats]]:
    pa, _ = import_pyarrow(table.path)
    for name in names:
        with parquet_damage_named(table.path):  # of two columns of one name
            kind = table.file.schema_arrow.field(name).type
        require_numbers(pa, kind, name, table.path)
    with parquet_damage_named(table.path):
        rows = table.file.metadata.num_rows
        batches = table.file.iter_batches(batch_size=min(size, max(1, rows)), columns=names)
        for batch in batches:
            yield {
                name: batch.column(name).cast(pa.float64()).to_numpy(zero_copy_only=False)
                for name in names
            }
