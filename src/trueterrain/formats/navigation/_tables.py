"""Columns of numbers by name, from CSV or Parquet, some rows at a time."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from trueterrain.core.errors import FormatError, name_file_in_errors
from trueterrain.formats._text_head import Head, find_head, number_of, split_line
from trueterrain.formats.navigation._recognise import is_navigation
from trueterrain.formats.navigation._schema import suggest_name
from trueterrain.formats.signature import open_regular
from trueterrain.formats.table._parquet import import_pyarrow, parquet_damage_named

Floats = npt.NDArray[np.float64]

ROWS = 1_000_000  # read at a time

_GAPS = ("", "nan", "NaN", "NAN", "NA", "null")
_PANDAS = r"\s+"  # blanks, for pandas


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
    """Columns of a table, all rows."""
    parts = list(table_blocks(path, names))
    return {name: np.concatenate([part[name] for part in parts]) for name in names}


def table_blocks(
    path: str | Path, names: Sequence[str], size: int = ROWS, *, head: Head | None = None
) -> Iterator[dict[str, Floats]]:
    """Columns of a table, some rows at a time.

    Parameters
    ----------
    path : str or Path
        CSV (or other separated text) with a header, or Parquet.
    names : sequence of str
        Columns to read.
    size : int
        Largest number of rows at a time.
    head : Head, optional
        Head of a text that names no columns.

    Yields
    ------
    dict of numpy.ndarray, shape (row,)
        Numbers of each column; NaN where a cell is empty.

    Raises
    ------
    FormatError
        Naming line and column: a missing column, a cell that is no number, a line of other length.
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
    wanted = list(dict.fromkeys(names))
    read = _parquet_blocks if table.file is not None else _text_blocks
    rows = 0
    for block in read(table, wanted, size):
        rows += len(block[wanted[0]])
        yield block
    if rows == 0:
        raise FormatError("has no rows", path=path, cure="Copy or export it again.")


@dataclass(frozen=True, kw_only=True)
class _NumberTable:
    path: Path
    columns: tuple[str, ...]
    separator: str | None = None  # of text; None: blanks
    decimal: str = "."  # sign, of text
    header: int = 0  # lines before the data
    file: Any = None  # of Parquet


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
        separator=head.separator,
        decimal=head.decimal,
        header=head.first - 1,
    )


def _text_blocks(table: _NumberTable, names: list[str], size: int) -> Iterator[dict[str, Floats]]:
    import pandas as pd

    indices = {table.columns.index(name): name for name in names}
    # all columns are read, since pandas overlooks surplus fields when told to use some only
    dtypes = {i: float if i in indices else str for i in range(len(table.columns))}
    row = 0
    try:
        with pd.read_csv(
            table.path,
            sep=table.separator or _PANDAS,
            header=None,
            skiprows=table.header,
            dtype=dtypes,
            decimal=table.decimal,
            chunksize=size,
            encoding="utf-8-sig",
            encoding_errors="replace",
            keep_default_na=False,
            na_values=list(_GAPS),
            skipinitialspace=True,
            skip_blank_lines=True,
            comment="#",
            **_exact_parser(pd.__version__),
        ) as reader:
            for frame in reader:
                if frame.shape[1] != len(table.columns) or frame.iloc[:, -1].isna().any():
                    _explain_rows(table, indices)  # a line that was cut off looks like a gap
                row += len(frame)
                yield {name: frame[i].to_numpy(dtype=np.float64) for i, name in indices.items()}
    except pd.errors.EmptyDataError:
        return
    except ValueError as error:  # pandas' own parser errors are ValueErrors, too
        _explain_rows(table, indices)
        raise FormatError(
            f"cannot be read as a table ({error})", path=table.path, cure="Export it again."
        ) from None


def _exact_parser(pandas: str) -> dict[str, Any]:
    """What makes pandas read every bit of a number, which it does by itself since 3.1."""
    version = tuple(int(part) for part in pandas.split(".")[:2])
    return {} if version >= (3, 1) else {"float_precision": "round_trip"}


def _explain_rows(table: _NumberTable, indices: dict[int, str]) -> None:
    """Go through the file line by line and raise at the first that breaks a rule."""
    with table.path.open(encoding="utf-8-sig", errors="replace", newline=None) as stream:
        for number, line in enumerate(stream, start=1):
            if number <= table.header or not _is_content(line):
                continue
            cells = split_line(line, table.separator, table.path)
            if len(cells) != len(table.columns):
                raise FormatError(
                    f"has {len(cells)} of {len(table.columns)} fields",
                    path=table.path,
                    place=f"line {number}",
                    cure="Complete or remove the line; if it is the last, the file was cut off.",
                )
            for index, name in indices.items():
                if (
                    cells[index].strip() not in _GAPS
                    and _parse_number(cells[index], table.decimal) is None
                ):
                    raise FormatError(
                        f"must be a number, got {cells[index][:80]!r}",
                        path=table.path,
                        place=f"line {number}, column {name!r}",
                        cure="Correct the line, or export the file again.",
                    )


def _open_parquet(path: Path) -> _NumberTable:
    _, pq = import_pyarrow(path)
    with parquet_damage_named(path):
        file = pq.ParquetFile(path, page_checksum_verification=True)
        return _NumberTable(path=path, columns=tuple(file.schema_arrow.names), file=file)


def _parquet_blocks(
    table: _NumberTable, names: list[str], size: int
) -> Iterator[dict[str, Floats]]:
    import pyarrow as pa

    for name in names:
        with parquet_damage_named(table.path):  # of two columns of one name
            kind = table.file.schema_arrow.field(name).type
        if not (pa.types.is_integer(kind) or pa.types.is_floating(kind)):
            raise FormatError(
                f"must hold numbers, got {kind}",
                path=table.path,
                place=f"column {name!r}",
                cure="Convert the column to float64.",
            )
    with parquet_damage_named(table.path):
        rows = table.file.metadata.num_rows
        batches = table.file.iter_batches(batch_size=min(size, max(1, rows)), columns=names)
        for batch in batches:
            yield {
                name: batch.column(name).cast(pa.float64()).to_numpy(zero_copy_only=False)
                for name in names
            }


def _is_content(line: str) -> bool:
    return bool(line.strip()) and not line.startswith("#")


def _parse_number(text: str, decimal: str) -> float | None:
    value = number_of(text, decimal)
    return None if value is None or math.isinf(value) else value
