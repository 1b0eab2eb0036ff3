"""Zarr store of a run, whose arrays are appended to block by block."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import zarr

from trueterrain.core import Checksums
from trueterrain.core.schemas.run import ROW_CHUNK
from trueterrain.formats._zarr import ARRAYS
from trueterrain.formats._zarr_write import create_array, json_attrs, make_compressors

_CHUNK_VALUES = 1_000_000  # largest number of values in a chunk of several dimensions

Array = npt.NDArray[Any]


class AppendableStore:
    """Zarr store with arrays that grow along their first dimension.

    Rows are buffered until they fill a chunk: so memory stays flat, each chunk is written once, and
    blocks of any size give the same bytes.
    """

    def __init__(self, path: Path, attrs: Mapping[str, Any]) -> None:
        self._root = zarr.create_group(path, zarr_format=3, attributes=dict(attrs))
        self._rows: dict[str, _RowBuffer] = {}
        self._needed: list[str] = []
        self._arrays: list[zarr.Array[Any]] = []
        self._written = Checksums()

    def names(self, group: str) -> set[str]:
        """Names of the growing arrays of a group."""
        prefix = f"{group}/"
        return {path.removeprefix(prefix) for path in self._rows if path.startswith(prefix)}

    def set_attrs(self, group: str, attrs: Mapping[Any, Any]) -> None:
        """Attributes of a group."""
        self._root.require_group(group).attrs.update(json_attrs(attrs))

    def write(
        self, path: str, values: Array, dims: Sequence[Any], attrs: Mapping[Any, Any]
    ) -> None:
        """Write an array at once."""
        chunk = max(1, min(values.shape[0], _rows_of(values.shape))) if values.ndim else 1
        array = self._create(path, values.shape, chunk, values.dtype, dims, attrs)
        array[...] = values
        self._written.add(array.path, values)

    def grow(
        self,
        path: str,
        like: Array,
        dims: Sequence[Any],
        attrs: Mapping[Any, Any],
        *,
        chunk: int | None = None,
        fill: float | None = None,
    ) -> None:
        """Create an array without rows; shape and type of a row are those of `like`."""
        chunk = chunk or _rows_of(like.shape)
        shape = (0, *like.shape[1:])
        array = self._create(path, shape, chunk, like.dtype, dims, attrs, fill)
        self._rows[path] = _RowBuffer(array, self._written)

    def append(self, path: str, rows: Array) -> None:
        """Append rows to an array."""
        self._rows[path].append(rows)

    def close(self, path: Path) -> None:
        """Write the buffered rows, and read all back; errors name `path`, that of the output."""
        for rows in self._rows.values():
            rows.close()
        self._root.attrs[ARRAYS] = sorted(self._needed)
        found = Checksums()
        for array in self._arrays:
            if array.ndim == 0:
                found.add(array.path, array[...])
                continue
            for start in range(0, array.shape[0], array.chunks[0]):
                found.add(array.path, array[start : start + array.chunks[0]])
        found.require_same(self._written, path)

    def _create(
        self,
        path: str,
        shape: tuple[int, ...],
        chunk: int,
        dtype: Any,
        dims: Sequence[Any],
        attrs: Mapping[Any, Any],
        fill: float | None = None,
    ) -> zarr.Array[Any]:
        if np.dtype(dtype).kind not in "fiub":
            message = f"{path} must hold numbers, got {dtype}."
            raise ValueError(message)
        if not path.startswith("truth/"):  # the truth may be removed from a run
            self._needed.append(path)
        chunks = (chunk, *(max(1, n) for n in shape[1:])) if shape else ()
        array = create_array(
            self._root,
            path,
            shape=shape,
            chunks=chunks,
            dtype=dtype,
            fill=fill,
            # a fast level; bitshuffle, since neighbouring ranges differ in few of their low bits
            compressors=make_compressors(1, "bitshuffle"),
            dims=dims,
            attrs=json_attrs(attrs),
        )
        self._arrays.append(array)
        return array


class _RowBuffer:
    """Buffer of the rows of an array, written in whole chunks."""

    def __init__(self, array: zarr.Array[Any], written: Checksums) -> None:
        self._array = array
        self._chunk = array.chunks[0]
        self._waiting = np.empty((self._chunk, *array.shape[1:]), dtype=array.dtype)
        self._filled = 0
        self._written = 0
        self._checksums = written

    def append(self, values: Array) -> None:
        """Append rows; whole chunks are written, the rest is buffered."""
        start = 0
        while start < len(values):
            if self._filled == 0 and len(values) - start >= self._chunk:
                end = start + (len(values) - start) // self._chunk * self._chunk
                self._write(values[start:end])
            else:
                end = min(len(values), start + self._chunk - self._filled)
                self._waiting[self._filled : self._filled + end - start] = values[start:end]
                self._filled += end - start
                if self._filled == self._chunk:
                    self.close()
            start = end

    def close(self) -> None:
        """Write the buffered rows."""
        if self._filled:
            self._write(self._waiting[: self._filled])
            self._filled = 0

    def _write(self, rows: Array) -> None:
        end = self._written + len(rows)
        self._array.resize((end, *self._array.shape[1:]))
        self._array[self._written : end] = rows
        self._written = end
        self._checksums.add(self._array.path, np.asarray(rows, dtype=self._array.dtype))


def _rows_of(shape: tuple[int, ...]) -> int:
    """Number of rows in a chunk."""
    return max(1, min(ROW_CHUNK, _CHUNK_VALUES // max(1, int(np.prod(shape[1:])))))
