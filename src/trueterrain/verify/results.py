"""What the tests of accuracy share: limits, figures and parts of the error over a plate."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.verify.registration.search import Registration
from trueterrain.verify.statistics.uncertainty import LEAST, AccuracyFigure, mean_figure, rms_figure

Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]

_STEEP = 0.5  # slope [m/m] of the machined profile from which heights depend on the place


_FIGURES = ("rms", "off_edges", "distance", "maximum", "bias", "noise", "registration")


@dataclass(frozen=True, kw_only=True)
class TestLimits:
    """What the figures of a test may be at most; none unless given."""

    rms: float | None = None
    "Greatest root mean square of the error [m]."

    off_edges: float | None = None
    "Greatest root mean square of the error away from edges [m]."

    distance: float | None = None
    "Greatest root mean square of the shortest distance from the machined profile [m]."

    maximum: float | None = None
    "Greatest error [m]."

    bias: float | None = None
    "Greatest mean error, of either sign [m]."

    noise: float | None = None
    "Greatest standard deviation of repeats [m]."

    registration: float | None = None
    "Greatest residual of the registration [m]."

    def __post_init__(self) -> None:
        """Check the values."""
        for name in _FIGURES:
            value = getattr(self, name)
            if value is not None and not 0 < value < math.inf:
                message = f"{name} must be greater than 0 m, got {value}."
                raise ValueError(message)


@dataclass(frozen=True, kw_only=True)
class ResultRow:
    """A row of the table of results (Table 3-1 of Smith 2009)."""

    test: str
    "What was tested."

    rms: AccuracyFigure
    "Root mean square of the error [m]."

    off_edges: AccuracyFigure | None
    "The same away from edges; None where there are none, or nothing else [m]."

    distance: AccuracyFigure | None
    """Root mean square of the shortest distance from the machined profile, which is small at
    upright faces; None without a plate [m]."""

    maximum: float
    "Greatest error, of either sign [m]."

    bias: AccuracyFigure
    "Mean error [m]."

    noise: float | None
    "Standard deviation of a single height in repeats [m]."

    registration: float | None
    "Residual of the registration without outliers [m]."

    count: int
    "Heights that were compared."

    def verdicts(self, limits: TestLimits, *, cautious: bool = False) -> dict[str, bool]:
        """Whether figures keep their limits.

        Parameters
        ----------
        limits : Limits
            What they may be at most.
        cautious : bool
            Ask the upper ends of the intervals to keep the limits, not the figures. Intervals of
            too few independent errors keep none.

        Returns
        -------
        dict of bool
            By name of the figure, of those with a limit.
        """

        def judged(figure: AccuracyFigure | None) -> float | None:
            if figure is None:
                return None
            if not cautious:
                return abs(figure.value)
            return max(abs(figure.low), abs(figure.high)) if figure.trusted else None

        found = {
            "rms": judged(self.rms),
            "off_edges": judged(self.off_edges),
            "distance": judged(self.distance),
            "maximum": self.maximum,
            "bias": judged(self.bias),
            "noise": self.noise,
            "registration": self.registration,
        }
        return {
            name: value is not None and value <= getattr(limits, name)
            for name, value in found.items()
            if getattr(limits, name) is not None
        }

    def to_dict(self) -> dict[str, Any]:
        """The same as plain numbers and words, as for JSON; lengths in m."""
        return {
            "test": self.test,
            "rms": describe_figure(self.rms),
            "off_edges": self.off_edges and describe_figure(self.off_edges),
            "distance": self.distance and describe_figure(self.distance),
            "maximum": self.maximum,
            "bias": describe_figure(self.bias),
            "noise": self.noise,
            "registration": self.registration,
            "count": self.count,
        }


def describe_figure(figure: AccuracyFigure) -> dict[str, float | bool]:
    """A figure as plain numbers."""
    return {
        "value": figure.value,
        "low": figure.low,
        "high": figure.high,
        "confidence": figure.confidence,
        "independent": figure.independent,
        "trusted": figure.trusted,
    }


def row_of(
    test: str,
    error: Floats,
    edge: Bools,
    distance: Floats,
    *,
    noise: float | None,
    registration: Registration,
    confidence: float,
) -> ResultRow:
    """Row of the table from errors over a plate."""
    plain = error[~edge]
    off_edges = None
    if plain.size >= LEAST and plain.size < error.size:
        off_edges = rms_figure(plain, confidence=confidence)
    faces = _count_runs(edge)  # where a beam meets a face is chance, once for each
    most = faces if faces else math.inf
    return ResultRow(
        test=test,
        rms=rms_figure(error, confidence=confidence, most=most),
        off_edges=off_edges,
        distance=rms_figure(distance, confidence=confidence, most=most),
        maximum=float(np.abs(error).max()),
        bias=mean_figure(error, confidence=confidence, most=most),
        noise=noise,
        registration=registration.residual,
        count=error.size,
    )


def _count_runs(chosen: Bools) -> int:
    """How many unbroken stretches of places are chosen."""
    return int(chosen[0]) + int(np.count_nonzero(chosen[1:] & ~chosen[:-1]))


def profile_distances(machined: xr.Dataset, position: Floats, height: Floats) -> Floats:
    """Shortest distances of points from the line of a machined profile.

    Parameters
    ----------
    machined : xarray.Dataset
        Machined profile.
    position, height : numpy.ndarray, shape (n,)
        Places on it and heights [m].

    Returns
    -------
    numpy.ndarray, shape (n,)
        Distances [m].

    Examples
    --------
    >>> from trueterrain.core.schemas import make_profile
    >>> step = make_profile([0.0, 0.5, 0.500001, 1.0], [0.0, 0.0, 0.04, 0.04])
    >>> distances(step, np.array([0.499]), np.array([0.02]))
    array([0.001])
    """
    s = machined["s"].values - machined["s"].values[0]
    h = machined["height"].values
    along, up = np.diff(s), np.diff(h)
    square = along**2 + up**2
    found = np.empty(position.size)
    for at, (x, z) in enumerate(zip(position, height, strict=True)):
        share = np.clip(((x - s[:-1]) * along + (z - h[:-1]) * up) / square, 0.0, 1.0)
        apart = (x - s[:-1] - share * along) ** 2 + (z - h[:-1] - share * up) ** 2
        found[at] = np.sqrt(apart.min())
    return found


def at_edges(machined: xr.Dataset, position: Floats, reach: float) -> Bools:
    """Whether positions are within reach of where the machined profile is steep.

    Parameters
    ----------
    machined : xarray.Dataset
        Machined profile.
    position : numpy.ndarray
        Positions on it [m].
    reach : float
        Greatest distance [m].

    Returns
    -------
    numpy.ndarray of bool
        One for each position.
    """
    s = machined["s"].values - machined["s"].values[0]
    h = machined["height"].values
    steep = np.flatnonzero(np.abs(np.diff(h)) > _STEEP * np.diff(s))
    found = np.zeros(position.shape, bool)
    for piece in steep:
        found |= (position >= s[piece] - reach) & (position <= s[piece + 1] + reach)
    found |= (position <= s[0] + reach) | (position >= s[-1] - reach)  # where the ground begins
    return found


def parts_of(error: Floats, noise: Floats, edge: Bools, flagged: Bools) -> dict[str, float]:
    """Split the mean square of errors into causes, which add up to it.

    Parameters
    ----------
    error : numpy.ndarray, shape (n,)
        Errors of mean heights [m].
    noise : numpy.ndarray, shape (n,)
        Standard uncertainty of these means by repeats [m].
    edge, flagged : numpy.ndarray of bool, shape (n,)
        Heights beside steep faces, and those of flagged intensity elsewhere.

    Returns
    -------
    dict of float
        Mean squares [m²]: ``edge``, ``reflectivity``, and of the rest ``bias`` (its mean),
        ``noise`` (what repeats average to) and ``shape`` (what stays the same in all repeats).

    Examples
    --------
    >>> no = np.zeros(4, bool)
    >>> parts = parts_of(np.array([1.0, 3.0, 1.0, 3.0]), np.zeros(4), no, no)
    >>> parts["bias"], parts["shape"]
    (4.0, 1.0)
    """
    plain = ~edge & ~flagged
    share = float(plain.mean())
    mean = float(error[plain].mean()) if share else 0.0
    spread = float(error[plain].var()) if share else 0.0
    random = min(float(np.mean(noise[plain] ** 2)), spread) if share else 0.0
    return {
        "noise": share * random,
        "bias": share * mean**2,
        "shape": share * (spread - random),
        "edge": float(np.sum(error[edge] ** 2)) / error.size,
        "reflectivity": float(np.sum(error[flagged & ~edge] ** 2)) / error.size,
    }
