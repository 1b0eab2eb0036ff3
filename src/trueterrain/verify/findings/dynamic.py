"""Findings of the dynamic test: signatures of faults in errors over plane ground.

Over plane ground, an error that moves with the body is caused by the motion, by lever arms and
angles, or by clocks, and each fault has a signature: a clock error adds the vertical velocity of
the laser, an error of a lever arm the vertical component of the body axis along which it lies, a
scale error of the accelerometers the part of the height that comes from them. All signatures are
fitted in one regression, together with the errors that navigation leaves in any case: a level of
the plate and one of the floor, and a slow drift.

Fusion aligns accelerometers with navigation to some 0.1 ms, and their scale is known to some 0.1 %.
Both errors are constant in a run, so that residuals do not show them: their variances are added.
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
from trueterrain.verify.findings.finding import Finding, is_significant
from trueterrain.verify.registration.search import Registration
from trueterrain.verify.statistics.regression import (
    CERTAIN,
    RegressionEstimate,
    project_out,
    regress_signatures,
)

Floats = npt.NDArray[np.float64]

_CROSSOVER = 0.4  # [Hz] above which height comes from the accelerometers
_DRIFT_RATE = 4.0  # polynomial terms of the drift per second: errors slower than some 2 Hz
_CORRELATION_TIME = 0.1  # [s] over which errors of neighbours are correlated
_MIN_PLACES = 40  # places away from edges
_MIN_NOISE = 1e-7  # [m] lower bound of the uncorrelated noise
_INSEPARABLE = 0.9  # correlation of signatures above which they are hardly separable
_JOINT = 19.3  # chi-square of two signatures with the probability of four sd of a single one


@dataclass(frozen=True, kw_only=True)
class _Fault:
    """A fault with a signature in the errors."""

    name: str
    unit: str
    min_size: float
    "Smallest size that matters."
    seen: float
    "Size that a test must be able to observe to exclude the fault."
    cure: str
    "Advice for a motion that was too weak."
    floor: float = 0.0
    "Standard deviation of the error of fusion itself, constant in a run."


_CLOCK = _Fault(
    name="clock of the scanner",
    unit="s",
    min_size=0.0002,
    seen=0.002,
    floor=0.0001,
    cure="excite the body more: cleats under the wheels beside plate and floor",
)
_SCALE = _Fault(
    name="scale of the accelerometers",
    unit="1",
    min_size=0.005,
    seen=0.04,
    floor=0.001,
    cure="excite heave and pitch apart from each other: cleats at uneven distances",
)
_LEVER_X = _Fault(
    name="lever arm ahead, or boresight pitch",
    unit="m",
    min_size=0.005,
    seen=0.02,
    cure="excite pitch: cleats one wheelbase and a half apart",
)
_LEVER_Y = _Fault(
    name="lever arm to the left",
    unit="m",
    min_size=0.003,
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
    """Findings of a dynamic test.

    Parameters
    ----------
    tree : xarray.DataTree
        The run.
    table, machined : xarray.Dataset
        Errors on plate and floor, and the machined profile of the plate.
    found : Registration
        Place of the plate along the path.
    path : Trajectory
        Motion of the body.
    lever : numpy.ndarray, shape (3,)
        Position of the scanner in the body as declared [m].
    assumed, screening
        See `DynamicSettings`.

    Returns
    -------
    tuple of Finding
        Place of the plate, faults with signatures, bright ground, flagged intensity, lost scans and
        lost returns.
    """
    s = table["s"].values
    errors = table.isel(s=np.flatnonzero((s >= 0) & (s <= found.length)))
    plain = errors.isel(s=np.flatnonzero(~errors["edge"].values))
    times = errors["time"].values
    # places along the path have the standard deviation of navigation at the crossing: its
    # horizontal covariance, projected onto the direction of travel
    direction = np.array([path.position[-1, :2] - path.position[0, :2]])
    direction /= np.linalg.norm(direction)
    plan = path.at(np.array([times.mean()])).covariance[0, :2, :2]
    longitudinal_sd = math.sqrt(float((direction @ plan @ direction.T)[0, 0]))
    lost, flagged = returned_fraction(tree, times.min(), times.max(), screening)
    stamps = np.asarray(tree["scans/time"], dtype=np.float64)
    return (
        plate_place_finding(
            errors,
            machined,
            found,
            assumed,
            where=("beyond", "short of"),
            sd=longitudinal_sd,
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
    """Estimate faults of clock, accelerometers, lever arms and angles from their signatures.

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
        Whether the motion is fused with accelerometers.

    Returns
    -------
    tuple of Finding
        Values of clock and lever arms are true less declared values, to be added to those of the
        run. That of the scale is positive for accelerometers that read too much.
    """
    roll = unknown_finding(
        "boresight roll",
        "rad",
        "A roll error tilts all of the ground, and a narrow strip hardly shows it: use the static "
        "test with a spirit level, or passes in opposite directions.",
    )
    lever_z = unknown_finding(
        "lever arm up",
        "m",
        "A vertical lever arm error shifts all heights by a constant, which a vehicle on its "
        "wheels cannot observe: measure it, or compare with surveyed heights.",
    )
    plain = ~table["edge"].values
    faults = [one for one in _FAULTS if fused or one is not _SCALE]
    findings = (
        {_SCALE.name: unknown_finding(_SCALE.name, "1", "The run holds no accelerometers.")}
        if not fused
        else {}
    )
    if plain.sum() < _MIN_PLACES:
        for one in faults:
            findings[one.name] = unknown_finding(
                one.name,
                one.unit,
                "Too few places away from edges: add floor before and after the plate.",
            )
        return (*(findings[one.name] for one in _FAULTS), roll, lever_z)
    order = np.argsort(table["time"].values[plain], kind="stable")
    time, error, s = (table[name].values[plain][order] for name in ("time", "error", "s"))
    signatures, laser_height = _fault_signatures(path, time, lever, ground)
    nuisance = _nuisance_functions(time, (s >= 0) & (s <= length))
    correlated = round(_CORRELATION_TIME / max(float(np.median(np.diff(time))), 1e-6))
    lags = min(max(correlated, 1), time.size // 8)
    clean = {one.name: project_out(nuisance, signatures[one.name]) for one in faults}
    noise = max(float(np.std(np.diff(error))) / math.sqrt(2), _MIN_NOISE)
    moved = [
        one for one in faults if CERTAIN * noise < one.seen * float(np.linalg.norm(clean[one.name]))
    ]
    for one in faults:
        if one not in moved:
            findings[one.name] = unknown_finding(one.name, one.unit, _weak_motion_text(one))
    pairs: list[Finding] = []
    if moved:
        columns = np.stack([signatures[one.name] for one in moved], axis=-1)
        fit = regress_signatures(columns, nuisance, error, lags=lags)
        if fused:
            floor = np.diag([one.floor**2 for one in moved])
            fit = replace(fit, covariance=fit.covariance + floor)
        clean_signatures = np.stack([clean[one.name] for one in moved])
        for at, one in enumerate(moved):
            findings[one.name] = _fault_finding(moved, at, fit, laser_height)
        pairs = _inseparable_faults(moved, findings, fit, clean_signatures)
    return (*(findings[one.name] for one in _FAULTS), *pairs, roll, lever_z)


def _fault_signatures(
    path: Trajectory, time: Floats, lever: Floats, ground: float
) -> tuple[dict[str, Floats], float]:
    """Error by a unit of each fault at some times, and height of the laser above the ground [m]."""
    from scipy.signal import butter, sosfiltfilt

    poses = path.at(time)
    arm = poses.rotation.apply(lever)
    turn = poses.rotation.apply(poses.angular_velocity)
    axes = poses.rotation.as_matrix()
    even = np.linspace(path.time[0], path.time[-1], path.time.size)
    every = path.at(even)
    laser = every.position[:, 2] + every.rotation.apply(lever)[:, 2]
    rate = (even.size - 1) / (even[-1] - even[0])
    sections = butter(2, _CROSSOVER, "highpass", fs=rate, output="sos")
    pad = min(even.size - 1, int(rate / _CROSSOVER))
    fast = sosfiltfilt(sections, laser, padlen=pad)
    # derivatives of the height of a return with respect to each fault
    signatures = {
        _CLOCK.name: -poses.velocity[:, 2] - np.cross(turn, arm)[:, 2],
        _SCALE.name: np.interp(time, even, fast),
        _LEVER_X.name: -axes[:, 2, 0],
        _LEVER_Y.name: -axes[:, 2, 1],
    }
    return signatures, float(np.mean(poses.position[:, 2] + arm[:, 2])) - ground


def _nuisance_functions(time: Floats, on: npt.NDArray[np.bool_]) -> Floats:
    """Columns of the errors of navigation: polynomials in time, and a level of the plate."""
    from numpy.polynomial.legendre import legvander

    span = float(time[-1] - time[0])
    degree = min(max(2, math.ceil(_DRIFT_RATE * span)), time.size // 8)
    columns = legvander(2 * (time - time[0]) / span - 1, degree)
    if on.all() or not on.any():
        return np.asarray(columns)
    return np.asarray(np.concatenate([columns, on[:, None].astype(np.float64)], axis=1))


def _fault_finding(
    moved: list[_Fault], at: int, fit: RegressionEstimate, laser_height: float
) -> Finding:
    """Finding of a fault from its estimate."""
    one, value, sd = moved[at], float(fit.value[at]), float(fit.sd[at])
    detected = is_significant(value, sd, min_size=one.min_size)
    if detected:
        meaning = _meaning_text(one, value, laser_height)
    elif sd * CERTAIN <= one.seen:
        min_size = _size_text(one, max(one.min_size, sd * CERTAIN))
        meaning = f"The error has no signature of more than {min_size}."
    else:
        return unknown_finding(one.name, one.unit, _weak_motion_text(one))
    return Finding(
        name=one.name, value=value, sd=sd, unit=one.unit, detected=detected, meaning=meaning
    )


def _inseparable_faults(
    moved: list[_Fault],
    findings: dict[str, Finding],
    fit: RegressionEstimate,
    signatures: Floats,
) -> list[Finding]:
    """Pairs of faults that are not separable, as their signatures are highly correlated.

    A pair is tested jointly, by the chi-square of both estimates.
    """
    found = []
    correlations = np.atleast_2d(np.corrcoef(signatures))
    for at, one in enumerate(moved):
        for other in range(at):
            correlation = abs(float(correlations[at, other]))
            names = (moved[other].name, one.name)
            observed = all(findings[name].detected is not None for name in names)
            if correlation < _INSEPARABLE or observed:
                continue
            pair = [other, at]
            value, covariance = fit.value[pair], fit.covariance[np.ix_(pair, pair)]
            significant = float(value @ np.linalg.solve(covariance, value)) > _JOINT
            effect = float(np.sqrt(np.mean((value @ signatures[pair]) ** 2)))
            there = "One of them is significant" if significant else "Neither is significant"
            found.append(
                Finding(
                    name=" or ".join(names),
                    value=effect,
                    sd=None,
                    unit="m",
                    detected=significant,
                    meaning=f"{there}, {1e3 * effect:.2f} mm of the error; their signatures are "
                    f"not separable in this motion (correlation {correlation:.2f}); to separate "
                    f"them, {one.cure}.",
                )
            )
            for name, fault in zip(names, (moved[other], one), strict=True):
                if findings[name].detected is None:
                    findings[name] = unknown_finding(
                        name,
                        fault.unit,
                        "In this motion its signature is not separable from that of another "
                        f"fault: see {' or '.join(names)}.",
                    )
    return found


def _weak_motion_text(one: _Fault) -> str:
    return f"The motion was too weak: {one.cure}."


def _size_text(one: _Fault, value: float) -> str:
    if one.unit == "s":
        return f"{1e3 * value:.2f} ms"
    return f"{100 * value:.2f} %" if one.unit == "1" else f"{1e3 * value:.1f} mm"


def _meaning_text(one: _Fault, value: float, laser_height: float) -> str:
    size, angle = _size_text(one, abs(value)), math.degrees(math.atan2(abs(value), laser_height))
    if one is _CLOCK:
        sign = "small" if value > 0 else "large"
        return (
            "The error follows the vertical velocity of the laser: the clock of the scanner in the "
            f"mounting is {size} too {sign} relative to the motion; or the clock of the "
            "accelerometers is wrong, if the plate lies at its place."
        )
    if one is _SCALE:
        return (
            f"The error follows the height of the laser: accelerometers read {size} too "
            f"{'much' if value > 0 else 'little'}; calibrate them."
        )
    if one is _LEVER_X:
        where, more = ("behind", "more") if value > 0 else ("ahead", "less")
        return (
            f"The error follows pitch: the mounting places the scanner {size} {where} of its true "
            f"position, or turns it {angle:.2f} degrees {more} nose-down; heights do not separate "
            "the two."
        )
    side = "right" if value > 0 else "left"
    return (
        f"The error follows roll: the mounting places the scanner {size} to the {side} of its true "
        "position."
    )
