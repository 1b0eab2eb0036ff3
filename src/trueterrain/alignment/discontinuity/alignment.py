"""Lanes brought into agreement along reference paths: the thesis's method (4.3.1, 4.4).

Along the overlap of two lanes runs a reference path. Around each of its equally spaced reference
points the heights of both lanes are collected, and their common mean is the reference height. What
each lane departs from it, its discontinuity vector, is low-pass filtered without phase and taken
off all points of the lane, station by station.

More lanes join one by one, each by the pair it forms with a lane that is aligned already. Only two
passes over the points are made, however many lanes there are: one for the cells of the overlap,
one for the search areas.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np
import xarray as xr

from trueterrain.alignment.difference_summary import DifferenceSummary
from trueterrain.alignment.discontinuity.area_sums import (
    AreaHeights,
    AreaSums,
    HeightHistograms,
    SearchArea,
    SearchDisc,
    inside_overlap,
)
from trueterrain.alignment.discontinuity.low_pass import low_pass
from trueterrain.alignment.discontinuity.reference_path import (
    OverlapEdges,
    ReferencePath,
    centre_reference,
    keep_to_middle,
    overlap_edges,
)
from trueterrain.alignment.discontinuity.result import (
    CorrectionValues,
    Names,
    PairAlignment,
    PassAlignment,
    StationCorrection,
)
from trueterrain.alignment.discontinuity.seam import PairCells, SeamSteps
from trueterrain.alignment.discontinuity.sparse_sums import Flags, Floats
from trueterrain.alignment.discontinuity.vectors import (
    DiscontinuitySettings,
    DiscontinuityVectors,
    discontinuity_vectors,
    reference_height,
)
from trueterrain.alignment.observations.overlap import (
    LanePoints,
    OccupiedCells,
    Overlap,
    lane_blocks,
    occupied_cells,
    overlap_of,
)
from trueterrain.core import provenance
from trueterrain.core.errors import CoverageError
from trueterrain.core.progress import Progress, no_progress

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
    "align_lanes",
    "correct_points",
    "low_pass",
    "reference_height",
]

_STRETCH = 1.0  # [m] of a path over which steps at the edges are averaged
_BAND = 2.0  # cells from an edge, within which they count


def align_lanes(
    lanes: Mapping[str, LanePoints],
    options: DiscontinuitySettings = DiscontinuitySettings(),
    *,
    paths: ReferencePath | Mapping[Names, ReferencePath] | None = None,
    area: SearchArea | None = None,
    fix: str | None = None,
    order: Sequence[str] | None = None,
    progress: Progress = no_progress,
) -> PassAlignment:
    """Bring lanes into agreement by discontinuity vectors along reference paths.

    Parameters
    ----------
    lanes : mapping of str to points
        Points of each lane: a dataset, a sequence of them, or a function that returns blocks. They
        are gone through twice.
    options : DiscontinuityOptions
        Search areas, filter, and what counts.
    paths : mapping of pairs of names to ReferencePath, or ReferencePath, optional
        Reference path of each pair, or one whose stations count for all pairs. On the path of a
        pair lie its search areas; with one for all, or none, they lie in the middle of the
        overlap. By default a smooth path along the centre of each overlap.
    area : SearchArea, optional
        Search area instead of the disc, such as a `trueterrain.profile.Rectangle`, which suits a
        thin overlap.
    fix : str, optional
        Lane that stays as it is, and to which all others are brought. By default the first two
        lanes share their difference.
    order : sequence of str, optional
        Order in which lanes are aligned. By default from the fixed lane, or from the outermost
        (that which overlaps with the fewest others), by the largest overlap first.
    progress : callable, optional
        Called with what is done and the lanes done and to do.

    Returns
    -------
    LaneAlignment
        Corrections of all lanes, and how they agree before and after. It does not depend on the
        order in which lanes are given, nor on blocks.

    Raises
    ------
    ValueError
        If there are fewer than two lanes, or names in `fix`, `order` or `paths` are none of them.
    CoverageError
        If a lane overlaps no other, or an overlap is too thin for the search areas.
    SchemaError
        If lanes have different coordinate reference systems.
    TrueTerrainError
        If two lanes hold the same points.

    Notes
    -----
    Search areas lie inside an overlap if it holds all cells whose middle they hold, so within half
    a cell. Where they do not, or hold too few points, there is a gap: the correction is taken from
    both sides of it. Beyond the ends of the overlap it stays constant.

    Examples
    --------
    Two level lanes that differ by 12 mm:

    >>> from trueterrain.core.schemas import make_points
    >>> x, y = (at.ravel() for at in np.meshgrid(np.arange(0, 20, 0.05), np.arange(0, 3, 0.05)))
    >>> lanes = {"left": make_points(x, y, 0 * x + 0.012), "right": make_points(x, y - 2, 0 * x)}
    >>> found = align_lanes(lanes)
    >>> found.pairs[0].before.median, found.pairs[0].after.rmse, found.pairs[0].seam_before.median
    (0.012, 0.000, 0.006)
    >>> float(correct(lanes["left"], found, "left").up[0])
    0.006
    """
    _check_names(lanes, fix, order)
    cells: dict[str, OccupiedCells] = {}
    for number, name in enumerate(sorted(lanes)):
        progress("overlap", number, len(lanes))
        cells[name] = occupied_cells(lanes[name], options.cell, name=name)
    overlaps = {
        pair: found
        for pair in combinations(cells, 2)
        if (found := overlap_of(cells[pair[0]], cells[pair[1]], lanes=pair))
    }
    joined = _order_pairs(overlaps, tuple(cells), fix, order)
    area = area or SearchDisc(radius=options.radius)
    ways = {pair: _pair_path(pair, overlaps, paths, area, options) for pair in joined}
    heights = _area_heights(lanes, ways, options, progress)
    return _align_pairs(cells, overlaps, ways, heights, options, fix)


def correct_points(points: xr.Dataset, alignment: PassAlignment, lane: str) -> xr.Dataset:
    """Points of a lane with its correction taken off.

    Parameters
    ----------
    points : xarray.Dataset
        Points, all or a block of them.
    alignment : LaneAlignment
        Corrections.
    lane : str
        Name of the lane.

    Returns
    -------
    xarray.Dataset
        With new ``up``; attribute ``beyond_overlap`` counts those beyond the ends of the overlap,
        whose correction is that of the end.

    Raises
    ------
    ValueError
        If there is no such lane.
    """
    shape = points["up"].shape
    found = alignment.correction(lane, np.ravel(points["easting"]), np.ravel(points["northing"]))
    up = points["up"].copy(data=np.asarray(points["up"], dtype=float) - found.height.reshape(shape))
    step = provenance.add_step(
        points.assign(up=up),
        "align lanes",
        parameters={"method": "discontinuity", "lane": lane, "options": alignment.options},
    )
    return step.assign_attrs(beyond_overlap=int(found.beyond.sum()))


def _check_names(
    lanes: Mapping[str, LanePoints], fix: str | None, order: Sequence[str] | None
) -> None:
    if len(lanes) < 2:
        message = f"lanes must be at least 2, got {len(lanes)}: one pass has nothing to agree with."
        raise ValueError(message)
    if fix is not None and fix not in lanes:
        message = f"fix must be one of {', '.join(lanes)}, got {fix!r}."
        raise ValueError(message)
    if order is not None:
        if sorted(order) != sorted(lanes):
            message = f"order must name each of {', '.join(lanes)} once, got {', '.join(order)}."
            raise ValueError(message)
        if fix is not None and order[0] != fix:
            message = f"order must begin with the fixed lane {fix}, got {order[0]}."
            raise ValueError(message)


def _order_pairs(
    overlaps: Mapping[Names, Overlap],
    names: tuple[str, ...],
    fix: str | None,
    order: Sequence[str] | None,
) -> list[Names]:
    """Pairs by which lanes join, that which is aligned already first."""

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
        # by area; of equal ones that whose names come first
        pair = min(((a, b) for b in rest for a in placed), key=lambda p: (-area(*p), p[1], p[0]))
        if not area(*pair):
            raise CoverageError(
                f"overlaps with none of {', '.join(placed)}",
                place=f"lane {', '.join(rest)}",
                cure="Leave it out, give another order, or compare origins and clocks.",
            )
        placed.append(pair[1])
        joined.append(pair)
    return joined


class _PairPath(NamedTuple):
    """Reference path of a pair."""

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
    options: DiscontinuitySettings,
) -> _PairPath:
    overlap = overlaps[min(pair), max(pair)]
    if overlap.lanes != pair:
        overlap = replace(overlap, lanes=pair, cells=overlap.cells[::-1])
    if isinstance(paths, Mapping):
        for names in paths:
            if tuple(sorted(names)) not in overlaps:
                message = f"paths must name pairs of lanes that overlap, got {names}."
                raise ValueError(message)
        path = paths.get(pair) or paths.get((pair[1], pair[0]))
    else:
        path = None
    if path is None:
        path = (
            paths
            if isinstance(paths, ReferencePath)
            else centre_reference(overlap, spacing=options.spacing, smoothing=options.smoothing)
        )
        path = keep_to_middle(overlap, path, length=2 * area.half_axes[0])
    inside = inside_overlap(overlap, path, area)
    return _PairPath(overlap, path, area, overlap_edges(overlap, path), inside)


def _area_heights(
    lanes: Mapping[str, LanePoints],
    ways: Mapping[Names, _PairPath],
    options: DiscontinuitySettings,
    progress: Progress,
) -> dict[tuple[Names, str], AreaHeights]:
    """Heights in the search areas of each lane of each pair, in one pass over the points."""
    heights: dict[tuple[Names, str], AreaHeights] = {}
    for number, name in enumerate(sorted(lanes)):
        progress("heights", number, len(lanes))
        sums = {
            pair: AreaSums(way.path, way.area, options.bin_width)
            for pair, way in ways.items()
            if name in pair
        }
        for block in lane_blocks(lanes[name]):
            for one in sums.values():
                one.add(block)
        heights |= {(pair, name): one.heights() for pair, one in sums.items()}
    progress("heights", len(lanes), len(lanes))
    return heights


def _align_pairs(
    cells: Mapping[str, OccupiedCells],
    overlaps: Mapping[Names, Overlap],
    ways: Mapping[Names, _PairPath],
    heights: Mapping[tuple[Names, str], AreaHeights],
    options: DiscontinuitySettings,
    fix: str | None,
) -> PassAlignment:
    corrections: dict[str, StationCorrection] = {}
    shared = {pair: PairCells(overlap) for pair, overlap in overlaps.items()}
    states = [_pair_agreements(shared, corrections)]
    pairs: list[PairAlignment] = []
    for pair, way in ways.items():
        stays = bool(pairs) or pair[0] == fix
        found = discontinuity_vectors(
            (heights[pair, pair[0]], heights[pair, pair[1]]),
            way.path,
            way.area,
            way.edges,
            way.inside,
            options,
            lanes=pair,
            aligned=_taken_off(corrections, pair[0], *way.path.places) if stays else None,
        )
        corrected = pair[1:] if stays else pair
        begin, end = found.ends
        for name in corrected:
            vector = found.filtered[pair.index(name)]
            corrections[name] = StationCorrection(
                path=way.path, height=vector, begin=begin, end=end
            )
        states.append(_pair_agreements(shared, corrections))
        pairs.append(_pair_report(pair, corrected, way, found, corrections))
    return PassAlignment(
        options=options,
        lanes=(pairs[0].lanes[0], *(pair[1] for pair in ways)),
        pairs=tuple(pairs),
        corrections=corrections,
        states=tuple(states),
        left_out={name: one.left_out for name, one in cells.items()},
    )


def _pair_report(
    pair: Names,
    corrected: tuple[str, ...],
    way: _PairPath,
    found: DiscontinuityVectors,
    corrections: Mapping[str, StationCorrection],
) -> PairAlignment:
    apart = np.where(found.gap, np.nan, found.height[0] - found.height[1])
    taken = found.filtered[0] - found.filtered[1]
    cells, band = PairCells(way.overlap), _BAND * way.overlap.cell
    steps = [
        cells.seam(_pair_corrections(cells, pair, made), way.path, _STRETCH, band)
        for made in ({}, corrections)
    ]
    return PairAlignment(
        lanes=pair,
        corrected=corrected,
        overlap=way.overlap,
        path=way.path,
        edges=way.edges,
        discontinuity=found,
        before=DifferenceSummary.of(apart),
        after=DifferenceSummary.of(apart - taken),
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
    """Corrections of both lanes at the centres of cells, shape (2, n)."""
    return np.stack([_taken_off(corrections, name, *cells.centres) for name in pair])


def _taken_off(
    corrections: Mapping[str, StationCorrection], lane: str, easting: Floats, northing: Floats
) -> Floats:
    if lane not in corrections:
        return np.zeros(easting.size)
    return corrections[lane].at(easting, northing).height
