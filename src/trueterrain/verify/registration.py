"""Registration: where a measured profile lies on a machined one, before errors are counted.

Offset, tilt and shift along the profile say how scanner and plate stood to each other. Charged to
the heights they would look like errors of the profiler: most of all the shift, at every edge.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.errors import CoverageError, SchemaError

Floats = npt.NDArray[np.float64]

_STEP = 0.001  # [m] between the shifts that are tried first for every millimetre of the search
_COARSE = 0.01  # [m] the same for long searches
_LONG = 0.5  # [m] half range from which a search is long
_PRECISE = 1e-6  # [m] to which the shift is found
_NEARLY = 2e-5  # [m/m] to which the stretch is found, and [m] the shift meanwhile
_STRETCH = 0.01  # [m/m] by which a way may be measured too long or too short
_TRIED = 5  # stretches of either sign that are tried first
_ASIDE = 3  # steps by which the shift may change with the stretch
_HUBER = 1.345  # standard deviations beyond which a point weighs less
_CUT = 3.0  # the same beyond which a point is an outlier
_BOUND = 0.003  # [m] residual beyond which a point costs no more, as beside upright edges
_NMAD = 1.4826  # times the median absolute deviation is the standard deviation of normal errors
_LEAST_SCALE = 5e-5  # [m] standard deviation that is believed at least
_ROUNDS = 12  # of reweighting
_GAIN = (0.7, 1.4)  # between which the measured shape is that of the plate, in its height
_SHAPE = 0.7  # correlation with the machined shape from which a plate is found
_LENGTH, _HEIGHT = (0.05, 20.0), (0.001, 1.0)  # [m] that plates may span
_LEAST = 20  # points on the plate
_CLEARLY = 0.9  # of the cost of the one direction that the other must stay below
_SAME = 1e-10  # [m2] by which costs differ at least
_NARROW = 0.9  # of the reference must be measured


@dataclass(frozen=True, kw_only=True)
class Registration:
    """How a measured profile lies on a machined one."""

    shift: float
    "Where the machined profile begins in the measured coordinate (its end, if reversed) [m]."

    offset: float
    "Height of the measured zero over the machined one in the middle of the plate [m]."

    tilt: float
    "Slope of the measured ground line against that of the plate [rad]."

    reversed: bool
    "Whether the machined profile runs against the measured coordinate."

    residual: float
    "Root mean square of what is left, without outliers [m]."

    unregistered: float
    "The same before the shift, from where the plate was assumed; NaN if that is not known [m]."

    outliers: int
    "Points beyond three robust standard deviations."

    points: int
    "Points on the plate."

    length: float
    "Length of the machined profile [m]."

    stretch: float = 0.0
    "By how much the plate is measured too long; 0 unless it was asked for [m/m]."

    def positions(self, along: npt.ArrayLike) -> Floats:
        """Positions on the machined profile of measured coordinates.

        Parameters
        ----------
        along : array_like
            Measured coordinates [m].

        Returns
        -------
        numpy.ndarray
            s of the machined profile [m].
        """
        s = (np.asarray(along, dtype=np.float64) - self.shift) / (1.0 + self.stretch)
        return self.length - s if self.reversed else s

    def level(self, along: npt.ArrayLike) -> Floats:
        """Height that offset and tilt add at measured coordinates [m].

        Parameters
        ----------
        along : array_like
            Measured coordinates [m].

        Returns
        -------
        numpy.ndarray
            To be taken off measured heights.
        """
        s = np.asarray(along, dtype=np.float64) - self.shift
        middle = 0.5 * self.length * (1.0 + self.stretch)
        return np.asarray(self.offset + math.tan(self.tilt) * (s - middle))


def check_machined(machined: xr.Dataset, *, path: object = None) -> tuple[Floats, Floats]:
    """Nodes of a machined profile, if it can be one of a plate.

    Parameters
    ----------
    machined : xarray.Dataset
        Profile; straight lines join its nodes.
    path : path, optional
        Its file, for the message.

    Returns
    -------
    s, height : numpy.ndarray
        Distance from its first node, and height [m].

    Raises
    ------
    SchemaError
        If it has several tracks or gaps, or spans what no plate does: a wrong unit.
    """
    file = None if path is None else str(path)
    if "track" in machined.dims:
        raise SchemaError("must have one track", path=file, place="machined profile")
    s = machined["s"].values - machined["s"].values[0]
    height = machined["height"].values.astype(np.float64)
    if not np.isfinite(height).all():
        raise SchemaError("must have no gaps", path=file, place="machined profile")
    for name, span, (least, most) in (
        ("s", float(np.ptp(s)), _LENGTH), ("height", float(np.ptp(height)), _HEIGHT),
    ):  # fmt: skip
        if not least <= span <= most:
            raise SchemaError(
                f"spans {span:g} m, a plate spans {least:g} to {most:g} m: it is in another unit",
                path=file, place=f"machined profile, {name}",
                cure=f"Name the unit in the header, as in `{name} [mm]`.",
            )  # fmt: skip
    return s, height


def register(
    along: npt.ArrayLike,
    height: npt.ArrayLike,
    machined: xr.Dataset,
    *,
    assumed: float | None = None,
    search: float | None = None,
    stretch: bool = False,
) -> Registration:
    """Find offset, tilt and shift of a measured profile against the machined one.

    Parameters
    ----------
    along : array_like, shape (n,)
        Measured coordinates [m].
    height : array_like, shape (n,)
        Measured heights [m].
    machined : xarray.Dataset
        Machined profile.
    assumed : float, optional
        Where the plate is assumed to begin in the measured coordinate [m].
    search : float, optional
        Greatest distance from there [m]; by default the plate is looked for everywhere. 0 takes it
        as it lies: neither shift nor stretch are taken off, and no plate need be recognised.
    stretch : bool
        Whether the length over which the plate is measured is found too: a way that drifts while it
        is crossed is measured too long or too short, by 1 % at most.

    Returns
    -------
    Registration
        Of the direction that fits better.

    Raises
    ------
    ValueError
        If the arrays are of different lengths, or `search` is given without `assumed`.
    SchemaError
        If the machined profile is none, or its heights are in another unit.
    CoverageError
        If too little is measured, or the plate is not found.

    Notes
    -----
    Shifts are tried one after the other; at each, offset and tilt are those of the smallest
    absolute deviations as Huber's weights find them, and the cost of a point is bounded, so that
    neither edges nor saturated returns pull (Huber 1964). The shift with the least cost is refined
    by golden section, and so is the stretch: at each, the shift is found again. A shape that
    correlates less than 0.7, or of another height, is no plate.

    Examples
    --------
    >>> from trueterrain.kinds import make_profile
    >>> plate = make_profile([0, 0.3, 0.36, 0.42, 1.0], [0, 0, 0.05, 0, 0])
    >>> y = np.arange(-1, 1, 0.004)
    >>> z = 2 + 0.01 * (y + 0.1) + np.interp(y + 0.6, plate.s, plate.height)
    >>> found = register(y, z, plate)
    >>> print(f"{found.shift:.4f} m, {found.offset:.4f} m, {found.tilt:.4f} rad")
    -0.6000 m, 2.0000 m, 0.0100 rad
    """
    x, z = (np.asarray(values, dtype=np.float64) for values in (along, height))
    if x.shape != z.shape or x.ndim != 1:
        message = f"along and height must be of one length, got {x.shape} and {z.shape}."
        raise ValueError(message)
    if search is not None and assumed is None:
        message = "search needs assumed, where the plate is assumed to begin."
        raise ValueError(message)
    good = np.isfinite(x) & np.isfinite(z)
    order = np.argsort(x[good], kind="stable")
    x, z = x[good][order], z[good][order]
    s, h = check_machined(machined)
    shifts = _shifts(x, float(s[-1]), assumed, search)
    as_it_lies = search == 0
    ahead, against = (
        _best(_Fit(x, z, nodes, shape), shifts, refine=not as_it_lies)
        for nodes, shape in ((s, h), (s[-1] - s[::-1], h[::-1]))
    )
    # a plate that looks the same from both sides is not turned by noise
    turned = against[0] < _CLEARLY * ahead[0] - _SAME
    cost, shift, fit = against if turned else ahead
    if not math.isfinite(cost):
        raise CoverageError("holds too few points where the plate is looked for")
    if not as_it_lies:
        _require_plate(fit, shift, shifts)
    before = math.nan if assumed is None else _rms_before(fit, assumed)
    stretched = 0.0
    if stretch and not as_it_lies:
        fit, shift, stretched = _stretched(fit, shift)
    offset, tilt, residual = fit.at(shift)
    scale = _scale(residual)
    inside = np.abs(residual) <= _CUT * scale
    return Registration(
        shift=shift, offset=offset, tilt=math.atan(tilt), reversed=turned,
        residual=float(np.sqrt(np.mean(residual[inside] ** 2))), unregistered=before,
        outliers=int((~inside).sum()), points=residual.size, length=float(s[-1]),
        stretch=stretched,
    )  # fmt: skip


class _Fit:
    """A measured profile and a machined one, to be laid onto each other."""

    def __init__(self, x: Floats, z: Floats, s: Floats, h: Floats) -> None:
        self.x, self.z, self.s, self.h = x, z, s, h
        self.length = float(s[-1])

    def stretched(self, stretch: float) -> "_Fit":
        """The same with a machined profile that is longer by a share."""
        return _Fit(self.x, self.z, (1.0 + stretch) * self.s, self.h)

    def on_plate(self, shift: float) -> tuple[Floats, Floats, Floats]:
        """Distances from the middle of the plate, heights, and machined heights."""
        first, end = np.searchsorted(self.x, (shift, shift + self.length))
        along = self.x[first:end] - shift
        return along - 0.5 * self.length, self.z[first:end], np.interp(along, self.s, self.h)

    def at(self, shift: float, rounds: int = _ROUNDS) -> tuple[float, float, Floats]:
        """Offset, slope and residuals with the plate at a shift."""
        t, z, h = self.on_plate(shift)
        y = z - h
        weight = np.ones_like(y)
        offset = slope = 0.0
        for _ in range(rounds):
            total = weight.sum()
            mean_t, mean_y = (weight @ t) / total, (weight @ y) / total
            slope = float((weight * (t - mean_t)) @ y / ((weight * (t - mean_t)) @ t))
            offset = float(mean_y - slope * mean_t)
            residual = y - offset - slope * t
            weight = np.minimum(
                1.0, _HUBER * _scale(residual) / np.maximum(np.abs(residual), 1e-12)
            )
        return offset, slope, y - offset - slope * t

    def cost(self, shift: float, cut: float, rounds: int) -> float:
        """Mean bounded square of the residuals; infinite where too little is measured."""
        t = self.on_plate(shift)[0]
        if t.size < _LEAST or np.ptp(t) < _NARROW * self.length:
            return math.inf
        residual = self.at(shift, rounds)[2]
        return float(np.mean(np.minimum(residual**2, cut**2)))


def _shifts(x: Floats, length: float, assumed: float | None, search: float | None) -> Floats:
    low, high = float(x[0]) - 0.1 * length, float(x[-1]) - 0.9 * length
    if assumed is not None and search == 0:
        return np.array([assumed])
    if assumed is not None and search is not None:
        low, high = max(low, assumed - search), min(high, assumed + search)
    step = _STEP if high - low <= 2 * _LONG else _COARSE
    return np.arange(low, high + step, step) if high >= low else np.empty(0)


def _best(fit: _Fit, shifts: Floats, *, refine: bool = True) -> tuple[float, float, _Fit]:
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
        fine = float(shifts[best]) + np.arange(-step, step + _STEP, _STEP)
        return _best(fit, fine)
    shift = _golden(fit, float(shifts[best]) - step, float(shifts[best]) + step)
    return costs[best], shift, fit


def _golden(fit: _Fit, low: float, high: float) -> float:
    """Shift of least cost, its bound that of robust residuals."""
    cut = _bound(fit, 0.5 * (low + high))
    return _least(lambda shift: fit.cost(shift, cut, _ROUNDS), low, high)


def _stretched(fit: _Fit, shift: float) -> tuple[_Fit, float, float]:
    """The same plate with the length over which it is measured free, its shift, and the stretch."""
    cut = _bound(fit, shift)
    rises = np.abs(np.diff(fit.h))
    # about the middle of its relief, stretch and shift hardly interfere
    middle = float(rises @ (0.5 * (fit.s[1:] + fit.s[:-1])) / rises.sum())

    def laid(stretch: float, rounds: int = _ROUNDS) -> tuple[float, float]:
        """Least cost with a stretch, and its shift."""
        one = fit.stretched(stretch)

        def cost(where: float) -> float:
            return one.cost(where, cut, rounds)

        near = shift - stretch * middle + _STEP * np.arange(-_ASIDE, _ASIDE + 1)
        best = min(near.tolist(), key=cost)
        best = _least(cost, best - _STEP, best + _STEP, _NEARLY)
        return cost(best), best

    tried = np.linspace(-_STRETCH, _STRETCH, 2 * _TRIED + 1).tolist()
    best = min(tried, key=lambda stretch: laid(stretch, 3)[0])
    apart = _STRETCH / _TRIED
    found = _least(lambda stretch: laid(stretch)[0], best - apart, best + apart, _NEARLY)
    longer, shift = fit.stretched(found), laid(found)[1]
    return longer, _golden(longer, shift - _STEP, shift + _STEP), found


def _bound(fit: _Fit, shift: float) -> float:
    """Residual beyond which a point costs no more."""
    return max(_CUT * _scale(fit.at(shift)[2]), _BOUND)


def _least(
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


def _require_plate(fit: _Fit, shift: float, shifts: Floats) -> None:
    """Raise unless the measured shape is that of the plate."""
    likeness, gain = _likeness(fit, shift)
    if likeness >= _SHAPE and _GAIN[0] <= gain <= _GAIN[1]:
        return
    # where heights are in another unit, the plate fits worst where it lies: look at shapes alone
    alike = [_likeness(fit, float(one)) for one in shifts]
    best, gain = max([(likeness, gain), *alike])
    if best >= _SHAPE and not _GAIN[0] <= gain <= _GAIN[1]:
        raise SchemaError(
            f"heights are measured as {gain:.3g} times the machined ones: "
            "the profile is in another unit, or that of another plate",
            place="machined profile, height",
            cure="Name the unit in the header, as in `height [mm]`.",
        )
    raise CoverageError(
        f"the plate is not found: the shape that fits best correlates by {likeness:.2f}, "
        f"less than {_SHAPE}",
        cure="Say where it lies, or look whether it was scanned: `trueterrain plot`.",
    )


def _likeness(fit: _Fit, shift: float) -> tuple[float, float]:
    """Correlation of the measured shape with the machined one, and how much higher it is."""
    t, z, h = fit.on_plate(shift)
    if t.size < _LEAST or np.ptp(t) < _NARROW * fit.length:
        return -1.0, 0.0
    plane = np.stack([np.ones_like(t), t], axis=-1)
    shape, seen = (
        values - plane @ np.linalg.lstsq(plane, values, rcond=None)[0] for values in (h, z)
    )
    product, power = float(shape @ seen), float(shape @ shape)
    return product / math.sqrt(max(power * float(seen @ seen), 1e-30)), product / max(power, 1e-30)


def _rms_before(fit: _Fit, assumed: float) -> float:
    """Root mean square of residuals with the plate where it was assumed."""
    if not math.isfinite(fit.cost(assumed, math.inf, 1)):
        return math.nan
    residual = fit.at(assumed)[2]
    return float(np.sqrt(np.mean(residual**2)))


def _scale(residual: Floats) -> float:
    return max(_NMAD * float(np.median(np.abs(residual - np.median(residual)))), _LEAST_SCALE)
