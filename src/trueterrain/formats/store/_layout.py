"""How a dataset lies in a store, and whether a store is whole."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr
import zarr
from zarr.codecs import BloscCodec, Crc32cCodec

from trueterrain.errors import FormatError, SchemaError
from trueterrain.formats.signature import kind_of_store
from trueterrain.kinds import SCHEMA

CHUNK = 250_000  # values; blocks of a million points are made of whole chunks

#: Group that lists the arrays.
SUMMARY = "summary"

#: Array in it with least and greatest easting and northing of the points in each chunk.
BOUNDS = f"{SUMMARY}/bounds"

_TEXTS = "texts"  # attribute of an array of numbers that stand for texts
_CURE = "Copy the whole folder again."

# whatever the library raises over a store that is not as it was written
ERRORS = (ValueError, KeyError, OSError, TypeError, RuntimeError, AttributeError, IndexError)

Values = npt.NDArray[Any]


@dataclass(frozen=True, kw_only=True)
class Entry:
    """What the summary says of an array."""

    name: str
    dims: list[str]
    shape: list[int]
    dtype: str
    coordinate: bool


@dataclass(frozen=True, kw_only=True)
class Stored:
    """A store that is open, and has been found to be whole."""

    path: Path
    kind: str
    attrs: dict[str, Any]
    entries: list[Entry]
    statistics: dict[str, Any]
    arrays: dict[str, "zarr.Array[Any]"]
    bounds: "zarr.Array[Any] | None"
    strange: list[str]
    "Names of arrays and groups that the summary does not know."

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
        return self._values(self.arrays[name], f"array {name}", rows)

    def chunk_bounds(self) -> Values:
        """Bounds of each chunk of points, shape (chunk, 4) [m]."""
        assert self.bounds is not None
        return self._values(self.bounds, f"array {BOUNDS}", slice(None))

    def _values(self, array: "zarr.Array[Any]", place: str, rows: slice) -> Values:
        try:
            return np.asarray(array[rows] if array.ndim else array[...])
        except ERRORS as error:
            first, last, _ = rows.indices(array.shape[0] if array.ndim else 1)
            where = f"{place}, rows {first} to {last - 1}"
            raise damaged(self.path, where, _in_words(error)) from None

    def variable(self, entry: Entry, rows: slice = slice(None)) -> xr.Variable:
        """An array as it was before it was written."""
        attrs = dict(self.arrays[entry.name].attrs)
        values = self.values(entry.name, rows)
        texts = attrs.pop(_TEXTS, None)
        if texts is not None:
            try:
                values = np.array(texts, dtype=str)[values]
            except (IndexError, ValueError):
                raise damaged(self.path, f"array {entry.name}", "numbers without text") from None
        return xr.Variable(entry.dims, values, attrs)


def rows_of(kind: str, dims: Mapping[Any, Any] | tuple[Any, ...]) -> str:
    """Dimension along which a kind of data is chunked."""
    if kind == "surface":
        return "u" if "u" in dims else "northing"
    return {"points": "point", "profile": "s"}[kind]


def create_group(path: Path, attrs: Mapping[Any, Any]) -> zarr.Group:
    """Group with the attributes of a dataset."""
    return zarr.create_group(path, zarr_format=3, attributes=plain_attrs(attrs, "the dataset"))


def create_array(
    root: zarr.Group,
    name: str,
    *,
    dims: tuple[Any, ...],
    shape: tuple[int, ...],
    dtype: Any,
    attrs: Mapping[Any, Any],
    rows: str,
) -> "zarr.Array[Any]":
    """Array without values, in chunks along the dimension `rows`."""
    dtype = np.dtype(dtype).newbyteorder("=")
    if dtype.kind not in "fiub":
        raise SchemaError(f"must hold numbers, got {dtype}", place=f"variable {name}")
    others = [length for dim, length in zip(dims, shape, strict=True) if dim != rows]
    along = max(1, CHUNK // max(1, int(np.prod(others))))
    chunks = tuple(
        along if dim == rows else max(1, length) for dim, length in zip(dims, shape, strict=True)
    )
    return root.create_array(
        name,
        shape=shape,
        chunks=chunks,
        dtype=dtype,
        fill_value=dtype.type(0),
        # bytes of the same weight side by side: as quick as without, and half the size
        compressors=[BloscCodec(cname="zstd", clevel=3, shuffle="shuffle"), Crc32cCodec()],
        dimension_names=[str(dim) for dim in dims],
        attributes=plain_attrs(attrs, f"variable {name}"),
        chunk_key_encoding={"name": "default", "separator": "."},
        # so that a chunk that is missing is known to be lost
        config={"write_empty_chunks": True},
    )


def as_numbers(variable: xr.Variable) -> tuple[Any, dict[Any, Any]]:
    """Variable and attributes to write; numbers stand for texts, which Zarr 3 knows no type for."""
    if variable.dtype.kind not in "UOT":
        return variable, dict(variable.attrs)
    values = np.asarray(variable.values)
    if not all(isinstance(value, str) for value in values.ravel()):
        return variable, dict(variable.attrs)  # neither numbers nor texts: refused as such
    texts, index = np.unique(values.astype(str), return_inverse=True)
    numbers = xr.Variable(variable.dims, index.reshape(values.shape).astype(np.int32))
    return numbers, {**variable.attrs, _TEXTS: texts.tolist()}


def plain_attrs(attrs: Mapping[Any, Any], place: str) -> dict[str, Any]:
    """Attributes as JSON keeps them."""
    try:
        plain = json.loads(json.dumps(dict(attrs), default=_plain))
    except TypeError as error:
        cure = "Keep numbers, texts, lists and tables of them only."
        raise SchemaError(f"attributes: {error}", place=place, cure=cure) from None
    return dict(plain)


def write_summary(root: zarr.Group, entries: list[Entry], statistics: Mapping[str, Any]) -> None:
    """Write what must be there, when all of it is."""
    summary = {"variables": [asdict(entry) for entry in entries], "statistics": dict(statistics)}
    root.require_group(SUMMARY).attrs.update(plain_attrs(summary, SUMMARY))


def opened(path: str | Path) -> Stored:
    """Open a store.

    Raises
    ------
    FormatError
        If it is no store of points, a surface or a profile, of a newer schema, or not whole.
    """
    path = Path(path)
    kind = kind_of_store(path)
    if kind == "run":
        raise FormatError(
            "is a recorded run", path=path,
            cure="Open it with open_run, or grid it: `trueterrain grid`.",
        )  # fmt: skip
    try:
        root = zarr.open_group(path, mode="r")
        attrs = dict(root.attrs)
    except ERRORS as error:
        raise damaged(path, "zarr.json", _in_words(error)) from None
    if attrs.get("schema") != SCHEMA:
        raise FormatError(
            f"must be {SCHEMA}, got {attrs.get('schema')!r}", path=path, place="attribute schema",
            cure="If it is newer, update trueterrain.",
        )  # fmt: skip
    try:
        about = dict(root[SUMMARY].attrs)
        entries = [Entry(**entry) for entry in about["variables"]]  # type: ignore[arg-type, union-attr]  # checked by TypeError
        statistics = dict(about["statistics"])  # type: ignore[arg-type]  # so is this
    except ERRORS as error:
        raise damaged(path, f"group {SUMMARY}", _in_words(error)) from None
    arrays = {entry.name: _array(root, entry.name, path, entry) for entry in entries}
    known = {*arrays, SUMMARY}
    return Stored(
        path=path,
        kind=kind,
        attrs=attrs,
        entries=entries,
        statistics=statistics,
        arrays=arrays,
        bounds=_array(root, BOUNDS, path) if kind == "points" else None,
        strange=sorted(part.name for part in path.iterdir() if part.is_dir()
                       and part.name not in known),
    )  # fmt: skip


def damaged(path: Path, place: str, how: str) -> FormatError:
    """Error of a store that is not as it was written."""
    return FormatError(f"is damaged ({how})", path=path, place=place, cure=_CURE)


def _array(
    root: zarr.Group, name: str, path: Path, entry: Entry | None = None
) -> "zarr.Array[Any]":
    """Array of a store, whose chunks are all there."""
    place = f"array {name}"
    if not (path / name / "zarr.json").is_file():
        raise FormatError("is missing", path=path, place=place, cure=_CURE)
    try:
        array = root[name]
        found = array.nchunks_initialized  # type: ignore[union-attr]  # a group has none: an error
    except ERRORS as error:
        raise damaged(path, place, _in_words(error)) from None
    assert isinstance(array, zarr.Array)
    if entry is not None:
        names = getattr(array.metadata, "dimension_names", None) or ()
        is_ = (list(names), list(array.shape), str(array.dtype))
        was = (entry.dims, entry.shape, entry.dtype)
        if is_ != was:
            how = " instead of ".join(f"{d} {s} {t}" for d, s, t in (is_, was))
            raise damaged(path, place, how)
    if found < array.nchunks:
        raise FormatError(
            f"{array.nchunks - found} of {array.nchunks} chunks are missing", path=path,
            place=place, cure=_CURE,
        )  # fmt: skip
    return array


def _in_words(error: Exception) -> str:
    return " ".join(str(error).split()).rstrip(".")[:120] or type(error).__name__


def _plain(value: Any) -> Any:
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    message = f"{type(value).__name__} cannot be kept in a store"
    raise TypeError(message)
