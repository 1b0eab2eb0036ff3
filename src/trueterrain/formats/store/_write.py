"""Points, surfaces and profiles to stores."""

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
import zarr

from trueterrain.core import Checksums, whole_store
from trueterrain.core.errors import CoverageError, SchemaError
from trueterrain.core.schemas import check_points, check_profile, check_surface, kind_of
from trueterrain.formats.store._layout import (
    BOUNDS,
    CHUNK,
    ArrayEntry,
    Values,
    as_numbers,
    create_array,
    create_group,
    plain_attrs,
    rows_of,
    write_summary,
)
from trueterrain.formats.store._statistics import PointStatistics, SurfaceStatistics

_AT_ONCE = 4  # chunks that are written together, each by a thread of its own


def write(
    data: xr.Dataset | Iterator[xr.Dataset], path: str | Path, *, force: bool = False
) -> None:
    """Write points, a surface or a profile as a store.

    Numbers keep every bit and all attributes are kept. Points may come block by block, and
    surfaces that are not in memory are read part by part.

    Parameters
    ----------
    data : xarray.Dataset or iterator of xarray.Dataset
        Points, surface or profile, or blocks of points with the same variables. Attributes of
        points are those of the last block, which has counted all of them.
    path : str or Path
        Path of the store to write: a folder ``NAME.zarr``.
    force : bool
        Replace points, a surface or a profile that is there already; nothing else ever.

    Raises
    ------
    ValueError
        If the name does not end with .zarr.
    SchemaError
        If the data are of no known kind, variables or the CRS change from block to block, or
        something is neither a number nor a text.
    CoverageError
        If there are no points to write.
    OutputError
        If there is something already, and `force` is false or it is something else, or if the
        store is not whole when it is read back.

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
    """Variable by variable, some chunks at a time."""
    root = create_group(target, data.attrs)
    rows = rows_of(kind, data.sizes)
    tally = SurfaceStatistics(data) if kind == "surface" else None
    entries = []
    for name, variable in data.variables.items():
        seen = tally.add if tally is not None and name == "height" else None
        array = _write_variable(root, str(name), variable, rows, seen, path)
        entries.append(
            _array_entry(str(name), array, variable.dims, coordinate=name in data.coords)
        )
    write_summary(root, entries, {} if tally is None else tally.statistics())


def _write_variable(
    root: zarr.Group,
    name: str,
    variable: xr.Variable,
    rows: str,
    seen: Callable[[Values], None] | None,
    path: Path,
) -> "zarr.Array[Any]":
    numbers, attrs = as_numbers(variable)
    array = create_array(
        root,
        name,
        dims=variable.dims,
        shape=variable.shape,
        dtype=numbers.dtype,
        attrs=attrs,
        rows=rows,
    )
    written, found = Checksums(), Checksums()
    if rows not in variable.dims:
        values = np.asarray(numbers.values)
        array[...] = values
        written.add(name, values)
        found.add(name, array[...])
        found.require_same(written, path)
        return array
    axis = variable.dims.index(rows)
    step = _AT_ONCE * array.chunks[axis]
    for start in range(0, variable.shape[axis], step):
        part = slice(start, start + step)
        values = np.asarray(numbers.isel({rows: part}).values)
        place = (*[slice(None)] * axis, part)
        array[place] = values
        written.add(name, values)
        found.add(name, array[place])
        if seen is not None:
            seen(values)
    found.require_same(written, path)
    return array


def _write_points(blocks: Iterable[xr.Dataset], target: Path, path: Path) -> None:
    taken = _BlockLayout(path)
    tally = PointStatistics()
    root: zarr.Group | None = None
    arrays: dict[str, zarr.Array[Any]] = {}
    written, found = Checksums(), Checksums()
    for columns in _whole_chunks(map(taken.columns, blocks)):
        if root is None:
            root = create_group(target, taken.attrs)
            arrays = {
                name: create_array(
                    root,
                    name,
                    dims=("point",),
                    shape=(0,),
                    dtype=values.dtype,
                    attrs=taken.first[name].attrs,
                    rows="point",
                )
                for name, values in columns.items()
            }
        start = tally.count
        tally.add(columns)
        for name, array in arrays.items():
            array.resize((tally.count,))
            array[start : tally.count] = columns[name]
            written.add(name, columns[name])
            found.add(name, array[start : tally.count])
    if root is None:
        raise CoverageError("there are no points to write", path=path)
    found.require_same(written, path)
    root.attrs.put(plain_attrs(taken.attrs, "the dataset"))
    bounds = tally.bounds()
    create_array(
        root,
        BOUNDS,
        dims=("chunk", "edge"),
        shape=bounds.shape,
        dtype=bounds.dtype,
        attrs={"edges": "west, south, east, north", "units": "m"},
        rows="chunk",
    )[...] = bounds
    entries = [
        _array_entry(name, array, ("point",), coordinate=name in taken.coordinates)
        for name, array in arrays.items()
    ]
    write_summary(root, entries, tally.statistics())


class _BlockLayout:
    """What the blocks of points have in common."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.first: dict[str, xr.Variable] = {}
        self.coordinates: set[str] = set()
        self.attrs: dict[Any, Any] = {}

    def columns(self, block: xr.Dataset) -> dict[str, Values]:
        """Columns of a block, which must be as those of the blocks before."""
        check_points(block, path=self._path)
        found = {str(name): variable for name, variable in block.variables.items()}
        for name, variable in found.items():
            if variable.dims != ("point",):
                rule = f"must have the dimension (point), got {variable.dims}"
                raise SchemaError(rule, path=self._path, place=f"variable {name}")
        if not self.first:
            # without their values, but for a row: blocks are many
            self.first = {name: variable[:1].copy() for name, variable in found.items()}
            self.coordinates = {str(name) for name in block.coords}
        else:
            self._require_alike(found, block)
        self.attrs = dict(block.attrs)
        return {name: np.asarray(found[name].values) for name in self.first}

    def _require_alike(self, found: dict[str, xr.Variable], block: xr.Dataset) -> None:
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
    """Blocks of whole chunks, but for the last: a store does not depend on the size of blocks."""
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
