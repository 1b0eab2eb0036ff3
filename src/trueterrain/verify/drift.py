"""Drift test: how heights wander over a kilometre and more, in runs that repeat each other.

What all runs share is bias, what differs from run to run is repeatability (thesis 3.6). Both are
told apart by distance: over how many metres do errors grow, and how much (Fig. 2-2).
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

_FEWEST = 2  # runs
_LEAST = 32  # places
_PER_DECADE = 8  # distances of the structure function
_LONGEST = 0.5  # of the length, over which pairs of places are still many


@dataclass(frozen=True, kw_only=True)
class DriftSettings:
    """How a drift test is evaluated."""

    spacing: float = 1.0
    "Distance of the places that are compared [m]."

    min_length: float = 1000.0
    "Shortest common length of which the test is a test [m]."

    confidence: float = 0.95
    "Share of repeats of the test in which the intervals hold the truth."

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
    """How heights wander in repeated runs."""

    errors: xr.Dataset
    """Over distance s [m]: ``error`` (run, s) of each run against the reference, or, without one,
    against the mean of all; ``mean`` over the runs and ``spread`` between them [m]."""

    growth: xr.Dataset
    """Over ``distance`` [m]: ``structure``, the root mean square by which errors of places so far
    apart differ; ``allan``, the Allan deviation of means over so much; ``repeats``, the structure
    function of what differs from run to run [m]."""

    row: ResultRow
    "Row of the table; its noise is the repeatability of a single run."

    repeatability: AccuracyFigure
    "Standard deviation of a single run about what all share [m]."

    shared: AccuracyFigure | None
    """Root mean square of what all runs share, less what so many runs leave by chance; None without
    a reference, of which alone it can be known [m]."""

    runs: int
    "Runs that were compared."

    def to_dict(self) -> dict[str, Any]:
        """The same as plain numbers and words, as for JSON, without the single errors."""
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
        Profiles along one path, a run each, of one track; their s counts from the same place.
    reference : xarray.Dataset, optional
        True heights along the path.
    settings : DriftSettings
        How the test is evaluated.

    Returns
    -------
    DriftResult
        Errors against distance and what they are made of.

    Raises
    ------
    CoverageError
        If there are fewer than two runs, or they share too short a stretch.
    ValueError
        If a profile has several tracks.

    Notes
    -----
    Heights are interpolated at places of equal distance. With e the errors of n runs, their spread
    about the mean at a place gives the repeatability, with n - 1 in its denominator. The mean holds
    the repeatability over n besides the bias, which is taken off its mean square. Without a
    reference the mean of the runs stands for it: errors are then too small by sqrt((n - 1) / n),
    and are enlarged by as much.

    Intervals come from blocks of places, drawn together for all runs. Drift that is as long as the
    path leaves few of them: then the interval is wide, or no interval tells.

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
    if len(profiles) < _FEWEST:
        raise CoverageError(
            f"the drift test needs at least {_FEWEST} runs, got {len(profiles)}",
            cure="Repeat the run over the same path.",
        )
    s = _common_places([*profiles, *([] if reference is None else [reference])], settings)
    heights = np.stack([_heights_at(profile, s) for profile in profiles])
    n = len(profiles)
    shared = heights.mean(axis=0)
    apart = (heights - shared) * math.sqrt(n / (n - 1))
    error = apart if reference is None else heights - _heights_at(reference, s)
    mean = error.mean(axis=0)
    repeatability = rms_figure(apart, confidence=settings.confidence)
    bias = None
    if reference is not None:
        bias = _shared_error(mean, repeatability, n, settings.confidence)
    dataset = xr.Dataset(
        {
            "error": (("run", "s"), error),
            "mean": ("s", mean),
            "spread": ("s", np.sqrt((apart**2).mean(axis=0))),
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
        growth=_error_growth(error, apart, settings.spacing),
        row=row,
        repeatability=repeatability,
        shared=bias,
        runs=n,
    )


def _common_places(profiles: list[xr.Dataset], settings: DriftSettings) -> Floats:
    """Places that all profiles reach."""
    for profile in profiles:
        if "track" in profile.dims:
            message = "profiles must have one track each, got several: choose one."
            raise ValueError(message)
    low = max(float(profile["s"][0]) for profile in profiles)
    high = min(float(profile["s"][-1]) for profile in profiles)
    if high - low < settings.min_length:
        raise CoverageError(
            f"runs share {max(high - low, 0.0):.1f} m, the drift test needs "
            f"{settings.min_length:g} m",
            cure="Drive further, or ask for less: min_length.",
        )
    count = math.floor((high - low) / settings.spacing * (1 + 1e-12)) + 1
    if count < _LEAST:
        raise CoverageError(
            f"{count} places are too few", cure=f"Choose a spacing that gives at least {_LEAST}."
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
    """What all runs share, without what chance leaves in their mean."""
    found = rms_figure(mean, confidence=confidence)
    chance = repeatability.value**2 / runs

    def without(value: float) -> float:
        return math.sqrt(max(value**2 - chance, 0.0))

    return AccuracyFigure(
        value=without(found.value),
        low=without(found.low),
        high=without(found.high),
        confidence=confidence,
        block=found.block,
        independent=found.independent,
    )


def _error_growth(error: Floats, apart: Floats, spacing: float) -> xr.Dataset:
    n = error.shape[1]
    most = max(1, int(_LONGEST * (n - 1)))
    count = max(2, math.ceil(_PER_DECADE * math.log10(most)))
    lags = np.unique(np.rint(np.geomspace(1, most, count)).astype(int))
    sums = np.concatenate([np.zeros((error.shape[0], 1)), np.cumsum(error, axis=1)], axis=1)
    columns: dict[str, list[float]] = {"structure": [], "allan": [], "repeats": []}
    for lag in lags:
        for name, values in (("structure", error), ("repeats", apart)):
            columns[name].append(math.sqrt(np.mean((values[:, lag:] - values[:, :-lag]) ** 2)))
        means = (sums[:, lag:] - sums[:, :-lag]) / lag
        steps = means[:, lag:] - means[:, :-lag]
        columns["allan"].append(math.sqrt(0.5 * np.mean(steps**2)))
    return xr.Dataset(
        {name: ("distance", values) for name, values in columns.items()},
        {"distance": spacing * lags},
    )
