"""Registration of two signals: shift and scale of the stations at which they agree best.

A feature at station x of the first signal lies at x + shift + scale (x - start) of the second one,
`start` being the first station of the first signal.
"""

from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from trueterrain.core.errors import CoverageError
from trueterrain.roughness.agreement._signal import FilteredSignal, ProfileTrack, signal_of
from trueterrain.roughness.agreement.settings import AgreementSettings

Array = npt.NDArray[np.float64]

_TIE = 1e-9  # [1] ratings that differ by less are equal: the smaller shift is taken
_ROUNDING = 1e-13  # [1] of a correlation
_CONVERGED = 1e-7  # [m] correction of a station below which the iteration ends
_VALLEY = 0.5  # [1] fraction of the best rating, below which a peak has ended
_RIVAL = 0.95  # [1] fraction of the best rating, from which on another peak may be the true one
_AT_SAMPLE = 1e-6  # [samples] by which a station may miss a sample because of rounding
_SINGULAR = 1e-14  # [1] fraction of the largest singular value below which one counts as 0
_MAX_ITERATIONS = 20
_MAX_HALVINGS = 6
_MIN_STRETCHES = 3  # from which on a scale can be separated from a shift
_MIN_STRETCH = 20.0  # [m]


class SignalCorrelation(NamedTuple):
    """Correlation of two signals where they overlap, and the normal equations of a correction."""

    rating: float
    "Covariance over the larger one of both variances [1]."

    correlation: float
    "Covariance over the geometric mean of both variances [1]."

    sd_ratio: float
    "Standard deviation of the second over that of the first [1]."

    overlap: float
    "Length of the overlap [m]."

    products: Array
    "Sums of all products of 1, b, b', x b' and a, see `_kernels.accumulate_products`."


class RegisteredPair(NamedTuple):
    """Two registered tracks: their shift and scale, and how well they agree there."""

    plain: SignalCorrelation
    "Correlation at the best shift."

    shift: float
    "Best shift [m]."

    corrected: SignalCorrelation
    "Correlation at the best shift and scale; as `plain` if no scale is searched."

    corrected_shift: float
    "Shift at the start of the first, with that scale [m]."

    scale: float
    "Scale of the stations of the second [m/m]; NaN if it is not searched."

    rival: float | None
    "Another shift that is rated nearly as well [m], on a periodic road; None if there is none."

    starts: tuple[float, float]
    "First stations of both after the transient [m]; the scale counts from that of the first."

    @property
    def shift_back(self) -> float:
        """Corrected shift of the first against the second, at the second's first station [m]."""
        # inverse of x -> x + shift + scale (x - start)
        distance = self.starts[1] - self.starts[0] - self.corrected_shift
        return -(self.corrected_shift + self.scale * distance / (1 + self.scale))


def register_pair(
    first: ProfileTrack, second: ProfileTrack, settings: AgreementSettings
) -> RegisteredPair:
    """Find the best shift of a pair, and the best scale if it is searched."""
    step = settings.step or min(first.spacing, second.spacing)
    one, other = signal_of(first, settings, step), signal_of(second, settings, step)
    starts = one.start, other.start
    shift, rival = best_shift(one, other, settings)
    plain = correlate_signals(one, other, shift, 0.0)
    if settings.max_scale == 0:
        return RegisteredPair(plain, shift, plain, shift, np.nan, rival, starts)
    found, coarse = best_scale(one, other, shift, settings)
    # the wavelengths of a filter are in metres: scale the profile before it is filtered
    origin = float(second.station[0])
    station = origin + (second.station - origin) / (1 + coarse)
    other = signal_of(replace(second, station=station), settings, step)
    near = origin + (one.start + found - origin) / (1 + coarse) - one.start
    fine_shift, fine = refine_registration(one, other, near, 0.0, settings)
    corrected = correlate_signals(one, other, fine_shift, fine)
    # both scales one after the other, and the shift in stations of the second as it was measured
    station_there = origin + (1 + coarse) * (one.start + fine_shift - origin)
    scale = (1 + coarse) * (1 + fine) - 1
    return RegisteredPair(plain, shift, corrected, station_there - one.start, scale, rival, starts)


def correlate_signals(
    first: FilteredSignal, second: FilteredSignal, shift: float, scale: float
) -> SignalCorrelation:
    """Correlate two signals at a shift [m] and a scale [m/m]."""
    from trueterrain.roughness.agreement import _kernels

    step = first.step
    offset = (first.start + shift - second.start) / step  # [samples] of the first in the second
    begin = max(0, int(np.ceil(-offset / (1 + scale) - _AT_SAMPLE)))
    sums = np.zeros((5, 5))
    place = offset + begin * (1 + scale)
    _kernels.accumulate_products(first.values, begin, second.cubics, step, place, 1 + scale, sums)
    sums += np.triu(sums, 1).T
    count = max(sums[0, 0], 1.0)
    # sums of squares and products about the means of the overlap
    aa = sums[4, 4] - sums[0, 4] ** 2 / count
    bb = sums[1, 1] - sums[0, 1] ** 2 / count
    ab = sums[1, 4] - sums[0, 1] * sums[0, 4] / count
    if not (aa > 0 and bb > 0):
        return SignalCorrelation(-np.inf, -np.inf, np.nan, (count - 1) * step, sums)
    return SignalCorrelation(
        rating=float(ab / max(aa, bb)),
        correlation=float(ab / np.sqrt(aa * bb)),
        sd_ratio=float(np.sqrt(bb / aa)),
        overlap=float((count - 1) * step),
        products=sums,
    )


