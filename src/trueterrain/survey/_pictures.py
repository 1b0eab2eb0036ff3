"""The pictures of a survey: drawn while the data are there, kept for the report."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from trueterrain import figures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from trueterrain.survey._lane import Lane, Run

_PART = 6.0  # [m] of a lane that is drawn node by node


@dataclass(eq=False)
class Pictures:
    """Figures by lane and kind; each is written as PNG, too, if there is a folder."""

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
        self.parts[lane] = _middle(surface)
        self._keep(lane, "part", figures.surface_map(self.parts[lane]), "part of the surface")
        if profiles:
            self._keep(lane, "profiles", figures.profiles(profiles), "profiles")

    def of_whole(self, lane: "Lane") -> None:
        """Draw the whole surface.

        Parameters
        ----------
        lane : Lane
            The lane.
        """
        self._keep(lane.name, "surface", figures.surface_map(lane.coarse), "surface")

    def of_motion(self, run: "Run") -> None:
        """Draw how the body moved.

        Parameters
        ----------
        run : Run
            The run.
        """
        t = run.taken.trajectory
        _, pitch, roll = np.unwrap(t.at(t.time).rotation.as_euler("ZYX"), axis=0).T
        motion = {"time": t.time, "up": t.position[:, 2], "pitch": pitch, "roll": roll}
        self._keep(run.name, "motion", figures.body_motion(motion), "motion of the body")

    def close(self) -> None:
        """Let go of all figures."""
        from matplotlib import pyplot as plt

        for figure in self.figures.values():
            plt.close(figure)

    def _keep(self, lane: str, kind: str, axes: Any, what: str) -> None:
        self.figures[lane, kind] = axes.figure
        if self.folder is not None:
            file = f"{lane}-{kind}.png"
            figures.save(axes.figure, self.folder / file)
            self.files.append((file, f"{lane}: {what}"))


def _middle(surface: xr.Dataset) -> xr.Dataset:
    """A part of a long lane from its middle, so that single stones are seen."""
    if "u" not in surface.dims:
        return surface
    u = surface["u"].values
    middle = 0.5 * (u[0] + u[-1])
    return surface.sel(u=slice(middle - 0.5 * _PART, middle + 0.5 * _PART)).copy(deep=True)
