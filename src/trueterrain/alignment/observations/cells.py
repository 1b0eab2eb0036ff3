"""Cells of the ground as one pass saw them: what passes are compared by."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path as FilePath
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import xarray as xr
from scipy.spatial.transform import Rotation

from trueterrain.alignment.settings import CellSettings
from trueterrain.core.errors import CoverageError, name_file_in_errors
from trueterrain.formats.run import Mounting, open_run, scan_blocks
from trueterrain.georeference import Screening
from trueterrain.motion.trajectory import Trajectory

if TYPE_CHECKING:
    from trueterrain.alignment.observations.centring import Path

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

_THINNEST = 50  # scans, of which at least one is taken however slow a pass is


@dataclass(frozen=True, kw_only=True, eq=False)
class PassCells:
    """What one pass saw of each cell of a grid that all passes share.

    A cell that the pass came back to is there several times.
    """

    name: str
    "Name of the pass."

    cell: Integers
    "Number of the cell in the grid of all passes, shape (n,)."

    time: Floats
    "Mean time [s], or station [m], of its returns, shape (n,)."

    easting: Floats
    "Mean place of its returns [m], shape (n,)."

    northing: Floats
    "Mean place of its returns [m], shape (n,)."

    height: Floats
    "Mean height of its returns [m], shape (n,)."

    variance: Floats
    "Of that mean, by the scatter of the returns about their plane and by their count [m²], (n,)."

    count: Integers
    "Returns, shape (n,)."

    slope_east: Floats
    "Slope of the ground towards east [1], shape (n,)."

    slope_north: Floats
    "Slope of the ground towards north [1], shape (n,)."

    offset: Floats
    "Distance from the path of the pass, left positive [m], shape (n,)."

    ahead: Floats
    "Distance from the body along its path [m], shape (n,)."

    sd_time: Floats | None = None
    "Times [s], or stations [m], at which the navigation says how sure it is, ascending."

    sd_height: Floats | None = None
    "Standard deviation of the height by the navigation at these times [m]."

    def __post_init__(self) -> None:
        """Check shapes and values."""
        if not self.name:
            message = "name must not be empty."
            raise ValueError(message)
        for entry in fields(self):
            value = getattr(self, entry.name)
            if entry.name in ("name", "sd_time", "sd_height"):
                continue
            if value.shape != self.cell.shape or value.ndim != 1:
                message = (
                    f"{entry.name} must hold one value for each of the {self.cell.size} cells of "
                    f"{self.name}, got the shape {value.shape}."
                )
                raise ValueError(message)
            if not np.isfinite(value).all():
                message = f"{entry.name} of {self.name} must be finite."
                raise ValueError(message)
        if not (self.variance >= 0).all():
            message = f"variance of {self.name} must not be negative."
            raise ValueError(message)
        if (self.sd_time is None) != (self.sd_height is None):
            message = f"sd_time and sd_height of {self.name} must both be given, or neither."
            raise ValueError(message)
        if self.sd_time is not None and self.sd_height is not None:
            good = (
                self.sd_time.shape == self.sd_height.shape
                and self.sd_time.ndim == 1
                and self.sd_time.size > 0
                and (np.diff(self.sd_time) >= 0).all()
                and (self.sd_height > 0).all()
            )
            if not good:
                message = (
                    f"sd_time of {self.name} must ascend and sd_height be greater than 0 m, one "
                    "for each time."
                )
                raise ValueError(message)

    def __len__(self) -> int:
        """Entries."""
        return self.cell.size

    def part(self, some: npt.NDArray[np.bool_] | Integers) -> "PassCells":
        """Some of the cells.

        Parameters
        ----------
        some : numpy.ndarray of bool or int
            Which of them.

        Returns
        -------
        LaneCells
            Of the same name.
        """
        kept = {
            entry.name: getattr(self, entry.name)[some]
            for entry in fields(self)
            if entry.name not in ("name", "sd_time", "sd_height")
        }
        return PassCells(name=self.name, **kept, sd_time=self.sd_time, sd_height=self.sd_height)


def lane_cells(
    name: str,
    cell: npt.ArrayLike,
    time: npt.ArrayLike,
    height: npt.ArrayLike,
    *,
    variance: npt.ArrayLike,
    easting: npt.ArrayLike = 0.0,
    northing: npt.ArrayLike = 0.0,
    count: npt.ArrayLike = 1,
    slope_east: npt.ArrayLike = 0.0,
    slope_north: npt.ArrayLike = 0.0,
    offset: npt.ArrayLike = 0.0,
    ahead: npt.ArrayLike = 0.0,
    sd_time: npt.ArrayLike | None = None,
    sd_height: npt.ArrayLike | None = None,
) -> PassCells:
    """Cells of a pass, or of control, from arrays or numbers that hold for all cells.

    Parameters
    ----------
    name : str
        Name of the pass.
    cell : array_like of int, shape (n,)
        Number of the cell in the grid of all passes.
    time : array_like
        Time [s], or station [m].
    height : array_like
        Mean height [m].
    variance : array_like
        Of the mean height [m²].
    easting, northing : array_like
        Mean place of the returns [m].
    count : array_like of int
        Returns.
    slope_east, slope_north : array_like
        Slope of the ground [1].
    offset, ahead : array_like
        Distance from the path, left positive, and from the body along it [m].
    sd_time, sd_height : array_like, optional
        Standard deviation of the height by the navigation [m], and its times.

    Returns
    -------
    LaneCells
        In the order given.

    Examples
    --------
    >>> len(lane_cells("south", [7, 8], [0.1, 0.2], [1.0, 1.1], variance=1e-6))
    2
    """
    number = np.asarray(cell, dtype=np.int64)

    def column(values: npt.ArrayLike) -> Floats:
        return np.broadcast_to(np.asarray(values, dtype=np.float64), number.shape).copy()

    return PassCells(
        name=name,
        cell=number,
        time=column(time),
        easting=column(easting),
        northing=column(northing),
        height=column(height),
        variance=column(variance),
        count=np.broadcast_to(np.asarray(count, dtype=np.int64), number.shape).copy(),
        slope_east=column(slope_east),
        slope_north=column(slope_north),
        offset=column(offset),
        ahead=column(ahead),
        sd_time=None if sd_time is None else np.asarray(sd_time, dtype=np.float64),
        sd_height=None if sd_height is None else np.asarray(sd_height, dtype=np.float64),
    )


def cells_of_points(
    points: xr.Dataset | Iterable[xr.Dataset],
    options: CellSettings = CellSettings(),
    *,
    names: Mapping[int, str] | None = None,
    path: "Path | None" = None,
) -> list[PassCells]:
    """Cells of each pass from points with times.

    Parameters
    ----------
    points : xarray.Dataset or iterable of xarray.Dataset
        Points with ``time`` [s], in one dataset or in blocks; ``lane`` tells passes apart. Where
        there is no time, the station along the road [m] can be given as ``time``.
    options : CellOptions
        Size of the cells, and which of them are used.
    names : mapping of int to str, optional
        Names of the lanes; by default their numbers.
    path : callable, optional
        Easting, northing [m] and heading [rad] of the body at some times; by default what the mean
        places of the returns tell.

    Returns
    -------
    list of LaneCells
        One for each lane, in ascending order, the same for any order and blocks of the points.

    Raises
    ------
    SchemaError
        If points have no time, or coordinates are not finite.
    CoverageError
        If a lane has no cell with enough returns.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_points
    >>> points = make_points([0.2, 0.8, 0.5], [0.2, 0.4, 0.9], [1.0, 1.1, 1.2], time=[0, 1, 2])
    >>> (south,) = cells_of_points(points, CellOptions(size=1.0, min_count=3, max_sd=1.0))
    >>> south.height, south.time
    (array([1.1]), array([1.]))
    """
    from trueterrain.alignment.observations.visit_sums import collect_cell_sums

    found = collect_cell_sums(points, options)
    if not found:
        raise CoverageError("there are no points")
    named = names or {}
    return [sums.cells(named.get(number, str(number)), path) for number, sums in found.items()]


def cells_of_run(
    run: str | FilePath | xr.DataTree,
    trajectory: Trajectory,
    options: CellSettings = CellSettings(),
    *,
    name: str,
    mounting: Mounting | None = None,
    screening: Screening = Screening(),
) -> PassCells:
    """Cells of a recorded run.

    Parameters
    ----------
    run : str, Path or xarray.DataTree
        The run.
    trajectory : Trajectory
        Motion of the body.
    options : CellOptions
        Size of the cells, and which of them are used.
    name : str
        Name of the pass.
    mounting : Mounting, optional
        Where the scanner sits; by default what the run says.
    screening : Screening
        Which returns are flagged, and what becomes of them.

    Returns
    -------
    LaneCells
        With the standard deviations of the height by the navigation.

    Raises
    ------
    CoverageError
        If the trajectory covers no scan, or no cell has enough returns.
    FormatError
        If the run is damaged.
    """
    from trueterrain.alignment.observations.centring import at_their_middle
    from trueterrain.alignment.observations.visit_sums import VisitSums
    from trueterrain.georeference import georeference, mounting_of

    tree = run if isinstance(run, xr.DataTree) else open_run(run)
    mounting = mounting or mounting_of(tree)
    every = _scan_stride(tree, trajectory, options)
    sums = VisitSums(options)
    with name_file_in_errors("the run" if isinstance(run, xr.DataTree) else run):
        thinned = (
            block.isel(scan=slice(-block.attrs["first_scan"] % every, None, every))
            for block in scan_blocks(run)
        )
        for block in georeference(thinned, trajectory, mounting, screening=screening):
            sums.add(*(block[key].values for key in ("easting", "northing", "up", "time")))
    knots = trajectory.time
    ahead = Rotation.from_quat(trajectory.quaternion).apply([1.0, 0.0, 0.0])
    heading = np.unwrap(np.arctan2(ahead[:, 1], ahead[:, 0]))

    def path(time: Floats) -> tuple[Floats, Floats, Floats]:
        x, y, course = (
            np.interp(time, knots, values)
            for values in (trajectory.position[:, 0], trajectory.position[:, 1], heading)
        )
        return x, y, course

    sd = np.sqrt(trajectory.covariance[:, 2, 2])
    known = bool((sd > 0).all()) and trajectory.datum_sd is not None
    navigation = {"sd_time": trajectory.time, "sd_height": sd} if known else {}
    return at_their_middle(sums.cells(name, path, **navigation), path, options.size)


def _scan_stride(run: xr.DataTree, trajectory: Trajectory, options: CellSettings) -> int:
    """Of how many scans one is taken, so that cells have as many along the way as asked for."""
    if options.scans == 0:
        return 1
    stamps = np.asarray(run["scans"]["time"], dtype=np.float64)
    steps = np.diff(stamps[np.isfinite(stamps)])
    speed = float(np.median(np.hypot(*trajectory.velocity[:, :2].T)))
    apart = speed * float(np.median(steps)) if steps.size else 0.0
    if not apart > 0:
        return 1
    return int(np.clip(options.size / (options.scans * apart), 1, _THINNEST))
