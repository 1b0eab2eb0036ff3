"""Columns of numbers by name from a CSV or Parquet table, block by block.

Used for navigation, scans and accelerometers: tables of recordings, whose columns the user names.
Points and profiles, whose columns have names of their own, are read by `trueterrain.formats.table`.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from trueterrain.core.errors import FormatError, suggest_name
from trueterrain.formats._table_file import ColumnRule, ParquetTable, TextTable, open_table
from trueterrain.formats._text_head import Head
from trueterrain.formats.navigation_signature import is_navigation

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
    return _names_of(_open_named(Path(path)))


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
    table = _open_named(Path(path)) if head is None else TextTable(Path(path), head)
    columns = _names_of(table)
    for name in names:
        if name not in columns:
            raise FormatError(
                f"has no column {name!r}{suggest_name(name, columns)}; it has "
                f"{', '.join(columns[:12])}{', ...' if len(columns) > 12 else ''}",
                path=path,
                place="header",
            )
    rules = {columns.index(name): ColumnRule(label=name) for name in dict.fromkeys(names)}
    for block in table.blocks(rules, size):
        yield {rules[index].label: np.asarray(values, float) for index, values in block.items()}


def _open_named(path: Path) -> TextTable | ParquetTable:
    """Open a table whose columns have names."""
    table = open_table(path, is_navigation)
    if not table.named:
        raise FormatError(
            "begins with numbers, not with the names of the columns",
            path=path,
            place="line 1" if isinstance(table, ParquetTable) else f"line {table.head.first}",
            cure="Add a first line with the names.",
        )
    return table


def _names_of(table: TextTable | ParquetTable) -> list[str]:
    return [label.strip() for label in table.labels]
