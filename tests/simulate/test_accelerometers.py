from itertools import pairwise

import numpy as np
import numpy.testing as npt
import pytest
from scipy.interpolate import BPoly
from scipy.signal import butter, freqs, group_delay, sos2tf, welch
from scipy.spatial.transform import Rotation

from trueterrain.simulate.accelerometers import (
    Accelerometers,
    AccelerometerStream,
    sensor_triangle,
    specific_force,
)
from trueterrain.simulate.pose import COMPONENTS, PoseKnots
from trueterrain.simulate.rotation import angular_acceleration, angular_velocity, body_to_ground

G = 9.80665  # [m/s^2]
EXACT = 1e-11  # [m/s^2] round-off of forces of up to 100 m/s^2
QUINTIC = 1e-8  # [m/s^2] what a quintic over 1 ms leaves of a sine of up to 3 Hz
# Second derivatives between knots 1 ms apart magnify the round-off of heights of up to 1.4 m:
# 1e-16 x 1.4 m x 60 / (1 ms)^2.
KNOTS = 1e-8  # [m/s^2]
PERFECT = {
    "noise_density": 0.0,
    "bias_sd": 0.0,
    "bias_walk": 0.0,
    "scale_sd": 0.0,
    "tilt_sd": 0.0,
    "filter_order": 0,
    "full_scale": np.inf,
}
NAMES = {name: column for column, name in enumerate(COMPONENTS)}


def moving(seconds, spacing=0.001, **components):
    """Knots of a motion given as value, rate and acceleration of some components."""
    time = np.arange(round(seconds / spacing) + 1) * spacing
    parts = np.zeros((3, time.size, 6))
    for name, motion in components.items():
        for part, values in zip(parts, motion(time), strict=True):
            part[:, NAMES[name]] = values
    return PoseKnots(time=time, pose=parts[0], rate=parts[1], acceleration=parts[2])


def sine(amplitude, frequency):
    w = 2 * np.pi * frequency

    def motion(t):
        s, c = amplitude * np.sin(w * t), amplitude * np.cos(w * t)
        return s, w * c, -w * w * s

    return motion


def constant(value):
    return lambda t: (value, 0.0, 0.0)


def stream(seed=1, **values):
    return AccelerometerStream(Accelerometers(**values), seed=seed)


def random_motion(seconds, spacing=0.5, seed=4):
    rng = np.random.default_rng(seed)
    time = np.arange(round(seconds / spacing) + 1) * spacing
    values = [rng.normal(size=(time.size, 6)) * scale for scale in (1, 2, 5)]
    knots = PoseKnots(time=time, pose=values[0], rate=values[1], acceleration=values[2])
    return knots, BPoly.from_derivatives(time, np.stack(values, axis=1))


POSITIONS = np.array([[-2.0, 0.3, 1.2], [0.5, -0.7, -0.4], [0.0, 0.0, 0.0]])


def test_at_rest_they_read_gravity_along_their_axis():
    for roll, pitch in [(0.0, 0.0), (0.1, 0.0), (0.0, -0.2), (0.3, 0.15)]:
        knots = moving(0.1, roll=constant(roll), pitch=constant(pitch), yaw=constant(2.0))
        force = specific_force(knots, [0.05], POSITIONS)
        npt.assert_allclose(force, G * np.cos(roll) * np.cos(pitch), rtol=0, atol=EXACT)


def test_heave_adds_its_acceleration():
    knots = moving(1.0, up=sine(0.05, 1.3))
    t = np.arange(0, 1, 0.00037)
    w = 2 * np.pi * 1.3
    truth = G - 0.05 * w**2 * np.sin(w * t)
    npt.assert_allclose(
        specific_force(knots, t, POSITIONS), np.tile(truth[:, None], 3), rtol=0, atol=QUINTIC
    )


