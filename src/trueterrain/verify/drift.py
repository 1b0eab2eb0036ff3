"""Drift test: growth of height errors with distance in repeated runs over one path (thesis 3.6).

The error common to all runs is the bias, the differences between runs the repeatability. Both are
given as functions of distance by structure functions (Fig. 2-2).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import CoverageError
from trueterrain.verify.results import ResultRow, describe_figure
from trueterrain.verify.statistics.uncertainty import AccuracyFigure, mean_figure, rms_figure

Floats = npt.NDArray[np.float64]

_MIN_RUNS = 2
_MIN_PLACES = 32
_PER_DECADE = 8  # distances of the structure function
_MAX_LAG = 0.5  # fraction of the length up to which there are enough pairs of places


@dataclass(frozen=True, kw_only=True)
class DriftSettings:
    """Settings of a drift test."""

    spacing: float = 1.0
    "Distance between the places that are compared [m]."

    min_length: float = 1000.0
    "Smallest length common to all profiles [m]."

    confidence: float = 0.95
    "Fraction of repeats of the test in which the intervals hold the true value."

    def __post_init__(self) -> None:
        """Check the values."""
        for name in ("spacing", "min_length"):
            if not 0 < getattr(self, name) < math.inf:
                message = f"{name} must be greater than 0 m, got {getattr(self, name)}."
                raise ValueError(message)
        if not 0 < self.confidence < 1:
            message = f"confidence must be between 0 and 1, got {self.confidence}."
            raise ValueError(message)


@dataclass(frozen=True, kw_only=True, eq=False)
class DriftResult:
    """Result of a drift test."""

    errors: xr.Dataset
    """Over distance s [m]: ``error`` (run, s) of each run relative to the reference or, without
    one, to the mean of all runs; ``mean`` over the runs and ``spread``, their standard deviation
    [m]."""

    growth: xr.Dataset
    """Over ``distance`` [m]: ``structure``, the root mean square difference of errors at that
    distance; ``allan``, the Allan deviation of means over it; ``repeats``, the structure function
    of the differences between runs [m]."""

    row: ResultRow
    "Row of the table; its noise is the repeatability of a single run."

    repeatability: AccuracyFigure
    "Standard deviation of a single run about the mean of all runs [m]."

    shared: AccuracyFigure | None
    """Root mean square of the error common to all runs, without the random error of their mean;
    None without a reference [m]."""

    runs: int
    "Number of runs."

    def to_dict(self) -> dict[str, Any]:
        """Numbers and strings, ready for JSON, without the single errors."""
        return {
            **self.row.to_dict(),
            "runs": self.runs,
            "length": float(np.ptp(self.errors["s"].values)),
            "repeatability": describe_figure(self.repeatability),
            "shared": self.shared and describe_figure(self.shared),
            "growth": {
                name: self.growth[name].values.tolist()
                for name in ("distance", "structure", "allan", "repeats")
            },
        }


def drift_test(
    profiles: Sequence[xr.Dataset],
    reference: xr.Dataset | None = None,
    settings: DriftSettings = DriftSettings(),
) -> DriftResult:
    """Compare profiles of repeated runs with a reference, or with each other.

    Parameters
    ----------
    profiles : sequence of xarray.Dataset
        Profiles of one track along one path, one for each run; s counts from the same place.
    reference : xarray.Dataset, optional
        True heights along the path.
    settings : DriftSettings
        Spacing, length and confidence.

    Returns
    -------
    DriftResult
        Errors over distance, split into bias and repeatability.

    Raises
    ------
    CoverageError
        If there are fewer than two runs, or their common length is too short.
    ValueError
        If a profile has several tracks.

    Notes
    -----
    Heights are interpolated at equally spaced places. The variance of n runs about their mean at a
    place, with n - 1 in its denominator, gives the repeatability. The mean square of the mean of
    the runs holds the squared repeatability over n besides the squared bias; it is subtracted.
    Without a reference, errors count from the mean of the runs: they are too small by
    sqrt((n - 1) / n) and are enlarged accordingly.

    Intervals come from a bootstrap of blocks of places, common to all runs. Drift with a
    correlation length of the order of the path leaves few independent blocks: the interval is wide.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_profile
    >>> s = np.arange(0, 2001.0)
    >>> drift = [1e-3 * np.random.default_rng(k).normal(size=s.size).cumsum() for k in (1, 2)]
    >>> flat = make_profile(s, 0 * s)
    >>> found = drift_test([make_profile(s, error) for error in drift], flat)
    >>> ten = found.growth.structure.sel(distance=10, method="nearest")
    >>> print(f"{1e3 * float(ten):.1f} mm over 10 m")
    3.2 mm over 10 m
    """
    if len(profiles) < _MIN_RUNS:
        raise CoverageError(
            f"the drift test needs at least {_MIN_RUNS} runs, got {len(profiles)}",
            cure="Repeat the run over the same path.",
        )
    s = _common_places([*profiles, *([] if reference is None else [reference])], settings)
    heights = np.stack([_heights_at(profile, s) for profile in profiles])
    n = len(profiles)
    mean_height = heights.mean(axis=0)
    deviation = (heights - mean_height) * math.sqrt(n / (n - 1))
    error = deviation if reference is None else heights - _heights_at(reference, s)
    mean = error.mean(axis=0)
    repeatability = rms_figure(deviation, confidence=settings.confidence)
    bias = None
    if reference is not None:
        bias = _shared_error(mean, repeatability, n, settings.confidence)
    dataset = xr.Dataset(
        {
            "error": (("run", "s"), error),
            "mean": ("s", mean),
            "spread": ("s", np.sqrt((deviation**2).mean(axis=0))),
        },
        {"s": s, "run": np.arange(n)},
    )
    row = ResultRow(
        test="drift",
        rms=rms_figure(error, confidence=settings.confidence),
        off_edges=None,
        distance=None,
        maximum=float(np.abs(error).max()),
        bias=mean_figure(error, confidence=settings.confidence),
        noise=repeatability.value,
        registration=None,
        count=error.size,
    )
    return DriftResult(
        errors=dataset,
        growth=_error_growth(error, deviation, settings.spacing),
        row=row,
        repeatability=repeatability,
        shared=bias,
        runs=n,
    )


def _common_places(profiles: list[xr.Dataset], settings: DriftSettings) -> Floats:
    """Equally spaced places within the length common to all profiles [m]."""
    for profile in profiles:
        if "track" in profile.dims:
            message = "profiles must have one track each, got several: choose one."
            raise ValueError(message)
    low = max(float(profile["s"][0]) for profile in profiles)
    high = min(float(profile["s"][-1]) for profile in profiles)
    if high - low < settings.min_length:
        raise CoverageError(
            f"runs have {max(high - low, 0.0):.1f} m in common, the drift test needs "
            f"{settings.min_length:g} m",
            cure="Record longer runs, or reduce min_length.",
        )
    count = math.floor((high - low) / settings.spacing * (1 + 1e-12)) + 1
    if count < _MIN_PLACES:
        raise CoverageError(
            f"{count} places are too few",
            cure=f"Choose a spacing that gives at least {_MIN_PLACES}.",
        )
    places: Floats = low + settings.spacing * np.arange(count, dtype=np.float64)
    return places


def _heights_at(profile: xr.Dataset, s: Floats) -> Floats:
    height = profile["height"].values
    known = np.isfinite(height)
    if not known.all():
        place = float(profile["s"].values[~known][0])
        raise CoverageError(
            "there is no height", place=f"s = {place:g} m", cure="Fill or cut the gap first."
        )
    return np.asarray(np.interp(s, profile["s"].values, height))


def _shared_error(
    mean: Floats, repeatability: AccuracyFigure, runs: int, confidence: float
) -> AccuracyFigure:
    """Error common to all runs: the figure of their mean without its random error."""
    found = rms_figure(mean, confidence=confidence)
    variance_of_mean = repeatability.value**2 / runs

    def corrected(value: float) -> float:
        return math.sqrt(max(value**2 - variance_of_mean, 0.0))

    return AccuracyFigure(
        value=corrected(found.value),
        low=corrected(found.low),
        high=corrected(found.high),
        confidence=confidence,
        block=found.block,
        independent=found.independent,
    )


def _error_growth(error: Floats, deviation: Floats, spacing: float) -> xr.Dataset:
    """Structure functions and Allan deviation of errors, shape (run, s) [m]."""
    n = error.shape[1]
    max_lag = max(1, int(_MAX_LAG * (n - 1)))
    count = max(2, math.ceil(_PER_DECADE * math.log10(max_lag)))
    lags = np.unique(np.rint(np.geomspace(1, max_lag, count)).astype(int))
    sums = np.concatenate([np.zeros((error.shape[0], 1)), np.cumsum(error, axis=1)], axis=1)
    columns: dict[str, list[float]] = {"structure": [], "allan": [], "repeats": []}
    for lag in lags:
        for name, values in (("structure", error), ("repeats", deviation)):
            columns[name].append(math.sqrt(np.mean((values[:, lag:] - values[:, :-lag]) ** 2)))
        # Allan variance: half the mean square difference of adjacent means (Allan 1966)
        means = (sums[:, lag:] - sums[:, :-lag]) / lag
        steps = means[:, lag:] - means[:, :-lag]
        columns["allan"].append(math.sqrt(0.5 * np.mean(steps**2)))
    return xr.Dataset(
        {name: ("distance", values) for name, values in columns.items()},
        {"distance": spacing * lags},
    )
