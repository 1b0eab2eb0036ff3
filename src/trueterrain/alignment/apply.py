"""Application of corrections: to the trajectory of a run, or to the points of a cloud.

The trajectory of a run is corrected, so every product made of it afterwards agrees. A cloud has no
trajectory: each of its points is moved by the correction at its own time.
"""

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import xarray as xr
from scipy.spatial.transform import Rotation

from trueterrain.alignment.adjustment.spline import SplineCorrection
from trueterrain.alignment.discontinuity.result import PassAlignment
from trueterrain.alignment.observations.cells import PassPath
from trueterrain.core import provenance
from trueterrain.core.errors import SchemaError
from trueterrain.motion.trajectory import Trajectory

Floats = npt.NDArray[np.float64]

_UP, _EAST, _NORTH = 2, 0, 1
_AXES = {"east": 0, "north": 1, "height": 2, "roll": 3, "pitch": 4}  # rows of a covariance
_CHUNK = 20_000  # times evaluated at once: each needs a copy of the covariance of its interval


def corrected_trajectory(trajectory: Trajectory, correction: SplineCorrection) -> Trajectory:
    """Trajectory of a pass with the correction of a network adjustment.

    Parameters
    ----------
    trajectory : Trajectory
        Trajectory before the correction.
    correction : SplineCorrection
        Correction of the pass as a function of time.

    Returns
    -------
    Trajectory
        Raised by the height, moved by east and north, rotated by roll and pitch about the axes of
        the body. In the corrected components the covariance is that of the correction, with the
        variance of the datum where it is known: the correction replaces the navigation there.

    Notes
    -----
    Covariances between corrected and other components are set to 0, since the adjustment does not
    estimate them. A rotation about the body by the roll r also moves ground at the distance h below
    it sideways by h r; `corrected_points` leaves out that shift, which is of second order.
    """
    t = trajectory.time
    position = trajectory.position.copy()
    for axis, name in ((_EAST, "east"), (_NORTH, "north"), (_UP, "height")):
        position[:, axis] += correction(t, name)
    velocity = trajectory.velocity + np.gradient(position - trajectory.position, t, axis=0)
    # the correction raises points ahead by +pitch, but body pitch is nose-down positive (ISO 8855)
    turn = np.stack([correction(t, "roll"), -correction(t, "pitch"), np.zeros(t.size)], axis=1)
    tilt = Rotation.from_rotvec(turn)
    rotated = Rotation.from_quat(trajectory.quaternion) * tilt
    # small angles: the derivative of the rotation vector is the added angular velocity
    rate = tilt.inv().apply(trajectory.angular_velocity) + np.gradient(turn, t, axis=0)
    return replace(
        trajectory,
        position=position,
        velocity=velocity,
        quaternion=rotated.as_quat(),
        angular_velocity=rate,
        covariance=_corrected_covariance(trajectory, correction),
        datum_sd=correction.datum_sd,
    )


