"""Lanes of point clouds as they come out of a merging: corrected while they are read."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr

from trueterrain.alignment.apply import corrected_points
from trueterrain.alignment.clouds.passes import CloudPass, blocks_of
from trueterrain.alignment.discontinuity.alignment import correct_points
from trueterrain.alignment.discontinuity.reference_path import ReferencePath
from trueterrain.alignment.merge import MergeResult
from trueterrain.alignment.observations.centring import Path

_STEP = 1e-4  # [m] of corrected coordinates at most
_ROUND_OFF = 1e-6  # of a whole number of steps
_FORMER = "extra_source"


@dataclass(frozen=True, kw_only=True, eq=False)
class CorrectedPass:
    """One lane in agreement with the others. Called, it yields its points block by block."""

    lane: CloudPass
    "Its points as they were."

    merging: MergeResult
    "How lanes were brought into agreement."

    station: ReferencePath | None
    "Path whose stations stand for time; None if its times do, or nothing needs them."

    path: Path | None
    "Where the pass was at its times, or stations."

    def __call__(self) -> Iterator[xr.Dataset]:
        """Blocks of its corrected points."""
        for block in self.lane():
            yield self.corrected(block)

    def corrected(self, block: xr.Dataset) -> xr.Dataset:
        """Some of its points, corrected.

        Parameters
        ----------
        block : xarray.Dataset
            Points of the lane.

        Returns
        -------
        xarray.Dataset
            With all their variables, ``lane`` that tells passes apart, and by the method network
            ``sd_relative``: that of the correction, relative to the datum. ``sd`` is there where
            the datum or the points' own is known. Where ``lane`` is another number than before,
            the former one is in ``extra_source``.
        """
        found, name = block, self.lane.name
        if self.merging.alignment is not None:
            found = correct_points(block, self.merging.alignment, name)
        elif self.merging.adjustment is not None:
            found = self._by_network(block)
        known = (*self.lane.variables, "sd", "sd_relative")
        found = found[[one for one in found.data_vars if one in known]]
        if self._renumbered:
            found = found.rename(lane=_FORMER)
        number = np.full(block.sizes["point"], self.lane.label, np.int64)
        return _in_finer_steps(found.assign(lane=("point", number, {"units": "1"})))

    @property
    def _renumbered(self) -> bool:
        """Whether numbers of its points are lost; those before an earlier merging are kept."""
        known = self.lane.variables
        return "lane" in known and _FORMER not in known and self.lane.numbers != (self.lane.label,)

    def _by_network(self, block: xr.Dataset) -> xr.Dataset:
        adjustment = self.merging.adjustment
        if adjustment is None or self.lane.name not in adjustment.names:
            # a fixed lane is the datum, and as sure as its points
            none, metres = np.zeros(block.sizes["point"]), {"units": "m"}
            found = block.assign(sd_relative=("point", none, metres))
            datum = adjustment.datum_sd.get(self.lane.name) if adjustment else None
            if "sd" in block or datum is None:
                return found
            return found.assign(sd=("point", none + datum, metres))
        timed = with_time(block, self.station)
        found = corrected_points(timed, adjustment.correction(self.lane.name), self.path)
        if self.station is None:
            return found
        return found.assign(time=block["time"]) if "time" in block else found.drop_vars("time")


class CorrectedClouds(Mapping[str, CorrectedPass]):
    """Lanes in agreement, by name; no point is held in memory.

    Parameters
    ----------
    lanes : mapping of str to CorrectedLane
        The lanes.
    """

    def __init__(self, lanes: Mapping[str, CorrectedPass]) -> None:
        self._lanes = dict(lanes)

    def __getitem__(self, name: str) -> CorrectedPass:
        """One of them."""
        return self._lanes[name]

    def __iter__(self) -> Iterator[str]:
        """Names."""
        return iter(self._lanes)

    def __len__(self) -> int:
        """How many there are."""
        return len(self._lanes)

    @property
    def deviations(self) -> tuple[str, ...]:
        """Standard deviations that all corrected points have: of sd and sd_relative."""
        adjustment = next(iter(self._lanes.values())).merging.adjustment
        given = set()
        if adjustment is not None:
            given = {"sd_relative"}
            if all(sd is not None for sd in adjustment.datum_sd.values()):
                given.add("sd")
        return tuple(
            name
            for name in ("sd", "sd_relative")
            if name in given or all(name in one.lane.variables for one in self._lanes.values())
        )

    def blocks(self, variables: Collection[str] | None = None) -> Iterator[xr.Dataset]:
        """Points of all lanes, corrected, each file read once.

        Parameters
        ----------
        variables : collection of str, optional
            Variables that are read; by default all that all lanes have.

        Yields
        ------
        xarray.Dataset
            Points, all with the same variables, so that they can be written to one file.
        """
        lanes = [one.lane for one in self._lanes.values()]
        same = set.intersection(*({*lane.variables} for lane in lanes)) | {"lane", *self.deviations}
        if all(one._renumbered for one in self._lanes.values()):
            same.add(_FORMER)
        for lane, block in blocks_of(lanes, variables):
            found = self._lanes[lane.name].corrected(block)
            yield found.drop_vars([name for name in found.data_vars if name not in same])


def _in_finer_steps(points: xr.Dataset) -> xr.Dataset:
    """Points whose steps of coordinates are fine enough for a correction, and hold what was."""
    scale = points.attrs.get("coordinate_scale")
    if scale is None:
        return points
    finer = [step / max(1.0, np.ceil(step / _STEP - _ROUND_OFF)) for step in scale]
    return points.assign_attrs(coordinate_scale=finer)


def with_time(block: xr.Dataset, station: ReferencePath | None) -> xr.Dataset:
    """Points with their stations as time, if these stand for it.

    Parameters
    ----------
    block : xarray.Dataset
        Points.
    station : ReferencePath or None
        Path whose stations [m] stand for time.

    Returns
    -------
    xarray.Dataset
        The same points if there is no path.
    """
    if station is None:
        return block
    at = station.locate(block["easting"].values, block["northing"].values).station
    return block.assign(time=("point", at, {"units": "s"}))
