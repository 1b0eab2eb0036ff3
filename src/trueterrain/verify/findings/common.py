"""What both tests look for: the place of the plate, bright ground, and what the scanner lost."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.georeference import Screening
from trueterrain.motion.scan_gaps import count_missing_scans
from trueterrain.verify.findings.finding import CERTAIN, Finding, is_significant
from trueterrain.verify.registration.search import Registration
from trueterrain.verify.statistics.regression import regress_signatures

Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]

#: Displacement of the plate that a test must be able to see, to tell that it is not there [m].
SEEN_PLACE = 0.005

#: Least displacement of the plate that matters [m]: nobody lays one down more truly.
LEAST_PLACE = 0.001

_LEAST_HEIGHT = 0.0001  # [m] error of bright ground that matters: the step of usual ranges
_LEAST_LOST = 0.05  # share of returns that a healthy scanner may lose
_LEAST_FLAGFUL = 0.01  # share of flagged returns that a plate of one brightness may have
_MOSTLY = 0.5  # share of the scans in which beams return that meet the ground at all
_BRIGHT = 1.5  # times the usual intensity from which ground is bright
_FEWEST = 8  # places of which a mean is taken
_LAGS = 5  # neighbours on a flank whose errors are alike
_FEWEST_FLANK = 4  # places on slanting flanks that tell where a plate lies
_BENT = 0.2  # change of slope from which a place is not that of one flank
_UPRIGHT = 3.0  # slope beyond which a flank counts as upright


def unknown_finding(name: str, unit: str, why: str) -> Finding:
    """Finding of a check that cannot be made."""
    return Finding(name=name, value=None, sd=None, unit=unit, detected=None, meaning=why)


def left_over(errors: xr.Dataset, machined: xr.Dataset) -> tuple[float, float]:
    """Shift that is left in errors along the machined profile, and its standard deviation.

    The registration compares cells with the profile at their middles, and so is not surer than a
    part of their width where faces are upright. Errors are those against the mean of the profile in
    each cell: slanting flanks tell what was left.

    Parameters
    ----------
    errors : xarray.Dataset
        ``error`` over ``s`` on the machined profile [m].
    machined : xarray.Dataset
        Machined profile.

    Returns
    -------
    value, sd : float
        By how much s is too small, of a step of Gauss and Newton with offset and slope left free
        [m]. Without slanting flanks nothing is left to tell: 0, with the standard deviation of
        what lies anywhere between two places.
    """
    s, error = errors["s"].values, errors["error"].values
    apart = float(np.median(np.diff(np.sort(s))))
    nodes, heights = machined["s"].values - machined["s"].values[0], machined["height"].values
    before, at, after = (np.interp(s + step, nodes, heights) for step in (-apart, 0.0, apart))
    slope = (after - before) / (2 * apart)
    plain = (np.abs(after - 2 * at + before) < _BENT * apart) & (np.abs(slope) < _UPRIGHT)
    if (np.abs(slope[plain]) > _BENT).sum() < _FEWEST_FLANK:
        return 0.0, apart / math.sqrt(12)
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
    """Where the plate lies against where it was assumed.

    Parameters
    ----------
    errors, machined : xarray.Dataset
        Errors over the plate, and its machined profile.
    found : Registration
        Where it lies.
    assumed : float, optional
        Where it was assumed to lie [m].
    where : tuple of str
        Words for a plate that lies further along the measured coordinate, and less far.
    sd : float
        Standard deviation of the measured coordinate itself [m].
    otherwise : str
        What else looks the same, in words.

    Returns
    -------
    Finding
        Found less assumed place [m].
    """
    name = "place of the plate"
    if assumed is None:
        return unknown_finding(
            name, "m", "No place was assumed: measure where the plate begins, and say so (assumed)."
        )
    left, by_flanks = left_over(errors, machined)
    sd = math.hypot(sd, by_flanks)
    beside = found.shift + (left if found.reversed else -left) - assumed
    detected = is_significant(beside, sd, least=LEAST_PLACE)
    if detected:
        meaning = (
            f"The plate lies {1e3 * abs(beside):.1f} mm {where[beside < 0]} its assumed place"
            f"{otherwise}; this was registered first and is not charged to the heights."
        )
    elif sd * CERTAIN > SEEN_PLACE:
        return unknown_finding(
            name,
            "m",
            f"Places along the way are sure to {1e3 * sd:.0f} mm only: the static test tells.",
        )
    else:
        meaning = f"The plate lies where it was assumed, within {1e3 * LEAST_PLACE:g} mm."
    return Finding(name=name, value=beside, sd=sd, unit="m", detected=detected, meaning=meaning)


def brightness_finding(
    position: Floats, error: Floats, intensity: Floats | None, flagged: Bools | None
) -> Finding:
    """Error of bright ground against that of the rest.

    Parameters
    ----------
    position, error : numpy.ndarray, shape (n,)
        Places away from edges, and the errors there [m].
    intensity : numpy.ndarray, optional
        Their mean intensities [counts]; None where none were recorded.
    flagged : numpy.ndarray of bool, optional
        Which are flagged by the settings; by default the brightest by far are.

    Returns
    -------
    Finding
        Mean error of the bright places less that of the others [m].
    """
    name = "error of bright ground"
    if intensity is None or not np.isfinite(intensity).any():
        return unknown_finding(
            name, "m", "The run holds no intensities: record them, to see what bright ground does."
        )
    bright = flagged
    if bright is None or not bright.any():
        bright = intensity > _BRIGHT * np.nanmedian(intensity)
    if bright.sum() < _FEWEST or (~bright).sum() < _FEWEST:
        return unknown_finding(
            name,
            "m",
            "Too little of the plate is much brighter or darker than the rest: a stripe of white "
            "paint on a cleat would tell.",
        )
    order = np.argsort(position, kind="stable")
    s, values = position[order], error[order]
    level = np.stack([np.ones_like(s), s - s.mean()], axis=-1)
    # as many neighbours are alike as a stripe has
    lags = min(int(bright.sum()), s.size // 8)
    fit = regress_signatures(bright[order].astype(np.float64)[:, None], level, values, lags=lags)
    value, sd = float(fit.value[0]), float(fit.sd[0])
    detected = is_significant(value, sd, least=_LEAST_HEIGHT)
    share = 100 * float(bright.mean())
    if detected:
        meaning = (
            f"Bright ground, {share:.0f} % of the plate, is seen {1e3 * abs(value):.2f} mm too "
            f"{'high' if value > 0 else 'low'}: the receiver saturates; screen such returns."
        )
    else:
        meaning = f"Bright ground, {share:.0f} % of the plate, is measured as truly as the rest."
    return Finding(name=name, value=value, sd=sd, unit="m", detected=detected, meaning=meaning)


def intensity_finding(share: float | None, screening: Screening) -> Finding:
    """Share of returns whose intensity is flagged; None where none were recorded."""
    name = "flagged intensity"
    if not screening.needs_intensity:
        return unknown_finding(
            name,
            "1",
            "Nothing was said of which intensities are flagged: give the saturation of the "
            "receiver (screening).",
        )
    if share is None:
        return unknown_finding(name, "1", "The run holds no intensities: record them.")
    detected = share > _LEAST_FLAGFUL
    meaning = (
        f"{100 * share:.1f} % of the returns are brighter or darker than the receiver likes"
        + (": their heights are flagged." if detected else ".")
    )
    return Finding(name=name, value=share, sd=None, unit="1", detected=detected, meaning=meaning)


def returned_fraction(
    tree: xr.DataTree, begin: float, end: float, screening: Screening
) -> tuple[float, float | None]:
    """What came back from a scanner between two times.

    Parameters
    ----------
    tree : xarray.DataTree
        The run.
    begin, end : float
        True times [s].
    screening : Screening
        Which returns are flagged.

    Returns
    -------
    lost : float
        Share of the returns that are missing, of beams that mostly return; NaN without any.
    flagged : float or None
        Share of the returns whose intensity is flagged; None where none were recorded.
    """
    from trueterrain.georeference import mounting_of

    scans = tree["scans"].to_dataset()
    time = scans["time"].values + mounting_of(tree).scanner_clock
    first, last = np.searchsorted(time, (begin, end))
    part = scans.isel(scan=slice(int(first), int(last) + 1))
    there = np.isfinite(part["range"].values)
    there &= (part["range"].values >= screening.nearest) & (
        part["range"].values <= screening.furthest
    )
    beams = there.mean(axis=0) >= _MOSTLY
    if not beams.any():
        return math.nan, None
    lost = 1.0 - float(there[:, beams].mean())
    if "intensity" not in part:
        return lost, None
    flagged = screening.flagged(part["intensity"].values)
    return lost, float(flagged[there].mean())


def lost_scans(time: npt.ArrayLike) -> Finding:
    """How many scans are missing, by their stamps."""
    missing = count_missing_scans(time)
    if missing.count:
        meaning = (
            f"{missing.count} scans are missing in {missing.gaps} gaps, the longest from "
            f"{missing.at:.3f} s on for {1e3 * missing.longest:.1f} ms: the recorder is too slow, "
            "or a cable is loose."
        )
    else:
        meaning = "No scan is missing among the others."
    return Finding(
        name="scans lost",
        value=float(missing.count),
        sd=None,
        unit="1",
        detected=missing.count > 0,
        meaning=meaning,
    )


def lost_returns(share: float, worst: float | None = None) -> Finding:
    """Share of beams that did not return, and that of the worst beam where it is known."""
    if not math.isfinite(share):
        return unknown_finding("returns lost", "1", "No beam was looked at.")
    detected = share > _LEAST_LOST
    beam = "" if worst is None else f", of the worst beam {100 * worst:.1f} %"
    cause = ": the ground is too dark, or the glass is dirty." if detected else "."
    return Finding(
        name="returns lost",
        value=share,
        sd=None,
        unit="1",
        detected=detected,
        meaning=f"{100 * share:.2f} % of the returns over the plate were lost{beam}{cause}",
    )


def describe_findings(findings: tuple[Finding, ...]) -> list[dict[str, Any]]:
    """Findings as plain numbers and words."""
    return [one.to_dict() for one in findings]
