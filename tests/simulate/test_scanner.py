"""The virtual scanner against intersections in closed form, and its errors against their size."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.testing as npt
import pytest
from scipy.spatial.transform import Rotation

from trueterrain.formats.run import Mounting
from trueterrain.simulate.casting import cast_beams
from trueterrain.simulate.ground import BelgianBlock, Ground, Plane, Step
from trueterrain.simulate.pose import PoseKnots
from trueterrain.simulate.raster import Raster
from trueterrain.simulate.scanner import Reflectivity, Scanner, ScannerStream

ANALYTIC = 1e-7  # [m] what is asked of a noise-free range; bisection reaches round-off
ON_RASTER = 1e-9  # [m] round-off: a beam's end is an exact root in its cell

PERFECT = Scanner(
    range_noise=0.0,
    quantum=0.0,
    intensity_noise=0.0,
    floor=0.0,
    saturation_bias=0.0,
    dropouts=0.0,
    spot_rays=1,
)
HEIGHT = 2.0  # [m] of the standing scanner


@dataclass(frozen=True, kw_only=True)
class Cap(Ground):
    """A sphere cap on a plane."""

    radius: float = 0.5
    rise: float = 0.05

    def _height(self, x, y):
        square = self.radius**2 - x**2 - y**2
        return np.maximum(np.sqrt(np.maximum(square, 0)) - self.radius + self.rise, 0.0)


def standing(duration=0.01, height=HEIGHT):
    """Knots of a body that stands still."""
    time = np.array([-1.0, duration + 1.0])
    pose = np.tile([0.0, 0.0, height, 0.0, 0.0, 0.0], (2, 1))
    return PoseKnots(time=time, pose=pose, rate=0 * pose, acceleration=0 * pose)


def moving(duration=0.2):
    """Knots of a body that drives, heaves, pitches, rolls and turns."""
    t = np.arange(-0.02, duration + 0.03, 1e-3)
    w = np.array([3.0, 2.0, 8.0, 7.0, 5.0, 1.0])
    size = np.array([0.0, 0.1, 0.05, 0.02, 0.03, 0.2])
    phase = w * t[:, None]
    pose = size * np.sin(phase) + [0, 0.3, HEIGHT, 0, 0, 0.4]
    rate, acceleration = size * w * np.cos(phase), -size * w**2 * np.sin(phase)
    pose[:, 0] += 5.0 * t
    rate[:, 0] += 5.0
    return PoseKnots(time=t, pose=pose, rate=rate, acceleration=acceleration)


def ranges(ground, scanner=PERFECT):
    """One scan of a standing scanner."""
    return ScannerStream(scanner, Mounting(), ground, seed=1).record(standing(), 0, 0.001)


def test_a_plane_from_a_standing_scanner():
    slope, camber = 0.03, -0.05
    angle = PERFECT.angle
    # (0, sin, -cos) r + (0, 0, h) on z = camber y
    truth = HEIGHT / (np.cos(angle) + camber * np.sin(angle))
    for ground in (Plane(slope=slope, camber=camber), Raster(Plane(slope=slope, camber=camber))):
        npt.assert_allclose(ranges(ground).true_range[0], truth, rtol=0, atol=ANALYTIC)


def test_a_step_from_a_standing_scanner():
    """Top of the step, its wall, or the ground below: whichever a beam meets first."""
    at, rise, angle = 0.7, 0.1, PERFECT.angle
    step = Step(position=at, rise=-rise, direction=np.pi / 2)  # falls off to the left
    top, below = HEIGHT / np.cos(angle), (HEIGHT + rise) / np.cos(angle)
    truth = np.where(top * np.sin(angle) < at, top, below)
    npt.assert_allclose(ranges(step).true_range[0], truth, rtol=0, atol=ANALYTIC)

    step = Step(position=at, rise=rise, direction=np.pi / 2)  # rises to the left
    top, below = (HEIGHT - rise) / np.cos(angle), HEIGHT / np.cos(angle)
    with np.errstate(divide="ignore"):
        wall = at / np.sin(angle)
    truth = np.select([top * np.sin(angle) >= at, below * np.sin(angle) < at], [top, below], wall)
    assert np.count_nonzero(truth == wall) >= 10  # the wall is seen
    npt.assert_allclose(ranges(step).true_range[0], truth, rtol=0, atol=ANALYTIC)


def test_a_sphere_cap_from_a_standing_scanner():
    cap, angle = Cap(), PERFECT.angle
    plane = HEIGHT / np.cos(angle)
    centre = HEIGHT - (cap.rise - cap.radius)  # below the scanner
    root = (centre * np.cos(angle)) ** 2 - centre**2 + cap.radius**2
    sphere = np.where(root > 0, centre * np.cos(angle) - np.sqrt(np.maximum(root, 0)), np.inf)
    truth = np.minimum(plane, sphere)
    assert np.count_nonzero(truth < plane) > 50
    npt.assert_allclose(ranges(cap).true_range[0], truth, rtol=0, atol=ANALYTIC)
    # a raster of 1 mm is below its sphere by at most spacing^2 / 4 R, on a beam by 1 / cos of that
    raster = ranges(Raster(cap, spacing=0.001)).true_range[0]
    npt.assert_allclose(raster, truth, rtol=0, atol=1.5 * 0.001**2 / 4 / cap.radius)


def test_beams_and_spacing_are_those_of_the_thesis():
    """Thesis 2.2: 940 points over 4 m, 1000 scans a second, 5 mm apart at 5 m/s."""
    across = HEIGHT * np.tan(PERFECT.angle)
    assert across.size == 940
    npt.assert_allclose(across[-1] - across[0], 4.0, rtol=0, atol=1e-12)
    knots = moving()
    scans = ScannerStream(PERFECT, Mounting(), Raster(Plane()), seed=1).record(knots, 0, 0.1)
    assert scans.range.shape == (100, 940)
    npt.assert_allclose(np.diff(scans.time) * 5.0, 0.005, rtol=0, atol=1e-12)


def test_points_lie_closest_below_the_scanner():
    """Fig. 2-3: equal angles are unequal distances, 1 / cos^2 of the angle."""
    spacing = np.diff(HEIGHT * np.tan(PERFECT.angle))
    npt.assert_allclose(spacing.max() / spacing.min(), 2.0, rtol=0, atol=0.01)  # at 45 degrees
    assert spacing.argmin() in (469, 470)


@pytest.mark.parametrize("offset", [0.5, 1.0, 1.5, 1.9])
def test_the_largest_slope_that_is_seen(offset):
    """Figs. 3-13, 3-14: a face that falls away is seen down to the slope of the beam itself."""
    limit = np.arctan2(HEIGHT, offset)  # [rad] of the face, from level
    seen = {}
    for name, slope in (("flatter", limit - 0.05), ("steeper", limit + 0.05)):
        ground = Step(position=offset, rise=-0.3, width=0.3 / np.tan(slope), direction=np.pi / 2)
        found = ranges(ground).true_range[0]
        depth = found * np.cos(PERFECT.angle) - HEIGHT
        seen[name] = np.count_nonzero((depth > 0.002) & (depth < 0.298))
    assert seen["flatter"] > 0
    assert seen["steeper"] == 0


def test_ground_behind_a_wall_is_in_its_shadow():
    angle = PERFECT.angle
    wall = Step(position=0.5, rise=0.2, direction=np.pi / 2) + Step(
        position=0.6, rise=-0.2, direction=np.pi / 2
    )
    across = ranges(wall).true_range[0] * np.sin(angle)
    shadow = 0.6 * HEIGHT / (HEIGHT - 0.2)  # where the beam over the far edge comes down
    assert not np.any((across > 0.6 + 1e-6) & (across < shadow - 1e-6))


@pytest.mark.parametrize("ground", [BelgianBlock(seed=4), Plane(slope=0.02, camber=0.01)])
def test_a_moving_scan_lies_on_the_ground(ground):
    """Georeferenced here with scipy alone: every beam at its own time, mounted askew."""
    raster = Raster(ground, spacing=0.005)
    mounting = Mounting(
        scanner_position=(-1.2, 0.1, 0.15),
        scanner_rotation=(0.02, -0.03, 0.05),
        scanner_clock=0.004,
    )
    knots = moving()
    scans = ScannerStream(PERFECT, mounting, raster, seed=1, begin=0.05).record(knots, 0.05, 0.15)
    time = ((scans.time + mounting.scanner_clock)[:, None] + PERFECT.delay).ravel()
    pose, _, _ = knots.at(time)
    angle = np.tile(PERFECT.angle, scans.time.size)
    beam = np.stack([0 * angle, np.sin(angle), -np.cos(angle)], axis=1)
    beam = Rotation.from_euler("ZYX", mounting.scanner_rotation[::-1]).apply(beam)
    beam *= scans.range.reshape(-1, 1)
    body = Rotation.from_euler("ZYX", pose[:, [5, 4, 3]])
    point = pose[:, :3] + body.apply(np.array(mounting.scanner_position) + beam)
    assert np.isfinite(point).all()
    truth = raster.height(point[:, 0], point[:, 1])
    npt.assert_allclose(point[:, 2], truth, rtol=0, atol=ON_RASTER)


def test_the_first_intersection_is_met():
    """Beams of any direction on rough ground, against a march of 0.2 mm."""
    raster = Raster(BelgianBlock(seed=5), spacing=0.01)
    rng = np.random.default_rng(1)
    direction = rng.normal(size=(100, 3)) * [1, 1, 0.3]
    direction[:, 2] = -np.abs(direction[:, 2]) - 0.2
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    origin = np.array([0.3, -0.4, 0.3]) + rng.uniform(-1, 1, (100, 3)) * [1, 1, 0.1]
    distance, _ = cast_beams(raster, origin, direction, max_distance=2.0)
    at = np.arange(0, 2.0, 2e-4)
    for n in range(len(origin)):
        point = origin[n] + at[:, None] * direction[n]
        below = point[:, 2] < raster.height(point[:, 0], point[:, 1]) - 1e-12
        if not below.any():
            # a graze of less than 0.2 mm may be between the steps of the march
            assert np.isnan(distance[n]) or distance[n] > 1.99
            continue
        assert distance[n] <= at[below.argmax()] + 1e-9
        met = origin[n] + distance[n] * direction[n]
        npt.assert_allclose(met[2], raster.height(met[0], met[1]), rtol=0, atol=ON_RASTER)


def test_a_beam_into_the_sky_meets_nothing():
    up = np.array([[0.6, 0.0, 0.8]])
    for ground in (Raster(Plane()), Plane()):
        assert np.isnan(cast_beams(ground, np.array([[0.0, 0.0, 1.0]]), up, max_distance=3.0)[0][0])


def test_range_noise_quantum_and_dropouts_have_their_size():
    scanner = Scanner(
        range_noise=0.0005,
        quantum=0.0001,
        dropouts=0.01,
        floor=0.0,
        saturation_bias=0.0,
        spot_rays=1,
    )
    stream = ScannerStream(scanner, Mounting(), Raster(Plane()), seed=3)
    scans = stream.record(standing(0.2), 0, 0.1)
    lost = np.isnan(scans.range)
    n = lost.size
    # 94,000 returns: 1 % of them is known within sqrt(p (1 - p) / n), a sd within 1 / sqrt(2 n)
    assert abs(lost.mean() - 0.01) < 4 * np.sqrt(0.01 * 0.99 / n)
    error = (scans.range - scans.true_range)[~lost]
    sd = np.hypot(0.0005, 0.0001 / np.sqrt(12))
    assert abs(error.std() / sd - 1) < 4 / np.sqrt(2 * n)
    assert abs(error.mean()) < 4 * sd / np.sqrt(n)
    npt.assert_allclose(scans.range[~lost] % 0.0001 % 0.0001, 0, rtol=0, atol=0.0001)
    steps = scans.range[~lost] / 0.0001
    npt.assert_allclose(steps, np.rint(steps), rtol=0, atol=1e-6)


def test_bright_stripes_saturate_and_bias_the_range():
    """Thesis 3.5.1: the range is wrong where the receiver saturates."""
    scanner = Scanner(
        range_noise=0.0,
        quantum=0.0,
        intensity_noise=0.0,
        dropouts=0.0,
        gain=40000.0,
        saturation=20000.0,
        saturation_bias=-0.002,
        spot_rays=1,
    )
    stripes = Reflectivity(ground=0.3, stripe=1.0, period=0.5, width=0.1, direction=np.pi / 2)
    stream = ScannerStream(scanner, Mounting(), Plane(), reflectivity=stripes, seed=1)
    scans = stream.record(standing(), 0, 0.001)
    across = scans.true_range[0] * np.sin(scanner.angle)
    bright = np.mod(across, 0.5) < 0.1
    assert scans.intensity[0][bright & (np.abs(across) < 0.5)].min() == 20000
    expected = 40000 * np.cos(scanner.angle) ** 3 * np.where(bright, 1.0, 0.3)
    npt.assert_allclose(
        scans.bias[0], -0.002 * np.maximum(expected / 20000 - 1, 0), rtol=0, atol=1e-9
    )
    npt.assert_allclose(scans.range - scans.true_range, scans.bias, rtol=0, atol=1e-12)


def test_dark_ground_is_lost_below_the_floor():
    scanner = Scanner(intensity_noise=0.0, floor=500.0, dropouts=0.0)
    stream = ScannerStream(
        scanner, Mounting(), Plane(), reflectivity=Reflectivity(ground=0.01), seed=1
    )
    assert np.isnan(stream.record(standing(), 0, 0.001).range).all()


def test_a_spot_averages_over_its_extent():
    """A stone narrower than the spot is seen at the part of the spot that it fills."""
    ridge = Step(position=-0.001, rise=0.01, direction=0.0) + Step(
        position=0.001, rise=-0.01, direction=0.0
    )
    point = ranges(ridge).true_range[0, 470]
    spot = ranges(ridge, Scanner(**{**vars(PERFECT), "spot_rays": 5})).true_range[0, 470]
    npt.assert_allclose(HEIGHT - point, 0.01, rtol=0, atol=1e-4)
    npt.assert_allclose(HEIGHT - spot, 0.01 / 5, rtol=0, atol=1e-4)  # one ray of five


def test_a_spot_on_a_plane_is_a_point():
    """Rays to either side cancel; what is left is their slant, spot^2 / 8 range at most."""
    point = ranges(Raster(Plane(slope=0.05))).true_range
    spot = ranges(
        Raster(Plane(slope=0.05)), Scanner(**{**vars(PERFECT), "spot_rays": 5})
    ).true_range
    npt.assert_allclose(spot, point, rtol=0, atol=0.01**2 / 8 / HEIGHT)


def test_the_size_of_a_block_changes_nothing():
    both = Scanner(), Mounting()
    raster = Raster(BelgianBlock(seed=6))
    whole = ScannerStream(*both, raster, seed=9).record(moving(), 0, 0.15)
    stream = ScannerStream(*both, Raster(BelgianBlock(seed=6)), seed=9)
    edges = [0, 0.013, 0.05, 0.0501, 0.15]
    parts = [stream.record(moving(), a, b) for a, b in pairwise(edges)]
    for name in ("time", "range", "intensity", "true_range", "bias"):
        joined = np.concatenate([getattr(part, name) for part in parts])
        npt.assert_array_equal(joined, getattr(whole, name))


def test_true_time_is_stamp_plus_clock():
    """The ground jumps up at a station that is passed at a known time."""
    step = Step(position=0.5, rise=0.1)
    mounting = Mounting(scanner_clock=0.02)
    knots = moving()
    knots.pose[:, 1:] = [0, HEIGHT, 0, 0, 0]
    knots.rate[:, 1:] = knots.acceleration[:, 1:] = 0
    scans = ScannerStream(PERFECT, mounting, Raster(step), seed=1, begin=0.02).record(
        knots, 0.02, 0.18
    )
    middle = PERFECT.beams // 2
    up = scans.true_range[:, middle] < HEIGHT - 0.05
    stamp = scans.time[up.argmax()]
    passed = 0.5 / 5.0 - PERFECT.delay[middle]
    assert 0 <= stamp + mounting.scanner_clock - passed <= 0.001


@pytest.mark.parametrize(
    ("name", "value", "rule"),
    [
        ("beams", 1, "at least 2"),
        ("rate", 0.0, "greater than 0"),
        ("range_noise", -1.0, "at least 0"),
        ("duty", 1.5, "at most 1"),
        ("dropouts", 1.0, "less than 1"),
        ("spot_rays", 4, "odd"),
        ("nominal_height", float("nan"), "greater than 0"),
    ],
)
def test_an_impossible_scanner_is_refused(name, value, rule):
    with pytest.raises(ValueError, match=f"{name} must be .*{rule}"):
        Scanner(**{name: value})


def test_a_motion_that_is_too_short_is_refused():
    with pytest.raises(ValueError, match="before the last beam"):
        ScannerStream(PERFECT, Mounting(), Plane(), seed=1).record(standing(), 0, 5.0)


@pytest.mark.slow
@pytest.mark.parametrize("rays", [3, 5])
def test_a_spot_is_the_mean_of_its_rays(rays):
    """On rough ground, against the same rays cast one by one."""
    raster = Raster(BelgianBlock(seed=5), spacing=0.01)
    rng = np.random.default_rng(2)
    turn = Rotation.from_euler("ZYX", rng.normal(size=(300, 3)) * [3.0, 0.3, 0.3])
    direction, forward = turn.apply([0.0, 0.0, -1.0]), turn.apply([1.0, 0.0, 0.0])
    origin = np.array([0.3, -0.4, 1.5]) + rng.uniform(-1, 1, (300, 3)) * [2, 2, 0.1]
    spot = 0.02 * rng.normal(size=(rays, 2))
    spot[rays // 2] = 0.0
    distance, slope = cast_beams(
        raster, origin, direction, max_distance=6.0, forward=forward, spot=spot
    )
    beside = np.cross(forward, direction)
    each = [
        cast_beams(raster, origin, direction + a * forward + b * beside, max_distance=6.0)
        for a, b in spot
    ]
    truth = np.mean([one for one, _ in each], axis=0)
    npt.assert_allclose(distance, truth, rtol=0, atol=1e-12)
    npt.assert_array_equal(slope, each[rays // 2][1])
    assert np.ptp([one for one, _ in each], axis=0).max() > 0.01  # the rays differ
    # ground that is no raster is averaged over likewise
    down = direction[:, 2] < -0.8
    assert np.count_nonzero(down) > 100
    beams = origin[down], direction[down]
    on_plane = [
        cast_beams(ground, *beams, max_distance=2.5, forward=forward[down], spot=spot)[0]
        for ground in (Plane(slope=0.1), Raster(Plane(slope=0.1)))
    ]
    npt.assert_allclose(on_plane[0], on_plane[1], rtol=0, atol=ON_RASTER)


def test_tiles_of_one_request_are_computed_once(monkeypatch):
    monkeypatch.setattr("trueterrain.simulate.raster._MAX_TILES", 3)
    made = []

    class Counted(Plane):
        def _height(self, x, y):
            made.append(x.size)
            return super()._height(x, y)

    raster = Raster(Counted())
    requested = [(column, row) for column in range(3) for row in range(3)]
    for tiles in (requested, [*requested, (3, 3)]):
        assert raster.tiles(tiles).height.shape[0] == len(tiles)
    assert len(made) == len(requested) + 1
    raster.tiles([(5, 5)])  # only three are kept from now on, this one and the last two
    raster.tiles([(5, 5), (3, 3)])
    assert len(made) == len(requested) + 2
    raster.tiles(requested[:1])
    assert len(made) == len(requested) + 3
