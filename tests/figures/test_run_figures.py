"""Figures of runs: drawn values equal the recorded ones, or follow in closed form."""

import matplotlib.pyplot as plt
import numpy as np
import numpy.testing as npt
import pytest
import xarray as xr
from scipy.spatial.transform import Rotation

from trueterrain import figures
from trueterrain.core.errors import CoverageError, SchemaError
from trueterrain.figures.run import groups
from trueterrain.formats.navigation import make_navigation
from trueterrain.formats.run import Mounting, open_run
from trueterrain.simulate.accelerometers import Accelerometers
from trueterrain.simulate.body import Wave
from trueterrain.simulate.scanner import Scanner
from trueterrain.simulate.scene import Scene, ScenePass, TruthSettings, Vehicle

pytestmark = pytest.mark.slow

EXACT = {"rtol": 0, "atol": 1e-12}  # [m], [rad], [s] round-off
QUANTUM = {"rtol": 0, "atol": 0.51e-4}  # [m] half a step of 0.1 mm in which ranges are kept
ON_GROUND = {"rtol": 0, "atol": 0.9e-4}  # [m] that step, along a beam of 45 degrees and 3 degrees

SCANNER = Scanner(
    beams=161,
    rate=100.0,
    spot_rays=1,
    range_noise=0.0,
    intensity_noise=0.0,
    dropouts=0.0,
    saturation=1e9,
)
WALL = {"kind": "step", "position": 0.5, "rise": 0.2, "direction": np.pi / 2}
DROP = {"kind": "step", "position": 0.9, "rise": -0.2, "direction": np.pi / 2}


@pytest.fixture(autouse=True)
def _closed_figures():
    yield
    plt.close("all")


def recorded(recorded_scene, name, **changes):
    """Run of a rigid body at 2 m/s with few beams."""
    scene = Scene(
        name=name,
        course={"kind": "straight", "length": 2.0},
        passes=(ScenePass(name="p", speed={"kind": "constant", "speed": 2.0}),),
        **{
            "raster": 0.0,
            "vehicle": Vehicle(model="rigid", height=0.8),
            "mounting": Mounting(scanner_position=(0.0, 0.0, 1.2)),
            "scanner": SCANNER,
            "accelerometers": Accelerometers(),
            **changes,
        },
    )
    return open_run(recorded_scene(scene)[0])


@pytest.fixture(scope="module")
def slope(recorded_scene):
    """Rolling, pitching, yawed scanner over an inclined plane."""
    waves = (
        Wave(component="roll", amplitude=0.03, frequency=1.0),
        Wave(component="pitch", amplitude=0.02, frequency=1.5),
        Wave(component="up", amplitude=0.02, frequency=2.0),
    )
    return recorded(
        recorded_scene,
        "slope",
        ground=({"kind": "plane", "slope": 0.03, "camber": -0.02},),
        vehicle=Vehicle(model="rigid", height=0.8, roll=0.02, waves=waves),
        mounting=Mounting(
            scanner_position=(-1.0, 0.2, 1.2),
            scanner_rotation=(0.02, -0.03, 0.05),
            scanner_clock=0.004,
        ),
    )


@pytest.fixture(scope="module")
def wall(recorded_scene):
    """A wall of 0.2 m from 0.5 m to 0.9 m to the left of the lane."""
    return recorded(
        recorded_scene,
        "wall",
        ground=(WALL, DROP),
        truth=TruthSettings(spacing=0.005),
    )


def without_truth(run):
    return xr.DataTree.from_dict(
        {path: node.to_dataset() for path, node in run.subtree_with_keys if "truth" not in path}
    )


def notes(ax):
    ax.figure.canvas.draw()
    texts = [*ax.texts, *(child for child in ax.artists if hasattr(child, "get_text"))]
    return [text.get_text() for text in texts]