def _corrected_covariance(trajectory: Trajectory, correction: SplineCorrection) -> Floats:
    """Covariance in which the corrected components have the covariance of the correction."""
    forward = Rotation.from_quat(trajectory.quaternion).apply([1.0, 0.0, 0.0])
    angle = np.arctan2(forward[:, 1], forward[:, 0])
    axes = [_AXES[name] for name in correction.components]
    sign = np.array([-1.0 if name == "pitch" else 1.0 for name in correction.components])
    found = np.empty_like(trajectory.covariance)
    for begin in range(0, angle.size, _CHUNK):
        part = slice(begin, begin + _CHUNK)
        course = Rotation.from_euler("Z", angle[part, None]).as_matrix()
        # rotate into axes along the heading, in which roll and pitch are defined
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
    """Trajectory of a pass that is fixed in an adjustment: its height is the datum.

    Parameters
    ----------
    trajectory : Trajectory
        Trajectory before the correction.
    datum_sd : float or None
        Standard deviation of the datum [m]; None if it is not known.

    Returns
    -------
    Trajectory
        The same trajectory; the variance of its height is that of the datum.
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
    found[:, height, height] += correction.residual_sd**2
    return np.asarray(found)


def trajectory_along(
    trajectory: Trajectory,
    alignment: PassAlignment,
    name: str,
    *,
    lever_arm: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Trajectory:
    """Trajectory of a pass with the correction along a reference path (thesis 4.3.1).

    Parameters
    ----------
    trajectory : Trajectory
        Trajectory before the correction.
    alignment : PassAlignment
        Corrections as functions of station.
    name : str
        Name of the pass.
    lever_arm : tuple of float
        Position of the scanner in the body frame: forward, left, up [m]. The station is that of
        the scanner, since it sees the ground below itself.

    Returns
    -------
    Trajectory
        With corrected heights. The covariance is unchanged, since the method estimates none.
    """
    position = trajectory.position.copy()
    rotated = Rotation.from_quat(trajectory.quaternion)
    scanner = position + rotated.apply(np.array(lever_arm))
    found = alignment.correction(name, scanner[:, _EAST], scanner[:, _NORTH])
    position[:, _UP] -= found.height
    velocity = trajectory.velocity.copy()
    velocity[:, _UP] -= np.gradient(found.height, trajectory.time)
    return replace(trajectory, position=position, velocity=velocity)


def corrected_points(
    points: xr.Dataset, correction: SplineCorrection, path: PassPath | None = None
) -> xr.Dataset:
    """Points of a pass with the correction of a network adjustment.

    Parameters
    ----------
    points : xarray.Dataset
        Points with ``time``, all or a block of them.
    correction : SplineCorrection
        Correction of the pass.
    path : callable, optional
        Easting, northing [m] and heading [rad] of the pass as a function of time; needed for roll
        and pitch.

    Returns
    -------
    xarray.Dataset
        With corrected heights, and positions if a shift was estimated, and ``sd_relative``: the
        standard deviation of the correction relative to the datum. With ``sd`` if the standard
        deviation of the datum or of the points is known: the root of the sum of all variances, a
        safe bound, since it is unknown which part of the errors of the points was corrected.

    Raises
    ------
    SchemaError
        If points have no time.
    ValueError
        If roll or pitch were estimated and there is no path.
    """
    if "time" not in points:
        raise SchemaError(
            "is missing, and corrections are functions of time",
            place="variable time",
            cure="Take a cloud with gps_time, or the method discontinuity, which goes by station.",
        )
    time = np.asarray(points["time"], dtype=np.float64)
    offset: Floats | float = 0.0
    longitudinal: Floats | float = 0.0
    if {"roll", "pitch"} & set(correction.components):
        if path is None:
            message = "path is needed, since the correction holds roll or pitch."
            raise ValueError(message)
        offset, longitudinal = body_coordinates(points, path)
    moved = {
        "easting": np.asarray(points["easting"]) + correction(time, "east"),
        "northing": np.asarray(points["northing"]) + correction(time, "north"),
        "up": np.asarray(points["up"]) + correction.height_at(time, offset, longitudinal),
        "sd_relative": _correction_sd(correction, time, offset, longitudinal),
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
    correction: SplineCorrection, time: Floats, offset: Floats | float, longitudinal: Floats | float
) -> Floats:
    """Standard deviations of corrected heights, evaluated in chunks."""
    columns = np.broadcast_arrays(time, offset, longitudinal)
    found = np.empty(time.size)
    for begin in range(0, time.size, _CHUNK):
        part = slice(begin, begin + _CHUNK)
        found[part] = correction.sd(*(values[part] for values in columns))
    return found


def body_coordinates(points: xr.Dataset, path: PassPath) -> tuple[Floats, Floats]:
    """Positions of points relative to the body.

    Parameters
    ----------
    points : xarray.Dataset
        Points with ``time``.
    path : callable
        Easting, northing [m] and heading [rad] of the pass as a function of time.

    Returns
    -------
    offset, longitudinal : numpy.ndarray
        Lateral distance, to the left positive, and longitudinal distance, forward positive [m].
    """
    x, y, heading = path(np.asarray(points["time"], dtype=np.float64))
    east, north = points["easting"].values - x, points["northing"].values - y
    offset = north * np.cos(heading) - east * np.sin(heading)
    longitudinal = east * np.cos(heading) + north * np.sin(heading)
    return np.asarray(offset), np.asarray(longitudinal)
