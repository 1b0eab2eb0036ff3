"""Registration of a measured profile to a machined one by offset, tilt, shift and stretch.

These parameters are the relative position of scanner and plate. Without registration they would
appear as errors of the profiler, the shift most of all, at every edge.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import CoverageError, SchemaError
from trueterrain.verify.registration.cost import (
    MIN_FRACTION,
    MIN_POINTS,
    OUTLIER_BOUND,
    RegistrationFit,
    best_shift,
    robust_scale,
    stretched_fit,
    trial_shifts,
)

Floats = npt.NDArray[np.float64]

_GAIN = (0.7, 1.4)  # bounds of the ratio of measured to machined relief
_MIN_CORRELATION = 0.7  # with the machined shape for a plate to be recognised
_LENGTH, _HEIGHT = (0.05, 20.0), (0.001, 1.0)  # [m] bounds of the size of plates
_REVERSED_COST = 0.9  # fraction of the forward cost below which a plate counts as reversed
_MIN_DIFFERENCE = 1e-10  # [m²] of two costs


@dataclass(frozen=True, kw_only=True)
class Registration:
    """Parameters and quality of a registration."""

    shift: float
    "Measured coordinate of the start of the machined profile (of its end, if reversed) [m]."

    offset: float
    "Measured less machined height at the centre of the plate [m]."

    tilt: float
    "Slope of the measured profile relative to the machined one [rad]."

    reversed: bool
    "Whether the machined profile runs against the measured coordinate."

    residual: float
    "Root mean square of the residuals without outliers [m]."

    unregistered: float
    "The same at the assumed place, before the shift; NaN without an assumed place [m]."

    outliers: int
    "Number of points beyond three robust standard deviations."

    points: int
    "Number of points on the plate."

    length: float
    "Length of the machined profile [m]."

    stretch: float = 0.0
    "Relative excess of the measured length; 0 if it was not estimated [m/m]."

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
        """Contribution of offset and tilt at measured coordinates [m].

        Parameters
        ----------
        along : array_like
            Measured coordinates [m].

        Returns
        -------
        numpy.ndarray
            To be subtracted from measured heights.
        """
        s = np.asarray(along, dtype=np.float64) - self.shift
        centre = 0.5 * self.length * (1.0 + self.stretch)
        return np.asarray(self.offset + math.tan(self.tilt) * (s - centre))


def check_machined_profile(machined: xr.Dataset, *, path: object = None) -> tuple[Floats, Floats]:
    """Check a machined profile, and return its nodes.

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
        If it has several tracks or gaps, or a size that no plate has because of a wrong unit.
    """
    file = None if path is None else str(path)
    if "track" in machined.dims:
        raise SchemaError("must have one track", path=file, place="machined profile")
    s = machined["s"].values - machined["s"].values[0]
    height = machined["height"].values.astype(np.float64)
    if not np.isfinite(height).all():
        raise SchemaError("must have no gaps", path=file, place="machined profile")
    for name, span, (least, most) in (
        ("s", float(np.ptp(s)), _LENGTH),
        ("height", float(np.ptp(height)), _HEIGHT),
    ):
        if not least <= span <= most:
            raise SchemaError(
                f"spans {span:g} m, a plate spans {least:g} to {most:g} m: it is in another unit",
                path=file,
                place=f"machined profile, {name}",
                cure=f"Name the unit in the header, as in `{name} [mm]`.",
            )
    return s, height


def register_profile(
    along: npt.ArrayLike,
    height: npt.ArrayLike,
    machined: xr.Dataset,
    *,
    assumed: float | None = None,
    search: float | None = None,
    stretch: bool = False,
) -> Registration:
    """Estimate offset, tilt and shift of a measured profile relative to the machined one.

    Parameters
    ----------
    along : array_like, shape (n,)
        Measured coordinates [m].
    height : array_like, shape (n,)
        Measured heights [m].
    machined : xarray.Dataset
        Machined profile.
    assumed : float, optional
        Assumed start of the plate in the measured coordinate [m].
    search : float, optional
        Greatest distance from there [m]; by default the whole profile is searched. 0 keeps the
        assumed place: neither shift nor stretch is estimated, and the plate need not be recognised.
    stretch : bool
        Whether the measured length of the plate is estimated too: a drifting position makes it
        wrong, by 1 % at most.

    Returns
    -------
    Registration
        In the direction with the smaller cost.

    Raises
    ------
    ValueError
        If the arrays are of different lengths, or `search` is given without `assumed`.
    SchemaError
        If the machined profile is not that of a plate, or its heights are in another unit.
    CoverageError
        If too little is measured, or the plate is not found.

    Notes
    -----
    The shift is found by a grid search. At each shift, offset and tilt are those of a robust fit
    with Huber's weights (Huber 1964), and the cost of a point is bounded, so that neither edges nor
    saturated returns influence the result. The shift of least cost is refined by golden section
    search, and so is the stretch, with a new search of the shift at each stretch. A shape with a
    correlation below 0.7, or of another height, is not a plate.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_profile
    >>> plate = make_profile([0, 0.3, 0.36, 0.42, 1.0], [0, 0, 0.05, 0, 0])
    >>> y = np.arange(-1, 1, 0.004)
    >>> z = 2 + 0.01 * (y + 0.1) + np.interp(y + 0.6, plate.s, plate.height)
    >>> found = register_profile(y, z, plate)
    >>> print(f"{found.shift:.4f} m, {found.offset:.4f} m, {found.tilt:.4f} rad")
    -0.6000 m, 2.0000 m, 0.0100 rad
    """
    x, z = (np.asarray(values, dtype=np.float64) for values in (along, height))
    if x.shape != z.shape or x.ndim != 1:
        message = f"along and height must be of one length, got {x.shape} and {z.shape}."
        raise ValueError(message)
    if search is not None and assumed is None:
        message = "search needs assumed, the assumed place of the plate."
        raise ValueError(message)
    good = np.isfinite(x) & np.isfinite(z)
    order = np.argsort(x[good], kind="stable")
    x, z = x[good][order], z[good][order]
    s, h = check_machined_profile(machined)
    shifts = trial_shifts(x, float(s[-1]), assumed, search)
    fixed = search == 0
    forward, backward = (
        best_shift(RegistrationFit(x, z, nodes, shape), shifts, refine=not fixed)
        for nodes, shape in ((s, h), (s[-1] - s[::-1], h[::-1]))
    )
    # noise must not reverse a symmetric plate: the other direction has to be clearly better
    is_reversed = backward[0] < _REVERSED_COST * forward[0] - _MIN_DIFFERENCE
    cost, shift, fit = backward if is_reversed else forward
    if not math.isfinite(cost):
        raise CoverageError("holds too few points where the plate is searched for")
    if not fixed:
        _require_plate(fit, shift, shifts)
    before = math.nan if assumed is None else _rms_before(fit, assumed)
    stretched = 0.0
    if stretch and not fixed:
        fit, shift, stretched = stretched_fit(fit, shift)
    offset, tilt, residual = fit.at(shift)
    scale = robust_scale(residual)
    inside = np.abs(residual) <= OUTLIER_BOUND * scale
    return Registration(
        shift=shift,
        offset=offset,
        tilt=math.atan(tilt),
        reversed=is_reversed,
        residual=float(np.sqrt(np.mean(residual[inside] ** 2))),
        unregistered=before,
        outliers=int((~inside).sum()),
        points=residual.size,
        length=float(s[-1]),
        stretch=stretched,
    )


def registered_points(
    along: Floats, up: Floats, found: Registration, assumed: float | None
) -> xr.Dataset:
    """Measured points on the plate, at its registered and its assumed place.

    They allow the registration to be recomputed.

    Parameters
    ----------
    along, up : numpy.ndarray, shape (n,)
        Measured coordinates and heights [m].
    found : Registration
        Registration of the plate.
    assumed : float, optional
        Assumed start of the plate [m].

    Returns
    -------
    xarray.Dataset
        ``up`` over ascending ``along`` [m].
    """
    begins = [found.shift, found.shift if assumed is None else assumed]
    length = found.length * (1.0 + found.stretch)
    kept = np.flatnonzero((along >= min(begins)) & (along <= max(begins) + length))
    order = kept[np.argsort(along[kept], kind="stable")]
    return xr.Dataset({"up": ("along", up[order])}, {"along": along[order]})


def _require_plate(fit: RegistrationFit, shift: float, shifts: Floats) -> None:
    """Raise if the measured shape is not that of the plate."""
    correlation, gain = _shape_correlation(fit, shift)
    if correlation >= _MIN_CORRELATION and _GAIN[0] <= gain <= _GAIN[1]:
        return
    # heights in another unit give the largest cost at the true place: compare shapes alone
    trials = [_shape_correlation(fit, float(one)) for one in shifts]
    best, gain = max([(correlation, gain), *trials])
    if best >= _MIN_CORRELATION and not _GAIN[0] <= gain <= _GAIN[1]:
        raise SchemaError(
            f"heights are measured as {gain:.3g} times the machined ones: "
            "the profile is in another unit, or that of another plate",
            place="machined profile, height",
            cure="Name the unit in the header, as in `height [mm]`.",
        )
    raise CoverageError(
        f"the plate is not found: the shape that fits best correlates by {correlation:.2f}, "
        f"less than {_MIN_CORRELATION}",
        cure="State its place (assumed), or check that it was scanned: `trueterrain plot`.",
    )


def _shape_correlation(fit: RegistrationFit, shift: float) -> tuple[float, float]:
    """Correlation of the measured with the machined shape, and their regression coefficient."""
    t, z, h = fit.on_plate(shift)
    if t.size < MIN_POINTS or np.ptp(t) < MIN_FRACTION * fit.length:
        return -1.0, 0.0
    plane = np.stack([np.ones_like(t), t], axis=-1)
    # a shape is a profile without its regression line
    shape, measured = (
        values - plane @ np.linalg.lstsq(plane, values, rcond=None)[0] for values in (h, z)
    )
    product, power = float(shape @ measured), float(shape @ shape)
    return product / math.sqrt(max(power * float(measured @ measured), 1e-30)), product / max(
        power, 1e-30
    )


def _rms_before(fit: RegistrationFit, assumed: float) -> float:
    """Root mean square of the residuals with the plate at its assumed place [m]."""
    if not math.isfinite(fit.cost(assumed, math.inf, 1)):
        return math.nan
    residual = fit.at(assumed)[2]
    return float(np.sqrt(np.mean(residual**2)))
