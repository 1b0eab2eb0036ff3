"""The network adjustment on simulated cells with known truth."""

import re
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from trueterrain.alignment import NetworkSettings, adjust_passes, make_pass_cells
from trueterrain.alignment.adjustment.model_search import fit_unconstrained
from trueterrain.alignment.adjustment.shared_cells import find_shared_cells
from trueterrain.alignment.adjustment.system import build_system
from trueterrain.core.errors import CoverageError, TrueTerrainError
from trueterrain.simulate.noise import SecondOrderGaussMarkov

SPEED = 10.0  # [m/s]
SIZE = 0.5  # [m] of a cell
NOISE = 1e-3  # [m] of a cell's height
SAME = 1e-9  # [m] rounding of the solver
NO_SD = np.zeros((2, 0))  # of a navigation that says none
LEFT_TO_GO = 0.3  # [1] standard deviations, of the sum of all steps after one of 0.01
PLAIN = NetworkSettings(components=("height",), knot_spacing=(1.0, 0.5, 0.25))
#: weights by variance alone: plain least squares
LEAST_SQUARES = replace(PLAIN, huber=1e3, tukey=1e6)


class Road:
    """Cells of a road of 3 m width, and passes over it, each with its own drift."""

    def __init__(self, length=300.0, width=3.0, seed=1):
        self.rng = np.random.default_rng(seed)
        along, across = np.meshgrid(
            np.arange(SIZE / 2, length, SIZE),
            np.arange(SIZE / 2, width, SIZE) - width / 2,
            indexing="ij",
        )
        self.s, self.v = along.ravel(), across.ravel()
        self.ground = self.rng.normal(0, 0.05, self.s.size)
        self.clock = np.arange(0, length / SPEED + 1, 0.02)

    def process(self, sd=0.018, tau=25.0):
        """Smooth drift of one pass at the times of the clock [m]."""
        process = SecondOrderGaussMarkov(rng=self.rng, sd=sd, correlation_time=tau, rate=50.0)
        return process.next(self.clock.size)[:, 0]

    def drive(self, name, drift=0.0, *, roll=0.0, noise=NOISE, some=None, begin=0.0, back=False):
        """Cells of a pass; drift at the times of the clock, or a number."""
        some = np.ones(self.s.size, bool) if some is None else some
        s, v = self.s[some], self.v[some]
        time = (self.clock[-1] - 1 - s / SPEED) if back else s / SPEED
        offset = -v if back else v
        up = np.interp(time, self.clock, np.broadcast_to(drift, self.clock.shape))
        height = self.ground[some] + up + roll * offset + self.rng.normal(0, noise, s.size)
        return make_pass_cells(
            name,
            np.flatnonzero(some),
            begin + time,
            height,
            variance=noise**2,
            easting=s,
            northing=v,
            offset=offset,
            count=30,
        )


def corrections(adjustment, time):
    return np.array([one(time) for one in adjustment.corrections])


def test_known_drift_is_removed_with_the_reported_sd():
    """Against a fixed pass: constant offset and drift, over several seeds."""
    ratio = []
    for seed in range(6):
        road = Road(600.0, seed=seed)
        drift = road.process() + road.rng.normal(0, 0.03)
        found = adjust_passes(
            [road.drive("a"), road.drive("b", drift)], fixed=["a"], settings=PLAIN
        ).correction("b")
        time = np.arange(0.025, 60.0, 0.05)
        error = found(time) + np.interp(time, road.clock, drift)
        assert np.abs(error).max() < 1e-3  # [m] a cell has 1 mm, and there are six across
        ratio.append(error / found.sd(time))
    assert 0.9 < np.sqrt(np.mean(np.square(ratio))) < 1.1


def test_the_less_accurate_pass_gets_the_correction():
    """A pass with ten times smaller reported sd gets hardly any correction."""
    road = Road()
    drift = road.process()
    time = road.clock
    sure, unsure = np.full(time.size, 0.005), np.full(time.size, 0.05)
    one = replace(road.drive("a", 0.0), sd_time=time, sd_height=sure)
    two = replace(road.drive("b", drift - drift.mean()), sd_time=time, sd_height=unsure)
    found = adjust_passes([one, two], settings=PLAIN)
    moved = [np.ptp(found.correction(name)(time)) for name in "ab"]
    assert moved[0] < 0.05 * moved[1]


