"""Merging of passes: compare them, align them, compare them again.

=================  ================================================================================
`method`           what it does
=================  ================================================================================
`network`          one least-squares adjustment of all passes
`discontinuity`    discontinuity vectors along reference paths, pair by pair (thesis 4.3.1)
`grid`             the mean of all passes without correction (thesis 4.3.2); flags disagreement
=================  ================================================================================

All methods are judged by the differences of passes in the same cells, so they can be compared.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from itertools import combinations
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from trueterrain.alignment.adjustment.agreement import PairAgreement, pair_agreements
from trueterrain.alignment.adjustment.network import Adjustment, adjust_passes
from trueterrain.alignment.adjustment.shared_cells import find_shared_cells
from trueterrain.alignment.discontinuity.result import PassAlignment
from trueterrain.alignment.discontinuity.seams import SeamAgreement, find_seams
from trueterrain.alignment.discontinuity.vectors import DiscontinuitySettings
from trueterrain.alignment.observations.cells import PassCells
from trueterrain.alignment.settings import CellSettings, NetworkSettings
from trueterrain.core.errors import CoverageError
from trueterrain.core.progress import Progress, no_progress

Floats = npt.NDArray[np.float64]

Method = Literal["network", "discontinuity", "grid"]

_NEIGHBOURS = 3  # cells, side of the squares over which remaining steps are averaged

#: Corrections added to the heights of each pass in its cells, shape (cell,) [m].
Added = Mapping[str, Floats]


@dataclass(frozen=True, kw_only=True)
class MergeSettings:
    """How passes are merged."""

    method: Method = "network"
    """network: one adjustment of all passes; discontinuity: vectors along reference paths, as in
    the thesis; grid: the mean of all passes, which flags places where they disagree."""

    fixed: tuple[str, ...] = ()
    """Names of passes that are not corrected. By default the mean correction of all passes is
    zero."""

    control: str | None = None
    """CSV file of control points with the columns easting, northing, up and sd [m]; network
    only."""

    path: str | None = None
    """CSV file of waypoints of the reference path through the overlap, with the columns easting and
    northing [m]; discontinuity only. By default the centre of each overlap."""

    limit: float = 0.002
    "Maximum difference of height between passes, for grid and for checks of agreement [m]."

    cells: CellSettings = field(default_factory=lambda: CellSettings(size=0.1))
    "Cells in which passes are compared."

    network: NetworkSettings = field(
        default_factory=lambda: NetworkSettings(components=("height", "roll", "shift"))
    )
    "Settings of the network adjustment."

    discontinuity: DiscontinuitySettings = field(default_factory=DiscontinuitySettings)
    "Settings of the discontinuity vectors."

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
            message = (
                f"the method discontinuity can fix one pass only, got {', '.join(self.fixed)}."
            )
            raise ValueError(message)


@dataclass(frozen=True, kw_only=True, eq=False)
class MergeResult:
    """Corrections of passes, and their agreement before and after."""

    method: Method
    "Method of alignment."

    names: tuple[str, ...]
    "Names of the passes."

    pairs: tuple[PairAgreement, ...]
    "Differences of each pair in their common cells, before and after."

    seams: tuple[SeamAgreement, ...]
    "Steps at the edges of each overlap, before and after."

    adjustment: Adjustment | None
    "Result of the network adjustment; None for other methods."

    alignment: PassAlignment | None
    "Discontinuity vectors; None for other methods."

    problems: tuple[str, ...]
    "Warnings."

    def to_dict(self) -> dict[str, Any]:
        """Result as a dictionary for JSON."""
        found: dict[str, Any] = {
            "method": self.method,
            "passes": list(self.names),
            "pairs": [asdict(pair) for pair in self.pairs],
            "seams": [
                {
                    "lanes": list(seam.names),
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
    """Align passes, and summarise their differences before and after.

    Parameters
    ----------
    cells : sequence of PassCells
        Cells of each pass.
    settings : MergeSettings
        Method and its settings.
    control : sequence of PassCells
        Cells of control points.
    align : callable, optional
        Computes discontinuity vectors from all points; needed for that method only.
    progress : callable, optional
        Called with a task, the amount done and the total.

    Returns
    -------
    MergeResult
        Corrections, and agreement before and after.

    Raises
    ------
    CoverageError
        If no cell is common to two passes, or two passes hold the same returns.
    ValueError
        If `align` is missing for the method discontinuity, or a name is unknown.
    TrueTerrainError
        If the adjustment does not converge.

    Examples
    --------
    >>> from trueterrain.alignment import make_pass_cells
    >>> rng = np.random.default_rng(1)
    >>> x, y = (at.ravel() for at in np.meshgrid(np.arange(0.05, 40, 0.1), np.arange(0.05, 1, 0.1)))
    >>> number = (np.floor(x / 0.1).astype(int) << 32) + np.floor(y / 0.1).astype(int)
    >>> east, west = (
    ...     make_pass_cells(name, number, x / 5, up + rng.normal(0, 1e-3, x.size), variance=1e-6,
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
    seams, no_seams = find_seams(cells, added, settings.cells.size)
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
    """Differences of passes in common cells.

    Parameters
    ----------
    cells : sequence of PassCells
        Cells of each pass.
    added : mapping of str to numpy.ndarray, optional
        Corrections to add to the heights of each pass; by default none.

    Returns
    -------
    list of PairAgreement
        By the names of the passes.

    Raises
    ------
    CoverageError
        If no cell is common to two passes.
    """
    shared = find_shared_cells(cells, (), ())
    after = shared.entries.height
    if added is not None:
        moved = [replace(one, height=one.height + added[one.name]) for one in cells]
        after = find_shared_cells(moved, (), ()).entries.height
    none = np.full(after.size, np.nan)
    return pair_agreements(shared, np.ones(after.size), shared.entries.height, after, none)


def require_different(cells: Sequence[PassCells]) -> None:
    """Raise CoverageError if there is nothing to compare, or a pass is given twice.

    Parameters
    ----------
    cells : sequence of PassCells
        Cells of each pass.
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
        # a horizontal shift d changes the height at a fixed place by -slope * d
        added[one.name] = (
            correction.height_at(one.time, one.offset, one.longitudinal)
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
        f"{name} has no ground in common with another pass and is not aligned"
        for name in found.names
        if name not in paired
    ]
    if settings.method == "grid":
        problems += _steps_left(cells, settings)
    if found.adjustment is not None:
        problems += _of_network(found.adjustment)
    if found.alignment is not None:
        problems += [
            f"{pair.names[0]} and {pair.names[1]}: {int(pair.discontinuity.gap.sum())} of "
            f"{pair.discontinuity.gap.size} reference points have too few heights"
            for pair in found.alignment.pairs
            if pair.discontinuity.gap.any()
        ]
    return replace(found, problems=tuple(problems))


def _steps_left(cells: Sequence[PassCells], settings: MergeSettings) -> list[str]:
    """Warning of places at which the mean difference of passes exceeds the limit."""
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
        "left": adjustment.residual_sd,
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
        extrapolated = sum(end - begin for begin, end in one.unsupported)
        fraction = extrapolated / (one.knots.end - one.knots.begin)
        if extrapolated:
            problems.append(
                f"the correction of {one.name} is extrapolated over {fraction:.0%} of the pass, "
                "where no other pass covers the same ground"
            )
    return problems
