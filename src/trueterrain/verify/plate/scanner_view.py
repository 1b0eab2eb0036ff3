"""Visibility of a calibration plate to a scanner: returns, shadows, edges, brightness."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from trueterrain.verify.plate.parts import PlateDesign, cleat_flanks

Floats = npt.NDArray[np.float64]

#: Orientation of the plate's profile: along the scan (static test) or along the direction of
#: travel, the traffic lane (dynamic test).
PlateOrientation = Literal["along the scan", "along the lane"]

#: State of a return.
Brightness = Literal["clear", "saturated", "lost"]

_STEEP = math.radians(60.0)  # slope from which a face has edges at its top and its foot
_FINE = 1e-4  # [m] spacing of the places in the test of visibility
_EDGE_ON = 1e-9  # [rad] tolerance of the test of visibility


@dataclass(frozen=True, kw_only=True, eq=False)
class ScanSetup:
    """Geometry and radiometry of a scanner above a plate; defaults are the thesis's system.

    Raises
    ------
    ValueError
        If a value is out of its bounds.

    Examples
    --------
    >>> print(f"{1000 * ScanSetup().spacing_below:.2f} mm")
    3.35 mm
    """

    angle: npt.ArrayLike = field(
        default_factory=lambda: np.linspace(-math.pi / 4, math.pi / 4, 940)
    )
    "Angle of each beam from straight down, left positive, shape (beam,) [rad]."

    height: float = 2.0
    "Height of the laser above the ground [m]."

    offset: float = 0.0
    "Offset of the centre of the plate from the laser, left positive [m]."

    lie: PlateOrientation = "along the scan"
    "Orientation of the profile."

    speed: float = 5.4
    "Speed of the crossing of a plate along the lane [m/s]."

    rate: float = 1000.0
    "Scans per second [Hz]."

    spot_width: float = 0.0015
    "Extent of the spot along the scan [m]."

    spot_length: float = 0.010
    "Extent of the spot along the direction of travel [m]."

    gain: float = 30000.0
    "Intensity of a white surface at normal incidence at the range `nominal` [counts]."

    nominal: float = 2.0
    "Range for which `gain` holds [m]."

    floor: float = 500.0
    "Intensity below which returns are lost [counts]."

    saturation: float = 20000.0
    "Intensity above which the receiver saturates [counts]."

    def __post_init__(self) -> None:
        """Check the values."""
        for name, unit in (
            ("height", "m"),
            ("speed", "m/s"),
            ("rate", "Hz"),
            ("spot_width", "m"),
            ("spot_length", "m"),
            ("gain", "counts"),
            ("nominal", "m"),
            ("saturation", "counts"),
        ):
            value = getattr(self, name)
            if not 0 < value < math.inf:
                message = f"{name} must be finite and greater than 0 {unit}, got {value}."
                raise ValueError(message)
        if not (math.isfinite(self.offset) and 0 <= self.floor < self.saturation):
            message = "offset must be finite, and floor from 0 to less than saturation."
            raise ValueError(message)
        if self.lie not in get_args(PlateOrientation):
            message = (
                f"lie must be one of {', '.join(get_args(PlateOrientation))}, got {self.lie!r}."
            )
            raise ValueError(message)
        angles = self.angles
        if angles.ndim != 1 or angles.size < 2 or not (np.abs(angles) < math.pi / 2).all():
            message = "angle must hold two or more angles less than 90 degrees from straight down."
            raise ValueError(message)
        if not ((np.diff(angles) > 0).all() or (np.diff(angles) < 0).all()):
            message = "angle must ascend or descend."
            raise ValueError(message)

    @property
    def angles(self) -> Floats:
        """Angles of the beams from right to left, shape (beam,) [rad]."""
        angles = np.asarray(self.angle, dtype=np.float64)
        return angles if angles.size < 2 or angles[-1] > angles[0] else angles[::-1]

    @property
    def spacing_below(self) -> float:
        """Distance between points on level ground below the plate's centre [m]."""
        incidence = math.atan2(self.offset, self.height)
        step = float(np.median(np.diff(self.angles)))
        return self.height * step / math.cos(incidence) ** 2


@dataclass(frozen=True, kw_only=True)
class EdgeView:
    """A steep face of the plate's profile, and its sampling by the scanner."""

    name: str
    "Cleat and side."

    s: float
    "Position of its foot along the profile [m]."

    rise: float
    "Height from foot to top [m]."

    slope: float
    "Steepness [rad]."

    limit: float
    "Greatest visible slope at this place; pi for a face that rises towards the scanner [rad]."

    seen: bool
    "Whether the whole face is visible."

    spacing: float
    "Distance between points at this place [m]."

    on_face: int
    "Number of returns from the face."

    blurred: float
    "Mean number of returns whose spot lies on both sides of the edge."


