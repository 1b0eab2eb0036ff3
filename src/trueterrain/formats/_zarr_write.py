"""Writing arrays of Zarr 3 stores: codecs, chunks and attributes, common to runs and stores."""

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import zarr
from zarr.codecs import BloscCodec, Crc32cCodec


def create_array(
    root: zarr.Group,
    name: str,
    *,
    shape: tuple[int, ...],
    chunks: tuple[int, ...],
    dtype: Any,
    fill: Any,
    compressors: list[Any],
    dims: Sequence[Any],
    attrs: Mapping[str, Any],
) -> "zarr.Array[Any]":
    """Create an array without values.

    Chunks are always written, also if all their values are the fill value: so a missing chunk is
    known to be lost.

    Parameters
    ----------
    root : zarr.Group
        The store.
    name : str
        Path of the array in the store.
    shape, chunks : tuple of int
        Shape of the array and of its chunks.
    dtype : dtype
        Type of the values.
    fill : number or None
        Value of missing chunks for readers that do not look for them; None: see
        `choose_fill_value`.
    compressors : list
        Codecs, see `make_compressors`.
    dims : sequence of str
        Names of the dimensions.
    attrs : mapping
        Attributes, as JSON can hold them.
    """
    return root.create_array(
        name,
        shape=shape,
        chunks=chunks,
        dtype=dtype,
        fill_value=choose_fill_value(dtype) if fill is None else np.dtype(dtype).type(fill),
        compressors=compressors,
        dimension_names=[str(dim) for dim in dims],
        attributes=dict(attrs),
        chunk_key_encoding={"name": "default", "separator": "."},
        config={"write_empty_chunks": True},
    )


def make_compressors(level: int, shuffle: str) -> list[Any]:
    """Codecs of every array that is written: compression by zstd, and a checksum of each chunk."""
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
