"""Dynamic test: how true a profile over the plate is from a moving vehicle (thesis 3.5.2).

Beside figures of the error, how much of the motion of the body comes through to the profile: the
body-motion rejection, decibel by decibel and frequency by frequency.
"""

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import CoverageError, name_file_in_errors
from trueterrain.georeference import Screening
from trueterrain.motion.trajectory import Trajectory
from trueterrain.verify.error_modes import ErrorMode, modes_of, source_of
from trueterrain.verify.findings.common import describe_findings
from trueterrain.verify.findings.dynamic import dynamic_findings
from trueterrain.verify.findings.finding import Finding
from trueterrain.verify.motion_rejection import LEAST_SAMPLES, rejection_of
from trueterrain.verify.registration.points import registered_points
from trueterrain.verify.registration.search import Registration, register_profile
from trueterrain.verify.results import ResultRow, at_edges, parts_of, profile_distances, row_of

Floats = npt.NDArray[np.float64]

_CROSSED = 0.95  # share of the plate that must have heights
_PLANE = 0.4  # of the height of the plate, by which a floor seems to depart from a plane at most
_FINE = 0.002  # [m] cells by which the stretch is found
_STRAIGHT = 0.05  # [m] by which the way over the plate may leave a straight line


@dataclass(frozen=True, kw_only=True)
class DynamicSettings:
    """How a dynamic test is evaluated."""

    spacing: float = 0.01
    "Spacing of the profile along the way [m]."

    offset: float = 0.0
    "Middle of the strip of returns that are taken, left of the way of the body [m]."

    width: float = 0.1
    "Width of this strip [m]."

    floor: float = 0.0
    "Length of plane floor before and after the plate, for the body-motion rejection [m]."

    begin: float | None = None
    "Time from which the way is looked at [s]; by default that of the first pose."

    end: float | None = None
    "Time to which the way is looked at [s]; by default that of the last pose."

    assumed: float | None = None
    "Where the plate is assumed to begin along the way from the first pose [m]."

    search: float | None = None
    """Greatest distance of the plate from there [m]; by default it is looked for everywhere; 0
    takes it as it lies."""

    stretch: bool = False
    "Whether the length over which the plate was measured is found too, as where the way drifts."

    ride: tuple[float, float] = (0.5, 3.0)
    "Lowest and highest frequency of the primary ride of the vehicle [Hz]."

    hop: tuple[float, float] = (8.0, 16.0)
    "Lowest and highest frequency of the hop of its wheels [Hz]."

    edge: float = 0.01
    "Distance from a steep face within which an error counts as one of an edge [m]."

    screening: Screening = field(default_factory=Screening)
    "Which returns are flagged, and what becomes of them."

    confidence: float = 0.95
    "Share of repeats of the test in which the intervals hold the truth."

    def __post_init__(self) -> None:
        """Check the values."""
        for name in ("spacing", "width"):
            if not 0 < getattr(self, name) < math.inf:
                message = f"{name} must be greater than 0 m, got {getattr(self, name)}."
                raise ValueError(message)
        for name in ("floor", "edge"):
            if not 0 <= getattr(self, name) < math.inf:
                message = f"{name} must be at least 0 m, got {getattr(self, name)}."
                raise ValueError(message)
        if not 0 < self.ride[0] < self.ride[1] <= self.hop[0] < self.hop[1] < math.inf:
            message = f"ride and hop must ascend [Hz], got {self.ride} and {self.hop}."
            raise ValueError(message)
        if not 0 < self.confidence < 1:
            message = f"confidence must be between 0 and 1, got {self.confidence}."
            raise ValueError(message)
        if self.search is not None and self.assumed is None:
            message = "search needs assumed, where the plate is assumed to begin."
            raise ValueError(message)
        if self.begin is not None and self.end is not None and not self.begin < self.end:
            message = f"begin must be before end, got {self.begin} s and {self.end} s."
            raise ValueError(message)


