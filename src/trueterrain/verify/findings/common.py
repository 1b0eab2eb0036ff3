"""Findings of the static and the dynamic test: place of the plate, bright ground, lost scans."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.formats.run import open_run
from trueterrain.georeference import Screening
from trueterrain.motion.scan_gaps import count_missing_scans
from trueterrain.verify.findings.finding import Finding, is_significant
from trueterrain.verify.registration.search import Registration
from trueterrain.verify.statistics.regression import CERTAIN, regress_signatures

Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]

#: Displacement of the plate that a test must be able to observe to exclude it [m].
OBSERVABLE_PLACE = 0.005

#: Smallest displacement of the plate that matters [m]: the accuracy of placing it.
MIN_PLACE = 0.001

_MIN_HEIGHT = 0.0001  # [m] error of bright ground that matters: the resolution of usual ranges
_MAX_LOST = 0.05  # fraction of returns that a scanner in order may lose
_MAX_FLAGGED = 0.01  # fraction of flagged returns of a plate of one brightness
_MIN_PRESENT = 0.5  # fraction of the scans in which a beam that meets the ground returns
_BRIGHT = 1.5  # times the median intensity from which ground is bright
_MIN_PLACES = 8  # places of a mean
_LAGS = 5  # neighbours on a flank whose errors are correlated
_MIN_FLANK_PLACES = 4  # places on slanting flanks from which the shift is observable
_MAX_BEND = 0.2  # change of slope beyond which a place does not lie on one flank
_UPRIGHT = 3.0  # slope beyond which a flank counts as upright


def unknown_finding(name: str, unit: str, why: str) -> Finding:
    """Finding for a fault that is not observable, with the reason."""
    return Finding(name=name, value=None, sd=None, unit=unit, detected=None, meaning=why)


def residual_shift(errors: xr.Dataset, machined: xr.Dataset) -> tuple[float, float]:
    """Residual shift of a registration along the machined profile, and its standard deviation.

    The registration compares cells with the profile at their centres; at upright faces its
    resolution is a part of their width. The errors count against the mean of the profile in each
    cell, so that slanting flanks show the shift that remains.

    Parameters
    ----------
    errors : xarray.Dataset
        ``error`` over ``s`` on the machined profile [m].
    machined : xarray.Dataset
        Machined profile.

    Returns
    -------
    value, sd : float
        Amount by which s is too small: one Gauss-Newton step with free offset and slope [m].
        Without slanting flanks it is 0, with the standard deviation of a uniform distribution
        between two places.
    """
    s, error = errors["s"].values, errors["error"].values
    step = float(np.median(np.diff(np.sort(s))))
    nodes, heights = machined["s"].values - machined["s"].values[0], machined["height"].values
    before, at, after = (np.interp(s + shift, nodes, heights) for shift in (-step, 0.0, step))
    slope = (after - before) / (2 * step)
    plain = (np.abs(after - 2 * at + before) < _MAX_BEND * step) & (np.abs(slope) < _UPRIGHT)
    if (np.abs(slope[plain]) > _MAX_BEND).sum() < _MIN_FLANK_PLACES:
        return 0.0, step / math.sqrt(12)
    level = np.stack([np.ones_like(s), s - s.mean()], axis=-1)
    fit = regress_signatures(slope[plain, None], level[plain], error[plain], lags=_LAGS)
    return float(fit.value[0]), float(fit.sd[0])


def plate_place_finding(
    errors: xr.Dataset,
    machined: xr.Dataset,
    found: Registration,
    assumed: float | None,
    *,
    where: tuple[str, str],
    sd: float = 0.0,
    otherwise: str = "",
) -> Finding:
    """Displacement of the plate from its assumed place.

    Parameters
    ----------
    errors, machined : xarray.Dataset
        Errors over the plate, and its machined profile.
    found : Registration
        Where it lies.
    assumed : float, optional
        Assumed place [m].
    where : tuple of str
        Words for a plate at a larger and at a smaller coordinate than assumed.
    sd : float
        Standard deviation of the measured coordinate itself [m].
    otherwise : str
        Other causes of the same displacement, in words.

    Returns
    -------
    Finding
        Measured less assumed place [m].
    """
    name = "place of the plate"
    if assumed is None:
        return unknown_finding(
            name,
            "m",
            "No place was assumed: measure where the plate begins, and state it (assumed).",
        )
    shift, shift_sd = residual_shift(errors, machined)
    sd = math.hypot(sd, shift_sd)
    displacement = found.shift + (shift if found.reversed else -shift) - assumed
    detected = is_significant(displacement, sd, min_size=MIN_PLACE)
    if detected:
        size = f"{1e3 * abs(displacement):.1f} mm"
        meaning = (
            f"The plate lies {size} {where[displacement < 0]} its assumed place{otherwise}; "
            "registration removes it from the heights."
        )
    elif sd * CERTAIN > OBSERVABLE_PLACE:
        return unknown_finding(
            name,
            "m",
            f"Places along the path have a standard deviation of {1e3 * sd:.0f} mm: use the static "
            "test.",
        )
    else:
        meaning = f"The plate lies where it was assumed, within {1e3 * MIN_PLACE:g} mm."
    return Finding(
        name=name, value=displacement, sd=sd, unit="m", detected=detected, meaning=meaning
    )


def brightness_finding(
    position: Floats, error: Floats, intensity: Floats | None, flagged: Bools | None
) -> Finding:
    """Mean error of bright ground relative to that of the remaining ground.

    Parameters
    ----------
    position, error : numpy.ndarray, shape (n,)
        Places away from edges, and the errors there [m].
    intensity : numpy.ndarray, optional
        Their mean intensities [counts]; None if not recorded.
    flagged : numpy.ndarray of bool, optional
        Places that the settings flag; by default those much brighter than the median.

    Returns
    -------
    Finding
        Mean error of the bright places less that of the others [m].
    """
    name = "error of bright ground"
    if intensity is None or not np.isfinite(intensity).any():
        return unknown_finding(
            name, "m", "The run holds no intensities: record them, to observe bright ground."
        )
    bright = flagged
    if bright is None or not bright.any():
        bright = intensity > _BRIGHT * np.nanmedian(intensity)
    if bright.sum() < _MIN_PLACES or (~bright).sum() < _MIN_PLACES:
        return unknown_finding(
            name,
            "m",
            "Too little of the plate is much brighter or darker than the rest: paint a white "
            "stripe on a cleat.",
        )
    order = np.argsort(position, kind="stable")
    s, values = position[order], error[order]
    level = np.stack([np.ones_like(s), s - s.mean()], axis=-1)
    # errors are correlated over the width of a stripe
    lags = min(int(bright.sum()), s.size // 8)
    fit = regress_signatures(bright[order].astype(np.float64)[:, None], level, values, lags=lags)
    value, sd = float(fit.value[0]), float(fit.sd[0])
    detected = is_significant(value, sd, min_size=_MIN_HEIGHT)
    fraction = 100 * float(bright.mean())
    if detected:
        meaning = (
            f"Bright ground, {fraction:.0f} % of the plate, is {1e3 * abs(value):.2f} mm too "
            f"{'high' if value > 0 else 'low'}: the receiver saturates; screen such returns."
        )
    else:
        meaning = f"Bright ground, {fraction:.0f} % of the plate, has the same error as the rest."
    return Finding(name=name, value=value, sd=sd, unit="m", detected=detected, meaning=meaning)


def intensity_finding(fraction: float | None, screening: Screening) -> Finding:
    """Fraction of returns of flagged intensity; None if intensities were not recorded."""
    name = "flagged intensity"
    if not screening.needs_intensity:
        return unknown_finding(
            name,
            "1",
            "No intensities are flagged by the settings: state the saturation of the receiver "
            "(screening).",
        )
    if fraction is None:
        return unknown_finding(name, "1", "The run holds no intensities: record them.")
    detected = fraction > _MAX_FLAGGED
    meaning = (
        f"{100 * fraction:.1f} % of the returns have an intensity outside of the receiver's range"
        + (": their heights are flagged." if detected else ".")
    )
    return Finding(name=name, value=fraction, sd=None, unit="1", detected=detected, meaning=meaning)


def returned_fraction(
    tree: xr.DataTree, begin: float, end: float, screening: Screening
) -> tuple[float, float | None]:
    """Fractions of lost and of flagged returns between two times.

    Parameters
    ----------
    tree : xarray.DataTree
        The run.
    begin, end : float
        True times [s].
    screening : Screening
        Bounds of range and intensity.

    Returns
    -------
    lost : float
        Fraction of missing returns of the beams that mostly return; NaN without such beams.
    flagged : float or None
        Fraction of returns of flagged intensity; None if intensities were not recorded.
    """
    scans = tree["scans"].to_dataset()
    time = scans["time"].values + open_run(tree).mounting.scanner_clock
    first, last = np.searchsorted(time, (begin, end))
    part = scans.isel(scan=slice(int(first), int(last) + 1))
    there = np.isfinite(part["range"].values)
    there &= (part["range"].values >= screening.nearest) & (
        part["range"].values <= screening.furthest
    )
    beams = there.mean(axis=0) >= _MIN_PRESENT
    if not beams.any():
        return math.nan, None
    lost = 1.0 - float(there[:, beams].mean())
    if "intensity" not in part:
        return lost, None
    flagged = screening.flagged(part["intensity"].values)
    return lost, float(flagged[there].mean())


def lost_scans(time: npt.ArrayLike) -> Finding:
    """Number of missing scans, from gaps in their time stamps."""
    missing = count_missing_scans(time)
    if missing.count:
        meaning = (
            f"{missing.count} scans are missing in {missing.gaps} gaps, the longest from "
            f"{missing.at:.3f} s on for {1e3 * missing.longest:.1f} ms: the recorder is too slow, "
            "or a connection is loose."
        )
    else:
        meaning = "No scan is missing."
    return Finding(
        name="scans lost",
        value=float(missing.count),
        sd=None,
        unit="1",
        detected=missing.count > 0,
        meaning=meaning,
    )


def lost_returns(fraction: float, worst: float | None = None) -> Finding:
    """Fraction of lost returns, and that of the worst beam where it is known."""
    if not math.isfinite(fraction):
        return unknown_finding("returns lost", "1", "No beam mostly returns.")
    detected = fraction > _MAX_LOST
    beam = "" if worst is None else f", of the worst beam {100 * worst:.1f} %"
    cause = ": the ground is too dark, or the window is dirty." if detected else "."
    return Finding(
        name="returns lost",
        value=fraction,
        sd=None,
        unit="1",
        detected=detected,
        meaning=f"{100 * fraction:.2f} % of the returns over the plate were lost{beam}{cause}",
    )


def describe_findings(findings: tuple[Finding, ...]) -> list[dict[str, Any]]:
    """Findings as numbers and strings, ready for JSON."""
    return [one.to_dict() for one in findings]
