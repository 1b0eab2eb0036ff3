"""Arguments of `RunWriter`: checks of shapes, ranges and intensities as stored integers."""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from trueterrain.core.errors import SchemaError
from trueterrain.core.schemas.run import QUANTUM

Array = npt.NDArray[Any]
Floats = npt.NDArray[np.float64]

_STEPS_16 = 2**16 - 1  # the largest integer marks a beam without a return
_STEPS_32 = 2**32 - 1


def quantise_ranges(
    ranges: npt.NDArray[Any], fill: int, first: int, path: Path
) -> npt.NDArray[Any]:
    """Ranges [m] as integers, steps of 0.1 mm; NaN becomes `fill`."""
    steps = np.asarray(ranges, dtype=np.float64) / QUANTUM
    np.rint(steps, out=steps)
    good = (steps >= 1) & (steps < fill)
    if not good.all():
        bad = ~(good | np.isnan(steps))
        if bad.any():
            scan, beam = (int(i) for i in np.argwhere(bad)[0])
            value = ranges[scan, beam]
            cure = "Write NaN where there was no return."
            if value > 0:
                cure = "Give the RunWriter the max_range of the scanner."
            raise SchemaError(
                f"must be greater than 0 m and less than {fill * QUANTUM:.4f} m, got {value:g} m "
                f"at scan {first + scan}, beam {beam}",
                path=path,
                place="scans, variable range",
                cure=cure,
            )
        steps[~good] = fill
    return steps.astype(np.uint16 if fill == _STEPS_16 else np.uint32)


def whole_intensity(intensity: npt.NDArray[Any], first: int, path: Path) -> npt.NDArray[np.uint16]:
    """Intensities as integers; NaN (no return) becomes 0."""
    if intensity.dtype == np.uint16:
        return intensity
    values = (
        np.where(np.isnan(intensity), 0, intensity) if intensity.dtype.kind == "f" else intensity
    )
    bad = ~((values >= 0) & (values <= _STEPS_16) & (values == np.rint(values)))
    if bad.any():
        scan, beam = (int(i) for i in np.argwhere(bad)[0])
        raise SchemaError(
            f"must be a whole number from 0 to {_STEPS_16}, got {intensity[scan, beam]} at scan "
            f"{first + scan}, beam {beam}",
            path=path,
            place="scans, variable intensity",
            cure="Scale and round the intensities.",
        )
    return values.astype(np.uint16)


def fill_of(max_range: float) -> int:
    """Integer that marks a beam without a return: the largest of two or four bytes."""
    if not 0 < max_range < _STEPS_32 * QUANTUM:
        message = (
            f"max_range must be greater than 0 m and less than {_STEPS_32 * QUANTUM:.0f} m, "
            f"got {max_range}."
        )
        raise ValueError(message)
    return _STEPS_16 if max_range < (_STEPS_16 - 0.5) * QUANTUM else _STEPS_32


def require_shape(name: str, values: Array, shape: tuple[int | None, ...]) -> None:
    """Raise a ValueError unless an array has a shape; None stands for any length."""
    fits = len(values.shape) == len(shape) and all(
        wanted in (None, found) for wanted, found in zip(shape, values.shape, strict=True)
    )
    if not fits:
        words = ", ".join("n" if length is None else str(length) for length in shape)
        message = f"{name} must have the shape ({words}), got {values.shape}."
        raise ValueError(message)


def fan_of(angle: npt.ArrayLike, delay: npt.ArrayLike) -> dict[str, Floats]:
    """Angle [rad] and delay [s] of the beams as arrays of equal shape (beam,)."""
    fan = {
        "angle": np.asarray(angle, dtype=np.float64),
        "delay": np.asarray(delay, dtype=np.float64),
    }
    shapes = {name: values.shape for name, values in fan.items()}
    if fan["angle"].ndim != 1 or shapes["angle"] != shapes["delay"]:
        message = (
            f"angle and delay must have the same shape (beam,), got {shapes['angle']} and "
            f"{shapes['delay']}."
        )
        raise ValueError(message)
    return fan


def positions_of(positions: npt.ArrayLike | None) -> Floats | None:
    """Positions of the accelerometers [m], shape (sensor, 3)."""
    if positions is None:
        return None
    values = np.asarray(positions, dtype=np.float64)
    if values.ndim != 2 or values.shape[1] != 3 or not np.isfinite(values).all():
        message = f"accelerometer_positions must have the shape (sensor, 3), got {values.shape}."
        raise ValueError(message)
    return values
