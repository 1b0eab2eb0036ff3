"""Differences between the passes, and the least squares that explain them."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trueterrain.formats.run import Mounting
from trueterrain.georeference._patches import NAMES, SHARED, GroundPatches, PatchGrid
from trueterrain.georeference._wander import COMPONENTS, MotionErrorModel

Floats = npt.NDArray[np.float64]

#: What is taken to be known of each parameter before: angles [rad], arms [m], clock [s].
BROAD = np.array([0.1] * 3 + [1.0] * 3 + [0.1])

_OFFSET = 1.0  # [m] of what is taken to be known of the offset of a pass
_ROUNDS = 2  # in which weights follow what is left, and the wander of heights what is seen
_HUBER = 2.0  # standard deviations beyond which a residual weighs less
_TO_SD = 1.0 / 0.6745  # standard deviation over median of magnitudes
_STEEP = 0.03  # share of the cells that are the steepest
_LEAST_STEEP = 0.02  # slope that a steep cell has at least


@dataclass(frozen=True, kw_only=True, eq=False)
class PatchDifferences:
    """Patches that at least two passes see."""

    misfit: Floats
    "Height of each pass less the mean of the passes, shape (pass, cell) [m]; 0 where unseen."

    design: Floats
    """Derivative of it by the parameters, then by the offset of each pass but the first, shape
    (pass, cell, k)."""

    effect: Floats
    """Derivative of the height of each pass by the errors of its motion (east, north, up, roll,
    pitch, yaw), shape (pass, cell, 6); 0 where unseen."""

    time: Floats
    "When each pass saw the cell, shape (pass, cell) [s]; any where unseen."

    there: npt.NDArray[np.bool_]
    "Whether a pass saw it, shape (pass, cell)."

    slope: Floats
    "Magnitude of the slope, shape (cell,) [1]."

    degrees_of_freedom: Floats
    "Passes that see it less one, shape (cell,)."

    block: npt.NDArray[np.intp]
    "Number of the square of ground that the cell lies in, shape (cell,)."

    @property
    def squares(self) -> int:
        """Squares of ground in which cells lie."""
        return int(self.block.max()) + 1

    @property
    def correspondences(self) -> int:
        """Independent differences of height."""
        return int(self.degrees_of_freedom.sum())

    def less_mean(self, values: Floats) -> Floats:
        """Values of shape (pass, cell, k), 0 where unseen, less the mean of the passes."""
        return _less_mean(values, self.there, self.degrees_of_freedom + 1.0)


def shared_times(seen: list[GroundPatches]) -> list[Floats]:
    """When each pass sees cells that another one sees too, NaN elsewhere [s]."""
    valid = np.stack([np.isfinite(part.height) for part in seen])
    shared = valid.sum(axis=0) >= 2
    return [np.where(shared, part.time, np.nan) for part in seen]


def form_height_differences(
    seen: list[GroundPatches], grid: PatchGrid, cluster: float, mounting: Mounting
) -> PatchDifferences | None:
    """Differences between passes; None if no ground is seen twice.

    Parameters
    ----------
    seen : list of Patches
        What each pass sees.
    grid : MapGrid
        Its cells.
    cluster : float
        Size of the squares in which errors may be correlated [m].
    mounting : Mounting
        Where the scanner is taken to sit.

    Returns
    -------
    Differences or None
        Of all cells that two passes see.
    """
    height = np.stack([part.height for part in seen])
    valid = np.isfinite(height)
    row, column = np.nonzero(valid.sum(axis=0) >= 2)
    if not row.size:
        return None
    there = valid[:, row, column]
    count = there.sum(axis=0)
    height = np.where(there, height[:, row, column], 0.0)
    slope = sum(np.where(there[p], part.slope[:, row, column], 0.0) for p, part in enumerate(seen))
    slope = np.asarray(slope) / count
    turns = body_turns(mounting)
    design = np.zeros((len(seen), row.size, len(NAMES) + len(seen) - 1))
    effect = np.zeros((len(seen), row.size, COMPONENTS))
    time = np.zeros_like(height)
    for p, part in enumerate(seen):
        by = part.shift[:, :, row, column]
        change = by[:, 2] - slope[0] * by[:, 0] - slope[1] * by[:, 1]
        design[p, :, : len(NAMES)] = np.where(there[p], change, 0.0).T
        if p:
            design[p, :, len(NAMES) + p - 1] = there[p]
        moved = np.concatenate([-slope, np.ones((1, row.size)), turns @ change])
        effect[p] = np.where(there[p], moved, 0.0).T
        time[p] = np.where(there[p], part.time[row, column], 0.0)
    size = max(1, round(cluster / grid.spacing))
    squares = -(-grid.shape[1] // size)
    return PatchDifferences(
        misfit=_less_mean(height[:, :, None], there, count)[:, :, 0],
        design=_less_mean(design, there, count),
        effect=effect,
        time=time,
        there=there,
        slope=np.hypot(*slope),
        degrees_of_freedom=count - 1.0,
        block=np.unique(row // size * squares + column // size, return_inverse=True)[1],
    )


def body_turns(mounting: Mounting) -> Floats:
    """What turns of the body do, in terms of the parameters of the mounting.

    A body that turns by a small angle turns the scanner as much, and carries it along on its arm.

    Parameters
    ----------
    mounting : Mounting
        Where the scanner sits.

    Returns
    -------
    numpy.ndarray, shape (3, 7)
        Changes of the parameters that do what a turn about each axis of the body does.

    Examples
    --------
    >>> body_turns(Mounting(scanner_position=(-2.0, 0.0, 1.0)))[1]  # the nose down: the tail up
    array([0., 1., 0., 1., 0., 2., 0.])
    """
    from scipy.spatial.transform import Rotation

    angles = mounting.scanner_rotation
    ahead = Rotation.from_euler("ZYX", angles[::-1]).as_matrix()[:, 0]
    beside = [-np.sin(angles[2]), np.cos(angles[2]), 0.0]
    axes = np.stack([ahead, beside, [0.0, 0.0, 1.0]], axis=1)
    carried = np.cross(np.eye(3), mounting.scanner_position)
    return np.concatenate([np.linalg.pinv(axes).T, carried, np.zeros((3, 1))], axis=1) + 0.0


def _less_mean(values: Floats, there: npt.NDArray[np.bool_], count: Floats) -> Floats:
    mean = values.sum(axis=0) / count[:, None]
    return np.where(there[:, :, None], values - mean, 0.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class ParameterEstimate:
    """Least squares of some of the parameters, of the offsets, and of errors of the motion."""

    step: Floats
    "What is to be added to the parameters, then the offsets [their units]."

    motion: Floats
    "What is to be added to the errors of the motion, see `Wander`."

    normal: Floats
    "Normal matrix of all of these, weighted by the scatter of the differences."

    covariance: Floats
    """Of the parameters and offsets, from the scatter of whole squares of ground and from errors
    of the motion at all times."""

    sensitivity: Floats
    "Change of the same by those parameters of all that are not chosen, shape (k, others)."

    residual: float
    "Root mean square of the differences that are left [m]."

    wander: MotionErrorModel
    "Errors of the motion as they were taken in the end."

    unknowns: float
    "Unknowns that the differences tell: of what is known before, a share."

    @property
    def sd(self) -> Floats:
        """Standard deviations, the larger ones of those by cells and by whole squares."""
        by_cells = np.diag(np.linalg.inv(self.normal / SHARED))[: self.step.size]
        return np.sqrt(np.maximum(by_cells, np.diag(self.covariance)))


def fit_parameters(
    found: PatchDifferences,
    chosen: list[int],
    wander: MotionErrorModel,
    moved: Floats,
    *,
    height_noise: float,
    reach: Floats,
) -> ParameterEstimate:
    """Explain the differences.

    Parameters
    ----------
    found : Differences
        The differences.
    chosen : list of int
        Parameters to estimate, by their place in `NAMES`.
    wander : Wander
        Errors of the motion.
    moved : numpy.ndarray, shape (wander.size,)
        By how much the passes were moved against these already.
    height_noise : float
        Least standard deviation of a height [m].
    reach : numpy.ndarray, shape (7,)
        Directions whose standard deviation is beyond that of this are not stepped along.

    Returns
    -------
    Fit
        Of the chosen parameters, all offsets and the errors of the motion.
    """
    plain = found.design.shape[2]
    fixed = [*chosen, *range(len(NAMES), plain)]
    columns = [*fixed, *range(plain, plain + wander.size)]
    others = [index for index in range(len(NAMES)) if index not in chosen]
    known = np.concatenate([BROAD, np.full(plain - len(NAMES), _OFFSET)])[fixed] ** -2.0
    prior = np.zeros((len(columns), len(columns)))
    prior[: len(fixed), : len(fixed)] = np.diag(known)
    scale = np.concatenate([reach[chosen], np.ones(len(fixed) - len(chosen))])
    left = remove_pass_offsets(found)
    for last in np.arange(_ROUNDS) == _ROUNDS - 1:
        prior[len(fixed) :, len(fixed) :] = wander.precision
        before = prior[:, len(fixed) :] @ moved
        weight = _cell_weights(found, left, height_noise)
        told, right = _form_normal_equations(found, wander, weight)
        normal = told[np.ix_(columns, columns)] + SHARED * prior
        step = _solve_determined(normal / SHARED, right[columns] / SHARED - before, scale)
        left = found.misfit + _misfit_changes(found, fixed, wander, step[:, None])[:, :, 0]
        inverse = np.asarray(np.linalg.inv(normal), dtype=np.float64)
        if not last and wander.size:
            known_to = SHARED * inverse[len(fixed) :, len(fixed) :]
            wander = wander.as_seen(step[len(fixed) :], known_to)
    ours = inverse[:, : len(fixed)]
    leverage = weight[:, None] * _misfit_changes(found, fixed, wander, ours)
    unknowns = len(columns) - SHARED * float(np.sum(inverse * prior))
    covariance = _sum_covariance(found, leverage, left, unknowns)
    covariance += wander.covariance(leverage, found.effect, found.time)
    covariance += (SHARED * ours[: len(fixed)] * known) @ (SHARED * ours[: len(fixed)]).T
    return ParameterEstimate(
        step=step[: len(fixed)],
        motion=step[len(fixed) :],
        normal=normal,
        covariance=0.5 * (covariance + covariance.T),
        sensitivity=(-inverse @ told[np.ix_(columns, others)])[: len(fixed)],
        residual=rms_difference(left, found),
        wander=wander,
        unknowns=unknowns,
    )


def _form_normal_equations(
    found: PatchDifferences, wander: MotionErrorModel, weight: Floats
) -> tuple[Floats, Floats]:
    """Normal matrix and right side of all parameters, offsets and errors of the motion.

    Cells that each pass sees in one piece of its broken line have a few unknowns in common.
    """
    plain = found.design.shape[2]
    size = plain + wander.size
    normal, right = np.zeros((size, size)), np.zeros(size)
    for cells, columns, design in _group_cells(found, wander):
        flat = design.reshape(-1, columns.size)
        weighted = (weight[cells, None] * design).reshape(flat.shape)
        normal[np.ix_(columns, columns)] += weighted.T @ flat
        right[columns] -= weighted.T @ found.misfit[:, cells].ravel()
    return normal, right


def _group_cells(
    found: PatchDifferences, wander: MotionErrorModel
) -> Iterator[tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], Floats]]:
    """Cells of like pieces, their unknowns, and the derivatives by these, (pass, cell, k)."""
    plain = found.design.shape[2]
    if not wander.size:
        yield np.arange(found.slope.size), np.arange(plain), found.design
        return
    places = [wander.place(p, time) for p, time in enumerate(found.time)]
    key = np.zeros(found.slope.size, dtype=np.intp)
    for knots, (piece, _) in zip(wander.knots, places, strict=True):
        key = key * knots.size + piece
    order = np.argsort(key, kind="stable")
    for cells in np.split(order, np.flatnonzero(np.diff(key[order])) + 1):
        columns, parts = [np.arange(plain)], []
        for p, (piece, x) in enumerate(places):
            columns.append(plain + wander.columns(p, int(piece[cells[0]])))
            effect = found.effect[p][np.ix_(cells, wander.uncertain[p])]
            late = x[cells, None] * effect
            part = np.zeros((len(places), cells.size, 2 * effect.shape[1]))
            part[p] = np.concatenate([effect - late, late], axis=1)
            parts.append(part)
        count = found.degrees_of_freedom[cells] + 1.0
        motion = _less_mean(np.concatenate(parts, axis=2), found.there[:, cells], count)
        design = np.concatenate([found.design[:, cells], motion], axis=2)
        yield cells, np.concatenate(columns), design


def _misfit_changes(
    found: PatchDifferences, fixed: list[int], wander: MotionErrorModel, step: Floats
) -> Floats:
    """What steps of shape (unknown, m) do to the misfits, shape (pass, cell, m)."""
    moved = found.design[:, :, fixed] @ step[: len(fixed)]
    if wander.size:
        moved += found.less_mean(wander.caused(step[len(fixed) :], found.effect, found.time))
    return np.asarray(moved)


def _sum_covariance(
    found: PatchDifferences, leverage: Floats, left: Floats, unknowns: float
) -> Floats:
    """Covariance of what heights are summed to, from the scatter of whole squares of ground."""
    scores = np.einsum("pci,pc->ci", leverage, left)
    blocks = found.squares
    summed = np.stack(
        [np.bincount(found.block, score, minlength=blocks) for score in scores.T], axis=1
    )
    return np.asarray(summed.T @ summed * (blocks / max(blocks - unknowns, 1.0)))


def _solve_determined(normal: Floats, right: Floats, scale: Floats) -> Floats:
    """Solution along the directions that are known better than the scale.

    The scale is that of the first unknowns; all others are known before.
    """
    first, rest = slice(scale.size), slice(scale.size, None)
    carried = np.linalg.solve(
        normal[rest, rest], np.column_stack([normal[rest, first], right[rest]])
    )
    reduced = normal[first, first] - normal[first, rest] @ carried[:, :-1]
    values, vectors = np.linalg.eigh(scale[:, None] * reduced * scale)
    sure = values > 1.0
    aim = scale * (right[first] - normal[first, rest] @ carried[:, -1])
    step = scale * (vectors[:, sure] @ ((vectors[:, sure].T @ aim) / values[sure]))
    return np.concatenate([step, carried[:, -1] - carried[:, :-1] @ step])


def remove_pass_offsets(found: PatchDifferences) -> Floats:
    """Differences less the offset of each pass, found from the level half of the cells."""
    misfit = found.misfit
    offsets = found.design[:, :, len(NAMES) :]
    level = found.slope <= np.median(found.slope)
    for _ in range(2):
        normal = np.einsum("pci,pcj->ij", offsets[:, level], offsets[:, level], optimize=True)
        right = np.einsum("pci,pc->i", offsets[:, level], misfit[:, level], optimize=True)
        misfit = misfit - offsets @ np.linalg.lstsq(normal, right, rcond=None)[0]
    return np.asarray(misfit)


def _cell_weights(found: PatchDifferences, levelled: Floats, height_noise: float) -> Floats:
    """Of each cell: one over the variance of a height there, less for outliers.

    What is uncertain where the ground is level, and what more where it is steep, is told by the
    scatter itself.
    """
    error = np.sqrt((levelled**2).sum(axis=0) / found.degrees_of_freedom)
    level = found.slope <= np.median(found.slope)
    plain = max(height_noise, _TO_SD * float(np.median(error[level])))
    steep = found.slope >= max(float(np.quantile(found.slope, 1.0 - _STEEP)), _LEAST_STEEP)
    aside = 0.0
    if steep.any():
        aside = _TO_SD * float(np.median(error[steep] / found.slope[steep]))
    sd = np.hypot(plain, aside * found.slope)
    beyond = error / sd
    return np.asarray(np.where(beyond > _HUBER, _HUBER / np.maximum(beyond, _HUBER), 1.0) / sd**2)


def rms_difference(misfit: Floats, found: PatchDifferences) -> float:
    """Root mean square of differences [m]."""
    return float(np.sqrt((misfit**2).sum() / found.degrees_of_freedom.sum()))
