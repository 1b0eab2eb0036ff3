"""Settings of an import: description of the flat files of a run in TOML."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
import numpy.typing as npt

from trueterrain.core.schemas.run import Mounting
from trueterrain.formats.navigation.columns import NavigationColumns

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class NavigationFiles:
    """Files of the navigation."""

    file: Path
    "SBET file, or table (CSV, Parquet); relative to the description."

    format: Literal["sbet", "table"] = "sbet"
    "Format of the file."

    accuracy: Path | None = None
    "SMRMSG file with the reported standard deviations."

    columns: NavigationColumns | None = None
    "Names of the columns of a table; by default those of the variables of navigation."

    def __post_init__(self) -> None:
        """Check that columns are named for a table only."""
        if self.format == "sbet" and self.columns is not None:
            message = "columns must be named for a table only, got format 'sbet'."
            raise ValueError(message)


@dataclass(frozen=True, kw_only=True)
class ScanTable:
    """A table of ranges: a row per return, or a row per scan.

    With layout ``"returns"`` each row holds the time, the range, and the beam by number or angle.
    With layout ``"scans"`` each row holds the time and the ranges of all beams, in columns named as
    `range` (and `intensity`) followed by the number of the beam: range0, range1, ...
    """

    file: Path
    "Table (CSV, Parquet); relative to the description."

    layout: Literal["returns", "scans"] = "returns"
    "Whether a row is a return or a whole scan."

    angles: tuple[float, ...] = ()
    "Angle of each beam from straight down, positive to the left; or give the next three."

    first_angle: float | None = None
    "Angle of the first beam of a fan with equal steps."

    last_angle: float | None = None
    "Angle of the last beam of a fan with equal steps."

    beams: int | None = None
    "Number of beams of a fan with equal steps."

    degrees: bool = False
    "Whether angles are in degrees, else in radians."

    beam_interval: float = 0.0
    "Time from each beam to the next [s]."

    time: str = "time"
    "Column of the time."

    time_of: Literal["scan", "beam"] = "scan"
    "Whether the time of a row is that of the first beam of its scan, or that of the beam."

    scan: str = ""
    "Column of the number of the scan; without it, a scan begins where the time changes."

    beam: str = ""
    "Column of the number of the beam, from 0; or name the column of the angle."

    angle: str = ""
    "Column of the angle."

    range: str = "range"
    "Column of the range, or the beginning of the names of the columns of ranges."

    intensity: str = ""
    "Column of the intensity, or the beginning of their names; empty: there is none."

    range_scale: float = 1.0
    "Metres per unit of the range."

    time_scale: float = 1.0
    "Seconds per unit of the time."

    no_return: float | None = None
    "Range that means no return, in the unit of the table; 0 and empty cells always do."

    max_range: float = 6.5
    "Largest range of the scanner [m]."

    outside: Literal["error", "drop"] = "error"
    "Treatment of scans before the first or after the last epoch of the navigation."

    def __post_init__(self) -> None:
        """Check that fan and beams are given by exactly one method."""
        even = (self.first_angle, self.last_angle, self.beams)
        if bool(self.angles) == all(value is not None for value in even):
            message = (
                "the fan must be given either by angles or by first_angle, last_angle and beams, "
                f"got {len(self.angles)} angles and {even}."
            )
            raise ValueError(message)
        if self.beams is not None and self.beams < 1:
            message = f"beams must be at least 1, got {self.beams}."
            raise ValueError(message)
        if self.layout == "returns" and bool(self.beam) == bool(self.angle):
            message = f"either beam or angle must name a column, got {self.beam!r}, {self.angle!r}."
            raise ValueError(message)
        for name in ("range_scale", "time_scale"):
            if not getattr(self, name) > 0:
                message = f"{name} must be greater than 0, got {getattr(self, name)}."
                raise ValueError(message)
        if not self.beam_interval >= 0:
            message = f"beam_interval must not be negative, got {self.beam_interval}."
            raise ValueError(message)

    def fan(self) -> tuple[Floats, Floats]:
        """Angle [rad] and delay [s] of each beam."""
        if self.angles:
            angle = np.array(self.angles, dtype=np.float64)
        else:
            assert self.first_angle is not None
            assert self.last_angle is not None
            assert self.beams is not None
            angle = np.linspace(self.first_angle, self.last_angle, self.beams)
        delay: Floats = self.beam_interval * np.arange(angle.size, dtype=np.float64)
        radians: Floats = np.deg2rad(angle) if self.degrees else angle
        return radians, delay


@dataclass(frozen=True, kw_only=True)
class AccelerometerTable:
    """A table of accelerations, a row per sample."""

    file: Path
    "Table (CSV, Parquet); relative to the description."

    time: str = "time"
    "Column of the time."

    columns: tuple[str, ...]
    "Columns of the specific forces along z of the body, a column per sensor."

    positions: tuple[tuple[float, float, float], ...]
    "Position of each sensor in the body frame: forward, left, up [m]."

    scale: float = 1.0
    "Metres per second squared per unit; 9.80665 for g, negative if the axes point down."

    time_scale: float = 1.0
    "Seconds per unit of the time."

    def __post_init__(self) -> None:
        """Check that each column has the position of its sensor."""
        if not self.columns or len(self.columns) != len(self.positions):
            message = (
                f"columns must name one column for each of the positions, got {len(self.columns)} "
                f"and {len(self.positions)}."
            )
            raise ValueError(message)
        if not self.time_scale > 0:
            message = f"time_scale must be greater than 0, got {self.time_scale}."
            raise ValueError(message)


@dataclass(frozen=True, kw_only=True)
class RunFiles:
    """Flat files of a run, and the attributes of the run."""

    name: str
    "Name of the run."

    origin: tuple[float, float, float] | None = None
    """Longitude [deg], latitude [deg], ellipsoidal height [m] of the local frame; by default the
    first position of the navigation."""

    time_reference: Literal["gps", "run"] = "gps"
    "Whether times are seconds of the GPS week, or seconds from an arbitrary epoch."

    navigation: NavigationFiles
    "Files of the navigation."

    scans: ScanTable
    "Table of the scans."

    accelerometers: AccelerometerTable | None = None
    "Table of the accelerations."

    mounting: Mounting = field(default_factory=Mounting)
    "Pose of the scanner in the body frame, and clock offsets of the instruments."
