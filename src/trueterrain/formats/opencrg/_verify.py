"""Whether a file that was written holds what it should, for two independent readers."""

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pycrg
import xarray as xr

from trueterrain.errors import OutputError
from trueterrain.formats.opencrg import _rules
from trueterrain.formats.opencrg._read import load_surface

Floats = npt.NDArray[np.float64]

_SAME = 1e-9  # [m] positions along and across
_ROUND_OFF = 1e-9  # [m] of heights of up to some km in double precision
# rounding of a number in each format, relative to its size
_ROUNDING = {"KRBI": 1.2e-7, "KDBI": 1e-15, "LRFI": 1e-6, "LDFI": 1e-15}
_C_API_ROUNDING = 1.2e-7  # the C-API holds heights as float32
_MOST_CELLS = 200_000  # so that checking takes less time than writing


def read_back(road: xr.Dataset, path: Path, fmt: str, base: Floats) -> xr.Dataset:
    """Surface as it stands in the file, if that is what it should be.

    Parameters
    ----------
    road : xarray.Dataset
        What should have been written.
    path : Path
        The file.
    fmt : str
        Format of the numbers.
    base : ndarray
        Part of the heights that the reference line holds [m]; only the rest is rounded.

    Raises
    ------
    OutputError
        If positions, heights or the values between the nodes differ.
    """
    written = load_surface(path)
    largest = float(np.nanmax(np.abs(np.asarray(road["height"]) - base)))
    _compare_positions(road, written, path)
    _compare_heights(road, written, path, _ROUND_OFF + _ROUNDING[fmt] * largest)
    _compare_evaluation(written, path, _ROUND_OFF + 2 * _C_API_ROUNDING * largest)
    return written


def _compare_positions(road: xr.Dataset, written: xr.Dataset, path: Path) -> None:
    for axis in ("u", "v"):
        if road.sizes[axis] != written.sizes[axis]:
            raise _difference(f"{written.sizes[axis]} of {road.sizes[axis]} nodes", axis, path)
        off = float(np.abs(road[axis].values - written[axis].values).max())
        if off > _SAME:
            raise _difference(f"differences of {off:.3g} m", axis, path)
    moved = np.hypot(
        road["easting"].values - written["easting"].values,
        road["northing"].values - written["northing"].values,
    )
    if moved.max() > _rules.TOLERANCE:
        raise OutputError(
            f"nodes would move by up to {moved.max() * 1e3:.3g} mm, since the file holds rounded "
            "headings and chords of exactly equal length",
            path=path,
            place=f"reference line, node {int(np.argmax(moved))}",
            cure="Resample the reference line with chords of equal length, or write fmt='KDBI'.",
        )


def _compare_heights(road: xr.Dataset, written: xr.Dataset, path: Path, tolerance: float) -> None:
    should, found = road["height"].values, written["height"].values
    if (np.isnan(should) != np.isnan(found)).any():
        raise _difference("heights where there should be none, or none where they should be",
                          "height", path)  # fmt: skip
    off = float(np.nanmax(np.abs(should - found)))
    if off > tolerance:
        raise _difference(f"differences of {off:.3g} m", "height", path)


def _compare_evaluation(written: xr.Dataset, path: Path, tolerance: float) -> None:
    """Heights in the middle of cells on both sides of the reference line, by the C-API."""
    u, v, height = (np.asarray(written[name]) for name in ("u", "v", "height"))
    cells = (u.size - 1) * (v.size - 1)
    chosen = np.unique(np.linspace(0, cells - 1, min(cells, _MOST_CELLS)).astype(int))
    i, j = np.divmod(chosen, v.size - 1)
    should = (height[i, j] + height[i + 1, j] + height[i, j + 1] + height[i + 1, j + 1]) / 4
    with pycrg.RoadSurface.open(path, apply_modifiers=False) as road:
        found = road.uv_to_z_many((u[i] + u[i + 1]) / 2, (v[j] + v[j + 1]) / 2)
        ranges = np.array([road.u_range(), road.v_range()])
        modifiers = road.header.modifiers
    if np.abs(ranges - [u[[0, -1]], v[[0, -1]]]).max() > _SAME:
        raise _difference(f"the ranges {ranges.tolist()}", "u and v", path)
    if modifiers != {}:
        raise _difference(f"the modifiers {modifiers}", "modifiers", path)
    differ = np.isnan(should) != np.isnan(found)
    differ |= np.abs(should - found) > tolerance
    if differ.any():
        at = int(np.flatnonzero(differ)[0])
        raise _difference(
            f"{found[at]!r} m, not {should[at]!r} m", f"cell ({i[at]}, {j[at]})", path
        )


def _difference(found: str, place: str, path: Path) -> OutputError:
    return OutputError(
        f"what was written does not read back the same: {found}",
        path=path,
        place=place,
        cure="Nothing is left of the file; please report this.",
    )
