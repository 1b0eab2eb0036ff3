"""What aligning lanes along reference paths results in."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from trueterrain.alignment.difference_summary import DifferenceSummary
from trueterrain.alignment.discontinuity.path import ReferencePath
from trueterrain.alignment.discontinuity.reference_path import OverlapEdges
from trueterrain.alignment.discontinuity.seam import SeamSteps
from trueterrain.alignment.discontinuity.sparse_sums import Flags, Floats
from trueterrain.alignment.discontinuity.vectors import DiscontinuitySettings, DiscontinuityVectors
from trueterrain.alignment.observations.overlap import Overlap

Names = tuple[str, str]


class CorrectionValues(NamedTuple):
    """Corrections at some places."""

    height: Floats
    "What is taken off heights there [m]."

    station: Floats
    "Station of the reference path [m]."

    beyond: Flags
    "Whether the place lies beyond the ends of the overlap, where the correction stays constant."


@dataclass(frozen=True, kw_only=True, eq=False)
class StationCorrection:
    """Correction of one lane as a function of station."""

    path: ReferencePath
    "Path whose stations count."

    height: Floats
    "What is taken off heights at the reference points, shape (s,) [m]; straight in between."

    begin: float
    "Station of the first reference point with enough heights [m]."

    end: float
    "Station of the last one [m]."

    def at(self, easting: npt.ArrayLike, northing: npt.ArrayLike) -> CorrectionValues:
        """Corrections at places: of points, or of the way of a scanner.

        Parameters
        ----------
        easting, northing : array_like, shape (n,)
            Places [m].

        Returns
        -------
        Corrections
            All of shape (n,); 0 m at places that are not finite.
        """
        found = self.path.locate(easting, northing)
        period = self.path.length if self.path.closed else None
        height = np.interp(found.station, self.path.station, self.height, period=period)
        beyond = found.beyond.copy()
        if not self.path.closed:
            beyond |= (found.station < self.begin) | (found.station > self.end)
        return CorrectionValues(np.nan_to_num(height, nan=0.0), found.station, beyond)


@dataclass(frozen=True, kw_only=True, eq=False)
class PairAlignment:
    """Two lanes brought into agreement."""

    lanes: Names
    "Names; where one of them was aligned before, it is the first."

    corrected: tuple[str, ...]
    "Those that got their correction from this pair."

    overlap: Overlap
    "What both cover."

    path: ReferencePath
    "Reference path through it."

    edges: OverlapEdges
    "Its width along the path."

    discontinuity: DiscontinuityVectors
    "Discontinuity vectors."

    before: DifferenceSummary
    "First lane less second at the reference points, as recorded."

    after: DifferenceSummary
    "The same, corrected."

    seam_before: SeamSteps
    "Steps at the edges of the overlap, as recorded."

    seam_after: SeamSteps
    "The same, corrected."


@dataclass(frozen=True, kw_only=True, eq=False)
class PassAlignment:
    """All lanes brought into agreement, pair by pair."""

    options: DiscontinuitySettings
    "How."

    lanes: tuple[str, ...]
    "Names in the order in which they were aligned."

    pairs: tuple[PairAlignment, ...]
    "Pairs by which they were, in that order."

    corrections: Mapping[str, StationCorrection]
    "Correction of each lane; a fixed one has none."

    states: tuple[Mapping[Names, DifferenceSummary], ...]
    """Agreement in the cells of all lanes that overlap, neighbours or not: as recorded, then after
    each pair."""

    left_out: Mapping[str, int]
    "Points of each lane that are not finite."

    def correction(
        self, lane: str, easting: npt.ArrayLike, northing: npt.ArrayLike
    ) -> CorrectionValues:
        """Corrections of a lane at places.

        Parameters
        ----------
        lane : str
            Name of the lane.
        easting, northing : array_like, shape (n,)
            Places [m].

        Returns
        -------
        Corrections
            Zero, with NaN as station, for a fixed lane.

        Raises
        ------
        ValueError
            If there is no such lane.
        """
        if lane not in self.lanes:
            message = f"lane must be one of {', '.join(self.lanes)}, got {lane!r}."
            raise ValueError(message)
        if lane in self.corrections:
            return self.corrections[lane].at(easting, northing)
        size = np.size(easting)
        return CorrectionValues(np.zeros(size), np.full(size, np.nan), np.zeros(size, np.bool_))
