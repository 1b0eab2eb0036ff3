"""Errors of surfaces against known ground: of simulated runs, or given as a function."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import CoverageError
from trueterrain.core.statistics import MAD_TO_SD
from trueterrain.formats.run import Run, open_run
from trueterrain.geometry.grid_frame import grid_frame
from trueterrain.motion import Trajectory
from trueterrain.surface.evaluate import heights_at

Floats = npt.NDArray[np.float64]

#: True height [m] at easting and northing [m], arrays of one shape.
TrueHeight = Callable[[Floats, Floats], Floats]

_ROWS = 512  # cross-sections in one block


def true_ground(run: xr.DataTree) -> TrueHeight:
    """True ground of a simulated run, by bilinear interpolation between its nodes.

    Parameters
    ----------
    run : xarray.DataTree
        Run with the group ``truth/ground``.

    Returns
    -------
    callable
        True height at easting and northing; NaN outside of the ground.

    Raises
    ------
    CoverageError
        If the run has no truth: it was not simulated.
    """
    if "/truth/ground" not in run.groups:
        raise CoverageError(
            "holds no true ground, since it was not simulated",
            place="group truth",
            cure="Compare with another surface.",
        )
    surface = run["truth/ground"].to_dataset().compute()
    return lambda easting, northing: heights_at(surface, easting, northing)


def truth_of(run: Run | str | Path) -> TrueHeight | None:
    """True ground of a run, if it is simulated.

    Parameters
    ----------
    run : Run or path
        The run, or its store.

    Returns
    -------
    callable or None
        As by `true_ground`; None for real runs.
    """
    run = open_run(run)
    return true_ground(run) if "/truth/ground" in run.groups else None


def exact_trajectory(run: xr.DataTree | str | Path) -> Trajectory:
    """True motion of the body in a simulated run.

    Parameters
    ----------
    run : xarray.DataTree or path
        Run with the group ``truth/body``.

    Returns
    -------
    Trajectory
        Through the knots of the true motion, 0.5 ms apart, without uncertainty.

    Raises
    ------
    CoverageError
        If the run has no truth: it was not simulated.
    """
    from scipy.spatial.transform import Rotation

    run = open_run(run)
    if "/truth/body" not in run.groups:
        raise CoverageError(
            "holds no true motion, since it was not simulated",
            place="group truth",
            path=run.source,
        )
    body = run["truth/body"].to_dataset().compute()
    position, velocity = (
        np.stack([body[f"{name}{what}"].values for name in ("east", "north", "up")], axis=1)
        for what in ("", "_rate")
    )
    roll, pitch, yaw = (body[name].values for name in ("roll", "pitch", "yaw"))
    r, p, y = (body[f"{name}_rate"].values for name in ("roll", "pitch", "yaw"))
    # angular velocity in the body frame from the rates of roll, pitch and yaw
    angular_velocity = [
        r - y * np.sin(pitch),
        p * np.cos(roll) + y * np.sin(roll) * np.cos(pitch),
        -p * np.sin(roll) + y * np.cos(roll) * np.cos(pitch),
    ]
    n = body.sizes["knot"]
    return Trajectory(
        time=body["time"].values,
        position=position,
        velocity=velocity,
        quaternion=Rotation.from_euler("ZYX", np.stack([yaw, pitch, roll], axis=1)).as_quat(),
        angular_velocity=np.stack(angular_velocity, axis=1),
        covariance=np.zeros((n, 6, 6)),
        flag=np.zeros(n, np.uint8),
    )


def ground_errors(surface: xr.Dataset, truth: TrueHeight) -> dict[str, Any]:
    """Errors of the heights of a surface against the true ground.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface along a reference line, or map.
    truth : callable
        True height at easting and northing.

    Returns
    -------
    dict
        ``nodes``, the number of compared nodes; of the errors [m] the ``median`` (a shift of the
        datum or drift), ``rms``, and about the median ``rms_about_median``, ``nmad`` (normalised
        median absolute deviation, robust against steps and joints) and ``p95``, the 95 % quantile
        of the absolute errors.

    Raises
    ------
    CoverageError
        If the truth covers no node.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_surface
    >>> road = make_surface([[1.0, 1.2], [1.1, 1.1]], easting=[0, 1], northing=[0, 1])
    >>> ground_errors(road, lambda easting, northing: 0 * easting + 1)["median"]
    0.1
    """
    frame = grid_frame(surface)
    height = surface["height"] if "u" in surface.dims else surface["height"].T
    found = []
    for start in range(0, height.shape[0], _ROWS):
        rows = slice(start, start + _ROWS)
        error = height[rows].values - truth(*frame.nodes(rows))
        found.append(error[np.isfinite(error)])
    return statistics_of(np.concatenate(found))


def statistics_of(errors: npt.ArrayLike) -> dict[str, Any]:
    """Statistics of errors of heights, as `ground_errors` gives them.

    Parameters
    ----------
    errors : array_like
        Errors [m]; values that are not finite are left out.

    Returns
    -------
    dict
        See `ground_errors`.

    Raises
    ------
    CoverageError
        If there are none.

    Examples
    --------
    >>> statistics_of([0.001, 0.002, 0.003, np.nan])["nodes"]
    3
    """
    every = np.ravel(np.asarray(errors, dtype=np.float64))
    known = every[np.isfinite(every)]
    if not known.size:
        raise CoverageError("the true ground covers no node of the surface")
    median = float(np.median(known))
    deviation = np.abs(known - median)
    return {
        "nodes": int(known.size),
        "median": median,
        "rms": float(np.sqrt(np.mean(known**2))),
        "rms_about_median": float(np.sqrt(np.mean((known - median) ** 2))),
        "nmad": MAD_TO_SD * float(np.median(deviation)),
        "p95": float(np.percentile(deviation, 95)),
    }
