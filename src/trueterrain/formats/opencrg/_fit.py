"""Fit a surface to the rules of OpenCRG: millimetre positions, equal chords, no holes."""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import OutputError
from trueterrain.core.row_blocks import height_blocks
from trueterrain.core.schemas import check_surface, make_surface
from trueterrain.formats.opencrg import _rules
from trueterrain.formats.opencrg._holes import holes_in, patch_surface
from trueterrain.formats.opencrg._payload import HIGHEST

Floats = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]


def fit_to_rules(surface: xr.Dataset, path: Path) -> xr.Dataset:
    """Surface along a reference line that OpenCRG can hold: rounded to 1 mm and without holes.

    Heights are not copied: those that fill holes are inserted when blocks are read.

    Raises
    ------
    OutputError
        Naming the rule that the surface breaks.
    """
    road = _along_easting(surface) if "u" not in surface.dims else check_surface(surface)
    road = road.assign_coords(
        u=road["u"].copy(data=_snapped_stations(np.asarray(road["u"], float), path)),
        v=road["v"].copy(data=_snapped_offsets(np.asarray(road["v"], float), path)),
    )
    _require_chords(road, path)
    _require_curvature(road, path)
    _require_gentle(road, path)
    return patch_surface(road, _require_heights(road, path))


def _along_easting(surface: xr.Dataset) -> xr.Dataset:
    """A map as a road along its easting axis, on the row of nodes nearest to its centre."""
    check_surface(surface)
    easting, northing = (np.asarray(surface[name], float) for name in ("easting", "northing"))
    centre = northing[np.argmin(np.abs(northing - northing.mean()))]
    cells: dict[str, Any] = {
        name: np.asarray(surface[name]).T
        for name in ("count", "sd", "sd_relative", "filled")
        if name in surface
    }
    road = make_surface(
        np.asarray(surface["height"]).T,
        u=easting - easting[0],
        v=northing - centre,
        easting=easting,
        northing=np.full(easting.size, centre),
        **cells,
    )
    return road.assign_attrs({**surface.attrs, "kind": road.attrs["kind"]})


def _snapped_stations(u: Floats, path: Path) -> Floats:
    increment = (u[-1] - u[0]) / (u.size - 1)
    step = round(increment / _rules.MILLIMETRE)
    snapped = (round(u[0] / _rules.MILLIMETRE) + step * np.arange(u.size)) * _rules.MILLIMETRE
    if step < 1 or abs(increment - step * _rules.MILLIMETRE) > _rules.TOLERANCE:
        raise OutputError(
            f"the spacing must be a multiple of 1 mm, got {increment:.6g} m",
            path=path,
            place="axis u",
            cure=f"Grid the surface with a spacing of {max(step, 1)} mm.",
        )
    off = np.flatnonzero(np.abs(u - snapped) > _rules.TOLERANCE)
    if off.size:
        raise OutputError(
            f"must start at and proceed by multiples of 1 mm within 0.1 mm, got {u[off[0]]:.6f} m "
            f"where {snapped[off[0]]:.3f} m is the nearest",
            path=path,
            place=f"axis u, node {off[0]}",
            cure="Grid the surface with equal spacing, from a start that is a multiple of 1 mm.",
        )
    return np.asarray(np.round(snapped, 3))


def _snapped_offsets(v: Floats, path: Path) -> Floats:
    off = np.flatnonzero(_rules.off_grid(v))
    if off.size:
        raise OutputError(
            f"must be a multiple of 1 mm within 0.1 mm, got {v[off[0]]:.6f} m",
            path=path,
            place=f"axis v, node {off[0]}",
            cure="Grid the surface on multiples of 1 mm.",
        )
    snapped = np.round(v, 3)
    twice = np.flatnonzero(np.diff(snapped) <= 0)
    if twice.size:
        raise OutputError(
            f"nodes must be at least 1 mm apart, got {v[twice[0]]:.6f} m and "
            f"{v[twice[0] + 1]:.6f} m",
            path=path,
            place=f"axis v, node {twice[0]}",
            cure="Grid the surface with a spacing of 1 mm or more.",
        )
    hidden = np.flatnonzero(_rules.overlooked_sections(snapped))
    if hidden.size:
        width = snapped[-1] - snapped[0]
        raise OutputError(
            f"nodes must be equally spaced or at least {width / _rules.LOOKED_UP:.3g} m apart (the "
            f"width divided by {_rules.LOOKED_UP}), else programs with the ASAM C library find "
            f"wrong heights between them, got {snapped[hidden[0] - 1]:.3f} m and "
            f"{snapped[hidden[0]]:.3f} m",
            path=path,
            place=f"axis v, node {hidden[0]}",
            cure="Grid the surface with equal spacing across.",
        )
    return np.asarray(snapped)


