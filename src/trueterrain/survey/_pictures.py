"""Figures of a survey: drawn while the data are in memory, kept for the report."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from scipy.spatial.transform import Rotation

from trueterrain import figures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from trueterrain.alignment.merge import MergeResult
    from trueterrain.survey._products import SurfaceResult
    from trueterrain.survey.runs import ProcessedRun

_COVERED = 0.99  # fraction of the differences before alignment that the colours cover
_SHOWN = 3  # profiles in one picture
_SHOWN_KNOTS = 60_000  # of the trajectory in the picture of the motion; 1 ms apart in a minute
_PART = 6.0  # [m] of a surface that is drawn node by node


@dataclass(eq=False)
class Pictures:
    """Figures by surface and kind; also written as PNG if there is a folder."""

    folder: Path | None
    "Where they are written."

    figures: dict[tuple[str, str], "Figure"] = field(default_factory=dict)
    "Lane and kind, and the figure."

    parts: dict[str, xr.Dataset] = field(default_factory=dict)
    "Part of each lane, node by node."

    files: list[tuple[str, str]] = field(default_factory=list)
    "Names of files, and what they show."

    def of_lane(self, lane: str, surface: xr.Dataset, profiles: dict[str, xr.Dataset]) -> None:
        """Draw a surface and its profiles.

        Parameters
        ----------
        lane : str
            Name of the lane.
        surface : xarray.Dataset
            Its surface.
        profiles : dict of xarray.Dataset
            Its profiles by name.
        """
        self.parts[lane] = _central_part(surface)
        self._keep(lane, "part", figures.surface_map(self.parts[lane]), "part of the surface")
        if profiles:
            some = dict(list(profiles.items())[:_SHOWN])
            self._keep(lane, "profiles", figures.profiles(some), "profiles")

    def of_whole(self, lane: "SurfaceResult") -> None:
        """Draw the whole surface.

        Parameters
        ----------
        lane : SurfaceResult
            The surface.
        """
        self.of_surface(lane.name, lane.coarse)

    def of_surface(self, lane: str, surface: xr.Dataset) -> None:
        """Draw a surface from above.

        Parameters
        ----------
        lane : str
            Name of the lane.
        surface : xarray.Dataset
            Its surface.
        """
        self._keep(lane, "surface", figures.surface_map(surface), "surface")

    def of_motion(self, run: "ProcessedRun") -> None:
        """Draw how the body moved.

        Parameters
        ----------
        run : ProcessedRun
            The run.
        """
        t = run.record.trajectory
        some = slice(None, None, -(-t.time.size // _SHOWN_KNOTS))
        rotation = Rotation.from_quat(t.quaternion[some])
        _, pitch, roll = np.unwrap(rotation.as_euler("ZYX"), axis=0).T
        motion = {"time": t.time[some], "up": t.position[some, 2], "pitch": pitch, "roll": roll}
        self._keep(run.name, "motion", figures.body_motion(motion), "motion of the body")

    def of_merging(
        self, merging: "MergeResult", runs: "Sequence[ProcessedRun]", cell: float
    ) -> None:
        """Draw how passes were brought into agreement.

        Parameters
        ----------
        merging : MergeResult
            The alignment.
        runs : sequence of ProcessedRun
            The runs as they were before.
        cell : float
            Size of the cells in which they were compared [m].
        """
        found, vectors = merging.adjustment, merging.alignment
        if found is not None:
            reported_sd = {
                run.name: (
                    run.record.trajectory.time,
                    np.sqrt(run.record.trajectory.covariance[:, 2, 2]),
                )
                for run in runs
            }
            self._merge(
                "correction",
                figures.pass_correction(found.corrections, navigation_sd=reported_sd or None),
            )
            largest = float(np.nanquantile(found.ground.before, _COVERED))
            for when in ("before", "after"):
                self._merge(
                    when,
                    figures.discrepancy_map(
                        found.ground, when=when, rejected=found.rejected, largest=largest, cell=cell
                    ),
                )
            self._merge("choice", figures.strength_choice(found))
            self._merge("spectrum", figures.correction_spectrum(found.corrections))
        if vectors is not None:
            pair = vectors.pairs[0]
            self._merge("vectors", figures.discontinuity_vectors(pair))
            stations = pair.discontinuity.station[~pair.discontinuity.gap]
            centre = float(stations[stations.size // 2])
            self._merge("histograms", figures.pass_histograms(pair.discontinuity, station=centre))
        for number, seam in enumerate(merging.seams, start=1):
            if np.isfinite(seam.before.median):
                self._merge("seam" if number == 1 else f"seam-{number}", figures.seam_steps(seam))

    def _merge(self, kind: str, axes: Any) -> None:
        self._keep("merge", kind, axes, f"passes, {kind}")

    def close(self) -> None:
        """Close all figures."""
        from matplotlib import pyplot as plt

        for figure in self.figures.values():
            plt.close(figure)

    def _keep(self, lane: str, kind: str, axes: Any, what: str) -> None:
        self.figures[lane, kind] = axes.figure
        if self.folder is not None:
            file = f"{lane}-{kind}.png"
            figures.save_figure(axes.figure, self.folder / file)
            self.files.append((file, f"{lane}: {what}"))


def _central_part(surface: xr.Dataset) -> xr.Dataset:
    """Central part of a long surface, in which single stones are visible."""
    if "u" not in surface.dims:
        return surface
    u = surface["u"].values
    centre = 0.5 * (u[0] + u[-1])
    return surface.sel(u=slice(centre - 0.5 * _PART, centre + 0.5 * _PART)).copy(deep=True)
