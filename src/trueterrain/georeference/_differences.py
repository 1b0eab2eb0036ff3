"""Differences between the passes, and the least squares that explain them."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trueterrain.georeference._patches import NAMES, SHARED, MapGrid, Patches

Floats = npt.NDArray[np.float64]

#: What is taken to be known of each parameter before: angles [rad], arms [m], clock [s].
BROAD = np.array([0.1] * 3 + [1.0] * 3 + [0.1])

_EAST = 3  # place of east among the errors of motion: roll, pitch, yaw, east, north
_ROUNDS = 2  # in which weights follow what is left
_HUBER = 2.0  # standard deviations beyond which a residual weighs less
_TO_SD = 1.0 / 0.6745  # standard deviation over median of magnitudes
_STEEP = 0.03  # share of the cells that are the steepest
_LEAST_STEEP = 0.02  # slope that a steep cell has at least


@dataclass(frozen=True, kw_only=True, eq=False)
class Differences:
    """Patches that at least two passes see."""

    misfit: Floats
    "Height of each pass less the mean of the passes, shape (pass, cell) [m]; 0 where unseen."

    design: Floats
    """Derivative by parameters, then by the offset of each pass but the first, then by errors of
    motion, shape (pass, cell, k)."""

    sd: Floats
    "What is known before of all these, standard deviations, shape (k,)."

    moved: Floats
    "By how much the passes were moved against errors of their motion already, shape (k,)."

    aside: npt.NDArray[np.intp]
    "Pass and axis (east, north) of the last columns of the design, those that move passes aside."

    slope: Floats
    "Magnitude of the slope, shape (cell,) [1]."

    freedom: Floats
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
        return int(self.freedom.sum())


def differences(
    seen: list[Patches], grid: MapGrid, cluster: float, motion_sd: Floats, moved: Floats
) -> Differences | None:
    """Differences between passes; None if no ground is seen twice.

    Parameters
    ----------
    seen : list of Patches
        What each pass sees.
    grid : MapGrid
        Its cells.
    cluster : float
        Size of the squares in which errors may be correlated [m].
    motion_sd : numpy.ndarray, shape (pass, 5)
        Standard deviations of roll, pitch, yaw [rad], east and north [m] of each pass as a whole.
    moved : numpy.ndarray, shape (pass, 2)
        By how much each pass was moved east and north already [m].

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
    moving = np.argwhere(motion_sd > 0)
    moving = moving[np.argsort(moving[:, 1] >= _EAST, kind="stable")]
    aside = moving[moving[:, 1] >= _EAST] - np.array([0, _EAST])
    first = len(NAMES) + len(seen) - 1
    design = np.zeros((len(seen), row.size, first + len(moving)))
    for p, part in enumerate(seen):
        by = part.shift[:, :, row, column]
        change = by[:, 2] - slope[0] * by[:, 0] - slope[1] * by[:, 1]
        design[p, :, : len(NAMES)] = np.where(there[p], change, 0.0).T
        if p:
            design[p, :, len(NAMES) + p - 1] = there[p]
        # an angle of the body that is wrong does what that of the scanner does
        effects = [*change[:3], *-slope]
        for place in np.flatnonzero(moving[:, 0] == p):
            design[p, :, first + place] = np.where(there[p], effects[moving[place, 1]], 0.0)
    size = max(1, round(cluster / grid.spacing))
    squares = -(-grid.shape[1] // size)
    return Differences(
        misfit=_less_mean(height[:, :, None], there, count)[:, :, 0],
        design=_less_mean(design, there, count),
        sd=np.concatenate([BROAD, np.full(len(seen) - 1, 1.0), motion_sd[tuple(moving.T)]]),
        moved=np.concatenate([np.zeros(design.shape[2] - len(aside)), moved[tuple(aside.T)]]),
        aside=aside,
        slope=np.hypot(*slope),
        freedom=count - 1.0,
        block=np.unique(row // size * squares + column // size, return_inverse=True)[1],
    )


def _less_mean(values: Floats, there: npt.NDArray[np.bool_], count: Floats) -> Floats:
    mean = values.sum(axis=0) / count[:, None]
    return np.where(there[:, :, None], values - mean, 0.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Fit:
    """Least squares of some of the parameters and of the offsets."""

    step: Floats
    "What is to be added to the parameters, then the offsets [their units]."

    normal: Floats
    "Normal matrix of the same, weighted by the scatter of the differences."

    covariance: Floats
    "Of the same, from the scatter of whole squares of ground."

    sensitivity: Floats
    "Change of the same by those parameters of all that are not chosen, shape (k, others)."

    residual: float
    "Root mean square of the differences that are left [m]."

    raw: float
    "The same before, less offsets in height [m]."

    @property
    def sd(self) -> Floats:
        """Standard deviations, the larger ones of those by cells and by whole squares."""
        by_cells = np.diag(np.linalg.inv(self.normal / SHARED))
        return np.sqrt(np.maximum(by_cells, np.diag(self.covariance)))


def fit(found: Differences, chosen: list[int], *, height_noise: float, reach: Floats) -> Fit:
    """Explain the differences.

    Parameters
    ----------
    found : Differences
        The differences.
    chosen : list of int
        Parameters to estimate, by their place in `NAMES`.
    height_noise : float
        Least standard deviation of a height [m].
    reach : numpy.ndarray, shape (7,)
        Directions whose standard deviation is beyond that of this are not stepped along.

    Returns
    -------
    Fit
        Of the chosen parameters and all offsets.
    """
    columns = [*chosen, *range(len(NAMES), found.design.shape[2])]
    design, prior = found.design[:, :, columns], found.sd[columns] ** -2.0
    scale = np.concatenate([reach[chosen], np.ones(len(columns) - len(chosen))])
    left = levelled = _levelled(found)
    for _ in range(_ROUNDS):
        weight = _weights(found, left, height_noise)
        normal = np.einsum("pci,c,pcj->ij", design, weight, design, optimize=True)
        normal += np.diag(SHARED * prior)
        right = -np.einsum("pci,c,pc->i", design, weight, found.misfit, optimize=True)
        right -= SHARED * prior * found.moved[columns]
        step = _followed(normal / SHARED, right / SHARED, scale)
        left = found.misfit + design @ step
    others = [index for index in range(len(NAMES)) if index not in chosen]
    mixed = np.einsum(
        "pci,c,pcj->ij", design, weight, found.design[:, :, others], optimize=True
    )  # fmt: skip
    scores = np.einsum("pci,c,pc->ci", design, weight, left, optimize=True)
    blocks = found.squares
    summed = np.stack(
        [np.bincount(found.block, score, minlength=blocks) for score in scores.T], axis=1
    )
    inverse = np.linalg.inv(normal)
    scatter = summed.T @ summed * (blocks / max(blocks - len(columns), 1))
    covariance = inverse @ (scatter + np.diag(SHARED**2 * prior)) @ inverse
    return Fit(
        step=step, normal=normal, covariance=0.5 * (covariance + covariance.T),
        sensitivity=-inverse @ mixed, residual=_rms(left, found), raw=_rms(levelled, found),
    )  # fmt: skip


def _followed(normal: Floats, right: Floats, scale: Floats) -> Floats:
    """Solution along the directions that are known better than the scale."""
    values, vectors = np.linalg.eigh(scale[:, None] * normal * scale)
    sure = values > 1.0
    return np.asarray(
        scale * (vectors[:, sure] @ ((vectors[:, sure].T @ (scale * right)) / values[sure]))
    )


def _levelled(found: Differences) -> Floats:
    """Differences less the offset of each pass, found from the level half of the cells."""
    misfit = found.misfit
    offsets = found.design[:, :, len(NAMES) : len(NAMES) + len(misfit) - 1]
    level = found.slope <= np.median(found.slope)
    for _ in range(2):
        normal = np.einsum("pci,pcj->ij", offsets[:, level], offsets[:, level], optimize=True)
        right = np.einsum("pci,pc->i", offsets[:, level], misfit[:, level], optimize=True)
        misfit = misfit - offsets @ np.linalg.lstsq(normal, right, rcond=None)[0]
    return np.asarray(misfit)


def _weights(found: Differences, levelled: Floats, height_noise: float) -> Floats:
    """Of each cell: one over the variance of a height there, less for outliers.

    What is uncertain where the ground is level, and what more where it is steep, is told by the
    scatter itself.
    """
    error = np.sqrt((levelled**2).sum(axis=0) / found.freedom)
    level = found.slope <= np.median(found.slope)
    plain = max(height_noise, _TO_SD * float(np.median(error[level])))
    steep = found.slope >= max(float(np.quantile(found.slope, 1.0 - _STEEP)), _LEAST_STEEP)
    aside = 0.0
    if steep.any():
        aside = _TO_SD * float(np.median(error[steep] / found.slope[steep]))
    sd = np.hypot(plain, aside * found.slope)
    beyond = error / sd
    return np.asarray(np.where(beyond > _HUBER, _HUBER / np.maximum(beyond, _HUBER), 1.0) / sd**2)


def _rms(misfit: Floats, found: Differences) -> float:
    return float(np.sqrt((misfit**2).sum() / found.freedom.sum()))
