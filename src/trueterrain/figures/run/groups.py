"""What the figures of runs share: groups, stretches of time, points on the ground."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import CoverageError, SchemaError

Floats = npt.NDArray[np.float64]

POSE = ("east", "north", "up", "roll", "pitch", "yaw")

_SLACK = 1e-6  # [s] by which a time may miss the scans


@dataclass(frozen=True, kw_only=True, eq=False)
class ScanReturns:
    """Consecutive scans, seen from behind the scanner; each array has shape (scan, beam)."""

    time: Floats
    "Stamps of the scans, shape (scan,) [s]."

    along: Floats
    "Distance ahead of the first scan [m]; of no meaning without truth."

    across: Floats
    "Distance to the left of the scanner [m]."

    up: Floats
    "Height [m]: on the ground, or above the scanner where its pose is not known."

    position: Floats | None
    "Easting and northing of each return [m], shape (scan, beam, 2); None where not known."

    angle: Floats
    "Of each beam from straight down, shape (beam,) [rad]."


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
    """Scans from a time on; by default those in the middle of the run.

    Parameters
    ----------
    run : xarray.DataTree
        The run.
    at : float, optional
        Stamp of the first scan [s]; that of the nearest scan is taken.
    count : int
        How many; fewer at the end of the run.

    Returns
    -------
    slice
        Their indices.

    Raises
    ------
    ValueError
        If `count` is less than 1.
    CoverageError
        If there is no scan, or the time lies outside of the scans.
    """
    if count < 1:
        message = f"scans must be at least 1, got {count}."
        raise ValueError(message)
    time: Floats = run_group(run, "scans")["time"].values
    if time.size == 0:
        raise CoverageError("holds no scan", place="group scans")
    if at is None:
        first = max(min(time.size // 2, time.size - count), 0)
    elif not time[0] - _SLACK <= at <= time[-1] + _SLACK:
        raise CoverageError(
            f"there is no scan at {at:g} s",
            place="group scans",
            cure=f"Give a time from {time[0]:.6g} s to {time[-1]:.6g} s.",
        )
    else:
        first = int(np.abs(time - at).argmin())
    return slice(first, min(first + count, time.size))


def returns_of(run: xr.DataTree, part: slice) -> ScanReturns:
    """Where the returns of some scans lie: on the ground if the truth is known.

    This is for looking only. It takes the exact poses of the scanner from the truth, and straight
    lines between those of neighbouring scans.
    """
    scans = run_group(run, "scans").isel(scan=part).load()
    angle = scans["angle"].values
    ranges = scans["range"].values
    beam = np.stack([np.zeros_like(angle), np.sin(angle), -np.cos(angle)], axis=1)
    seen = ranges[:, :, None] * beam
    shared = {"time": scans["time"].values, "angle": angle}
    if not has_group(run, "truth/scanner"):
        return ScanReturns(
            along=seen[..., 0], across=seen[..., 1], up=seen[..., 2], position=None, **shared
        )
    where = _pose_of_beams(run_group(run, "truth/scanner"), part, scans["delay"].values)
    point = where[..., :3] + _rotate_vectors(seen, where[..., 3:])
    first = where[0, 0]
    ahead = np.array([np.cos(first[5]), np.sin(first[5])])
    east, north = np.moveaxis(point[..., :2] - first[:2], -1, 0)
    return ScanReturns(
        along=east * ahead[0] + north * ahead[1],
        across=north * ahead[0] - east * ahead[1],
        up=point[..., 2],
        position=point[..., :2],
        **shared,
    )


def _pose_of_beams(truth: xr.Dataset, part: slice, delay: Floats) -> Floats:
    """Pose of the scanner at every beam, shape (scan, beam, 6)."""
    around = slice(max(part.start - 1, 0), part.stop + 1)
    known = truth.isel(scan=around)
    time = known["time"].values
    pose = np.stack([known[name].values for name in POSE], axis=1)
    pose[:, 3:] = np.unwrap(pose[:, 3:], axis=0)
    when = time[part.start - around.start :][: part.stop - part.start, None] + delay
    if time.size == 1:
        return np.broadcast_to(pose[0], (*when.shape, len(POSE)))
    piece = np.clip(np.searchsorted(time, when, side="right") - 1, 0, time.size - 2)
    share = (when - time[piece]) / (time[piece + 1] - time[piece])
    between: Floats = pose[piece] + share[..., None] * (pose[piece + 1] - pose[piece])
    return between


def _rotate_vectors(vectors: Floats, angles: Floats) -> Floats:
    """Vectors turned from the axes of the scanner to those of the ground."""
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_euler("ZYX", angles[..., ::-1].reshape(-1, 3))
    turned: Floats = turn.apply(vectors.reshape(-1, 3)).reshape(vectors.shape)
    return turned


def equal_columns(data: Any, names: tuple[str, ...], what: str) -> dict[str, Floats]:
    """Arrays of equal length from a dataset or a mapping.

    Parameters
    ----------
    data : xarray.Dataset or mapping of str to array_like
        Where they are.
    names : tuple of str
        Which ones.
    what : str
        What the data are, for the message.

    Returns
    -------
    dict of str to numpy.ndarray
        By name.

    Raises
    ------
    SchemaError
        If one is missing, or they differ in length.
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
