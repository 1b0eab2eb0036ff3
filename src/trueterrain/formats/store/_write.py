"""Write points, surfaces and profiles to stores."""

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
import zarr

from trueterrain.core import whole_store
from trueterrain.core.errors import CoverageError, SchemaError
from trueterrain.core.schemas import check_points, check_profile, check_surface, kind_of
from trueterrain.formats._zarr_write import StoreWriter
from trueterrain.formats.store._layout import (
    BOUNDS,
    CHUNK,
    ArrayEntry,
    Values,
    as_numbers,
    create_array,
    create_store,
    plain_attrs,
    rows_of,
    write_summary,
)
from trueterrain.formats.store._statistics import PointStatistics, SurfaceStatistics

_AT_ONCE = 4  # chunks that are written together, each in its own thread


def write(
    data: xr.Dataset | Iterator[xr.Dataset], path: str | Path, *, force: bool = False
) -> None:
    """Write points, a surface or a profile as a store.

    All numbers and attributes are stored exactly. Points may come block by block; surfaces that are
    not in memory are read part by part.

    Parameters
    ----------
    data : xarray.Dataset or iterator of xarray.Dataset
        Points, surface or profile, or blocks of points with the same variables. Attributes of
        points are taken from the last block, so that they may hold counts of all blocks.
    path : str or Path
        Path of the store to write: a folder ``NAME.zarr``.
    force : bool
        Replace an existing store of the same kind of data, never anything else.

    Raises
    ------
    ValueError
        If the name does not end with .zarr.
    SchemaError
        If the data are of no known kind, variables or the CRS differ between blocks, or a value is
        neither a number nor a text.
    CoverageError
        If there are no points to write.
    OutputError
        If the path exists and `force` is false or it holds something else, or if the store differs
        when it is read back.

    Examples
    --------
    >>> import tempfile
    >>> from trueterrain.formats.store import read
    >>> from trueterrain.core.schemas import make_points
    >>> points = make_points([0.1, 0.2], [1.0, 2.0], [0.3, 0.1 + 0.2], crs="EPSG:25832")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write(points, Path(folder) / "p.zarr")
    ...     again = read(Path(folder) / "p.zarr")
    >>> again.identical(points)
    True
    """
    path = Path(path)
    kind = kind_of(data) if isinstance(data, xr.Dataset) else "points"
    with whole_store(path, (kind,), force=force) as temporary:
        if kind == "points":
            blocks = [data] if isinstance(data, xr.Dataset) else data
            _write_points(blocks, temporary, path)
            return
        assert isinstance(data, xr.Dataset)
        check = check_surface if kind == "surface" else check_profile
        _write_whole(check(data, path=path), kind, temporary, path)


def _write_whole(data: xr.Dataset, kind: str, target: Path, path: Path) -> None:
    """Write a surface or profile variable by variable, some chunks at a time."""
    store = create_store(target, data.attrs)
    rows = rows_of(kind, data.sizes)
    statistics = SurfaceStatistics(data) if kind == "surface" else None
    entries = []
    for name, variable in data.variables.items():
        add = statistics.add if statistics is not None and name == "height" else None
        array = _write_variable(store, str(name), variable, rows, add)
        entries.append(
            _array_entry(str(name), array, variable.dims, coordinate=name in data.coords)
        )
    store.require_same(path)
    write_summary(store, entries, {} if statistics is None else statistics.to_dict())


def _write_variable(
    store: StoreWriter,
    name: str,
    variable: xr.Variable,
    rows: str,
    add_values: Callable[[Values], None] | None,
) -> "zarr.Array[Any]":
    numbers, attrs = as_numbers(variable)
    array = create_array(
        store,
        name,
        dims=variable.dims,
        shape=variable.shape,
        dtype=numbers.dtype,
        attrs=attrs,
        rows=rows,
    )
    if rows not in variable.dims:
        store.write_part(array, ..., np.asarray(numbers.values))
        return array
    axis = variable.dims.index(rows)
    step = _AT_ONCE * array.chunks[axis]
    for start in range(0, variable.shape[axis], step):
        part = slice(start, start + step)
        values = np.asarray(numbers.isel({rows: part}).values)
        store.write_part(array, (*[slice(None)] * axis, part), values)
        if add_values is not None:
            add_values(values)
    return array


