"""Corrections taken to where they belong: the motion of a run, or the points of a cloud.

A run is corrected in its trajectory, so that every product made of it afterwards agrees. A cloud
has no motion; its points are moved, each by the correction at its own time.
"""

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import xarray as xr
from scipy.spatial.transform import Rotation

from trueterrain.alignment.adjustment.spline import SplineCorrection
from trueterrain.alignment.discontinuity.result import PassAlignment
from trueterrain.alignment.observations.centring import Path
from trueterrain.core import provenance
from trueterrain.core.errors import SchemaError
from trueterrain.motion.trajectory import Trajectory

Floats = npt.NDArray[np.float64]

_UP, _EAST, _NORTH = 2, 0, 1
_AXES = {"east": 0, "north": 1, "height": 2, "roll": 3, "pitch": 4}  # of a covariance
_CHUNK = 20_000  # times at once, since each takes the covariance of its interval


def corrected_trajectory(trajectory: Trajectory, correction: SplineCorrection) -> Trajectory:
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
        the body. The covariance of what was corrected is that of the correction, and of its datum
        if that is known: what the navigation was unsure of is what was corrected.

    Notes
    -----
    Covariances of what was corrected with the rest are dropped, since the adjustment knows nothing
    of them. Turned about the body, ground a height h below it also moves sideways by h times the
    roll, which points that are corrected by `corrected_points` do not.
    """
    t = trajectory.time
    position = trajectory.position.copy()
    for axis, name in ((_EAST, "east"), (_NORTH, "north"), (_UP, "height")):
        position[:, axis] += correction(t, name)
    velocity = trajectory.velocity + np.gradient(position - trajectory.position, t, axis=0)
    # a point to the left rises by the roll, one ahead by the pitch, which is nose-down positive
    turn = np.stack([correction(t, "roll"), -correction(t, "pitch"), np.zeros(t.size)], axis=1)
    tilt = Rotation.from_rotvec(turn)
    turned = Rotation.from_quat(trajectory.quaternion) * tilt
    # so small a turn changes no faster than its vector
    rate = tilt.inv().apply(trajectory.angular_velocity) + np.gradient(turn, t, axis=0)
    return replace(
        trajectory,
        position=position,
        velocity=velocity,
        quaternion=turned.as_quat(),
        angular_velocity=rate,
        covariance=_corrected_covariance(trajectory, correction),
        datum_sd=correction.datum_sd,
    )


def _corrected_covariance(trajectory: Trajectory, correction: SplineCorrection) -> Floats:
    """Covariance with that of what was corrected in place of the navigation's."""
    ahead = Rotation.from_quat(trajectory.quaternion).apply([1.0, 0.0, 0.0])
    angle = np.arctan2(ahead[:, 1], ahead[:, 0])
    axes = [_AXES[name] for name in correction.components]
    sign = np.array([-1.0 if name == "pitch" else 1.0 for name in correction.components])
    found = np.empty_like(trajectory.covariance)
    for begin in range(0, angle.size, _CHUNK):
        part = slice(begin, begin + _CHUNK)
        course = Rotation.from_euler("Z", angle[part, None]).as_matrix()
        # axes that follow the course: of the turns
        turn = np.tile(np.eye(6), (len(course), 1, 1))
        turn[:, 3:, 3:] = course
        back = turn.transpose(0, 2, 1)
        along = back @ trajectory.covariance[part] @ turn
        along[:, axes, :] = along[:, :, axes] = 0.0
        own = _of_components(correction, trajectory.time[part]) * np.outer(sign, sign)
        along[np.ix_(range(len(along)), axes, axes)] = own
        found[part] = turn @ along @ back
    found[:, _UP, _UP] += (correction.datum_sd or 0.0) ** 2
    return found


def fixed_trajectory(trajectory: Trajectory, datum_sd: float | None) -> Trajectory:
    """Motion of a pass that is fixed in an adjustment: its height is the datum.

    Parameters
    ----------
    trajectory : Trajectory
        Motion as it was found.
    datum_sd : float or None
        Standard deviation of the datum [m]; None if it is not known.

    Returns
    -------
    Trajectory
        The same motion; the variance of its height is that of the datum.
    """
    covariance = trajectory.covariance.copy()
    covariance[:, _UP] = covariance[:, :, _UP] = 0.0
    covariance[:, _UP, _UP] = (datum_sd or 0.0) ** 2
    return replace(trajectory, covariance=covariance, datum_sd=datum_sd)


def _of_components(correction: SplineCorrection, time: Floats) -> Floats:
    """Covariance of the components of a correction at some times, shape (time, k, k)."""
    interval, weights = correction.knots.basis(time)
    k = len(correction.components)
    blocks = correction.covariance[interval].reshape(-1, k, 4, k, 4)
    found = np.einsum("ni,nkilj,nj->nkl", weights, blocks, weights, optimize=True)
    height = correction.components.index("height")
    found[:, height, height] += correction.left**2
    return np.asarray(found)


def trajectory_along(
    trajectory: Trajectory,
    alignment: PassAlignment,
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
    points: xr.Dataset, correction: SplineCorrection, path: Path | None = None
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
        With new heights, places if these were estimated, and ``sd_relative``: that of the
        correction, relative to the datum. With ``sd`` too where the datum's or the points' own is
        known: all together, since nobody knows which part of the points' own was corrected.

    Raises
    ------
    SchemaError
        If points have no time.
    ValueError
        If roll or pitch were estimated and there is no path.
    """
    if "time" not in points:
        raise SchemaError(
            "is missing, and corrections follow it",
            place="variable time",
            cure="Take a cloud with gps_time, or the method discontinuity, which goes by station.",
        )
    time = np.asarray(points["time"], dtype=np.float64)
    offset: Floats | float = 0.0
    ahead: Floats | float = 0.0
    if {"roll", "pitch"} & set(correction.components):
        if path is None:
            message = "path is needed, since the correction holds roll or pitch."
            raise ValueError(message)
        offset, ahead = body_coordinates(points, path)
    moved = {
        "easting": np.asarray(points["easting"]) + correction(time, "east"),
        "northing": np.asarray(points["northing"]) + correction(time, "north"),
        "up": np.asarray(points["up"]) + correction.height_at(time, offset, ahead),
        "sd_relative": _correction_sd(correction, time, offset, ahead),
    }
    if "sd" in points or correction.datum_sd is not None:
        own = np.asarray(points["sd"]) if "sd" in points else 0.0
        moved["sd"] = np.hypot(np.hypot(moved["sd_relative"], own), correction.datum_sd or 0.0)
    found = points.assign({name: (points["up"].dims, values) for name, values in moved.items()})
    for name in moved:
        found[name].attrs = dict(points[name].attrs if name in points else points["up"].attrs)
    return provenance.add_step(
        found,
        "merge",
        parameters={
            "method": "network",
            "lane": correction.name,
            "components": correction.components,
        },
    )


def _correction_sd(
    correction: SplineCorrection, time: Floats, offset: Floats | float, ahead: Floats | float
) -> Floats:
    """Standard deviations of what a correction leaves, some at a time."""
    columns = np.broadcast_arrays(time, offset, ahead)
    found = np.empty(time.size)
    for begin in range(0, time.size, _CHUNK):
        part = slice(begin, begin + _CHUNK)
        found[part] = correction.sd(*(values[part] for values in columns))
    return found


def body_coordinates(points: xr.Dataset, path: Path) -> tuple[Floats, Floats]:
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
