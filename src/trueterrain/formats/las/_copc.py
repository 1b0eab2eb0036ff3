"""Spatial queries of COPC files: only the nodes of the octree that touch the bounds are read."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import numpy.typing as npt
from laspy.copc import Bounds as Box
from laspy.copc import CopcInfoVlr, CopcReader, load_octree_for_query

from trueterrain.formats._bounds import Bounds
from trueterrain.formats.las._open import LasChunk, damage_named, read_chunk_table

_LARGEST = 2**31 - 1  # largest integer coordinate of LAS


def is_copc(header: Any) -> bool:
    """Whether a file is a Cloud Optimized Point Cloud."""
    return len(header.vlrs) > 0 and isinstance(header.vlrs[0], CopcInfoVlr)


def query_nodes(path: Path, bounds: Bounds, size: int, selection: Any) -> Iterator[Any]:
    """Yield records of the points within bounds, of about `size` points at most.

    At each level of the octree, a box that touches nodes with too many points is halved
    recursively. The cuts lie between integer coordinates, so that each point belongs to exactly
    one record.
    """
    with damage_named(path, "COPC header"):
        reader = CopcReader.open(path, decompression_selection=selection)
    with reader, damage_named(path, "COPC"):
        header = reader.header
        _require_cube(reader)
        chunks = set(read_chunk_table(path, header, reader.laszip_vlr))
        west, south, east, north = bounds
        low = _integer_coordinates(header, np.array([west, south, -np.inf]), np.floor)
        high = _integer_coordinates(header, np.array([east, north, np.inf]), np.ceil)
        with damage_named(path, "COPC hierarchy"):
            nodes = _octree_nodes(reader, low, high, None)
            for node in nodes:
                # laspy allocates as many bytes and points as a node states: check them first
                chunk = LasChunk(node.offset, node.byte_size, node.point_count)
                if chunk not in chunks:
                    message = f"{node.key} is no chunk of the file: {chunk}"
                    raise ValueError(message)
        for level in sorted({node.key.level for node in nodes}):
            yield from _query_parts(reader, path, low, high, level, size)


def _query_parts(
    reader: Any,
    path: Path,
    low: npt.NDArray[np.int64],
    high: npt.NDArray[np.int64],
    level: int,
    size: int,
) -> Iterator[Any]:
    with damage_named(path, f"COPC hierarchy, level {level}"):
        nodes = _octree_nodes(reader, low, high, level)
    count = sum(node.point_count for node in nodes)
    if count == 0:
        return
    if count > size and len(nodes) > 1:
        # cut the box around the nodes in halves, along a face of the cells of the octree
        header = reader.header
        mins = np.min([node.bounds.mins for node in nodes], axis=0)
        maxs = np.max([node.bounds.maxs for node in nodes], axis=0)
        side = nodes[0].bounds.maxs[0] - nodes[0].bounds.mins[0]
        axis = int(np.argmax(maxs - mins))
        cells = round(float((maxs - mins)[axis] / side))
        plane = mins[axis] + side * max(1, cells // 2)
        cut = int(np.floor((plane - header.offsets[axis]) / header.scales[axis]))
        if low[axis] <= cut < high[axis]:
            left, right = high.copy(), low.copy()
            left[axis], right[axis] = cut, cut + 1
            yield from _query_parts(reader, path, low, left, level, size)
            yield from _query_parts(reader, path, right, high, level, size)
            return
    with damage_named(path, f"COPC level {level}"):
        record = reader.query(bounds=_query_box(reader.header, low, high), level=level)
    for start in range(0, len(record), size):
        yield laspy.ScaleAwarePointRecord(
            record.array[start : start + size],
            record.point_format,
            reader.header.scales,
            reader.header.offsets,
        )


def _octree_nodes(
    reader: Any, low: npt.NDArray[np.int64], high: npt.NDArray[np.int64], level: int | None
) -> list[Any]:
    nodes = load_octree_for_query(
        _Pages(reader.source),
        reader.copc_info,
        reader.root_page,
        query_bounds=_query_box(reader.header, low, high),
        level_range=None if level is None else range(level, level + 1),
    )
    return [node for node in nodes if node.point_count > 0]


class _Pages:
    """Source of the pages of the hierarchy; refuses pages of impossible size and circular ones."""

    def __init__(self, source: Any) -> None:
        self._source = source
        self._left = source.seek(0, os.SEEK_END)

    def seek(self, offset: int) -> None:
        self._source.seek(offset)

    def read(self, size: int) -> bytes:
        if not 0 < size <= self._left:
            message = f"a page of {size} bytes, where {self._left} can be"
            raise ValueError(message)
        self._left -= size
        page: bytes = self._source.read(size)
        return page


def _require_cube(reader: Any) -> None:
    """Raise a ValueError if the cube of the octree is not finite or has no size."""
    info = reader.copc_info
    if not (np.isfinite(info.center).all() and 0 < info.halfsize < np.inf):
        message = f"a cube of {2 * info.halfsize} m around {info.center}"
        raise ValueError(message)


def _query_box(header: Any, low: npt.NDArray[np.int64], high: npt.NDArray[np.int64]) -> Any:
    # a quarter of a step wider, so that rounding does not lose points on the faces
    mins = (low - 0.25) * header.scales + header.offsets
    maxs = (high + 0.25) * header.scales + header.offsets
    return Box(mins, maxs)


def _integer_coordinates(header: Any, values: npt.NDArray[np.float64], towards: Any) -> Any:
    steps = towards((values - header.offsets) / header.scales)
    # one step within the range of the integers, since _query_box widens by a quarter
    return np.clip(steps, -_LARGEST + 1, _LARGEST - 1).astype(np.int64)
