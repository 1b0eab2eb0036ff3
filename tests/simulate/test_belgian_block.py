"""Belgian block against the measured road of the OpenCRG sample data, and against its own rules."""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.testing as npt
import pycrg
import pytest
from scipy.ndimage import gaussian_filter, gaussian_filter1d, maximum_filter1d
from scipy.signal import detrend

from trueterrain.simulate.ground import BelgianBlock

pytestmark = pytest.mark.slow

CELL = 0.01  # [m] spacing of the measured grid and of what is compared with it
LENGTH, WIDTH = 1001, 301  # [1] nodes of the part of the measured grid that has no holes
RAGGED = 40  # [1] columns at the right edge that have
PIECES = 8  # [1] pieces of simulated road; a single one scatters by 2 mm in RMS
LAGS = np.array([1, 3, 5, 10, 17, 34, 50, 100, 115, 225])  # [1] cells

RMS = 0.15  # [1] scatter of a road of 10 m with nine fields: four are high or low by chance
PITCH = 0.10  # [1] as wide as the peak of the spectrum of the joints
JOINTS = 0.15  # [1] depth and width: the ensemble repeats within 3 %
DIFFERENCES = 0.15  # [1] RMS difference of heights: the measured road is one sample
SPECTRUM = 0.25  # [1] power of the fall of the spectrum: its fit moves by this with the band
QUANTILES = 5e-3  # [m] a fifth of the height of the fields
SAME = {"rtol": 0, "atol": 0.0}  # not a bit may differ


def without_plane(height: np.ndarray) -> np.ndarray:
    u, v = np.meshgrid(*(np.arange(n) * CELL for n in height.shape), indexing="ij")
    columns = np.column_stack([np.ones(u.size), u.ravel(), v.ravel()])
    plane = columns @ np.linalg.lstsq(columns, height.ravel(), rcond=None)[0]
    return height - plane.reshape(height.shape)


@pytest.fixture(scope="module")
def measured(data: Path) -> np.ndarray:
    """Measured heights about their plane [m], read by an independent program."""
    path = data / "opencrg" / "asam" / "belgian_block.crg"
    with pycrg.RoadSurface.open(str(path), apply_modifiers=False) as road:
        height = np.array(road.grid().z)
    assert np.isfinite(height[:, RAGGED:]).all()
    return without_plane(height[:, RAGGED:])


@pytest.fixture(scope="module")
def simulated() -> list[np.ndarray]:
    """Pieces of simulated road of the same size [m], cut out at different places."""
    along, across = np.arange(LENGTH) * CELL, np.arange(WIDTH) * CELL - 1.65
    return [
        without_plane(BelgianBlock(seed=seed).height(along[:, None] + 37.0 * seed, across))
        for seed in range(PIECES)
    ]


def difference(height: np.ndarray, axis: int) -> np.ndarray:
    """RMS difference of heights at the lags [m]."""
    h = np.moveaxis(height, axis, 0)
    return np.array([np.sqrt(np.mean((h[lag:] - h[:-lag]) ** 2)) for lag in LAGS])


