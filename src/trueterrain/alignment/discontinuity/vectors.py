"""Discontinuity vectors of two lanes (thesis 4.3.1, Figs 4-4 and 4-5)."""

from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from trueterrain.alignment.discontinuity.area_sums import AreaHeights, HeightHistograms, SearchArea
from trueterrain.alignment.discontinuity.low_pass import low_pass
from trueterrain.alignment.discontinuity.path import ReferencePath
from trueterrain.alignment.discontinuity.reference_path import OverlapEdges
from trueterrain.alignment.discontinuity.sparse_sums import Flags, Floats, Integers
from trueterrain.core.errors import CoverageError

Statistic = Literal["mean", "median"]
Reference = Literal["pooled", "midway"]

_MEDIAN_ERROR = 1.2533  # of a median of normal heights, by that of their mean: sqrt(pi / 2)
_BIN = 1e-5  # [m] steps that bins are whole multiples of


@dataclass(frozen=True, kw_only=True)
class DiscontinuitySettings:
    """How lanes are aligned along reference paths."""

    spacing: float = 0.25
    "Distance of the reference points [m]."

    radius: float = 0.2
    "Radius of the disc around each in which heights are compared [m]."

    cut_off: float = 2.5
    """Wavelength of which half stays in the correction [m]: longer ones are drift, shorter ones
    are left alone."""

    statistic: Statistic = "mean"
    "What is compared of the heights of a lane in a disc: their mean or median."

    reference: Reference = "pooled"
    """Height that both lanes are brought to: that of all points (pooled), or midway between the
    lanes."""

    cell: float = 0.1
    "Size of the cells in which the overlap is looked for [m]."

    smoothing: float = 10.0
    """Wavelength below which a path along the centre does not follow the edges of the overlap [m];
    the search areas do."""

    least: int = 20
    "Points that each lane must have in a disc; with fewer there is a gap."

    max_gap_fraction: float = 0.5
    "Share of the reference points that may be gaps [1]; with more there is an error."

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
    """By how much each of two lanes departs from the reference height along a path."""

    lanes: tuple[str, str]
    "Names of the lanes; the first of all shapes (2, s) below is that of the first."

    station: Floats
    "Stations of the reference points, shape (s,) [m]."

    height: Floats
    "Mean or median of each lane in the search areas, as recorded, shape (2, s) [m]."

    sd: Floats
    "Standard deviation of its heights there, that of the ground included, shape (2, s) [m]."

    count: Integers
    "How many there are, shape (2, s)."

    histograms: tuple[HeightHistograms, HeightHistograms]
    "How the heights of each lane are distributed, as recorded (Fig. 4-4)."

    reference_height: Floats
    "Height that both are brought to, shape (s,) [m]; NaN in gaps."

    raw: Floats
    "Height of each lane less the reference height (Fig. 4-5), shape (2, s) [m]; NaN in gaps."

    error: Floats
    """Standard deviation of `raw` from the scatter of the heights, as if they were independent,
    shape (2, s) [m]."""

    filtered: Floats
    "The same without waves shorter than the cut-off, over gaps interpolated, shape (2, s) [m]."

    gap: Flags
    "Where there are too few points, or the search area leaves the overlap, shape (s,)."

    thin: Flags
    "Where the search area leaves the overlap, shape (s,)."

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
    """Height that lanes are brought to (thesis Eq. 4-1).

    Parameters
    ----------
    height : array_like, shape (lane, s)
        Mean height of each lane [m].
    count : array_like, shape (lane, s)
        Points that it is the mean of.
    how : {"pooled", "midway"}
        Mean of all points of all lanes, or mean of the lanes.

    Returns
    -------
    numpy.ndarray, shape (s,)
        Reference height [m].

    Notes
    -----
    As printed in the thesis, Eq. 4-1 adds up the means of both lanes, which is twice the height.
    Meant is their mean over all points, ``(n1 z1 + n2 z2) / (n1 + n2)``.

    Examples
    --------
    >>> reference_height([[0.10], [0.14]], [[300], [100]])
    array([0.11])
    >>> reference_height([[0.10], [0.14]], [[300], [100]], "midway")
    array([0.12])
    """
    z = np.asarray(height, dtype=float)
    n = np.asarray(count, dtype=float) if how == "pooled" else np.ones(z.shape)
    # the first lane taken off, so that heights of hundreds of metres cost no digits
    return np.asarray(z[0] + (n * (z - z[0])).sum(axis=0) / n.sum(axis=0))


