"""What the dynamic test looks for besides the size of the error: marks of faults on the motion.

Over plane ground an error that moves with the body is that of the motion, of levers and angles, or
of clocks, and each leaves a mark of its own: a clock that is wrong by a unit adds the vertical
velocity of the laser, a lever arm the rise of the axis of the body along which it is wrong,
accelerometers that read too much the part of the height that comes from them. All marks are fitted
at once, beside what navigation leaves anyhow: a level of plate and floor each, and a slow drift.

Fusion aligns accelerometers with navigation to some 0.1 ms, and each of them reads too much or too
little by some 0.1 %. Both stay the same in a run, so that no spread shows them: they are added.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.georeference import Screening
from trueterrain.motion.trajectory import Trajectory
from trueterrain.verify.findings.common import (
    brightness_finding,
    intensity_finding,
    lost_returns,
    lost_scans,
    plate_place_finding,
    returned_fraction,
    unknown_finding,
)
from trueterrain.verify.findings.finding import CERTAIN, Finding, is_significant
from trueterrain.verify.registration.search import Registration
from trueterrain.verify.statistics.regression import (
    RegressionEstimate,
    project_out,
    regress_signatures,
)

Floats = npt.NDArray[np.float64]

_SLOWEST = 0.4  # [Hz] from which on height is that of the accelerometers
_DRIFT = 4.0  # terms of the drift for every second: what is slower than some 2 Hz
_ALIKE = 0.1  # [s] over which errors of neighbours are alike
_FEWEST = 40  # places away from edges
_LEAST_NOISE = 1e-7  # [m] of what neighbours do not share, that is believed at least
_NEAR = 0.9  # correlation of marks from which they are told apart badly
_JOINT = 19.3  # chi-squared of two marks with the chance of four standard deviations of one


@dataclass(frozen=True, kw_only=True)
class _Fault:
    """A fault that leaves a mark."""

    name: str
    unit: str
    least: float
    "Size that matters."
    seen: float
    "Size that a test must be able to see, to tell that it is not there."
    cure: str
    "What would tell, where the motion was too weak."
    floor: float = 0.0
    "Standard deviation of what fusion itself may be wrong by, alike in all of a run."


_CLOCK = _Fault(
    name="clock of the scanner",
    unit="s",
    least=0.0002,
    seen=0.002,
    floor=0.0001,
    cure="excite the body more: cleats under the wheels beside plate and floor",
)
_SCALE = _Fault(
    name="scale of the accelerometers",
    unit="1",
    least=0.005,
    seen=0.04,
    floor=0.001,
    cure="excite heave and pitch apart from each other: cleats at uneven distances",
)
_LEVER_X = _Fault(
    name="lever arm ahead, or boresight pitch",
    unit="m",
    least=0.005,
    seen=0.02,
    cure="excite pitch: cleats one wheelbase and a half apart",
)
_LEVER_Y = _Fault(
    name="lever arm to the left",
    unit="m",
    least=0.003,
    seen=0.02,
    cure="excite roll: an event with staggered cleats",
)
_FAULTS = (_CLOCK, _SCALE, _LEVER_X, _LEVER_Y)


def dynamic_findings(
    tree: xr.DataTree,
    table: xr.Dataset,
    machined: xr.Dataset,
    found: Registration,
    path: Trajectory,
    lever: Floats,
    *,
    assumed: float | None,
    screening: Screening,
) -> tuple[Finding, ...]:
    """All that is looked for.

    Parameters
    ----------
    tree : xarray.DataTree
        The run.
    table, machined : xarray.Dataset
        Errors on plate and floor, and the machined profile of the plate.
    found : Registration
        Where the plate lies along the way.
    path : Trajectory
        Motion of the body.
    lever : numpy.ndarray, shape (3,)
        Position of the scanner in the body as declared [m].
    assumed, screening
        As the settings say.

    Returns
    -------
    tuple of Finding
        Place, faults that leave marks on the motion, bright ground, flagged intensity, scans and
        returns lost.
    """
    s = table["s"].values
    errors = table.isel(s=np.flatnonzero((s >= 0) & (s <= found.length)))
    plain = errors.isel(s=np.flatnonzero(~errors["edge"].values))
    times = errors["time"].values
    # where the plate lies along the way is as sure as navigation at the crossing
    away = np.array([path.position[-1, :2] - path.position[0, :2]])
    away /= np.linalg.norm(away)
    plan = path.at(np.array([times.mean()])).covariance[0, :2, :2]
    sd_way = math.sqrt(float((away @ plan @ away.T)[0, 0]))
    lost, flagged = returned_fraction(tree, times.min(), times.max(), screening)
    stamps = np.asarray(tree["scans/time"], dtype=np.float64)
    return (
        plate_place_finding(
            errors,
            machined,
            found,
            assumed,
            where=("beyond", "short of"),
            sd=sd_way,
            otherwise=", or a clock, a lever arm ahead or a boresight pitch is wrong",
        ),
        *find_faults(
            table,
            path,
            lever,
            ground=found.offset,
            length=found.length,
            fused="accelerometers" in tree.children,
        ),
        brightness_finding(
            plain["s"].values,
            plain["error"].values,
            plain["intensity"].values if "intensity" in plain else None,
            None,
        ),
        intensity_finding(flagged, screening),
        lost_scans(stamps[(stamps >= path.time[0]) & (stamps <= path.time[-1])]),
        lost_returns(lost),
    )


def find_faults(
    table: xr.Dataset,
    path: Trajectory,
    lever: Floats,
    *,
    ground: float,
    length: float,
    fused: bool,
) -> tuple[Finding, ...]:
    """Faults of clock, accelerometers, levers and angles, by their marks.

    Parameters
    ----------
    table : xarray.Dataset
        Errors on plate and floor: ``error`` [m], ``time`` [s] and ``edge`` over ``s`` [m].
    path : Trajectory
        Motion of the body.
    lever : numpy.ndarray, shape (3,)
        Position of the scanner in the body as declared [m].
    ground : float
        Height of the ground in the frame of the motion [m].
    length : float
        Length of the plate [m].
    fused : bool
        Whether accelerometers had a share in the motion.

    Returns
    -------
    tuple of Finding
        Values of clock and levers are true less declared ones: what is to be added to what the run
        says. That of the scale is by how much accelerometers read too much.
    """
    roll = unknown_finding(
        "boresight roll",
        "rad",
        "A scanner that leans tilts all of the ground alike, and the strip beside the way but "
        "little: the static test with a spirit level tells, or passes in opposite directions.",
    )
    lever_z = unknown_finding(
        "lever arm up",
        "m",
        "A lever arm that is wrong upward lifts all heights alike, which a vehicle on its wheels "
        "cannot tell from the ground: measure it, or compare with surveyed heights.",
    )
    plain = ~table["edge"].values
    faults = [one for one in _FAULTS if fused or one is not _SCALE]
    told = (
        {_SCALE.name: unknown_finding(_SCALE.name, "1", "The run holds no accelerometers.")}
        if not fused
        else {}
    )
    if plain.sum() < _FEWEST:
        for one in faults:
            told[one.name] = unknown_finding(
                one.name, one.unit, "Too few places away from edges: add floor beside the plate."
            )
        return (*(told[one.name] for one in _FAULTS), roll, lever_z)
    order = np.argsort(table["time"].values[plain], kind="stable")
    time, error, s = (table[name].values[plain][order] for name in ("time", "error", "s"))
    marks, high = _fault_signatures(path, time, lever, ground)
    nuisance = _nuisance_functions(time, (s >= 0) & (s <= length))
    alike = round(_ALIKE / max(float(np.median(np.diff(time))), 1e-6))
    lags = min(max(alike, 1), time.size // 8)
    clean = {one.name: project_out(nuisance, marks[one.name]) for one in faults}
    noise = max(float(np.std(np.diff(error))) / math.sqrt(2), _LEAST_NOISE)
    moved = [
        one for one in faults if CERTAIN * noise < one.seen * float(np.linalg.norm(clean[one.name]))
    ]
    for one in faults:
        if one not in moved:
            told[one.name] = unknown_finding(one.name, one.unit, _weak_motion_text(one))
    pairs: list[Finding] = []
    if moved:
        columns = np.stack([marks[one.name] for one in moved], axis=-1)
        fit = regress_signatures(columns, nuisance, error, lags=lags)
        if fused:
            floor = np.diag([one.floor**2 for one in moved])
            fit = replace(fit, covariance=fit.covariance + floor)
        bare = np.stack([clean[one.name] for one in moved])
        for at, one in enumerate(moved):
            told[one.name] = _fault_finding(moved, at, fit, high)
        pairs = _inseparable_faults(moved, told, fit, bare)
    return (*(told[one.name] for one in _FAULTS), *pairs, roll, lever_z)


def _fault_signatures(
    path: Trajectory, time: Floats, lever: Floats, ground: float
) -> tuple[dict[str, Floats], float]:
    """Error that a unit of each fault leaves at some times, and height of the laser over ground."""
    from scipy.signal import butter, sosfiltfilt

    poses = path.at(time)
    arm = poses.rotation.apply(lever)
    turn = poses.rotation.apply(poses.angular_velocity)
    axes = poses.rotation.as_matrix()
    even = np.linspace(path.time[0], path.time[-1], path.time.size)
    every = path.at(even)
    laser = every.position[:, 2] + every.rotation.apply(lever)[:, 2]
    rate = (even.size - 1) / (even[-1] - even[0])
    sections = butter(2, _SLOWEST, "highpass", fs=rate, output="sos")
    pad = min(even.size - 1, int(rate / _SLOWEST))
    fast = sosfiltfilt(sections, laser, padlen=pad)
    marks = {
        _CLOCK.name: -poses.velocity[:, 2] - np.cross(turn, arm)[:, 2],
        _SCALE.name: np.interp(time, even, fast),
        _LEVER_X.name: -axes[:, 2, 0],
        _LEVER_Y.name: -axes[:, 2, 1],
    }
    return marks, float(np.mean(poses.position[:, 2] + arm[:, 2])) - ground


def _nuisance_functions(time: Floats, on: npt.NDArray[np.bool_]) -> Floats:
    """Level of the plate beside that of the floor, and polynomials as slow as navigation drifts."""
    from numpy.polynomial.legendre import legvander

    span = float(time[-1] - time[0])
    degree = min(max(2, math.ceil(_DRIFT * span)), time.size // 8)
    columns = legvander(2 * (time - time[0]) / span - 1, degree)
    if on.all() or not on.any():
        return np.asarray(columns)
    return np.asarray(np.concatenate([columns, on[:, None].astype(np.float64)], axis=1))


def _fault_finding(moved: list[_Fault], at: int, fit: RegressionEstimate, high: float) -> Finding:
    """What the fit says about a fault."""
    one, value, sd = moved[at], float(fit.value[at]), float(fit.sd[at])
    detected = is_significant(value, sd, least=one.least)
    if detected:
        meaning = _meaning_text(one, value, high)
    elif sd * CERTAIN <= one.seen:
        least = _size_text(one, max(one.least, sd * CERTAIN))
        meaning = f"The error bears no mark of more than {least}."
    else:
        return unknown_finding(one.name, one.unit, _weak_motion_text(one))
    return Finding(
        name=one.name, value=value, sd=sd, unit=one.unit, detected=detected, meaning=meaning
    )


def _inseparable_faults(
    moved: list[_Fault], told: dict[str, Finding], fit: RegressionEstimate, bare: Floats
) -> list[Finding]:
    """Faults of which none can be told alone, since another has nearly the same mark."""
    found = []
    likeness = np.atleast_2d(np.corrcoef(bare))
    for at, one in enumerate(moved):
        for other in range(at):
            alike = abs(float(likeness[at, other]))
            names = (moved[other].name, one.name)
            if alike < _NEAR or all(told[name].detected is not None for name in names):
                continue
            pair = [other, at]
            value, covariance = fit.value[pair], fit.covariance[np.ix_(pair, pair)]
            sure = float(value @ np.linalg.solve(covariance, value)) > _JOINT
            effect = float(np.sqrt(np.mean((value @ bare[pair]) ** 2)))
            there = "One of them is there" if sure else "Neither leaves a certain mark"
            found.append(
                Finding(
                    name=" or ".join(names),
                    value=effect,
                    sd=None,
                    unit="m",
                    detected=sure,
                    meaning=f"{there}, {1e3 * effect:.2f} mm of the error; their marks are alike "
                    f"in this motion (correlation {alike:.2f}); to tell which, {one.cure}.",
                )
            )
            for name, it in zip(names, (moved[other], one), strict=True):
                if told[name].detected is None:
                    told[name] = unknown_finding(
                        name,
                        it.unit,
                        "In this motion its mark is like that of another fault: see "
                        f"{' or '.join(names)}.",
                    )
    return found


def _weak_motion_text(one: _Fault) -> str:
    return f"The motion was too weak to tell: {one.cure}."


def _size_text(one: _Fault, value: float) -> str:
    if one.unit == "s":
        return f"{1e3 * value:.2f} ms"
    return f"{100 * value:.2f} %" if one.unit == "1" else f"{1e3 * value:.1f} mm"


def _meaning_text(one: _Fault, value: float, high: float) -> str:
    size, angle = _size_text(one, abs(value)), math.degrees(math.atan2(abs(value), high))
    if one is _CLOCK:
        way = "small" if value > 0 else "large"
        return (
            "The error follows the vertical velocity of the laser: what the mounting adds to the "
            f"stamps of the scanner is {size} too {way} against the motion; or it is the clock of "
            "the accelerometers, if the plate lies in its place."
        )
    if one is _SCALE:
        return (
            f"The error follows the height of the laser: accelerometers read {size} too "
            f"{'much' if value > 0 else 'little'}; calibrate them."
        )
    if one is _LEVER_X:
        where, more = ("behind", "more") if value > 0 else ("ahead", "less")
        return (
            f"The error follows pitch: the scanner is declared {size} {where} of where it sits, or "
            f"to look {angle:.2f} degrees {more} nose-down than it does; heights cannot tell which."
        )
    side = "right" if value > 0 else "left"
    return f"The error follows roll: the scanner is declared {size} to the {side} of its place."
