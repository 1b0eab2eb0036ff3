"""Motion during scans: pose of the scanner at the time of every beam, from few poses per scan.

Position and rotation of the body during a scan are quadratics of time through its poses at begin,
midpoint and end. Their error is at most 0.07 h³ times the jerk, with h half of the duration: 4 nm
for 0.4 ms and 1000 m/s³. Longer scans are divided into pieces.

Scans that are missing or that the trajectory does not cover are counted.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import xarray as xr
from scipy.spatial.transform import Rotation

from trueterrain.core.errors import CoverageError
from trueterrain.formats.run import Mounting
from trueterrain.formats.run.rules import check_scans
from trueterrain.motion.trajectory import Trajectory

Floats = npt.NDArray[np.float64]

#: Maximum duration of a piece of a scan whose motion is a quadratic of time [s].
LONGEST = 2e-3

_SHORTEST = 1e-6  # [s] minimum half duration of a piece, over which rates are computed
_GAP = 1.5  # median steps above which a step between two scans is a gap


@dataclass(frozen=True, kw_only=True, eq=False)
class PoseExpansion:
    """Motion during the pieces of some scans; the pieces of a scan are consecutive."""

    coefficient: Floats
    """Coefficients of 1, x, x² of the position of the scanner, then of its left and of its upward
    axis in the ground frame; x is the time after the midpoint of the piece [s]. Shape
    (piece, 3, 9) [m, m/s, m/s²; 1, 1/s, 1/s²]."""

    body: Floats
    "East, north, up of the body at the midpoint of the piece, shape (piece, 3) [m]."

    variance: Floats
    """Covariances of up and of rotations about east and north: uu, ue, un, ee, en, nn; then the
    mean variance of the positions east and north. Shape (piece, 7) [m²], [m rad], [rad²]; [m²]."""

    flag: npt.NDArray[np.uint8]
    "Flags of the trajectory during the piece, combined, shape (piece,)."


class ScanGeometry:
    """Origin and direction of the beams of a scanner on a moving body.

    Parameters
    ----------
    trajectory : Trajectory
        Motion of the body.
    mounting : Mounting
        Lever arm, boresight angles and clock of the scanner.
    angle : array_like, shape (beam,)
        Angle of each beam from straight down, positive to the left [rad].
    delay : array_like, shape (beam,)
        Time of each beam after the time of its scan [s].

    Raises
    ------
    ValueError
        If angles and delays differ in shape or are not finite.
    """

    def __init__(
        self,
        trajectory: Trajectory,
        mounting: Mounting,
        angle: npt.ArrayLike,
        delay: npt.ArrayLike,
    ) -> None:
        from trueterrain.georeference import _kernels  # here, as numba takes long to import

        self.trajectory = trajectory
        self.mounting = mounting
        self.angle = np.asarray(angle, dtype=np.float64)
        self.delay = np.asarray(delay, dtype=np.float64)
        _check_fan(self.angle, self.delay)
        self.first = _split_beams(self.delay)
        "First beam of each piece, and the number of beams."
        bounds = list(zip(self.first[:-1], self.first[1:], strict=True))
        low = np.array([self.delay[a:b].min() for a, b in bounds])
        high = np.array([self.delay[a:b].max() for a, b in bounds])
        self._span = float(low.min()), float(high.max())
        self._midpoint = 0.5 * (low + high)
        self._half = np.maximum(0.5 * (high - low), _SHORTEST)
        x = self.delay - np.repeat(self._midpoint, np.diff(self.first))
        powers = np.stack([np.ones_like(x), x, x * x])
        self.beam = np.concatenate(
            [powers, np.sin(self.angle) * powers, -np.cos(self.angle) * powers]
        )
        "Factors of the nine coefficients for each beam, shape (9, beam)."
        rotation = Rotation.from_euler("ZYX", mounting.scanner_rotation[::-1]).as_matrix()
        self._left, self._upward = rotation[:, 1].copy(), rotation[:, 2].copy()
        self._lever = np.array(mounting.scanner_position, dtype=np.float64)
        knots = trajectory.time.size
        self._rotation_vector, self._rotation_rate = (
            np.empty((knots - 1, 3)),
            np.empty((knots - 1, 3)),
        )
        self._motion = tuple(
            np.ascontiguousarray(getattr(trajectory, name), dtype=np.float64)
            for name in ("time", "position", "velocity", "quaternion", "angular_velocity")
        )
        _kernels.rotation_steps(
            self._motion[3], self._motion[4], self._rotation_vector, self._rotation_rate
        )
        self._covariance = np.ascontiguousarray(trajectory.covariance, dtype=np.float64)

    @property
    def pieces(self) -> int:
        """Number of pieces of a scan."""
        return self.first.size - 1

    def covers(self, time: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Whether the trajectory covers all beams of scans.

        Parameters
        ----------
        time : array_like, shape (scan,)
            Stamps of the scans [s].

        Returns
        -------
        numpy.ndarray of bool, shape (scan,)
            False also where a stamp is not finite.
        """
        true = np.asarray(time, dtype=np.float64) + self.mounting.scanner_clock
        first, last = self._span
        return self.trajectory.covers(true + first, true + last)

    def expand(self, time: npt.ArrayLike) -> PoseExpansion:
        """Motion during some scans.

        Parameters
        ----------
        time : array_like, shape (scan,)
            Stamps of the scans [s].

        Returns
        -------
        PoseExpansion
            Of all pieces, scan by scan.

        Raises
        ------
        ValueError
            If the trajectory does not cover a scan.
        """
        from trueterrain.georeference import _kernels

        time = np.asarray(time, dtype=np.float64)
        missing = np.flatnonzero(~self.covers(time))
        if missing.size:
            knots = self.trajectory.time
            message = (
                f"time must be from {knots[0]:.6f} s to {knots[-1]:.6f} s with the scanner's clock "
                f"and all delays, got {time[missing[0]]:.6f} s (scan {missing[0]})."
            )
            raise ValueError(message)
        midpoint = (time[:, None] + self.mounting.scanner_clock + self._midpoint).ravel()
        n = midpoint.size
        found = PoseExpansion(
            coefficient=np.empty((n, 3, 9)),
            body=np.empty((n, 3)),
            variance=np.empty((n, 7)),
            flag=np.empty(n, np.uint8),
        )
        _kernels.expand_poses(
            midpoint,
            self._half,
            *self._motion,
            self._rotation_vector,
            self._rotation_rate,
            self._covariance,
            self.trajectory.flag,
            self._lever,
            self._left,
            self._upward,
            found.coefficient,
            found.body,
            found.variance,
            found.flag,
        )
        return found