def best_shift(
    first: FilteredSignal, second: FilteredSignal, settings: AgreementSettings
) -> tuple[float, float | None]:
    """Shift at which the rating is largest [m]: among whole samples, then between them.

    The second value is another shift, beyond a minimum of the ratings, that is rated nearly as
    well.
    """
    from scipy.signal import correlate

    step = first.step
    a, b = first.values - first.values.mean(), second.values - second.values.mean()
    offset = second.start - first.start
    lags = np.arange(
        np.ceil((-settings.max_shift - offset) / step - _TIE),
        np.floor((settings.max_shift - offset) / step + _TIE) + 1,
    ).astype(np.int64)
    begin, end = np.maximum(0, -lags), np.minimum(a.size, b.size - lags)
    count = end - begin
    enough = count * step >= settings.min_overlap
    if not enough.any():
        raise _overlap_error(first, second, settings)
    lags, begin, end, count = lags[enough], begin[enough], end[enough], count[enough]
    # ratings at all lags at once: products by FFT, sums over the overlap from running sums
    products = correlate(b, a, mode="full", method="fft")[lags + a.size - 1]
    sum_a, square_a = _running_sums(a, begin, end)
    sum_b, square_b = _running_sums(b, begin + lags, end + lags)
    covariance = products - sum_a * sum_b / count
    larger = np.maximum(square_a - sum_a**2 / count, square_b - sum_b**2 / count)
    flat = np.full_like(larger, -np.inf)  # signals without variance have no rating
    ratings = np.divide(covariance, larger, out=flat, where=larger > 0)
    shifts = offset + lags * step
    ties = np.flatnonzero(ratings >= ratings.max() - _TIE)
    best = int(ties[np.argmin(np.abs(shifts[ties]))])
    shift, _ = refine_registration(
        first, second, float(shifts[best]), 0.0, settings, with_scale=False
    )
    rival = _second_peak(ratings, best)
    return shift, None if rival is None else float(shifts[rival])


def _second_peak(ratings: Array, best: int) -> int | None:
    """Sample of another peak nearly as high as the best, None if there is none."""
    low = np.flatnonzero(ratings < _VALLEY * ratings[best])
    before, after = low[low < best], low[low > best]
    begin = int(before[-1]) + 1 if before.size else 0
    end = int(after[0]) if after.size else ratings.size
    others = np.where(
        (np.arange(ratings.size) < begin) | (np.arange(ratings.size) >= end), ratings, -np.inf
    )
    found = int(np.argmax(others))
    return found if others[found] > _RIVAL * ratings[best] > 0 else None


def best_scale(
    first: FilteredSignal, second: FilteredSignal, shift: float, settings: AgreementSettings
) -> tuple[float, float]:
    """Shift [m] and scale [m/m] at which the correlation of the signals is largest."""
    starts = (shift, 0.0), _stack_correlations(first, second, shift, settings)
    start = max(starts, key=lambda pair: correlate_signals(first, second, *pair).correlation)
    return refine_registration(first, second, *start, settings)


def refine_registration(
    first: FilteredSignal,
    second: FilteredSignal,
    shift: float,
    scale: float,
    settings: AgreementSettings,
    *,
    with_scale: bool = True,
) -> tuple[float, float]:
    """Refine a shift and a scale by least squares of the difference of the signals.

    Gauss-Newton iterations on first = mean + gain * second(x + shift + scale (x - start)): mean and
    gain are unknowns as well, so that the minimum is where the correlation is largest.
    """
    here = correlate_signals(first, second, shift, scale)
    for _ in range(_MAX_ITERATIONS):
        change = _registration_step(first, here.products, with_scale=with_scale)
        # at most four samples at a time: beyond, the signal is not linear in the shift
        largest = _max_station_change(first, change)
        change *= min(1.0, 4 * first.step / largest) if largest > 0 else 1.0
        for _ in range(_MAX_HALVINGS):
            trial = float(shift + change[0]), float(scale + change[1])
            there = correlate_signals(first, second, *trial)
            enough = there.overlap >= 0.5 * settings.min_overlap
            if enough and there.correlation >= here.correlation - _ROUNDING:
                break
            change *= 0.5
        else:
            break
        (shift, scale), here = trial, there
        if _max_station_change(first, change) < _CONVERGED:
            break
    return shift, scale


