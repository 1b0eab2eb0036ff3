"""Difference of two surfaces: map, statistics, structure function."""

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import CoverageError, SchemaError
from trueterrain.core.provenance import add_step
from trueterrain.core.schemas import check_surface, make_surface
from trueterrain.core.statistics import nmad
from trueterrain.geometry.crs import parse_crs
from trueterrain.geometry.grid_frame import EDGE, grid_frame
from trueterrain.surface.evaluate import heights_at

Floats = npt.NDArray[np.float64]

_ROWS = 512  # cross-sections that are compared at once
_FEET = 1 / 0.3048
_NEAR = 0.02  # relative tolerance of a ratio of heights against that of feet to metres
_MIN_HEIGHT = 10.0  # [m] median height above which such a ratio is no coincidence


@dataclass(frozen=True, kw_only=True)
class HeightDifferences:
    """Statistics of differences of height.

    Examples
    --------
    >>> found = HeightDifferences.of([0.001, 0.002, 0.003, np.nan])
    >>> print(found.n, f"{1000 * found.rms:.3f} mm")
    3 2.160 mm
    """

    n: int
    "Number of nodes with a difference."

    mean: float
    "Mean [m]."

    median: float
    "Median [m]."

    rms: float
    "Root mean square [m]."

    nmad: float
    "1.4826 times the median absolute deviation from the median [m]."

    p95: float
    "Magnitude that 95 % do not exceed [m]."

    largest: float
    "Largest magnitude [m]."

    @classmethod
    def of(cls, differences: npt.ArrayLike) -> "HeightDifferences":
        """Compute the statistics.

        Parameters
        ----------
        differences : array_like
            Differences [m]; those that are not finite do not count.

        Returns
        -------
        HeightDifferences
            All NaN if there are none.
        """
        d = np.ravel(np.asarray(differences, dtype=float))
        d = d[np.isfinite(d)]
        if not d.size:
            nan = math.nan
            return cls(n=0, mean=nan, median=nan, rms=nan, nmad=nan, p95=nan, largest=nan)
        median, size = float(np.median(d)), np.abs(d)
        return cls(
            n=d.size,
            mean=float(d.mean()),
            median=median,
            rms=float(np.sqrt(np.mean(d**2))),
            nmad=nmad(d),
            p95=float(np.percentile(size, 95)),
            largest=float(size.max()),
        )


def surface_difference(
    surface: xr.Dataset,
    reference: xr.Dataset,
    *,
    level: Literal["none", "median", "plane"] = "none",
) -> xr.Dataset:
    """Height of a surface above a reference, at the nodes of the reference.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface along a reference line, or map; bilinear between its nodes.
    reference : xarray.Dataset
        Surface along a reference line, or map, in the same coordinate reference system.
    level : {"none", "median", "plane"}
        What is removed from the difference: nothing, its median, or the least-squares plane.

    Returns
    -------
    xarray.Dataset
        Surface over the nodes of the reference whose ``height`` is the difference [m], NaN where
        one of the two has none; elevation and banking are 0.

    Raises
    ------
    ValueError
        If `level` is unknown.
    SchemaError
        If one is no Surface, or their coordinate reference systems differ.
    CoverageError
        If no node has a height in both.

    Warns
    -----
    UserWarning
        If only one of them has a coordinate reference system, or the heights of one look like
        feet.

    Examples
    --------
    >>> axes = {"easting": [0.0, 1.0, 2.0], "northing": [0.0, 1.0]}
    >>> ground = make_surface(np.zeros((2, 3)), **axes)
    >>> surface_difference(make_surface(np.full((2, 3), 0.002), **axes), ground).height.values
    array([[0.002, 0.002, 0.002], [0.002, 0.002, 0.002]])
    """
    if level not in ("none", "median", "plane"):
        message = f"level must be none, median or plane, got {level!r}"
        raise ValueError(message)
    check_surface(surface)
    check_surface(reference)
    _require_same_crs(surface, reference)
    difference = _at_nodes(surface, reference)
    known = np.isfinite(difference)
    if not known.any():
        raise CoverageError(
            "have no node with a height in common: "
            f"{_extent_text(surface)}, and {_extent_text(reference)}",
            place="surface and reference",
            cure="Check their coordinates, or choose a reference of the same place.",
        )
    _question_feet(reference, difference)
    if level == "median":
        difference -= np.median(difference[known])
    elif level == "plane":
        difference -= _fit_plane(difference, known)
    data = _as_surface(difference, reference)
    return add_step(data, "surface_difference", parameters={"level": level}, after=surface)