@dataclass(frozen=True, kw_only=True, eq=False)
class DynamicResult:
    """How true a profile from a moving vehicle is."""

    errors: xr.Dataset
    """Over position s on the machined profile [m]: ``along`` the way, ``up`` as it was measured,
    ``height`` (registered), ``machined`` (mean over the places of the returns), ``error``, ``sd``
    of a mean by the spread of its returns, ``distance`` from the machined line [m], ``count``,
    ``edge`` and ``time`` [s]."""

    row: ResultRow
    "Row of the table."

    registration: Registration
    "Where the plate was found."

    registered: xr.Dataset
    "Means ``up`` of cells ``along`` the way where the plate was found, and was assumed [m]."

    parts: dict[str, float]
    "Mean squares by cause, which add up to that of the error [m²]; see `parts_of`."

    speed: float
    "Mean speed over the plate [m/s]."

    rejection: xr.Dataset
    """Over ``frequency`` [Hz]: spectra ``motion`` (of the laser's height) and ``error`` [m²/Hz],
    ``rejection`` with ``low`` and ``high`` [dB]."""

    findings: tuple[Finding, ...] = ()
    "What was looked for besides: see `Finding`."

    modes: tuple[ErrorMode, ...] = ()
    "The error on plate and floor by the modes of the body, from low to high frequencies."

    @property
    def source(self) -> str:
        """Which mode the error comes from, in a sentence."""
        return source_of(self.modes)

    def to_dict(self) -> dict[str, Any]:
        """The same as plain numbers and words, as for JSON, without the single errors."""
        found = self.registration
        names = (
            "shift",
            "offset",
            "tilt",
            "reversed",
            "residual",
            "unregistered",
            "outliers",
            "points",
            "stretch",
        )
        bands = ("frequency", "motion", "error", "rejection", "low", "high")
        return {
            **self.row.to_dict(),
            "speed": self.speed,
            "registration_found": {name: getattr(found, name) for name in names},
            "parts": {name: math.sqrt(value) for name, value in self.parts.items()},
            "rejection": {name: self.rejection[name].values.tolist() for name in bands},
            "findings": describe_findings(self.findings),
            "modes": [one.to_dict() for one in self.modes],
            "source": self.source,
        }


def dynamic_test(
    run: xr.DataTree | str | Path,
    machined: xr.Dataset,
    trajectory: Trajectory,
    settings: DynamicSettings = DynamicSettings(),
    *,
    name: str = "dynamic",
) -> DynamicResult:
    """Compare a profile over a calibration plate, measured while driving, with the machined one.

    Parameters
    ----------
    run : xarray.DataTree or path
        Run over the plate, whose cleats lie across the way.
    machined : xarray.Dataset
        Machined profile of the plate; straight lines join its nodes.
    trajectory : Trajectory
        Motion of the body, by any method.
    settings : DynamicSettings
        How the test is evaluated.
    name : str
        Name of the test in the table.

    Returns
    -------
    DynamicResult
        Errors over the plate, their figures, and the body-motion rejection.

    Raises
    ------
    CoverageError
        If the run does not cross the plate, or it is not found.
    SchemaError
        If the machined profile is none of a plate, or in another unit.
    ValueError
        If screening needs intensities that were not recorded.

    Notes
    -----
    Returns of a strip beside the way are averaged in cells along it. Against each mean stands the
    mean of the machined heights at the places of the same returns, so that neither the slope in a
    cell nor the places of scans are charged to the heights (Figs 3-22, 3-23).

    The motion is the height of the laser at the time of the scans, as the trajectory shows it.
    Errors beside edges are bridged before spectra are taken, since they say nothing about the body.
    Without ``floor`` the stretch is that of the plate, and frequencies below speed / length are not
    told apart.
    """
    from trueterrain.formats.run import open_run
    from trueterrain.georeference import mounting_of

    source = None if isinstance(run, xr.DataTree) else Path(run)
    path = trajectory.between(settings.begin, settings.end)
    with name_file_in_errors(source):
        strip = strip_of(run, path, settings)
        # within cells of some length the flanks of arcs bend, which looks like a stretch
        cells = _cell_means(
            strip, min(_FINE, settings.spacing) if settings.stretch else settings.spacing
        )
        found = register_profile(
            cells["along"],
            cells["height"],
            machined,
            assumed=settings.assumed,
            search=settings.search,
            stretch=settings.stretch,
        )
        table = _compare_cells(strip, machined, found, settings)
        on = (table.s.values >= 0) & (table.s.values <= found.length)
        errors = table.isel(s=np.flatnonzero(on))
        distance = profile_distances(machined, errors["s"].values, errors["height"].values)
        errors = errors.assign(distance=("s", distance))
        _require_crossed(errors.sizes["s"], found.length, settings.spacing)
    error, edge = errors["error"].values, errors["edge"].values
    single = (errors["sd"] ** 2 * errors["count"]).values[~edge]
    noise = float(np.sqrt(single.mean())) if single.size else None
    row = row_of(
        name, error, edge, distance, noise=noise, registration=found, confidence=settings.confidence
    )
    parts = parts_of(error, errors["sd"].values, edge, np.zeros_like(edge))
    time, along = errors["time"].values, errors["along"].values
    speed = float(np.abs(np.polyfit(time - time.mean(), along - along.mean(), 1)[0]))
    tree = run if isinstance(run, xr.DataTree) else open_run(run)
    lever = np.array(mounting_of(tree, path=source).scanner_position)
    rejection, modes = _crossing_spectra(source, table, path, lever, settings)
    findings = dynamic_findings(
        tree,
        table,
        machined,
        found,
        path,
        lever,
        assumed=settings.assumed,
        screening=settings.screening,
    )
    return DynamicResult(
        errors=errors,
        row=row,
        registration=found,
        registered=registered_points(cells["along"], cells["height"], found, settings.assumed),
        parts=parts,
        speed=speed,
        rejection=rejection,
        modes=modes,
        findings=findings,
    )


