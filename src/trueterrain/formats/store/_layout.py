"""Layout of a store: its arrays, their chunks and its summary; opening a store with checks."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr
import zarr

from trueterrain.core.errors import FormatError, SchemaError
from trueterrain.core.schemas import SCHEMA
from trueterrain.formats._zarr import (
    StoredArray,
    damaged_error,
    read_group_attrs,
)
from trueterrain.formats._zarr_write import StoreWriter, json_attrs
from trueterrain.formats.signature import kind_of_store

CHUNK = 250_000  # values in a chunk; blocks of a million points consist of whole chunks

#: Group that lists the arrays.
SUMMARY = "summary"

#: Array in it with minimum and maximum of easting and northing of the points in each chunk.
BOUNDS = f"{SUMMARY}/bounds"

_TEXTS = "texts"  # attribute of an array of integers: the texts that they stand for

# required variables of each kind of data
_NEEDED = {"points": ("easting", "northing", "up"), "surface": ("height",), "profile": ("height",)}

Values = npt.NDArray[Any]


@dataclass(frozen=True, kw_only=True)
class ArrayEntry:
    """Description of an array in the summary."""

    name: str
    dims: list[str]
    shape: list[int]
    dtype: str
    coordinate: bool


@dataclass(frozen=True, kw_only=True)
class _PointStatistics:
    count: int
    extent: dict[str, tuple[float, float]]
    time: tuple[float, float] | None
    not_finite: int
    lanes: dict[str, int] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class _SurfaceStatistics:
    extent: dict[str, tuple[float, float] | None]
    missing: float


_STATISTICS: dict[str, Any] = {
    "points": _PointStatistics,
    "surface": _SurfaceStatistics,
    "profile": dict[str, Any],
}


@dataclass(frozen=True, kw_only=True)
class OpenedStore:
    """Open store, in which no array or chunk is missing."""

    path: Path
    kind: str
    attrs: dict[str, Any]
    entries: list[ArrayEntry]
    statistics: dict[str, Any]
    arrays: dict[str, StoredArray]
    bounds: StoredArray | None
    unlisted: list[str]
    "Names of arrays and groups that the summary does not list."

    @property
    def sizes(self) -> dict[str, int]:
        """Length of each dimension."""
        return {
            dim: length
            for entry in self.entries
            for dim, length in zip(entry.dims, entry.shape, strict=True)
        }

    def values(self, name: str, rows: slice = slice(None)) -> Values:
        """Values of an array, or rows of it."""
        array = self.arrays[name]
        return array.read(rows if array.shape else ...)

    def chunk_bounds(self) -> Values:
        """Bounds of each chunk of points, shape (chunk, 4) [m]."""
        assert self.bounds is not None
        return self.bounds.read()

    def variable(self, entry: ArrayEntry, rows: slice = slice(None)) -> xr.Variable:
        """Variable of an array, or rows of it, as it was written."""
        attrs = dict(self.arrays[entry.name].attrs)
        values = self.values(entry.name, rows)
        texts = attrs.pop(_TEXTS, None)
        if texts is not None:
            try:
                values = np.array(texts, dtype=str)[values]
            except (IndexError, ValueError, TypeError):
                raise damaged_error(
                    self.path, f"array {entry.name}", "numbers without text"
                ) from None
        return xr.Variable(entry.dims, values, attrs)


def rows_of(kind: str, dims: Mapping[Any, Any] | tuple[Any, ...]) -> str:
    """Dimension along which a kind of data is chunked."""
    if kind == "surface":
        return "u" if "u" in dims else "northing"
    return {"points": "point", "profile": "s"}[kind]


def create_store(path: Path, attrs: Mapping[Any, Any]) -> StoreWriter:
    """Create a store with the attributes of a dataset."""
    # shuffling the bytes by their significance halves the size and costs no time
    return StoreWriter(path, plain_attrs(attrs, "the dataset"), level=3, shuffle="shuffle")


def create_array(
    store: StoreWriter,
    name: str,
    *,
    dims: tuple[Any, ...],
    shape: tuple[int, ...],
    dtype: Any,
    attrs: Mapping[Any, Any],
    rows: str,
) -> "zarr.Array[Any]":
    """Create an array without values, in chunks along the dimension `rows`."""
    dtype = np.dtype(dtype).newbyteorder("=")
    if dtype.kind not in "fiub":
        raise SchemaError(f"must hold numbers, got {dtype}", place=f"variable {name}")
    others = [length for dim, length in zip(dims, shape, strict=True) if dim != rows]
    along = max(1, CHUNK // max(1, int(np.prod(others))))
    chunks = tuple(
        along if dim == rows else max(1, length) for dim, length in zip(dims, shape, strict=True)
    )
    return store.create_array(
        name,
        shape=shape,
        chunks=chunks,
        dtype=dtype,
        dims=dims,
        attrs=plain_attrs(attrs, f"variable {name}"),
    )


def as_numbers(variable: xr.Variable) -> tuple[Any, dict[Any, Any]]:
    """Variable and attributes to write; texts become integers, as Zarr 3 has no type for them."""
    if variable.dtype.kind not in "UOT":
        return variable, dict(variable.attrs)
    values = np.asarray(variable.values)
    if not all(isinstance(value, str) for value in values.ravel()):
        return variable, dict(variable.attrs)  # neither numbers nor texts: refused on writing
    texts, index = np.unique(values.astype(str), return_inverse=True)
    numbers = xr.Variable(variable.dims, index.reshape(values.shape).astype(np.int32))
    return numbers, {**variable.attrs, _TEXTS: texts.tolist()}


def plain_attrs(attrs: Mapping[Any, Any], place: str) -> dict[str, Any]:
    """Attributes as JSON holds them; a SchemaError names a type that JSON cannot hold."""
    try:
        return json_attrs(attrs, _refuse_attribute)
    except TypeError as error:
        cure = "Keep numbers, texts, lists and tables of them only."
        raise SchemaError(f"attributes: {error}", place=place, cure=cure) from None


def write_summary(
    store: StoreWriter, entries: list[ArrayEntry], statistics: Mapping[str, Any]
) -> None:
    """Write the summary; it comes last, so that a store without it is incomplete."""
    summary = {"variables": [asdict(entry) for entry in entries], "statistics": dict(statistics)}
    store.root.require_group(SUMMARY).attrs.update(plain_attrs(summary, SUMMARY))


def open_store(path: str | Path) -> OpenedStore:
    """Open a store.

    Raises
    ------
    FormatError
        If it is not a store of points, a surface or a profile, has a newer schema, or lacks chunks.
    """
    path = Path(path)
    kind = kind_of_store(path)
    if kind == "run":
        raise FormatError(
            "is a recorded run",
            path=path,
            cure="Open it with open_run, or grid it: `trueterrain grid`.",
        )
    attrs = read_group_attrs(path)
    if attrs.get("schema") != SCHEMA:
        raise FormatError(
            f"must be {SCHEMA}, got {attrs.get('schema')!r}",
            path=path,
            place="attribute schema",
            cure="If it is newer, update trueterrain.",
        )
    entries, statistics = _read_summary(path, kind)
    arrays = {entry.name: _open_array(path, entry) for entry in entries}
    return OpenedStore(
        path=path,
        kind=kind,
        attrs=attrs,
        entries=entries,
        statistics=statistics,
        arrays=arrays,
        bounds=_chunk_bounds(path, arrays["easting"]) if kind == "points" else None,
        unlisted=sorted(
            part.name
            for part in path.iterdir()
            if part.is_dir() and part.name not in {*arrays, SUMMARY}
        ),
    )


def _is_folder_name(name: str) -> bool:
    """Whether a name is that of a folder in the store, not a path out of it."""
    return name.strip(". ") != "" and not set(name) & set("/\\\0")


def _read_summary(path: Path, kind: str) -> tuple[list[ArrayEntry], dict[str, Any]]:
    """Read the summary: descriptions of the arrays, and statistics."""
    from pydantic import TypeAdapter, ValidationError

    place = f"group {SUMMARY}"
    if not (path / SUMMARY / "zarr.json").is_file():
        raise damaged_error(path, place, "it is missing")
    about = read_group_attrs(path, SUMMARY)
    try:
        variables, statistics = (json.dumps(about.get(n)) for n in ("variables", "statistics"))
        entries = TypeAdapter(list[ArrayEntry]).validate_json(variables, strict=True)
        TypeAdapter(_STATISTICS[kind]).validate_json(statistics, strict=True)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise damaged_error(path, place, f"{where}: {first['msg']}") from None
    names = [entry.name for entry in entries]
    wrong = [name for name in _NEEDED[kind] if name not in names]
    wrong += [name for name in names if names.count(name) > 1 or not _is_folder_name(name)]
    if wrong:
        raise damaged_error(path, place, f"array {wrong[0]!r} is not listed once")
    return entries, dict(about["statistics"])


def _open_array(path: Path, entry: ArrayEntry) -> StoredArray:
    """Open an array; raise unless it agrees with the summary and no chunk is missing."""
    array = StoredArray(path, entry.name)
    is_ = (list(array.dims), list(array.shape), str(array.dtype))
    was = (entry.dims, entry.shape, entry.dtype)
    if is_ != was:
        how = " instead of ".join(f"{d} {s} {t}" for d, s, t in (is_, was))
        raise damaged_error(path, f"array {entry.name}", how)
    array.require_chunks()
    return array


def _chunk_bounds(path: Path, points: StoredArray) -> StoredArray:
    """Open the array of the bounds of the chunks of points."""
    bounds = StoredArray(path, BOUNDS)
    chunks = -(-points.shape[0] // CHUNK)
    if bounds.shape != (chunks, 4):
        how = f"shape {list(bounds.shape)} instead of {[chunks, 4]}"
        raise damaged_error(path, f"array {BOUNDS}", how)
    bounds.require_chunks()
    return bounds


def _refuse_attribute(value: Any) -> Any:
    """Raise a TypeError: JSON cannot hold a value of this type."""
    message = f"{type(value).__name__} cannot be kept in a store"
    raise TypeError(message)
