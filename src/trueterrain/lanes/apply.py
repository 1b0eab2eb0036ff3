"""Corrections taken to where they belong: the motion of a run, or the points of a cloud.

A run is corrected in its trajectory, so that every product made of it afterwards agrees. A cloud
has no motion; its points are moved, each by the correction at its own time.
"""

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import xarray as xr
from scipy.spatial.transform import Rotation

from trueterrain import provenance
from trueterrain.errors import SchemaError
from trueterrain.lanes._collect import Path
from trueterrain.lanes._discontinuity_result import LaneAlignment
from trueterrain.lanes.spline import Correction
from trueterrain.motion.trajectory import Trajectory

Floats = npt.NDArray[np.float64]

_UP, _EAST, _NORTH = 2, 0, 1


def corrected_trajectory(trajectory: Trajectory, correction: Correction) -> Trajectory:
    """Motion of a pass with the correction of a network adjustment.

    Parameters
    ----------
    trajectory : Trajectory
        Motion as it was found.
    correction : Correction
        What is to be added to the pass, by time.

    Returns
    -------
    Trajectory
        Raised by the height, moved by east and north, turned by roll and pitch about the axes of
        the body. The variances of what was corrected are those of the correction, relative to the
        datum of the adjustment: what the navigation was unsure of is what was corrected.

    Notes
    -----
    Covariances of what was corrected with the rest are dropped, since the adjustment knows nothing
    of them.
    """
    t = trajectory.time
    position = trajectory.position.copy()
    for axis, name in ((_EAST, "east"), (_NORTH, "north"), (_UP, "height")):
        position[:, axis] += correction(t, name)
    velocity = trajectory.velocity + np.gradient(position - trajectory.position, t, axis=0)
    # a point to the left rises by the roll, one ahead by the pitch, which is nose-down positive
    turn = np.stack(
        [correction(t, "roll"), -correction(t, "pitch"), np.zeros(t.size)], axis=1
    )  # fmt: skip
    turned = Rotation.from_quat(trajectory.quaternion) * Rotation.from_rotvec(turn)
    return replace(
        trajectory, position=position, velocity=velocity, quaternion=turned.as_quat(),
        covariance=_covariance(trajectory, correction),
    )  # fmt: skip


def _covariance(trajectory: Trajectory, correction: Correction) -> Floats:
    """Covariance with the variances of what was corrected in place of the navigation's."""
    t = trajectory.time
    ahead = Rotation.from_quat(trajectory.quaternion).apply([1.0, 0.0, 0.0])
    course = Rotation.from_euler("Z", np.arctan2(ahead[:, 1], ahead[:, 0])[:, None]).as_matrix()
    # axes that follow the course: of the place and of the turns
    turn = np.zeros((t.size, 6, 6))
    turn[:, :3, :3] = np.eye(3)
    turn[:, 3:, 3:] = course
    along = np.einsum("nji,njk,nkl->nil", turn, trajectory.covariance, turn, optimize=True)
    variance = {_UP: correction.sd(t) ** 2}
    for axis, name, (offset, forward) in ((3, "roll", (1.0, 0.0)), (4, "pitch", (0.0, 1.0))):
        if name in correction.components:
            # the mean of both sides holds no covariance with the height
            sides = [correction.sd(t, side * offset, side * forward) ** 2 for side in (1, -1)]
            variance[axis] = 0.5 * (sides[0] + sides[1]) - variance[_UP]
    for axis, values in variance.items():
        along[:, axis, :] = along[:, :, axis] = 0.0
        along[:, axis, axis] = np.maximum(values, 0.0)
    return np.asarray(np.einsum("nij,njk,nlk->nil", turn, along, turn, optimize=True))


def trajectory_along(
    trajectory: Trajectory,
    alignment: LaneAlignment,
    lane: str,
    *,
    lever: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Trajectory:
    """Motion of a pass with the correction along a reference path (thesis 4.3.1).

    Parameters
    ----------
    trajectory : Trajectory
        Motion as it was found.
    alignment : LaneAlignment
        Corrections by station.
    lane : str
        Name of the lane.
    lever : tuple of float
        Where the scanner sits in the body: forward, left, up [m]; the station of what it sees is
        its own, not that of the body.

    Returns
    -------
    Trajectory
        Raised station by station. Its covariance stays, since the method tells none.
    """
    position = trajectory.position.copy()
    turned = Rotation.from_quat(trajectory.quaternion)
    scanner = position + turned.apply(np.array(lever))
    found = alignment.correction(lane, scanner[:, _EAST], scanner[:, _NORTH])
    position[:, _UP] -= found.height
    velocity = trajectory.velocity.copy()
    velocity[:, _UP] -= np.gradient(found.height, trajectory.time)
    return replace(trajectory, position=position, velocity=velocity)


def corrected_points(
    points: xr.Dataset, correction: Correction, path: Path | None = None
) -> xr.Dataset:
    """Points of a pass with the correction of a network adjustment.

    Parameters
    ----------
    points : xarray.Dataset
        Points with ``time``, all or a block of them.
    correction : Correction
        What is to be added to the pass.
    path : callable, optional
        Easting, northing [m] and heading [rad] of the pass at some times; needed for roll and
        pitch.

    Returns
    -------
    xarray.Dataset
        With new heights, places if these were estimated, and ``sd``: that of the correction, and
        that of the points if they had one.

    Raises
    ------
    SchemaError
        If points have no time.
    ValueError
        If roll or pitch were estimated and there is no path.
    """
    if "time" not in points:
        raise SchemaError(
            "is missing, and corrections follow it", place="variable time",
            cure="Take a cloud with gps_time, or the method discontinuity, which goes by station.",
        )  # fmt: skip
    time = np.asarray(points["time"], dtype=np.float64)
    offset: Floats | float = 0.0
    ahead: Floats | float = 0.0
    if {"roll", "pitch"} & set(correction.components):
        if path is None:
            message = "path is needed, since the correction holds roll or pitch."
            raise ValueError(message)
        offset, ahead = beside(points, path)
    moved = {
        "easting": np.asarray(points["easting"]) + correction(time, "east"),
        "northing": np.asarray(points["northing"]) + correction(time, "north"),
        "up": np.asarray(points["up"]) + correction.height_at(time, offset, ahead),
        "sd": correction.sd(time, offset, ahead),
    }
    if "sd" in points:
        moved["sd"] = np.hypot(moved["sd"], np.asarray(points["sd"]))
    found = points.assign({name: (points["up"].dims, values) for name, values in moved.items()})
    for name in moved:
        found[name].attrs = dict(points[name].attrs if name in points else points["up"].attrs)
    return provenance.add_step(
        found, "merge",
        parameters={
            "method": "network", "lane": correction.name, "components": correction.components,
        },
    )  # fmt: skip


def beside(points: xr.Dataset, path: Path) -> tuple[Floats, Floats]:
    """Where points lie from the body.

    Parameters
    ----------
    points : xarray.Dataset
        Points with ``time``.
    path : callable
        Easting, northing [m] and heading [rad] of the pass at some times.

    Returns
    -------
    offset, ahead : numpy.ndarray
        To the left of the path, and ahead of the body [m].
    """
    x, y, heading = path(np.asarray(points["time"], dtype=np.float64))
    east, north = points["easting"].values - x, points["northing"].values - y
    offset = north * np.cos(heading) - east * np.sin(heading)
    ahead = east * np.cos(heading) + north * np.sin(heading)
    return np.asarray(offset), np.asarray(ahead)
