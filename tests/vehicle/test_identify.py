"""Ride and hop from accelerations: the true modes lie within what is stated."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import decimate

from trueterrain.vehicle import (
    GOLDEN_QUARTER_CAR,
    linear_model,
    named_vehicle,
    simulate_response,
    vehicle_modes,
)
from trueterrain.vehicle.identify import (
    ModeRecording,
    identify_modes,
    integrate_acceleration,
    velocity_spectrum,
)

RATE = 500.0  # [Hz]
NOISE = 0.01  # [m/s²] of an accelerometer of 50 ug/sqrt(Hz), sampled at 500 Hz
MODEL = linear_model(GOLDEN_QUARTER_CAR)
MODES = vehicle_modes(MODEL)
TRUTH = np.column_stack([MODES.natural_frequency, MODES.damping_ratio]).ravel()


def sweep(begin, end, seconds, amplitude):
    """Height and acceleration of a shaker that sweeps evenly in Hz/s, led in and out over 2 s."""
    t = np.arange(round(seconds * RATE)) / RATE
    pace = (end - begin) / seconds
    phase, turn = 2 * np.pi * (begin * t + pace / 2 * t**2), 2 * np.pi * (begin + pace * t)

    def fade(t):
        x = np.clip(t / 2.0, 0, 1)
        return (
            x**3 * (10 - 15 * x + 6 * x**2),
            15 * x**2 * (1 - x) ** 2,
            15 * x * (1 - x) * (1 - 2 * x),
        )

    (a, a1, a2), (b, b1, b2) = fade(t), fade(seconds - t)
    w, w1, w2 = a * b, a1 * b - a * b1, a2 * b - 2 * a1 * b1 + a * b2
    up = w * np.sin(phase)
    bend = (w2 - w * turn**2) * np.sin(phase)
    bend += (2 * w1 * turn + w * 2 * np.pi * pace) * np.cos(phase)
    still = np.zeros(1000)
    return [amplitude * np.concatenate([still, part, still]) for part in (up, bend)]


def shaken(rng, begin, *, excitation, signals=("body", "wheel"), seconds=120.0):
    """A sweep of the thesis's shaker procedure, recorded with noise."""
    up, bend = sweep(begin, 30.0, seconds, 0.003)
    moved = dict(
        zip(("body", "wheel"), simulate_response(MODEL, 1 / RATE, up).acceleration.T, strict=True)
    )

    def noisy(values):
        return values + NOISE * rng.standard_normal(values.size)

    return ModeRecording(
        accelerations={name: noisy(moved[name]) for name in signals},
        rate=RATE,
        excitation=noisy(bend) if excitation else None,
        band=(begin * (1.0 if excitation else 1.05), 25.0),
    )


def errors(found):
    """Estimates less the truth, over their standard uncertainties."""
    pairs = [
        pair
        for mode in (found.ride, found.hop)
        for pair in ((mode.frequency, mode.frequency_sd), (mode.damping, mode.damping_sd))
    ]
    values, sd = np.array(pairs).T
    return (values - TRUTH) / sd


def holds(found):
    """Whether the true modes lie within the stated intervals."""
    ends = [
        end
        for mode in (found.ride, found.hop)
        for end in (mode.frequency_interval, mode.damping_interval)
    ]
    return np.array([low <= true <= high for (low, high), true in zip(ends, TRUTH, strict=True)])


@pytest.mark.slow
@pytest.mark.parametrize("excitation", [True, False])
def test_the_two_sweeps_of_the_shaker_procedure(excitation):
    """From 1 and from 6 to 30 Hz, with and without the motion of the shaker recorded."""
    inside = []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        several = [
            shaken(rng, begin, excitation=excitation, seconds=100.0 + 20 * seed)
            for begin in (1.0, 6.0)
        ]
        found = identify_modes(several)
        inside.append(holds(found))
        assert found.ride.frequency_sd < 0.01  # [Hz]
        assert found.hop.frequency_sd < 0.1  # [Hz]
        assert list(found.spectra) == ["1: body", "1: wheel", "2: body", "2: wheel"]
    assert np.mean(inside) >= 11 / 12  # of 12 intervals of 95 %