def test_adjusted_ground_has_the_reported_sd():
    """Four passes with independent drift, relative to a fixed one."""
    road = Road(400.0)
    passes = [road.drive("a"), *(road.drive(name, road.process()) for name in "bcd")]
    found = adjust_passes(passes, fixed=["a"], settings=PLAIN).ground
    error = found.height - road.ground[found.cell]
    assert 0.9 < np.sqrt(np.mean((error / found.sd) ** 2)) < 1.1
    assert np.median(found.after) < 0.2 * np.median(found.before)


def test_order_of_passes_and_cells_does_not_matter():
    road = Road()
    passes = [road.drive(name, road.process()) for name in "abc"]
    mixed = [one.part(road.rng.permutation(len(one))) for one in (passes[2], passes[0], passes[1])]
    first, second = adjust_passes(passes, settings=PLAIN), adjust_passes(mixed, settings=PLAIN)
    for name in "abc":
        one, two = first.correction(name), second.correction(name)
        assert_allclose(two.coefficients, one.coefficients, rtol=0, atol=SAME)
    assert second.pairs == first.pairs


def test_a_shift_of_all_heights_changes_nothing():
    road = Road()
    passes = [road.drive(name, road.process()) for name in "ab"]
    higher = [replace(one, height=one.height + 7.0) for one in passes]
    time = np.linspace(0, 30, 50)
    first, second = (
        corrections(adjust_passes(some, settings=PLAIN), time) for some in (passes, higher)
    )
    assert_allclose(second, first, rtol=0, atol=SAME)


def test_the_mean_of_the_passes_is_the_datum():
    road = Road()
    found = adjust_passes(
        [road.drive(name, road.process() + 0.1) for name in "abc"], settings=PLAIN
    )
    time = np.linspace(found.corrections[0].knots.begin, found.corrections[0].knots.end, 2001)
    assert_allclose(corrections(found, time).mean(), 0.0, rtol=0, atol=1e-6)  # [m] mean of samples


def test_constant_offsets_are_those_of_least_squares():
    road = Road()
    passes = [road.drive("a", 0.010), road.drive("b", -0.004), road.drive("c", 0.001, noise=3e-3)]
    found = adjust_passes(passes, settings=replace(LEAST_SQUARES, strength=0.0))
    heights = np.array([one.height for one in passes])
    weight = 1.0 / (np.array([NOISE, NOISE, 3e-3]) ** 2 + found.noise_floor**2)
    # each cell has the same weights, so offsets are the mean differences from the weighted mean
    truth = -(heights - (weight @ heights) / weight.sum()).mean(axis=1)
    truth -= truth.mean()
    measured = corrections(found, [5.0])[:, 0]
    assert_allclose(measured, truth, rtol=0, atol=SAME)


def test_drift_linear_in_time_is_removed():
    """The spline holds a straight line, which is that of least squares between the passes."""
    road = Road()
    drift = 0.002 * (road.clock - 15.0)
    found = adjust_passes(
        [road.drive("a"), road.drive("b", drift)], fixed=["a"], settings=LEAST_SQUARES
    )
    one = found.correction("b")
    time = np.linspace(0, 30, 100)
    line = np.polyfit(time, one(time), 1)
    assert_allclose(line, [-0.002, 0.03], rtol=0, atol=2e-4)  # [m/s], [m] noise of 3600 cells
    assert np.abs(one(time) + 0.002 * (time - 15.0)).max() < 4 * one.sd(time).max()


