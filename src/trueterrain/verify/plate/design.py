"""Design of a calibration plate: cleats of known profile, the reference of accuracy tests.

After section 3.4 of Smith, "Improving the Quality of Terrain Measurement" (Virginia Tech, 2009):
interchangeable cleats on a plate with a grid of holes of 152 mm, which the scanner measures
standing (profile along the scan) and driving (profile along the lane).
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
    Lie,
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
    "Lie",
    "PlateCleat",
    "PlateDesign",
    "PlateView",
    "ReflectivityBand",
    "ScanSetup",
    "cleat_flanks",
    "design_plate",
    "machined_profile",
    "view_plate",
    "write_machined",
]

_EVERY = 0.001  # [m] between the nodes of the machined profile
_CLEAR = 1e-5  # [m] of nodes from corners
_APART = 2  # holes from cleat to cleat


def design_plate(
    shapes: Sequence[CleatShape] = ("rectangle", "semicircle", "triangle", "edge"),
    *,
    cleat_width: float = 0.076,
    rise: float = 0.038,
    edge_rise: float = EDGE_RISE,
    **plate: Any,
) -> PlateDesign:
    """Plate with cleats two holes apart about its middle.

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
        As by `PlateDesign` and `PlateCleat`.

    Examples
    --------
    >>> [cleat.hole for cleat in design_plate(["rectangle", "semicircle", "triangle"]).cleats]
    [-2, 0, 2]
    """
    first = -(len(shapes) - 1)
    cleats = tuple(
        PlateCleat(
            shape=shape,
            hole=first + _APART * number,
            width=cleat_width,
            rise=edge_rise if shape == "edge" else rise,
        )
        for number, shape in enumerate(shapes)
    )
    return PlateDesign(cleats=cleats, **plate)


def machined_profile(plate: PlateDesign) -> xr.Dataset:
    """Profile of a plate as it is to be machined: the reference of accuracy tests.

    Parameters
    ----------
    plate : PlateDesign
        The plate.

    Returns
    -------
    xarray.Dataset
        Profile: s from the left end [m], height above the ground under the plate [m], and sd, the
        standard uncertainty of a tolerance within which all heights are alike [m].

    Notes
    -----
    Straight lines join its nodes: the corners, and one every millimetre between them. Uneven in s,
    it is exact everywhere.

    Examples
    --------
    >>> profile = machined_profile(PlateDesign())
    >>> print(f"{float(profile.sd[0]):.6f} m")
    0.000058 m
    """
    corners, heights = plate.vertices()
    between = _EVERY * np.arange(1, math.ceil(plate.length / _EVERY))
    after = np.searchsorted(corners, between).clip(1, corners.size - 1)
    apart = np.minimum(between - corners[after - 1], corners[after] - between)
    s = np.sort(np.concatenate([corners, between[apart > _CLEAR]]))
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
        Where the file shall be.
    force : bool
        Replace a file that is there already.

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