def test_the_peak_of_velocity_is_not_the_mode():
    """What the thesis reads off Figs. 3-8 and 3-9: near the mode, and wide."""
    found = identify_modes(shaken(np.random.default_rng(1), 1.0, excitation=True))
    body = found.spectra["1: body"]
    near = (body.frequency > 0.9) & (body.frequency < 3)
    peak = body.frequency[near][np.argmax(body.density[near])]
    half = body.frequency[near][body.density[near] > body.density[near].max() / 2]
    assert 0.2 < peak - TRUTH[0] < 0.6  # [Hz] off
    assert np.ptp(half) > 0.3  # [Hz]: as sure as the peak is
    assert np.ptp(found.ride.frequency_interval) < 0.05


@pytest.mark.slow
def test_intervals_on_roads_cover_the_true_modes():
    """40 estimates: their errors are as large as stated, and 95 % intervals hold most of them."""
    scores, inside = [], []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        road = np.cumsum(rng.standard_normal(150_000)) * 2.2e-4
        moved = decimate(
            simulate_response(MODEL, 1 / 1000, road).acceleration, 5, ftype="fir", axis=0
        )
        moved = moved + 0.005 * rng.standard_normal(moved.shape)
        signals = {"body": moved[:, 0], "wheel": moved[:, 1]}
        found = identify_modes(ModeRecording(accelerations=signals, rate=200.0, waviness=2.0))
        scores.append(errors(found))
        inside.append(holds(found))
    assert np.sqrt(np.mean(np.square(scores))) < 1.4  # 40 values, of which some are correlated
    assert np.mean(inside) >= 0.85  # 34 of 40: one in a thousand if 95 % hold


def test_one_signal_alone_is_less_certain():
    rng = np.random.default_rng(4)
    road = np.cumsum(rng.standard_normal(150_000)) * 2.2e-4
    moved = decimate(simulate_response(MODEL, 1 / 1000, road).acceleration, 5, ftype="fir", axis=0)
    alone, both = (
        identify_modes(
            ModeRecording(
                accelerations={name: moved[:, at] for name, at in names.items()},
                rate=200.0,
                waviness=2.0,
            )
        )
        for names in ({"wheel": 1}, {"wheel": 1, "body": 0})
    )
    assert alone.ride.frequency_sd > 3 * both.ride.frequency_sd
    assert holds(both).all()


def test_a_full_car_on_a_road_has_larger_scatter():
    """Body above the front left wheel: pitch and roll are in it, which a quarter car has not."""
    car = named_vehicle("golden car")
    model = linear_model(car)
    rng = np.random.default_rng(2)
    speed, rate = 20.0, 1000.0
    lag = round(car.wheelbase / speed * rate)
    road = np.cumsum(rng.standard_normal((120_000 + lag, 2)), axis=0) * 2e-4
    wheels = np.column_stack([road[lag:], road[:-lag]])
    moved = simulate_response(model, 1 / rate, wheels).acceleration
    x, y = car.wheel_positions[0]
    body = moved[:, 0] - x * moved[:, 1] + y * moved[:, 2]
    signals = {"body": body, "wheel": moved[:, 3]}
    signals = {name: decimate(each, 5, ftype="fir") for name, each in signals.items()}
    found = identify_modes(ModeRecording(accelerations=signals, rate=200.0, waviness=2.0))
    true = vehicle_modes(model)
    low, high = found.hop.frequency_interval
    assert low < true.natural_frequency[true.names.index("front hop")] < high
    bodies = [true.natural_frequency[true.names.index(n)] for n in ("heave", "pitch", "roll")]
    assert min(bodies) - 0.1 < found.ride.frequency < max(bodies) + 0.1


def test_the_fitted_car_is_the_golden_car():
    found = identify_modes(
        [shaken(np.random.default_rng(1), begin, excitation=True) for begin in (1.0, 6.0)]
    )
    car = found.car
    ratios = [car.suspension_stiffness, car.tyre_stiffness, car.suspension_damping]
    assert_allclose(ratios, [63.3, 653.0, 6.0], rtol=0.02, atol=0)
    assert_allclose(car.unsprung_mass, 0.15, rtol=0.02, atol=0)


