"""Discontinuity vectors of two passes (thesis 4.3.1, Figs 4-4 and 4-5)."""

from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from trueterrain.alignment.discontinuity.area_sums import AreaHeights, HeightHistograms, SearchArea
from trueterrain.alignment.discontinuity.centre_line import OverlapEdges
from trueterrain.alignment.discontinuity.low_pass import low_pass
from trueterrain.alignment.discontinuity.path import ReferencePath
from trueterrain.alignment.observations.sparse_sums import Flags, Floats, Integers
from trueterrain.core.errors import CoverageError

Statistic = Literal["mean", "median"]
Reference = Literal["pooled", "midway"]

_MEDIAN_ERROR = (
    1.2533  # standard error of a median over that of a mean for normal values: sqrt(pi / 2)
)
_BIN = 1e-5  # [m] resolution of heights; the width of bins is a multiple of it


@dataclass(frozen=True, kw_only=True)
class DiscontinuitySettings:
    """Settings of the alignment along reference paths."""

    spacing: float = 0.25
    "Distance of the reference points [m]."

    radius: float = 0.2
    "Radius of the search disc around each reference point [m]."

    cut_off: float = 2.5
    """Cut-off wavelength of the correction, with a transmission of 50 % [m]: longer waves are
    drift, shorter ones noise."""

    statistic: Statistic = "mean"
    "Statistic of the heights of a pass in a disc: mean or median."

    reference: Reference = "pooled"
    """Reference height: mean of all points of both passes (pooled), or mean of the two passes
    (midway)."""

    cell: float = 0.1
    "Size of the cells from which the overlap is found [m]."

    smoothing: float = 10.0
    """Wavelength below which a path along the centre does not follow the overlap [m]; the search
    areas do."""

    least: int = 20
    "Minimum number of points of each pass in a disc; with fewer there is a gap."

    max_gap_fraction: float = 0.5
    "Maximum fraction of reference points that are gaps [1]."

    bin_width: float = 1e-3
    "Width of the bins of the histograms, a multiple of 0.00001 m [m]."

    def __post_init__(self) -> None:
        """Check the values."""
        for name in ("spacing", "radius", "cut_off", "cell", "smoothing"):
            value = getattr(self, name)
            if not 0 < value < np.inf:
                message = f"{name} must be greater than 0 m, got {value}."
                raise ValueError(message)
        for name, known in (("statistic", Statistic), ("reference", Reference)):
            if getattr(self, name) not in get_args(known):
                message = (
                    f"{name} must be one of {', '.join(get_args(known))}, got "
                    f"{getattr(self, name)!r}."
                )
                raise ValueError(message)
        if self.cut_off < 2 * self.spacing:
            message = (
                f"cut_off must be at least twice the spacing of {self.spacing:g} m, got "
                f"{self.cut_off:g} m."
            )
            raise ValueError(message)
        if self.least < 2:
            message = f"least must be at least 2 points, got {self.least}."
            raise ValueError(message)
        if not 0 <= self.max_gap_fraction < 1:
            message = (
                f"max_gap_fraction must be at least 0 and less than 1, got {self.max_gap_fraction}."
            )
            raise ValueError(message)
        whole = self.bin_width / _BIN
        if not (whole > 0.5 and abs(whole - round(whole)) < 1e-6):
            message = f"bin_width must be a multiple of 0.00001 m, got {self.bin_width}."
            raise ValueError(message)


@dataclass(frozen=True, kw_only=True, eq=False)
class DiscontinuityVectors:
    """Discontinuity vectors: heights of two passes less the reference height along a path."""

    names: tuple[str, str]
    "Names of the passes, in the order of the rows below."

    station: Floats
    "Stations of the reference points, shape (s,) [m]."

    height: Floats
    "Mean or median height of each pass in the search areas, uncorrected, shape (2, s) [m]."

    sd: Floats
    "Standard deviation of the heights in the areas, ground included, shape (2, s) [m]."

    count: Integers
    "Number of heights, shape (2, s)."

    histograms: tuple[HeightHistograms, HeightHistograms]
    "Histograms of the uncorrected heights of each pass (Fig. 4-4)."

    reference_height: Floats
    "Reference height, shape (s,) [m]; NaN in gaps."

    raw: Floats
    "Height of each pass less the reference height (Fig. 4-5), shape (2, s) [m]; NaN in gaps."

    error: Floats
    """Standard deviation of `raw` from the scatter of the heights, as if they were independent,
    shape (2, s) [m]."""

    filtered: Floats
    "Low-pass filtered `raw`, interpolated over gaps: the correction, shape (2, s) [m]."

    gap: Flags
    "True for too few points, or a search area that leaves the overlap, shape (s,)."

    thin: Flags
    "True for a search area that leaves the overlap, shape (s,)."

    width: Floats
    "Width of the overlap, shape (s,) [m]."

    @property
    def ends(self) -> tuple[float, float]:
        """Stations of the first and the last reference point that is no gap [m]."""
        known = self.station[~self.gap]
        return float(known[0]), float(known[-1])


