"""Gridding: a height and its standard deviation for each node, from returns or points.

The height of a node is the mean of the heights in its cell (thesis 4.3.2). On a slope that is the
height at the mean position of the returns, which differs from the node; so it is reduced to the
node along the slope of the neighbouring heights, unless the plain mean is asked for. A slope is the
mean of the steps to both sides, at most twice the gentler one, so that a step in the ground stays
a step.
"""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import CoverageError, SchemaError
from trueterrain.core.row_blocks import height_blocks
from trueterrain.surface._nodes import ROWS, NodeValues, compute_nodes
from trueterrain.surface.accumulate import CellSums, ReturnTotals
from trueterrain.surface.cells import Grid
from trueterrain.surface.settings import GridSettings

Floats = npt.NDArray[np.float64]

__all__ = [
    "GridSettings",
    "compute_rows",
    "grid_points",
    "name_deviations",
    "require_heights",
    "surface_of",
    "trim_surface",
]


def surface_of(
    sums: CellSums,
    options: GridSettings = GridSettings(),
    *,
    crs: str = "",
    add_data: Callable[[CellSums], None] | None = None,
) -> xr.Dataset:
    """Surface from the sums of its cells.

    Parameters
    ----------
    sums : CellSums
        Sums over returns or points, those of `options.kept_sums()` among them.
    options : GridSettings
        Statistic of the heights in a cell.
    crs : str
        Coordinate reference system of the grid.
    add_data : callable, optional
        Adds all the data to the sums a second time; needed for medians and percentiles.

    Returns
    -------
    xarray.Dataset
        Surface with ``height`` [m], ``count`` (returns; flagged ones count by their weight),
        ``sd`` and ``sd_relative`` [m], see `name_deviations`.

    Raises
    ------
    CoverageError
        If no cell has enough returns.
    ValueError
        If the sums lack what the options need.

    Notes
    -----
    The variance of a height is the scatter of the returns within cells, less the parts of the slope
    and of differences between passes, pooled over 5 x 5 cells and divided by the count; plus the
    variance of the pose, whose error is common to all returns of a pass; plus that of its
    horizontal position times the square of the slope. Minimum and maximum have the standard
    deviation of a single return; those of medians and percentiles hold for normal errors.
    """
    if options.fraction is not None and add_data is None:
        message = f"{options.statistic} goes through the data twice: add_data must be given."
        raise ValueError(message)
    missing = [
        name
        for name in ("extremes", "places")
        if getattr(options.kept_sums(), name) and not getattr(sums.wanted, name)
    ]
    if missing:
        message = f"the sums lack {', '.join(missing)}, which {options.statistic} needs."
        raise ValueError(message)
    nodes = NodeValues.empty(sums.rows, sums.grid.shape[1])
    compute_rows(sums, options, sums.rows, nodes, add_data)
    require_heights(bool(np.isfinite(nodes.height).any()), options, sums.return_totals)
    return sums.grid.surface(
        nodes.height, crs=crs, count=nodes.count, **name_deviations(nodes.sd, sums.datum_sd)
    )


def name_deviations(
    sd: npt.NDArray[np.float32], datum_sd: float | None
) -> dict[str, npt.NDArray[np.float32]]:
    """Variables of a surface for standard deviations, absolute and relative.

    Parameters
    ----------
    sd : numpy.ndarray
        Standard deviations without the uncertainty of the datum [m].
    datum_sd : float or None
        Standard deviation of the height error that all passes have in common [m]: 0 if passes are
        independent, None if it is not known.

    Returns
    -------
    dict of numpy.ndarray
        ``sd``, absolute, if it is known; ``sd_relative``, relative to the datum of the adjustment
        or to the points as given, if it differs from ``sd`` [m].

    Examples
    --------
    >>> name_deviations(np.float32([0.003]), 0.004)
    {'sd': array([0.005], dtype=float32), 'sd_relative': array([0.003], dtype=float32)}
    """
    if datum_sd is None:
        return {"sd_relative": sd}
    if not datum_sd:
        return {"sd": sd}
    return {"sd": np.hypot(sd, np.float32(datum_sd)), "sd_relative": sd}


def compute_rows(
    sums: CellSums,
    options: GridSettings,
    rows: range,
    nodes: NodeValues,
    add_data: Callable[[CellSums], None] | None,
) -> None:
    """Compute the nodes of some rows from the sums of their cells and of those around them.

    Parameters
    ----------
    sums : CellSums
        Sums that hold these rows, and `halo_of` more to either side as far as the grid has them.
    options : GridSettings
        Statistic of the heights in a cell.
    rows : range
        The rows.
    nodes : NodeValues
        Output.
    add_data : callable, optional
        Adds all the data to the sums a second time; needed for medians and percentiles.
    """
    sums.total()
    with ThreadPoolExecutor(sums.threads) as pool:
        jobs = [
            pool.submit(compute_nodes, sums, options, start, min(start + ROWS, rows.stop), nodes)
            for start in range(rows.start, rows.stop, ROWS)
        ]
        for job in jobs:
            job.result()
    if options.fraction is not None and add_data is not None:
        height = nodes.of(rows).height
        seen = np.isfinite(height)
        height[seen] = sums.quantile(options.fraction, rows, add_data)[seen]


