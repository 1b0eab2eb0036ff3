"""Response of a vehicle to a profile, and its agreement with the response to a reference.

A profile represents the ground well if a vehicle has the same response to both: body
acceleration is the quantity of comfort, tyre force that of durability and road load, suspension
travel that of springs and bump stops.
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import CoverageError, SchemaError
from trueterrain.core.schemas import check_profile
from trueterrain.roughness.filters import require_equal
from trueterrain.vehicle import (
    FullCarParameters,
    LinearModel,
    QuarterCarParameters,
    Response,
    linear_model,
    simulate_response,
)

Float = npt.NDArray[np.float64]

#: Compared quantities: names in the dataset of `vehicle_response`, units and meanings.
QUANTITIES = {
    "body_acceleration": ("m/s^2", "acceleration of the body above the wheel, upward"),
    "tyre_force": ("N", "force of the tyre on the ground beyond the weight at rest"),
    "suspension_travel": ("m", "how far the suspension is longer than at rest"),
}

#: Frequency bands in which responses are compared [Hz]: body ride, greatest sensitivity of humans
#: (ISO 2631-1 weights vertical motion highest from 4 to 8 Hz), wheel hop, and above.
BANDS = ((0.5, 3.0), (3.0, 8.0), (8.0, 20.0), (20.0, 50.0))


def vehicle_response(
    profile: xr.Dataset,
    vehicle: QuarterCarParameters | FullCarParameters,
    *,
    speed: float,
    lead: float = 10.0,
) -> xr.Dataset:
    """Response of a vehicle that follows a profile at constant speed, with point contact.

    Parameters
    ----------
    profile : xarray.Dataset
        Profile, equally spaced. A quarter car drives along each track by itself; a full car needs
        two tracks, the first on its left.
    vehicle : QuarterCarParameters or FullCarParameters
        The vehicle, linear.
    speed : float
        Speed [m/s].
    lead : float
        Length at the start on which the initial motion decays and which is left out [m]. The
        vehicle starts at rest on the heights under its wheels.

    Returns
    -------
    xarray.Dataset
        With dimensions (wheel, time): ``body_acceleration`` above each wheel [m/s²], ``tyre_force``
        less its static value [N] and ``suspension_travel`` [m].

    Raises
    ------
    ValueError
        If `speed` is not greater than 0, `lead` is negative, or a full car has not two tracks.
    SchemaError
        If the profile is not equally spaced.
    CoverageError
        If a height is not finite, or the profile ends within the lead and the wheelbase.

    Notes
    -----
    Heights are linear between samples; for these the motion is exact. Rear wheels follow in the
    track of the front wheels at the distance of the wheelbase. The model is linear: tyres do not
    lift off, and suspensions have no bump stops.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_profile
    >>> from trueterrain.vehicle import GOLDEN_QUARTER_CAR
    >>> s = np.arange(0.0, 60.0, 0.02)
    >>> wave = make_profile(s, 0.01 * np.sin(2 * np.pi * s / 10.0))
    >>> response = vehicle_response(wave, GOLDEN_QUARTER_CAR, speed=20.0, lead=40.0)
    >>> print(f"{float(abs(response.body_acceleration).max()):.2f} m/s²")
    1.30 m/s²
    """
    if not 0 < speed < np.inf:
        message = f"speed must be greater than 0 m/s, got {speed}."
        raise ValueError(message)
    if not 0 <= lead < np.inf:
        message = f"lead must be at least 0 m, got {lead}."
        raise ValueError(message)
    station, tracks, names = _profile_tracks(profile)
    spacing = require_equal(station, "for a vehicle to drive on")
    step = spacing / speed
    model = linear_model(vehicle)
    behind = vehicle.wheelbase if isinstance(vehicle, FullCarParameters) else 0.0
    left_out = int(np.ceil(lead / spacing))
    if station[-1] - station[0] < behind + (left_out + 1) * spacing:
        raise CoverageError(
            f"the profile is {station[-1] - station[0]:g} m long, which leaves nothing behind a "
            f"lead of {lead:g} m" + (f" and a wheelbase of {behind:g} m" if behind else ""),
            cure="Take a longer profile or a shorter lead.",
        )
    if isinstance(vehicle, FullCarParameters):
        if len(tracks) != 2:
            message = f"a full car must have two tracks, left and right, got {len(tracks)}."
            raise ValueError(message)
        wheels: Sequence[str] = model.wheels
        runs = [_full_car(vehicle, model, step, _under_four_wheels(station, tracks, behind))]
    else:
        wheels, runs = names, [_quarter_car(vehicle, model, step, row) for row in tracks]
    data = {
        name: (("wheel", "time"), np.concatenate([run[name] for run in runs])[:, left_out:])
        for name in QUANTITIES
    }
    time = step * np.arange(data["tyre_force"][1].shape[1])
    response = xr.Dataset(data, {"wheel": list(wheels), "time": ("time", time, {"units": "s"})})
    for name, (units, meaning) in QUANTITIES.items():
        response[name].attrs.update(units=units, long_name=meaning)
    return response.assign_attrs(speed=float(speed))


def compare_responses(
    response: xr.Dataset,
    reference: xr.Dataset,
    *,
    bands: Sequence[tuple[float, float]] = BANDS,
    exponent: float = 5.0,
) -> xr.Dataset:
    """Agreement of the response of a vehicle with that on a reference profile.

    Parameters
    ----------
    response, reference : xarray.Dataset
        From `vehicle_response`, of the same vehicle at the same speed over the same road.
    bands : sequence of (float, float)
        Bounds of the frequency bands in which the power is compared [Hz].
    exponent : float
        Slope of the S-N curve, see `pseudo_damage`; 5 is usual for road loads.

    Returns
    -------
    xarray.Dataset
        With dimension quantity: ``rms_ratio``, RMS over that of the reference; ``correlation``;
        ``error``, RMS of the difference over RMS of the reference; ``damage_ratio``, pseudo-damage
        over that of the reference; with dimensions (quantity, band): ``band_ratio``, RMS within
        the band over that of the reference there, NaN for a band that the record does not resolve.

    Raises
    ------
    ValueError
        If a band does not ascend from 0 or more.
    SchemaError
        If the two responses are not of the same wheels and times.

    Notes
    -----
    All wheels are pooled: sums of squares run over wheels and times, after subtraction of the mean
    of each wheel. A squared `band_ratio` is the ratio of the integrals of the two spectral
    densities over that band; these are periodograms with a Hann window over the whole record.

    A signal g times as large as the reference plus independent noise of relative RMS e has
    ``rms_ratio`` sqrt(g² + e²), ``correlation`` g / sqrt(g² + e²) and ``error``
    sqrt((g - 1)² + e²).

    Examples
    --------
    >>> from trueterrain.core.schemas import make_profile
    >>> from trueterrain.vehicle import GOLDEN_QUARTER_CAR
    >>> s = np.arange(0.0, 60.0, 0.02)
    >>> bumps = np.where(s % 12.0 < 0.5, 0.01, 0.0)
    >>> truth, high = (
    ...     vehicle_response(make_profile(s, height), GOLDEN_QUARTER_CAR, speed=20.0)
    ...     for height in (bumps, 1.2 * bumps)
    ... )
    >>> found = compare_responses(high, truth).sel(quantity="tyre_force")
    >>> print(f"{found.rms_ratio:.3f} {found.correlation:.3f} {found.error:.3f}")
    1.200 1.000 0.200
    """
    for low, high in bands:
        if not 0 <= low < high < np.inf:
            message = f"bands must ascend from 0 Hz or more, got {low:g} to {high:g} Hz."
            raise ValueError(message)
    same = response.sizes == reference.sizes and all(
        response[name].equals(reference[name]) for name in ("wheel", "time")
    )
    if not same:
        raise SchemaError(
            "must be of the same wheels and times as the reference, got "
            f"{dict(response.sizes)} and {dict(reference.sizes)}",
            cure="Use the same vehicle and speed, and profiles with the same stations.",
        )
    table = {
        name: _response_agreement(response[name], reference[name], bands, exponent)
        for name in QUANTITIES
    }
    rows = [table[name] for name in QUANTITIES]
    data: dict[str, object] = {
        name: ("quantity", [row[name] for row in rows])
        for name in ("rms_ratio", "correlation", "error", "damage_ratio")
    }
    data["band_ratio"] = ("quantity", "band"), [row["band_ratio"] for row in rows]
    ends = np.asarray(bands, dtype=float).reshape(-1, 2)
    return xr.Dataset(
        data,
        {
            "quantity": list(QUANTITIES),
            "lowest": ("band", ends[:, 0], {"units": "Hz"}),
            "highest": ("band", ends[:, 1], {"units": "Hz"}),
        },
    )


def pseudo_damage(signal: npt.ArrayLike, *, exponent: float = 5.0) -> float:
    """Pseudo-damage of a load: sum of its rainflow cycles, raised to the slope of the S-N curve.

    Parameters
    ----------
    signal : array_like, shape (n,)
        Load, in any unit.
    exponent : float
        Slope of the S-N curve, greater than 0.

    Returns
    -------
    float
        Sum of the amplitudes of all cycles to the power of `exponent`, with half weight for half
        cycles [unit of the load to that power].

    Raises
    ------
    ValueError
        If `exponent` is not greater than 0, or the signal is not one row of finite values.

    Notes
    -----
    Cycles are counted as in ASTM E1049-85 (2017) by the package rainflow, and added by the
    Palmgren-Miner rule. Twice the load gives 2 ** `exponent` times the damage.

    Examples
    --------
    >>> cycles = np.tile([0.0, 1.0, 0.0, -1.0], 10)
    >>> pseudo_damage(cycles[1:], exponent=3.0)  # nine and a half of amplitude 1
    9.5
    """
    from rainflow import extract_cycles

    if not 0 < exponent < np.inf:
        message = f"exponent must be greater than 0, got {exponent}."
        raise ValueError(message)
    values = np.asarray(signal, dtype=float)
    if values.ndim != 1 or not np.isfinite(values).all():
        message = f"signal must be one row of finite values, got shape {values.shape}."
        raise ValueError(message)
    return float(sum(n * (0.5 * size) ** exponent for size, _, n, _, _ in extract_cycles(values)))


def _profile_tracks(profile: xr.Dataset) -> tuple[Float, Float, list[str]]:
    """Stations [m], heights (track, s) [m] and names of the tracks."""
    check_profile(profile)
    names = (
        [str(name) for name in profile["track"].values] if "track" in profile.dims else ["wheel"]
    )
    station = np.asarray(profile["s"], dtype=float)
    heights = np.asarray(profile["height"], dtype=float).reshape(len(names), station.size)
    bad = np.argwhere(~np.isfinite(heights))
    if bad.size:
        track, sample = bad[0]
        raise CoverageError(
            f"has no finite height ({len(bad)} of {heights.size} have none)",
            place=f"track {names[track]}, s = {station[sample]:g} m",
            cure="Fill the gap, or drive before and behind it separately.",
        )
    return station, heights, names


def _under_four_wheels(station: Float, tracks: Float, wheelbase: float) -> Float:
    """Heights under front left, front right, rear left and rear right wheel, (samples, 4) [m]."""
    front = station[station >= station[0] + wheelbase]
    rear = front - wheelbase
    columns = [np.interp(at, station, row) for at in (front, rear) for row in tracks]
    return np.stack(columns, axis=-1)


def _quarter_car(
    car: QuarterCarParameters, model: LinearModel, step: float, heights: Float
) -> dict[str, Float]:
    motion = simulate_response(model, step, heights)
    body, wheel = motion.displacement.T
    force = _tyre_force(
        np.array([car.tyre_stiffness]),
        np.array([car.tyre_damping]),
        step,
        heights[:, None],
        motion,
        slice(1, 2),
    )
    return {
        "body_acceleration": motion.acceleration[None, :, 0],
        "tyre_force": force,
        "suspension_travel": (body - wheel)[None],
    }


def _full_car(
    car: FullCarParameters, model: LinearModel, step: float, heights: Float
) -> dict[str, Float]:
    motion = simulate_response(model, step, heights)
    x, y = car.wheel_positions.T
    above = np.stack(
        [np.ones(4), -x, y]
    )  # height of the body above each wheel by heave, pitch, roll
    stiffness = np.repeat([car.front_tyre_stiffness, car.rear_tyre_stiffness], 2)
    damping = np.repeat([car.front_tyre_damping, car.rear_tyre_damping], 2)
    return {
        "body_acceleration": (motion.acceleration[:, :3] @ above).T,
        "tyre_force": _tyre_force(stiffness, damping, step, heights, motion, slice(3, 7)),
        "suspension_travel": (motion.displacement[:, :3] @ above - motion.displacement[:, 3:]).T,
    }


def _tyre_force(
    stiffness: Float, damping: Float, step: float, heights: Float, motion: Response, wheels: slice
) -> Float:
    """Force of each tyre (wheel, time) [N]; ground rates are backward differences."""
    rate = np.diff(heights, axis=0, prepend=heights[:1]) / step
    spring = stiffness * (heights - motion.displacement[:, wheels])
    damper = damping * (rate - motion.velocity[:, wheels])
    return np.asarray((spring + damper).T)


def _response_agreement(
    response: xr.DataArray,
    reference: xr.DataArray,
    bands: Sequence[tuple[float, float]],
    exponent: float,
) -> dict[str, object]:
    a, b = (
        signal.values - signal.values.mean(axis=1, keepdims=True)
        for signal in (response, reference)
    )
    power_a, power_b = (a**2).sum(), (b**2).sum()
    with np.errstate(divide="ignore", invalid="ignore"):  # a reference without motion
        rms_ratio = np.sqrt(power_a / power_b)
        correlation = (a * b).sum() / np.sqrt(power_a * power_b)
        error = np.sqrt(((a - b) ** 2).sum() / power_b)
        step = float(response.time[1] - response.time[0])
        ratio = [
            np.sqrt(_band_power(a, step, *band) / _band_power(b, step, *band)) for band in bands
        ]
        damage = [sum(pseudo_damage(row, exponent=exponent) for row in rows) for rows in (a, b)]
        damage_ratio = np.float64(damage[0]) / damage[1]
    return {
        "rms_ratio": rms_ratio,
        "correlation": correlation,
        "error": error,
        "band_ratio": ratio,
        "damage_ratio": damage_ratio,
    }


def _band_power(signal: Float, step: float, low: float, high: float) -> np.float64:
    """Power within a band, up to a constant; NaN if the record has no spectral line there."""
    from scipy.signal.windows import hann

    count = signal.shape[1]
    spectrum = np.abs(np.fft.rfft(signal * hann(count, sym=False), axis=1)) ** 2
    frequency = np.fft.rfftfreq(count, step)
    within = (frequency >= low) & (frequency < high)
    return np.float64(spectrum[:, within].sum() if within.any() else np.nan)
