"""Static test: errors of a scanner at rest above a calibration plate (thesis 3.5.1)."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import CoverageError, name_file_in_errors
from trueterrain.formats.run import Run, open_run, scan_blocks
from trueterrain.georeference import Screening
from trueterrain.verify.findings.common import describe_findings
from trueterrain.verify.findings.finding import Finding
from trueterrain.verify.findings.static import static_findings
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

_MIN_RETURNS = 2  # returns of a beam for a standard deviation
_MIN_HEIGHTS = 20  # on the plate
_STEEP = 0.5  # [rad] slope beyond that of any plate: the value is in degrees


@dataclass(frozen=True, kw_only=True)
class StaticSettings:
    """Settings of a static test."""

    scans: int | None = None
    "Number of scans, from the first one on; by default all."

    min_scans: int = 100
    "Smallest number of scans."

    present: float = 0.5
    "Fraction of the scans in which a beam must have returned to be compared."

    edge: float = 0.005
    "Distance from a steep face within which an error belongs to an edge [m]."

    assumed: float | None = None
    "Assumed start of the plate, to the left of the scanner [m]; by default not known."

    search: float | None = None
    "Greatest distance of the plate from there [m]; by default the whole scan is searched."

    level: float | None = None
    "Slope of the plate by a spirit level, left side up [rad]; None if not known."

    level_sd: float = 0.0002
    "Standard deviation of that slope [rad]; a good level resolves 0.2 mm in 1 m."

    screening: Screening = field(default_factory=Screening)
    "Bounds of range and intensity; results are given with and without flagged returns."

    confidence: float = 0.95
    "Fraction of repeats of the test in which the intervals hold the true value."

    def __post_init__(self) -> None:
        """Check the values."""
        if self.min_scans < _MIN_RETURNS or (self.scans is not None and self.scans < _MIN_RETURNS):
            message = f"scans and min_scans must be at least {_MIN_RETURNS}."
            raise ValueError(message)
        if not 0 < self.present <= 1:
            message = f"present must be greater than 0 and at most 1, got {self.present}."
            raise ValueError(message)
        if not (self.edge >= 0 and math.isfinite(self.edge)):
            message = f"edge must be at least 0 m, got {self.edge}."
            raise ValueError(message)
        if not 0 < self.confidence < 1:
            message = f"confidence must be between 0 and 1, got {self.confidence}."
            raise ValueError(message)
        if self.level is not None and not abs(self.level) < _STEEP:
            message = f"level must be a slope in rad, less than {_STEEP} rad, got {self.level}."
            raise ValueError(message)
        if not (self.level_sd >= 0 and math.isfinite(self.level_sd)):
            message = f"level_sd must be at least 0 rad, got {self.level_sd}."
            raise ValueError(message)
        if self.search is not None and self.assumed is None:
            message = "search needs assumed, the assumed place of the plate."
            raise ValueError(message)


@dataclass(frozen=True, kw_only=True, eq=False)
class StaticResult:
    """Result of a static test."""

    errors: xr.Dataset
    """Over position s on the machined profile [m], in the order of the beams: ``along`` to the left
    of the scanner, ``up`` as measured, ``height`` (registered), ``machined``, ``error``,
    ``sd`` of a single scan, ``sd_mean``, ``distance`` from the machined line [m], ``intensity``
    (mean), ``edge`` and ``flagged``."""

    row: ResultRow
    "Row of the table."

    registration: Registration
    "Registration of the plate."

    registered: xr.Dataset
    "Heights ``up`` over ``along`` on the plate, where it was found and where it was assumed [m]."

    parts: dict[str, float]
    "Mean squares by cause, which add up to that of the error [m²]; see `error_parts`."

    scans: int
    "Number of scans."

    findings: tuple[Finding, ...] = ()
    "Findings on single faults; see `Finding`."

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
        )
        return {
            **self.row.to_dict(),
            "scans": self.scans,
            "registration_found": {name: getattr(found, name) for name in names},
            "parts": {name: math.sqrt(value) for name, value in self.parts.items()},
            "findings": describe_findings(self.findings),
        }


def static_test(
    run: xr.DataTree | str | Path,
    machined: xr.Dataset,
    settings: StaticSettings = StaticSettings(),
) -> list[StaticResult]:
    """Compare the mean of repeated scans of a calibration plate with its machined profile.

    Parameters
    ----------
    run : xarray.DataTree or path
        Run of a scanner at rest.
    machined : xarray.Dataset
        Machined profile of the plate; straight lines join its nodes.
    settings : StaticSettings
        Scans, registration, screening and confidence.

    Returns
    -------
    list of StaticResult
        With all returns and, if the settings screen intensities, without flagged returns.

    Raises
    ------
    CoverageError
        If there are fewer scans than needed, or the plate is not found.
    SchemaError
        If the machined profile is not that of a plate, or in another unit.
    ValueError
        If screening needs intensities that were not recorded.

    Notes
    -----
    Each beam of a scanner at rest meets the same place in every scan. Its mean range over the scans
    gives a height, the standard deviation of its ranges the noise (Fig. 3-17), and the difference
    from the machined height at that place the error (Figs 3-18, 3-19).

    Screened errors are those of returns with good intensity; places whose beam has too few of them
    are left out.
    """
    run = open_run(run)
    have = run["scans"].sizes["scan"]
    wanted = have if settings.scans is None else settings.scans
    needed = max(settings.min_scans, settings.scans or 0)
    if have < needed:
        raise CoverageError(
            f"holds {have} scans, the static test needs {needed}",
            path=run.source,
            place="scans",
            cure="Record more scans, or reduce scans and min_scans.",
        )
    screened = settings.screening
    rows = [("static", Screening(nearest=screened.nearest, furthest=screened.furthest))]
    if screened.needs_intensity:
        rows.append(("static, screened", screened))
    directions = _beam_directions(run.mounting, np.asarray(run["scans/angle"]))
    sums = [_Sums(screening, screened) for _, screening in rows]
    for block in _first_scans(run, wanted):
        for one in sums:
            one.add(block)
    with name_file_in_errors(run.source):
        return [
            _static_result(name, one, sums[0], directions, run, machined, settings, wanted)
            for (name, _), one in zip(rows, sums, strict=True)
        ]


class _Sums:
    """Sums over scans for each beam, relative to its first return to avoid cancellation."""

    def __init__(self, screening: Screening, flag: Screening) -> None:
        self._screening, self._flag = screening, flag
        self._base: Floats | None = None

    def add(self, block: xr.Dataset) -> None:
        ranges = block["range"].values
        intensity = block["intensity"].values if "intensity" in block else None
        weight = self._screening.weights(ranges, intensity)
        if self._base is None:
            beams = ranges.shape[1]
            self._base = np.full(beams, np.nan)
            self.count, self._first, self._second = (np.zeros(beams) for _ in range(3))
            self.bright, self.flagged = np.zeros(beams), np.zeros(beams)
        good = weight > 0
        first = np.take_along_axis(ranges, good.argmax(axis=0)[None], axis=0)[0]
        self._base = np.where(np.isfinite(self._base), self._base, first)
        deviation = np.where(good, ranges - self._base, 0.0)
        weight = np.where(good, weight, 0.0)
        self.count += weight.sum(axis=0)
        self._first += (weight * deviation).sum(axis=0)
        self._second += (weight * deviation**2).sum(axis=0)
        if intensity is not None:
            self.bright += (weight * intensity).sum(axis=0)
            if self._flag.needs_intensity:
                self.flagged += (weight * self._flag.flagged(intensity)).sum(axis=0)

    def means(self) -> tuple[Floats, Floats]:
        """Mean range and standard deviation of a single range, shape (beam,) each [m]."""
        assert self._base is not None
        count = np.where(self.count >= _MIN_RETURNS, self.count, np.nan)
        mean = self._first / count
        variance = (self._second / count - mean**2) * count / (count - 1)
        return self._base + mean, np.sqrt(np.maximum(variance, 0.0))


def _first_scans(run: Run, wanted: int) -> Iterator[xr.Dataset]:
    for block in scan_blocks(run):
        left = wanted - block.attrs["first_scan"]
        if left <= 0:
            return
        yield block.isel(scan=slice(0, left))


def _beam_directions(mounting: Any, angle: Floats) -> Floats:
    """Components to the left and upward of the unit vector of each beam, shape (2, beam)."""
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_euler("ZYX", mounting.scanner_rotation[::-1])
    beams = np.stack([np.zeros_like(angle), np.sin(angle), -np.cos(angle)], axis=-1)
    return np.asarray(turn.apply(beams)[:, 1:].T)


def _static_result(
    name: str,
    sums: _Sums,
    every: _Sums,
    directions: Floats,
    tree: xr.DataTree,
    machined: xr.Dataset,
    settings: StaticSettings,
    scans: int,
) -> StaticResult:
    mean, sd = sums.means()
    good = np.flatnonzero((sums.count >= settings.present * scans) & np.isfinite(mean))
    along, up = mean[good] * directions[:, good]
    found = register_profile(along, up, machined, assumed=settings.assumed, search=settings.search)
    registered = registered_points(along, up, found, settings.assumed)
    s = found.positions(along)
    on = (s >= 0) & (s <= found.length)
    if on.sum() < _MIN_HEIGHTS:
        raise CoverageError(f"holds {on.sum()} heights on the plate, needed are {_MIN_HEIGHTS}")
    good, along, s = good[on], along[on], s[on]
    true = np.interp(s, machined["s"] - machined["s"][0], machined["height"])
    height = up[on] - found.level(along)
    count = sums.count[good]
    noise = sd[good] * np.abs(directions[1, good])
    edge = at_edges(machined, s, settings.edge)
    flagged = sums.flagged[good] > 0.5 * count
    distance = profile_distances(machined, s, height)
    columns = {
        "along": along,
        "up": up[on],
        "height": height,
        "machined": true,
        "error": height - true,
        "distance": distance,
        "sd": noise,
        "sd_mean": noise / np.sqrt(count),
        "intensity": sums.bright[good] / count,
        "edge": edge,
        "flagged": flagged,
    }
    errors = xr.Dataset({key: ("s", value) for key, value in columns.items()}, {"s": s})
    single = float(np.sqrt(np.mean(noise**2)))
    row = result_row(
        name,
        height - true,
        edge,
        distance,
        noise=single,
        registration=found,
        confidence=settings.confidence,
    )
    parts = error_parts(height - true, columns["sd_mean"], edge, flagged)
    beams = slice(int(good.min()), int(good.max()) + 1)
    findings = static_findings(
        tree,
        errors,
        machined,
        found,
        assumed=settings.assumed,
        level=settings.level,
        level_sd=settings.level_sd,
        screening=settings.screening,
        scans=scans,
        returned=every.count[beams],
        flagged=every.flagged[beams],
    )
    return StaticResult(
        errors=errors,
        row=row,
        registration=found,
        parts=parts,
        scans=scans,
        findings=findings,
        registered=registered,
    )
