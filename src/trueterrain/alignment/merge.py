"""Passes merged into one ground: compared, brought into agreement, and compared again.

=================  ================================================================================
`method`           what it does
=================  ================================================================================
`network`          one least-squares adjustment of all passes at once
`discontinuity`    discontinuity vectors along reference paths, pair by pair (thesis 4.3.1)
`grid`             nothing but the mean of all passes (thesis 4.3.2); warns where they disagree
=================  ================================================================================

Whatever the method, passes are compared in the same cells, so that methods can be compared as well.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from itertools import combinations
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from trueterrain.alignment.adjustment.network import Adjustment, adjust_passes
from trueterrain.alignment.adjustment.shared_cells import find_shared_cells
from trueterrain.alignment.agreement import PairAgreement, pairs_of
from trueterrain.alignment.discontinuity.result import PassAlignment
from trueterrain.alignment.discontinuity.vectors import DiscontinuitySettings
from trueterrain.alignment.observations.cells import PassCells
from trueterrain.alignment.seams import SeamAgreement, seams_of
from trueterrain.alignment.settings import CellSettings, NetworkSettings
from trueterrain.core.errors import CoverageError
from trueterrain.core.progress import Progress, no_progress

Floats = npt.NDArray[np.float64]

Method = Literal["network", "discontinuity", "grid"]

_NEIGHBOURS = 3  # cells, side of the neighbourhood in which steps that remain are looked for

#: What is to be added to the heights of a pass in its cells, shape (cell,) [m].
Added = Mapping[str, Floats]


@dataclass(frozen=True, kw_only=True)
class MergeSettings:
    """How passes are merged."""

    method: Method = "network"
    """network: one adjustment of all passes; discontinuity: vectors along reference paths, as in
    the thesis; grid: the mean of all passes, with a warning where they disagree."""

    fixed: tuple[str, ...] = ()
    "Names of passes that stay as they are."

    control: str | None = None
    """CSV file of control points that heights are brought to, with the columns easting, northing,
    up and sd [m]; network only."""

    path: str | None = None
    """CSV file of waypoints of the reference path through the overlap, with the columns easting and
    northing [m]; discontinuity only. By default the middle of each overlap."""

    limit: float = 0.002
    "Difference of passes in the neighbourhood of a cell beyond which the method grid warns [m]."

    cells: CellSettings = field(default_factory=lambda: CellSettings(size=0.1))
    "Cells in which passes are compared."

    network: NetworkSettings = field(
        default_factory=lambda: NetworkSettings(components=("height", "roll", "shift"))
    )
    "How the adjustment is done."

    discontinuity: DiscontinuitySettings = field(default_factory=DiscontinuitySettings)
    "How discontinuity vectors are found."

    def __post_init__(self) -> None:
        """Check the values."""
        if self.method not in get_args(Method):
            message = f"method must be one of {', '.join(get_args(Method))}, got {self.method!r}."
            raise ValueError(message)
        if not 0 < self.limit < np.inf:
            message = f"limit must be greater than 0 m, got {self.limit}."
            raise ValueError(message)
        if self.control is not None and self.method != "network":
            message = f"control goes with the method network, got {self.method}."
            raise ValueError(message)
        if self.path is not None and self.method != "discontinuity":
            message = f"path goes with the method discontinuity, got {self.method}."
            raise ValueError(message)
        if self.method == "grid" and self.fixed:
            message = "fixed has no meaning for the method grid, which corrects no pass."
            raise ValueError(message)
        if self.method == "discontinuity" and len(self.fixed) > 1:
            message = f"the method discontinuity can fix one lane, got {', '.join(self.fixed)}."
            raise ValueError(message)


@dataclass(frozen=True, kw_only=True, eq=False)
class MergeResult:
    """How passes agree before and after."""

    method: Method
    "How they were brought into agreement."

    names: tuple[str, ...]
    "Names of the passes."

    pairs: tuple[PairAgreement, ...]
    "Differences of each pair in the cells that both saw, before and after."

    seams: tuple[SeamAgreement, ...]
    "Steps at the edges of each overlap, before and after."

    adjustment: Adjustment | None
    "The network adjustment."

    alignment: PassAlignment | None
    "Discontinuity vectors."

    problems: tuple[str, ...]
    "What is flagged, in words."

    def to_dict(self) -> dict[str, Any]:
        """What was found, as JSON takes it."""
        found: dict[str, Any] = {
            "method": self.method,
            "passes": list(self.names),
            "pairs": [asdict(pair) for pair in self.pairs],
            "seams": [
                {
                    "lanes": list(seam.lanes),
                    "before": seam.before.median,
                    "after": seam.after.median,
                }
                for seam in self.seams
            ],
            "network": None,
            "problems": list(self.problems),
        }
        if self.adjustment is not None:
            found["network"] = _network_summary(self.adjustment)
        return found


def merge_cells(
    cells: Sequence[PassCells],
    settings: MergeSettings = MergeSettings(),
    *,
    control: Sequence[PassCells] = (),
    align: Callable[[], PassAlignment] | None = None,
    progress: Progress = no_progress,
) -> MergeResult:
    """Bring passes into agreement, and say by how much they disagreed before and after.

    Parameters
    ----------
    cells : sequence of LaneCells
        What each pass saw.
    settings : MergeSettings
        How.
    control : sequence of LaneCells
        Heights that are known.
    align : callable, optional
        Finds discontinuity vectors; needed for that method, since these take all points.
    progress : callable, optional
        Called with a task, the amount done and the total.

    Returns
    -------
    Merging
        Corrections, and agreement.

    Raises
    ------
    CoverageError
        If no cell is seen by two passes, or two passes hold the same returns.
    ValueError
        If the method needs `align` and it is not given, or names are wrong.
    TrueTerrainError
        If the adjustment does not converge.

    Examples
    --------
    >>> from trueterrain.alignment import lane_cells
    >>> rng = np.random.default_rng(1)
    >>> x, y = (at.ravel() for at in np.meshgrid(np.arange(0.05, 40, 0.1), np.arange(0.05, 1, 0.1)))
    >>> number = (np.floor(x / 0.1).astype(int) << 32) + np.floor(y / 0.1).astype(int)
    >>> east, west = (
    ...     lane_cells(name, number, x / 5, up + rng.normal(0, 1e-3, x.size), variance=1e-6,
    ...                easting=x, northing=y)
    ...     for name, up in (("east", 0.005), ("west", -0.005)))
    >>> (pair,) = merge_cells([east, west]).pairs
    >>> f"{1e3 * pair.before.median:.1f} mm, {1e3 * abs(pair.after.median):.1f} mm"
    '-10.0 mm, 0.0 mm'
    """
    require_different(cells)
    adjustment = alignment = None
    added: Added = {one.name: np.zeros(len(one)) for one in cells}
    if settings.method == "network":
        adjustment = adjust_passes(
            cells,
            control=control,
            fixed=settings.fixed,
            settings=settings.network,
            progress=progress,
        )
        added = _by_network(cells, adjustment)
    elif settings.method == "discontinuity":
        if align is None:
            message = "align is needed for the method discontinuity."
            raise ValueError(message)
        alignment = align()
        added = {
            one.name: -alignment.correction(one.name, one.easting, one.northing).height
            for one in cells
        }
    progress("compare passes", 0, None)
    pairs = tuple(adjustment.pairs) if adjustment else tuple(compare_passes(cells, added))
    seams, no_seams = seams_of(cells, added, settings.cells.size)
    found = MergeResult(
        method=settings.method,
        names=tuple(sorted(one.name for one in cells)),
        pairs=pairs,
        seams=tuple(seams),
        adjustment=adjustment,
        alignment=alignment,
        problems=tuple(no_seams),
    )
    return _with_problems(found, settings, cells)


def compare_passes(cells: Sequence[PassCells], added: Added | None = None) -> list[PairAgreement]:
    """Differences of passes in the cells that two of them saw.

    Parameters
    ----------
    cells : sequence of LaneCells
        What each pass saw.
    added : mapping of str to numpy.ndarray, optional
        What is added to the heights of each pass; by default nothing.

    Returns
    -------
    list of PairAgreement
        By the names of the passes.

    Raises
    ------
    CoverageError
        If no cell is seen by two passes.
    """
    shared = find_shared_cells(cells, (), ())
    after = shared.entries.height
    if added is not None:
        moved = [replace(one, height=one.height + added[one.name]) for one in cells]
        after = find_shared_cells(moved, (), ()).entries.height
    none = np.full(after.size, np.nan)
    return pairs_of(shared, np.ones(after.size), shared.entries.height, after, none)


def require_different(cells: Sequence[PassCells]) -> None:
    """Raise CoverageError if there is nothing to compare, or a pass is there twice.

    Parameters
    ----------
    cells : sequence of LaneCells
        What each pass saw.
    """
    if len(cells) < 2 and not any(np.unique(one.cell).size < len(one) for one in cells):
        raise CoverageError(
            "there is one pass, and it never comes back to the same ground",
            cure="Name at least two passes that overlap.",
        )
    for one, other in combinations(cells, 2):
        if np.array_equal(one.cell, other.cell) and np.array_equal(one.height, other.height):
            raise CoverageError(
                f"{one.name} and {other.name} hold the same returns",
                cure="Name each pass once.",
            )


def _by_network(cells: Sequence[PassCells], adjustment: Adjustment) -> dict[str, Floats]:
    added = {one.name: np.zeros(len(one)) for one in cells}
    for one in cells:
        if one.name not in adjustment.names:
            continue
        correction = adjustment.correction(one.name)
        # ground that is moved sideways brings the height of its slope to where it goes
        added[one.name] = (
            correction.height_at(one.time, one.offset, one.ahead)
            - one.slope_east * correction(one.time, "east")
            - one.slope_north * correction(one.time, "north")
        )
    return added


def _with_problems(
    found: MergeResult, settings: MergeSettings, cells: Sequence[PassCells]
) -> MergeResult:
    problems = list(found.problems)
    paired = {name for pair in found.pairs for name in (pair.first, pair.second)}
    problems += [
        f"{name} shares no ground with another pass, so nothing ties it"
        for name in found.names
        if name not in paired
    ]
    if settings.method == "grid":
        problems += _steps_left(cells, settings)
    if found.adjustment is not None:
        problems += _of_network(found.adjustment)
    if found.alignment is not None:
        problems += [
            f"{pair.lanes[0]} and {pair.lanes[1]}: {int(pair.discontinuity.gap.sum())} of "
            f"{pair.discontinuity.gap.size} reference points have too few heights"
            for pair in found.alignment.pairs
            if pair.discontinuity.gap.any()
        ]
    return replace(found, problems=tuple(problems))


def _steps_left(cells: Sequence[PassCells], settings: MergeSettings) -> list[str]:
    """Where passes differ by more than the limit in the mean of the cells around a place."""
    shared = find_shared_cells(cells, (), ())
    entries, first = shared.entries, shared.start[:-1]
    span = np.maximum.reduceat(entries.height, first) - np.minimum.reduceat(entries.height, first)
    square = _NEIGHBOURS * settings.cells.size
    places = np.floor(np.stack([entries.easting[first], entries.northing[first]], axis=1) / square)
    around, number, count = np.unique(places, axis=0, return_inverse=True, return_counts=True)
    mean = np.bincount(number.ravel(), span, minlength=count.size) / count
    beyond = np.flatnonzero(mean > settings.limit)
    if not beyond.size:
        return []
    worst = int(beyond[np.argmax(mean[beyond])])
    easting, northing = (around[worst] + 0.5) * square
    return [
        f"passes differ by more than {1e3 * settings.limit:g} mm around {beyond.size:,} of "
        f"{count.size:,} places, by {1e3 * mean[worst]:.1f} mm at easting {easting:.1f} m and "
        f"northing {northing:.1f} m: steps remain; bring them into agreement first"
    ]


def _network_summary(adjustment: Adjustment) -> dict[str, Any]:
    return {
        "chosen": asdict(adjustment.chosen),
        "trials": [asdict(trial) for trial in adjustment.trials],
        "omitted": list(adjustment.omitted),
        "groups": [list(group) for group in adjustment.groups],
        "tests": [asdict(test) for test in adjustment.tests],
        "closures": [asdict(closure) for closure in adjustment.closures],
        "cells": int(adjustment.ground.cell.size),
        "rejected": len(adjustment.rejected),
        "noise_floor": adjustment.noise_floor,
        "left": adjustment.left,
        "datum_sd": dict(adjustment.datum_sd),
        "iterations": adjustment.iterations,
        "corrections": [
            {
                "pass": one.name,
                "components": list(one.components),
                "knot_spacing": one.knots.spacing,
                "unsupported": [list(stretch) for stretch in one.unsupported],
            }
            for one in adjustment.corrections
        ],
    }


def _of_network(adjustment: Adjustment) -> list[str]:
    problems = []
    if len(adjustment.groups) > 1:
        names = "; ".join(", ".join(group) for group in adjustment.groups)
        problems.append(f"passes fall into groups without ground in common: {names}")
    for one in adjustment.corrections:
        alone = sum(end - begin for begin, end in one.unsupported)
        share_alone = alone / (one.knots.end - one.knots.begin)
        if alone:
            problems.append(
                f"{one.name} is tied by smoothness alone over {share_alone:.0%} of its way, where "
                "no other pass sees the same ground"
            )
    return problems
