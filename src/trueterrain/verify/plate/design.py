"""Design of a calibration plate: cleats of known profile, the reference of accuracy tests.

After section 3.4 of Smith, "Improving the Quality of Terrain Measurement" (Virginia Tech, 2009):
interchangeable cleats on a plate with a 152 mm grid of holes, measured by a scanner at rest
(profile along the scan) and from a moving vehicle (profile along the direction of travel).
"""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from trueterrain.core import whole_output
from trueterrain.core.schemas import make_profile
from trueterrain.verify.plate.parts import (
    EDGE_RISE,
    CleatShape,
    Flank,
    PlateCleat,
    PlateDesign,
    cleat_flanks,
)
from trueterrain.verify.plate.scanner_view import (
    Brightness,
    EdgeView,
    PlateOrientation,
    PlateView,
    ReflectivityBand,
    ScanSetup,
    view_plate,
)

__all__ = [
    "Brightness",
    "CleatShape",
    "EdgeView",
    "Flank",
    "PlateCleat",
    "PlateDesign",
    "PlateOrientation",
    "PlateView",
    "ReflectivityBand",
    "ScanSetup",
    "cleat_flanks",
    "design_plate",
    "machined_profile",
    "view_plate",
    "write_machined",
]

_SPACING = 0.001  # [m] of the nodes of the machined profile
_MIN_DISTANCE = 1e-5  # [m] of nodes from corners
_HOLE_STEP = 2  # holes from cleat to cleat


def design_plate(
    shapes: Sequence[CleatShape] = ("rectangle", "semicircle", "triangle", "edge"),
    *,
    cleat_width: float = 0.076,
    rise: float = 0.038,
    edge_rise: float = EDGE_RISE,
    **plate: Any,
) -> PlateDesign:
    """Design a plate with cleats two holes apart about its centre.

    Parameters
    ----------
    shapes : sequence of str
        Profiles of the cleats, from left to right.
    cleat_width : float
        Extent of a cleat along the profile [m]; half the pitch of the holes.
    rise : float
        Height of rectangle, semicircle and triangle above the plate [m].
    edge_rise : float
        Height of the bar with sharp edges [m].
    **plate
        Other fields of `PlateDesign`.

    Returns
    -------
    PlateDesign
        The plate.

    Raises
    ------
    ValueError
        See `PlateDesign` and `PlateCleat`.

    Examples
    --------
    >>> [cleat.hole for cleat in design_plate(["rectangle", "semicircle", "triangle"]).cleats]
    [-2, 0, 2]
    """
    first = -(len(shapes) - 1)
    cleats = tuple(
        PlateCleat(
            shape=shape,
            hole=first + _HOLE_STEP * number,
            width=cleat_width,
            rise=edge_rise if shape == "edge" else rise,
        )
        for number, shape in enumerate(shapes)
    )
    return PlateDesign(cleats=cleats, **plate)


def machined_profile(plate: PlateDesign) -> xr.Dataset:
    """Machined profile of a plate, the reference of accuracy tests.

    Parameters
    ----------
    plate : PlateDesign
        The plate.

    Returns
    -------
    xarray.Dataset
        Profile: s from the left end [m], height above the ground under the plate [m], and sd, the
        standard deviation of a uniform distribution within the tolerance [m].

    Notes
    -----
    Straight lines join the nodes: the corners, and one every millimetre between them. The spacing
    is not equal, but the profile is exact everywhere.

    Examples
    --------
    >>> profile = machined_profile(PlateDesign())
    >>> print(f"{float(profile.sd[0]):.6f} m")
    0.000058 m
    """
    corners, heights = plate.vertices()
    between = _SPACING * np.arange(1, math.ceil(plate.length / _SPACING))
    after = np.searchsorted(corners, between).clip(1, corners.size - 1)
    distance = np.minimum(between - corners[after - 1], corners[after] - between)
    s = np.sort(np.concatenate([corners, between[distance > _MIN_DISTANCE]]))
    height = np.interp(s, corners, heights)
    sd = np.full(s.size, plate.tolerance / math.sqrt(3))
    profile = make_profile(s, height, sd=sd)
    return profile.assign_attrs(tolerance=plate.tolerance)


def write_machined(plate: PlateDesign, path: str | Path, *, force: bool = False) -> None:
    """Write the machined profile as CSV, which `trueterrain.open` reads as a profile.

    Parameters
    ----------
    plate : PlateDesign
        The plate.
    path : str or Path
        Path of the file.
    force : bool
        Replace an existing file.

    Raises
    ------
    OutputError
        If the file exists and `force` is false, or its folder does not exist.

    Examples
    --------
    >>> import tempfile
    >>> import trueterrain
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_machined(PlateDesign(), Path(folder) / "plate.csv")
    ...     read = trueterrain.open(Path(folder) / "plate.csv")
    >>> print(float(read.height.max()))
    0.05
    """
    profile = machined_profile(plate)
    shapes = "; ".join(
        f"{cleat.shape} {1000 * cleat.width:g} x {1000 * cleat.rise:g} mm at "
        f"{plate.foot(cleat) + cleat.width / 2:.3f} m"
        for cleat in plate.cleats
    )
    lines = [
        "# machined profile of a calibration plate; straight lines join the rows",
        f"# cleats: {shapes}",
        f"# tolerance of s and height: +- {plate.tolerance:g} m; sd is tolerance / sqrt(3)",
        "s [m],height [m],sd [m]",
    ]
    columns = (profile[name].values.tolist() for name in ("s", "height", "sd"))
    lines += [f"{s:.7f},{height:.7f},{sd:.7f}" for s, height, sd in zip(*columns, strict=True)]
    with whole_output(path, force=force) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")