def _write_points(blocks: Iterable[xr.Dataset], target: Path, path: Path) -> None:
    layout = _BlockLayout(path)
    statistics = PointStatistics()
    store: StoreWriter | None = None
    arrays: dict[str, zarr.Array[Any]] = {}
    for columns in _whole_chunks(map(layout.columns, blocks)):
        if store is None:
            store = create_store(target, layout.attrs)
            arrays = {
                name: create_array(
                    store,
                    name,
                    dims=("point",),
                    shape=(0,),
                    dtype=values.dtype,
                    attrs=layout.first[name].attrs,
                    rows="point",
                )
                for name, values in columns.items()
            }
        start = statistics.count
        statistics.add(columns)
        for name, array in arrays.items():
            array.resize((statistics.count,))
            store.write_part(array, slice(start, statistics.count), columns[name])
    if store is None:
        raise CoverageError("there are no points to write", path=path)
    store.root.attrs.put(plain_attrs(layout.attrs, "the dataset"))
    bounds = statistics.bounds()
    edges = create_array(
        store,
        BOUNDS,
        dims=("chunk", "edge"),
        shape=bounds.shape,
        dtype=bounds.dtype,
        attrs={"edges": "west, south, east, north", "units": "m"},
        rows="chunk",
    )
    store.write_part(edges, ..., bounds)
    store.require_same(path)
    entries = [
        _array_entry(name, array, ("point",), coordinate=name in layout.coordinates)
        for name, array in arrays.items()
    ]
    write_summary(store, entries, statistics.to_dict())


class _BlockLayout:
    """Variables and attributes of the first block of points, which all blocks must have."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.first: dict[str, xr.Variable] = {}
        self.coordinates: set[str] = set()
        self.attrs: dict[Any, Any] = {}

    def columns(self, block: xr.Dataset) -> dict[str, Values]:
        """Columns of a block; raises unless its variables and CRS are those of the first block."""
        check_points(block, path=self._path)
        found = {str(name): variable for name, variable in block.variables.items()}
        for name, variable in found.items():
            if variable.dims != ("point",):
                rule = f"must have the dimension (point), got {variable.dims}"
                raise SchemaError(rule, path=self._path, place=f"variable {name}")
        if not self.first:
            # one row is enough to keep names, types and attributes
            self.first = {name: variable[:1].copy() for name, variable in found.items()}
            self.coordinates = {str(name) for name in block.coords}
        else:
            self._require_same(found, block)
        self.attrs = dict(block.attrs)
        return {name: np.asarray(found[name].values) for name in self.first}

    def _require_same(self, found: dict[str, xr.Variable], block: xr.Dataset) -> None:
        now, before = (
            [f"{name} ({columns[name].dtype})" for name in sorted(columns)]
            for columns in (found, self.first)
        )
        if now != before:
            raise SchemaError(
                f"all blocks must have the same variables, got {', '.join(now)} after "
                f"{', '.join(before)}",
                path=self._path,
            )
        crs, known = (str(attrs.get("crs", ""))[:40] for attrs in (block.attrs, self.attrs))
        if block.attrs.get("crs", "") != self.attrs.get("crs", ""):
            raise SchemaError(
                f"all blocks must have the same CRS, got {crs!r} after {known!r}",
                path=self._path,
                cure="Transform them first, or name the CRS of all.",
            )


def _whole_chunks(blocks: Iterable[dict[str, Values]]) -> Iterator[dict[str, Values]]:
    """Blocks of whole chunks, except the last, so that block sizes do not change the store."""
    waiting: list[dict[str, Values]] = []
    held = 0
    for block in blocks:
        waiting.append(block)
        held += next(iter(block.values())).size
        if held >= _AT_ONCE * CHUNK:
            joined = _join_blocks(waiting)
            full = held // CHUNK * CHUNK
            yield {name: values[:full] for name, values in joined.items()}
            waiting = [{name: values[full:] for name, values in joined.items()}]
            held -= full
    if held:
        yield _join_blocks(waiting)


def _join_blocks(blocks: list[dict[str, Values]]) -> dict[str, Values]:
    if len(blocks) == 1:
        return blocks[0]
    return {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}


def _array_entry(
    name: str, array: "zarr.Array[Any]", dims: tuple[Any, ...], *, coordinate: bool
) -> ArrayEntry:
    return ArrayEntry(
        name=name,
        dims=[str(dim) for dim in dims],
        shape=list(array.shape),
        dtype=str(array.dtype),
        coordinate=coordinate,
    )
