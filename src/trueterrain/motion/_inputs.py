"""What the fusion takes from a run: navigation and accelerometers in true time, and their gaps."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import CoverageError, SchemaError

Float = npt.NDArray[np.float64]
Span = tuple[float, float]

COORDINATES = ("east", "north", "up", "roll", "pitch", "yaw")

_GAP = 1.5  # usual steps from which on a step is a gap
_FEWEST = 4  # epochs between two gaps that are of use
_JUMP_SPEED = 1.0  # [m/s] from which on a jump of the clock shows in the positions


@dataclass(frozen=True, kw_only=True)
class InstrumentClock:
    """How stamps become true time.

    Examples
    --------
    >>> Clock(offset=0.5, rate=0.001, begin=10.0).true(np.array([20.0]))
    array([20.51])
    """

    offset: float = 0.0
    "What is added to stamps at `begin` [s]."

    rate: float = 0.0
    "Growth of it per second [s/s]."

    begin: float = 0.0
    "Stamp from which on it grows [s]."

    def true(self, stamp: Float) -> Float:
        """True times of stamps [s]."""
        return np.asarray(stamp + self.offset + self.rate * (stamp - self.begin))


@dataclass(frozen=True, kw_only=True, eq=False)
class NavigationInput:
    """Epochs that can be used."""

    time: Float
    "True times, ascending, shape (n,) [s]."

    pose: Float
    "East, north, up [m], roll, pitch, yaw [rad] (yaw without jumps), shape (n, 6)."

    sd: Float
    "Standard deviations as reported, shape (n, 6) [m, rad]; NaN where none was."

    step: float
    "Usual time from epoch to epoch [s]."

    gaps: tuple[Span, ...]
    "Last epoch before and first epoch after each gap [s]."

    dropped: int
    "Epochs that were left out because a value was not finite or they stood alone between gaps."


@dataclass(frozen=True, kw_only=True, eq=False)
class AccelerometerInput:
    """Samples that can be used."""

    time: Float
    "True times, ascending, shape (m,) [s]."

    force: Float
    "Specific force along body z, shape (m, sensor) [m/s^2]."

    position: Float
    "Of each sensor in the body, shape (sensor, 3) [m]."

    step: float
    "Usual time from sample to sample [s]."

    gaps: tuple[Span, ...]
    "Last sample before and first sample after each gap [s]."

    dropped: int
    "Samples that were left out because a value was not finite."


def read_navigation(run: xr.DataTree) -> NavigationInput:
    """Navigation of a run.

    Raises
    ------
    SchemaError
        If times are not finite, do not run forward, or jump.
    CoverageError
        If less than 4 epochs can be used.
    """
    group = _require_group(run, "navigation")
    time = _group_times(group, "navigation")
    pose = np.stack([np.asarray(group[name].values, float) for name in COORDINATES], axis=1)
    sd = np.stack([_reported_sd(group, name, time.size) for name in COORDINATES], axis=1)
    usable = np.isfinite(pose).all(axis=1)
    step = float(np.median(np.diff(time))) if time.size > 1 else 0.0
    usable &= _in_company(time, usable, step)
    if np.count_nonzero(usable) < _FEWEST:
        raise CoverageError(
            f"has {np.count_nonzero(usable)} usable epochs, at least {_FEWEST} are needed",
            place="group navigation",
            cure="Record or export it again.",
        )
    dropped = int(usable.size - np.count_nonzero(usable))
    time, pose, sd = time[usable], pose[usable], sd[usable]
    pose[:, 5] = np.unwrap(pose[:, 5])
    _refuse_jumps(time, pose, step)
    gaps = _find_gaps(time, step)
    return NavigationInput(time=time, pose=pose, sd=sd, step=step, gaps=gaps, dropped=dropped)


def read_accelerometers(run: xr.DataTree, clock: InstrumentClock) -> AccelerometerInput | None:
    """Accelerometers of a run; None if there are none.

    Parameters
    ----------
    run : xarray.DataTree
        The run.
    clock : Clock
        Of the accelerometers, the delay of their filter included.

    Raises
    ------
    SchemaError
        If times are not finite or do not run forward.
    """
    if "accelerometers" not in run.children:
        return None
    group = _require_group(run, "accelerometers")
    time = _group_times(group, "accelerometers")
    force = np.asarray(group["acceleration"].values, dtype=float)
    usable = np.isfinite(force).all(axis=1)
    if np.count_nonzero(usable) < _FEWEST:
        return None
    step = float(np.median(np.diff(time)))
    dropped = int(usable.size - np.count_nonzero(usable))
    time = clock.true(time[usable])
    return AccelerometerInput(
        time=time,
        force=force[usable],
        position=np.asarray(group["position"].values, float),
        step=step,
        gaps=_find_gaps(time, step),
        dropped=dropped,
    )


def inside_spans(time: Float, spans: tuple[Span, ...]) -> npt.NDArray[np.bool_]:
    """Whether each time lies strictly inside of a span."""
    inside = np.zeros(time.size, dtype=bool)
    for begin, end in spans:
        inside |= (time > begin) & (time < end)
    return inside


def _require_group(run: xr.DataTree, name: str) -> xr.Dataset:
    if name not in run.children:
        raise SchemaError("is missing", place=f"group {name}")
    return run[name].to_dataset()


def _group_times(group: xr.Dataset, name: str) -> Float:
    time = np.array(group["time"].values, dtype=float)
    place = f"group {name}, variable time"
    if not np.isfinite(time).all():
        first = int(np.argmin(np.isfinite(time)))
        raise SchemaError(
            f"must be finite everywhere, got {time[first]:g} at index {first}",
            place=place,
            cure="Leave out the records without a time.",
        )
    falls = np.flatnonzero(np.diff(time) <= 0)
    if falls.size:
        at = int(falls[0]) + 1
        raise SchemaError(
            f"must run forward, but value {at} ({time[at]:.6f} s) follows {time[at - 1]:.6f} s",
            place=place,
            cure="Cut the recording there, or correct the jump of its clock.",
        )
    return time


def _reported_sd(group: xr.Dataset, name: str, size: int) -> Float:
    if f"sd_{name}" not in group:
        return np.full(size, np.nan)
    return np.asarray(group[f"sd_{name}"].values, dtype=float)


def _in_company(time: Float, usable: npt.NDArray[np.bool_], step: float) -> npt.NDArray[np.bool_]:
    """Whether an epoch stands among at least 4 without a gap."""
    index = np.flatnonzero(usable)
    company = np.zeros(usable.size, dtype=bool)
    for part in np.split(index, np.flatnonzero(np.diff(time[index]) > _GAP * step) + 1):
        if part.size >= _FEWEST:
            company[part] = True
    return company


def _find_gaps(time: Float, step: float) -> tuple[Span, ...]:
    at = np.flatnonzero(np.diff(time) > _GAP * step)
    return tuple((float(time[k]), float(time[k + 1])) for k in at)


def _refuse_jumps(time: Float, pose: Float, step: float) -> None:
    """Raise a SchemaError where time jumps but the body only moved as in one usual step."""
    speed = np.linalg.norm(np.diff(pose[:, :2], axis=0), axis=1) / np.diff(time)
    for k in np.flatnonzero(np.diff(time) > _GAP * step):
        around = np.concatenate([speed[max(k - 20, 0) : k], speed[k + 1 : k + 21]])
        usual = float(np.median(around))
        length = time[k + 1] - time[k]
        way = speed[k] * length
        as_one_step = abs(way - usual * step)
        as_a_gap = abs(way - usual * length)
        if usual > _JUMP_SPEED and 3 * as_one_step < as_a_gap and as_a_gap > 0.05:
            raise SchemaError(
                f"jumps by {length - step:.6f} s at {time[k]:.6f} s, while the body went on "
                f"{way:.3f} m, as in one step of {step:.6f} s",
                place="group navigation, variable time",
                cure="Correct the jump of its clock, or cut the recording there.",
            )