def test_a_cross_tilt_is_that_of_least_squares():
    road = Road()
    passes = [road.drive("a"), road.drive("b", 0.02, roll=0.003)]
    settings = NetworkSettings(strength=0.0, huber=1e3, tukey=1e6, roll_sd=10.0, knot_spacing=1.0)
    found = adjust_passes(passes, fixed=["a"], settings=settings)
    assert found.chosen.components == ("height", "roll")
    difference = passes[1].height - passes[0].height
    design = np.stack([np.ones(road.v.size), road.v], axis=1)
    truth = -np.linalg.lstsq(design, difference, rcond=None)[0]
    one = found.correction("b")
    measured = [one([5.0])[0], one([5.0], "roll")[0]]
    # [m], [rad] the prior of 10 rad pulls a little
    assert_allclose(measured, truth, rtol=0, atol=1e-7)


def test_without_roll_there_is_no_roll_correction():
    """Without roll in the passes there is none in the corrections."""
    road = Road()
    settings = NetworkSettings(knot_spacing=1.0)
    found = adjust_passes([road.drive(name, road.process()) for name in "ab"], settings=settings)
    assert found.chosen.components == ("height",)
    assert found.omitted == ("roll", "east", "north")


@pytest.mark.slow
def test_without_drift_there_is_no_correction():
    """Corrections are within their noise, and the test for drift says so."""
    probabilities = []
    for seed in range(30):
        road = Road(seed=seed)
        found = adjust_passes([road.drive(name) for name in "ab"], settings=PLAIN)
        probabilities += [test.p_value for test in found.tests]
        time = np.linspace(0, 30, 200)
        for one in found.corrections:
            assert np.abs(one(time)).max() < 4 * one.sd(time).max()
            assert np.abs(one(time)).max() < 1.5e-4  # [m] a tenth of the noise of a cell and less
    assert min(probabilities) > 0.001
    assert 0.3 < np.mean(probabilities) < 0.7


def test_drift_is_detected_by_the_score_test():
    road = Road()
    found = adjust_passes(
        [road.drive("a"), road.drive("b", road.process(sd=0.002))], settings=PLAIN
    )
    assert [one.name for one in found.tests] == ["a", "b", ""]
    assert max(one.p_value for one in found.tests) < 1e-6


@pytest.mark.parametrize("passes", ["ab", "abc"])
def test_a_car_in_one_pass_is_rejected(passes):
    """An object as large as a car does not change the corrections; its cells are reported."""
    road = Road()
    drifts = {name: road.process() for name in passes}
    clean = [road.drive(name, drifts[name]) for name in passes]
    car = (np.abs(road.s - 100.0) < 2.25) & (np.abs(road.v) < 0.9)
    parked = replace(clean[0], height=clean[0].height + np.where(car, 1.4, 0.0))
    before = adjust_passes(clean, settings=PLAIN)
    after = adjust_passes([parked, *clean[1:]], settings=PLAIN)
    time = np.linspace(0, 30, 500)
    moved = corrections(after, time) - corrections(before, time)
    sd = np.array([one.sd(time) for one in before.corrections])
    assert (np.abs(moved) < 3 * sd).all()  # fewer cells carry the correction there
    rejected = after.rejected
    hit = np.isin(rejected.cell, np.flatnonzero(car)) & (rejected.name == "a")
    assert hit.sum() == car.sum()
    if passes == "abc":  # of three the others are right
        assert not np.isin(rejected.cell[rejected.name != "a"], np.flatnonzero(car)).any()
        assert_allclose(rejected.misfit[hit], 1.4, rtol=0, atol=0.01)


def test_loops_of_three_passes_close():
    """Each overlaps the next only; after the adjustment the closure of the medians is 0."""
    road = Road(width=6.0)
    halves = [(road.v < 1.0), (road.v > -1.0), (road.v < -0.5) | (road.v > 0.5)]
    passes = [
        road.drive(name, road.process() + up, some=some)
        for name, up, some in zip("abc", (0.0, 0.03, -0.02), halves, strict=True)
    ]
    found = adjust_passes(passes, settings=PLAIN)
    (loop,) = found.closures
    assert sorted(loop.passes) == ["a", "b", "c"]
    assert abs(loop.after) < 2e-4  # [m]
    assert abs(loop.before) > abs(loop.after)


