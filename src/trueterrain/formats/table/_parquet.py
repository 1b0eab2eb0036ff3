"""Tables in Parquet, read and written block by block (extra ``parquet``)."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from trueterrain.core import Checksums, not_whole
from trueterrain.core.errors import FormatError
from trueterrain.core.schemas import EXTRA
from trueterrain.formats._parquet import import_pyarrow, parquet_damage_named, require_numbers
from trueterrain.formats.table._columns import TableLayout, layout_of
from trueterrain.formats.table._text import Values

_METADATA = b"trueterrain"  # key of the metadata that hold CRS and provenance
_ROWS = 1_000_000  # rows that are read at a time


def open_parquet(path: Path, *, kind: str | None = None) -> tuple[Any, TableLayout, dict[str, Any]]:
    """Open a file; returns the file of pyarrow, the meaning of its columns, and the attributes."""
    _, pq = import_pyarrow(path)
    with parquet_damage_named(path):
        file = pq.ParquetFile(path, page_checksum_verification=True)
        names = file.schema_arrow.names
        rows = file.metadata.num_rows
        kept = json.loads((file.schema_arrow.metadata or {}).get(_METADATA, b"{}"))
        attrs = dict(kept)
    if rows == 0:
        raise FormatError("has no rows", path=path, cure="Export it again.")
    return file, layout_of(names, path, kind=kind), attrs


def parquet_blocks(
    path: Path, file: Any, layout: TableLayout, size: int | None = None
) -> Iterator[Values]:
    """Yield the columns in SI units, at most `size` rows at a time."""
    pa, _ = import_pyarrow(path)
    labels = file.schema_arrow.names
    row, rows = 0, file.metadata.num_rows
    with parquet_damage_named(path):
        for batch in file.iter_batches(
            batch_size=min(size or _ROWS, max(1, rows)),
            columns=[labels[column.index] for column in layout.columns],
        ):
            values: Values = {}
            for column in layout.columns:
                array = batch.column(labels[column.index])
                if column.name == "track":
                    values[column] = np.array(array.to_pylist(), dtype=str)
                else:
                    numbers = _column_numbers(pa, array, column.label, path)
                    values[column] = numbers if column.scale == 1.0 else numbers * column.scale
                    _check_values(layout, column, values[column], row, path)
            yield values
            row += batch.num_rows
        if row != rows:
            message = f"{row} rows instead of {rows}"
            raise ValueError(message)


def _column_numbers(pa: Any, array: Any, label: str, path: Path) -> Any:
    require_numbers(pa, array.type, label, path)
    # extra bytes keep their type, since float64 does not hold 64-bit integers
    keep = label.startswith(EXTRA) and not array.null_count
    return (array if keep else array.cast(pa.float64())).to_numpy(zero_copy_only=False)


def _check_values(layout: TableLayout, column: Any, values: Any, row: int, path: Path) -> None:
    bad = ~np.isfinite(values) if layout.must_be_finite(column) else np.isinf(values)
    if bad.any():
        first = int(np.flatnonzero(bad)[0])
        raise FormatError(
            f"must be a finite number, got {values[first]}",
            path=path,
            place=f"row {row + first + 1}, column {column.label!r}",
            cure="Remove the row, or fill in the number.",
        )


class ParquetWriter:
    """Writer of one row group per block of columns; a context manager."""

    def __init__(self, temporary: Path, metadata: dict[str, Any]) -> None:
        self._pa, self._pq = import_pyarrow(temporary)
        self._path = temporary
        self._metadata = {_METADATA: json.dumps(metadata).encode()}
        self._writer: Any = None
        self._written = Checksums()

    def __enter__(self) -> "ParquetWriter":
        return self

    def __exit__(self, *_: object) -> None:
        if self._writer is not None:
            self._writer.close()

    def add(self, columns: dict[str, Any]) -> None:
        """Append rows."""
        table = self._pa.table({name: self._pa.array(c) for name, c in columns.items()})
        if self._writer is None:
            schema = table.schema.with_metadata(self._metadata)
            self._writer = self._pq.ParquetWriter(self._path, schema)
        table = table.cast(self._writer.schema)
        self._writer.write_table(table)
        for batch in table.to_batches():
            _add_columns(self._written, batch)

    def require_same(self, path: Path) -> None:
        """Read the file back; raise if it differs from what was written."""
        found = Checksums()
        try:
            with self._pq.ParquetFile(self._path) as file:
                for batch in file.iter_batches():
                    _add_columns(found, batch)
        except (self._pa.ArrowException, OSError) as error:
            raise not_whole(path, str(error)) from error
        found.require_same(self._written, path)


def _add_columns(checksums: Checksums, batch: Any) -> None:
    for name in batch.schema.names:
        values = batch.column(name).to_numpy(zero_copy_only=False)
        if values.dtype == object:  # text
            checksums.add(name, "".join(f"{text}\n" for text in values).encode())
        else:
            checksums.add(name, values)