def strip_of(
    run: xr.DataTree | str | Path, path: Trajectory, settings: DynamicSettings
) -> dict[str, Floats]:
    """Returns of the strip in the order of their place along the way.

    Their ``along`` and ``up`` [m], ``time`` [s] and, where there is one, ``intensity``.
    """
    from trueterrain.georeference import georeference

    origin = path.position[0, :2]
    way = path.position[-1, :2] - origin
    driven = float(np.hypot(*way))
    if driven < settings.spacing:
        raise CoverageError(
            f"the vehicle moved by {driven:.3f} m: the run does not cross the plate",
            cure="Use the static test for a vehicle that stands.",
        )
    ahead = way / driven
    aside = np.array([-ahead[1], ahead[0]])
    sway = float(np.abs((path.position[:, :2] - origin) @ aside).max())
    if sway > _STRAIGHT * max(1.0, driven):
        raise CoverageError(
            f"the way leaves a straight line by {sway:.2f} m",
            cure="Name the time of the crossing: begin and end.",
        )
    found: dict[str, list[Floats]] = {}
    for points in georeference(run, path, screening=settings.screening):
        places = np.stack([points.easting.values, points.northing.values], axis=-1) - origin
        inside = np.abs(places @ aside - settings.offset) <= 0.5 * settings.width
        columns = {"along": places @ ahead, "up": points.up.values, "time": points.time.values}
        if "intensity" in points:
            columns["intensity"] = points.intensity.values.astype(np.float64)
        for name, values in columns.items():
            found.setdefault(name, []).append(values[inside])
    strip = {name: np.concatenate(values) for name, values in found.items()}
    if not strip["along"].size:
        raise CoverageError(
            "there is no return in the strip", cure="Choose another offset or a larger width."
        )
    order = np.argsort(strip["along"], kind="stable")
    return {name: values[order] for name, values in strip.items()}


def _cell_means(strip: dict[str, Floats], spacing: float) -> dict[str, Floats]:
    """Means of cells along the way."""
    cell = np.floor(strip["along"] / spacing).astype(np.int64)
    first = np.flatnonzero(np.concatenate([[True], np.diff(cell) != 0]))
    count = np.diff(np.concatenate([first, [cell.size]]))
    means = {name: np.add.reduceat(values, first) / count for name, values in strip.items()}
    return {"along": means["along"], "height": means["up"]}