def require_heights(found: bool, options: GridSettings, return_totals: ReturnTotals) -> None:
    """Raise CoverageError if no node has a height, that is, unless some were `found`."""
    if found:
        return
    if not (return_totals.used or return_totals.outside or return_totals.too_high):
        where = f" in {return_totals.scans} scans" if return_totals.scans else ""
        raise CoverageError(
            f"there is no return{where}",
            cure="Look at the ranges (`trueterrain plot`), and at what screening leaves.",
        )
    raise CoverageError(
        f"no cell has {options.min_count} returns: {return_totals.used} lie on the grid, "
        f"{return_totals.outside} outside",
        cure="Choose a coarser spacing, or a grid where the returns are.",
    )


def grid_points(
    points: xr.Dataset | Iterable[xr.Dataset],
    grid: Grid,
    options: GridSettings = GridSettings(),
    *,
    threads: int = 1,
) -> xr.Dataset:
    """Grid points to a surface.

    Parameters
    ----------
    points : xarray.Dataset or iterable of xarray.Dataset
        Points, or blocks of them; medians and percentiles go through them at least twice.
    grid : Grid
        The cells.
    options : GridSettings
        Statistic of the heights in a cell.
    threads : int
        Threads that work at once; the surface does not depend on it.

    Returns
    -------
    xarray.Dataset
        Surface with ``height``, ``count`` and ``sd``; with ``sd_relative`` instead if the points
        have no ``sd``, since only their scatter and their ``sd_relative`` are known then.
        ``attrs["outside"]`` counts points outside the grid.

    Raises
    ------
    CoverageError
        If there are no points on the grid.
    SchemaError
        If blocks disagree about their CRS or standard deviations.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_points
    >>> from trueterrain.surface.cells import grid_over
    >>> points = make_points([0.1, 0.2, 0.9, 1.1], [0, 0, 1, 1], [5.0, 5.2, 7.0, 7.2])
    >>> grid_points(points, grid_over(0, 0, 1, 1, spacing=1.0), GridSettings(level=False)).height
    <xarray.DataArray 'height' (northing: 2, easting: 2)>...
    array([[5.1, nan],
           [nan, 7.1]])
    ...
    """
    if options.fraction is not None and isinstance(points, Iterator):
        message = f"{options.statistic} needs points that can be read twice, e.g. a list."
        raise ValueError(message)
    sums: CellSums | None = None
    crs, own = "", None
    for block in _point_blocks(points):
        found = str(block.attrs.get("crs", ""))
        if sums is None:
            own = next((name for name in ("sd", "sd_relative") if name in block), None)
            sums = CellSums(grid, options.kept_sums(point_sd=own is not None), threads=threads)
            crs = found
        elif found != crs:
            raise SchemaError(
                f"all points must have the same CRS, got {found[:40]!r} after {crs[:40]!r}",
                cure="Transform them first, or name the CRS of all.",
            )
        _add_block(sums, block, own)
    if sums is None:
        raise CoverageError("there are no points to grid")

    def add_data(these: CellSums) -> None:
        for block in _point_blocks(points):
            _add_block(these, block, own)

    if own != "sd":
        sums.datum_sd = None
    surface = surface_of(sums, options, crs=crs, add_data=add_data)
    return surface.assign_attrs(outside=sums.return_totals.outside)


def _point_blocks(points: xr.Dataset | Iterable[xr.Dataset]) -> Iterable[xr.Dataset]:
    return [points] if isinstance(points, xr.Dataset) else points


def _add_block(sums: CellSums, block: xr.Dataset, own: str | None) -> None:
    sd = block[own].values if own in block else None
    sums.add_points(block.easting.values, block.northing.values, block.up.values, sd)


def trim_surface(surface: xr.Dataset) -> xr.Dataset:
    """Surface without the cross-sections at both ends, or rows and columns, that have no height.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface along a reference line, or map.

    Returns
    -------
    xarray.Dataset
        A view; along a line its width stays.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_surface
    >>> road = make_surface([[np.nan, np.nan], [1, 2], [1, 2]], u=[0, 1, 2], v=[0, 1],
    ...                     easting=[0, 1, 2], northing=[0, 0, 0])
    >>> trim_surface(road).u.values
    array([1., 2.])
    """
    seen = [np.zeros(size, np.bool_) for size in surface["height"].shape]
    for rows, height in height_blocks(surface):
        known = np.isfinite(height)
        seen[0][rows] = known.any(axis=1)
        seen[1] |= known.any(axis=0)
    cut = {}
    for dim, found in zip(surface["height"].dims, seen, strict=True):
        has = np.flatnonzero(found)
        # a surface has at least two nodes along each axis
        if dim != "v" and has.size > 1:
            cut[dim] = slice(int(has[0]), int(has[-1]) + 1)
    return surface.isel(cut)
