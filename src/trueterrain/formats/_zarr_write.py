"""Writing of Zarr 3 stores: codecs, chunks, attributes and checksums, common to runs and stores."""

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import zarr
from zarr.codecs import BloscCodec, Crc32cCodec

from trueterrain.core import Checksums


class StoreWriter:
    """Writer of a store, which reads back what it writes.

    Chunks are compressed by zstd and have a checksum.

    Parameters
    ----------
    path : Path
        Folder of the store.
    attrs : mapping
        Attributes of its group, as JSON can hold them.
    level : int
        Level of the compression.
    shuffle : str
        Order of bits or bytes before it: ``"shuffle"`` or ``"bitshuffle"``.
    """

    def __init__(self, path: Path, attrs: Mapping[str, Any], *, level: int, shuffle: str) -> None:
        self.root = zarr.create_group(path, zarr_format=3, attributes=dict(attrs))
        self._compressors = make_compressors(level, shuffle)
        self._written, self._found = Checksums(), Checksums()

    def create_array(
        self,
        name: str,
        *,
        shape: tuple[int, ...],
        chunks: tuple[int, ...],
        dtype: Any,
        dims: Sequence[Any],
        attrs: Mapping[str, Any],
        fill: float | None = None,
    ) -> "zarr.Array[Any]":
        """Create an array without values.

        Chunks are always written, also if all their values are the fill value: so a missing chunk
        is known to be lost.

        Parameters
        ----------
        name : str
            Path of the array in the store.
        shape, chunks : tuple of int
            Shape of the array and of its chunks.
        dtype : dtype
            Type of the values.
        dims : sequence of str
            Names of the dimensions.
        attrs : mapping
            Attributes, as JSON can hold them.
        fill : number, optional
            Value of missing chunks for readers that do not look for them; by default NaN or 0.
        """
        return self.root.create_array(
            name,
            shape=shape,
            chunks=chunks,
            dtype=dtype,
            fill_value=choose_fill_value(dtype) if fill is None else np.dtype(dtype).type(fill),
            compressors=self._compressors,
            dimension_names=[str(dim) for dim in dims],
            attributes=dict(attrs),
            chunk_key_encoding={"name": "default", "separator": "."},
            config={"write_empty_chunks": True},
        )

    def write_part(self, array: "zarr.Array[Any]", place: Any, values: npt.NDArray[Any]) -> None:
        """Write a part of an array, in the order of its values, and read it back."""
        array[place] = values
        self._written.add(array.path, np.asarray(values, dtype=array.dtype))
        self._found.add(array.path, array[place])

    def require_same(self, path: Path) -> None:
        """Raise an OutputError that names `path` if something reads back as other values."""
        self._found.require_same(self._written, path)


def make_compressors(level: int, shuffle: str) -> list[Any]:
    """Codecs of every array: compression by zstd, and a checksum of each chunk."""
    blosc = BloscCodec(cname="zstd", clevel=level, shuffle=shuffle)  # type: ignore[arg-type]
    return [blosc, Crc32cCodec()]


def choose_fill_value(dtype: Any) -> Any:
    """Fill value of a type: NaN, or 0 for integers."""
    kind = np.dtype(dtype)
    return kind.type(np.nan if kind.kind == "f" else 0)


def json_attrs(attrs: Mapping[Any, Any], other: Callable[[Any], Any] = str) -> dict[str, Any]:
    """Attributes as JSON holds them.

    Parameters
    ----------
    attrs : mapping
        Attributes; numbers and arrays of numpy become numbers and lists.
    other : callable
        Converts a value of any other type, or raises a TypeError.
    """

    def convert(value: Any) -> Any:
        return value.tolist() if isinstance(value, np.generic | np.ndarray) else other(value)

    return dict(json.loads(json.dumps(dict(attrs), default=convert)))
