"""What a scanner sees of a calibration plate: points, shadows, slopes, edges, brightness."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from trueterrain.verify.plate.parts import PlateDesign, cleat_flanks

Floats = npt.NDArray[np.float64]

#: Which way the profile of the plate lies: along the scan, as in a static test, or along the lane.
Lie = Literal["along the scan", "along the lane"]

#: What becomes of a return.
Brightness = Literal["clear", "saturated", "lost"]

_STEEP = math.radians(60.0)  # a face that is at least as steep has an edge at its top and its foot
_FINE = 1e-4  # [m] between the places whose visibility is tested
_EDGE_ON = 1e-9  # [rad] by which a place may be behind another and count as seen


@dataclass(frozen=True, kw_only=True, eq=False)
class ScanSetup:
    """How a scanner looks at the plate; the defaults are those of the thesis's system.

    Raises
    ------
    ValueError
        If a value breaks its rule.

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
    "Offset of the middle of the plate from the laser, left positive [m]."

    lie: Lie = "along the scan"
    "Which way the profile lies."

    speed: float = 5.4
    "Speed at which a plate that lies along the lane is crossed [m/s]."

    rate: float = 1000.0
    "Scans per second [Hz]."

    spot_width: float = 0.0015
    "Extent of the spot along the scan [m]."

    spot_length: float = 0.010
    "Extent of the spot along the lane [m]."

    gain: float = 30000.0
    "Intensity of a white surface met at right angles at `nominal` [counts]."

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
        if self.lie not in get_args(Lie):
            message = f"lie must be one of {', '.join(get_args(Lie))}, got {self.lie!r}."
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
        """Distance from point to point across level ground below the plate's middle [m]."""
        ahead = math.atan2(self.offset, self.height)
        step = float(np.median(np.diff(self.angles)))
        return self.height * step / math.cos(ahead) ** 2


@dataclass(frozen=True, kw_only=True)
class EdgeView:
    """A steep face of the plate's profile, and what is measured of it."""

    name: str
    "Cleat and side."

    s: float
    "Where its foot is along the profile [m]."

    rise: float
    "Height from foot to top [m]."

    slope: float
    "Steepness [rad]."

    limit: float
    "Steepest face that the scanner sees there; a half turn if it rises towards the scanner [rad]."

    seen: bool
    "Whether all of the face is in view."

    spacing: float
    "Distance from point to point there [m]."

    on_face: int
    "Returns from the face itself."

    blurred: float
    "Returns whose spot lies on both sides of the edge, on the average."


@dataclass(frozen=True, kw_only=True)
class ReflectivityBand:
    """A strip of the plate with a surface of its own."""

    name: str
    "Surface."

    reflectivity: float
    "Share of the light that it returns [1]."

    intensity: float
    "Of a return from the plate in the middle [counts]."

    brightness: Brightness
    "What becomes of it."


@dataclass(frozen=True, kw_only=True, eq=False)
class PlateView:
    """What a scanner sees of a plate; made by `view_plate`."""

    s: Floats
    "Place of each return along the profile, shape (n,) [m]."

    height: Floats
    "Its height, shape (n,) [m]."

    shadows: tuple[tuple[float, float], ...]
    "Stretches of the profile that are out of view [m]."

    edges: tuple[EdgeView, ...]
    "Steep faces."

    bands: tuple[ReflectivityBand, ...]
    "Surfaces."

    flags: tuple[str, ...]
    "What is against this plate at this place, in words."


def view_plate(plate: PlateDesign, setup: ScanSetup = ScanSetup()) -> PlateView:
    """Look at a plate as a scanner does: exact beams on the exact profile.

    Parameters
    ----------
    plate : PlateDesign
        The plate, on level ground.
    setup : ScanSetup
        Scanner, and how the plate lies.

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
    Along the scan, a beam that comes down at the offset y from a laser at height h has the slope
    h / y: a face that falls away more steeply is in its own shadow (Smith 2009, Figs. 3-13 and
    3-14). Along the lane, all beams of a place on the lane come from straight above: nothing is in
    shadow, no vertical face has a return, and edges are blurred over the length of the spot.

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
    """Where beams first meet the profile, with level ground beyond it left out."""
    y = vertices[0] - 0.5 * length + setup.offset
    z = vertices[1]
    # the ends of the plate stand on the ground
    y = np.concatenate([[y[0]], y, [y[-1]]])
    z = np.concatenate([[0.0], z, [0.0]])
    ahead, down = np.sin(setup.angles)[:, None], -np.cos(setup.angles)[:, None]
    dy, dz = np.diff(y), np.diff(z)
    across = ahead * dz - down * dy
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (y[:-1] * dz - (z[:-1] - setup.height) * dy) / across
        part = (y[:-1] * down - (z[:-1] - setup.height) * ahead) / across
    hits = (part >= 0) & (part <= 1) & (distance > 0) & np.isfinite(distance)
    nearest = np.where(hits, distance, np.inf).min(axis=1)
    # the ground beside the plate may be nearer, on the way to its far side
    met = np.isfinite(nearest)
    ground = setup.height / np.cos(setup.angles)
    met &= nearest <= ground + 1e-12
    s = nearest[met] * np.sin(setup.angles[met]) - setup.offset + 0.5 * length
    return s, setup.height - nearest[met] * np.cos(setup.angles[met])


def _shadow_stretches(
    vertices: Floats, length: float, setup: ScanSetup
) -> tuple[tuple[float, float], ...]:
    """Stretches behind something that is higher and nearer to straight below."""
    s = np.union1d(np.arange(0.0, length, _FINE), vertices[0])
    z = np.interp(s, *vertices)
    y = s - 0.5 * length + setup.offset
    view = np.arctan2(np.abs(y), setup.height - z)
    hidden = np.zeros(s.size, dtype=bool)
    for side, order in ((y >= 0, slice(None)), (y < 0, slice(None, None, -1))):
        outwards = np.flatnonzero(side)[order]
        so_far = np.maximum.accumulate(view[outwards])
        hidden[outwards] = view[outwards] < so_far - _EDGE_ON
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
            away = (flank.foot - flank.top) * y > 0  # its foot is farther from straight below
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
            f"The faces {'; '.join(hidden)} are steeper than the scanner sees there, as a whole or "
            "at the foot, and lie in shadow. Put the plate nearer to straight below the laser."
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