def _require_chords(road: xr.Dataset, path: Path) -> None:
    easting, northing, u = (np.asarray(road[name], float) for name in ("easting", "northing", "u"))
    chords = np.hypot(np.diff(easting), np.diff(northing))
    wrong = np.flatnonzero(np.abs(chords - np.diff(u)) > _rules.TOLERANCE)
    if wrong.size:
        at = int(wrong[0])
        raise OutputError(
            f"all chords must be as long as the spacing of u ({u[1] - u[0]:.3f} m) within 0.1 mm, "
            f"got {chords[at]:.6f} m",
            path=path,
            place=f"reference line, nodes {at} and {at + 1}",
            cure="Resample the reference line with chords of equal length.",
        )


def _require_curvature(road: xr.Dataset, path: Path) -> None:
    u, v = (np.asarray(road[name], float) for name in ("u", "v"))
    kappa = _rules.line_curvature(
        np.asarray(road["easting"]), np.asarray(road["northing"]), float(u[1] - u[0])
    )
    sharp = np.flatnonzero(_rules.beyond_centre(kappa, v))
    if sharp.size:
        at = int(sharp[np.argmax(np.abs(kappa[sharp]))])
        raise OutputError(
            f"its radius must be greater than the road is wide to its inner side ({v[0]:g} m to "
            f"{v[-1]:g} m), got {1 / abs(kappa[at]):.3g} m",
            path=path,
            place=f"reference line, u = {u[at + 1]:.3f} m",
            cure="Smooth the reference line, or make the grid narrower.",
        )


def _require_gentle(road: xr.Dataset, path: Path) -> None:
    slope = np.diff(np.asarray(road["elevation"])) / np.diff(np.asarray(road["u"]))
    for name, values in (("slope", slope), ("banking", np.asarray(road.get("banking", 0.0)))):
        if np.abs(values).max() > _rules.STEEPEST:
            at = int(np.argmax(np.abs(values)))
            raise OutputError(
                f"the {name} must be at most {_rules.STEEPEST:g} m/m, got "
                f"{values.flat[at]:.3g} m/m",
                path=path,
                place=f"reference line, node {at}",
                cure="Put steep parts into the heights of the grid, not into the reference line.",
            )


def _require_heights(road: xr.Dataset, path: Path) -> Index:
    """Flat indices of the holes within cross-sections; raises if heights cannot be written."""
    empty: list[int] = []
    holes: list[Index] = []
    for rows, block in height_blocks(road):
        if not max(block.max(), -block.min()) <= HIGHEST:
            _require_possible(block, rows.start, path)
            empty += [rows.start + int(k) for k in np.flatnonzero(np.isnan(block).all(axis=1))]
        holes.append(rows.start * block.shape[1] + holes_in(block))
    if empty:
        raise OutputError(
            f"each cross-section must have a height, but {len(empty)} have none, the first at "
            f"u = {float(road['u'][empty[0]]):.3f} m",
            path=path,
            place=f"height, cross-section {empty[0]}",
            cure="Cut the surface there, or fill the gap along the road.",
        )
    return np.concatenate(holes)


def _require_possible(block: Floats, first: int, path: Path) -> None:
    wild = np.argwhere(np.abs(block) > HIGHEST)
    if wild.size:
        i, j = wild[0]
        raise OutputError(
            f"must be at most {HIGHEST:g} m in size, got {block[i, j]:g} m",
            path=path,
            place=f"height, node ({first + i}, {j})",
            cure="Remove heights that are not ground.",
        )
