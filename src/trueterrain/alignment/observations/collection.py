"""Cells of the ground from points or recorded runs."""

from collections.abc import Iterable, Mapping
from pathlib import Path as FilePath

import numpy as np
import numpy.typing as npt
import xarray as xr
from scipy.spatial.transform import Rotation

from trueterrain.alignment.observations.cells import PassCells, PassPath, move_to_centres
from trueterrain.alignment.observations.visit_sums import VisitSums, collect_cell_sums
from trueterrain.alignment.settings import CellSettings
from trueterrain.core.errors import CoverageError, name_file_in_errors
from trueterrain.formats.run import Mounting, open_run, scan_blocks
from trueterrain.georeference import Screening, georeference
from trueterrain.motion.trajectory import Trajectory

Floats = npt.NDArray[np.float64]

_THINNEST = 50  # maximum stride over scans


def cells_of_points(
    points: xr.Dataset | Iterable[xr.Dataset],
    settings: CellSettings = CellSettings(),
    *,
    names: Mapping[int, str] | None = None,
    path: PassPath | None = None,
) -> list[PassCells]:
    """Cells of each pass from points with times.

    Parameters
    ----------
    points : xarray.Dataset or iterable of xarray.Dataset
        Points with ``time`` [s], in one dataset or in blocks; ``lane`` numbers the passes. Points
        without time may have the station along the road [m] as ``time``.
    settings : CellSettings
        Size of the cells, and which of them are accepted.
    names : mapping of int to str, optional
        Names of the passes; by default their numbers.
    path : callable, optional
        Easting, northing [m] and heading [rad] of the body as functions of time; by default from
        the mean positions of the returns.

    Returns
    -------
    list of PassCells
        One for each pass, by ascending number; independent of order and blocks of the points.

    Raises
    ------
    SchemaError
        If points have no time, or coordinates are not finite.
    CoverageError
        If a pass has no cell with enough returns.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_points
    >>> points = make_points([0.2, 0.8, 0.5], [0.2, 0.4, 0.9], [1.0, 1.1, 1.2], time=[0, 1, 2])
    >>> (south,) = cells_of_points(points, CellSettings(size=1.0, min_count=3, max_sd=1.0))
    >>> south.height, south.time
    (array([1.1]), array([1.]))
    """
    found = collect_cell_sums(points, settings)
    if not found:
        raise CoverageError("there are no points")
    named = names or {}
    return [sums.cells(named.get(number, str(number)), path) for number, sums in found.items()]


def cells_of_run(
    run: str | FilePath | xr.DataTree,
    trajectory: Trajectory,
    settings: CellSettings = CellSettings(),
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
        Trajectory of the body.
    settings : CellSettings
        Size of the cells, and which of them are accepted.
    name : str
        Name of the pass.
    mounting : Mounting, optional
        Pose of the scanner in the body frame; by default that of the run.
    screening : Screening
        Which returns are flagged or dropped.

    Returns
    -------
    PassCells
        With the reported standard deviations of the height.

    Raises
    ------
    CoverageError
        If the trajectory covers no scan, or no cell has enough returns.
    FormatError
        If the run is damaged.
    """
    run = open_run(run)
    mounting = mounting or run.mounting
    stride = _scan_stride(run, trajectory, settings)
    sums = VisitSums(settings)
    with name_file_in_errors(run.source or "the run"):
        thinned = (
            block.isel(scan=slice(-block.attrs["first_scan"] % stride, None, stride))
            for block in scan_blocks(run)
        )
        for block in georeference(thinned, trajectory, mounting, screening=screening):
            sums.add(*(block[key].values for key in ("easting", "northing", "up", "time")))
    knots = trajectory.time
    forward = Rotation.from_quat(trajectory.quaternion).apply([1.0, 0.0, 0.0])
    heading = np.unwrap(np.arctan2(forward[:, 1], forward[:, 0]))

    def path(time: Floats) -> tuple[Floats, Floats, Floats]:
        x, y, course = (
            np.interp(time, knots, values)
            for values in (trajectory.position[:, 0], trajectory.position[:, 1], heading)
        )
        return x, y, course

    sd = np.sqrt(trajectory.covariance[:, 2, 2])
    known = bool((sd > 0).all()) and trajectory.datum_sd is not None
    navigation = {"sd_time": trajectory.time, "sd_height": sd} if known else {}
    return move_to_centres(sums.cells(name, path, **navigation), path, settings.size)


def _scan_stride(run: xr.DataTree, trajectory: Trajectory, settings: CellSettings) -> int:
    """Stride over scans that leaves the requested number of scans in a cell."""
    if settings.scans == 0:
        return 1
    stamps = np.asarray(run["scans"]["time"], dtype=np.float64)
    steps = np.diff(stamps[np.isfinite(stamps)])
    speed = float(np.median(np.hypot(*trajectory.velocity[:, :2].T)))
    distance = speed * float(np.median(steps)) if steps.size else 0.0
    if not distance > 0:
        return 1
    return int(np.clip(settings.size / (settings.scans * distance), 1, _THINNEST))
