"""Ground as a fine raster, on which millions of beams a second can be cast.

The raster *is* the true ground of a simulated run: its nodes have the heights of the ground from
which it is sampled, it is bilinear between them, and the intersection of a beam with it is exact.
Tiles are computed where beams arrive, and dropped behind the vehicle.
"""

from collections import OrderedDict
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from trueterrain.simulate.ground import Ground

Float = npt.NDArray[np.float64]
Integer = npt.NDArray[np.int64]

#: Cells along the edge of a tile, and of the blocks of a tile whose highest node is kept.
TILE_CELLS = 200
BLOCK_CELLS = 10

_MAX_TILES = 400  # [1] kept, 323 kB each, unless more are requested; 5 per metre at 5 mm


@dataclass(frozen=True, kw_only=True, eq=False)
class Tiles:
    """Tiles of a raster in contiguous arrays, for the kernel that casts rays."""

    spacing: float
    "Distance of the nodes [m]."

    first: Integer
    "Column and row of the first tile of the index, shape (2,)."

    index: npt.NDArray[np.int64]
    "Slot of each tile, -1 where there is none, shape (row, column)."

    height: Float
    "Heights of the nodes, shape (slot, row, column) [m]; neighbours repeat the nodes of an edge."

    block_top: Float
    "Highest node of each block, shape (slot, row, column) [m]."

    tile_top: Float
    "Highest node of each tile, shape (slot,) [m]."


class Raster(Ground):
    """Ground that is bilinear between the nodes of a square raster.

    Parameters
    ----------
    ground : Ground
        Ground from which the nodes take their heights.
    spacing : float
        Distance of the nodes [m]; they lie at whole multiples of it.

    Examples
    --------
    >>> from trueterrain.simulate.ground import Sine
    >>> wave = Sine(amplitude=0.01, wavelength=1.0)
    >>> raster = Raster(wave, spacing=0.25)
    >>> raster.height(0.125, 0.0)  # linear between trough and crest
    array(0.005)
    """

    def __init__(self, ground: Ground, *, spacing: float = 0.005) -> None:
        if not 0 < spacing < float("inf"):
            message = f"spacing must be greater than 0 m, got {spacing}."
            raise ValueError(message)
        self.ground = ground
        self.spacing = spacing
        self._tiles: OrderedDict[tuple[int, int], tuple[Float, Float]] = OrderedDict()
        self._max_tiles = _MAX_TILES
        self._last: tuple[list[tuple[int, int]], Tiles] | None = None

    def to_dict(self) -> dict[str, Any]:
        """Kind and parameters, for provenance."""
        return {"kind": "Raster", "spacing": self.spacing, "ground": self.ground.to_dict()}

    def tile_of(self, x: npt.ArrayLike, y: npt.ArrayLike) -> Integer:
        """Column and row of the tile in which points lie.

        Parameters
        ----------
        x, y : array_like, shape (n,)
            Easting and northing [m].

        Returns
        -------
        numpy.ndarray of int64, shape (n, 2)
            Column and row.
        """
        at = np.stack([np.asarray(x, dtype=float), np.asarray(y, dtype=float)], axis=-1)
        return np.floor(at / (TILE_CELLS * self.spacing)).astype(np.int64)

    def tiles(self, requested: Iterable[tuple[int, int]]) -> Tiles:
        """Requested tiles in contiguous arrays; missing ones are computed.

        Parameters
        ----------
        requested : iterable of (column, row)
            The tiles.

        Returns
        -------
        Tiles
            Arguments of the kernel.
        """
        requested = sorted(set(requested))
        if self._last is not None and self._last[0] == requested:
            return self._last[1]
        self._max_tiles = max(_MAX_TILES, len(requested))
        height, tops = (np.stack(part) for part in zip(*map(self._tile, requested), strict=True))
        columns, rows = np.array(requested).T
        first = np.array([columns.min(), rows.min()])
        index = np.full((np.ptp(rows) + 1, np.ptp(columns) + 1), -1, np.int64)
        index[rows - first[1], columns - first[0]] = np.arange(len(requested))
        tiles = Tiles(
            spacing=self.spacing,
            first=first,
            index=index,
            height=height,
            block_top=tops,
            tile_top=tops.max(axis=(1, 2)),
        )
        self._last = requested, tiles
        return tiles

    def _tile(self, tile: tuple[int, int]) -> tuple[Float, Float]:
        """Nodes and block tops of one tile; the least recently used tiles are dropped."""
        if tile not in self._tiles:
            nodes = np.arange(TILE_CELLS + 1)
            x, y = ((number * TILE_CELLS + nodes) * self.spacing for number in tile)
            height = self.ground.height(x[None, :], y[:, None])
            self._tiles[tile] = height, _block_tops(np.where(np.isnan(height), -np.inf, height))
        self._tiles.move_to_end(tile)
        while len(self._tiles) > self._max_tiles:
            self._tiles.popitem(last=False)
        return self._tiles[tile]

    def _height(self, x: Float, y: Float) -> Float:
        i, j = np.floor(x / self.spacing), np.floor(y / self.spacing)
        fx, fy = x / self.spacing - i, y / self.spacing - j
        total = np.zeros(x.size)
        for di, wx in ((0, 1 - fx), (1, fx)):
            for dj, wy in ((0, 1 - fy), (1, fy)):
                weight = wx * wy
                needed = np.flatnonzero(weight != 0)  # a point on a node needs only that node
                total[needed] += weight[needed] * self._nodes(i[needed] + di, j[needed] + dj)
        return total

    def _nodes(self, i: Float, j: Float) -> Float:
        """Heights of nodes, from the tiles of the last request if they contain them."""
        if self._last is None:
            return self.ground.height(i * self.spacing, j * self.spacing)
        tiles, height = self._last[1], np.empty(i.size)
        column, row = (np.floor(n / TILE_CELLS).astype(np.int64) for n in (i, j))
        at = row - tiles.first[1], column - tiles.first[0]
        rows, columns = tiles.index.shape
        inside = (at[0] >= 0) & (at[0] < rows) & (at[1] >= 0) & (at[1] < columns)
        slot = np.where(inside, tiles.index[at[0] * inside, at[1] * inside], -1)
        known, new = np.flatnonzero(slot >= 0), np.flatnonzero(slot < 0)
        cell = [(n[known] - t[known] * TILE_CELLS).astype(int) for n, t in ((j, row), (i, column))]
        height[known] = tiles.height[slot[known], cell[0], cell[1]]
        height[new] = self.ground.height(i[new] * self.spacing, j[new] * self.spacing)
        return height


def _block_tops(height: Float) -> Float:
    """Highest node of each block of a tile; a block includes the nodes on all its edges."""
    blocks = TILE_CELLS // BLOCK_CELLS
    starts = np.arange(blocks) * BLOCK_CELLS
    nodes = starts[:, None] + np.arange(BLOCK_CELLS + 1)
    return np.asarray(height[nodes].max(axis=1)[:, nodes].max(axis=2))
