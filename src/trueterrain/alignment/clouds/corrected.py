"""Corrected passes of point clouds, whose points are corrected while they are read."""

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr

from trueterrain.alignment.apply import corrected_points
from trueterrain.alignment.clouds.inspection import HEIGHTS
from trueterrain.alignment.clouds.passes import CloudPass, blocks_of
from trueterrain.alignment.discontinuity.alignment import correct_points
from trueterrain.alignment.discontinuity.reference_path import ReferencePath
from trueterrain.alignment.merge import MergeResult
from trueterrain.alignment.observations.cells import PassPath
from trueterrain.core import provenance
from trueterrain.surface.cells import Grid
from trueterrain.surface.grid import GridSettings, grid_points

_STEP = 1e-4  # [m] maximum step of corrected coordinates
_ROUND_OFF = 1e-6  # of a whole number of steps
_FORMER = "extra_source"


@dataclass(frozen=True, kw_only=True, eq=False)
class CorrectedPass:
    """One corrected pass. Calling it yields its points in blocks."""

    cloud: CloudPass
    "Its uncorrected points."

    merging: MergeResult
    "Result of the alignment."

    station: ReferencePath | None
    "Path whose stations replace times; None if times are used, or not needed."

    path: PassPath | None
    "Position and heading of the pass as functions of time or station."

    def __call__(self) -> Iterator[xr.Dataset]:
        """Blocks of its corrected points."""
        for block in self.cloud():
            yield self.corrected(block)

    def corrected(self, block: xr.Dataset) -> xr.Dataset:
        """Correct some of its points.

        Parameters
        ----------
        block : xarray.Dataset
            Points of the pass.

        Returns
        -------
        xarray.Dataset
            With all variables of the pass, its number as ``lane``, and with the method network
            ``sd_relative``: the standard deviation of the correction, relative to the datum. ``sd``
            is there if that of the datum or of the points is known. A ``lane`` that changes is kept
            as ``extra_source``.
        """
        found, name = block, self.cloud.name
        if self.merging.alignment is not None:
            found = correct_points(block, self.merging.alignment, name)
        elif self.merging.adjustment is not None:
            found = self._by_network(block)
        known = (*self.cloud.variables, "sd", "sd_relative")
        found = found[[one for one in found.data_vars if one in known]]
        if self._renumbered:
            found = found.rename(lane=_FORMER)
        number = np.full(block.sizes["point"], self.cloud.label, np.int64)
        return _refine_steps(found.assign(lane=("point", number, {"units": "1"})))

    @property
    def _renumbered(self) -> bool:
        """Whether its points get another number; numbers from before an earlier merge are kept."""
        known = self.cloud.variables
        return (
            "lane" in known and _FORMER not in known and self.cloud.numbers != (self.cloud.label,)
        )

    def _by_network(self, block: xr.Dataset) -> xr.Dataset:
        adjustment = self.merging.adjustment
        if adjustment is None or self.cloud.name not in adjustment.names:
            # a fixed pass is the datum: its relative standard deviation is 0
            none, metres = np.zeros(block.sizes["point"]), {"units": "m"}
            found = block.assign(sd_relative=("point", none, metres))
            datum = adjustment.datum_sd.get(self.cloud.name) if adjustment else None
            if "sd" in block or datum is None:
                return found
            return found.assign(sd=("point", none + datum, metres))
        timed = with_time(block, self.station)
        found = corrected_points(timed, adjustment.correction(self.cloud.name), self.path)
        if self.station is None:
            return found
        return found.assign(time=block["time"]) if "time" in block else found.drop_vars("time")


