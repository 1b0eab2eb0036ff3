"""Results of the alignment along reference paths."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from trueterrain.alignment.discontinuity.centre_line import OverlapEdges
from trueterrain.alignment.discontinuity.path import ReferencePath
from trueterrain.alignment.discontinuity.seams import SeamSteps
from trueterrain.alignment.discontinuity.vectors import DiscontinuitySettings, DiscontinuityVectors
from trueterrain.alignment.observations.overlap import Overlap
from trueterrain.alignment.observations.sparse_sums import Flags, Floats
from trueterrain.surface.difference import DifferenceSummary

Names = tuple[str, str]


class CorrectionValues(NamedTuple):
    """Corrections at some positions."""

    height: Floats
    "Correction to subtract from heights [m]."

    station: Floats
    "Station of the reference path [m]."

    beyond: Flags
    "Whether the position lies beyond the ends of the overlap; the correction is constant there."


@dataclass(frozen=True, kw_only=True, eq=False)
class StationCorrection:
    """Correction of one pass as a function of station."""

    path: ReferencePath
    "Path to which the stations refer."

    height: Floats
    "Correction to subtract at the reference points, shape (s,) [m]; linear in between."

    begin: float
    "Station of the first reference point with enough heights [m]."

    end: float
    "Station of the last one [m]."

    def at(self, easting: npt.ArrayLike, northing: npt.ArrayLike) -> CorrectionValues:
        """Corrections at positions, of points or of a scanner.

        Parameters
        ----------
        easting, northing : array_like, shape (n,)
            Positions [m].

        Returns
        -------
        CorrectionValues
            Of shape (n,); 0 m at positions that are not finite.
        """
        found = self.path.locate(easting, northing)
        period = self.path.curve.length if self.path.curve.closed else None
        height = np.interp(found.station, self.path.curve.s, self.height, period=period)
        beyond = found.beyond.copy()
        if not self.path.curve.closed:
            beyond |= (found.station < self.begin) | (found.station > self.end)
        return CorrectionValues(np.nan_to_num(height, nan=0.0), found.station, beyond)


@dataclass(frozen=True, kw_only=True, eq=False)
class PairAlignment:
    """Alignment of two passes."""

    names: Names
    "Names; a pass that is aligned already comes first."

    corrected: tuple[str, ...]
    "Names of the passes that this pair corrects."

    overlap: Overlap
    "Overlap of both."

    path: ReferencePath
    "Reference path through it."

    edges: OverlapEdges
    "Centre and width of the overlap along the path."

    discontinuity: DiscontinuityVectors
    "Discontinuity vectors."

    before: DifferenceSummary
    "First pass less second at the reference points, before the correction."

    after: DifferenceSummary
    "First pass less second at the reference points, corrected."

    seam_before: SeamSteps
    "Steps at the edges of the overlap, before the correction."

    seam_after: SeamSteps
    "Steps at the edges of the overlap, corrected."


@dataclass(frozen=True, kw_only=True, eq=False)
class PassAlignment:
    """Alignment of all passes, pair by pair."""

    settings: DiscontinuitySettings
    "Settings."

    names: tuple[str, ...]
    "Names in order of alignment."

    pairs: tuple[PairAlignment, ...]
    "Pairs in order of alignment."

    corrections: Mapping[str, StationCorrection]
    "Correction of each pass; a fixed pass has none."

    states: tuple[Mapping[Names, DifferenceSummary], ...]
    """Agreement in the cells of all overlaps: before the alignment, then after each pair."""

    left_out: Mapping[str, int]
    "Number of points of each pass that are not finite."

    def correction(
        self, name: str, easting: npt.ArrayLike, northing: npt.ArrayLike
    ) -> CorrectionValues:
        """Corrections of a pass at positions.

        Parameters
        ----------
        name : str
            Name of the pass.
        easting, northing : array_like, shape (n,)
            Positions [m].

        Returns
        -------
        CorrectionValues
            For a fixed pass 0, with NaN as station.

        Raises
        ------
        ValueError
            If there is no such pass.
        """
        if name not in self.names:
            message = f"name must be one of {', '.join(self.names)}, got {name!r}."
            raise ValueError(message)
        if name in self.corrections:
            return self.corrections[name].at(easting, northing)
        size = np.size(easting)
        return CorrectionValues(np.zeros(size), np.full(size, np.nan), np.zeros(size, np.bool_))