@dataclass(frozen=True, kw_only=True)
class ReflectivityBand:
    """A strip of the plate with a surface of its own."""

    name: str
    "Surface."

    reflectivity: float
    "Fraction of the light that it reflects [1]."

    intensity: float
    "Intensity of a return from the centre of the plate [counts]."

    brightness: Brightness


"State of its returns."


@dataclass(frozen=True, kw_only=True, eq=False)
class PlateView:
    """Visibility of a plate to a scanner; made by `view_plate`."""

    s: Floats
    "Position of each return along the profile, shape (n,) [m]."

    height: Floats
    "Its height, shape (n,) [m]."

    shadows: tuple[tuple[float, float], ...]
    "Hidden stretches of the profile [m]."

    edges: tuple[EdgeView, ...]
    "Steep faces."

    bands: tuple[ReflectivityBand, ...]
    "Surfaces."

    flags: tuple[str, ...]
    "Warnings on the plate at this place."


def view_plate(plate: PlateDesign, setup: ScanSetup = ScanSetup()) -> PlateView:
    """Intersect the beams of a scanner with a plate, to check its place and its cleats.

    Parameters
    ----------
    plate : PlateDesign
        The plate, on level ground.
    setup : ScanSetup
        Scanner and orientation of the plate.

    Returns
    -------
    PlateView
        Returns, shadows, edges and brightness.

    Raises
    ------
    ValueError
        If no beam meets the plate.

    Notes
    -----
    Along the scan, a beam that meets the ground at the offset y from a laser at height h has the
    slope h / y: a steeper face that descends away from the laser is in its own shadow (Smith 2009,
    Figs. 3-13 and 3-14). Along the direction of travel, all beams of a place are vertical in the
    plane of the profile: there is no shadow, no return from a vertical face, and edges are blurred
    over the length of the spot.

    Examples
    --------
    >>> from trueterrain.verify.plate.design import PlateDesign
    >>> view = view_plate(PlateDesign(), ScanSetup(offset=1.2))
    >>> len(view.shadows) > 0, [edge.name for edge in view.edges if not edge.seen][:2]
    (True, ['rectangle, left', 'semicircle, left'])
    """
    vertices = plate.vertices()
    if setup.lie == "along the scan":
        s, height = _scanned_profile(vertices, plate.length, setup)
        shadows = _shadow_stretches(vertices, plate.length, setup)
    else:
        step = setup.speed / setup.rate
        s = step * np.arange(0.5, plate.length / step)
        height = np.interp(s, *vertices)
        shadows = ()
    if not s.size:
        message = (
            f"offset must put the plate under the beams, which reach from "
            f"{setup.height * math.tan(setup.angles[0]):.2f} m to "
            f"{setup.height * math.tan(setup.angles[-1]):.2f} m, got {setup.offset} m."
        )
        raise ValueError(message)
    edges = tuple(_edge_views(plate, vertices, s, height, setup))
    bands = tuple(_reflectivity_band(name, bright, plate, setup) for name, bright in plate.bands)
    return PlateView(
        s=s,
        height=height,
        shadows=shadows,
        edges=edges,
        bands=bands,
        flags=tuple(_view_notes(plate, s, shadows, edges, bands, setup)),
    )


def _scanned_profile(vertices: Floats, length: float, setup: ScanSetup) -> tuple[Floats, Floats]:
    """First intersections of the beams with the profile, without those on level ground."""
    y = vertices[0] - 0.5 * length + setup.offset
    z = vertices[1]
    # the ends of the plate reach down to the ground
    y = np.concatenate([[y[0]], y, [y[-1]]])
    z = np.concatenate([[0.0], z, [0.0]])
    sine, down = np.sin(setup.angles)[:, None], -np.cos(setup.angles)[:, None]
    dy, dz = np.diff(y), np.diff(z)
    # Cramer's rule for the intersection of a beam with each segment
    determinant = sine * dz - down * dy
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (y[:-1] * dz - (z[:-1] - setup.height) * dy) / determinant
        part = (y[:-1] * down - (z[:-1] - setup.height) * sine) / determinant
    hits = (part >= 0) & (part <= 1) & (distance > 0) & np.isfinite(distance)
    nearest = np.where(hits, distance, np.inf).min(axis=1)
    # a beam may meet the ground in front of the plate before its far side
    met = np.isfinite(nearest)
    ground = setup.height / np.cos(setup.angles)
    met &= nearest <= ground + 1e-12
    s = nearest[met] * np.sin(setup.angles[met]) - setup.offset + 0.5 * length
    return s, setup.height - nearest[met] * np.cos(setup.angles[met])


