"""What the static test looks for besides the size of the error."""

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

Floats = npt.NDArray[np.float64]

_ROLL_SD = math.radians(0.015)  # [rad] of roll by navigation where no other is reported
_LEAST_ROLL = math.radians(0.02)  # [rad] boresight error that matters: 0.7 mm at 2 m to the side


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
    """All that is looked for.

    Parameters
    ----------
    tree : xarray.DataTree
        The run.
    errors, machined : xarray.Dataset
        Errors over the plate, and its machined profile.
    found : Registration
        How scanner and plate lie to each other.
    assumed, level, level_sd
        As the settings say.
    screening : Screening
        Which returns are flagged.
    scans : int
        Scans that were taken.
    returned, flagged : numpy.ndarray, shape (n,)
        Returns of each beam that meets the plate, and how many of them are flagged.

    Returns
    -------
    tuple of Finding
        Place, boresight roll, bright ground, flagged intensity, scans and returns lost.
    """
    plain = ~errors["edge"].values
    intensity = errors["intensity"].values if "intensity" in tree["scans"] else None
    share = None if intensity is None else float(flagged.sum() / max(returned.sum(), 1.0))
    return (
        plate_place_finding(
            errors,
            machined,
            found,
            assumed,
            where=("to the left of", "to the right of"),
            otherwise=", or the scanner sits that much to the other side",
        ),
        boresight_roll(tree, errors, found, level=level, level_sd=level_sd, scans=scans),
        brightness_finding(
            errors["s"].values[plain],
            errors["error"].values[plain],
            None if intensity is None else intensity[plain],
            errors["flagged"].values[plain] if screening.needs_intensity else None,
        ),
        intensity_finding(share, screening),
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
    """Roll of the scanner in the body against what the mounting says.

    A body that leans by r over a plate that slopes by b sees it slope by b - r; a scanner that is
    declared to lean by d too much adds d. What navigation gives as roll while it stands is as wrong
    as its drift, however long it stands: means do not help.

    Parameters
    ----------
    tree : xarray.DataTree
        The run.
    errors : xarray.Dataset
        Errors over the plate.
    found : Registration
        With the slope that was seen.
    level, level_sd : float
        Slope of the plate by a spirit level, and its standard deviation [rad].
    scans : int
        Scans that were taken.

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
            "The slope of the plate is not known: lay a spirit level on it and say so (level).",
        )
    if "navigation" not in tree.children:
        return unknown_finding(
            name, "rad", "The run holds no navigation, which tells how the body leans."
        )
    time = np.asarray(tree["scans/time"])[:scans]
    navigation = tree["navigation"].to_dataset()
    during = (navigation["time"].values >= time[0]) & (navigation["time"].values <= time[-1])
    roll = navigation["roll"].values[during]
    if not np.isfinite(roll).any():
        return unknown_finding(
            name, "rad", "Navigation says nothing while the scanner scans: record both."
        )
    sd_roll = _ROLL_SD
    if "sd_roll" in navigation and np.isfinite(navigation["sd_roll"].values[during]).any():
        sd_roll = float(np.nanmean(navigation["sd_roll"].values[during]))
    value = float(level - np.nanmean(roll) - found.tilt)
    sd = math.sqrt(sd_roll**2 + level_sd**2 + _tilt_sd(errors) ** 2)
    detected = is_significant(value, sd, least=_LEAST_ROLL)
    if detected:
        meaning = (
            f"The mounting says that the scanner leans {math.degrees(abs(value)):.3f} degrees "
            f"{'more' if value < 0 else 'less'} to the right than it does: heights at 2 m to the "
            f"side are off by {2e3 * abs(value):.1f} mm."
        )
    else:
        meaning = "Scanner, navigation and spirit level agree on the slope of the plate."
    return Finding(name=name, value=value, sd=sd, unit="rad", detected=detected, meaning=meaning)


def _tilt_sd(errors: xr.Dataset) -> float:
    """Standard deviation of the slope that was seen, by what is left off edges [rad]."""
    from trueterrain.verify.statistics.regression import regress_signatures

    plain = ~errors["edge"].values
    s, error = errors["s"].values[plain], errors["error"].values[plain]
    if s.size < 3:
        return 0.0
    fit = regress_signatures((s - s.mean())[:, None], np.ones((s.size, 1)), error, lags=s.size // 8)
    return float(fit.sd[0])
