"""Rules of OpenCRG beyond its syntax, as checked by its MATLAB library.

All positions are multiples of 1 mm; heights are missing only at the left and right edge; slope and
banking are at most 1; no centre of curvature of the reference line lies on the road.
"""

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.row_blocks import height_blocks
from trueterrain.formats.opencrg._header import CrgHeader

Floats = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

MILLIMETRE = 1e-3  # [m] unit of all positions
TOLERANCE = 1e-4  # [m] tolerance of positions and of the lengths of chords
STEEPEST = 1.0  # [m/m] largest slope and banking
LOOKED_UP = 199  # [steps] across the road, in the table by which the C-API finds long sections
_AT_STEP = 1e-6  # [steps] tolerance of a long section at the end of a step


def line_curvature(easting: Floats, northing: Floats, increment: float) -> Floats:
    """Curvature of the reference line at its inner nodes [1/m], left turns positive."""
    # sine of the angle between two chords of equal length, over that length
    x, y = np.diff(easting), np.diff(northing)
    return np.asarray((x[:-1] * y[1:] - y[:-1] * x[1:]) / increment**3)


def beyond_centre(kappa: Floats, v: Floats) -> Mask:
    """Inner nodes where the road reaches its centre of curvature, and so overlaps itself."""
    return np.asarray(np.maximum(kappa * v[0], kappa * v[-1]) >= 1)


def interior_holes(height: Floats) -> Mask:
    """Nodes without height between nodes of their cross-section that have one."""
    valid = np.isfinite(height)
    from_right = np.logical_or.accumulate(valid, axis=1)
    from_left = np.logical_or.accumulate(valid[:, ::-1], axis=1)[:, ::-1]
    return np.asarray(from_right & from_left & ~valid)


def off_grid(positions: Floats) -> Mask:
    """Positions that are not multiples of 1 mm."""
    return np.asarray(np.abs(positions - np.round(positions / MILLIMETRE) * MILLIMETRE) > TOLERANCE)


def is_even(v: Floats) -> bool:
    """Whether long sections are equally spaced, by the criterion of pycrg."""
    even = np.linspace(v[0], v[-1], v.size)
    return bool(np.abs(v - even).max() <= 1e-9 * max(1.0, v[-1] - v[0]))


def overlooked_sections(v: Floats) -> Mask:
    """Long sections that the C-API overlooks, so that it interpolates wrong heights next to them.

    The C-API finds sections with unequal spacing by a table of 199 equal steps across the road; of
    several sections within one step it overlooks the last.
    """
    if is_even(v):
        return np.zeros(v.size, dtype=bool)
    step = np.ceil((v[:-1] - v[0]) / (v[-1] - v[0]) * LOOKED_UP - _AT_STEP)
    same_step = np.concatenate([[False], np.diff(step) == 0, [False]])
    return np.asarray(same_step & ~np.roll(same_step, -1))


def check_rules(header: CrgHeader, surface: xr.Dataset, kappa: Floats) -> list[str]:
    """Problems of a surface for other programs: broken rules, and lines they read differently."""
    return [
        *_modifier_flags(header),
        *_position_flags(header, surface),
        *_height_flags(surface),
        *_line_flags(header, surface, kappa),
    ]


def _modifier_flags(header: CrgHeader) -> list[str]:
    if header.modifiers is None:
        return [
            "there is no section $ROAD_CRG_MODS: programs that apply the default modifiers move "
            "the start of the road to the origin; here it stays where it is stored"
        ]
    if header.modifiers:
        names = ", ".join(header.modifiers)
        return [f"the file has modifiers that are not applied here: {names}"]
    return []


def _position_flags(header: CrgHeader, surface: xr.Dataset) -> list[str]:
    found = []
    v = np.asarray(surface["v"])
    for name, values in (
        ("start of u", np.array([header.start])),
        ("increment of u", np.array([header.increment])),
        ("v", v),
    ):
        wrong = values[off_grid(values)]
        if wrong.size:
            found.append(f"{name} must be a multiple of 1 mm, got {wrong[0]:g} m")
    hidden = v[overlooked_sections(v)]
    if hidden.size:
        found.append(
            f"the distance between long sections is not the same and at v = {hidden[0]:g} m less "
            f"than 1/{LOOKED_UP} of the width: programs with the C library find wrong heights there"
        )
    if "reference_line_end_u" not in header.road:
        found.append("REFERENCE_LINE_END_U is missing: a truncated file cannot be detected")
    return found


def _height_flags(surface: xr.Dataset) -> list[str]:
    found = []
    holes, empty = 0, np.zeros(surface.sizes["u"], np.bool_)
    for rows, height in height_blocks(surface):
        holes += int(interior_holes(height).sum())
        empty[rows] = ~np.isfinite(height).any(axis=1)
    if holes:
        found.append(f"{holes} heights are missing between others, not only at the edges")
    if empty.any():
        first = float(surface["u"][int(empty.argmax())])
        found.append(
            f"{int(empty.sum())} cross-sections have no height, the first at u = {first:g} m"
        )
    return found


def _line_flags(header: CrgHeader, surface: xr.Dataset, kappa: Floats) -> list[str]:
    found = []
    easting, northing = np.asarray(surface["easting"]), np.asarray(surface["northing"])
    chords = np.hypot(np.diff(easting), np.diff(northing))
    worst = int(np.argmax(np.abs(chords - header.increment)))
    if abs(chords[worst] - header.increment) > TOLERANCE:
        found.append(
            f"the chord that ends at u = {float(surface['u'][worst + 1]):g} m is "
            f"{chords[worst]:.6g} m long, not {header.increment:g} m: headings and end disagree"
        )
    if "phi" in header.channels and "reference_line_end_x" not in header.road:
        found.append("REFERENCE_LINE_END_X and _Y are missing: rounded headings move the end")
    sharp = beyond_centre(kappa, np.asarray(surface["v"]))
    if sharp.any():
        at = int(np.flatnonzero(sharp)[0])
        found.append(
            f"the road overlaps itself: its line turns with a radius of {1 / abs(kappa[at]):.3g} m "
            f"at u = {float(surface['u'][at + 1]):g} m"
        )
    slope = np.diff(surface["elevation"]) / header.increment
    banking = np.asarray(surface["banking"]) if "banking" in surface else np.zeros(1)
    for name, values in (("slope", slope), ("banking", banking)):
        if np.abs(values).max() > STEEPEST * (1 + 1e-6):
            found.append(f"the {name} of the reference line is steeper than {STEEPEST:g} m/m")
    return found
