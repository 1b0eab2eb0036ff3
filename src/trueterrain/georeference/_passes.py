"""Passes over the same ground: what they see for a mounting, and how their motion may be wrong."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import CoverageError
from trueterrain.core.progress import Progress
from trueterrain.formats.run import Mounting
from trueterrain.georeference._differences import (
    PatchDifferences,
    form_height_differences,
    shared_times,
)
from trueterrain.georeference._patches import BLOCK, PatchGrid, fit_patches, ground_extent
from trueterrain.georeference._settings import CalibrationSettings
from trueterrain.georeference._wander import MotionErrorModel
from trueterrain.motion.trajectory import Trajectory

Floats = npt.NDArray[np.float64]

_LARGEST = 3_000_000  # cells


class CalibrationPasses:
    """Runs with their motion.

    Parameters
    ----------
    runs : sequence of xarray.DataTree or path
        Passes over the same ground.
    trajectories : sequence of Trajectory
        Motion of each.
    settings : CalibrationSettings
        Which returns are used, and how finely.
    progress : callable
        Called at each look.
    """

    def __init__(
        self,
        runs: Sequence[xr.DataTree | str | Path],
        trajectories: Sequence[Trajectory],
        settings: CalibrationSettings,
        progress: Progress,
    ) -> None:
        self._passes = list(zip(runs, trajectories, strict=True))
        self._settings = settings
        self._progress = progress
        self._looks = 0
        self._motion_sd = np.stack([_motion_sd(way) for way in trajectories])
        self.wander: MotionErrorModel | None = None

    @property
    def count(self) -> int:
        """How many they are."""
        return len(self._passes)

    def area(self, mounting: Mounting) -> tuple[float, float, float, float]:
        """Ground that at least two passes may share."""
        used = (self._settings.screening, self._settings.max_angle)
        parts = [
            ground_extent(_scan_blocks(run), way, mounting, *used) for run, way in self._passes
        ]
        seen = np.array([part for part in parts if part is not None])
        if len(seen) < 2:
            raise CoverageError(
                f"{len(seen)} of {len(parts)} passes have returns, two are needed", place="scans"
            )
        # what lies west of all eastern ends but one, and so on, is seen at least twice
        low, high = np.sort(seen[:, :2], axis=0)[1], np.sort(seen[:, 2:], axis=0)[-2]
        if not (low < high).all():
            raise _no_ground()
        return float(low[0]), float(low[1]), float(high[0]), float(high[1])

    def first(
        self, mounting: Mounting, area: tuple[float, float, float, float]
    ) -> tuple[PatchDifferences, MotionErrorModel]:
        """Differences between the passes as they are, and how their motion may be wrong."""
        s = self._settings
        found, times = self._look(mounting, area, s.spacing, list(self._passes))
        length = np.repeat(s.drift_time, 3)
        return found, MotionErrorModel.over(times, self._motion_sd, length, s.drift_step)

    def seen(
        self,
        mounting: Mounting,
        area: tuple[float, float, float, float],
        spacing: float,
        wander: MotionErrorModel,
        moved: Floats,
    ) -> PatchDifferences:
        """Differences between the passes, moved east and north, for a mounting."""
        passes = [
            (run, _shift_horizontally(way, wander, p, moved))
            for p, (run, way) in enumerate(self._passes)
        ]
        return self._look(mounting, area, spacing, passes)[0]

    def _look(
        self,
        mounting: Mounting,
        area: tuple[float, float, float, float],
        spacing: float,
        passes: list[tuple[xr.DataTree | str | Path, Trajectory]],
    ) -> tuple[PatchDifferences, list[Floats]]:
        grid = PatchGrid.over(area, spacing)
        if grid.shape[0] * grid.shape[1] > _LARGEST:
            raise CoverageError(
                f"the ground needs {grid.shape[0]} x {grid.shape[1]} cells, at most {_LARGEST}",
                cure="Name an area around some steps, or take larger cells.",
            )
        self._looks += 1
        self._progress(f"look {self._looks} at the ground", 0, None)
        used = (self._settings.screening, self._settings.max_angle)
        parts = [fit_patches(_scan_blocks(run), way, mounting, grid, *used) for run, way in passes]
        found = form_height_differences(parts, grid, self._settings.cluster, mounting)
        if found is None:
            raise _no_ground()
        return found, shared_times(parts)


def _motion_sd(way: Trajectory) -> Floats:
    """Standard deviations of east, north, up, roll, pitch and yaw over a pass."""
    variance = np.einsum("nii->ni", way.covariance).mean(axis=0)
    tilt = 0.5 * (variance[3] + variance[4])
    return np.sqrt([*variance[:3], tilt, tilt, variance[5]])


def _shift_horizontally(
    way: Trajectory, wander: MotionErrorModel, p: int, moved: Floats
) -> Trajectory:
    """The motion of a pass, moved east and north."""
    if not moved.any():
        return way
    by = [wander.line(p, moved, component, way.time) for component in (0, 1)]
    return replace(way, position=way.position + np.stack([*by, np.zeros_like(by[0])], axis=1))


def _no_ground() -> CoverageError:
    return CoverageError(
        "the passes share no ground in which returns lie closely enough",
        cure="Take passes over the same ground, or larger cells: spacing.",
    )


def _scan_blocks(run: xr.DataTree | str | Path) -> Iterator[xr.Dataset]:
    from trueterrain.formats.run import scan_blocks

    return scan_blocks(run, size=BLOCK)