def legend_texts(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


def line(ax, label):
    return next(drawn for drawn in ax.lines if drawn.get_label() == label).get_data()


# points of scans


def test_points_lie_on_the_ground_that_was_driven_over(slope):
    """Every beam at its own time, also those of the first and of the last scan."""
    for part in (slice(0, 3), slice(97, 100)):
        points = groups.returns_of(slope, part)
        east, north = np.moveaxis(points.position, -1, 0)
        npt.assert_allclose(points.up, 0.03 * east - 0.02 * north, **ON_GROUND)


def test_along_and_across_are_seen_from_the_first_beam(slope):
    points = groups.returns_of(slope, slice(10, 12))
    truth = slope["truth/scanner"].isel(scan=10)
    turn = Rotation.from_euler("z", -float(truth.yaw))
    seen = points.position - [float(truth.east), float(truth.north)]
    expected = turn.apply(np.concatenate([seen, np.zeros((*seen.shape[:2], 1))], 2).reshape(-1, 3))
    npt.assert_allclose(points.along.ravel(), expected[:, 0], **EXACT)
    npt.assert_allclose(points.across.ravel(), expected[:, 1], **EXACT)


def test_a_plan_shows_all_points_and_their_spacing(wall):
    ax = figures.scan_plan(wall, at=0.3, scans=5, across=(-2.1, 0.3))
    points = groups.returns_of(wall, slice(30, 35))
    shown = points.across <= 0.3
    offsets = np.stack([points.across[shown], points.along[shown]], axis=1)
    npt.assert_array_equal(ax.collections[0].get_offsets(), offsets)
    npt.assert_array_equal(ax.collections[0].get_array(), points.up[shown])
    assert ax.xaxis_inverted()  # left is on the left
    # on level ground 2 m below; all but the closest and the widest 2 % of the gaps
    offset = 2.0 * np.tan(wall.scans.angle.values)
    near, far = 1000 * np.percentile(np.tile(np.diff(offset[offset <= 0.3]), 5), [2, 98])
    assert notes(ax) == [f"equal scale, 5 scans, {near:.1f} to {far:.1f} mm from point to point"]


def test_a_plan_of_one_scan_has_some_height(wall):
    low, high = figures.scan_plan(wall, scans=1).get_ylim()
    assert high - low > 0.3


def test_an_elevation_shows_points_true_ground_and_shadows(wall):
    ax = figures.scan_elevation(wall, at=0.4)
    across, up = line(ax, "returns")
    angle = wall.scans.angle.values
    npt.assert_allclose(np.hypot(across, 2.0 - up), wall.scans.range[40], **EXACT)
    offset, height = line(ax, "true ground, every 5 mm")
    away = np.abs(offset[:, None] - [0.5, 0.9]).min(axis=1) > 0.006  # a node off the faces
    on_top = (offset > 0.5) & (offset < 0.9)
    npt.assert_allclose(height[away], np.where(on_top, 0.2, 0.0)[away], **EXACT)
    # one shadow, from the upper edge of the far face to where the beam over it comes down
    (shadow,) = ax.patches
    begin, end = shadow.get_x(), shadow.get_x() + shadow.get_width()
    beam = 2.0 * np.deg2rad(90 / 160) / np.cos(np.arctan(0.5)) ** 2  # [m] from point to point
    assert begin == pytest.approx(0.9, abs=beam)
    assert end == pytest.approx(0.9 * 2.0 / 1.8, abs=beam)
    assert legend_texts(ax) == ["true ground, every 5 mm", "not seen", "returns"]
    assert notes(ax)[0].startswith("vertical exaggeration ")
    assert "-" not in notes(ax)[0]
    assert angle.size == across.size


def test_a_part_of_an_elevation(wall):
    across, _ = line(figures.scan_elevation(wall, at=0.4, across=(-0.2, 0.2)), "returns")
    assert -0.2 <= across.min() < across.max() <= 0.2


def test_without_truth_an_elevation_is_in_the_axes_of_the_scanner(slope):
    ax = figures.scan_elevation(without_truth(slope), at=0.5)
    across, up = line(ax, "returns")
    ranges, angle = slope.scans.range[50].values, slope.scans.angle.values
    npt.assert_allclose(across, ranges * np.sin(angle), **EXACT)
    npt.assert_allclose(up, -ranges * np.cos(angle), **EXACT)
    assert ax.get_ylabel().startswith("Height above the scanner")
    with pytest.raises(SchemaError, match=r"group truth/scanner: is missing\. Only simulated"):
        figures.scan_plan(without_truth(slope))


def test_a_time_or_a_part_without_scans(wall):
    with pytest.raises(CoverageError, match=r"no scan at 7 s\. Give a time from 0 s to 0\.99 s"):
        figures.scan_elevation(wall, at=7.0)
    with pytest.raises(CoverageError, match="no return from 5 m to 6 m"):
        figures.scan_plan(wall, across=(5.0, 6.0))
    with pytest.raises(ValueError, match="scans must be at least 1, got 0"):
        figures.scan_plan(wall, scans=0)


# ranges


def test_ranges_are_an_image_of_scans_and_beams(slope):
    ax = figures.range_image(slope)
    ranges = slope.scans.range.values
    npt.assert_array_equal(ax.images[0].get_array().filled(np.nan), ranges.T)
    left, right, bottom, top = ax.images[0].get_extent()
    assert (left, right) == pytest.approx((0.0, 0.99))
    assert (bottom, top) == pytest.approx((-45 - 45 / 160, 45 + 45 / 160))
    assert notes(ax) == ["every scan shown"]
    assert ax.get_legend() is None


def test_ranges_below_the_scanner(wall):
    ax = figures.range_image(wall, begin=0.2, end=0.25, below=True)
    image = ax.images[0].get_array().filled(np.nan)
    assert image.shape == (161, 6)
    middle = np.abs(wall.scans.angle.values) < 0.2
    npt.assert_allclose(image[middle], 2.0, **QUANTUM)


def test_missing_returns_are_marked_at_their_positions(slope):
    lost = slope.scans.to_dataset().load()
    lost["range"][7, 20] = np.nan
    lost["range"][50:52, 100] = np.nan
    tree = slope.copy()
    tree["scans"] = xr.DataTree(lost)
    ax = figures.range_image(tree)
    time, degrees = np.asarray(ax.collections[0].get_offsets()).T
    npt.assert_allclose(time, [0.07, 0.50, 0.51], **EXACT)
    angle = np.rad2deg(lost.angle.values)
    npt.assert_allclose(degrees, angle[[20, 100, 100]], **EXACT)
    assert legend_texts(ax) == ["no return, 0.019 %"]  # 3 of 16,100


def test_of_many_scans_one_of_every_n_is_shown(slope, monkeypatch):
    monkeypatch.setattr("trueterrain.figures.run.ranges._MAX_SCANS", 30)
    monkeypatch.setattr("trueterrain.figures.run.ranges._BLOCK", 7)
    ax = figures.range_image(slope)
    npt.assert_array_equal(ax.images[0].get_array().filled(np.nan), slope.scans.range[::4].T)
    assert notes(ax) == ["1 of 4 scans shown"]


def test_ranges_of_no_time(slope):
    with pytest.raises(CoverageError, match=r"The scans are from 0 s to 0\.99 s"):
        figures.range_image(slope, begin=3.0)


# motion


def test_the_motion_of_the_body_is_the_true_one(slope):
    ax = figures.body_motion(slope)
    truth = slope["truth/body"]
    time, heave = line(ax, "heave")
    npt.assert_array_equal(time, truth.time.values)
    npt.assert_allclose(heave, truth.up - truth.up[0], **EXACT)
    (angles,) = (other for other in ax.figure.axes if other is not ax)
    npt.assert_array_equal(line(angles, "pitch")[1], truth.pitch.values)
    npt.assert_array_equal(line(angles, "roll")[1], truth.roll.values)
    assert legend_texts(ax) == ["heave", "pitch, nose down +", "roll"]
    assert (ax.get_ylabel(), angles.get_ylabel()) == ("Heave [mm]", "Pitch and roll [deg]")
    assert notes(ax) == ["true motion of the body"]


def test_both_zeros_are_at_the_same_height_and_all_is_in_sight(slope):
    ax = figures.body_motion(slope)
    angles = next(other for other in ax.figure.axes if other is not ax)
    zeros = [each.transData.transform((0.0, 0.0))[1] for each in (ax, angles)]
    assert zeros[0] == pytest.approx(zeros[1])
    for each in (ax, angles):
        low, high = each.get_ylim()
        for drawn in each.lines:
            assert np.all((drawn.get_ydata() >= low) & (drawn.get_ydata() <= high))


def test_a_body_that_stands_still_can_be_shown():
    still = np.zeros(5)
    ax = figures.body_motion({"time": np.arange(5.0), "up": still, "pitch": still, "roll": still})
    low, high = ax.get_ylim()
    assert low < 0 < high


def test_angles_are_ticked_at_round_degrees(slope):
    ax = figures.body_motion(slope, components=["pitch"])
    ax.figure.canvas.draw()
    ticks = np.rad2deg(ax.get_yticks())
    npt.assert_allclose(ticks, np.round(ticks, 3), rtol=0, atol=1e-9)  # [deg] round-off
    assert [text.get_text() for text in ax.get_yticklabels()][1] == f"{ticks[1]:g}".replace(
        "-", "−"
    )


def test_motion_by_navigation_and_of_navigation(slope):
    recorded_up = slope.navigation.up.values
    ax = figures.body_motion(slope, source="navigation", components=["up"])
    npt.assert_allclose(line(ax, "heave")[1], recorded_up - recorded_up[0], **EXACT)
    ax = figures.body_motion(without_truth(slope), components=["up"])
    npt.assert_allclose(line(ax, "heave")[1], recorded_up - recorded_up[0], **EXACT)
    ax = figures.body_motion(slope["navigation"].to_dataset(), components=["up"])
    npt.assert_allclose(line(ax, "heave")[1], recorded_up - recorded_up[0], **EXACT)


def test_motion_of_a_missing_group(slope):
    with pytest.raises(ValueError, match="components must be some of up, pitch, roll"):
        figures.body_motion(slope, components=["yaw"])
    with pytest.raises(SchemaError, match=r"group truth/body: is missing"):
        figures.body_motion(without_truth(slope), source="truth")
    with pytest.raises(SchemaError, match=r"motion, variable up: is missing"):
        figures.laser_displacement({"time": [0.0, 1.0]})
    with pytest.raises(SchemaError, match=r"variable up: must have one value for each of time"):
        figures.laser_displacement({"time": [0.0, 1.0], "up": [0.0]})


def test_the_displacement_of_the_laser(slope):
    truth = slope["truth/scanner"]
    ax = figures.laser_displacement(slope)
    npt.assert_allclose(ax.lines[0].get_ydata(), truth.up - truth.up[0], **EXACT)
    span = 1000 * float(truth.up.max() - truth.up.min())
    assert notes(ax) == [f"laser, {span:.1f} mm from peak to peak"]
    part = figures.laser_displacement(slope, begin=0.2, end=0.4).lines[0].get_xdata()
    assert (part[0], part[-1]) == pytest.approx((0.204, 0.394))
    with pytest.raises(ValueError, match="begin and end must enclose a sample"):
        figures.laser_displacement(slope, begin=10.0)


# errors of navigation


def test_errors_of_navigation_are_the_injected_ones(slope, wall):
    ax = figures.navigation_errors({"a": slope, "b": wall})
    truth = slope["truth/navigation"]
    time, drift = line(ax, "a: drift")
    npt.assert_allclose(time, truth.true_time - truth.true_time[0], **EXACT)
    npt.assert_array_equal(drift, truth.drift_up)
    npt.assert_array_equal(ax.lines[1].get_ydata(), truth.error_up)
    npt.assert_array_equal(line(ax, "b: drift")[1], wall["truth/navigation"].drift_up)
    assert legend_texts(ax) == ["a: drift", "with noise", "b: drift", "with noise"]
    ax = figures.navigation_errors(slope, component="yaw")
    npt.assert_array_equal(line(ax, "slope-p")[1], truth.error_yaw)
    assert ax.get_ylabel() == "Error of yaw [deg]"


def test_errors_of_a_run_without_truth(slope):
    with pytest.raises(SchemaError, match=r"group truth/navigation: is missing\. Only simulated"):
        figures.navigation_errors(without_truth(slope))
    with pytest.raises(ValueError, match="component must be one of east"):
        figures.navigation_errors(slope, component="speed")
    with pytest.raises(ValueError, match="at least 1 run"):
        figures.navigation_errors({})


# spectra


def test_the_spectrum_of_white_noise_is_level_and_holds_its_variance():
    rng = np.random.default_rng(3)
    noise = 0.2 * rng.standard_normal(400_000)
    ax = figures.spectrum(noise, 1000.0, segment=1.0)
    frequency, density = ax.lines[0].get_data()
    # 799 segments: about 760 independent pairs of degrees of freedom, 3.6 % in each value
    npt.assert_allclose(np.mean(density), 2 * 0.2**2 / 1000.0, rtol=0.01, atol=0)
    assert frequency[0] == 1.0  # the mean is not drawn
    assert ax.get_ylabel() == "Acceleration [(m/s²)²/Hz]"


@pytest.mark.parametrize("segments", [1, 4, 31])
def test_the_confidence_band_has_its_stated_coverage(segments):
    rng = np.random.default_rng(segments)
    held, size = [], 200
    for _ in range(60):
        noise = rng.standard_normal(size + (segments - 1) * size // 2)
        ax = figures.spectrum(noise, 1.0, segment=size, confidence=0.8)
        (band,) = ax.collections
        path = band.get_paths()[0].vertices
        frequency = ax.lines[0].get_xdata()[10:-10:3]
        low, high = (
            np.array([edge(path[np.isclose(path[:, 0], f), 1]) for f in frequency])
            for edge in (np.min, np.max)
        )
        held.append(np.mean((low <= 2.0) & (high >= 2.0)))
        plt.close("all")
    # 60 repeats of some 9 independent frequencies: 0.4 / sqrt(540) = 1.7 %, three times that
    assert np.mean(held) == pytest.approx(0.8, abs=0.05)


def test_degrees_of_freedom_are_those_of_the_scatter():
    """4 overlapping segments, whose density scatters by sqrt(2 / degrees)."""
    rng = np.random.default_rng(9)
    values = [
        figures.spectrum(rng.standard_normal(500), 1.0, segment=200).lines[0].get_ydata()[20:80:4]
        for _ in range(200)
        if not plt.close("all")
    ]
    scatter = np.std(values) / np.mean(values)
    noted = notes(figures.spectrum(rng.standard_normal(500), 1.0, segment=200))[0]
    degrees = float(noted.split(", ")[2].split()[0])
    assert scatter == pytest.approx(np.sqrt(2 / degrees), rel=0.07)  # 3000 values, some correlated


def test_peaks_are_marked_at_their_frequencies():
    time = np.arange(20_000) / 500.0
    signal = np.sin(2 * np.pi * 1.25 * time) + 0.3 * np.sin(2 * np.pi * 10.75 * time)
    ax = figures.spectrum(
        {"body": signal},
        500.0,
        segment=8.0,
        frequencies=(0.5, 30.0),
        peaks={"primary ride": (0.8, 2.0), "wheel hop": (8.0, 14.0)},
    )
    assert notes(ax)[:2] == ["primary ride 1.2 Hz", "wheel hop 10.8 Hz"]
    assert legend_texts(ax) == ["body"]
    frequency = line(ax, "body")[0]
    assert (frequency[0], frequency[-1]) == (0.5, 30.0)


def test_a_spectrum_of_nothing():
    noise = np.random.default_rng(1).standard_normal(1000)
    with pytest.raises(ValueError, match="rate must be greater than 0 Hz"):
        figures.spectrum(noise, 0.0)
    with pytest.raises(ValueError, match=r"segment must be from 0\.08 s to the 10 s of the signal"):
        figures.spectrum(noise, 100.0, segment=11.0)
    with pytest.raises(ValueError, match="confidence must be between 0 and 1"):
        figures.spectrum(noise, 100.0, confidence=95)
    with pytest.raises(ValueError, match="peak 'hop' must be searched where there is a frequency"):
        figures.spectrum(noise, 100.0, peaks={"hop": (80.0, 90.0)})
    with pytest.raises(ValueError, match="signal a must have one dimension and be finite"):
        figures.spectrum({"a": [1.0, np.nan]}, 100.0)
    with pytest.raises(ValueError, match="frequencies must hold one"):
        figures.spectrum(noise, 100.0, frequencies=(60.0, 70.0))


# slopes


def test_the_measurable_slope_is_that_of_the_beam():
    ax = figures.measurable_slope(2.0, 2.0, found={"found": ([1.0], [np.arctan(2.0)])})
    offset, limit = line(ax, "slope of the beam")
    npt.assert_allclose(np.tan(np.deg2rad(limit)) * np.abs(offset), 2.0 * (offset != 0), **EXACT)
    npt.assert_allclose(line(ax, "found")[1], np.rad2deg(np.arctan(2.0)), **EXACT)
    with pytest.raises(ValueError, match="must be greater than 0 m"):
        figures.measurable_slope(0.0)


# navigation


def test_navigation_from_above_and_its_heights():
    time = np.linspace(400_000.0, 400_010.0, 50)
    still = np.zeros(50)
    drive = make_navigation(
        {
            "time": time,
            "east": 3 * (time - time[0]),
            "north": 4 * (time - time[0]),
            "up": 0.01 * np.sin(time),
            "roll": still,
            "pitch": still,
            "yaw": still,
            "sd_east": still + 0.02,
            "sd_north": still + 0.02,
            "sd_up": still + 0.03,
            "sd_roll": still,
            "sd_pitch": still,
            "sd_yaw": still,
        }
    )
    ax = figures.navigation_plan(drive)
    npt.assert_array_equal(line(ax, "trajectory"), [drive.east, drive.north])
    assert notes(ax) == ["equal scale, 50 m driven"]
    ax = figures.navigation_heights(drive)
    npt.assert_allclose(line(ax, "height"), [time - 400_000.0, drive.up], **EXACT)
    edges = ax.collections[0].get_paths()[0].vertices[:, 1]
    assert edges.max() == pytest.approx(float(drive.up.max()) + 0.03)
    assert ax.get_xlabel() == "Time − 400000 s [s]"
    assert legend_texts(ax) == ["± 1 sd", "height"]


def test_figures_draw_into_given_axes(slope):
    axes = plt.subplots(3, 3)[1].ravel()
    draw = [
        lambda ax: figures.scan_plan(slope, ax=ax),
        lambda ax: figures.scan_elevation(slope, ax=ax),
        lambda ax: figures.range_image(slope, ax=ax),
        lambda ax: figures.body_motion(slope, ax=ax),
        lambda ax: figures.laser_displacement(slope, ax=ax),
        lambda ax: figures.navigation_errors(slope, ax=ax),
        lambda ax: figures.spectrum(slope.accelerometers.acceleration[:, 0], 2000.0, ax=ax),
        lambda ax: figures.measurable_slope(ax=ax),
        lambda ax: figures.navigation_plan(slope, ax=ax),
    ]
    for ax, function in zip(axes, draw, strict=True):
        assert function(ax) is ax
