"""Discontinuity vectors of passes with known drift over analytic ground, on several courses."""

from collections.abc import Callable

import numpy as np
import numpy.testing as npt
import pytest
import xarray as xr

from trueterrain.alignment.discontinuity.alignment import (
    DiscontinuitySettings,
    align_along_paths,
    correct_points,
    low_pass,
    reference_height,
)
from trueterrain.alignment.discontinuity.reference_path import (
    ReferencePath,
    polar_reference,
    straight_reference,
    waypoint_reference,
)
from trueterrain.core.errors import CoverageError, SchemaError, TrueTerrainError
from trueterrain.core.provenance import provenance_steps
from trueterrain.core.schemas import make_points
from trueterrain.profile import Rectangle

EXACT = 1e-9  # [m] round-off
STEP = 1e-5  # [m] heights are added up in steps of it, corrected ones lie half a step off at most
DRIFT = 2.5e-4  # [m] means of some 300 places of a slope of 5 % in a disc, smoothed over 2.5 m
RADIUS = 30.0  # [m]
AMPLITUDE = 6e-3  # [m] of the drift
WAVE = 10.0  # [m] of the drift
OPTIONS = DiscontinuitySettings()
PASSED = 0.5 ** ((OPTIONS.cut_off / WAVE) ** 2)  # part of that wave that a Gaussian filter passes

CurveFunction = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


