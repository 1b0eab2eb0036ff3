"""Open Zarr 3 stores safely: sizes are checked before anything is read.

The library reads missing chunks as zeros, and raises exceptions of many types over damaged ones.
Here both are FormatErrors that name the array and the chunk. On opening, the chunks are compared
with the files of the folder; only the first bytes of one chunk of each array are read.
"""

import itertools
import json
import math
import os
import re
import struct
import sys
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import zarr
from xarray.backends import BackendArray
from xarray.core import indexing
from zarr.codecs import BloscCodec, BytesCodec
from zarr.storage import LocalStore

from trueterrain.core.errors import FormatError

#: Attribute of a store that lists its required arrays.
ARRAYS = "arrays"

Values = npt.NDArray[Any]

_CURE = "Copy the whole folder again."
_LARGEST_CHUNK = 2**31 - 1  # [bytes] limit of the compressor
_AT_ONCE = 1 << 25  # [bytes] read at a time to verify an array
_HEADER = struct.Struct("<4xIII")  # of Blosc: size, block size, compressed size [bytes]
_CHUNK_NAME = re.compile(r"(c|\d+)([./]\d+)*")
_CF_NUMBERS = ("scale_factor", "add_offset", "_FillValue", "missing_value")


def damaged_error(path: str | Path, place: str, error: Exception | str) -> FormatError:
    """Error for a store that differs from what was written."""
    words = " ".join(str(error).split()).rstrip(".")[:160] or type(error).__name__
    if "computed checksum do not match" in words:
        words = "its checksum is not that of its content"
    return FormatError(f"is damaged ({words})", path=path, place=place, cure=_CURE)


