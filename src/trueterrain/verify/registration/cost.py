"""Laying a machined profile onto a measured one: offset, tilt, shift and stretch of least cost."""

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from trueterrain.core.statistics import nmad

Floats = npt.NDArray[np.float64]

_STEP = 0.001  # [m] between the shifts that are tried first for every millimetre of the search
_COARSE = 0.01  # [m] the same for long searches
_REFINED = 5  # of the best shifts of a long search that are looked at more closely
_LONG = 0.5  # [m] half range from which a search is long
_PRECISE = 1e-6  # [m] to which the shift is found
_NEARLY = 2e-5  # [m/m] to which the stretch is found, and [m] the shift meanwhile
_STRETCH = 0.01  # [m/m] by which a way may be measured too long or too short
_TRIED = 5  # stretches of either sign that are tried first
_ASIDE = 3  # steps by which the shift may change with the stretch
_HUBER = 1.345  # standard deviations beyond which a point weighs less
_BOUND = 0.003  # [m] residual beyond which a point costs no more, as beside upright edges
_LEAST_SCALE = 5e-5  # [m] standard deviation that is believed at least
_ROUNDS = 12  # of reweighting

#: Robust standard deviations beyond which a point is an outlier.
CUT = 3.0

#: Fewest points on a plate.
LEAST_POINTS = 20

#: Share of a plate that must be measured.
NARROW = 0.9


class RegistrationFit:
    """A measured profile and a machined one, to be laid onto each other."""

    def __init__(self, x: Floats, z: Floats, s: Floats, h: Floats) -> None:
        self.x, self.z, self.s, self.h = x, z, s, h
        self.length = float(s[-1])

    def stretched(self, stretch: float) -> "RegistrationFit":
        """The same with a machined profile that is longer by a share."""
        return RegistrationFit(self.x, self.z, (1.0 + stretch) * self.s, self.h)

    def on_plate(self, shift: float) -> tuple[Floats, Floats, Floats]:
        """Distances from the middle of the plate, heights, and machined heights."""
        first, end = np.searchsorted(self.x, (shift, shift + self.length))
        along = self.x[first:end] - shift
        return along - 0.5 * self.length, self.z[first:end], np.interp(along, self.s, self.h)

    def at(self, shift: float, iterations: int = _ROUNDS) -> tuple[float, float, Floats]:
        """Offset, slope and residuals with the plate at a shift."""
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
                1.0, _HUBER * scale_of(residual) / np.maximum(np.abs(residual), 1e-12)
            )
        return offset, slope, y - offset - slope * t

    def cost(self, shift: float, cut: float, iterations: int) -> float:
        """Mean bounded square of the residuals; infinite where too little is measured."""
        t = self.on_plate(shift)[0]
        if t.size < LEAST_POINTS or np.ptp(t) < NARROW * self.length:
            return math.inf
        residual = self.at(shift, iterations)[2]
        return float(np.mean(np.minimum(residual**2, cut**2)))


def trial_shifts(x: Floats, length: float, assumed: float | None, search: float | None) -> Floats:
    """Shifts that are tried first [m]."""
    low, high = float(x[0]) - 0.1 * length, float(x[-1]) - 0.9 * length
    if assumed is not None and search == 0:
        return np.array([assumed])
    if assumed is not None and search is not None:
        low, high = max(low, assumed - search), min(high, assumed + search)
    step = _STEP if high - low <= 2 * _LONG else _COARSE
    return np.arange(low, high + step, step) if high >= low else np.empty(0)


def best_shift(
    fit: RegistrationFit, shifts: Floats, *, refine: bool = True
) -> tuple[float, float, RegistrationFit]:
    """Cost and shift of the best of some shifts, refined unless it shall be one of them."""
    cut = 0.25 * float(np.ptp(fit.h))
    costs = [fit.cost(float(shift), cut, 3) for shift in shifts]
    if not costs or not np.isfinite(costs).any():
        return math.inf, math.nan, fit
    best = int(np.argmin(costs))
    if not refine:
        return costs[best], float(shifts[best]), fit
    step = float(shifts[1] - shifts[0]) if shifts.size > 1 else _STEP
    if step > 2 * _STEP:
        # where much is missing little remains to differ: the coarse best need not be the best
        around = np.concatenate([[math.inf], costs, [math.inf]])
        lowest = np.flatnonzero((costs <= around[:-2]) & (costs <= around[2:]))
        some = lowest[np.argsort(np.array(costs)[lowest], kind="stable")][:_REFINED]
        near = np.arange(-step, step + _STEP, _STEP)
        return min((best_shift(fit, shifts[at] + near) for at in some), key=lambda one: one[0])
    shift = _best_shift(fit, float(shifts[best]) - step, float(shifts[best]) + step)
    return costs[best], shift, fit


def _best_shift(fit: RegistrationFit, low: float, high: float) -> float:
    """Shift of least cost, its bound that of robust residuals."""
    cut = _residual_bound(fit, 0.5 * (low + high))
    return _golden_section(lambda shift: fit.cost(shift, cut, _ROUNDS), low, high)


def stretched_fit(fit: RegistrationFit, shift: float) -> tuple[RegistrationFit, float, float]:
    """The same plate with the length over which it is measured free, its shift, and the stretch."""
    cut = _residual_bound(fit, shift)
    rises = np.abs(np.diff(fit.h))
    # about the middle of its relief, stretch and shift hardly interfere
    middle = float(rises @ (0.5 * (fit.s[1:] + fit.s[:-1])) / rises.sum())

    def laid(stretch: float, iterations: int = _ROUNDS) -> tuple[float, float]:
        """Least cost with a stretch, and its shift."""
        one = fit.stretched(stretch)

        def cost(where: float) -> float:
            return one.cost(where, cut, iterations)

        near = shift - stretch * middle + _STEP * np.arange(-_ASIDE, _ASIDE + 1)
        best = min(near.tolist(), key=cost)
        best = _golden_section(cost, best - _STEP, best + _STEP, _NEARLY)
        return cost(best), best

    tried = np.linspace(-_STRETCH, _STRETCH, 2 * _TRIED + 1).tolist()
    best = min(tried, key=lambda stretch: laid(stretch, 3)[0])
    apart = _STRETCH / _TRIED
    found = _golden_section(lambda stretch: laid(stretch)[0], best - apart, best + apart, _NEARLY)
    longer, shift = fit.stretched(found), laid(found)[1]
    return longer, _best_shift(longer, shift - _STEP, shift + _STEP), found


def _residual_bound(fit: RegistrationFit, shift: float) -> float:
    """Residual beyond which a point costs no more."""
    return max(CUT * scale_of(fit.at(shift)[2]), _BOUND)


def _golden_section(
    cost: Callable[[float], float], low: float, high: float, precise: float = _PRECISE
) -> float:
    """Where a function of one minimum is least, by golden section."""
    ratio = 0.5 * (math.sqrt(5) - 1)
    a, b = high - ratio * (high - low), low + ratio * (high - low)
    cost_a, cost_b = cost(a), cost(b)
    while high - low > precise:
        if cost_a <= cost_b:
            high, b, cost_b = b, a, cost_a
            a = high - ratio * (high - low)
            cost_a = cost(a)
        else:
            low, a, cost_a = a, b, cost_b
            b = low + ratio * (high - low)
            cost_b = cost(b)
    return 0.5 * (low + high)


def scale_of(residual: Floats) -> float:
    """Robust standard deviation of residuals [m]."""
    return max(nmad(residual), _LEAST_SCALE)
