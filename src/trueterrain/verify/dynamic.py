"""Dynamic test: error of a profile over a calibration plate from a moving vehicle (thesis 3.5.2).

Besides accuracy figures, the test gives the body-motion rejection: the ratio of the motion of the
laser to the error of the profile by frequency.
"""

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import CoverageError, name_file_in_errors
from trueterrain.formats.run import open_run
from trueterrain.geometry.rotations import to_iso8855
from trueterrain.georeference import Screening, georeference
from trueterrain.motion.trajectory import Trajectory
from trueterrain.verify.error_modes import ErrorMode, main_error_source, split_by_mode
from trueterrain.verify.findings.common import describe_findings
from trueterrain.verify.findings.dynamic import dynamic_findings
from trueterrain.verify.findings.finding import Finding
from trueterrain.verify.motion_rejection import MIN_SAMPLES, rejection_spectrum
from trueterrain.verify.registration.search import (
    Registration,
    register_profile,
    registered_points,
)
from trueterrain.verify.results import (
    ResultRow,
    at_edges,
    error_parts,
    profile_distances,
    result_row,
)

Floats = npt.NDArray[np.float64]

_MIN_CROSSED = 0.95  # fraction of the plate that must have heights
_PLANE = 0.4  # largest error of a plane floor, as a fraction of the relief of the plate
_FINE = 0.002  # [m] cells for the estimation of the stretch
_STRAIGHT = 0.05  # lateral deviation of the path from a straight line, per metre [m/m]


@dataclass(frozen=True, kw_only=True)
class DynamicSettings:
    """Settings of a dynamic test."""

    spacing: float = 0.01
    "Spacing of the profile along the path [m]."

    offset: float = 0.0
    "Lateral offset of the centre of the strip of returns, to the left of the body's path [m]."

    width: float = 0.1
    "Width of this strip [m]."

    floor: float = 0.0
    "Length of plane floor before and after the plate, for the body-motion rejection [m]."

    begin: float | None = None
    "Time of the start of the crossing [s]; by default that of the first pose."

    end: float | None = None
    "Time of the end of the crossing [s]; by default that of the last pose."

    assumed: float | None = None
    "Assumed distance of the start of the plate along the path from the first pose [m]."

    search: float | None = None
    """Greatest distance of the plate from there [m]; by default the whole path is searched; 0 takes
    the assumed place without registration of shift and stretch."""

    stretch: bool = False
    "Whether the measured length of the plate is estimated too, as for a drifting position."

    ride: tuple[float, float] = (0.5, 3.0)
    "Lowest and highest frequency of the primary ride of the vehicle [Hz]."

    hop: tuple[float, float] = (8.0, 16.0)
    "Lowest and highest frequency of its wheel hop [Hz]."

    edge: float = 0.01
    "Distance from a steep face within which an error belongs to an edge [m]."

    screening: Screening = field(default_factory=Screening)
    "Bounds of range and intensity of the returns."

    confidence: float = 0.95
    "Fraction of repeats of the test in which the intervals hold the true value."

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
            message = "search needs assumed, the assumed place of the plate."
            raise ValueError(message)
        if self.begin is not None and self.end is not None and not self.begin < self.end:
            message = f"begin must be before end, got {self.begin} s and {self.end} s."
            raise ValueError(message)