def _shadow_stretches(
    vertices: Floats, length: float, setup: ScanSetup
) -> tuple[tuple[float, float], ...]:
    """Stretches hidden by higher parts that are closer to the nadir of the laser."""
    s = np.union1d(np.arange(0.0, length, _FINE), vertices[0])
    z = np.interp(s, *vertices)
    y = s - 0.5 * length + setup.offset
    view = np.arctan2(np.abs(y), setup.height - z)
    hidden = np.zeros(s.size, dtype=bool)
    for side, order in ((y >= 0, slice(None)), (y < 0, slice(None, None, -1))):
        outwards = np.flatnonzero(side)[order]
        # a place is hidden if its view angle is less than that of a place nearer to the nadir
        max_view = np.maximum.accumulate(view[outwards])
        hidden[outwards] = view[outwards] < max_view - _EDGE_ON
    changes = np.flatnonzero(np.diff(np.concatenate([[0], hidden.astype(int), [0]])))
    return tuple(
        (float(s[begin]), float(s[end - 1]))
        for begin, end in changes.reshape(-1, 2)
        if s[end - 1] - s[begin] > _FINE
    )


def _edge_views(
    plate: PlateDesign, vertices: Floats, s: Floats, height: Floats, setup: ScanSetup
) -> list[EdgeView]:
    out = []
    for flank in cleat_flanks(plate):
        if flank.slope < _STEEP:
            continue
        low, high = sorted((flank.begin, flank.end))
        foot = np.interp(flank.foot, *vertices)
        if setup.lie == "along the lane":
            spacing, spot, limit, seen = setup.speed / setup.rate, setup.spot_length, math.pi, False
            on_face = 0
            seen = flank.slope < math.pi / 2 - 1e-3
        else:
            y = flank.foot - 0.5 * plate.length + setup.offset
            step = float(np.median(np.diff(setup.angles)))
            spacing = (setup.height - foot) * step / math.cos(math.atan2(y, setup.height)) ** 2
            spot = setup.spot_width
            away = (
                flank.foot - flank.top
            ) * y > 0  # its foot is farther from the nadir than its top
            limit = math.atan2(setup.height - foot, abs(y)) if away else math.pi
            seen = flank.slope <= limit
            inside = (s >= low - 1e-6) & (s <= high + 1e-6)
            inside &= (height > foot + 1e-6) & (height < foot + flank.rise - 1e-6)
            on_face = int(inside.sum())
        out.append(
            EdgeView(
                name=flank.name,
                s=flank.foot,
                rise=flank.rise,
                slope=flank.slope,
                limit=limit,
                seen=seen,
                spacing=spacing,
                on_face=on_face,
                blurred=spot / spacing,
            )
        )
    return out


def _reflectivity_band(
    name: str, reflectivity: float, plate: PlateDesign, setup: ScanSetup
) -> ReflectivityBand:
    down = setup.height - plate.thickness
    distance = math.hypot(down, setup.offset)
    intensity = setup.gain * reflectivity * (down / distance) * (setup.nominal / distance) ** 2
    brightness: Brightness = "clear"
    if intensity > setup.saturation:
        brightness = "saturated"
    elif intensity < setup.floor:
        brightness = "lost"
    return ReflectivityBand(
        name=name, reflectivity=reflectivity, intensity=intensity, brightness=brightness
    )


def _view_notes(
    plate: PlateDesign,
    s: Floats,
    shadows: Sequence[tuple[float, float]],
    edges: Sequence[EdgeView],
    bands: Sequence[ReflectivityBand],
    setup: ScanSetup,
) -> list[str]:
    out = []
    hidden = [edge.name for edge in edges if not edge.seen]
    if hidden and setup.lie == "along the scan":
        out.append(
            f"The faces {'; '.join(hidden)} are too steep to be visible there, as a whole or at "
            "the foot, and lie in shadow. Move the plate towards the nadir of the laser."
        )
    if shadows:
        dark = sum(end - begin for begin, end in shadows)
        out.append(
            f"{1000 * dark:.0f} mm of the profile lie in shadow ({100 * dark / plate.length:.1f} %)"
            ": leave them out of the comparison."
        )
    if s[0] > 0.01 or s[-1] < plate.length - 0.01:
        out.append(
            f"The beams meet the plate from {s[0]:.2f} m to {s[-1]:.2f} m of its "
            f"{plate.length:.2f} m only."
        )
    widest = max((edge.spacing for edge in edges), default=0.0)
    narrow = min((cleat.width for cleat in plate.cleats), default=math.inf)
    if narrow < 5 * widest:
        out.append(
            f"The narrowest cleat, {1000 * narrow:.0f} mm, has fewer than five points: they are "
            f"{1000 * widest:.1f} mm apart."
        )
    out += [
        f"Returns from {band.name} are {band.brightness} ({band.intensity:.0f} counts)."
        for band in bands
        if band.brightness != "clear"
    ]
    return out
