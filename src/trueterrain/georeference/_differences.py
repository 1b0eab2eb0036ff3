"""Height differences between passes, and the least squares that estimate a mounting from them."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from trueterrain.formats.run import Mounting
from trueterrain.georeference._motion_errors import COMPONENTS, MotionErrorModel
from trueterrain.georeference._patches import CORRELATED_CELLS, NAMES, GroundPatches, PatchGrid

Floats = npt.NDArray[np.float64]

#: Prior standard deviation of each parameter: angles [rad], lever arms [m], clock [s].
PRIOR_SD = np.array([0.1] * 3 + [1.0] * 3 + [0.1])

_OFFSET = 1.0  # [m] prior standard deviation of the offset of a pass
_ITERATIONS = 2  # of the weights and of the correlation time of height errors
_HUBER = 2.0  # standard deviations beyond which a residual is down-weighted
_SD_PER_MEDIAN = 1.0 / 0.6745  # standard deviation over median magnitude of normal values
_STEEP_FRACTION = 0.03  # fraction of the cells that count as steep
_MIN_STEEP = 0.02  # minimum slope of a steep cell


@dataclass(frozen=True, kw_only=True, eq=False)
class PatchDifferences:
    """Height differences of all cells that at least two passes see."""

    misfit: Floats
    "Height in each pass less the mean of the passes, shape (pass, cell) [m]; 0 where unseen."

    design: Floats
    """Derivatives of the misfit by the parameters, then by the offset of each pass but the first,
    shape (pass, cell, k)."""

    effect: Floats
    """Derivatives of the height in each pass by the errors of its motion (east, north, up, roll,
    pitch, yaw), shape (pass, cell, 6); 0 where unseen."""

    time: Floats
    "Time at which each pass sees the cell, shape (pass, cell) [s]; arbitrary where unseen."

    valid: npt.NDArray[np.bool_]
    "Whether a pass sees the cell, shape (pass, cell)."

    slope: Floats
    "Magnitude of the slope, shape (cell,) [1]."

    degrees_of_freedom: Floats
    "Number of passes that see the cell less one, shape (cell,)."

    block: npt.NDArray[np.intp]
    "Index of the square of ground that contains the cell, shape (cell,)."

    @property
    def squares(self) -> int:
        """Number of squares of ground that contain cells."""
        return int(self.block.max()) + 1

    @property
    def correspondences(self) -> int:
        """Number of independent height differences."""
        return int(self.degrees_of_freedom.sum())

    def subtract_mean(self, values: Floats) -> Floats:
        """Values of shape (pass, cell, k), 0 where unseen, less their mean over the passes."""
        return _subtract_mean(values, self.valid, self.degrees_of_freedom + 1.0)


def common_times(seen: list[GroundPatches]) -> list[Floats]:
    """Times at which each pass sees cells that another pass sees as well, NaN elsewhere [s]."""
    valid = np.stack([np.isfinite(part.height) for part in seen])
    common = valid.sum(axis=0) >= 2
    return [np.where(common, part.time, np.nan) for part in seen]


def form_height_differences(
    seen: list[GroundPatches], grid: PatchGrid, cluster: float, mounting: Mounting
) -> PatchDifferences | None:
    """Height differences between passes; None if no cell is seen twice.

    Parameters
    ----------
    seen : list of GroundPatches
        Patches of each pass.
    grid : PatchGrid
        Their cells.
    cluster : float
        Size of the squares in which errors may be correlated [m].
    mounting : Mounting
        Assumed mounting.

    Returns
    -------
    PatchDifferences or None
        Of all cells that two passes see.
    """
    height = np.stack([part.height for part in seen])
    valid = np.isfinite(height)
    row, column = np.nonzero(valid.sum(axis=0) >= 2)
    if not row.size:
        return None
    valid = valid[:, row, column]
    count = valid.sum(axis=0)
    height = np.where(valid, height[:, row, column], 0.0)
    slope = sum(np.where(valid[p], part.slope[:, row, column], 0.0) for p, part in enumerate(seen))
    slope = np.asarray(slope) / count
    rotations = rotations_as_parameters(mounting)
    design = np.zeros((len(seen), row.size, len(NAMES) + len(seen) - 1))
    effect = np.zeros((len(seen), row.size, COMPONENTS))
    time = np.zeros_like(height)
    for p, part in enumerate(seen):
        by = part.shift[:, :, row, column]
        # a shift of the returns changes the height at a fixed place by its vertical component less
        # slope times its horizontal one
        change = by[:, 2] - slope[0] * by[:, 0] - slope[1] * by[:, 1]
        design[p, :, : len(NAMES)] = np.where(valid[p], change, 0.0).T
        if p:
            design[p, :, len(NAMES) + p - 1] = valid[p]
        moved = np.concatenate([-slope, np.ones((1, row.size)), rotations @ change])
        effect[p] = np.where(valid[p], moved, 0.0).T
        time[p] = np.where(valid[p], part.time[row, column], 0.0)
    size = max(1, round(cluster / grid.spacing))
    squares = -(-grid.shape[1] // size)
    return PatchDifferences(
        misfit=_subtract_mean(height[:, :, None], valid, count)[:, :, 0],
        design=_subtract_mean(design, valid, count),
        effect=effect,
        time=time,
        valid=valid,
        slope=np.hypot(*slope),
        degrees_of_freedom=count - 1.0,
        block=np.unique(row // size * squares + column // size, return_inverse=True)[1],
    )


def rotations_as_parameters(mounting: Mounting) -> Floats:
    """Changes of the mounting that are equivalent to small rotations of the body.

    A rotation of the body rotates the scanner as much and displaces it by the lever arm. Errors of
    the attitude thus have the derivatives of these parameters.

    Parameters
    ----------
    mounting : Mounting
        Position and attitude of the scanner in the body.

    Returns
    -------
    numpy.ndarray, shape (3, 7)
        Changes of the parameters for a rotation about each axis of the body.

    Examples
    --------
    >>> rotations_as_parameters(Mounting(scanner_position=(-2.0, 0.0, 1.0)))[1]  # nose down
    array([0., 1., 0., 1., 0., 2., 0.])
    """
    angles = mounting.scanner_rotation
    forward = Rotation.from_euler("ZYX", angles[::-1]).as_matrix()[:, 0]
    left = [-np.sin(angles[2]), np.cos(angles[2]), 0.0]
    # axes about which roll, pitch and yaw of the scanner rotate, in the body frame
    axes = np.stack([forward, left, [0.0, 0.0, 1.0]], axis=1)
    displaced = np.cross(np.eye(3), mounting.scanner_position)
    return np.concatenate([np.linalg.pinv(axes).T, displaced, np.zeros((3, 1))], axis=1) + 0.0


def _subtract_mean(values: Floats, valid: npt.NDArray[np.bool_], count: Floats) -> Floats:
    mean = values.sum(axis=0) / count[:, None]
    return np.where(valid[:, :, None], values - mean, 0.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class ParameterEstimate:
    """Least-squares estimate of parameters, offsets of passes and errors of the motion."""

    step: Floats
    "Corrections of the parameters, then of the offsets [their units]."

    motion: Floats
    "Corrections of the errors of the motion, see `MotionErrorModel`."

    normal: Floats
    "Normal matrix of all of these, weighted by the scatter of the differences."

    covariance: Floats
    """Covariance of the parameters and offsets, from the scatter of whole squares of ground and
    from errors of the motion at all times."""

    sensitivity: Floats
    "Derivatives of the parameters and offsets by parameters not chosen, shape (k, others)."

    residual: float
    "Root mean square of the residuals [m]."

    errors: MotionErrorModel
    "Model of the errors of the motion, with the estimated correlation time of heights."

    unknowns: float
    "Effective number of unknowns that the differences determine, beyond their priors."

    @property
    def sd(self) -> Floats:
        """Standard deviations by cells or by whole squares, whichever is larger."""
        by_cells = np.diag(np.linalg.inv(self.normal / CORRELATED_CELLS))[: self.step.size]
        return np.sqrt(np.maximum(by_cells, np.diag(self.covariance)))


def estimate_parameters(
    found: PatchDifferences,
    chosen: list[int],
    errors: MotionErrorModel,
    moved: Floats,
    *,
    height_noise: float,
    reach: Floats,
) -> ParameterEstimate:
    """Estimate parameters, offsets and errors of the motion from height differences.

    Parameters
    ----------
    found : PatchDifferences
        Height differences.
    chosen : list of int
        Parameters to estimate, by their index in `NAMES`.
    errors : MotionErrorModel
        Prior of the errors of the motion.
    moved : numpy.ndarray, shape (errors.size,)
        Errors for which the passes have been corrected already.
    height_noise : float
        Minimum standard deviation of a height [m].
    reach : numpy.ndarray, shape (7,)
        Standard deviations of parameters; directions that are determined worse are not corrected.

    Returns
    -------
    ParameterEstimate
        Of the chosen parameters, all offsets and the errors of the motion.
    """
    base = found.design.shape[2]
    fixed = [*chosen, *range(len(NAMES), base)]
    columns = [*fixed, *range(base, base + errors.size)]
    others = [index for index in range(len(NAMES)) if index not in chosen]
    prior_weight = np.concatenate([PRIOR_SD, np.full(base - len(NAMES), _OFFSET)])[fixed] ** -2.0
    prior = np.zeros((len(columns), len(columns)))
    prior[: len(fixed), : len(fixed)] = np.diag(prior_weight)
    scale = np.concatenate([reach[chosen], np.ones(len(fixed) - len(chosen))])
    residual = remove_pass_offsets(found)
    for last in np.arange(_ITERATIONS) == _ITERATIONS - 1:
        prior[len(fixed) :, len(fixed) :] = errors.precision
        before = prior[:, len(fixed) :] @ moved
        weight = _cell_weights(found, residual, height_noise)
        data_normal, right = _form_normal_equations(found, errors, weight)
        # errors of neighbouring cells are correlated: the data count CORRELATED_CELLS times too
        # often, so the priors are weighted as much more
        normal = data_normal[np.ix_(columns, columns)] + CORRELATED_CELLS * prior
        step = _solve_determined(
            normal / CORRELATED_CELLS, right[columns] / CORRELATED_CELLS - before, scale
        )
        residual = found.misfit + _misfit_changes(found, fixed, errors, step[:, None])[:, :, 0]
        inverse = np.asarray(np.linalg.inv(normal), dtype=np.float64)
        if not last and errors.size:
            motion_covariance = CORRELATED_CELLS * inverse[len(fixed) :, len(fixed) :]
            errors = errors.with_estimated_drift_time(step[len(fixed) :], motion_covariance)
    columns_of_inverse = inverse[:, : len(fixed)]
    leverage = weight[:, None] * _misfit_changes(found, fixed, errors, columns_of_inverse)
    unknowns = len(columns) - CORRELATED_CELLS * float(np.sum(inverse * prior))
    covariance = _sum_covariance(found, leverage, residual, unknowns)
    covariance += errors.covariance(leverage, found.effect, found.time)
    # the priors are observations as well
    prior_leverage = CORRELATED_CELLS * columns_of_inverse[: len(fixed)]
    covariance += (prior_leverage * prior_weight) @ prior_leverage.T
    return ParameterEstimate(
        step=step[: len(fixed)],
        motion=step[len(fixed) :],
        normal=normal,
        covariance=0.5 * (covariance + covariance.T),
        sensitivity=(-inverse @ data_normal[np.ix_(columns, others)])[: len(fixed)],
        residual=rms_difference(residual, found),
        errors=errors,
        unknowns=unknowns,
    )


def _form_normal_equations(
    found: PatchDifferences, errors: MotionErrorModel, weight: Floats
) -> tuple[Floats, Floats]:
    """Normal matrix and right side of all parameters, offsets and errors of the motion.

    Cells that each pass sees in the same piece of its motion errors depend on the same few unknowns
    and are added together.
    """
    base = found.design.shape[2]
    size = base + errors.size
    normal, right = np.zeros((size, size)), np.zeros(size)
    for cells, columns, design in _group_cells(found, errors):
        flat = design.reshape(-1, columns.size)
        weighted = (weight[cells, None] * design).reshape(flat.shape)
        normal[np.ix_(columns, columns)] += weighted.T @ flat
        right[columns] -= weighted.T @ found.misfit[:, cells].ravel()
    return normal, right


def _group_cells(
    found: PatchDifferences, errors: MotionErrorModel
) -> Iterator[tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], Floats]]:
    """Cells with the same pieces, their unknowns, and the derivatives by these, (pass, cell, k)."""
    base = found.design.shape[2]
    if not errors.size:
        yield np.arange(found.slope.size), np.arange(base), found.design
        return
    places = [errors.locate(p, time) for p, time in enumerate(found.time)]
    key = np.zeros(found.slope.size, dtype=np.intp)
    for knots, (piece, _) in zip(errors.knots, places, strict=True):
        key = key * knots.size + piece
    order = np.argsort(key, kind="stable")
    for cells in np.split(order, np.flatnonzero(np.diff(key[order])) + 1):
        columns, parts = [np.arange(base)], []
        for p, (piece, x) in enumerate(places):
            columns.append(base + errors.columns(p, int(piece[cells[0]])))
            effect = found.effect[p][np.ix_(cells, errors.uncertain[p])]
            end = x[cells, None] * effect
            part = np.zeros((len(places), cells.size, 2 * effect.shape[1]))
            part[p] = np.concatenate([effect - end, end], axis=1)
            parts.append(part)
        count = found.degrees_of_freedom[cells] + 1.0
        motion = _subtract_mean(np.concatenate(parts, axis=2), found.valid[:, cells], count)
        design = np.concatenate([found.design[:, cells], motion], axis=2)
        yield cells, np.concatenate(columns), design


def _misfit_changes(
    found: PatchDifferences, fixed: list[int], errors: MotionErrorModel, step: Floats
) -> Floats:
    """Changes of the misfits, (pass, cell, m), by steps of shape (unknown, m)."""
    changed = found.design[:, :, fixed] @ step[: len(fixed)]
    if errors.size:
        changed += found.subtract_mean(
            errors.height_changes(step[len(fixed) :], found.effect, found.time)
        )
    return np.asarray(changed)


def _sum_covariance(
    found: PatchDifferences, leverage: Floats, residual: Floats, unknowns: float
) -> Floats:
    """Covariance of weighted sums of heights from the scatter of whole squares of ground.

    Errors within a square may be correlated (Cameron, Gelbach and Miller, 2011).
    """
    scores = np.einsum("pci,pc->ci", leverage, residual)
    blocks = found.squares
    summed = np.stack(
        [np.bincount(found.block, score, minlength=blocks) for score in scores.T], axis=1
    )
    return np.asarray(summed.T @ summed * (blocks / max(blocks - unknowns, 1.0)))


def _solve_determined(normal: Floats, right: Floats, scale: Floats) -> Floats:
    """Solution along the directions that are determined better than the scale.

    The scale is that of the first unknowns; the others have priors and are eliminated (Schur
    complement).
    """
    first, rest = slice(scale.size), slice(scale.size, None)
    eliminated = np.linalg.solve(
        normal[rest, rest], np.column_stack([normal[rest, first], right[rest]])
    )
    reduced = normal[first, first] - normal[first, rest] @ eliminated[:, :-1]
    values, vectors = np.linalg.eigh(scale[:, None] * reduced * scale)
    determined = values > 1.0
    aim = scale * (right[first] - normal[first, rest] @ eliminated[:, -1])
    step = scale * (
        vectors[:, determined] @ ((vectors[:, determined].T @ aim) / values[determined])
    )
    return np.concatenate([step, eliminated[:, -1] - eliminated[:, :-1] @ step])


def remove_pass_offsets(found: PatchDifferences) -> Floats:
    """Differences less the offset of each pass, estimated from the level half of the cells."""
    misfit = found.misfit
    offsets = found.design[:, :, len(NAMES) :]
    level = found.slope <= np.median(found.slope)
    for _ in range(2):
        normal = np.einsum("pci,pcj->ij", offsets[:, level], offsets[:, level], optimize=True)
        right = np.einsum("pci,pc->i", offsets[:, level], misfit[:, level], optimize=True)
        misfit = misfit - offsets @ np.linalg.lstsq(normal, right, rcond=None)[0]
    return np.asarray(misfit)


def _cell_weights(found: PatchDifferences, residual: Floats, height_noise: float) -> Floats:
    """Weight of each cell: inverse variance of a height there, reduced for outliers (Huber).

    The variance is that of level ground plus that of a horizontal displacement times the squared
    slope; the scatter of level and of steep cells determines both.
    """
    error = np.sqrt((residual**2).sum(axis=0) / found.degrees_of_freedom)
    level = found.slope <= np.median(found.slope)
    base = max(height_noise, _SD_PER_MEDIAN * float(np.median(error[level])))
    steep = found.slope >= max(float(np.quantile(found.slope, 1.0 - _STEEP_FRACTION)), _MIN_STEEP)
    lateral_sd = 0.0
    if steep.any():
        lateral_sd = _SD_PER_MEDIAN * float(np.median(error[steep] / found.slope[steep]))
    sd = np.hypot(base, lateral_sd * found.slope)
    normalised = error / sd
    return np.asarray(
        np.where(normalised > _HUBER, _HUBER / np.maximum(normalised, _HUBER), 1.0) / sd**2
    )


def rms_difference(misfit: Floats, found: PatchDifferences) -> float:
    """Root mean square of differences [m]."""
    return float(np.sqrt((misfit**2).sum() / found.degrees_of_freedom.sum()))