def straight(s: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """North-east, far from the origin."""
    return 650_000 + 0.8 * s - 0.6 * v, 6_800_000 + 0.6 * s + 0.8 * v


def circle(s: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """To the left around a centre at (0, 0), from its east."""
    return (RADIUS - v) * np.cos(s / RADIUS), (RADIUS - v) * np.sin(s / RADIUS)


def flat(s: np.ndarray, v: np.ndarray) -> np.ndarray:
    return np.full(s.shape, 123.0)


def sloped(s: np.ndarray, v: np.ndarray) -> np.ndarray:
    return 100 + 0.05 * s + 0.02 * v


def waves(s: np.ndarray, v: np.ndarray) -> np.ndarray:
    return 0.02 * np.sin(2 * np.pi * s / 3.0) + 0.005 * np.cos(2 * np.pi * v / 0.8)


def no_drift(s: np.ndarray) -> np.ndarray:
    return np.zeros(s.shape)


def wave(s: np.ndarray) -> np.ndarray:
    return 0.02 + AMPLITUDE * np.sin(2 * np.pi * s / WAVE)


def one_pass(
    right: float,
    left: float,
    *,
    curve: CurveFunction = straight,
    ground: Callable[..., np.ndarray] = flat,
    drift: Callable[[np.ndarray], np.ndarray] = no_drift,
    begin: float = 0.0,
    end: float = 20.0,
    spacing: float = 0.02,
    seed: int = 0,
    crs: str = "",
) -> xr.Dataset:
    """Points of a pass from its right to its left edge, one in each square."""
    u, v = (
        at.ravel()
        for at in np.meshgrid(np.arange(begin, end, spacing), np.arange(right, left, spacing))
    )
    rng = np.random.default_rng(seed)
    u, v = u + spacing * rng.random(u.size), v + spacing * rng.random(v.size)
    x, y = curve(u, v)
    return make_points(x, y, ground(u, v) + drift(u), crs=crs)


def pair(**how: object) -> dict[str, xr.Dataset]:
    """Two passes that overlap by 0.6 m, the left one with a drift."""
    return {
        "left": one_pass(-0.3, 1.2, **{"drift": wave, "seed": 1} | how),
        "right": one_pass(-1.2, 0.3, **{"seed": 2} | how | {"drift": no_drift}),
    }


@pytest.mark.parametrize("ground", [flat, sloped, waves])
@pytest.mark.parametrize("curve", [straight, circle])
def test_drift_between_two_passes_is_divided_equally(ground, curve) -> None:
    passes = pair(ground=ground, curve=curve)
    found = align_along_paths(passes)
    path = found.pairs[0].path
    (vector,) = (one.discontinuity for one in found.pairs)
    truth = true_station(path, curve)
    inner = (truth > 3) & (truth < 17) & ~vector.gap  # the filter reaches 2.5 m
    wanted = 0.02 + PASSED * AMPLITUDE * np.sin(2 * np.pi * truth / WAVE)
    difference = vector.filtered[0] - vector.filtered[1]
    npt.assert_allclose(difference[inner], wanted[inner], rtol=0, atol=DRIFT)
    # passes of the same density are off by half of it each
    npt.assert_allclose(vector.filtered[0], -vector.filtered[1], rtol=0, atol=0.05 * 0.026)
    assert found.pairs[0].before.median > 0.013
    assert found.pairs[0].after.rmse < AMPLITUDE * (1 - PASSED) + 2 * DRIFT


def true_station(path: ReferencePath, curve: CurveFunction) -> np.ndarray:
    """True stations of the reference points."""
    if curve is circle:
        return RADIUS * np.unwrap(np.arctan2(path.curve.northing, path.curve.easting))
    return 0.8 * (path.curve.easting - 650_000) + 0.6 * (path.curve.northing - 6_800_000)


def test_the_correction_of_flat_ground_is_the_filtered_drift() -> None:
    """Only the mean over the disc and the filter attenuate the drift."""
    middle = straight_reference(straight(0.5, 0.0), straight(19.5, 0.0))
    vector = align_along_paths(pair(), paths={("left", "right"): middle}).pairs[0].discontinuity
    s = 0.5 + vector.station
    inner = (s > 3) & (s < 17)
    disc = OPTIONS.radius * 2 * np.pi / WAVE
    mean = 1 - disc**2 / 8  # of a wave over a disc: 2 J1(x) / x
    scatter = 6e-5  # [m] places of 300 points in a disc, on a drift of 4 mm/m
    wanted = 0.02 + mean * AMPLITUDE * np.sin(2 * np.pi * s / WAVE)
    npt.assert_allclose((vector.raw[0] - vector.raw[1])[inner], wanted[inner], atol=scatter, rtol=0)
    wanted = 0.02 + mean * PASSED * AMPLITUDE * np.sin(2 * np.pi * s / WAVE)
    npt.assert_allclose(
        (vector.filtered[0] - vector.filtered[1])[inner], wanted[inner], atol=scatter / 2, rtol=0
    )


def test_a_linear_drift_is_not_bent_at_the_ends() -> None:
    passes = pair(drift=lambda s: 0.01 + 0.002 * s)
    vector = align_along_paths(passes).pairs[0].discontinuity
    s = true_station(align_along_paths(passes).pairs[0].path, straight)
    apart = vector.filtered[0] - vector.filtered[1]
    npt.assert_allclose(apart[~vector.gap], (0.01 + 0.002 * s)[~vector.gap], rtol=0, atol=1e-4)


def test_a_closed_course_in_polar_stations_has_no_seam() -> None:
    around = 2 * np.pi * RADIUS

    def drift(s: np.ndarray) -> np.ndarray:
        return 0.02 + AMPLITUDE * np.cos(2 * np.pi * 15 * s / around)

    passes = {
        "inner": one_pass(-0.3, 0.6, curve=circle, drift=drift, end=around, spacing=0.03, seed=1),
        "outer": one_pass(-0.6, 0.3, curve=circle, end=around, spacing=0.03, seed=2),
    }
    ring = polar_reference((0.0, 0.0), RADIUS)
    found = align_along_paths(passes, paths=ring)
    vector = found.pairs[0].discontinuity
    passed = 0.5 ** ((OPTIONS.cut_off * 15 / around) ** 2)
    wanted = 0.02 + passed * AMPLITUDE * np.cos(2 * np.pi * 15 * vector.station / around)
    apart = vector.filtered[0] - vector.filtered[1]
    npt.assert_allclose(apart, wanted, rtol=0, atol=DRIFT)  # at all stations, the first included
    assert not vector.gap.any()
    both_sides = found.correction("inner", [RADIUS, RADIUS], [-1e-6, 1e-6])
    npt.assert_allclose(*both_sides.height, rtol=0, atol=1e-8)
    assert both_sides.station[0] > around - 1e-3
    assert not both_sides.beyond.any()


def test_a_closed_course_is_found_by_itself() -> None:
    around = 2 * np.pi * 15.0

    def ring(s: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return (15 - v) * np.cos(s / 15), (15 - v) * np.sin(s / 15)

    passes = {
        "inner": one_pass(-0.3, 0.6, curve=ring, drift=wave, end=around, spacing=0.03, seed=1),
        "outer": one_pass(-0.6, 0.3, curve=ring, end=around, spacing=0.03, seed=2),
    }
    found = align_along_paths(passes)
    assert found.pairs[0].path.curve.closed
    assert found.pairs[0].path.curve.length == pytest.approx(around, abs=0.2)
    # the part of the wave that the filter does not pass stays, half of it at each edge
    assert found.pairs[0].seam_after.median < 0.5 * AMPLITUDE * (1 - PASSED)


def test_points_are_corrected_by_station_and_stay_constant_beyond_the_overlap() -> None:
    passes = pair(drift=lambda s: 0.01 + 0.001 * s)
    passes["left"] = one_pass(-0.3, 1.2, begin=-4, end=24, drift=lambda s: 0.01 + 0.001 * s, seed=1)
    found = align_along_paths(passes, fix="right")
    after = correct_points(passes["left"], found, "left")
    s = 0.8 * (after.easting - 650_000) + 0.6 * (after.northing - 6_800_000)
    inside = (s > 0.5) & (s < 19.5)
    npt.assert_allclose(after.up[inside], 123.0, rtol=0, atol=1e-4)
    npt.assert_allclose(after.up[s < 0], 123.01 + 0.001 * s[s < 0] - 0.0102, rtol=0, atol=2e-4)
    assert after.attrs["beyond_overlap"] == pytest.approx(float((~inside).sum()), rel=0.2)
    flagged = found.correction("left", *straight(np.array([-2.0, 10.0, 22.0]), np.zeros(3)))
    assert flagged.beyond.tolist() == [True, False, True]
    assert provenance_steps(after)[-1]["parameters"]["lane"] == "left"
    assert correct_points(passes["right"], found, "right").up.equals(passes["right"].up)


def test_reference_height_is_the_pooled_mean_of_equation_4_1() -> None:
    """Erratum: the printed equation is the sum of both means, twice the height."""
    z, n = np.array([[0.10, 5.0], [0.14, 5.2]]), np.array([[300, 100], [100, 100]])
    npt.assert_allclose(reference_height(z, n), [0.11, 5.1], rtol=0, atol=EXACT)
    npt.assert_allclose(reference_height(z, n, "midway"), [0.12, 5.1], rtol=0, atol=EXACT)
    assert (reference_height(z, n) < z.sum(axis=0) - 0.09).all()


def test_the_denser_pass_moves_less_unless_the_reference_is_midway() -> None:
    passes = {
        "dense": one_pass(-0.3, 1.2, drift=lambda s: np.full(s.shape, 0.010), seed=1),
        "sparse": one_pass(-1.2, 0.3, spacing=0.04, seed=2),
    }
    pooled = align_along_paths(passes).pairs[0].discontinuity
    npt.assert_allclose(pooled.filtered[0], 0.010 / 5, rtol=0, atol=2e-4)  # 4 of 5 points are its
    npt.assert_allclose(pooled.filtered[1], -0.010 * 4 / 5, rtol=0, atol=2e-4)
    midway = (
        align_along_paths(passes, DiscontinuitySettings(reference="midway")).pairs[0].discontinuity
    )
    npt.assert_allclose(midway.filtered[0], 0.005, rtol=0, atol=STEP)
    npt.assert_allclose(midway.filtered[1], -0.005, rtol=0, atol=STEP)


def test_histograms_hold_all_heights_of_both_passes() -> None:
    passes = pair(ground=waves)
    middle = straight_reference(straight(0.5, 0.0), straight(19.5, 0.0))
    vector = align_along_paths(passes, paths={("left", "right"): middle}).pairs[0].discontinuity
    k = 30
    for row, (name, points) in enumerate(passes.items()):
        assert vector.names[row] == name
        x, y = middle.curve.easting[k], middle.curve.northing[k]
        away = np.hypot(points.easting - x, points.northing - y)
        inside = np.sort(points.up.values[away <= OPTIONS.radius])
        edges, quantity = vector.histograms[row][k]
        assert quantity.sum() == vector.count[row, k] == inside.size
        counted, _ = np.histogram(np.rint(inside / STEP) * STEP + 1e-9, edges)
        npt.assert_array_equal(quantity, counted)
        assert vector.height[row, k] == pytest.approx(inside.mean(), abs=STEP)
        assert vector.sd[row, k] == pytest.approx(inside.std(ddof=1), abs=STEP)
        median = vector.histograms[row].median[k]
        assert median == pytest.approx(np.median(inside), abs=5e-4)  # half a bin


def test_medians_leave_out_what_lies_on_the_road_in_one_pass() -> None:
    passes = pair(drift=no_drift)
    x, y = straight(np.full(60, 10.0), np.linspace(-0.15, 0.15, 60))
    leaf = make_points(x, y, np.full(60, 123.3))
    passes["left"] = xr.concat([passes["left"], leaf], "point")
    mean = align_along_paths(passes, fix="right").pairs[0].discontinuity
    median = (
        align_along_paths(passes, DiscontinuitySettings(statistic="median"), fix="right")
        .pairs[0]
        .discontinuity
    )
    assert mean.names == ("right", "left")
    assert np.nanmax(mean.raw[1]) > 0.01
    # half a bin, by the fraction of points on the leaf
    npt.assert_allclose(median.raw[1][~median.gap], 0.0, rtol=0, atol=1e-4)


def test_three_passes_are_chained_from_the_fixed_one() -> None:
    passes = {
        "a": one_pass(-0.3, 1.2, drift=wave, seed=1),
        "b": one_pass(-1.2, 0.3, seed=2),
        "c": one_pass(-2.2, -0.6, drift=lambda s: -0.03 + 0.001 * s, seed=3),
    }
    found = align_along_paths(passes, fix="b")
    assert found.names[0] == "b"
    assert "b" not in found.corrections
    assert {one.names for one in found.pairs} == {("b", "a"), ("b", "c")}
    assert all(one.corrected == one.names[1:] for one in found.pairs)
    assert len(found.states) == 3
    assert abs(found.states[0]["b", "c"].median) > 0.015
    assert abs(found.states[-1]["b", "c"].median) < 1e-4
    assert abs(found.states[-1]["a", "b"].median) < 1e-4
    joined = found.names[1]  # after the first pair only that one agrees
    waiting = found.names[2]
    assert abs(found.states[1][tuple(sorted(("b", joined)))].median) < 1e-4
    other = tuple(sorted(("b", waiting)))
    assert found.states[1][other] == found.states[0][other]


def test_three_adjacent_passes_are_aligned_in_order() -> None:
    passes = {
        "1": one_pass(-0.3, 1.2, drift=lambda s: np.full(s.shape, 0.02), seed=1),
        "2": one_pass(-1.2, 0.3, seed=2),
        "3": one_pass(-2.2, -0.6, drift=lambda s: -0.03 + 0.001 * s, seed=3),
    }
    found = align_along_paths(passes)
    assert found.names == ("1", "2", "3")
    assert [one.corrected for one in found.pairs] == [("1", "2"), ("3",)]
    npt.assert_allclose(found.corrections["1"].height, 0.01, rtol=0, atol=2e-4)
    second, third = (
        found.correction(name, *straight(np.array([10.0]), np.array([-0.9]))).height[0]
        for name in "23"
    )
    assert third - second == pytest.approx(-0.02, abs=1e-4)
    backwards = align_along_paths(passes, order=["3", "2", "1"])
    assert backwards.names == ("3", "2", "1")
    assert backwards.states[-1]["1", "2"].rmse < 1e-4


def test_the_result_is_the_same_bits_for_any_blocks_and_order() -> None:
    passes = pair(ground=waves)
    whole = align_along_paths(passes)
    rng = np.random.default_rng(5)
    shuffled = {
        name: points.isel(point=rng.permutation(points.sizes["point"]))
        for name, points in reversed(passes.items())
    }

    def blocks(points: xr.Dataset) -> list[xr.Dataset]:
        return [
            points.isel(point=slice(k, k + 7001)) for k in range(0, points.sizes["point"], 7001)
        ]

    parts = {"left": blocks(shuffled["left"]), "right": lambda: iter(blocks(shuffled["right"]))}
    other = align_along_paths(parts)
    for name in passes:
        npt.assert_array_equal(whole.corrections[name].height, other.corrections[name].height)
    assert whole.pairs[0].after == other.pairs[0].after
    assert whole.states == other.states


def test_gaps_are_bridged_and_flagged() -> None:
    passes = pair(drift=lambda s: 0.01 + 0.001 * s)
    s = 0.8 * (passes["left"].easting - 650_000) + 0.6 * (passes["left"].northing - 6_800_000)
    passes["left"] = passes["left"].isel(point=np.flatnonzero((s < 8) | (s > 13)))
    middle = straight_reference(straight(0.5, 0.0), straight(19.5, 0.0))
    vector = align_along_paths(passes, paths={("left", "right"): middle}).pairs[0].discontinuity
    s = 0.5 + vector.station
    missing = (s > 8) & (s < 13)
    assert vector.gap[missing].all()
    assert vector.thin[missing].all()
    assert not vector.gap[(s < 7.7) | (s > 13.3)].any()
    assert np.isnan(vector.raw[:, missing]).all()
    apart = vector.filtered[0] - vector.filtered[1]
    npt.assert_allclose(apart, 0.01 + 0.001 * s, rtol=0, atol=1.5e-4)


def test_the_seam_is_the_step_of_the_merged_ground() -> None:
    """Where one of two passes of equal density ends, the merged ground steps by half of it."""
    passes = pair(ground=waves, drift=lambda s: np.full(s.shape, 0.012))
    found = align_along_paths(passes).pairs[0]
    assert found.seam_before.median == pytest.approx(0.006, abs=3e-4)
    npt.assert_allclose(found.seam_before.step[0], 0.006, rtol=0, atol=1e-3)
    npt.assert_allclose(found.seam_before.step[1], -0.006, rtol=0, atol=1e-3)
    assert found.seam_after.median < 2e-4  # [m] places of points in cells on waves


def test_passes_that_agree_get_no_correction() -> None:
    found = align_along_paths(pair(drift=no_drift))
    npt.assert_allclose(found.corrections["left"].height, 0.0, rtol=0, atol=EXACT)


def test_points_that_are_not_finite_are_left_out_and_counted() -> None:
    passes = pair()
    bad = passes["left"].copy(deep=True)
    bad["up"][::5] = np.nan
    bad["easting"][1::5] = np.inf
    found = align_along_paths(passes | {"left": bad})
    assert found.left_out == {"left": 2 * -(-bad.sizes["point"] // 5), "right": 0}
    assert found.pairs[0].after.rmse < 5e-4
    after = correct_points(bad, found, "left")
    npt.assert_array_equal(np.isnan(after.up), np.isnan(bad.up))


def test_a_single_pass_is_refused() -> None:
    with pytest.raises(ValueError, match="passes must be at least 2, got 1"):
        align_along_paths({"left": one_pass(-0.3, 1.2)})


def test_passes_that_do_not_overlap_are_refused() -> None:
    passes = {"left": one_pass(0.5, 1.2), "right": one_pass(-1.2, 0.0)}
    with pytest.raises(CoverageError, match=r"pass right: overlaps with none of left\..*"):
        align_along_paths(passes)


def test_an_overlap_too_thin_for_the_search_area_is_refused_with_station_and_width() -> None:
    passes = {"left": one_pass(-0.1, 1.2, seed=1), "right": one_pass(-1.2, 0.1, seed=2)}
    with pytest.raises(
        CoverageError,
        match=r"overlap of left and right: is too narrow for search areas 0.4 m long and 0.4 m "
        r"wide at \d+ of \d+ reference points, first at station \d.\d\d m, where it is 0.\d\d m "
        r"wide",
    ):
        align_along_paths(passes)
    assert (
        align_along_paths(passes, DiscontinuitySettings(radius=0.05, least=5)).pairs[0].after.n > 30
    )


def test_too_few_points_are_refused() -> None:
    with pytest.raises(CoverageError, match="fewer than 100000 points of a pass"):
        align_along_paths(pair(), DiscontinuitySettings(least=100_000))


def test_a_path_beside_the_overlap_is_refused() -> None:
    beside = straight_reference(straight(0, 1.0), straight(20, 1.0))
    with pytest.raises(CoverageError, match=r"too narrow .* 0.00 m wide"):
        align_along_paths(pair(), paths={("right", "left"): beside})


def test_different_crs_are_refused() -> None:
    passes = {
        "left": one_pass(-0.3, 1.2, crs="EPSG:2154"),
        "right": one_pass(-1.2, 0.3, crs="EPSG:25832"),
    }
    with pytest.raises(SchemaError, match=r"pass right: .*'EPSG:25832'.* pass left is 'EPSG:2154'"):
        align_along_paths(passes)


def test_the_same_points_twice_are_refused() -> None:
    with pytest.raises(TrueTerrainError, match="pass b: holds the same points as pass a"):
        align_along_paths({"a": one_pass(-0.3, 1.2), "b": one_pass(-0.3, 1.2)})


def test_an_iterator_is_refused_since_it_runs_dry() -> None:
    passes = pair()
    with pytest.raises(ValueError, match="exhausted after one iteration"):
        align_along_paths(passes | {"left": iter([passes["left"]])})


@pytest.mark.parametrize(
    ("how", "message"),
    [
        ({"fix": "middle"}, "fix must be one of left, right, got 'middle'"),
        ({"order": ["left"]}, "order must name each of left, right once, got left"),
        ({"order": ["left", "right"], "fix": "right"}, "order must begin with the fixed pass"),
        (
            {"paths": {("left", "x"): straight_reference((0, 0), (1, 0))}},
            "paths must name pairs of passes that overlap",
        ),
    ],
)
def test_unknown_names_are_refused(how, message) -> None:
    with pytest.raises(ValueError, match=message):
        align_along_paths(pair(), **how)


@pytest.mark.parametrize(
    ("how", "message"),
    [
        ({"radius": 0.0}, "radius must be greater than 0 m"),
        ({"cut_off": 0.3}, "cut_off must be at least twice the spacing"),
        ({"statistic": "mode"}, "statistic must be one of mean, median"),
        ({"reference": "sum"}, "reference must be one of pooled, midway"),
        ({"least": 1}, "least must be at least 2"),
        ({"max_gap_fraction": 1.0}, "max_gap_fraction must be at least 0 and less than 1"),
        ({"bin_width": 1.5e-5}, "bin_width must be a multiple"),
    ],
)
def test_options_that_make_no_sense_are_refused(how, message) -> None:
    with pytest.raises(ValueError, match=message):
        DiscontinuitySettings(**how)


def test_an_unknown_pass_cannot_be_corrected() -> None:
    passes = pair()
    with pytest.raises(ValueError, match="name must be one of left, right, got 'middle'"):
        correct_points(passes["left"], align_along_paths(passes), "middle")


def test_waypoints_of_a_curve_give_what_the_found_centre_gives() -> None:
    passes = pair(curve=circle, ground=sloped)
    s = np.linspace(0.5, 19.5, 40)
    given = align_along_paths(passes, paths=waypoint_reference(*circle(s, np.zeros(s.size))))
    found = align_along_paths(passes)
    at = circle(np.array([6.0, 10.0, 14.0]), np.full(3, 0.8))
    npt.assert_allclose(
        given.correction("left", *at).height,
        found.correction("left", *at).height,
        rtol=0,
        atol=DRIFT,
    )


class TestLowPass:
    """The filter: Gaussian, without phase, bending nothing."""

    x = np.arange(2000) * 0.1

    @pytest.mark.parametrize("wavelength", [2.5, 5.0, 10.0, 20.0, 200.0])
    def test_waves_pass_as_the_gaussian_says(self, wavelength) -> None:
        wave = np.exp(2j * np.pi * self.x / wavelength)
        passed = [low_pass(part, 0.1, 5.0, closed=True) for part in (wave.real, wave.imag)]
        wanted = 0.5 ** ((5.0 / wavelength) ** 2) * wave
        npt.assert_allclose(passed[0] + 1j * passed[1], wanted, rtol=0, atol=2e-6)  # cut at 1e-6

    def test_straight_lines_pass_whole_with_gaps_and_at_the_ends(self) -> None:
        line = 3.0 - 0.2 * self.x
        values = line.copy()
        values[[100, 101, 102, 500]] = np.nan
        values[700:900] = np.nan
        npt.assert_allclose(low_pass(values, 0.1, 5.0), line, rtol=0, atol=EXACT)

    def test_it_has_no_phase(self) -> None:
        values = np.zeros(401)
        values[200] = 1.0
        smooth = low_pass(values, 0.1, 5.0)
        npt.assert_allclose(smooth, smooth[::-1], rtol=0, atol=1e-15)
        assert smooth.argmax() == 200

    def test_it_stays_constant_outside_of_the_values(self) -> None:
        values = np.where((self.x > 20) & (self.x < 100), self.x, np.nan)
        smooth = low_pass(values, 0.1, 5.0)
        npt.assert_allclose(smooth[self.x < 20], smooth[201], rtol=0, atol=EXACT)
        npt.assert_allclose(smooth[self.x > 100], smooth[999], rtol=0, atol=EXACT)

    def test_gaps_at_the_seam_of_a_closed_course_are_bridged(self) -> None:
        wave = np.cos(2 * np.pi * self.x / 200)
        values = wave.copy()
        values[:20] = values[-20:] = np.nan
        npt.assert_allclose(low_pass(values, 0.1, 5.0, closed=True), wave, rtol=0, atol=0.01)

    def test_odd_inputs(self) -> None:
        npt.assert_array_equal(low_pass(np.full(4, np.nan), 0.1, 5.0), np.full(4, np.nan))
        one = np.array([np.nan, 2.0, np.nan])
        npt.assert_array_equal(low_pass(one, 0.1, 5.0), np.full(3, 2.0))
        with pytest.raises(ValueError, match="cut_off must be greater than 0 m"):
            low_pass(one, 0.1, 0.0)

    def test_a_cut_off_longer_than_a_closed_course_leaves_its_mean(self) -> None:
        values = np.arange(8.0)
        npt.assert_allclose(low_pass(values, 1.0, 50.0, closed=True), 3.5, rtol=0, atol=0.01)


def test_a_rectangle_suits_a_thin_overlap() -> None:
    passes = {
        "left": one_pass(-0.12, 1.2, ground=sloped, drift=wave, seed=1),
        "right": one_pass(-1.2, 0.12, ground=sloped, seed=2),
    }
    with pytest.raises(CoverageError, match="too narrow"):
        align_along_paths(passes)
    found = align_along_paths(passes, area=Rectangle(length=0.6, width=0.15)).pairs[0]
    assert found.discontinuity.gap.mean() < 0.1
    assert found.after.rmse < AMPLITUDE * (1 - PASSED) + 2 * DRIFT


def test_passes_over_the_same_lane_agree_though_neither_ends_inside_the_other() -> None:
    passes = {
        "first": one_pass(-0.6, 0.6, ground=sloped, drift=wave, seed=1),
        "again": one_pass(-0.6, 0.6, ground=sloped, seed=2),
    }
    found = align_along_paths(passes, fix="first").pairs[0]
    assert found.corrected == ("again",)
    assert found.after.rmse < AMPLITUDE * (1 - PASSED) + 2 * DRIFT
    assert np.isnan(found.seam_before.median)


def test_stations_of_one_path_count_for_all_pairs() -> None:
    """Three passes of a course around a centre, with polar stations."""
    around = 2 * np.pi * RADIUS
    passes = {
        name: one_pass(
            right, right + 1.2, curve=circle, drift=drift, end=around, spacing=0.04, seed=k
        )
        for k, (name, right, drift) in enumerate(
            [("inner", 0.2, wave_around), ("middle", -0.4, no_drift), ("outer", -1.0, wave_around)]
        )
    }
    ring = polar_reference((0.0, 0.0), RADIUS)
    found = align_along_paths(passes, paths=ring, fix="middle")
    assert {one.names[1] for one in found.pairs} == {"inner", "outer"}
    for one in found.pairs:
        assert not one.discontinuity.gap.any()
        wanted = wave_around(one.path.curve.s)
        npt.assert_allclose(one.discontinuity.filtered[1], wanted, rtol=0, atol=2 * DRIFT)


def wave_around(s: np.ndarray) -> np.ndarray:
    return 0.02 + AMPLITUDE * np.cos(6 * s / RADIUS)


def test_the_standard_deviation_of_the_vector_holds() -> None:
    rng = np.random.default_rng(8)
    passes = {
        name: points.assign(up=points.up + 0.005 * rng.standard_normal(points.sizes["point"]))
        for name, points in pair(drift=no_drift, spacing=0.04, end=120.0).items()
    }
    options = DiscontinuitySettings(spacing=0.45)  # discs apart, so that they are independent
    vector = align_along_paths(passes, options).pairs[0].discontinuity
    ratio = (vector.raw / vector.error)[:, ~vector.gap]
    assert 0.9 < np.sqrt(np.mean(ratio**2)) < 1.1
