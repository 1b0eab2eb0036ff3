"""Common parts of figures of runs: groups, ranges of scans, points on the ground."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import CoverageError, SchemaError

Floats = npt.NDArray[np.float64]

POSE = ("east", "north", "up", "roll", "pitch", "yaw")

_TIME_TOLERANCE = 1e-6  # [s] of a time outside of the scans


@dataclass(frozen=True, kw_only=True, eq=False)
class ScanReturns:
    """Points of consecutive scans relative to the scanner; arrays of shape (scan, beam)."""

    time: Floats
    "Stamps of the scans, shape (scan,) [s]."

    along: Floats
    "Longitudinal distance from the first scan [m]; meaningless without truth."

    across: Floats
    "Lateral distance from the scanner, to the left positive [m]."

    up: Floats
    "Height [m]: of the ground, or above the scanner if its pose is unknown."

    position: Floats | None
    "Easting and northing of each return [m], shape (scan, beam, 2); None if unknown."

    angle: Floats
    "Angle of each beam from straight down, shape (beam,) [rad]."


def run_group(run: xr.DataTree, name: str) -> xr.Dataset:
    """Group of a run, such as ``"truth/scanner"``."""
    node = run
    for part in name.split("/"):
        if part not in node.children:
            cure = "Only simulated runs hold the truth." if name.startswith("truth") else None
            raise SchemaError("is missing", place=f"group {name}", cure=cure)
        node = node.children[part]
    return node.to_dataset(inherit=False)


def has_group(run: xr.DataTree, name: str) -> bool:
    """Whether a run has a group."""
    node = run
    for part in name.split("/"):
        if part not in node.children:
            return False
        node = node.children[part]
    return True


def run_title(run: xr.DataTree) -> str:
    """Name of a run."""
    return str(run.attrs.get("name", ""))


def scans_from(run: xr.DataTree, at: float | None, count: int) -> slice:
    """Indices of scans from a time on; by default at the centre of the run.

    Parameters
    ----------
    run : xarray.DataTree
        The run.
    at : float, optional
        Time stamp of the first scan [s]; the nearest scan is used.
    count : int
        Number of scans; fewer at the end of the run.

    Returns
    -------
    slice
        Indices of the scans.

    Raises
    ------
    ValueError
        If `count` is less than 1.
    CoverageError
        If there is no scan, or the time is outside of the scans.
    """
    if count < 1:
        message = f"scans must be at least 1, got {count}."
        raise ValueError(message)
    time: Floats = run_group(run, "scans")["time"].values
    if time.size == 0:
        raise CoverageError("holds no scan", place="group scans")
    if at is None:
        first = max(min(time.size // 2, time.size - count), 0)
    elif not time[0] - _TIME_TOLERANCE <= at <= time[-1] + _TIME_TOLERANCE:
        raise CoverageError(
            f"there is no scan at {at:g} s",
            place="group scans",
            cure=f"Give a time from {time[0]:.6g} s to {time[-1]:.6g} s.",
        )
    else:
        first = int(np.abs(time - at).argmin())
    return slice(first, min(first + count, time.size))


def returns_of(run: xr.DataTree, part: slice) -> ScanReturns:
    """Points of some scans: on the ground if the truth is known.

    For figures only: the poses are the exact ones from the truth, interpolated linearly between
    scans. `trueterrain.georeference` is for measurements.
    """
    scans = run_group(run, "scans").isel(scan=part).load()
    angle = scans["angle"].values
    ranges = scans["range"].values
    beam = np.stack([np.zeros_like(angle), np.sin(angle), -np.cos(angle)], axis=1)
    # vector from the scanner to the return, in the axes of the scanner
    vector = ranges[:, :, None] * beam
    common = {"time": scans["time"].values, "angle": angle}
    if not has_group(run, "truth/scanner"):
        return ScanReturns(
            along=vector[..., 0], across=vector[..., 1], up=vector[..., 2], position=None, **common
        )
    pose = _beam_poses(run_group(run, "truth/scanner"), part, scans["delay"].values)
    # p_g = t_gs + R_gs v_s, the equation of a return in docs/explanation/notation.md
    point = pose[..., :3] + _rotate_vectors(vector, pose[..., 3:])
    first = pose[0, 0]
    forward = np.array([np.cos(first[5]), np.sin(first[5])])
    east, north = np.moveaxis(point[..., :2] - first[:2], -1, 0)
    return ScanReturns(
        along=east * forward[0] + north * forward[1],
        across=north * forward[0] - east * forward[1],
        up=point[..., 2],
        position=point[..., :2],
        **common,
    )


def _beam_poses(truth: xr.Dataset, part: slice, delay: Floats) -> Floats:
    """Pose of the scanner at the time of each beam, shape (scan, beam, 6)."""
    around = slice(max(part.start - 1, 0), part.stop + 1)
    known = truth.isel(scan=around)
    time = known["time"].values
    pose = np.stack([known[name].values for name in POSE], axis=1)
    pose[:, 3:] = np.unwrap(pose[:, 3:], axis=0)
    beam_time = time[part.start - around.start :][: part.stop - part.start, None] + delay
    if time.size == 1:
        return np.broadcast_to(pose[0], (*beam_time.shape, len(POSE)))
    piece = np.clip(np.searchsorted(time, beam_time, side="right") - 1, 0, time.size - 2)
    fraction = (beam_time - time[piece]) / (time[piece + 1] - time[piece])
    interpolated: Floats = pose[piece] + fraction[..., None] * (pose[piece + 1] - pose[piece])
    return interpolated


def _rotate_vectors(vectors: Floats, angles: Floats) -> Floats:
    """Vectors rotated from the scanner frame to the ground frame: R_z(yaw) R_y(pitch) R_x(roll)."""
    from scipy.spatial.transform import Rotation

    rotation = Rotation.from_euler("ZYX", angles[..., ::-1].reshape(-1, 3))
    rotated: Floats = rotation.apply(vectors.reshape(-1, 3)).reshape(vectors.shape)
    return rotated


def equal_columns(data: Any, names: tuple[str, ...], what: str) -> dict[str, Floats]:
    """Arrays of equal length from a dataset or a mapping.

    Parameters
    ----------
    data : xarray.Dataset or mapping of str to array_like
        Source of the arrays.
    names : tuple of str
        Names of the arrays.
    what : str
        Name of the data, for the message.

    Returns
    -------
    dict of str to numpy.ndarray
        Arrays by name.

    Raises
    ------
    SchemaError
        If an array is missing, or the lengths differ.
    """
    found: dict[str, Floats] = {}
    for name in names:
        if not isinstance(data, Mapping) or name not in data:
            raise SchemaError("is missing", place=f"{what}, variable {name}")
        found[name] = np.asarray(data[name], dtype=np.float64)
        if found[name].ndim != 1 or found[name].shape != found[names[0]].shape:
            raise SchemaError(
                f"must have one value for each of {names[0]}, has shape {found[name].shape}",
                place=f"{what}, variable {name}",
            )
    return found