def test_a_closed_course_closes_on_itself():
    """A pass that drives round twice is compared with itself."""
    road = Road(200.0)
    clock = np.arange(0, 45, 0.02)
    process = SecondOrderGaussMarkov(rng=road.rng, sd=0.02, correlation_time=25.0, rate=50.0)
    drift = process.next(clock.size)[:, 0]
    parts = []
    for turn in (0, 1):
        time = 20.0 * turn + road.s / SPEED
        noise = road.rng.normal(0, NOISE, time.size)
        parts.append(
            (np.arange(time.size), time, road.ground + np.interp(time, clock, drift) + noise)
        )
    cell, time, height = (np.concatenate(one) for one in zip(*parts, strict=True))
    oval = make_pass_cells(
        "oval",
        cell,
        time,
        height,
        variance=NOISE**2,
        easting=np.tile(road.s, 2),
        northing=np.tile(road.v, 2),
        count=30,
    )
    found = adjust_passes([oval], settings=PLAIN)
    (loop,) = found.closures
    assert loop.passes == ("oval",)
    assert abs(loop.after) < 1e-4  # [m]
    turn = np.linspace(1, 19, 200)
    one = found.correction("oval")
    step = one(turn + 20.0) - one(turn) + np.interp(turn + 20, clock, drift)
    assert np.abs(step - np.interp(turn, clock, drift)).max() < 1e-3  # [m] noise of six cells


def test_a_control_surface_is_the_datum():
    road = Road()
    near = np.abs(road.s - 150.0) < 20.0
    control = road.drive("plate", some=near, noise=2e-4)
    passes = [road.drive(name, road.process() + 0.05) for name in "ab"]
    found = adjust_passes(passes, control=[control], settings=PLAIN)
    assert found.names == ("a", "b")
    error = found.ground.height - road.ground[found.ground.cell]
    there = np.isin(found.ground.cell, np.flatnonzero(near))
    assert abs(np.mean(error[there])) < 1e-4  # [m]
    assert found.correction("a").sd(15.0) < found.correction("a").sd(2.0)


def test_groups_of_passes_have_datums_of_their_own():
    road = Road()
    left, right = road.s < 140.0, road.s > 160.0
    passes = [
        road.drive("a", 0.01, some=left),
        road.drive("b", 0.03, some=left),
        road.drive("c", 0.05, some=right),
        road.drive("d", 0.01, some=right),
    ]
    found = adjust_passes(passes, settings=replace(PLAIN, strength=0.0))
    assert found.groups == (("a", "b"), ("c", "d"))
    offsets = [float(found.correction(name)(20.0)) for name in "abcd"]
    assert_allclose(offsets, [0.01, -0.01, -0.02, 0.02], rtol=0, atol=2e-4)


def test_spans_without_overlap_are_reported_with_larger_sd():
    road = Road()
    short = road.drive("b", road.process(), some=road.s < 150.0)
    found = adjust_passes([road.drive("a", road.process()), short], settings=PLAIN).correction("a")
    ((begin, end),) = found.unsupported
    assert 14.0 < begin < 16.5
    assert end > 29.9
    assert found.sd(29.0) > 1.5 * found.sd(7.0)


def test_too_stiff_and_too_flexible_models_predict_worse():
    """The trials give the prediction error of held-out cells as a function of strength."""
    road = Road()
    found = adjust_passes([road.drive(name, road.process()) for name in "ab"], settings=PLAIN)
    best = found.chosen
    curve = {
        one.strength: one
        for one in found.trials
        if (one.knot_spacing, one.order) == (best.knot_spacing, best.order)
    }
    stiffest = min(one.held_out for one in found.trials if one.strength <= 1e-4)
    assert stiffest > 1.2 * best.held_out
    assert max(curve.values(), key=lambda one: one.log_likelihood) == best
    assert 0.005 < best.strength < 0.06  # [m] truth 0.018


