"""Alignment of passes by discontinuity vectors along reference paths (thesis 4.3.1, 4.4).

A reference path runs along the overlap of two passes. Around each of its equally spaced reference
points the heights of both passes are collected; their common mean is the reference height. The
height of a pass less the reference height is its discontinuity vector, which is low-pass filtered
with zero phase and subtracted from all points of the pass by station.

Further passes are aligned one by one, each by its overlap with a pass that is aligned already. The
points are read only twice, whatever the number of passes: for the cells of the overlaps, and for
the search areas.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np
import xarray as xr

from trueterrain.alignment.discontinuity.area_sums import (
    AreaHeights,
    AreaSums,
    HeightHistograms,
    SearchArea,
    SearchDisc,
    inside_overlap,
)
from trueterrain.alignment.discontinuity.centre_line import (
    OverlapEdges,
    centre_reference,
    follow_centre,
    overlap_edges,
)
from trueterrain.alignment.discontinuity.low_pass import low_pass
from trueterrain.alignment.discontinuity.reference_path import ReferencePath
from trueterrain.alignment.discontinuity.result import (
    CorrectionValues,
    Names,
    PairAlignment,
    PassAlignment,
    StationCorrection,
)
from trueterrain.alignment.discontinuity.seams import PairCells, SeamSteps
from trueterrain.alignment.discontinuity.vectors import (
    DiscontinuitySettings,
    DiscontinuityVectors,
    discontinuity_vectors,
    reference_height,
)
from trueterrain.alignment.observations.overlap import (
    OccupiedCells,
    Overlap,
    PassPoints,
    find_overlap,
    occupied_cells,
    point_blocks,
)
from trueterrain.alignment.observations.sparse_sums import Flags, Floats
from trueterrain.core import provenance
from trueterrain.core.errors import CoverageError
from trueterrain.core.progress import Progress, no_progress
from trueterrain.surface.difference import DifferenceSummary

__all__ = [
    "AreaHeights",
    "CorrectionValues",
    "DifferenceSummary",
    "DiscontinuitySettings",
    "DiscontinuityVectors",
    "HeightHistograms",
    "PairAlignment",
    "PassAlignment",
    "SeamSteps",
    "SearchArea",
    "SearchDisc",
    "StationCorrection",
    "align_along_paths",
    "correct_points",
    "low_pass",
    "reference_height",
]

_STRETCH = 1.0  # [m] length of path over which steps at the edges are averaged
_BAND = 2.0  # cells from the edge within which a step is measured


def align_along_paths(
    passes: Mapping[str, PassPoints],
    settings: DiscontinuitySettings = DiscontinuitySettings(),
    *,
    paths: ReferencePath | Mapping[Names, ReferencePath] | None = None,
    area: SearchArea | None = None,
    fix: str | None = None,
    order: Sequence[str] | None = None,
    progress: Progress = no_progress,
) -> PassAlignment:
    """Align passes by discontinuity vectors along reference paths.

    The method of the thesis. Use `adjust_passes` for more than two passes, closed loops, or
    standard deviations.

    Parameters
    ----------
    passes : mapping of str to points
        Points of each pass: a dataset, a sequence of them, or a function that returns blocks. They
        are read twice.
    settings : DiscontinuitySettings
        Search areas, filter and limits.
    paths : mapping of pairs of names to ReferencePath, or ReferencePath, optional
        Reference path of each pair, or one whose stations apply to all pairs. With a path for the
        pair the search areas lie on it, else along the centre of the overlap. By default a smooth
        path along the centre of each overlap.
    area : SearchArea, optional
        Search area instead of the disc, such as a `trueterrain.profile.Rectangle`, which suits a
        narrow overlap.
    fix : str, optional
        Pass that gets no correction, and to which all others are aligned. By default the
        difference of the first two passes is divided between them.
    order : sequence of str, optional
        Order in which passes are aligned. By default from the fixed pass, or from the outermost
        (that which overlaps with the fewest others), by the largest overlap first.
    progress : callable, optional
        Called with a task, the amount done and the total.

    Returns
    -------
    PassAlignment
        Corrections of all passes, and their agreement before and after. Independent of the order
        of passes and of blocks.

    Raises
    ------
    ValueError
        If there are fewer than two passes, or a name in `fix`, `order` or `paths` is unknown.
    CoverageError
        If a pass overlaps no other, or an overlap is too narrow for the search areas.
    SchemaError
        If passes have different coordinate reference systems.
    TrueTerrainError
        If two passes hold the same points.

    Notes
    -----
    A search area lies inside an overlap if the overlap contains all cells whose centres are in the
    area, so within half a cell. Areas outside, or with too few points, are gaps, over which the
    correction is interpolated. Beyond the ends of the overlap it is constant.

    Examples
    --------
    Two level passes that differ by 12 mm:

    >>> from trueterrain.core.schemas import make_points
    >>> x, y = (at.ravel() for at in np.meshgrid(np.arange(0, 20, 0.05), np.arange(0, 3, 0.05)))
    >>> passes = {"left": make_points(x, y, 0 * x + 0.012), "right": make_points(x, y - 2, 0 * x)}
    >>> found = align_along_paths(passes)
    >>> found.pairs[0].before.median, found.pairs[0].after.rmse, found.pairs[0].seam_before.median
    (0.012, 0.000, 0.006)
    >>> float(correct_points(passes["left"], found, "left").up[0])
    0.006
    """
    _check_names(passes, fix, order)
    cells: dict[str, OccupiedCells] = {}
    for number, name in enumerate(sorted(passes)):
        progress("overlap", number, len(passes))
        cells[name] = occupied_cells(passes[name], settings.cell, name=name)
    overlaps = {
        pair: found
        for pair in combinations(cells, 2)
        if (found := find_overlap(cells[pair[0]], cells[pair[1]], names=pair))
    }
    joined = _order_pairs(overlaps, tuple(cells), fix, order)
    area = area or SearchDisc(radius=settings.radius)
    pair_paths = {pair: _pair_path(pair, overlaps, paths, area, settings) for pair in joined}
    heights = _area_heights(passes, pair_paths, settings, progress)
    return _align_pairs(cells, overlaps, pair_paths, heights, settings, fix)


def correct_points(points: xr.Dataset, alignment: PassAlignment, name: str) -> xr.Dataset:
    """Subtract the correction of a pass from its points.

    Parameters
    ----------
    points : xarray.Dataset
        Points of the pass, all or a block.
    alignment : PassAlignment
        Corrections.
    name : str
        Name of the pass.

    Returns
    -------
    xarray.Dataset
        With corrected ``up``; attribute ``beyond_overlap`` is the number of points beyond the ends
        of the overlap, whose correction is that of the end.

    Raises
    ------
    ValueError
        If there is no such pass.
    """
    shape = points["up"].shape
    found = alignment.correction(name, np.ravel(points["easting"]), np.ravel(points["northing"]))
    up = points["up"].copy(data=np.asarray(points["up"], dtype=float) - found.height.reshape(shape))
    step = provenance.add_step(
        points.assign(up=up),
        "align lanes",
        parameters={"method": "discontinuity", "lane": name, "options": alignment.settings},
    )
    return step.assign_attrs(beyond_overlap=int(found.beyond.sum()))


def _check_names(
    passes: Mapping[str, PassPoints], fix: str | None, order: Sequence[str] | None
) -> None:
    if len(passes) < 2:
        message = f"passes must be at least 2, got {len(passes)}."
        raise ValueError(message)
    if fix is not None and fix not in passes:
        message = f"fix must be one of {', '.join(passes)}, got {fix!r}."
        raise ValueError(message)
    if order is not None:
        if sorted(order) != sorted(passes):
            message = f"order must name each of {', '.join(passes)} once, got {', '.join(order)}."
            raise ValueError(message)
        if fix is not None and order[0] != fix:
            message = f"order must begin with the fixed pass {fix}, got {order[0]}."
            raise ValueError(message)


def _order_pairs(
    overlaps: Mapping[Names, Overlap],
    names: tuple[str, ...],
    fix: str | None,
    order: Sequence[str] | None,
) -> list[Names]:
    """Pairs in order of alignment; the pass that is aligned already comes first."""

    def area(placed: str, other: str) -> float:
        found = overlaps.get((min(placed, other), max(placed, other)))
        return found.area if found else 0.0

    def neighbours(name: str) -> int:
        return sum(name in pair for pair in overlaps)

    first = fix or (order[0] if order else min(names, key=lambda name: (neighbours(name), name)))
    placed, joined = [first], []
    while len(placed) < len(names):
        rest = [name for name in names if name not in placed]
        if order:
            rest = [order[len(placed)]]
        # the largest overlap; of equal ones the first by name
        pair = min(((a, b) for b in rest for a in placed), key=lambda p: (-area(*p), p[1], p[0]))
        if not area(*pair):
            raise CoverageError(
                f"overlaps with none of {', '.join(placed)}",
                place=f"pass {', '.join(rest)}",
                cure="Leave it out, give another order, or compare origins and clocks.",
            )
        placed.append(pair[1])
        joined.append(pair)
    return joined


class _PairPath(NamedTuple):
    """Reference path and overlap of a pair."""

    overlap: Overlap
    path: ReferencePath
    area: SearchArea
    edges: OverlapEdges
    inside: Flags


def _pair_path(
    pair: Names,
    overlaps: Mapping[Names, Overlap],
    paths: ReferencePath | Mapping[Names, ReferencePath] | None,
    area: SearchArea,
    settings: DiscontinuitySettings,
) -> _PairPath:
    overlap = overlaps[min(pair), max(pair)]
    if overlap.names != pair:
        overlap = replace(overlap, names=pair, cells=overlap.cells[::-1])
    if isinstance(paths, Mapping):
        for names in paths:
            if tuple(sorted(names)) not in overlaps:
                message = f"paths must name pairs of passes that overlap, got {names}."
                raise ValueError(message)
        path = paths.get(pair) or paths.get((pair[1], pair[0]))
    else:
        path = None
    if path is None:
        path = (
            paths
            if isinstance(paths, ReferencePath)
            else centre_reference(overlap, spacing=settings.spacing, smoothing=settings.smoothing)
        )
        path = follow_centre(overlap, path, length=2 * area.half_axes[0])
    inside = inside_overlap(overlap, path, area)
    return _PairPath(overlap, path, area, overlap_edges(overlap, path), inside)


def _area_heights(
    passes: Mapping[str, PassPoints],
    pair_paths: Mapping[Names, _PairPath],
    settings: DiscontinuitySettings,
    progress: Progress,
) -> dict[tuple[Names, str], AreaHeights]:
    """Heights in the search areas of each pass of each pair, reading the points once."""
    heights: dict[tuple[Names, str], AreaHeights] = {}
    for number, name in enumerate(sorted(passes)):
        progress("heights", number, len(passes))
        sums = {
            pair: AreaSums(pair_path.path, pair_path.area, settings.bin_width)
            for pair, pair_path in pair_paths.items()
            if name in pair
        }
        for block in point_blocks(passes[name]):
            for one in sums.values():
                one.add(block)
        heights |= {(pair, name): one.heights() for pair, one in sums.items()}
    progress("heights", len(passes), len(passes))
    return heights


def _align_pairs(
    cells: Mapping[str, OccupiedCells],
    overlaps: Mapping[Names, Overlap],
    pair_paths: Mapping[Names, _PairPath],
    heights: Mapping[tuple[Names, str], AreaHeights],
    settings: DiscontinuitySettings,
    fix: str | None,
) -> PassAlignment:
    corrections: dict[str, StationCorrection] = {}
    shared = {pair: PairCells(overlap) for pair, overlap in overlaps.items()}
    states = [_pair_agreements(shared, corrections)]
    pairs: list[PairAlignment] = []
    for pair, pair_path in pair_paths.items():
        keeps_first = bool(pairs) or pair[0] == fix
        found = discontinuity_vectors(
            (heights[pair, pair[0]], heights[pair, pair[1]]),
            pair_path.path,
            pair_path.area,
            pair_path.edges,
            pair_path.inside,
            settings,
            names=pair,
            aligned=_correction_at(corrections, pair[0], *pair_path.path.places)
            if keeps_first
            else None,
        )
        corrected = pair[1:] if keeps_first else pair
        begin, end = found.ends
        for name in corrected:
            vector = found.filtered[pair.index(name)]
            corrections[name] = StationCorrection(
                path=pair_path.path, height=vector, begin=begin, end=end
            )
        states.append(_pair_agreements(shared, corrections))
        pairs.append(_pair_report(pair, corrected, pair_path, found, corrections))
    return PassAlignment(
        settings=settings,
        names=(pairs[0].names[0], *(pair[1] for pair in pair_paths)),
        pairs=tuple(pairs),
        corrections=corrections,
        states=tuple(states),
        left_out={name: one.left_out for name, one in cells.items()},
    )


def _pair_report(
    pair: Names,
    corrected: tuple[str, ...],
    pair_path: _PairPath,
    found: DiscontinuityVectors,
    corrections: Mapping[str, StationCorrection],
) -> PairAlignment:
    difference = np.where(found.gap, np.nan, found.height[0] - found.height[1])
    correction = found.filtered[0] - found.filtered[1]
    cells, band = PairCells(pair_path.overlap), _BAND * pair_path.overlap.cell
    steps = [
        cells.seam(_pair_corrections(cells, pair, applied), pair_path.path, _STRETCH, band)
        for applied in ({}, corrections)
    ]
    return PairAlignment(
        names=pair,
        corrected=corrected,
        overlap=pair_path.overlap,
        path=pair_path.path,
        edges=pair_path.edges,
        discontinuity=found,
        before=DifferenceSummary.of(difference),
        after=DifferenceSummary.of(difference - correction),
        seam_before=steps[0],
        seam_after=steps[1],
    )


def _pair_agreements(
    shared: Mapping[Names, PairCells], corrections: Mapping[str, StationCorrection]
) -> dict[Names, DifferenceSummary]:
    return {
        pair: cells.agreement(_pair_corrections(cells, pair, corrections))
        for pair, cells in shared.items()
    }


def _pair_corrections(
    cells: PairCells, pair: Names, corrections: Mapping[str, StationCorrection]
) -> Floats:
    """Corrections of both passes at the centres of cells, shape (2, n)."""
    return np.stack([_correction_at(corrections, name, *cells.centres) for name in pair])


def _correction_at(
    corrections: Mapping[str, StationCorrection], name: str, easting: Floats, northing: Floats
) -> Floats:
    if name not in corrections:
        return np.zeros(easting.size)
    return corrections[name].at(easting, northing).height
