"""Passes over the same ground: their height differences for a mounting, and their motion errors."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from trueterrain.core.errors import CoverageError
from trueterrain.core.progress import Progress
from trueterrain.formats.run import Mounting, Run, scan_blocks
from trueterrain.georeference._differences import (
    PatchDifferences,
    common_times,
    form_height_differences,
)
from trueterrain.georeference._motion_errors import MotionErrorModel
from trueterrain.georeference._patches import BLOCK, PatchGrid, fit_patches, ground_extent
from trueterrain.georeference.settings import CalibrationSettings
from trueterrain.motion.trajectory import Trajectory

Floats = npt.NDArray[np.float64]

_MAX_CELLS = 3_000_000  # cells


class CalibrationPasses:
    """Runs of a calibration with their trajectories.

    Parameters
    ----------
    runs : sequence of Run
        Passes over the same ground.
    trajectories : sequence of Trajectory
        Trajectory of each.
    settings : CalibrationSettings
        Selection of returns and size of cells.
    progress : callable
        Called at each evaluation of the ground.
    """

    def __init__(
        self,
        runs: Sequence[Run],
        trajectories: Sequence[Trajectory],
        settings: CalibrationSettings,
        progress: Progress,
    ) -> None:
        self._passes = list(zip(runs, trajectories, strict=True))
        self._settings = settings
        self._progress = progress
        self._views = 0
        self._motion_sd = np.stack([_motion_sd(trajectory) for trajectory in trajectories])

    @property
    def count(self) -> int:
        """Number of passes."""
        return len(self._passes)

    def area(self, mounting: Mounting) -> tuple[float, float, float, float]:
        """West, south, east, north of the ground that at least two passes may see [m]."""
        used = (self._settings.screening, self._settings.max_angle)
        parts = [
            ground_extent(scan_blocks(run, size=BLOCK), trajectory, mounting, *used)
            for run, trajectory in self._passes
        ]
        seen = np.array([part for part in parts if part is not None])
        if len(seen) < 2:
            raise CoverageError(
                f"{len(seen)} of {len(parts)} passes have returns, two are needed", place="scans"
            )
        # ground seen at least twice lies east of the second lowest western edge, and so on
        low, high = np.sort(seen[:, :2], axis=0)[1], np.sort(seen[:, 2:], axis=0)[-2]
        if not (low < high).all():
            raise _no_ground()
        return float(low[0]), float(low[1]), float(high[0]), float(high[1])

    def first(
        self, mounting: Mounting, area: tuple[float, float, float, float]
    ) -> tuple[PatchDifferences, MotionErrorModel]:
        """Height differences of the uncorrected passes, and the model of their motion errors."""
        s = self._settings
        found, times = self._view(mounting, area, s.spacing, list(self._passes))
        length = np.repeat(s.drift_time, 3)
        return found, MotionErrorModel.over(times, self._motion_sd, length, s.drift_step)

    def seen(
        self,
        mounting: Mounting,
        area: tuple[float, float, float, float],
        spacing: float,
        errors: MotionErrorModel,
        moved: Floats,
    ) -> PatchDifferences:
        """Height differences for a mounting, of passes corrected by `moved` east and north."""
        passes = [
            (run, _shift_horizontally(trajectory, errors, p, moved))
            for p, (run, trajectory) in enumerate(self._passes)
        ]
        return self._view(mounting, area, spacing, passes)[0]

    def _view(
        self,
        mounting: Mounting,
        area: tuple[float, float, float, float],
        spacing: float,
        passes: list[tuple[Run, Trajectory]],
    ) -> tuple[PatchDifferences, list[Floats]]:
        grid = PatchGrid.over(area, spacing)
        if grid.shape[0] * grid.shape[1] > _MAX_CELLS:
            raise CoverageError(
                f"the ground needs {grid.shape[0]} x {grid.shape[1]} cells, at most {_MAX_CELLS}",
                cure="Name an area around some steps, or take larger cells.",
            )
        self._views += 1
        self._progress(f"evaluation {self._views} of the ground", 0, None)
        used = (self._settings.screening, self._settings.max_angle)
        parts = [
            fit_patches(scan_blocks(run, size=BLOCK), trajectory, mounting, grid, *used)
            for run, trajectory in passes
        ]
        found = form_height_differences(parts, grid, self._settings.cluster, mounting)
        if found is None:
            raise _no_ground()
        return found, common_times(parts)


def _motion_sd(trajectory: Trajectory) -> Floats:
    """Standard deviations of east, north, up, roll, pitch and yaw, mean over a pass, shape (6,).

    The covariance refers to rotations about east and north; roll and pitch each get their mean.
    """
    variance = np.einsum("nii->ni", trajectory.covariance).mean(axis=0)
    tilt = 0.5 * (variance[3] + variance[4])
    return np.sqrt([*variance[:3], tilt, tilt, variance[5]])


def _shift_horizontally(
    trajectory: Trajectory, errors: MotionErrorModel, p: int, moved: Floats
) -> Trajectory:
    """Trajectory of a pass, displaced east and north by the estimated errors."""
    if not moved.any():
        return trajectory
    by = [errors.interpolate(p, moved, component, trajectory.time) for component in (0, 1)]
    return replace(
        trajectory, position=trajectory.position + np.stack([*by, np.zeros_like(by[0])], axis=1)
    )


def _no_ground() -> CoverageError:
    """Error of passes without common cells."""
    return CoverageError(
        "the passes have no common ground with enough returns",
        cure="Take passes over the same ground, or larger cells: spacing.",
    )