def spectrum(height: np.ndarray, axis: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """One-sided spectrum [m^3] along an axis, mean of all lines, and its frequencies [1/m]."""
    h = detrend(np.moveaxis(height, axis, 0), axis=0)
    window = np.hanning(len(h))[:, None]
    power = np.abs(np.fft.rfft(h * window, axis=0)) ** 2 * 2 * CELL / (window**2).sum()
    return np.fft.rfftfreq(len(h), CELL), power.mean(axis=1)


def spectrum_power(heights: list[np.ndarray]) -> float:
    """Power of the fall of the spectrum along the road from 1 to 20 1/m."""
    n = spectrum(heights[0])[0]
    mean = np.mean([spectrum(height)[1] for height in heights], axis=0)
    band = (n >= 1) & (n <= 20)
    return float(np.polyfit(np.log(n[band]), np.log(mean[band]), 1)[0])


def joints(height: np.ndarray) -> np.ndarray:
    """Largest curvature, upwards [1/m] and limited: large in joints."""
    sigma = 1.3  # [1] cells
    uu, vv, uv = (
        gaussian_filter(height, sigma, order=order) / CELL**2 for order in ((2, 0), (0, 2), (1, 1))
    )
    return np.clip(0.5 * (uu + vv) + np.hypot(0.5 * (uu - vv), uv), 0.0, 12.0)


def pitch(heights: list[np.ndarray], axis: int) -> float:
    """Distance from joint to joint along an axis [m]: peak of the spectrum of the joints."""
    power = 0.0
    for height in heights:
        j = np.moveaxis(joints(height), axis, 0)
        window = np.hanning(len(j))[:, None]
        power = power + (np.abs(np.fft.rfft((j - j.mean(0)) * window, 8192, axis=0)) ** 2).mean(1)
    n = np.fft.rfftfreq(8192, CELL)
    power = gaussian_filter1d(np.asarray(power), 0.1 / n[1])  # joints scatter: a broad peak
    band = (n > 3.5) & (n < 9)
    return float(1.0 / n[band][np.argmax(power[band])])


def mean_joint(heights: list[np.ndarray], axis: int) -> np.ndarray:
    """Mean section [m] through the joints that an axis crosses, 12 cells to either side."""
    sections = []
    for height in heights:
        h = np.moveaxis(height, axis, 0)
        curvature = gaussian_filter1d(h, 1.3, axis=0, order=2) / CELL**2
        middle = (curvature > 5) & (maximum_filter1d(curvature, 13, axis=0) == curvature)
        middle[:12] = middle[-12:] = False
        at, line = np.nonzero(middle)
        section = np.array([h[at + k, line] for k in range(-12, 13)])
        sections.append((section - section[[4, 5, 19, 20]].mean(axis=0)).mean(axis=1))
    return np.mean(sections, axis=0)


def depth_and_width(section: np.ndarray) -> tuple[float, float]:
    """Depth below the sides, and width at half depth [m]."""
    depth = -section[12]
    fine = np.interp(np.arange(0, 24, 0.01), np.arange(25), section)
    return float(depth), float((fine < -0.5 * depth).sum() * 0.01 * CELL)


def lanes_correlation(height: np.ndarray) -> float:
    """Correlation of the mean heights of the left and the right lane along the road."""
    return float(np.corrcoef(height[:, 200:].mean(axis=1), height[:, :150].mean(axis=1))[0, 1])


def test_rms_about_the_plane_is_the_measured_one(measured, simulated):
    npt.assert_allclose(measured.std(), 24.4e-3, rtol=0, atol=0.05e-3)  # as the docstring says
    rms = np.sqrt(np.mean(np.square(simulated)))
    npt.assert_allclose(rms, measured.std(), rtol=RMS, atol=0)


def test_heights_are_distributed_as_measured(measured, simulated):
    percent = [5, 25, 50, 75, 95]
    truth = np.percentile(measured, percent)
    npt.assert_allclose(np.percentile(simulated, percent), truth, rtol=0, atol=QUANTILES)


@pytest.mark.parametrize("axis", [0, 1])
def test_heights_differ_over_distances_as_measured(measured, simulated, axis):
    mean = np.sqrt(np.mean([difference(height, axis) ** 2 for height in simulated], axis=0))
    npt.assert_allclose(mean, difference(measured, axis), rtol=DIFFERENCES, atol=0)


def test_spectrum_along_the_road_falls_as_measured(measured, simulated):
    truth = spectrum_power([measured])
    npt.assert_allclose(truth, -2.23, rtol=0, atol=0.02)  # as the docstring says
    npt.assert_allclose(spectrum_power(simulated), truth, rtol=0, atol=SPECTRUM)


@pytest.mark.parametrize(("axis", "stated"), [(0, 0.172), (1, 0.196)])
def test_pitch_of_rows_and_blocks_is_the_measured_one(measured, simulated, axis, stated):
    truth = pitch([measured], axis)
    npt.assert_allclose(truth, stated, rtol=0, atol=1e-3)  # as the docstring says
    npt.assert_allclose(pitch(simulated, axis), truth, rtol=PITCH, atol=0)


@pytest.mark.parametrize(("axis", "stated"), [(0, (8.8e-3, 41e-3)), (1, (7.9e-3, 35e-3))])
def test_joints_are_as_deep_and_wide_as_measured(measured, simulated, axis, stated):
    truth = depth_and_width(mean_joint([measured], axis))
    npt.assert_allclose(truth, stated, rtol=0, atol=0.5e-3)  # as the docstring says
    npt.assert_allclose(depth_and_width(mean_joint(simulated, axis)), truth, rtol=JOINTS, atol=0)


def test_lanes_are_in_opposition_as_measured(measured, simulated):
    npt.assert_allclose(lanes_correlation(measured), -0.7, rtol=0, atol=0.01)
    assert np.mean([lanes_correlation(height) for height in simulated]) < -0.5


SMOOTH: dict[str, Any] = {
    "row_scatter": 0.0,
    "row_waviness": 0.0,
    "block_scatter": 0.0,
    "block_slant": 0.0,
    "bond_scatter": 0.0,
    "joint_depth_scatter": 0.0,
    "crown": 0.0,
    "height_scatter": 0.0,
    "tilt_scatter": 0.0,
    "lean": 0.0,
    "texture": 0.0,
    "field_height": 0.0,
    "field_scatter": 0.0,
    "undulation": 0.0,
}


def test_without_scatter_the_tops_are_level_and_the_joints_regular():
    road = BelgianBlock(**SMOOTH, row_pitch=0.2, block_pitch=0.2, joint_depth=0.01)
    middle = 0.1 + 0.2 * np.arange(-4, 5)
    # Rows of even number have joints at whole multiples of the pitch, odd ones at half of it.
    even = middle[np.arange(-4, 5) % 2 == 0]
    npt.assert_allclose(road.height(even[:, None], middle), 0.0, **SAME)
    npt.assert_allclose(road.height(even[:, None], middle + 0.1), -0.01, **SAME)
    npt.assert_allclose(road.height(even[:, None] + 0.2, middle), -0.01, **SAME)
    npt.assert_allclose(road.height(middle + 0.1, 0.03), -0.01, **SAME)


def test_bond_of_zero_aligns_all_rows():
    road = BelgianBlock(**SMOOTH, bond=0.0, row_pitch=0.2, block_pitch=0.2, joint_depth=0.01)
    npt.assert_allclose(road.height(0.1 + 0.2 * np.arange(9), 0.4), -0.01, **SAME)


def test_shoulder_and_joint_have_the_widths_asked_for():
    road = BelgianBlock(**SMOOTH, row_pitch=0.2, joint_width=0.01, shoulder=0.03, joint_depth=0.01)
    away = np.array([0.0, 0.005, 0.02, 0.035, 0.05])
    npt.assert_allclose(
        road.height(0.2 + away, 0.049), [-0.01, -0.01, -0.005, 0.0, 0.0], rtol=0, atol=1e-15
    )


def test_fields_alternate_like_a_chessboard():
    level = SMOOTH | {"field_height": 0.03, "joint_depth": 0.0, "bedding": 0.0}
    road = BelgianBlock(**level, field_length=2.0, field_width=2.0, field_length_scatter=0.0)
    along = np.array([1.0, 3.0, 5.0, -1.0])
    high = 0.03 * np.array([1.0, -1.0, 1.0, -1.0])
    npt.assert_allclose(road.height(along, 1.0), high, rtol=0, atol=1e-15)
    npt.assert_allclose(road.height(along, -1.0), -high, rtol=0, atol=1e-15)


@pytest.mark.parametrize("part", ["texture", "undulation"])
def test_roughness_has_the_rms_asked_for(part):
    road = BelgianBlock(**SMOOTH | {"joint_depth": 0.0, "bedding": 1.0, part: 0.004})
    x, y = np.random.default_rng(2).uniform(-500.0, 500.0, (2, 200_000))
    npt.assert_allclose(road.height(x, y).std(), 0.004, rtol=0.03, atol=0)  # random field, sampled


@pytest.mark.parametrize(("part", "distance"), [("height_scatter", 0.1), ("field_scatter", 2.0)])
def test_scatter_has_the_sd_asked_for(part, distance):
    """Heights in the middle of blocks or fields, each an independent number."""
    regular = {"joint_depth": 0.0, "bond": 0.0, "field_length_scatter": 0.0, "field_ramp": 0.1}
    size = {"field_length": 4.0, "field_width": 4.0, "row_pitch": 0.2, "block_pitch": 0.2}
    road = BelgianBlock(**SMOOTH | regular | size | {part: 0.004}, seed=8)
    middle = distance + 2 * distance * np.arange(100)
    height = road.height(middle[:, None], middle)
    npt.assert_allclose(height.std(), 0.004, rtol=0.03, atol=0)  # 10 000 numbers: 0.7 %
    npt.assert_allclose(height.mean(), 0.0, rtol=0, atol=0.2e-3)


def test_lean_makes_saw_teeth():
    road = BelgianBlock(**SMOOTH | {"joint_depth": 0.0, "lean": 0.05, "bedding": 0.0})
    middle = 0.5 * road.row_pitch
    away = np.array([-0.03, 0.0, 0.03])
    npt.assert_allclose(road.height(middle + away, 0.049), 0.05 * away, rtol=0, atol=1e-15)


@pytest.mark.slow
def test_the_surface_has_no_jumps():
    """Steps of 1 µm: no height may differ more than the steepest slope allows."""
    x = 3.0 + np.arange(1_000_000) * 1e-6
    for road in (BelgianBlock(seed=1), BelgianBlock(seed=2, direction=1.2)):
        for heights in (road.height(x, 0.7), road.height(0.4, x), road.height(x, x)):
            assert np.abs(np.diff(heights)).max() < 5e-6  # [m] slopes of 3 m/m in joints


def test_direction_turns_the_road():
    x, y = np.random.default_rng(5).uniform(-20.0, 20.0, (2, 1000))
    angle = 0.7
    turned = BelgianBlock(seed=4, direction=angle)
    along = np.cos(angle) * x + np.sin(angle) * y
    across = np.cos(angle) * y - np.sin(angle) * x
    npt.assert_allclose(turned.height(x, y), BelgianBlock(seed=4).height(along, across), **SAME)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("row_pitch", 0.0),
        ("row_scatter", -0.01),
        ("row_scatter", 0.1),
        ("block_scatter", 0.2),
        ("shoulder", np.nan),
        ("bedding", 1.5),
        ("field_length_scatter", 0.5),
        ("field_ramp", 1.0),
        ("lane_ramp", 3.0),
        ("crown", np.inf),
        ("seed", -1),
        ("seed", 1.5),
    ],
)
def test_bad_parameters_are_refused(field, value):
    with pytest.raises(ValueError, match="must"):
        BelgianBlock(**{field: value})