def discontinuity_vectors(
    heights: tuple[AreaHeights, AreaHeights],
    path: ReferencePath,
    area: SearchArea,
    edges: OverlapEdges,
    inside: Flags,
    options: DiscontinuitySettings,
    *,
    lanes: tuple[str, str],
    aligned: Floats | None = None,
) -> DiscontinuityVectors:
    """Discontinuity vectors of two lanes.

    Parameters
    ----------
    heights : tuple of AreaHeights
        Heights of both lanes in the search areas.
    path : ReferencePath
        The path.
    area : SearchArea
        The search area.
    edges : Edges
        Width of the overlap along it.
    inside : numpy.ndarray of bool, shape (s,)
        Whether the search areas lie inside of the overlap.
    options : DiscontinuityOptions
        What is compared, and how it is filtered.
    lanes : tuple of str
        Names of the lanes.
    aligned : numpy.ndarray, shape (s,), optional
        Correction that the first lane already has [m]: then it stays, and the second one is
        brought to it.

    Returns
    -------
    Discontinuity
        ``filtered`` of a lane that stays is the correction that it has.

    Raises
    ------
    CoverageError
        If too many reference points are gaps.
    """
    height = np.stack([one.mean for one in heights])
    if options.statistic == "median":
        height = np.stack([one.histograms.median for one in heights])
    count, sd = (np.stack([getattr(one, name) for one in heights]) for name in ("count", "sd"))
    few = np.asarray((count < options.least).any(axis=0))
    gap = few | ~inside
    _require_enough(gap, ~inside, few, path, area, edges, options, lanes)
    share: Any = np.zeros(count.shape)  # of the difference that each lane is off by
    known = np.where(gap, np.nan, height)
    if aligned is None:
        reference = reference_height(known, count, options.reference)
        weight = count if options.reference == "pooled" else np.ones(count.shape)
        share[:] = weight[::-1] / np.maximum(weight.sum(axis=0), 1)
    else:
        reference = known[0] - aligned
        share[1] = 1.0
    raw = known - reference
    with np.errstate(invalid="ignore", divide="ignore"):
        apart = np.sqrt((sd**2 / count).sum(axis=0))
    factor = _MEDIAN_ERROR if options.statistic == "median" else 1.0

    def smoothed(values: Floats) -> Floats:
        return low_pass(values, path.spacing, options.cut_off, closed=path.closed)

    if aligned is None:
        smooth = np.stack([smoothed(one) for one in raw])
    else:  # which is smooth already; filtered again it would lose some of what both share
        smooth = np.stack([aligned, aligned + smoothed(raw[1] - aligned)])
    return DiscontinuityVectors(
        lanes=lanes,
        station=path.station,
        height=height,
        sd=sd,
        count=count,
        histograms=(heights[0].histograms, heights[1].histograms),
        reference_height=reference,
        raw=raw,
        error=np.where(gap, np.nan, factor * apart * share),
        filtered=smooth,
        gap=gap,
        thin=~inside,
        width=edges.width,
    )


def _require_enough(
    gap: Flags,
    thin: Flags,
    few: Flags,
    path: ReferencePath,
    area: SearchArea,
    edges: OverlapEdges,
    options: DiscontinuitySettings,
    lanes: tuple[str, str],
) -> None:
    """Raise CoverageError if there are too many gaps."""
    if gap.sum() <= options.max_gap_fraction * gap.size and not gap.all():
        return
    place = f"overlap of {lanes[0]} and {lanes[1]}"
    bad = thin if thin.sum() >= few.sum() else few
    first = int(np.argmax(bad))
    long, wide = (2 * half for half in area.half_axes)
    size = f"search areas {long:g} m long and {wide:g} m wide"
    width = float(np.nan_to_num(edges.width[first]))
    where = (
        f"{size} at {bad.sum()} of {gap.size} reference points, first at station "
        f"{path.station[first]:.2f} m, where it is {width:.2f} m wide"
    )
    if bad is thin:
        raise CoverageError(
            f"is too thin for {where}",
            place=place,
            cure="Choose smaller ones, a path in the middle of the overlap, or leave a lane out.",
        )
    raise CoverageError(
        f"holds fewer than {options.least} points of a lane in {where}",
        place=place,
        cure="Choose larger ones, or allow fewer points.",
    )