def _registration_step(first: FilteredSignal, products: Array, *, with_scale: bool) -> Array:
    """Correction of shift and scale: one linear least-squares problem."""
    unknowns = 4 if with_scale else 3
    solved = np.linalg.lstsq(
        products[:unknowns, :unknowns], products[:unknowns, 4], rcond=_SINGULAR
    )[0]
    # unknowns mean, gain, gain * shift, gain * scale * length of the first
    gain = solved[1] if solved[1] != 0 else 1.0
    scale = solved[3] / (first.values.size * first.step) if with_scale else 0.0
    return np.array([solved[2], scale]) / gain


def _max_station_change(first: FilteredSignal, change: Array) -> float:
    """Largest change of a station [m]."""
    return float(abs(change[0]) + abs(change[1]) * first.length)


def _stack_correlations(
    first: FilteredSignal, second: FilteredSignal, shift: float, settings: AgreementSettings
) -> tuple[float, float]:
    """Shift and scale at which the sum of the correlations of many short stretches is largest.

    A scale shifts each stretch by a different length, and its effect within a stretch is small. So
    the correlation of each stretch is computed once at all shifts, and looked up at the shift that
    each pair of shift and scale gives it.
    """
    step = first.step
    width = _correlation_width(first.values) * step
    # so short that the largest scale shifts its ends by one correlation width
    length = max(width / settings.max_scale, _MIN_STRETCH)
    count = min(int(first.length / length), int(first.length / _MIN_STRETCH))
    if first.length < _MIN_STRETCHES * _MIN_STRETCH:
        return shift, 0.0
    edges = np.linspace(0, first.values.size, max(count, _MIN_STRETCHES) + 1).astype(int)
    every = max(step, 0.5 * width)
    shifts = every * np.arange(
        -np.ceil(settings.max_shift / every), np.ceil(settings.max_shift / every) + 1
    )
    reach = settings.max_scale * first.length
    scales = every / first.length * np.arange(-np.ceil(reach / every), np.ceil(reach / every) + 1)
    total = np.zeros((scales.size, shifts.size))
    for begin, end in pairwise(edges):
        centre = 0.5 * (begin + end - 1) * step
        lowest, table = _correlate_stretch(first, second, begin, end, centre, settings)
        at = (shifts + scales[:, None] * centre - lowest) / step
        at = np.clip(np.rint(at).astype(np.int64), 0, table.size - 1)
        total += table[at]
    row, column = np.unravel_index(int(total.argmax()), total.shape)
    return float(shifts[column]), float(scales[row])


def _correlate_stretch(
    first: FilteredSignal,
    second: FilteredSignal,
    begin: int,
    end: int,
    centre: float,
    settings: AgreementSettings,
) -> tuple[float, Array]:
    """Correlations of a stretch with the second signal: lowest shift [m], one value per sample."""
    from scipy.signal import correlate

    step = first.step
    offset = second.start - first.start
    reach = settings.max_shift + settings.max_scale * centre
    lowest, highest = (int(np.rint((sign * reach - offset) / step)) for sign in (-1, 1))
    table = np.zeros(highest - lowest + 1)
    part = first.values[begin:end] - first.values[begin:end].mean()
    # samples of the second signal that exist: lags from `low` to `high`
    low, high = max(lowest, -begin), min(highest, second.values.size - end)
    if high < low:
        return lowest * step + offset, table
    other = second.values[begin + low : end + high]
    other = other - other.mean()
    size = np.full(high - low + 1, end - begin)
    where = np.arange(size.size)
    sums, squares = _running_sums(other, where, where + size)
    variation = np.maximum(squares - sums**2 / size, 0.0)
    products = correlate(other, part, mode="valid", method="fft")
    scale = np.sqrt(float(part @ part) * variation)
    table[low - lowest : high - lowest + 1] = np.divide(
        products, scale, out=np.zeros_like(products), where=scale > 0
    )
    return lowest * step + offset, table


def _running_sums(
    values: Array, begin: npt.NDArray[np.int64], end: npt.NDArray[np.int64]
) -> list[Array]:
    """Sums of values and of their squares from `begin` to before `end`."""
    return [
        (sums := np.concatenate([[0.0], np.cumsum(power)]))[end] - sums[begin]
        for power in (values, values**2)
    ]


def _correlation_width(values: Array) -> int:
    """Lag [samples] at which the autocorrelation of a signal falls to a half."""
    from scipy.signal import correlate

    part = values[: 1 << 16] - values[: 1 << 16].mean()
    auto = correlate(part, part, mode="full", method="fft")[part.size - 1 :]
    below = np.flatnonzero(auto < 0.5 * auto[0])
    return max(1, int(below[0])) if below.size else part.size


def _overlap_error(
    first: FilteredSignal, second: FilteredSignal, settings: AgreementSettings
) -> CoverageError:
    ranges = [f"{one.start:g} to {one.start + one.length:g} m" for one in (first, second)]
    message = (
        f"overlap by less than {settings.min_overlap:g} m after the filter: "
        f"{ranges[0]}, and {ranges[1]}, with shifts up to {settings.max_shift:g} m"
    )
    return CoverageError(
        message,
        place=f"{first.name} and {second.name}",
        cure="Count stations from the start of each profile, or allow larger shifts.",
    )
