"""Cost of a registration, and its minimum over offset, tilt, shift and stretch."""

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from trueterrain.core.statistics import nmad

Floats = npt.NDArray[np.float64]

_STEP = 0.001  # [m] step of the first search
_COARSE_STEP = 0.01  # [m] step of the first search over a long range
_REFINED = 5  # number of local minima of a long search that are refined
_LONG = 0.5  # [m] half range from which a search is long
_TOLERANCE = 1e-6  # [m] of the shift
_STRETCH_TOLERANCE = 2e-5  # [m/m] of the stretch, and [m] of the shift during its search
_MAX_STRETCH = 0.01  # [m/m] of the measured length
_STRETCHES = 5  # number of trial stretches of either sign
_SHIFT_STEPS = 3  # steps by which the shift may change with the stretch
_HUBER = 1.345  # standard deviations beyond which the weight of a point decreases
_BOUND = 0.003  # [m] residual beyond which the cost of a point is constant, as at upright edges
_MIN_SCALE = 5e-5  # [m] lower bound of the residual standard deviation
_ITERATIONS = 12  # of reweighting
_TRIAL_ITERATIONS = 3  # of reweighting, for trial values

#: Robust standard deviations beyond which a point is an outlier.
OUTLIER_BOUND = 3.0

#: Smallest number of points on a plate.
MIN_POINTS = 20

#: Smallest measured fraction of a plate.
MIN_FRACTION = 0.9


class RegistrationFit:
    """Registration of a measured profile to a machined one: residuals and cost at a shift.

    ``x``, ``z``: coordinates, ascending, and heights of the measured profile, shape (n,) [m].
    ``s``, ``h``: nodes and heights of the machined profile, shape (m,) [m].
    """

    def __init__(self, x: Floats, z: Floats, s: Floats, h: Floats) -> None:
        self.x, self.z, self.s, self.h = x, z, s, h
        self.length = float(s[-1])

    def stretched(self, stretch: float) -> "RegistrationFit":
        """The same with a machined profile that is longer by a fraction."""
        return RegistrationFit(self.x, self.z, (1.0 + stretch) * self.s, self.h)

    def on_plate(self, shift: float) -> tuple[Floats, Floats, Floats]:
        """Distances from the centre of the plate, heights and machined heights [m]."""
        first, end = np.searchsorted(self.x, (shift, shift + self.length))
        along = self.x[first:end] - shift
        return along - 0.5 * self.length, self.z[first:end], np.interp(along, self.s, self.h)

    def at(self, shift: float, iterations: int = _ITERATIONS) -> tuple[float, float, Floats]:
        """Offset [m], slope [m/m] and residuals [m] with the plate at a shift.

        Huber's weights are found by iterative reweighting (Huber 1964).
        """
        t, z, h = self.on_plate(shift)
        y = z - h
        weight = np.ones_like(y)
        offset = slope = 0.0
        for _ in range(iterations):
            total = weight.sum()
            mean_t, mean_y = (weight @ t) / total, (weight @ y) / total
            slope = float((weight * (t - mean_t)) @ y / ((weight * (t - mean_t)) @ t))
            offset = float(mean_y - slope * mean_t)
            residual = y - offset - slope * t
            weight = np.minimum(
                1.0, _HUBER * robust_scale(residual) / np.maximum(np.abs(residual), 1e-12)
            )
        return offset, slope, y - offset - slope * t

    def cost(self, shift: float, cut: float, iterations: int) -> float:
        """Mean square of bounded residuals [m²]; infinite if too little of the plate is there."""
        t = self.on_plate(shift)[0]
        if t.size < MIN_POINTS or np.ptp(t) < MIN_FRACTION * self.length:
            return math.inf
        residual = self.at(shift, iterations)[2]
        return float(np.mean(np.minimum(residual**2, cut**2)))


def trial_shifts(x: Floats, length: float, assumed: float | None, search: float | None) -> Floats:
    """Trial shifts of the first search [m]."""
    low, high = float(x[0]) - 0.1 * length, float(x[-1]) - 0.9 * length
    if assumed is not None and search == 0:
        return np.array([assumed])
    if assumed is not None and search is not None:
        low, high = max(low, assumed - search), min(high, assumed + search)
    step = _STEP if high - low <= 2 * _LONG else _COARSE_STEP
    return np.arange(low, high + step, step) if high >= low else np.empty(0)


