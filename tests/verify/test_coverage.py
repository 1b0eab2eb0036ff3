"""How often intervals of figures of accuracy hold the truth, in repeats of whole tests.

The true value of a figure is that over all repeats under the same conditions: the root of the mean
of their mean squares, or the mean of their means. A repeat has its plate at another place beside
the beams, and another draw of noise, drift and motion. Here all repeats of the test itself stand
for it; of 200, it is known far better than any one of them knows it.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import binom

from trueterrain.core.schemas import make_profile
from trueterrain.verify.drift import DriftSettings, drift_test
from trueterrain.verify.dynamic import DynamicSettings, dynamic_test
from trueterrain.verify.static import StaticSettings, static_test
from trueterrain.verify.statistics.uncertainty import mean_figure, rms_figure

from . import test_dynamic as driven
from ._plates import machined, standing

pytestmark = pytest.mark.slow

REPEATS = 200
CHANCE = 0.01  # of a count outside of the limits at the stated coverage, half on either side
SEARCH = 0.003  # [m] the plate is looked for around its place, which is not what is tested here
WITHIN = 0.05  # [m] places of the plate: many times the distance of beams, scans and cells
CROSSING = (1.4, 2.2)  # [s] in which the plate is driven over


def limits(coverage):
    """Limits of the number of 200 repeats that hold the true value, for a stated coverage.

    Of 95 %, 181 to 197; outside of them are 0.5 % of all counts.
    """
    return binom.ppf([CHANCE / 2, 1 - CHANCE / 2], REPEATS, coverage)


def held(figures, *, mean=False):
    """In how many repeats the interval holds the true value."""
    values = np.array([one.value for one in figures])
    truth = values.mean() if mean else np.sqrt(np.mean(values**2))
    return sum(one.low <= truth <= one.high for one in figures)


def gauss_markov(rng, shape, spacing, length):
    """Gauss-Markov series of variance 1 whose correlation falls to 1/e in a length."""
    kept = np.exp(-spacing / length)
    begin = int(12 * length / spacing)
    white = rng.normal(size=(*shape[:-1], shape[-1] + begin))
    return lfilter([np.sqrt(1 - kept**2)], [1, -kept], white)[..., begin:]


def figures(rows, name):
    """A figure of all repeats."""
    return [getattr(row, name) for row in rows]


@pytest.fixture(scope="module")
def static_rows():
    """Rows of static tests of 30 scans and 301 beams."""
    rows = []
    for seed in range(REPEATS):
        rng = np.random.default_rng([1, seed])
        shift = -0.6 + WITHIN * rng.uniform()
        run = standing(scans=30, beams=301, shift=shift, tilt=0.003 * rng.normal(), seed=seed)
        settings = StaticSettings(min_scans=30, assumed=shift, search=SEARCH)
        rows.append(static_test(run, machined(), settings)[0].row)
    return rows


def dynamic_rows(monkeypatch, *, sd, duration, confidence=0.95):
    """Rows of dynamic tests whose motion has height errors of a Gauss-Markov process."""
    rows = []
    for seed in range(REPEATS):
        rng = np.random.default_rng([2, seed])
        begin = driven.BEGIN + WITHIN * rng.uniform()
        monkeypatch.setattr(driven, "BEGIN", begin)
        run = driven._run(seed=seed)
        monkeypatch.undo()
        motion = driven._motion()
        wrong = motion.position.copy()
        wrong[:, 2] += sd * gauss_markov(rng, motion.time.shape, 0.001, duration)
        settings = DynamicSettings(
            begin=CROSSING[0],
            end=CROSSING[1],
            assumed=begin - CROSSING[0] * driven.SPEED,
            search=SEARCH,
            confidence=confidence,
        )
        rows.append(dynamic_test(run, machined(), replace(motion, position=wrong), settings).row)
    return rows


def drift_rows(length, *, offset=0.0, confidence=0.95):
    """Rows of drift tests of four runs over 500 m, each with its own drift and offset [m]."""
    s = np.arange(501.0)
    flat = make_profile(s, 0 * s)
    settings = DriftSettings(min_length=500.0, confidence=confidence)
    rows = []
    for seed in range(REPEATS):
        rng = np.random.default_rng([3, seed])
        errors = 0.003 * gauss_markov(rng, (4, s.size), 1.0, length)
        errors += offset * rng.normal(size=(4, 1)) + 0.0005 * rng.normal(size=errors.shape)
        rows.append(drift_test([make_profile(s, error) for error in errors], flat, settings).row)
    return rows


def test_static_intervals_have_their_stated_coverage(static_rows):
    low, high = limits(0.95)
    off_edges = figures(static_rows, "off_edges")
    assert low <= held(off_edges) <= high
    assert all(one.trusted for one in off_edges)
    # the fit of the offset leaves less of the mean than errors alone would: the interval is wide
    assert held(figures(static_rows, "bias"), mean=True) >= low


def test_figures_dominated_by_single_beams_are_not_trusted(static_rows):
    """A beam meets a face of 40 mm in some of the repeats only."""
    rms = figures(static_rows, "rms")
    assert held(rms) < limits(0.95)[0]
    for name in ("rms", "distance", "bias"):
        assert not any(one.trusted for one in figures(static_rows, name))


def test_dynamic_intervals_have_their_stated_coverage(monkeypatch):
    rows = dynamic_rows(monkeypatch, sd=3e-4, duration=0.02)
    low, high = limits(0.95)
    assert low <= held(figures(rows, "off_edges")) <= high
    assert held(figures(rows, "bias"), mean=True) >= low
    # a crossing holds some ten independent errors of the motion
    assert sum(one.trusted for one in figures(rows, "off_edges")) < 0.5 * REPEATS


@pytest.mark.parametrize(("length", "offset"), [(10.0, 0.0), (50.0, 0.0), (10.0, 0.003)])
def test_drift_intervals_have_their_stated_coverage(length, offset):
    """Drift over 10 and 50 of 500 m, and what is constant in a run."""
    rows = drift_rows(length, offset=offset)
    low, high = limits(0.95)
    assert low <= held(figures(rows, "rms")) <= high
    assert low <= held(figures(rows, "bias"), mean=True) <= high


def test_intervals_of_less_confidence_have_at_least_their_stated_coverage():
    """The widest of three intervals is conservative, most of all at low confidence."""
    rows = drift_rows(10.0, confidence=0.8)
    low, _ = limits(0.8)
    for name in ("rms", "bias"):
        assert low <= held(figures(rows, name), mean=name == "bias") < limits(0.95)[1]


@pytest.mark.parametrize(
    ("correlation", "count"), [(0.0, 300), (0.7, 300), (0.9, 600), (0.9, 120), (0.99, 600)]
)
def test_intervals_of_correlated_errors_have_at_least_their_stated_coverage(correlation, count):
    """Root mean square 1 and mean 0, known without repeats."""
    rng = np.random.default_rng(20)
    length = -1 / np.log(correlation) if correlation else 1e-3
    errors = [gauss_markov(rng, (count,), 1.0, length) for _ in range(REPEATS)]
    low, _ = limits(0.95)
    rms, mean = ([figure(one) for one in errors] for figure in (rms_figure, mean_figure))
    assert sum(one.low <= 1 <= one.high for one in rms) >= low
    assert sum(one.low <= 0 <= one.high for one in mean) >= low


def test_slow_errors_half_hidden_by_noise_are_not_overlooked():
    """Levelled, as the registration does: over a plate they happen to be small now and then."""
    rng = np.random.default_rng(22)
    place = np.arange(100)
    errors = []
    for _ in range(REPEATS):
        slow = gauss_markov(rng, (place.size,), 1.0, 150.0)
        level = np.polyval(np.polyfit(place, slow, 1), place)
        errors.append(rms_figure(slow - level + 0.3 * rng.normal(size=place.size)))
    assert held(errors) >= limits(0.95)[0]


def test_few_large_errors_are_few_independent_ones():
    rng = np.random.default_rng(23)
    error = rng.normal(size=400)
    assert rms_figure(error).trusted
    error[200] = 100.0
    assert rms_figure(error).independent < 5
    assert rms_figure(error[:190], most=6).independent == 6
    assert not mean_figure(error[:190], most=6).trusted


def test_a_constant_error_has_no_uncertainty():
    found = rms_figure(0.002 + 1e-6 * np.random.default_rng(24).normal(size=200))
    assert found.trusted
    np.testing.assert_allclose((found.low, found.high), 0.002, rtol=0, atol=1e-6)  # [m] noise


def test_invalid_errors_are_refused():
    with pytest.raises(ValueError, match="at least 8 finite"):
        rms_figure([0.001, 0.002])
    with pytest.raises(ValueError, match="finite"):
        rms_figure(np.full(20, np.nan))
    with pytest.raises(ValueError, match="confidence"):
        rms_figure(np.ones(20), confidence=0.0)
    with pytest.raises(ValueError, match="block"):
        rms_figure(np.ones(20), block=0)
