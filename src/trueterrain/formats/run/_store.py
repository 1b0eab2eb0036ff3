"""Zarr store of a run, whose arrays are appended to block by block."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import zarr

from trueterrain.core.schemas.run import ROW_CHUNK
from trueterrain.formats._zarr import ARRAYS
from trueterrain.formats._zarr_write import StoreWriter, json_attrs

_CHUNK_VALUES = 1_000_000  # largest number of values in a chunk of several dimensions

Array = npt.NDArray[Any]


class AppendableStore(StoreWriter):
    """Zarr store with arrays that grow along their first dimension.

    Rows are buffered until they fill a chunk: so memory stays flat, each chunk is written once, and
    blocks of any size give the same bytes.
    """

    def __init__(self, path: Path, attrs: Mapping[str, Any]) -> None:
        # a fast level; bitshuffle, since neighbouring ranges differ in few of their low bits
        super().__init__(path, attrs, level=1, shuffle="bitshuffle")
        self._rows: dict[str, _RowBuffer] = {}
        self._needed: list[str] = []

    def names(self, group: str) -> set[str]:
        """Names of the growing arrays of a group."""
        prefix = f"{group}/"
        return {path.removeprefix(prefix) for path in self._rows if path.startswith(prefix)}

    def set_attrs(self, group: str, attrs: Mapping[Any, Any]) -> None:
        """Attributes of a group."""
        self.root.require_group(group).attrs.update(json_attrs(attrs))

    def write(
        self, path: str, values: Array, dims: Sequence[Any], attrs: Mapping[Any, Any]
    ) -> None:
        """Write an array at once."""
        chunk = max(1, min(values.shape[0], _rows_of(values.shape))) if values.ndim else 1
        array = self._create(path, values.shape, chunk, values.dtype, dims, attrs)
        self.write_part(array, ..., values)

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
        self._rows[path] = _RowBuffer(self, array)

    def append(self, path: str, rows: Array) -> None:
        """Append rows to an array."""
        self._rows[path].append(rows)

    def close(self, path: Path) -> None:
        """Write the buffered rows; errors name `path`, that of the output."""
        for rows in self._rows.values():
            rows.close()
        self.root.attrs[ARRAYS] = sorted(self._needed)
        self.require_same(path)

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
        return self.create_array(
            path,
            shape=shape,
            chunks=chunks,
            dtype=dtype,
            dims=dims,
            attrs=json_attrs(attrs),
            fill=fill,
        )


class _RowBuffer:
    """Buffer of the rows of an array, written in whole chunks."""

    def __init__(self, store: StoreWriter, array: zarr.Array[Any]) -> None:
        self._store, self._array = store, array
        self._chunk = array.chunks[0]
        self._waiting = np.empty((self._chunk, *array.shape[1:]), dtype=array.dtype)
        self._filled = 0
        self._written = 0

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
        self._store.write_part(self._array, slice(self._written, end), rows)
        self._written = end


def _rows_of(shape: tuple[int, ...]) -> int:
    """Number of rows in a chunk."""
    return max(1, min(ROW_CHUNK, _CHUNK_VALUES // max(1, int(np.prod(shape[1:])))))