def best_shift(
    fit: RegistrationFit, shifts: Floats, *, refine: bool = True
) -> tuple[float, float, RegistrationFit]:
    """Cost, shift and fit of the best trial shift, refined by golden section on request."""
    cut = 0.25 * float(np.ptp(fit.h))
    costs = [fit.cost(float(shift), cut, _TRIAL_ITERATIONS) for shift in shifts]
    if not costs or not np.isfinite(costs).any():
        return math.inf, math.nan, fit
    best = int(np.argmin(costs))
    if not refine:
        return costs[best], float(shifts[best]), fit
    step = float(shifts[1] - shifts[0]) if shifts.size > 1 else _STEP
    if step > 2 * _STEP:
        # a coarse search may miss the global minimum: the lowest local minima are refined
        padded = np.concatenate([[math.inf], costs, [math.inf]])
        minima = np.flatnonzero((costs <= padded[:-2]) & (costs <= padded[2:]))
        lowest = minima[np.argsort(np.array(costs)[minima], kind="stable")][:_REFINED]
        near = np.arange(-step, step + _STEP, _STEP)
        return min((best_shift(fit, shifts[at] + near) for at in lowest), key=lambda one: one[0])
    shift = _refined_shift(fit, float(shifts[best]) - step, float(shifts[best]) + step)
    return costs[best], shift, fit


def _refined_shift(fit: RegistrationFit, low: float, high: float) -> float:
    """Shift of least cost in an interval, with the bound of robust residuals [m]."""
    cut = _residual_bound(fit, 0.5 * (low + high))
    return _golden_section(lambda shift: fit.cost(shift, cut, _ITERATIONS), low, high)


def stretched_fit(fit: RegistrationFit, shift: float) -> tuple[RegistrationFit, float, float]:
    """Registration with free stretch of the measured length: fit, shift [m] and stretch [m/m]."""
    cut = _residual_bound(fit, shift)
    rises = np.abs(np.diff(fit.h))
    # relative to the centroid of the relief, stretch and shift are almost uncorrelated
    centre = float(rises @ (0.5 * (fit.s[1:] + fit.s[:-1])) / rises.sum())

    def fitted_cost(stretch: float, iterations: int = _ITERATIONS) -> tuple[float, float]:
        """Least cost with a stretch, and its shift."""
        stretched = fit.stretched(stretch)

        def cost(trial: float) -> float:
            return stretched.cost(trial, cut, iterations)

        near = shift - stretch * centre + _STEP * np.arange(-_SHIFT_STEPS, _SHIFT_STEPS + 1)
        best = min(near.tolist(), key=cost)
        best = _golden_section(cost, best - _STEP, best + _STEP, _STRETCH_TOLERANCE)
        return cost(best), best

    trials = np.linspace(-_MAX_STRETCH, _MAX_STRETCH, 2 * _STRETCHES + 1).tolist()
    best = min(trials, key=lambda stretch: fitted_cost(stretch, _TRIAL_ITERATIONS)[0])
    step = _MAX_STRETCH / _STRETCHES
    found = _golden_section(
        lambda stretch: fitted_cost(stretch)[0], best - step, best + step, _STRETCH_TOLERANCE
    )
    longer, shift = fit.stretched(found), fitted_cost(found)[1]
    return longer, _refined_shift(longer, shift - _STEP, shift + _STEP), found


def _residual_bound(fit: RegistrationFit, shift: float) -> float:
    """Residual beyond which the cost of a point is constant [m]."""
    return max(OUTLIER_BOUND * robust_scale(fit.at(shift)[2]), _BOUND)


def _golden_section(
    cost: Callable[[float], float], low: float, high: float, tolerance: float = _TOLERANCE
) -> float:
    """Minimum of a unimodal function by golden section search."""
    ratio = 0.5 * (math.sqrt(5) - 1)
    a, b = high - ratio * (high - low), low + ratio * (high - low)
    cost_a, cost_b = cost(a), cost(b)
    while high - low > tolerance:
        if cost_a <= cost_b:
            high, b, cost_b = b, a, cost_a
            a = high - ratio * (high - low)
            cost_a = cost(a)
        else:
            low, a, cost_a = a, b, cost_b
            b = low + ratio * (high - low)
            cost_b = cost(b)
    return 0.5 * (low + high)


def robust_scale(residual: Floats) -> float:
    """Robust standard deviation of residuals [m]."""
    return max(nmad(residual), _MIN_SCALE)