def test_pitch_adds_tangential_and_centripetal_terms():
    knots = moving(1.0, pitch=sine(0.05, 2.0))
    t = np.arange(0, 1, 0.00037)
    w = 2 * np.pi * 2.0
    pitch, rate = 0.05 * np.sin(w * t), 0.05 * w * np.cos(w * t)
    acceleration = -(w**2) * pitch
    x, _, z = POSITIONS.T
    # Nose down: what lies ahead of the centre falls (tangential), and all is drawn to the centre.
    truth = G * np.cos(pitch)[:, None] - acceleration[:, None] * x - rate[:, None] ** 2 * z
    npt.assert_allclose(specific_force(knots, t, POSITIONS), truth, rtol=0, atol=QUINTIC)


def test_roll_adds_tangential_and_centripetal_terms():
    knots = moving(1.0, roll=sine(0.05, 2.0))
    t = np.arange(0, 1, 0.00037)
    w = 2 * np.pi * 2.0
    roll, rate = 0.05 * np.sin(w * t), 0.05 * w * np.cos(w * t)
    _, y, z = POSITIONS.T
    truth = G * np.cos(roll)[:, None] - (w**2 * roll)[:, None] * y - rate[:, None] ** 2 * z
    npt.assert_allclose(specific_force(knots, t, POSITIONS), truth, rtol=0, atol=QUINTIC)


@pytest.mark.parametrize("banking", [0.0, -0.1])
def test_driving_in_a_circle_on_a_banked_road(banking):
    """To the left at 20 m/s, radius 50 m: 0.8 g; the body leans with the road."""
    radius, speed = 50.0, 20.0
    w = speed / radius

    def quarter(t):  # of the circle, later
        return sine(radius, w / (2 * np.pi))(t + np.pi / (2 * w))

    knots = moving(
        2.0,
        east=sine(radius, w / (2 * np.pi)),
        north=lambda t: tuple(-np.array(quarter(t))),
        yaw=lambda t: (w * t, w, 0.0),
        roll=constant(banking),
    )
    s, c = np.sin(banking), np.cos(banking)
    _, y, z = POSITIONS.T
    # The centre of the circle is on the left; what sits further left turns on a smaller circle.
    truth = G * c - s * w**2 * radius + w**2 * (s * c * y - s * s * z)
    force = specific_force(knots, np.arange(0, 2, 0.013), POSITIONS)
    npt.assert_allclose(force, np.tile(truth, (len(force), 1)), rtol=0, atol=QUINTIC)


