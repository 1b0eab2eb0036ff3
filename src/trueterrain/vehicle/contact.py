"""Tyre contact: height of a wheel as the mean of the ground over a rectangular contact patch.

A tyre envelops obstacles that are shorter than its contact patch; a point follower does not. The
patch is a rectangle that moves with the wheel, and all heights in it have equal weight. The model
has no tyre that bends over obstacles and touches the ground outside of the patch at rest.
"""

from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from trueterrain.core.errors import CoverageError
from trueterrain.vehicle.model import Array

# Fraction of the spacing within which half a patch counts as a whole number of samples [1]
_ROUNDING = 1e-9


@dataclass(frozen=True, kw_only=True)
class Tyre:
    """Contact patch of a tyre, and the number of samples across it.

    Raises
    ------
    ValueError
        If a size is not finite or negative, or there is no sample.

    Notes
    -----
    The default is the patch of a passenger car: 0.18 m is the tread width of a tyre of 185 to
    195 mm. A wheel of radius R that is deflected by F / k cuts a chord of 2 sqrt(2 R F / k) from
    flat ground, 0.22 m for the van (R 0.344 m, F / k 17 mm); as the tread curves away towards both
    ends, the patch is shorter, here 0.15 m.

    Examples
    --------
    >>> print(Tyre(patch_width=0.2, samples_across=5).offsets)
    [-0.08 -0.04  0.    0.04  0.08]
    """

    patch_length: float = 0.15
    "Length of the patch along the path of the wheel [m]."

    patch_width: float = 0.18
    "Width of the patch across the path [m]."

    samples_across: int = 9
    "Number of lines along which the ground is sampled, at the centres of equal strips."

    def __post_init__(self) -> None:
        for field in fields(self)[:2]:
            value = getattr(self, field.name)
            if not (np.isfinite(value) and value >= 0):
                message = f"{field.name} must be finite and at least 0 m, got {value}"
                raise ValueError(message)
        if self.samples_across != int(self.samples_across) or self.samples_across < 1:
            message = f"samples_across must be a whole number from 1 on, got {self.samples_across}"
            raise ValueError(message)

    @property
    def offsets(self) -> Array:
        """Offset of each line from the path of the wheel, from right to left, ascending [m]."""
        count = self.samples_across
        offsets: Array = ((np.arange(count) + 0.5) / count - 0.5) * self.patch_width
        return offsets


def contact_margin(spacing: float, patch_length: float) -> int:
    """Number of samples that a contact patch needs before and behind the wheel.

    Parameters
    ----------
    spacing : float
        Distance between samples along the path [m].
    patch_length : float
        Length of the patch [m].

    Returns
    -------
    int
        Samples.

    Raises
    ------
    ValueError
        If `spacing` is not greater than 0, or `patch_length` is negative.

    Examples
    --------
    >>> contact_margin(0.005, 0.15)
    15
    """
    return len(_patch_weights(spacing, patch_length)) // 2


def contact_heights(heights: npt.ArrayLike, spacing: float, patch_length: float) -> Array:
    """Height of a wheel along its path: moving mean of the ground under its contact patch.

    Parameters
    ----------
    heights : array_like, shape (along, across)
        Ground, sampled along the path on the lines of `Tyre.offsets` [m]; one line may have shape
        (along,).
    spacing : float
        Distance between samples along the path [m].
    patch_length : float
        Length of the patch [m]; 0 is a point follower.

    Returns
    -------
    numpy.ndarray, shape (along - 2 margin,)
        Mean height where the whole patch lies on the samples: element i belongs to sample
        i + margin, see `contact_margin` [m]. Blocks that overlap by 2 margin samples give the same
        bits as one piece.

    Raises
    ------
    ValueError
        If the shape is wrong, `spacing` is not greater than 0, or `patch_length` is negative.
    CoverageError
        If a height is not finite, or there are fewer samples than the patch needs.

    Notes
    -----
    The mean is exact for ground that is linear between samples: it is the trapezoidal rule, with
    partial trapezoids at the ends if the patch ends between samples. All lines across the patch
    have equal weight.

    Examples
    --------
    A step of 0.1 m becomes a ramp as long as the patch:

    >>> step = np.repeat([0.0, 0.1], 4)
    >>> print(contact_heights(step, 0.05, 0.15))
    [0.00416667 0.03333333 0.06666667 0.09583333]
    """
    weights = _patch_weights(spacing, patch_length)
    strip = np.ascontiguousarray(heights, dtype=float)
    if strip.ndim == 1:
        strip = strip[:, None]
    if strip.ndim != 2 or strip.shape[1] == 0:
        message = f"heights must have shape (along, across), got {np.shape(heights)}"
        raise ValueError(message)
    if not np.isfinite(strip).all():
        along, across = np.argwhere(~np.isfinite(strip))[0]
        raise CoverageError(
            f"a tyre must stand on finite heights, got {strip[along, across]} m",
            place=f"sample {along}, line {across}",
            cure="Fill the holes of the surface, or choose another path.",
        )
    if len(strip) < len(weights):
        raise CoverageError(
            f"a patch of {patch_length} m needs {len(weights)} samples along the path, "
            f"got {len(strip)}",
            cure="Extend the ground beyond the path of the wheel by half a patch.",
        )
    from trueterrain.vehicle._kernels import weighted_means

    out = np.empty(len(strip) - len(weights) + 1)
    weighted_means(strip, weights, np.empty(len(strip)), out)
    return out


def _patch_weights(spacing: float, patch_length: float) -> Array:
    """Weight of each sample in the mean over a patch about the central one, shape (odd,)."""
    if not (np.isfinite(spacing) and spacing > 0):
        message = f"spacing must be finite and greater than 0 m, got {spacing}"
        raise ValueError(message)
    if not (np.isfinite(patch_length) and patch_length >= 0):
        message = f"patch_length must be finite and at least 0 m, got {patch_length}"
        raise ValueError(message)
    half = patch_length / (2 * spacing)
    if abs(half - round(half)) < _ROUNDING:
        half = float(round(half))
    if half == 0:
        return np.ones(1)
    # integral of the hat functions of linear interpolation over half a patch: whole intervals give
    # 1/2 to both of their ends; a last partial interval of length r gives r - r²/2 and r²/2
    whole = int(half)
    rest = half - whole
    front = np.zeros(whole + 2)
    front[:whole] += 0.5
    front[1 : whole + 1] += 0.5
    front[whole] += rest - rest**2 / 2
    front[whole + 1] += rest**2 / 2
    if rest == 0:
        front = front[:-1]
    weights: Array = np.concatenate([front[:0:-1], [2 * front[0]], front[1:]]) / (2 * half)
    return weights
