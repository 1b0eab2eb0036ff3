"""Write points and profiles as tables."""

import json
import re
from collections.abc import Iterator
from contextlib import AbstractContextManager
from itertools import chain
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt
import pandas as pd
import xarray as xr

from trueterrain.core import Checksums, not_whole, whole_output
from trueterrain.core.errors import CoverageError, SchemaError
from trueterrain.core.schemas import (
    COORDINATES,
    EXTRA,
    RETURN_ATTRIBUTES,
    check_points,
    check_profile,
    kind_of,
)
from trueterrain.formats._table_file import METADATA, import_pyarrow

_POINTS = (
    *COORDINATES,
    "time",
    "intensity",
    "lane",
    "sd",
    "sd_relative",
    *RETURN_ATTRIBUTES,
)
_PROFILE = ("easting", "northing", "height", "sd", "count", "heading")
_ATTRS = (  # kept in Parquet
    "crs",
    "provenance",
    "gps_time_kind",
    "coordinate_scale",
    "coordinate_offset",
)
_ROWS = 1_000_000  # rows that are written at a time

# a spreadsheet runs a cell that begins so as a formula; an apostrophe before it makes it text
_FORMULA = re.compile(r"'*[=+\-@\t\r]")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")


def write(
    data: xr.Dataset | Iterator[xr.Dataset], path: str | Path, *, force: bool = False
) -> None:
    """Write points or a profile as a table: Parquet if the path has its ending, else CSV.

    Several tracks are written in rows, with a column ``track``. Numbers are exact to the last bit.

    Parameters
    ----------
    data : xarray.Dataset or iterator of xarray.Dataset
        A profile, points, or blocks of points.
    path : str or Path
        Path of the file to write.
    force : bool
        Replace an existing file.

    Raises
    ------
    SchemaError
        If the data are neither points nor a profile, or blocks differ in their variables.
    CoverageError
        If there are no points to write.
    OutputError
        If the file exists and `force` is false, or differs when it is read back.

    Examples
    --------
    >>> import tempfile
    >>> from trueterrain.core.schemas import make_profile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write(make_profile([0.0, 0.5], [0.1, 0.2]), Path(folder) / "p.csv")
    ...     print((Path(folder) / "p.csv").read_text().split())
    ['s,height', '0.0,0.1', '0.5,0.2']
    """
    path = Path(path)
    if isinstance(data, xr.Dataset) and kind_of(data) == "surface":
        raise SchemaError(
            "a surface is not a table",
            path=path,
            cure="Write CRG or GeoTIFF, or its nodes as points.",
        )
    with whole_output(path, force=force) as temporary:
        parts = chain([data]) if isinstance(data, xr.Dataset) else data
        first = next((part for part in parts if _count_rows(part)), None)
        if first is None:
            raise CoverageError("there are no points to write", path=path)
        attrs = {name: first.attrs[name] for name in _ATTRS if first.attrs.get(name)}
        names: list[str] | None = None
        with _open_writer(temporary, attrs) as writer:
            for columns in chain.from_iterable(map(_table_columns, chain([first], parts))):
                if names is not None and list(columns) != names:
                    raise SchemaError(
                        f"all blocks must have the same variables, got {', '.join(columns)} "
                        f"after {', '.join(names)}",
                        path=path,
                    )
                names = list(columns)
                writer.add(columns)
        writer.require_same(path)


def guard_text(text: str) -> str:
    """Text of a cell: an apostrophe is put before a text that would be a formula.

    Examples
    --------
    >>> guard_text("=1+2"), guard_text("-0.75"), guard_text("left")
    ("'=1+2", '-0.75', 'left')
    """
    return f"'{text}" if _FORMULA.match(text) and not _NUMBER.fullmatch(text) else text


def bare_texts(cells: npt.NDArray[np.str_]) -> npt.NDArray[np.str_]:
    """Texts without the apostrophe of `guard_text`."""
    names, place = np.unique(cells, return_inverse=True)
    bare = [name[1:] if name[:1] == "'" and _FORMULA.match(name) else name for name in names]
    return np.array(bare, dtype=np.str_)[place]


class _CsvWriter:
    def __init__(self, temporary: Path) -> None:
        self._path = temporary
        self._written = Checksums()
        self._stream: BinaryIO

    def __enter__(self) -> "_CsvWriter":
        self._stream = self._path.open("wb")
        return self

    def __exit__(self, *_: object) -> None:
        self._stream.close()

    def add(self, columns: dict[str, Any]) -> None:
        header = self._stream.tell() == 0
        frame = pd.DataFrame(columns)  # the shortest digits that give the same float64 are written
        if "track" in frame:
            frame["track"] = frame["track"].map(guard_text)
        text = frame.to_csv(header=header, index=False, na_rep="nan", lineterminator="\n").encode()
        self._written.add("text", text)
        self._stream.write(text)

    def require_same(self, path: Path) -> None:
        found = Checksums()
        found.add_file("text", self._path)
        found.require_same(self._written, path)


class _ParquetWriter:
    """Writer of one row group per block of columns; a context manager."""

    def __init__(self, temporary: Path, metadata: dict[str, Any]) -> None:
        self._pa, self._pq = import_pyarrow(temporary)
        self._path = temporary
        self._metadata = {METADATA: json.dumps(metadata).encode()}
        self._writer: Any = None
        self._written = Checksums()

    def __enter__(self) -> "_ParquetWriter":
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


def _open_writer(
    temporary: Path, attrs: dict[str, Any]
) -> AbstractContextManager[_CsvWriter | _ParquetWriter]:
    if temporary.suffix.lower() in (".parquet", ".pq"):
        return _ParquetWriter(temporary, attrs)
    return _CsvWriter(temporary)


def _count_rows(data: xr.Dataset) -> int:
    return data.sizes["point"] if "point" in data.dims else data.sizes.get("s", 0)


def _table_columns(data: xr.Dataset) -> Iterator[dict[str, Any]]:
    if kind_of(data) == "points":
        check_points(data)
        for start in range(0, data.sizes["point"], _ROWS):
            rows = slice(start, start + _ROWS)
            extra = (str(name) for name in data.data_vars if str(name).startswith(EXTRA))
            yield {name: data[name].values[rows] for name in (*_POINTS, *extra) if name in data}
        return
    check_profile(data)
    if "track" not in data.dims:
        yield {"s": data.s.values} | _profile_values(data)
        return
    for track in data.track.values:
        one = data.sel(track=track)
        yield {"track": np.full(data.sizes["s"], str(track)), "s": one.s.values} | _profile_values(
            one
        )


def _profile_values(profile: xr.Dataset) -> dict[str, Any]:
    return {name: profile[name].values for name in _PROFILE if name in profile}