def difference_statistics(
    differences: xr.Dataset | Sequence[xr.Dataset],
    *,
    across: tuple[float, float] | None = None,
) -> HeightDifferences:
    """Statistics of one difference, or of several together, over all or over one lane.

    Parameters
    ----------
    differences : xarray.Dataset or sequence of xarray.Dataset
        Of `surface_difference`; several are pooled, e.g. those of one speed.
    across : tuple of float, optional
        Right and left edge of a traffic lane [m]: only nodes with an offset v between them count.
        A node on the left edge belongs to the next lane, if there are nodes beyond.

    Returns
    -------
    HeightDifferences
        Statistics [m].

    Raises
    ------
    ValueError
        If the edges do not ascend.
    SchemaError
        If a lane is asked for on a map, which has none.

    Examples
    --------
    >>> road = make_surface([[0.001, 0.003]] * 2, u=[0, 1], v=[-1, 1], easting=[0, 1],
    ...                     northing=[0, 0])
    >>> difference_statistics(road, across=(-2.0, 0.0)).mean
    0.001
    """
    several = [differences] if isinstance(differences, xr.Dataset) else list(differences)
    if across is None:
        return HeightDifferences.of(
            np.concatenate([one["height"].values.ravel() for one in several])
        )
    right, left = across
    if not right < left:
        message = f"across must be a right edge and one left of it, got {right:g} and {left:g} m"
        raise ValueError(message)
    parts = []
    for one in several:
        if "v" not in one.dims:
            raise SchemaError(
                "is a map, which has no lanes",
                place="reference",
                cure="Compare with a surface along a reference line, or leave the lanes out.",
            )
        v = one["v"].values
        inside = (v >= right - EDGE) & ((v < left - EDGE) | (v[-1] <= left + EDGE))
        parts.append(one["height"].values[:, inside].ravel())
    return HeightDifferences.of(np.concatenate(parts))