@dataclass(frozen=True, kw_only=True, eq=False)
class DynamicResult:
    """Result of a dynamic test."""

    errors: xr.Dataset
    """Over position s on the machined profile [m]: ``along``, distance along the path, ``up`` as
    measured, ``height`` (registered), ``machined`` (mean over the places of the returns),
    ``error``, ``sd`` of the mean from the scatter of its returns, ``distance`` from the machined
    line [m], ``count``, ``edge`` and ``time`` [s]."""

    row: ResultRow
    "Row of the table."

    registration: Registration
    "Registration of the plate."

    registered: xr.Dataset
    "Means ``up`` of cells ``along`` the path where the plate was found, and was assumed [m]."

    parts: dict[str, float]
    "Mean squares by cause, which add up to that of the error [m²]; see `error_parts`."

    speed: float
    "Mean speed over the plate [m/s]."

    rejection: xr.Dataset
    """Over ``frequency`` [Hz]: spectra ``motion`` (of the laser's height) and ``error`` [m²/Hz],
    ``rejection`` with ``low`` and ``high`` [dB]."""

    findings: tuple[Finding, ...] = ()
    "Findings on single faults; see `Finding`."

    modes: tuple[ErrorMode, ...] = ()
    "Error on plate and floor by the modes of the vehicle, from low to high frequencies."

    @property
    def source(self) -> str:
        """Sentence on the mode from which the error mainly comes."""
        return main_error_source(self.modes)

    def to_dict(self) -> dict[str, Any]:
        """Numbers and strings, ready for JSON, without the single errors."""
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
    """Compare a profile over a calibration plate, measured by a moving vehicle, with the plate.

    Parameters
    ----------
    run : xarray.DataTree or path
        Run over the plate, whose cleats lie across the path.
    machined : xarray.Dataset
        Machined profile of the plate; straight lines join its nodes.
    trajectory : Trajectory
        Motion of the body, by any method.
    settings : DynamicSettings
        Strip, registration, bands and confidence.
    name : str
        Name of the test in the table.

    Returns
    -------
    DynamicResult
        Errors over the plate, accuracy figures, findings and body-motion rejection.

    Raises
    ------
    CoverageError
        If the run does not cross the plate, or it is not found.
    SchemaError
        If the machined profile is not that of a plate, or in another unit.
    ValueError
        If screening needs intensities that were not recorded.

    Notes
    -----
    Returns of a strip are averaged in cells along the path. Each mean is compared with the mean of
    the machined heights at the places of the same returns, so that neither the slope within a cell
    nor the places of the scans cause errors (Figs 3-22, 3-23).

    The motion is the height of the laser at the times of the scans, from the trajectory. Errors at
    edges do not depend on the body; they are interpolated before the spectral analysis. Without
    ``floor`` the record covers the plate only, and frequencies below speed / length are not
    resolved.
    """
    run = open_run(run)
    path = trajectory.between(settings.begin, settings.end)
    with name_file_in_errors(run.source):
        strip = select_strip(run, path, settings)
        # in long cells the mean over a curved flank is biased, which resembles a stretch
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
    row = result_row(
        name, error, edge, distance, noise=noise, registration=found, confidence=settings.confidence
    )
    parts = error_parts(error, errors["sd"].values, edge, np.zeros_like(edge))
    time, along = errors["time"].values, errors["along"].values
    speed = float(np.abs(np.polyfit(time - time.mean(), along - along.mean(), 1)[0]))
    lever = np.array(run.mounting.scanner_position)
    rejection, modes = _crossing_spectra(run.source, table, path, lever, settings)
    findings = dynamic_findings(
        run,
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


def select_strip(
    run: xr.DataTree | str | Path, path: Trajectory, settings: DynamicSettings
) -> dict[str, Floats]:
    """Select the returns of a strip, in the order of their distance along the path.

    ``along`` and ``up`` [m], ``time`` [s] and, if recorded, ``intensity`` of each return.
    """
    origin = path.position[0, :2]
    chord = path.position[-1, :2] - origin
    driven = float(np.hypot(*chord))
    if driven < settings.spacing:
        raise CoverageError(
            f"the vehicle moved by {driven:.3f} m: the run does not cross the plate",
            cure="Use the static test for a vehicle at rest.",
        )
    longitudinal = chord / driven
    lateral = np.array([-longitudinal[1], longitudinal[0]])
    deviation = float(np.abs((path.position[:, :2] - origin) @ lateral).max())
    if deviation > _STRAIGHT * max(1.0, driven):
        raise CoverageError(
            f"the path departs from a straight line by {deviation:.2f} m",
            cure="Name the time of the crossing: begin and end.",
        )
    found: dict[str, list[Floats]] = {}
    for points in georeference(run, path, screening=settings.screening):
        places = np.stack([points.easting.values, points.northing.values], axis=-1) - origin
        inside = np.abs(places @ lateral - settings.offset) <= 0.5 * settings.width
        columns = {
            "along": places @ longitudinal,
            "up": points.up.values,
            "time": points.time.values,
        }
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
    """Mean distance and height of cells along the path [m]."""
    cell = np.floor(strip["along"] / spacing).astype(np.int64)
    first = np.flatnonzero(np.concatenate([[True], np.diff(cell) != 0]))
    count = np.diff(np.concatenate([first, [cell.size]]))
    means = {name: np.add.reduceat(values, first) / count for name, values in strip.items()}
    return {"along": means["along"], "height": means["up"]}


def _compare_cells(
    strip: dict[str, Floats], machined: xr.Dataset, found: Registration, settings: DynamicSettings
) -> xr.Dataset:
    """Compare means of cells on plate and floor with the machined heights at the same places."""
    s = found.positions(strip["along"])
    reach = settings.floor
    kept = np.flatnonzero((s >= -reach) & (s <= found.length + reach))
    order = kept[np.argsort(s[kept], kind="stable")]
    s, along = s[order], strip["along"][order]
    nodes, heights = machined["s"].values - machined["s"].values[0], machined["height"].values
    on = (s >= 0) & (s <= found.length)
    true = np.where(on, np.interp(s, nodes, heights), 0.0)
    height = strip["up"][order] - found.level(along)
    if not on.all():  # the thickness under the plate is unknown: floor heights count from the floor
        height[~on] -= np.median(height[~on])
    cell = np.floor(s / settings.spacing).astype(np.int64)
    first = np.flatnonzero(np.concatenate([[True], np.diff(cell) != 0]))
    count = np.diff(np.concatenate([first, [cell.size]]))

    def mean(values: Floats) -> Floats:
        return np.asarray(np.add.reduceat(values, first) / count)

    error = height - true
    _require_plane(mean(error)[~on[first]], float(np.ptp(heights)))
    deviation = error - np.repeat(mean(error), count)
    single_sd = np.sqrt(mean(deviation**2) * count / np.maximum(count - 1, 1))
    position = mean(s)
    columns = {
        "along": mean(along),
        "up": mean(strip["up"][order]),
        "height": mean(height),
        "machined": mean(true),
        "error": mean(error),
        "sd": single_sd / np.sqrt(count),
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
    if cells < _MIN_CROSSED * length / spacing:
        raise CoverageError(
            f"{cells} of {length / spacing:.0f} places on the plate have heights: the run does not "
            "cross it, or its scans are too far apart",
            cure="Drive slower over the plate, or choose a larger spacing.",
        )


def _require_plane(floor: Floats, plate: float) -> None:
    """Raise if the floor before and after the plate is not plane."""
    max_error = float(np.abs(floor).max(initial=0.0))
    if max_error > _PLANE * plate:
        raise CoverageError(
            f"the floor beside the plate is not plane: it departs by {1000 * max_error:.1f} mm",
            cure="Choose a shorter floor, or 0.",
        )


def _crossing_spectra(
    source: Path | None,
    table: xr.Dataset,
    path: Trajectory,
    lever: Floats,
    settings: DynamicSettings,
) -> tuple[xr.Dataset, tuple[ErrorMode, ...]]:
    """Body-motion rejection over the time of the crossing, and the error by modes."""
    order = np.argsort(table["time"].values)
    time, error = (table[name].values[order] for name in ("time", "error"))
    plain = ~table["edge"].values[order]
    if plain.sum() < MIN_SAMPLES:
        raise CoverageError(
            f"{plain.sum()} places away from edges are too few for a spectrum, needed are "
            f"{MIN_SAMPLES}",
            path=source,
            cure="Choose a smaller spacing or edge, or add floor before and after the plate.",
        )
    even = np.linspace(time[0], time[-1], time.size)
    poses = path.at(even)
    laser = poses.position[:, 2] + poses.rotation.apply(lever)[:, 2]
    bridged = np.interp(even, time[plain], error[plain])
    roll, pitch, _ = to_iso8855(poses.rotation)
    motion = {"heave": poses.position[:, 2], "pitch": pitch, "roll": roll, "the laser": laser}
    return (
        rejection_spectrum(even, laser, bridged, confidence=settings.confidence),
        split_by_mode(even, bridged, motion, ride=settings.ride, hop=settings.hop),
    )