def test_specific_force_equals_second_differences_of_the_position_of_the_sensor():
    """Scipy's rotation and polynomials move the sensor; its path is differenced twice."""
    knots, pose = random_motion(10.0)
    rng = np.random.default_rng(2)
    # Within one piece: its ends are not smooth, and differences must not reach across.
    t = rng.integers(0, 20, 200) * 0.5 + rng.uniform(0.05, 0.45, 200)
    axes = rng.normal(size=(3, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]

    def position(time):
        values = pose(time)
        rotation = Rotation.from_euler("ZYX", values[:, :2:-1])
        return values[:, :3, None] + rotation.as_matrix() @ POSITIONS.T

    h = 4e-3  # [s] differences of eighth order: error 1e-8, round-off 1e-15 / h^2 = 1e-10
    weights = {0: -205 / 72, 1: 8 / 5, 2: -1 / 5, 3: 8 / 315, 4: -1 / 560}
    second = sum(
        weight * (position(t + k * h) + position(t - k * h)) / (2 if k == 0 else 1)
        for k, weight in weights.items()
    ) / (h * h)
    second[:, 2] += G
    rotation = Rotation.from_euler("ZYX", pose(t)[:, :2:-1]).as_matrix()
    truth = np.einsum("sc,nbc,nbs->ns", axes, rotation, second)
    force = specific_force(knots, t, POSITIONS, axes=axes)
    npt.assert_allclose(force, truth, rtol=0, atol=1e-6)  # [m/s^2] of up to 150 m/s^2


def test_kernel_equals_the_formula_in_matrices():
    knots, _ = random_motion(5.0)
    t = np.random.default_rng(3).uniform(0, 5, 500)
    pose, rate, acceleration = knots.at(t)
    w = angular_velocity(pose[:, 3:], rate[:, 3:])[:, None]
    dw = angular_acceleration(pose[:, 3:], rate[:, 3:], acceleration[:, 3:])[:, None]
    ground = acceleration[:, :3] + [0, 0, G]
    body = np.einsum("nba,nb->na", body_to_ground(pose[:, 3:]), ground)[:, None]
    truth = body + np.cross(dw, POSITIONS) + np.cross(w, np.cross(w, POSITIONS))
    npt.assert_allclose(specific_force(knots, t, POSITIONS), truth[..., 2], rtol=0, atol=EXACT)


def test_times_at_and_between_all_knots_are_found():
    """Knots that are not quite even, as sums of steps are not."""
    rng = np.random.default_rng(5)
    time = 1e5 + np.cumsum(0.001 + rng.uniform(-1e-4, 1e-4, 2000))
    up = rng.normal(size=(3, 2000))
    parts = np.zeros((3, 2000, 6))
    parts[:, :, 2] = up
    knots = PoseKnots(time=time, pose=parts[0], rate=parts[1], acceleration=parts[2])
    t = np.r_[time, rng.uniform(time[0], time[-1], 3000)]
    truth = knots.at(t)[2][:, 2] + G
    # Accelerations of 1e7 m/s^2 between such knots.
    npt.assert_allclose(specific_force(knots, t, [[0, 0, 0]])[:, 0], truth, rtol=1e-9, atol=1e-6)


def test_perfect_accelerometers_record_the_exact_force():
    knots, _ = random_motion(1.0)
    recorded, truth = stream(**PERFECT, positions=tuple(map(tuple, POSITIONS))).record(
        knots, 0.0, 1.0
    )
    npt.assert_array_equal(recorded["time"], np.arange(2000) / 2000)
    force = specific_force(knots, recorded["time"], POSITIONS)
    npt.assert_allclose(recorded["acceleration"], force, rtol=0, atol=EXACT)
    npt.assert_array_equal(truth["specific_force"], force)
    npt.assert_array_equal(truth["bias"], 0)


def test_an_event_at_t_is_stamped_t_less_clock():
    """A jerk of 1 m/s^3 upwards, so that the force tells the true time."""
    knots = moving(2.0, up=lambda t: (t**3 / 6, t**2 / 2, t))
    parameters = PERFECT | {"clock_offset": 0.05, "clock_rate": 1e-3}
    recorded, truth = stream(**parameters).record(knots, 0.0, 2.0)
    event = recorded["acceleration"][:, 0] - G
    clock = 0.05 + 1e-3 * recorded["time"]
    npt.assert_allclose(recorded["time"], event - clock, rtol=0, atol=KNOTS)  # [s] as [m/s^2]
    npt.assert_allclose(truth["true_time"], event, rtol=0, atol=KNOTS)
    npt.assert_array_equal(recorded["time"], np.arange(-99, -99 + event.size) / 2000)


def test_tilt_turns_the_axis_as_roll_and_pitch_turn_the_body():
    tilt = ((0.02, 0.0), (0.0, 0.03), (-0.01, 0.02))
    for roll, pitch in [(0.1, 0.0), (0.0, 0.1)]:
        knots = moving(0.1, roll=constant(roll), pitch=constant(pitch))
        reading = stream(**PERFECT | {"tilt": tilt}).record(knots, 0.0, 0.1)[0]["acceleration"][0]
        for value, (about_x, about_y) in zip(reading, tilt, strict=True):
            body = Rotation.from_euler("YX", [pitch, roll]).as_matrix()
            axis = Rotation.from_euler("XY", [about_x, about_y]).as_matrix()[:, 2]
            npt.assert_allclose(value, G * (body @ axis)[2], rtol=0, atol=EXACT)
    # A tilt about x adds to roll, one about y to pitch.
    knots = moving(0.1, roll=constant(0.1))
    reading = stream(**PERFECT | {"tilt": tilt}).record(knots, 0.0, 0.1)[0]["acceleration"][0]
    npt.assert_allclose(reading[0], G * np.cos(0.12), rtol=0, atol=EXACT)


def test_scale_and_bias_are_those_given():
    given = {"scale": (0.01, 0.0, -0.02), "bias": (0.1, -0.2, 0.0)}
    recorded, truth = stream(**PERFECT | given).record(moving(0.1), 0.0, 0.1)
    expected = G * (1 + np.array(given["scale"])) + given["bias"]
    npt.assert_allclose(recorded["acceleration"][7], expected, rtol=0, atol=EXACT)
    npt.assert_array_equal(truth["bias"], np.tile(given["bias"], (200, 1)))


MANY = 2000  # sensors: a standard deviation of as many numbers is right within 1 / sqrt(2 MANY)
MOMENT = 4 / np.sqrt(2 * MANY)


def test_constant_errors_have_the_given_standard_deviation():
    values = {"bias_sd": 0.05, "scale_sd": 0.002, "tilt_sd": 0.003}
    sensors = stream(positions=((0.0, 0.0, 0.0),) * MANY, **values)
    for drawn, sd in zip((sensors.bias, sensors.scale, sensors.tilt), values.values(), strict=True):
        npt.assert_allclose(drawn.std() / sd, 1, rtol=0, atol=MOMENT)
        npt.assert_allclose(drawn.mean(), 0, rtol=0, atol=4 * sd / np.sqrt(MANY))
    npt.assert_allclose(np.linalg.norm(sensors.axes, axis=1), 1, rtol=0, atol=1e-15)
    other = AccelerometerStream(sensors.parameters, seed=1, pass_number=3)
    npt.assert_array_equal(other.bias, sensors.bias)  # one instrument in all passes


def test_bias_walks():
    values = PERFECT | {"bias_walk": 0.01, "rate": 50.0, "positions": ((0.0, 0.0, 0.0),) * MANY}
    recorded, truth = stream(**values).record(moving(2.0), 0.0, 2.0)
    walk = truth["bias"]
    npt.assert_array_equal(walk[0], 0)
    for epoch in (1, 50, 99):
        sd = 0.01 * np.sqrt(epoch / 50)
        npt.assert_allclose(walk[epoch].std() / sd, 1, rtol=0, atol=MOMENT)
    npt.assert_allclose(recorded["acceleration"], G + walk, rtol=0, atol=EXACT)


@pytest.mark.parametrize("order", [0, 4])
def test_noise_has_the_density_asked_for(order):
    """200,000 samples of each of three sensors at rest; 50 ug/sqrt(Hz)."""
    values = PERFECT | {"noise_density": 50e-6 * G, "filter_order": order}
    recorded, _ = stream(**values).record(moving(100.0, spacing=1.0), 0.0, 100.0)
    noise = recorded["acceleration"] - G
    f, psd = welch(noise, 2000.0, nperseg=2048, axis=0)
    for low, high in [(1, 20), (20, 100), (100, 250), (600, 900)]:
        band = (f > low) & (f < high)
        # As many squares are averaged as samples x fraction of the band: 3 x 200,000 x fraction.
        bound = 4 * np.sqrt(2 / (600_000 * (high - low) / 1000))
        gain = np.ones(band.sum())
        if order:
            # Noise above the half rate is folded back, through the filter as well.
            b, a = sos2tf(butter(4, 500.0, fs=8000.0, output="sos"))
            folded = [f[band], 2000 - f[band], 2000 + f[band], 4000 - f[band]]
            gain = sum(response(b, a, f_in, 8000.0) ** 2 for f_in in folded)
        ratio = psd[band].mean(axis=1) / ((50e-6 * G) ** 2 * gain)
        npt.assert_allclose(ratio.mean(), 1, rtol=0, atol=bound, err_msg=f"{low} Hz")
    if order:  # at the steady state from the first sample on
        first = [
            stream(seed, **values).record(moving(0.001), 0.0, 0.001)[0]["acceleration"][0] - G
            for seed in range(300)
        ]
        npt.assert_allclose(np.std(first) / noise.std(), 1, rtol=0, atol=4 / np.sqrt(2 * 900))


def response(b, a, f, rate):
    """Magnitude of a digital filter, from its definition."""
    z = np.exp(-2j * np.pi * np.asarray(f) / rate)
    return np.abs(np.polyval(b[::-1], z) / np.polyval(a[::-1], z))


def test_sensors_have_noise_of_their_own():
    noise = stream(**PERFECT | {"noise_density": 0.001}).record(moving(10.0), 0.0, 10.0)[0]
    together = np.corrcoef(noise["acceleration"].T)
    npt.assert_allclose(together, np.eye(3), rtol=0, atol=4 / np.sqrt(20_000))


FILTER = PERFECT | {"filter_order": 4}


@pytest.mark.parametrize(
    ("frequency", "atol"),
    # The bilinear transform bends the response above the cut-off: 1 % of the full scale there.
    [(20.0, 1e-5), (200.0, 1e-4), (500.0, 1e-4), (900.0, 0.012), (1900.0, 0.005)],
)
def test_filter_has_the_response_of_a_butterworth_filter(frequency, atol):
    """Heave of 1 m/s^2 at one frequency; 1900 Hz is folded back to 100 Hz."""
    amplitude = 1 / (2 * np.pi * frequency) ** 2
    knots = moving(0.6, spacing=2.5e-5, up=sine(amplitude, frequency))
    recorded, _ = stream(**FILTER).record(knots, 0.0, 0.6)
    steady = recorded["time"] >= 0.1
    t, reading = recorded["time"][steady], recorded["acceleration"][steady, 0] - G
    # Half a second: whole periods. The acceleration is -sin; stamps see its alias by themselves.
    phasor = 2 * np.mean(reading * np.exp(-2j * np.pi * frequency * t)) / 1j
    b, a = butter(4, 2 * np.pi * 500.0, analog=True)
    truth = freqs(b, a, 2 * np.pi * frequency)[1]
    npt.assert_allclose(np.abs(phasor), np.abs(truth), rtol=0, atol=atol)
    if frequency < 500:  # the delay of 0.821 ms is 0.011 ms less than that of the analogue filter
        npt.assert_allclose(phasor, truth, rtol=0, atol=1e-4 + 2 * np.pi * frequency * 1.2e-5)


@pytest.mark.parametrize(("order", "cutoff"), [(1, 100.0), (2, 400.0), (4, 500.0), (7, 900.0)])
def test_group_delay_is_that_of_the_filter(order, cutoff):
    parameters = Accelerometers(filter_order=order, filter_cutoff=cutoff)
    b, a = sos2tf(butter(order, cutoff, fs=8000.0, output="sos"))
    samples = group_delay((b, a), [0.001], fs=8000.0)[1][0]
    npt.assert_allclose(parameters.group_delay, samples / 8000, rtol=0, atol=1e-9)  # [s]
    assert Accelerometers(filter_order=0).group_delay == 0


def test_slow_motion_is_delayed_by_the_group_delay():
    knots = moving(2.0, up=lambda t: (t**3 / 6, t**2 / 2, t))
    instrument = stream(**FILTER)
    recorded, truth = instrument.record(knots, 0.0, 2.0)
    late = truth["specific_force"][1000:] - recorded["acceleration"][1000:]
    npt.assert_allclose(late, instrument.group_delay, rtol=0, atol=KNOTS)  # a ramp of 1 m/s^3


def test_filter_begins_at_rest():
    given = {"scale": (0.01, 0.0, -0.02), "bias": (0.1, -0.2, 0.0)}
    recorded, _ = stream(**FILTER | given).record(moving(0.1), 0.0, 0.1)
    expected = G * (1 + np.array(given["scale"])) + given["bias"]
    npt.assert_allclose(recorded["acceleration"], np.tile(expected, (200, 1)), rtol=0, atol=1e-9)


def test_readings_are_limited_and_rounded():
    knots = moving(1.0, up=sine(0.5, 1.0))  # 9.8 +- 19.7 m/s^2
    values = PERFECT | {"full_scale": 20.0, "quantum": 0.01}
    recorded, truth = stream(**values).record(knots, 0.0, 1.0)
    reading, force = recorded["acceleration"], truth["specific_force"]
    assert reading.max() == 20.0
    inside = force < 20
    npt.assert_allclose(reading[inside], force[inside], rtol=0, atol=0.005 + EXACT)
    npt.assert_allclose(reading, np.round(reading / 0.01) * 0.01, rtol=0, atol=0)


@pytest.mark.parametrize(
    "values",
    [
        {},
        {"filter_order": 0},
        {"oversampling": 3, "rate": 1111.0, "clock_offset": 0.01, "clock_rate": 1e-5},
        {"filter_order": 7, "filter_cutoff": 50.0, "quantum": 0.001},
    ],
)
def test_blocks_do_not_matter(values):
    """Bit for bit, however a pass is cut, even between the inner samples."""
    knots, _ = random_motion(3.0, spacing=0.01)
    parameters = Accelerometers(**values)
    whole = AccelerometerStream(parameters, seed=3, pass_number=1).record(knots, 0.0, 3.0)
    rng = np.random.default_rng(1)
    for edges in (np.linspace(0, 3, 7), np.r_[0, np.sort(rng.uniform(0, 3, 150)), 3]):
        instrument = AccelerometerStream(parameters, seed=3, pass_number=1)
        blocks = [instrument.record(knots, float(a), float(b)) for a, b in pairwise(edges)]
        for part in (0, 1):
            for name, expected in whole[part].items():
                joined = np.concatenate([block[part][name] for block in blocks])
                npt.assert_array_equal(joined, expected, err_msg=name)


def test_long_blocks_are_computed_in_parts():
    """More inner samples than are computed at a time."""
    knots = moving(10.0, spacing=0.01, up=sine(0.05, 1.0))
    whole = stream().record(knots, 0.0, 10.0).recorded["acceleration"]
    instrument = stream()
    parts = [instrument.record(knots, t, t + 1.0).recorded["acceleration"] for t in np.arange(10.0)]
    npt.assert_array_equal(np.concatenate(parts), whole)


def test_knots_of_a_block_need_only_reach_as_far_as_the_block():
    knots = moving(2.0, up=sine(0.05, 1.0))
    whole = stream().record(knots, 0.0, 2.0).recorded["acceleration"]
    instrument = stream()
    parts = []
    for first, last in [(0, 500), (500, 1100), (1100, 2000)]:
        cut = slice(first, last + 1)
        part = PoseKnots(
            time=knots.time[cut],
            pose=knots.pose[cut],
            rate=knots.rate[cut],
            acceleration=knots.acceleration[cut],
        )
        block = instrument.record(part, knots.time[first], knots.time[last])
        parts.append(block.recorded["acceleration"])
    npt.assert_array_equal(np.concatenate(parts), whole)


def test_seeds_and_passes_have_noise_of_their_own():
    parameters = Accelerometers()
    readings = [
        AccelerometerStream(parameters, seed=seed, pass_number=k)
        .record(moving(0.1), 0.0, 0.1)
        .recorded["acceleration"]
        for seed, k in [(1, 0), (1, 1), (2, 0), (1, 0)]
    ]
    npt.assert_array_equal(readings[0], readings[3])
    assert len({reading.tobytes() for reading in readings}) == 3


def test_a_triangle_is_level_and_even():
    corners = np.array(sensor_triangle((-2.0, 0.1, 1.0), 0.4))
    npt.assert_allclose(corners.mean(axis=0), [-2.0, 0.1, 1.0], rtol=0, atol=EXACT)
    npt.assert_allclose(
        np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1),
        0.4 * np.sqrt(3),
        rtol=0,
        atol=EXACT,
    )
    assert np.ptp(corners[:, 2]) == 0
    with pytest.raises(ValueError, match="radius must be greater than 0"):
        sensor_triangle((0.0, 0.0, 0.0), 0.0)