def test_horizontal_shift_needs_relief():
    """It is estimated on a rough road and rejected on a level one."""
    settings = NetworkSettings(components=("height", "shift"), knot_spacing=1.0)
    road = Road()
    slope = road.rng.normal(0, 0.05, (2, road.s.size))
    shift = np.array([0.012, -0.008])

    def with_slope(cells, by):
        return replace(
            cells,
            slope_east=slope[0],
            slope_north=slope[1],
            height=cells.height - by @ slope,
        )

    passes = [with_slope(road.drive("a"), 0 * shift), with_slope(road.drive("b", 0.01), shift)]
    found = adjust_passes(passes, fixed=["a"], settings=settings)
    one = found.correction("b")
    assert found.omitted == ()
    measured = [float(one(15.0, name)) for name in ("east", "north")]
    assert_allclose(measured, -shift, rtol=0, atol=1.5e-3)  # [m] 1 mm / (0.05 sqrt(3600)) and more
    level = adjust_passes([road.drive("a"), road.drive("b", 0.01)], settings=settings)
    assert level.omitted == ("east", "north")


def test_cells_need_no_positions():
    """Without positions, consecutive cells are held out together."""
    road = Road()
    drift = road.process()
    passes = [road.drive("a"), road.drive("b", drift)]
    unplaced = [
        replace(one, easting=0.0 * one.easting, northing=0.0 * one.northing) for one in passes
    ]
    found = adjust_passes(unplaced, fixed=["a"], settings=PLAIN).correction("b")
    time = np.arange(0.025, 30.0, 0.05)
    assert np.abs(found(time) + np.interp(time, road.clock, drift)).max() < 1e-3  # [m]


def test_identical_passes_are_reported():
    road = Road()
    one = road.drive("a")
    found = adjust_passes([one, replace(one, name="b"), road.drive("c")], settings=PLAIN)
    assert found.identical == (("a", "b"),)


def test_passes_without_common_cells_are_refused():
    road = Road()
    passes = [road.drive("a", some=road.s < 100), road.drive("b", some=road.s > 200)]
    with pytest.raises(CoverageError, match="no cell is seen by two passes"):
        adjust_passes(passes)
    with pytest.raises(CoverageError, match="no cell is seen by two passes"):
        adjust_passes(passes[:1])
    with pytest.raises(CoverageError, match="b has no cells"):
        adjust_passes([passes[0], passes[1].part(np.zeros(len(passes[1]), bool))])


def test_names_must_be_unique_and_known():
    one = Road().drive("a")
    with pytest.raises(ValueError, match="names that differ, got 'a' 2 times"):
        adjust_passes([one, one])
    with pytest.raises(ValueError, match="fixed must name passes, got 'b'; there are a"):
        adjust_passes([one], fixed=["b"])
    with pytest.raises(ValueError, match="at least one pass"):
        adjust_passes([])
    found = adjust_passes([one, Road().drive("b")], settings=PLAIN)
    with pytest.raises(ValueError, match="name must be one of a, b, got 'c'"):
        found.correction("c")


def test_an_adjustment_that_does_not_converge_names_the_pass_and_the_place():
    """The message names the pass with gross errors and their position."""
    road = Road()
    passes = [road.drive(name) for name in "abc"]
    beyond = np.where(np.abs(passes[1].easting - 200) < 20, 1.0, 0.0)  # [m] no ground of the others
    passes[1] = replace(passes[1], height=passes[1].height + beyond)
    with pytest.raises(TrueTerrainError, match="did not converge in 1 iterations") as error:
        adjust_passes(passes, settings=replace(PLAIN, max_iterations=1))
    found = re.search(
        r"correction of (\w+) still changes by .* at easting ([\d.]+)", str(error.value)
    )
    assert found is not None
    assert found[1] == "b"
    assert abs(float(found[2]) - 200) < 20
    assert "--max-iterations" in str(error.value)


