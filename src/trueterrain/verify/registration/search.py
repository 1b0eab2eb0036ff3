"""Registration: where a measured profile lies on a machined one, before errors are counted.

Offset, tilt and shift along the profile say how scanner and plate stood to each other. Charged to
the heights they would look like errors of the profiler: most of all the shift, at every edge.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import CoverageError, SchemaError
from trueterrain.verify.registration.cost import (
    CUT,
    LEAST_POINTS,
    NARROW,
    RegistrationFit,
    best_shift,
    scale_of,
    stretched_fit,
    trial_shifts,
)

Floats = npt.NDArray[np.float64]

_GAIN = (0.7, 1.4)  # between which the measured shape is that of the plate, in its height
_SHAPE = 0.7  # correlation with the machined shape from which a plate is found
_LENGTH, _HEIGHT = (0.05, 20.0), (0.001, 1.0)  # [m] that plates may span
_CLEARLY = 0.9  # of the cost of the one direction that the other must stay below
_SAME = 1e-10  # [m2] by which costs differ at least


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
    >>> from trueterrain.core.schemas import make_profile
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
    shifts = trial_shifts(x, float(s[-1]), assumed, search)
    as_it_lies = search == 0
    ahead, against = (
        best_shift(RegistrationFit(x, z, nodes, shape), shifts, refine=not as_it_lies)
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
        fit, shift, stretched = stretched_fit(fit, shift)
    offset, tilt, residual = fit.at(shift)
    scale = scale_of(residual)
    inside = np.abs(residual) <= CUT * scale
    return Registration(
        shift=shift,
        offset=offset,
        tilt=math.atan(tilt),
        reversed=turned,
        residual=float(np.sqrt(np.mean(residual[inside] ** 2))),
        unregistered=before,
        outliers=int((~inside).sum()),
        points=residual.size,
        length=float(s[-1]),
        stretch=stretched,
    )


def _require_plate(fit: RegistrationFit, shift: float, shifts: Floats) -> None:
    """Raise unless the measured shape is that of the plate."""
    likeness, gain = _shape_correlation(fit, shift)
    if likeness >= _SHAPE and _GAIN[0] <= gain <= _GAIN[1]:
        return
    # where heights are in another unit, the plate fits worst where it lies: look at shapes alone
    alike = [_shape_correlation(fit, float(one)) for one in shifts]
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


def _shape_correlation(fit: RegistrationFit, shift: float) -> tuple[float, float]:
    """Correlation of the measured shape with the machined one, and how much higher it is."""
    t, z, h = fit.on_plate(shift)
    if t.size < LEAST_POINTS or np.ptp(t) < NARROW * fit.length:
        return -1.0, 0.0
    plane = np.stack([np.ones_like(t), t], axis=-1)
    shape, seen = (
        values - plane @ np.linalg.lstsq(plane, values, rcond=None)[0] for values in (h, z)
    )
    product, power = float(shape @ seen), float(shape @ shape)
    return product / math.sqrt(max(power * float(seen @ seen), 1e-30)), product / max(power, 1e-30)


def _rms_before(fit: RegistrationFit, assumed: float) -> float:
    """Root mean square of residuals with the plate where it was assumed."""
    if not math.isfinite(fit.cost(assumed, math.inf, 1)):
        return math.nan
    residual = fit.at(assumed)[2]
    return float(np.sqrt(np.mean(residual**2)))