def _check_fan(angle: Floats, delay: Floats) -> None:
    if not (angle.ndim == 1 and angle.shape == delay.shape and angle.size):
        message = (
            f"angle and delay must hold one value for each beam, got the shapes {angle.shape} "
            f"and {delay.shape}."
        )
        raise ValueError(message)
    if not (np.isfinite(angle).all() and np.isfinite(delay).all()):
        message = "angle and delay must be finite everywhere."
        raise ValueError(message)


def _split_beams(delay: Floats) -> npt.NDArray[np.int64]:
    """First beams of pieces of about equal duration, as few as `LONGEST` allows."""
    wanted = max(1, int(np.ceil(np.ptp(delay) / LONGEST)))
    longest = np.ptp(delay) / wanted * (1 + 1e-9)
    starts, low, high = [0], delay[0], delay[0]
    for beam, value in enumerate(delay):
        low, high = min(low, value), max(high, value)
        if high - low > longest:
            starts.append(beam)
            low = high = value
    return np.array([*starts, delay.size], dtype=np.int64)


@dataclass(frozen=True, kw_only=True)
class MissingScans:
    """Number of missing scans, and the longest step."""

    count: int
    "Missing scans."

    gaps: int
    "Gaps that contain them."

    longest: float
    "The longest step from scan to scan [s]; 0 if there is none."

    at: float
    "Stamp of the scan before it [s]; NaN if there is none."


def count_missing_scans(time: npt.ArrayLike) -> MissingScans:
    """Count missing scans from the stamps of the others.

    Parameters
    ----------
    time : array_like, shape (n,)
        Ascending stamps of the scans [s].

    Returns
    -------
    MissingScans
        A step longer than 1.5 median steps is a gap; it lacks the scans that would divide it into
        median steps.

    Examples
    --------
    >>> count_missing_scans([0.0, 0.1, 0.2, 0.5, 0.6]).count
    2
    """
    time = np.asarray(time, dtype=float)
    steps = np.diff(time)
    if not steps.size:
        return MissingScans(count=0, gaps=0, longest=0.0, at=float("nan"))
    median = float(np.median(steps))
    gaps = np.flatnonzero(steps > _GAP * median)
    count = int(np.sum(np.rint(steps[gaps] / median) - 1)) if gaps.size else 0
    longest = int(steps.argmax())
    return MissingScans(
        count=count, gaps=int(gaps.size), longest=float(steps[longest]), at=float(time[longest])
    )


def find_scan_problems(run: xr.DataTree, trajectory: Trajectory) -> list[str]:
    """Warnings about the scans of a run: gaps, which are pauses of the scanner or clock jumps.

    Parameters
    ----------
    run : xarray.DataTree
        The run.
    trajectory : Trajectory
        Motion of the body.

    Returns
    -------
    list of str
        One sentence, or none.

    Raises
    ------
    SchemaError
        If stamps are not finite or do not ascend.
    CoverageError
        If the trajectory covers no scan.
    """
    check_scans(run, None)
    time = np.asarray(run["scans"]["time"], dtype=float)
    clock = Mounting.from_attrs(run.attrs.get("mounting")).scanner_clock
    first, last = time[[0, -1]] + clock
    begin, end = trajectory.time[[0, -1]]
    if not trajectory.covers(last, first):  # last scan after the first knot, first before the last
        raise CoverageError(
            f"the motion, {begin:.3f} s to {end:.3f} s, covers none of the {time.size} scans, "
            f"{first:.3f} s to {last:.3f} s",
            place="scans",
            cure="Compare the clocks of scanner and navigation: `trueterrain info`.",
        )
    missing = count_missing_scans(time)
    if not missing.gaps:
        return []
    several = "a gap" if missing.gaps == 1 else f"{missing.gaps} gaps, the longest"
    return [
        f"scans: {several} of {missing.longest:.6g} s at {missing.at:.6f} s: the scanner paused, "
        "or its clock jumped"
    ]
