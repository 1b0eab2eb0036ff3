"""Common results of accuracy tests: limits, rows of figures, parts of the error over a plate."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.verify.registration.search import Registration
from trueterrain.verify.statistics.uncertainty import (
    MIN_ERRORS,
    AccuracyFigure,
    mean_figure,
    rms_figure,
)

Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]

_STEEP = 0.5  # [m/m] slope of the machined profile from which a place belongs to an edge


_FIGURES = ("rms", "off_edges", "distance", "maximum", "bias", "noise", "registration")


@dataclass(frozen=True, kw_only=True)
class AccuracyLimits:
    """Upper limits of the figures of a test; by default none."""

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
    "Name of the test."

    rms: AccuracyFigure
    "Root mean square of the error [m]."

    off_edges: AccuracyFigure | None
    "The same away from edges; None if there are no edges, or only edges [m]."

    distance: AccuracyFigure | None
    """Root mean square of the shortest distance from the machined profile, which is insensitive to
    the place of upright faces; None without a plate [m]."""

    maximum: float
    "Greatest error, of either sign [m]."

    bias: AccuracyFigure
    "Mean error [m]."

    noise: float | None
    "Standard deviation of a single height in repeated scans [m]."

    registration: float | None
    "Residual of the registration without outliers [m]."

    count: int
    "Number of compared heights."

    def verdicts(self, limits: AccuracyLimits, *, cautious: bool = False) -> dict[str, bool]:
        """Compare figures with their limits.

        Parameters
        ----------
        limits : AccuracyLimits
            Upper limits.
        cautious : bool
            Compare the upper ends of the intervals, not the figures. Intervals of too few
            independent errors fail every limit.

        Returns
        -------
        dict of bool
            Whether a figure is within its limit, by name, of the figures with a limit.
        """

        def compared_value(figure: AccuracyFigure | None) -> float | None:
            if figure is None:
                return None
            if not cautious:
                return abs(figure.value)
            return max(abs(figure.low), abs(figure.high)) if figure.trusted else None

        found = {
            "rms": compared_value(self.rms),
            "off_edges": compared_value(self.off_edges),
            "distance": compared_value(self.distance),
            "maximum": self.maximum,
            "bias": compared_value(self.bias),
            "noise": self.noise,
            "registration": self.registration,
        }
        return {
            name: value is not None and value <= getattr(limits, name)
            for name, value in found.items()
            if getattr(limits, name) is not None
        }

    def to_dict(self) -> dict[str, Any]:
        """Numbers and strings, ready for JSON; lengths in m."""
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
    """A figure as numbers, ready for JSON."""
    return {
        "value": figure.value,
        "low": figure.low,
        "high": figure.high,
        "confidence": figure.confidence,
        "independent": figure.independent,
        "trusted": figure.trusted,
    }


def result_row(
    test: str,
    error: Floats,
    edge: Bools,
    distance: Floats,
    *,
    noise: float | None,
    registration: Registration,
    confidence: float,
) -> ResultRow:
    """Row of the table, from errors over a plate."""
    plain = error[~edge]
    off_edges = None
    if plain.size >= MIN_ERRORS and plain.size < error.size:
        off_edges = rms_figure(plain, confidence=confidence)
    # the place where a beam meets a face is random: one independent error for each face
    faces = _count_runs(edge)
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
    """Number of contiguous stretches of chosen places."""
    return int(chosen[0]) + int(np.count_nonzero(chosen[1:] & ~chosen[:-1]))


def profile_distances(machined: xr.Dataset, position: Floats, height: Floats) -> Floats:
    """Shortest distances of points from the polyline of a machined profile.

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
    >>> profile_distances(step, np.array([0.499]), np.array([0.02]))
    array([0.001])
    """
    s = machined["s"].values - machined["s"].values[0]
    h = machined["height"].values
    along, up = np.diff(s), np.diff(h)
    square = along**2 + up**2
    found = np.empty(position.size)
    # foot of the perpendicular on each segment, limited to its ends
    for at, (x, z) in enumerate(zip(position, height, strict=True)):
        fraction = np.clip(((x - s[:-1]) * along + (z - h[:-1]) * up) / square, 0.0, 1.0)
        apart = (x - s[:-1] - fraction * along) ** 2 + (z - h[:-1] - fraction * up) ** 2
        found[at] = np.sqrt(apart.min())
    return found


def at_edges(machined: xr.Dataset, position: Floats, reach: float) -> Bools:
    """Whether positions are close to steep faces or to the ends of a machined profile.

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
    # the ends of the plate are faces to the ground
    found |= (position <= s[0] + reach) | (position >= s[-1] - reach)
    return found


def error_parts(error: Floats, noise: Floats, edge: Bools, flagged: Bools) -> dict[str, float]:
    """Split the mean square of errors by cause; the parts add up to it.

    Parameters
    ----------
    error : numpy.ndarray, shape (n,)
        Errors of mean heights [m].
    noise : numpy.ndarray, shape (n,)
        Standard uncertainty of these means from repeated scans [m].
    edge, flagged : numpy.ndarray of bool, shape (n,)
        Heights close to steep faces, and heights of flagged intensity elsewhere.

    Returns
    -------
    dict of float
        Mean squares [m²]: ``edge``, ``reflectivity``, and of the remaining errors ``bias`` (their
        mean), ``noise`` (random error of the means) and ``shape`` (constant in all repeats).

    Examples
    --------
    >>> no = np.zeros(4, bool)
    >>> parts = error_parts(np.array([1.0, 3.0, 1.0, 3.0]), np.zeros(4), no, no)
    >>> parts["bias"], parts["shape"]
    (4.0, 1.0)
    """
    plain = ~edge & ~flagged
    fraction = float(plain.mean())
    mean = float(error[plain].mean()) if fraction else 0.0
    variance = float(error[plain].var()) if fraction else 0.0
    random = min(float(np.mean(noise[plain] ** 2)), variance) if fraction else 0.0
    return {
        "noise": fraction * random,
        "bias": fraction * mean**2,
        "shape": fraction * (variance - random),
        "edge": float(np.sum(error[edge] ** 2)) / error.size,
        "reflectivity": float(np.sum(error[flagged & ~edge] ** 2)) / error.size,
    }