def reference_height(
    height: npt.ArrayLike, count: npt.ArrayLike, how: Reference = "pooled"
) -> Floats:
    """Reference height of several passes (thesis Eq. 4-1).

    Parameters
    ----------
    height : array_like, shape (pass, s)
        Mean height of each pass [m].
    count : array_like, shape (pass, s)
        Number of points of each mean.
    how : {"pooled", "midway"}
        Mean of all points of all passes, or mean of the passes.

    Returns
    -------
    numpy.ndarray, shape (s,)
        Reference height [m].

    Notes
    -----
    As printed in the thesis, Eq. 4-1 is the sum of the means of both passes, twice the height. The
    right form is the mean over all points, ``(n1 z1 + n2 z2) / (n1 + n2)``.

    Examples
    --------
    >>> reference_height([[0.10], [0.14]], [[300], [100]])
    array([0.11])
    >>> reference_height([[0.10], [0.14]], [[300], [100]], "midway")
    array([0.12])
    """
    z = np.asarray(height, dtype=float)
    n = np.asarray(count, dtype=float) if how == "pooled" else np.ones(z.shape)
    # relative to the first pass, which avoids cancellation at heights of hundreds of metres
    return np.asarray(z[0] + (n * (z - z[0])).sum(axis=0) / n.sum(axis=0))


def discontinuity_vectors(
    heights: tuple[AreaHeights, AreaHeights],
    path: ReferencePath,
    area: SearchArea,
    edges: OverlapEdges,
    inside: Flags,
    settings: DiscontinuitySettings,
    *,
    names: tuple[str, str],
    aligned: Floats | None = None,
) -> DiscontinuityVectors:
    """Compute the discontinuity vectors of two passes.

    Parameters
    ----------
    heights : tuple of AreaHeights
        Heights of both passes in the search areas.
    path : ReferencePath
        Reference path.
    area : SearchArea
        Search area.
    edges : Edges
        Centre and width of the overlap along the path.
    inside : numpy.ndarray of bool, shape (s,)
        Whether the search areas lie inside the overlap.
    settings : DiscontinuitySettings
        Statistic, reference and filter.
    names : tuple of str
        Names of the passes.
    aligned : numpy.ndarray, shape (s,), optional
        Correction that the first pass has already [m]: then it is kept, and the second pass is
        aligned to it.

    Returns
    -------
    DiscontinuityVectors
        ``filtered`` of a pass that is kept is its given correction.

    Raises
    ------
    CoverageError
        If too many reference points are gaps.
    """
    height = np.stack([one.mean for one in heights])
    if settings.statistic == "median":
        height = np.stack([one.histograms.median for one in heights])
    count, sd = (np.stack([getattr(one, name) for one in heights]) for name in ("count", "sd"))
    sparse = np.asarray((count < settings.least).any(axis=0))
    gap = sparse | ~inside
    _require_enough(gap, ~inside, sparse, path, area, edges, settings, names)
    fraction: Any = np.zeros(count.shape)  # of the difference assigned to each pass
    known = np.where(gap, np.nan, height)
    if aligned is None:
        reference = reference_height(known, count, settings.reference)
        weight = count if settings.reference == "pooled" else np.ones(count.shape)
        fraction[:] = weight[::-1] / np.maximum(weight.sum(axis=0), 1)
    else:
        reference = known[0] - aligned
        fraction[1] = 1.0
    raw = known - reference
    with np.errstate(invalid="ignore", divide="ignore"):
        difference_sd = np.sqrt((sd**2 / count).sum(axis=0))
    factor = _MEDIAN_ERROR if settings.statistic == "median" else 1.0

    def smoothed(values: Floats) -> Floats:
        return low_pass(values, path.curve.spacing, settings.cut_off, closed=path.curve.closed)

    if aligned is None:
        smooth = np.stack([smoothed(one) for one in raw])
    else:  # is smooth already: filtering it again would attenuate it
        smooth = np.stack([aligned, aligned + smoothed(raw[1] - aligned)])
    return DiscontinuityVectors(
        names=names,
        station=path.curve.s,
        height=height,
        sd=sd,
        count=count,
        histograms=(heights[0].histograms, heights[1].histograms),
        reference_height=reference,
        raw=raw,
        error=np.where(gap, np.nan, factor * difference_sd * fraction),
        filtered=smooth,
        gap=gap,
        thin=~inside,
        width=edges.width,
    )


def _require_enough(
    gap: Flags,
    thin: Flags,
    sparse: Flags,
    path: ReferencePath,
    area: SearchArea,
    edges: OverlapEdges,
    settings: DiscontinuitySettings,
    names: tuple[str, str],
) -> None:
    """Raise CoverageError if there are too many gaps."""
    if gap.sum() <= settings.max_gap_fraction * gap.size and not gap.all():
        return
    place = f"overlap of {names[0]} and {names[1]}"
    bad = thin if thin.sum() >= sparse.sum() else sparse
    first = int(np.argmax(bad))
    long, wide = (2 * half for half in area.half_axes)
    size = f"search areas {long:g} m long and {wide:g} m wide"
    width = float(np.nan_to_num(edges.width[first]))
    where = (
        f"{size} at {bad.sum()} of {gap.size} reference points, first at station "
        f"{path.curve.s[first]:.2f} m, where it is {width:.2f} m wide"
    )
    if bad is thin:
        raise CoverageError(
            f"is too narrow for {where}",
            place=place,
            cure="Choose smaller ones, a path along the centre, or leave a pass out.",
        )
    raise CoverageError(
        f"holds fewer than {settings.least} points of a pass in {where}",
        place=place,
        cure="Choose larger ones, or allow fewer points.",
    )