def rough_network(seed):
    """Two to six passes of few cells with drift, gross errors in up to most cells, wrong variances.

    Of the first 150, 14 did not converge in 60 iterations of plain steps with a noise floor that
    follows them: they crept, or went back and forth, those of seeds 17 and 70 in 1000 as well.
    """
    rng = np.random.default_rng(seed)
    n = int(rng.integers(30, 400))
    cell, noise = np.arange(n), 10 ** rng.uniform(-4, -1.5)
    ground, speed, passes = rng.normal(0, 0.1, n), rng.uniform(2, 50), []
    for number in range(int(rng.integers(2, 7))):
        seen = rng.random(n) < rng.uniform(0.3, 1)
        if number > 1:
            begin, end = np.sort(rng.integers(0, n, 2))
            seen &= ((cell >= begin) & (cell < end)) | (end - begin < 10)
        if seen.sum() < 5:
            seen[:] = True
        height = ground + rng.normal(0, noise, n) * np.where(rng.random(n) < 0.1, 10, 1)
        height += rng.normal(0, 0.05) + rng.normal(0, 0.05) * np.sin(cell / rng.uniform(3, 80))
        wrong = rng.random(n) < rng.choice([0, 0.01, 0.2, 0.5, 0.9])
        height += wrong * rng.choice([0.1, 1, 4]) * rng.choice([rng.normal(0, 1, n), np.ones(n)])
        at, back = cell[seen], rng.random() < 0.5
        passes.append(
            make_pass_cells(
                f"p{number}",
                at,
                (n - at if back else at) / speed,
                height[seen],
                variance=noise**2 * rng.choice([1, 0.01]),
                easting=0.5 * at,
                offset=rng.uniform(-1, 1, at.size),
            )
        )
    return passes


def robust_fit(seed, settings):
    """Corrections of such a network, and by how many of their sd another set differs from them."""
    shared = find_shared_cells(rough_network(seed), (), ())
    components = ("height", "roll") if seed % 2 else ("height",)
    system = build_system(
        shared, components, (1.0, 0.25, 0.1)[seed % 3], [NO_SD] * len(shared.names)
    )
    found = fit_unconstrained(system, settings)
    return found, lambda other: np.linalg.norm(
        system.whiten_change(found.solution, other.solution.x - found.solution.x)
    )


@pytest.mark.slow
def test_the_adjustment_converges_whatever_the_errors():
    iterations = [robust_fit(seed, NetworkSettings())[0].iterations for seed in range(150)]
    assert np.median(iterations) < 20
    loose = NetworkSettings(relative_tolerance=1.0)
    assert robust_fit(17, loose)[0].iterations < iterations[17]


@pytest.mark.parametrize("seed", range(0, 30, 3))
def test_the_result_is_the_limit_of_the_iteration(seed):
    """Compared with the same adjustment with much smaller tolerances."""
    exact = NetworkSettings(relative_tolerance=1e-9, tolerance=1e-12, max_iterations=5000)
    _, difference = robust_fit(seed, exact)
    assert difference(robust_fit(seed, NetworkSettings())[0]) < LEFT_TO_GO


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"knot_spacing": (1.0, 2.0)}, "from coarse to fine"),
        ({"knot_spacing": 0.0}, "knot_spacing must be greater than 0"),
        ({"strength": -1.0}, "strength must be at least 0"),
        ({"components": ("roll",)}, "components must be height and some of roll, pitch, shift"),
        ({"orders": ()}, "orders must be first, second or both"),
        ({"folds": 1}, "folds must be at least 2"),
        ({"tukey": 0.0}, "tukey must be greater than 0"),
    ],
)
def test_wrong_settings_are_refused(wrong, message):
    with pytest.raises(ValueError, match=message):
        NetworkSettings(**wrong)


def test_long_roads_are_sampled_to_choose_settings():
    """A sample of the road gives the same strength, and all of it is corrected."""
    road = Road(3000.0)
    passes = [road.drive("a"), road.drive("b", road.process())]
    found = adjust_passes(passes, fixed=["a"], settings=replace(PLAIN, sample=5000))
    assert 0.005 < found.chosen.strength < 0.06
    assert found.pairs[0].after.n == road.s.size
    assert found.pairs[0].after.rmse < 1.1 * np.sqrt(2) * NOISE


def test_public_names_can_be_imported():
    import trueterrain.alignment as package

    assert_array_equal([name for name in package.__all__ if not hasattr(package, name)], [])
