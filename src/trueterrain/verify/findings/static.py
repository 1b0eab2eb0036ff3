"""Findings of the static test: place of the plate, boresight roll, bright ground, lost returns."""

import math

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.georeference import Screening
from trueterrain.verify.findings.common import (
    brightness_finding,
    intensity_finding,
    lost_returns,
    lost_scans,
    plate_place_finding,
    unknown_finding,
)
from trueterrain.verify.findings.finding import Finding, is_significant
from trueterrain.verify.registration.search import Registration
from trueterrain.verify.statistics.regression import regress_signatures

Floats = npt.NDArray[np.float64]

_ROLL_SD = math.radians(0.015)  # [rad] of roll by navigation if it reports none
_MIN_ROLL = math.radians(0.02)  # [rad] boresight error that matters: 0.7 mm at an offset of 2 m


def static_findings(
    tree: xr.DataTree,
    errors: xr.Dataset,
    machined: xr.Dataset,
    found: Registration,
    *,
    assumed: float | None,
    level: float | None,
    level_sd: float,
    screening: Screening,
    scans: int,
    returned: Floats,
    flagged: Floats,
) -> tuple[Finding, ...]:
    """Findings of a static test.

    Parameters
    ----------
    tree : xarray.DataTree
        The run.
    errors, machined : xarray.Dataset
        Errors over the plate, and its machined profile.
    found : Registration
        Relative position of scanner and plate.
    assumed, level, level_sd
        See `StaticSettings`.
    screening : Screening
        Bounds of range and intensity.
    scans : int
        Number of scans.
    returned, flagged : numpy.ndarray, shape (n,)
        Numbers of returns and of flagged returns of each beam that meets the plate.

    Returns
    -------
    tuple of Finding
        Place of the plate, boresight roll, bright ground, flagged intensity, lost scans and lost
        returns.
    """
    plain = ~errors["edge"].values
    intensity = errors["intensity"].values if "intensity" in tree["scans"] else None
    fraction = None if intensity is None else float(flagged.sum() / max(returned.sum(), 1.0))
    return (
        plate_place_finding(
            errors,
            machined,
            found,
            assumed,
            where=("to the left of", "to the right of"),
            otherwise=", or the scanner lies as far to the other side",
        ),
        boresight_roll(tree, errors, found, level=level, level_sd=level_sd, scans=scans),
        brightness_finding(
            errors["s"].values[plain],
            errors["error"].values[plain],
            None if intensity is None else intensity[plain],
            errors["flagged"].values[plain] if screening.needs_intensity else None,
        ),
        intensity_finding(fraction, screening),
        lost_scans(np.asarray(tree["scans/time"])[:scans]),
        lost_returns(1.0 - float(returned.mean()) / scans, 1.0 - float(returned.min()) / scans),
    )


def boresight_roll(
    tree: xr.DataTree,
    errors: xr.Dataset,
    found: Registration,
    *,
    level: float | None,
    level_sd: float,
    scans: int,
) -> Finding:
    """Boresight roll: true roll of the scanner in the body less that of the mounting.

    With roll r of the body, slope b of the plate and an error d of the declared boresight roll, the
    measured slope is b - r + d. The roll of a vehicle at rest has the full drift of navigation as
    its error; averaging over time does not reduce it.

    Parameters
    ----------
    tree : xarray.DataTree
        The run.
    errors : xarray.Dataset
        Errors over the plate.
    found : Registration
        With the measured slope.
    level, level_sd : float
        Slope of the plate by a spirit level, and its standard deviation [rad].
    scans : int
        Number of scans.

    Returns
    -------
    Finding
        True less declared roll, to be added to what the mounting says [rad].
    """
    name = "boresight roll"
    if level is None:
        return unknown_finding(
            name,
            "rad",
            "The slope of the plate is not known: measure it by spirit level and state it (level).",
        )
    if "navigation" not in tree.children:
        return unknown_finding(
            name, "rad", "The run holds no navigation, so that the roll of the body is not known."
        )
    time = np.asarray(tree["scans/time"])[:scans]
    navigation = tree["navigation"].to_dataset()
    during = (navigation["time"].values >= time[0]) & (navigation["time"].values <= time[-1])
    roll = navigation["roll"].values[during]
    if not np.isfinite(roll).any():
        return unknown_finding(
            name, "rad", "Navigation has no records during the scans: record both."
        )
    sd_roll = _ROLL_SD
    if "sd_roll" in navigation and np.isfinite(navigation["sd_roll"].values[during]).any():
        sd_roll = float(np.nanmean(navigation["sd_roll"].values[during]))
    value = float(level - np.nanmean(roll) - found.tilt)
    sd = math.sqrt(sd_roll**2 + level_sd**2 + _tilt_sd(errors) ** 2)
    detected = is_significant(value, sd, min_size=_MIN_ROLL)
    if detected:
        meaning = (
            f"The mounting states a roll of the scanner that is {math.degrees(abs(value)):.3f} "
            f"degrees too {'large' if value < 0 else 'small'}: heights at an offset of 2 m are "
            f"wrong by {2e3 * abs(value):.1f} mm."
        )
    else:
        meaning = "Scanner, navigation and spirit level agree on the slope of the plate."
    return Finding(name=name, value=value, sd=sd, unit="rad", detected=detected, meaning=meaning)


def _tilt_sd(errors: xr.Dataset) -> float:
    """Standard deviation of the measured slope, from the residuals off edges [rad]."""
    plain = ~errors["edge"].values
    s, error = errors["s"].values[plain], errors["error"].values[plain]
    if s.size < 3:
        return 0.0
    fit = regress_signatures((s - s.mean())[:, None], np.ones((s.size, 1)), error, lags=s.size // 8)
    return float(fit.sd[0])