# --- velocity and spectra


def test_velocity_has_neither_phase_shift_nor_drift():
    t = np.arange(0, 40, 1 / 200)
    rng = np.random.default_rng(1)
    true = 0.2 * np.sin(2 * np.pi * 1.2 * t) + 0.1 * np.sin(2 * np.pi * 11 * t)
    acceleration = 0.2 * 2 * np.pi * 1.2 * np.cos(2 * np.pi * 1.2 * t)
    acceleration += 0.1 * 2 * np.pi * 11 * np.cos(2 * np.pi * 11 * t)
    acceleration += 0.05 + 1e-3 * t + 0.005 * rng.standard_normal(t.size)  # bias, drift, noise
    found = integrate_acceleration(acceleration, 200.0)
    inner = slice(1400, -1400)  # 7 s: two periods of the corner
    assert_allclose(found[inner], true[inner], rtol=0, atol=0.004)  # [m/s] 0.4 % by the corner
    assert abs(found.mean()) < 1e-3


def test_density_of_white_acceleration():
    """One-sided density of a over (2 pi f)², whatever the corner."""
    rng = np.random.default_rng(2)
    noise = rng.standard_normal(200_000)
    found = velocity_spectrum(noise, 200.0, segment=8.0)
    inside = (found.frequency > 1.0) & (found.frequency < 80)
    f = found.frequency[inside]
    truth = 2 / 200.0 / (2 * np.pi * f) ** 2
    assert_allclose(np.mean(found.density[inside] / truth), 1.0, rtol=0, atol=0.01)
    fraction = np.mean((found.low[inside] < truth) & (truth < found.high[inside]))
    assert 0.93 < fraction < 0.97  # of 632 bins, each half as good as alone


# --- what is refused


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ModeRecording(accelerations={}, rate=100.0), "must be of body, wheel or both"),
        (lambda: ModeRecording(accelerations={"seat": np.arange(9)}, rate=100.0), "got .'seat'."),
        (lambda: ModeRecording(accelerations={"body": np.arange(9)}, rate=0.0), "rate must be"),
        (
            lambda: ModeRecording(
                accelerations={"body": np.arange(9), "wheel": np.arange(8)}, rate=100.0
            ),
            "all have one length",
        ),
        (
            lambda: ModeRecording(
                accelerations={"body": np.arange(9)}, excitation=np.arange(8), rate=100.0
            ),
            "all have one length",
        ),
        (lambda: ModeRecording(accelerations={"body": [1.0, np.nan]}, rate=100.0), "body has gaps"),
        (
            lambda: ModeRecording(accelerations={"body": np.arange(9)}, rate=40.0),
            "band must ascend between 0 and half the rate, 20 Hz, got 0.7 to 25 Hz",
        ),
        (lambda: identify_modes([]), "at least one recording"),
        (
            lambda: identify_modes(
                ModeRecording(accelerations={"body": np.arange(90)}, rate=100.0), confidence=1.0
            ),
            "confidence must be",
        ),
        (
            lambda: identify_modes(
                ModeRecording(accelerations={"body": np.arange(90)}, rate=100.0), start=(11.0, 1.0)
            ),
            "start must ascend",
        ),
        (
            lambda: identify_modes(
                ModeRecording(
                    accelerations={"body": np.random.default_rng(1).standard_normal(90)}, rate=100.0
                )
            ),
            "choose longer segments or wider bands",
        ),
        (
            lambda: identify_modes(
                ModeRecording(accelerations={"body": np.arange(900)}, rate=100.0, segment=20.0)
            ),
            "segment must be from 0.16 s to the 9 s recorded, got 20 s",
        ),
        (
            lambda: identify_modes(ModeRecording(accelerations={"body": np.ones(900)}, rate=100.0)),
            "body is constant",
        ),
        (lambda: integrate_acceleration([1.0, np.nan], 100.0), "no gap"),
        (lambda: integrate_acceleration(np.ones(9), 100.0, corner=60.0), "corner must be"),
        (lambda: velocity_spectrum(np.arange(900), 100.0, confidence=0.0), "confidence must be"),
    ],
)
def test_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()