def test_blocks_must_follow_each_other_and_lie_within_the_knots():
    instrument = stream()
    with pytest.raises(ValueError, match=r"begin must be the end of the last block, 0.0 s"):
        instrument.record(moving(1.0), 0.5, 1.0)
    with pytest.raises(ValueError, match=r"knots must cover 0.0 s to .* got 0.0 s to 1.0 s"):
        instrument.record(moving(1.0), 0.0, 2.0)
    first = instrument.record(moving(1.0), 0.0, 1.0).recorded["acceleration"]
    npt.assert_array_equal(first, stream().record(moving(1.0), 0.0, 1.0).recorded["acceleration"])


def test_specific_force_refuses_what_does_not_fit():
    with pytest.raises(ValueError, match=r"time must be from 0.0 s to 1.0 s, got 0.5 s to 1.5 s"):
        specific_force(moving(1.0), [0.5, 1.5], POSITIONS)
    with pytest.raises(
        ValueError, match=r"positions of shape \(sensor, 3\), got \(1,\) and \(3,\)"
    ):
        specific_force(moving(1.0), [0.5], POSITIONS[0])


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"rate": 0.0}, "rate must be greater than 0, got 0.0"),
        ({"gravity": -9.81}, "gravity must be greater than 0"),
        ({"noise_density": -1.0}, "noise_density must be at least 0, got -1.0"),
        ({"bias_sd": -1.0}, "bias_sd must be at least 0"),
        ({"bias_walk": np.nan}, "bias_walk must be at least 0, got nan"),
        ({"scale_sd": -1.0}, "scale_sd must be at least 0"),
        ({"tilt_sd": -1.0}, "tilt_sd must be at least 0"),
        ({"quantum": -1.0}, "quantum must be at least 0"),
        ({"full_scale": 0.0}, "full_scale must be greater than 0 m/s"),
        ({"positions": (0.0, 1.0, 2.0)}, r"positions must be of shape \(sensor, 3\), got \(3,\)"),
        ({"positions": ()}, r"positions must be of shape \(sensor, 3\), got \(0,\)"),
        ({"positions": ((0.0, 0.0, np.inf),)}, "positions must be finite"),
        ({"bias": (0.1,)}, r"bias must be of shape \(3,\), got \(1,\)"),
        ({"scale": (0.1, 0.1)}, r"scale must be of shape \(3,\), got \(2,\)"),
        ({"tilt": ((0.1, 0.1),)}, r"tilt must be of shape \(3, 2\), got \(1, 2\)"),
        ({"tilt": ((0.1, np.nan),) * 3}, "tilt must be finite"),
        ({"clock_offset": np.nan}, "clock offset must be finite"),
        ({"filter_order": -1}, "filter_order must be a whole number of at least 0, got -1"),
        ({"filter_order": 2.5}, "filter_order must be a whole number"),
        ({"oversampling": 0}, "oversampling must be a whole number of at least 1, got 0"),
        ({"filter_cutoff": 0.0}, "filter_cutoff must be greater than 0"),
        ({"filter_cutoff": 4000.0}, "filter_cutoff must be below half .* 4000.0 Hz, got 4000.0 Hz"),
    ],
)
def test_bad_parameters_are_refused(values, message):
    with pytest.raises(ValueError, match=message):
        Accelerometers(**values)