def _compare_cells(
    strip: dict[str, Floats], machined: xr.Dataset, found: Registration, settings: DynamicSettings
) -> xr.Dataset:
    """Means of cells on plate and floor against the machined heights at the same places."""
    s = found.positions(strip["along"])
    reach = settings.floor
    kept = np.flatnonzero((s >= -reach) & (s <= found.length + reach))
    order = kept[np.argsort(s[kept], kind="stable")]
    s, along = s[order], strip["along"][order]
    nodes, heights = machined["s"].values - machined["s"].values[0], machined["height"].values
    on = (s >= 0) & (s <= found.length)
    true = np.where(on, np.interp(s, nodes, heights), 0.0)
    height = strip["up"][order] - found.level(along)
    if not on.all():  # heights of the floor count from itself: how thick plates lie is not known
        height[~on] -= np.median(height[~on])
    cell = np.floor(s / settings.spacing).astype(np.int64)
    first = np.flatnonzero(np.concatenate([[True], np.diff(cell) != 0]))
    count = np.diff(np.concatenate([first, [cell.size]]))

    def mean(values: Floats) -> Floats:
        return np.asarray(np.add.reduceat(values, first) / count)

    error = height - true
    _require_plane(mean(error)[~on[first]], float(np.ptp(heights)))
    about = error - np.repeat(mean(error), count)
    spread = np.sqrt(mean(about**2) * count / np.maximum(count - 1, 1))
    position = mean(s)
    columns = {
        "along": mean(along),
        "up": mean(strip["up"][order]),
        "height": mean(height),
        "machined": mean(true),
        "error": mean(error),
        "sd": spread / np.sqrt(count),
        "count": count,
        "time": mean(strip["time"][order]),
        "edge": at_edges(machined, position, settings.edge)
        & (position >= -settings.edge)
        & (position <= found.length + settings.edge),
    }
    if "intensity" in strip:
        columns["intensity"] = mean(strip["intensity"][order])
    return xr.Dataset({name: ("s", values) for name, values in columns.items()}, {"s": position})


def _require_crossed(cells: int, length: float, spacing: float) -> None:
    if cells < _CROSSED * length / spacing:
        raise CoverageError(
            f"{cells} of {length / spacing:.0f} places on the plate have heights: the run does not "
            "cross it, or its scans are too far apart",
            cure="Drive slower over the plate, or choose a larger spacing.",
        )


def _require_plane(floor: Floats, plate: float) -> None:
    """Raise if beside the plate lies what is no floor."""
    most = float(np.abs(floor).max(initial=0.0))
    if most > _PLANE * plate:
        raise CoverageError(
            f"the floor beside the plate is not plane: it departs by {1000 * most:.1f} mm",
            cure="Choose a shorter floor, or 0.",
        )


def _crossing_spectra(
    source: Path | None,
    table: xr.Dataset,
    path: Trajectory,
    lever: Floats,
    settings: DynamicSettings,
) -> tuple[xr.Dataset, tuple[ErrorMode, ...]]:
    """Spectra of error and motion over the time of the crossing, and the error by modes."""
    from trueterrain.geometry.rotations import to_iso8855

    order = np.argsort(table["time"].values)
    time, error = (table[name].values[order] for name in ("time", "error"))
    plain = ~table["edge"].values[order]
    if plain.sum() < LEAST_SAMPLES:
        raise CoverageError(
            f"{plain.sum()} places away from edges are too few for a spectrum, needed are "
            f"{LEAST_SAMPLES}",
            path=source,
            cure="Choose a smaller spacing or edge, or add floor beside the plate.",
        )
    even = np.linspace(time[0], time[-1], time.size)
    poses = path.at(even)
    laser = poses.position[:, 2] + poses.rotation.apply(lever)[:, 2]
    bridged = np.interp(even, time[plain], error[plain])
    roll, pitch, _ = to_iso8855(poses.rotation)
    motion = {"heave": poses.position[:, 2], "pitch": pitch, "roll": roll, "the laser": laser}
    return (
        rejection_of(even, laser, bridged, confidence=settings.confidence),
        modes_of(even, bridged, motion, ride=settings.ride, hop=settings.hop),
    )