class CorrectedClouds(Mapping[str, CorrectedPass]):
    """Corrected passes by name; points stay on disk.

    Parameters
    ----------
    passes : mapping of str to CorrectedPass
        The passes.
    """

    def __init__(self, passes: Mapping[str, CorrectedPass]) -> None:
        self._passes = dict(passes)

    def __getitem__(self, name: str) -> CorrectedPass:
        """Pass of a name."""
        return self._passes[name]

    def __iter__(self) -> Iterator[str]:
        """Names of the passes."""
        return iter(self._passes)

    def __len__(self) -> int:
        """Number of passes."""
        return len(self._passes)

    @property
    def deviations(self) -> tuple[str, ...]:
        """Standard deviations that all corrected points have, of sd and sd_relative."""
        adjustment = next(iter(self._passes.values())).merging.adjustment
        given = set()
        if adjustment is not None:
            given = {"sd_relative"}
            if all(sd is not None for sd in adjustment.datum_sd.values()):
                given.add("sd")
        return tuple(
            name
            for name in ("sd", "sd_relative")
            if name in given or all(name in one.cloud.variables for one in self._passes.values())
        )

    def blocks(self, variables: Collection[str] | None = None) -> Iterator[xr.Dataset]:
        """Corrected points of all passes, in blocks; each file is read once.

        Parameters
        ----------
        variables : collection of str, optional
            Variables that are read; by default those that all passes have.

        Yields
        ------
        xarray.Dataset
            Points with the same variables in all blocks, to be written to one file.
        """
        passes = [one.cloud for one in self._passes.values()]
        same = set.intersection(*({*cloud.variables} for cloud in passes)) | {
            "lane",
            *self.deviations,
        }
        if all(one._renumbered for one in self._passes.values()):
            same.add(_FORMER)
        for cloud, block in blocks_of(passes, variables):
            found = self._passes[cloud.name].corrected(block)
            yield found.drop_vars([name for name in found.data_vars if name not in same])


def _refine_steps(points: xr.Dataset) -> xr.Dataset:
    """Points with a coordinate step fine enough for a correction, a fraction of the old one."""
    scale = points.attrs.get("coordinate_scale")
    if scale is None:
        return points
    finer = [step / max(1.0, np.ceil(step / _STEP - _ROUND_OFF)) for step in scale]
    return points.assign_attrs(coordinate_scale=finer)


def with_time(block: xr.Dataset, station: ReferencePath | None) -> xr.Dataset:
    """Points with stations as times, where stations replace times.

    Parameters
    ----------
    block : xarray.Dataset
        Points.
    station : ReferencePath or None
        Path whose stations [m] replace times.

    Returns
    -------
    xarray.Dataset
        The same points if there is no path.
    """
    if station is None:
        return block
    at = station.locate(block["easting"].values, block["northing"].values).station
    return block.assign(time=("point", at, {"units": "s"}))


def merged_surface(
    corrected: CorrectedClouds,
    grid: Grid,
    settings: GridSettings = GridSettings(),
    *,
    threads: int = 1,
) -> xr.Dataset:
    """Grid all corrected passes to one surface.

    Parameters
    ----------
    corrected : CorrectedClouds
        Corrected passes.
    grid : Grid
        Grid of the surface.
    settings : GridSettings
        Statistic of each cell; medians and percentiles read the files several times.
    threads : int
        Number of threads; the surface does not depend on it.

    Returns
    -------
    xarray.Dataset
        Surface with ``height``, ``count`` and ``sd_relative``, and ``sd`` if it is known.

    Raises
    ------
    CoverageError
        If there are no points on the grid.

    Notes
    -----
    The variance of a height is the scatter of the points over their count, plus the mean variance
    of the corrections of the points in the cell. The latter is treated as one error common to all
    passes of the cell. Errors of different passes are correlated less, so ``sd_relative`` is an
    upper bound where passes overlap. It is relative to the datum of the adjustment. ``sd`` is there
    only if the standard deviation of the datum is known: from an ``sd`` of the points, which is not
    reduced by the number of passes, from control points, or from the settings. The methods
    discontinuity and grid give no standard deviations.
    """

    class RepeatableBlocks(Iterable[xr.Dataset]):
        """Blocks of corrected points that can be iterated repeatedly."""

        def __init__(self, left_out: str) -> None:
            self._left_out = left_out

        def __iter__(self) -> Iterator[xr.Dataset]:
            for block in corrected.blocks((*HEIGHTS, "sd", "sd_relative")):
                yield block.drop_vars(self._left_out, errors="ignore")

    both = {"sd", "sd_relative"} <= set(corrected.deviations)
    surface = grid_points(
        RepeatableBlocks("sd_relative" if both else ""), grid, settings, threads=threads
    )
    if both:
        relative = grid_points(RepeatableBlocks("sd"), grid, settings, threads=threads)
        surface = surface.assign(sd_relative=relative["sd_relative"])
    files = sorted({file for one in corrected.values() for file in one.cloud.files})
    merging = next(iter(corrected.values())).merging
    return provenance.add_step(
        surface,
        "grid merged lanes",
        parameters={
            "method": merging.method,
            "lanes": list(corrected),
            "options": settings,
            "spacing": grid.spacing,
        },
        inputs=files,
    )