class StoredArray(BackendArray):
    """Array of a store; errors in reading name it and the chunk.

    Parameters
    ----------
    path : Path
        Folder of the store.
    name : str
        Path of the array in it.

    Raises
    ------
    FormatError
        If the array is missing, its metadata are damaged, or a chunk of it is missing.
    """

    def __init__(self, path: Path, name: str) -> None:
        self._path, self.name = path, name
        self._place = f"array {name}"
        if not (path / name / "zarr.json").is_file():
            raise FormatError("is missing", path=path, place=self._place, cure=_CURE)
        try:
            self._array: zarr.Array[Any] = zarr.open_array(
                _Chunks(path, read_only=True), path=name, mode="r", zarr_format=3
            )
            self.attrs: dict[str, Any] = dict(self._array.attrs)
            if isinstance(self.attrs.get("_FillValue"), str):
                del self.attrs["_FillValue"]  # NaN as written by xarray, which needs no decoding
            self.shape = tuple(int(length) for length in self._array.shape)
            self.dtype = np.dtype(self._array.dtype)
            self.chunks = tuple(map(int, self._array.shards or self._array.chunks))
            metadata: Any = self._array.metadata
            self._codecs = tuple(metadata.codecs)
            self.dims = tuple(map(str, metadata.dimension_names or ()))
        except Exception as error:  # damaged metadata raise exceptions of many types
            raise damaged_error(path, self._place, error) from None
        self._is_whole = False
        self._check_metadata()

    def __getitem__(self, key: Any) -> Values:
        """Values of a part, for the lazy indexing of xarray."""
        found: Values = indexing.explicit_indexing_adapter(
            key, self.shape, indexing.IndexingSupport.OUTER, self.read
        )
        return found

    def read(self, key: Any = ...) -> Values:
        """Read the values of a part, after a check that no chunk is missing.

        Parameters
        ----------
        key : index or tuple of indices
            Whole numbers and slices, or arrays of whole numbers.

        Returns
        -------
        numpy.ndarray
            In memory.

        Raises
        ------
        FormatError
            Naming the first chunk that is missing or damaged.
        """
        if not self._is_whole:
            self.require_chunks()
        parts = key if isinstance(key, tuple) else (key,)
        outer = any(isinstance(part, np.ndarray | list) for part in parts)
        try:
            return np.asarray(self._array.oindex[key] if outer else self._array[key])
        except MemoryError:  # no damage: the part is too large
            raise
        except Exception as error:  # damaged chunks raise exceptions of many types
            found = self._named(error, parts)
            if found is None:  # no chunk is damaged: the index lies outside of the array
                raise
            raise found from None

    def verify_chunks(self) -> None:
        """Read every chunk; raise a FormatError at the first that is damaged.

        Chunks have a checksum, except in runs of earlier versions.
        """
        if not self.shape:
            self.read()
            return
        row = self.dtype.itemsize * math.prod(self.shape[1:]) * self.chunks[0]
        step = self.chunks[0] * max(1, _AT_ONCE // max(1, row))
        for start in range(0, self.shape[0], step):
            self.read(slice(start, start + step))

    def require_chunks(self) -> None:
        """Raise a FormatError if a chunk is missing, or there are more than the shape needs."""
        counts = self._chunk_counts()
        total = math.prod(counts)
        found = {
            name for name in _list_files(self._path / self.name) if _CHUNK_NAME.fullmatch(name)
        }
        # a generator, as a damaged shape may demand any number: the first missing chunk ends it
        names = (self._chunk_name(_index_of(number, counts)) for number in range(total))
        first = next((name for name in names if name not in found), None)
        if first is not None:
            lost = max(1, total - len(found))
            raise FormatError(
                f"{lost} of {total} chunks are missing, the first is {first}",
                path=self._path,
                place=self._place,
                cure=_CURE,
            )
        if len(found) > total:
            how = f"{len(found)} chunks, but {total} by its shape {list(self.shape)}"
            raise damaged_error(self._path, self._place, how)
        if total:
            self._check_first(self._chunk_name((0,) * len(counts)))
        self._is_whole = True

    def _check_metadata(self) -> None:
        how = ""
        if len(self.dims) != len(self.shape):
            how = f"{len(self.dims)} names for {len(self.shape)} dimensions"
        elif self.dtype.kind not in "fiub":
            how = f"{self.dtype} is no type of numbers"
        elif math.prod(self.shape) * self.dtype.itemsize > sys.maxsize:
            how = f"shape {list(self.shape)}"
        elif min((*self.shape, 0)) < 0 or min((*self.chunks, 1)) < 1:
            how = f"shape {list(self.shape)} in chunks {list(self.chunks)}"
        elif self._chunk_bytes() > _LARGEST_CHUNK:
            how = f"chunks of {self._chunk_bytes()} bytes"
        elif not all(map(self._is_number, _CF_NUMBERS)):
            how = f"{', '.join(_CF_NUMBERS)} must be numbers that {self.dtype} can hold"
        if how:
            raise damaged_error(self._path, self._place, how)

    def _is_number(self, name: str) -> bool:
        """Whether an attribute for decoding values is absent or a valid number."""
        if name not in self.attrs:
            return True
        value = self.attrs[name]
        if isinstance(value, bool) or not isinstance(value, int | float):
            return False
        if name in ("scale_factor", "add_offset"):
            return abs(value) < np.inf and (value != 0 or name == "add_offset")
        if self.dtype.kind not in "iu":
            return isinstance(value, float) or abs(value) < 2**53
        limits = np.iinfo(self.dtype)
        return isinstance(value, int) and int(limits.min) <= value <= int(limits.max)

    def _check_first(self, name: str) -> None:
        """Compare the size in a chunk with the shape of chunks, by which memory is allocated."""
        if not (isinstance(self._codecs[0], BytesCodec) and len(self._codecs) > 1):
            return
        if not isinstance(self._codecs[1], BloscCodec):
            return
        file = self._path / self.name / name
        try:
            with file.open("rb") as stream:
                start = stream.read(_HEADER.size)
        except OSError as error:
            raise damaged_error(self._path, f"{self._place}, chunk {name}", error) from None
        held = _HEADER.unpack(start)[0] if len(start) == _HEADER.size else 0
        if held != self._chunk_bytes():
            how = f"{held} bytes of values, but {self._chunk_bytes()} by its shape and type"
            raise damaged_error(self._path, f"{self._place}, chunk {name}", how)

    def _chunk_counts(self) -> list[int]:
        """Number of chunks along each dimension."""
        return [-(-n // chunk) for n, chunk in zip(self.shape, self.chunks, strict=True)]

    def _chunk_bytes(self) -> int:
        return math.prod(self.chunks) * self.dtype.itemsize

    def _chunk_name(self, index: tuple[int, ...]) -> str:
        return self._array.metadata.encode_chunk_key(index)

    def _named(self, error: Exception, parts: tuple[Any, ...]) -> FormatError | None:
        """Error that names the first chunk that cannot be read; None if all can be."""
        for index in self._touched(parts):
            part = tuple(
                slice(i * chunk, min((i + 1) * chunk, length))
                for i, chunk, length in zip(index, self.chunks, self.shape, strict=True)
            )
            try:
                self._array[part]
            except Exception as of_chunk:  # as before
                place = f"{self._place}, chunk {self._chunk_name(index)}"
                return damaged_error(self._path, place, of_chunk)
        return (
            None if isinstance(error, IndexError) else damaged_error(self._path, self._place, error)
        )

    def _touched(self, parts: tuple[Any, ...]) -> Iterator[tuple[int, ...]]:
        """Indices of the chunks that a part touches."""
        wanted = [range(count) for count in self._chunk_counts()]
        if parts and isinstance(parts[0], slice) and self.shape:
            rows = range(*parts[0].indices(self.shape[0]))
            if rows:
                low, high = min(rows[0], rows[-1]), max(rows[0], rows[-1])
                wanted[0] = range(low // self.chunks[0], high // self.chunks[0] + 1)
        return itertools.product(*wanted)


class _Chunks(LocalStore):
    """Store on disk in which a missing chunk is an error, not zeros."""

    async def get(self, key: str, *args: Any, **kwargs: Any) -> Any:
        value = await super().get(key, *args, **kwargs)
        if value is None and not key.endswith("zarr.json"):
            message = "the file is missing"
            raise FileNotFoundError(message)
        return value


def _index_of(number: int, counts: list[int]) -> tuple[int, ...]:
    """Index of a chunk by its number; the last dimension varies fastest."""
    index = []
    for count in reversed(counts):
        number, place = divmod(number, count)
        index.append(place)
    return tuple(reversed(index))


def find_damaged_chunks(arrays: Iterable[StoredArray]) -> list[str]:
    """Read every chunk of some arrays; return one line for each damaged array."""
    found = []
    for array in arrays:
        try:
            array.verify_chunks()
        except FormatError as error:
            found.append(f"{error.place}: {error.problem}. {error.cure}")
    return found


def require_whole(path: Path, arrays: Mapping[str, StoredArray]) -> None:
    """Raise a FormatError if a required array is missing, or a chunk of any array."""
    listed = read_group_attrs(path).get(ARRAYS, [])
    for name in listed if isinstance(listed, list) else [ARRAYS]:
        if name not in arrays:
            raise FormatError("is missing", path=path, place=f"array {name}", cure=_CURE)
    for array in arrays.values():
        array.require_chunks()


def open_arrays(path: Path) -> dict[str, StoredArray]:
    """Open the arrays of a store, by their path in it."""
    return {name: StoredArray(path, name) for name in _named_nodes(path, "array")}


def read_group_attrs(path: Path, name: str = "") -> dict[str, Any]:
    """Attributes of a group of a store."""
    about = _read_metadata(path, name)
    attrs = about.get("attributes", {})
    if about.get("node_type") != "group" or not isinstance(attrs, dict):
        raise damaged_error(path, _place_of(name), "it describes no group")
    return attrs


def find_groups(path: Path) -> list[str]:
    """Paths of the groups in a store; the first is the store itself, the empty path."""
    return _named_nodes(path, "group")


def _named_nodes(path: Path, kind: str) -> list[str]:
    found = []
    for folder, inner, files in os.walk(path, onerror=_raise_error):
        inner.sort()
        name = Path(folder).relative_to(path).as_posix().removeprefix(".")
        if "zarr.json" not in files:
            inner.clear()
            if any(_is_of_store(file) for file in _list_files(Path(folder))):
                raise damaged_error(path, _place_of(name), "it is missing")
            continue
        node = _read_metadata(path, name).get("node_type")
        if node not in ("group", "array"):
            raise damaged_error(path, _place_of(name), "it describes neither a group nor an array")
        if node == kind:
            found.append(name)
        if node == "array":
            inner.clear()
    return found


def _raise_error(error: OSError) -> None:
    """Raise the error of a folder that cannot be read, which `os.walk` would ignore."""
    raise error


def _is_of_store(file: str) -> bool:
    """Whether a file is metadata or a chunk of a Zarr store."""
    last = file.rpartition("/")[2]
    return last == "zarr.json" or _CHUNK_NAME.fullmatch(last) is not None


def _read_metadata(path: Path, name: str) -> Mapping[str, Any]:
    try:
        about = json.loads((path / name / "zarr.json").read_text(encoding="utf-8"))
    except (ValueError, RecursionError, OSError) as error:
        raise damaged_error(path, _place_of(name), error) from None
    if not isinstance(about, dict):
        raise damaged_error(path, _place_of(name), "it describes neither a group nor an array")
    return about


def _place_of(name: str) -> str:
    return f"{name}/zarr.json" if name else "zarr.json"


def _list_files(folder: Path, above: str = "") -> Iterator[str]:
    """Names of the regular files in a folder and its subfolders."""
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.is_dir():
                yield from _list_files(Path(entry.path), f"{above}{entry.name}/")
            elif entry.is_file():
                yield above + entry.name
