"""Schema of a run: groups, variables, attributes and the mounting of the instruments."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from trueterrain.core.errors import SchemaError, suggest_name
from trueterrain.core.schemas.navigation import NAVIGATION, SchemaVariable

KIND = "trueterrain/run"

#: Version of the schema below.
SCHEMA = 1

#: Step of stored ranges [m].
QUANTUM = 1e-4

#: Scans in a chunk of a store.
SCAN_CHUNK = 1000

#: Values along time in a chunk of all other arrays.
ROW_CHUNK = 1 << 16

TIME_REFERENCES = ("gps", "run")

SCANS = {
    "time": SchemaVariable(dims=("scan",), units="s"),
    "range": SchemaVariable(dims=("scan", "beam"), units="m"),
    "intensity": SchemaVariable(dims=("scan", "beam"), units="1", required=False),
    "angle": SchemaVariable(dims=("beam",), units="rad"),
    "delay": SchemaVariable(dims=("beam",), units="s"),
}

ACCELEROMETERS = {
    "time": SchemaVariable(dims=("sample",), units="s"),
    "acceleration": SchemaVariable(dims=("sample", "sensor"), units="m/s2"),
    "position": SchemaVariable(dims=("sensor", "axis"), units="m"),
}

GROUPS = {"scans": SCANS, "navigation": NAVIGATION, "accelerometers": ACCELEROMETERS}

_FARTHEST = 50.0  # [m] largest plausible distance of an instrument from the origin of the body
_LATEST = 3600.0  # [s] largest plausible clock offset


@dataclass(frozen=True, kw_only=True)
class Mounting:
    """Pose of the scanner in the body frame, and clock offsets of the instruments.

    True time = stamp of an instrument + its clock offset.

    Examples
    --------
    >>> Mounting(scanner_position=(-1.2, 0.0, 1.9)).scanner_clock
    0.0
    """

    scanner_position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    "Position of the scanner in the body frame: forward, left, up [m]."

    scanner_rotation: tuple[float, float, float] = (0.0, 0.0, 0.0)
    "Roll, pitch, yaw of the scanner in the body [rad]: to body is Rz(yaw) Ry(pitch) Rx(roll)."

    scanner_clock: float = 0.0
    "Clock offset of the scanner [s]: true time less its stamps."

    accelerometer_clock: float = 0.0
    "Clock offset of the accelerometers [s]: true time less their stamps."

    def __post_init__(self) -> None:
        """Check numbers and units."""
        for name, limit, hint in (
            ("scanner_position", _FARTHEST, "metres"),
            ("scanner_rotation", 2 * math.pi, "radians"),
        ):
            values = getattr(self, name)
            if len(values) != 3 or not all(math.isfinite(value) for value in values):
                message = f"{name} must be three numbers, got {values!r}."
                raise ValueError(message)
            if max(map(abs, values)) > limit:
                message = f"{name} must be in {hint} and within {limit:.4g}, got {values!r}."
                raise ValueError(message)
        for name in ("scanner_clock", "accelerometer_clock"):
            value = getattr(self, name)
            if not (math.isfinite(value) and abs(value) <= _LATEST):
                message = f"{name} must be in seconds and within {_LATEST:g}, got {value!r}."
                raise ValueError(message)

    def to_attrs(self) -> dict[str, Any]:
        """Values as in the attributes of a run."""
        return {
            name: [float(part) for part in value]
            if isinstance(value, tuple | list)
            else float(value)
            for name, value in asdict(self).items()
        }

    @classmethod
    def from_attrs(cls, values: Any, *, path: str | Path | None = None) -> "Mounting":
        """Create a mounting from the attribute of a run.

        Parameters
        ----------
        values : mapping
            Value of ``attrs["mounting"]``.
        path : str or Path, optional
            File of the run, for the message.

        Returns
        -------
        Mounting
            Mounting with these values.

        Raises
        ------
        SchemaError
            If a key is missing or unknown, or a value breaks its rule.
        """
        place = "attribute mounting"
        if not isinstance(values, Mapping):
            raise SchemaError(f"must be a table, got {values!r}", path=path, place=place)
        known = [field.name for field in fields(cls)]
        for name in values:
            if name not in known:
                raise SchemaError(
                    f"the key {name!r} is unknown{suggest_name(str(name), known)}; known are "
                    f"{', '.join(known)}",
                    path=path,
                    place=place,
                )
        for name in known:
            if name not in values:
                raise SchemaError(f"the key {name!r} is missing", path=path, place=place)
        plain: dict[str, Any] = {
            name: tuple(value) if isinstance(value, list | tuple) else value
            for name, value in values.items()
        }
        try:
            return cls(**plain)
        except (TypeError, ValueError, OverflowError) as error:
            raise SchemaError(str(error), path=path, place=place) from None