def structure_function(
    difference: xr.Dataset,
    *,
    axis: Literal["along", "across"] = "along",
    per_decade: int = 12,
) -> xr.Dataset:
    """Structure function of a difference: mean squared change over a distance.

    It separates noise, which is the same at all distances, from drift, which grows with distance.

    Parameters
    ----------
    difference : xarray.Dataset
        Of `surface_difference`.
    axis : {"along", "across"}
        Direction: along or across the reference line; on a map, along easting or northing.
    per_decade : int
        Distances per factor of ten, from the spacing to half the extent.

    Returns
    -------
    xarray.Dataset
        ``structure`` (distance) [m²]: mean of (d(x + distance) - d(x))²; ``pairs``, number of
        pairs. Distances without a pair are left out.

    Raises
    ------
    ValueError
        If `axis` is unknown, or `per_decade` is less than 1.
    SchemaError
        If the nodes are not equally spaced along the axis.

    Notes
    -----
    Independent errors of standard deviation σ give 2 σ² at every distance; a trend d(x) = g x gives
    g² distance²; a wave of amplitude a and length λ gives a² (1 - cos(2 π distance / λ)).

    Examples
    --------
    >>> ramp = make_surface(np.outer(np.ones(3), 0.001 * np.arange(8)),
    ...                     easting=np.arange(8), northing=np.arange(3))
    >>> found = structure_function(ramp)
    >>> print((1e6 * found.structure.values).round(3))  # [mm²]
    [ 1.  4.  9. 16.]
    """
    if axis not in ("along", "across"):
        message = f"axis must be along or across, got {axis!r}"
        raise ValueError(message)
    if per_decade < 1:
        message = f"per_decade must be at least 1, got {per_decade}"
        raise ValueError(message)
    dims = ("u", "v") if "u" in difference.dims else ("easting", "northing")
    dim = dims[0 if axis == "along" else 1]
    height = difference["height"].transpose(..., dim).values
    step = _node_spacing(difference[dim].values, dim)
    max_lag = max(1, height.shape[1] // 2)
    decades = math.log10(max_lag)
    lags = np.unique(np.rint(np.logspace(0, decades, int(per_decade * decades) + 2)).astype(int))
    total, pairs = np.zeros(lags.size), np.zeros(lags.size, dtype=np.int64)
    for start in range(0, height.shape[0], _ROWS):
        rows = np.ascontiguousarray(height[start : start + _ROWS])
        for at, lag in enumerate(lags):
            change = rows[:, lag:] - rows[:, :-lag]
            known = np.isfinite(change)
            pairs[at] += np.count_nonzero(known)
            total[at] += np.sum(change**2, where=known)
    kept = pairs > 0
    return xr.Dataset(
        {
            "structure": ("distance", total[kept] / pairs[kept], {"units": "m2"}),
            "pairs": ("distance", pairs[kept]),
        },
        {"distance": ("distance", lags[kept] * step, {"units": "m"})},
        {"axis": axis},
    )


def _require_same_crs(surface: xr.Dataset, reference: xr.Dataset) -> None:
    names = [str(one.attrs.get("crs", "")) for one in (surface, reference)]
    if names[0] == names[1]:
        return
    if not all(names):
        known, unknown = ("the surface", "the reference")[:: 1 if names[0] else -1]
        message = (
            f"only {known} has a coordinate reference system; {unknown} is assumed to be in the "
            "same one"
        )
        warnings.warn(message, stacklevel=3)
        return
    mine, theirs = (parse_crs(name) for name in names)
    if not mine.equals(theirs, ignore_axis_order=True):
        raise SchemaError(
            f"is in {mine.name}, but the reference in {theirs.name}",
            place="coordinate reference system",
            cure="Bring both into one system first.",
        )


def _at_nodes(surface: xr.Dataset, reference: xr.Dataset) -> Floats:
    """Difference at the nodes of the reference, computed in blocks of cross-sections."""
    if _same_nodes(surface, reference):
        heights = (np.asarray(one["height"], dtype=np.float64) for one in (surface, reference))
        return np.subtract(*heights)
    frame = grid_frame(reference)
    along = "u" in reference.dims
    height = np.asarray(reference["height"], dtype=np.float64)
    height = height if along else height.T
    difference = np.empty_like(height)
    for start in range(0, height.shape[0], _ROWS):
        rows = slice(start, start + _ROWS)
        difference[rows] = heights_at(surface, *frame.nodes(rows)) - height[rows]
    return difference if along else difference.T


def _same_nodes(surface: xr.Dataset, reference: xr.Dataset) -> bool:
    if surface["height"].dims != reference["height"].dims:
        return False
    names = ("easting", "northing", *(name for name in ("u", "v") if name in reference.dims))
    return all(np.array_equal(surface[name], reference[name]) for name in names)


def _fit_plane(difference: Floats, known: npt.NDArray[np.bool_]) -> Floats:
    """Least-squares plane over the axes of the grid."""
    axes = [np.linspace(-1.0, 1.0, size) for size in difference.shape]
    first, second = np.meshgrid(*axes, indexing="ij")
    columns = np.stack([np.ones_like(first), first, second])
    inside = columns[:, known]
    solved = np.linalg.lstsq(inside @ inside.T, inside @ difference[known], rcond=None)[0]
    return np.asarray(np.tensordot(solved, columns, 1))


def _as_surface(difference: Floats, reference: xr.Dataset) -> xr.Dataset:
    crs = str(reference.attrs.get("crs", ""))
    place = {name: reference[name].values for name in ("easting", "northing")}
    if "u" in reference.dims:
        place |= {name: reference[name].values for name in ("u", "v", "heading")}
    return make_surface(difference, crs=crs, **place)


def _question_feet(reference: xr.Dataset, difference: Floats) -> None:
    """Warn if one of two heights above a datum is that of the other in feet."""
    known = np.isfinite(difference)
    low = float(np.median(np.asarray(reference["height"])[known]))
    high = low + float(np.median(difference[known]))
    if min(abs(low), abs(high)) < _MIN_HEIGHT or low * high <= 0:
        return
    ratio = high / low
    if abs(max(ratio, 1 / ratio) / _FEET - 1) < _NEAR:
        which = "surface" if ratio > 1 else "reference"
        message = f"heights of {high:.1f} and {low:.1f} m: are those of the {which} in feet?"
        warnings.warn(message, stacklevel=3)


def _extent_text(surface: xr.Dataset) -> str:
    ends = [
        f"{axis} {float(surface[axis].min()):.1f} to {float(surface[axis].max()):.1f} m"
        for axis in ("easting", "northing")
    ]
    return ", ".join(ends)


def _node_spacing(nodes: Floats, dim: str) -> float:
    steps = np.diff(nodes)
    step = float(nodes[-1] - nodes[0]) / steps.size
    if np.abs(steps - step).max() > 0.01 * step:
        raise SchemaError(
            f"must be equally spaced, got spacings from {steps.min():g} to {steps.max():g} m",
            place=f"axis {dim}",
        )
    return step


@dataclass(frozen=True, kw_only=True)
class DifferenceSummary:
    """Statistics of differences of height between two passes."""

    n: int
    "Number of differences."

    median: float
    "Their median [m]."

    nmad: float
    "Normalised median absolute deviation: ``1.4826 median(|x - median(x)|)`` [m]."

    rmse: float
    "Their root mean square [m]."

    p95: float
    "95 % quantile of their absolute values [m]."

    @classmethod
    def of(cls, differences: npt.ArrayLike) -> "DifferenceSummary":
        """Statistics of differences.

        Parameters
        ----------
        differences : array_like
            Differences [m]; values that are not finite are ignored.

        Returns
        -------
        DifferenceSummary
            All NaN if there is no difference.

        Examples
        --------
        >>> DifferenceSummary.of([0.001, 0.003, 0.002, float("nan")])
        DifferenceSummary(n=3, median=0.002, nmad=0.0014826, rmse=0.0021602, p95=0.0029)
        """
        found = HeightDifferences.of(differences)
        return cls(n=found.n, median=found.median, nmad=found.nmad, rmse=found.rms, p95=found.p95)
