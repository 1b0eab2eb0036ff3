"""Corrections as splines, and the covariance of their prior."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.interpolate import BSpline

from trueterrain.alignment import GaussMarkovProcess, SplineCorrection, SplineKnots
from trueterrain.alignment.adjustment.spline import knots_over

ROUNDING = 1e-12  # [1] of sums of four products


def dense(rows):
    """Dense matrix from three diagonals."""
    return np.diag(rows[0]) + np.diag(rows[1, 1:], -1) + np.diag(rows[2, 2:], -2)


def basis_matrix(knots, time):
    interval, weights = knots.basis(time)
    matrix = np.zeros((len(time), knots.intervals + 3))
    for n in range(4):
        matrix[np.arange(len(time)), interval + n] = weights[:, n]
    return matrix


def test_basis_is_that_of_scipy():
    knots = SplineKnots(begin=-1.0, spacing=0.5, intervals=6)
    time = np.linspace(-1.0, 2.0, 200)[:-1]
    places = -1.0 + 0.5 * np.arange(-3, 10)
    truth = BSpline.design_matrix(time, places, 3).toarray()
    assert_allclose(basis_matrix(knots, time), truth, rtol=0, atol=ROUNDING)


def test_times_beyond_the_ends_are_taken_as_the_ends():
    knots = knots_over(2.0, 7.0, 2.0)
    assert (knots.begin, knots.end) == (1.5, 7.5)
    inside, outside = basis_matrix(knots, [1.5, 7.5]), basis_matrix(knots, [-9.0, 99.0])
    assert_allclose(outside, inside, rtol=0, atol=0)


@pytest.mark.parametrize("order", ["first", "second"])
def test_a_spline_has_the_covariance_of_its_process(order):
    """Variance and correlation of the spline by its prior, against those of the process."""
    process = GaussMarkovProcess(sd=0.02, correlation_time=25.0, order=order)
    knots = SplineKnots(begin=0.0, spacing=1.0, intervals=197)
    whitening = dense(process.whitening(np.full(200, process.sd), 1.0))
    covariance = np.linalg.inv(whitening.T @ whitening)
    time = np.linspace(10.0, 187.0, 1000)
    matrix = basis_matrix(knots, time)
    spline = matrix @ covariance @ matrix.T
    # a spline is not the process: they agree to 1 % at this spacing
    assert_allclose(np.diag(spline), process.sd**2, rtol=0, atol=0.01 * process.sd**2)
    truth = process.sd**2 * process.correlation(time - time[0])
    assert_allclose(spline[0], truth, rtol=0, atol=0.03 * process.sd**2)


def test_autocorrelation_falls_to_1_over_e_after_the_correlation_time():
    for order in ("first", "second"):
        process = GaussMarkovProcess(sd=1.0, correlation_time=7.0, order=order)
        assert_allclose(process.correlation([0.0, 7.0]), [1.0, np.exp(-1)], rtol=0, atol=1e-12)


def test_drift_scales_with_the_reported_sd():
    sd = np.where(np.arange(60) < 30, 0.01, 0.1)
    whitening = dense(GaussMarkovProcess(sd=1.0).whitening(sd, 1.0))
    variance = np.diag(np.linalg.inv(whitening.T @ whitening))
    assert_allclose(variance[59] / variance[0], 100.0, rtol=0, atol=1e-6)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"sd": -1.0}, "sd must be at least 0"),
        ({"sd": 1.0, "correlation_time": 0.0}, "correlation_time must be greater than 0"),
        ({"sd": 1.0, "order": "third"}, "order must be first or second"),
    ],
)
def test_wrong_processes_are_refused(wrong, message):
    with pytest.raises(ValueError, match=message):
        GaussMarkovProcess(**wrong)


@pytest.fixture
def correction():
    """Height and roll, with a covariance of its own."""
    rng = np.random.default_rng(2)
    knots = SplineKnots(begin=0.0, spacing=2.0, intervals=5)
    parts = rng.normal(size=(5, 8, 8))
    return SplineCorrection(
        name="a",
        knots=knots,
        components=("height", "roll"),
        coefficients=rng.normal(size=(2, 8)),
        offset=np.zeros(2),
        covariance=parts @ parts.transpose(0, 2, 1),
        residual_sd=0.3,
        supported=np.array([True, False, False, True, False]),
    )


def test_height_and_roll_add_up(correction):
    time, offset = np.array([[0.3, 4.0], [7.7, 9.9]]), np.array([[1.0, -2.0], [0.5, 0.0]])
    matrix = basis_matrix(correction.knots, time.ravel())
    height, roll = matrix @ correction.coefficients.T[:, 0], matrix @ correction.coefficients[1]
    truth = height.reshape(2, 2) + offset * roll.reshape(2, 2)
    assert_allclose(correction.height_at(time, offset), truth, rtol=0, atol=ROUNDING)
    assert_allclose(correction(time, "pitch"), 0.0, rtol=0, atol=0)
    with pytest.raises(ValueError, match="component must be one of height, roll"):
        correction(time, "heave")


def test_standard_deviation_is_that_of_the_covariance(correction):
    interval, weights = correction.knots.basis([3.1])
    row = np.concatenate([weights[0], -1.5 * weights[0]])
    truth = np.sqrt(row @ correction.covariance[interval[0]] @ row + 0.3**2)
    assert_allclose(correction.sd(3.1, offset=-1.5), truth, rtol=0, atol=ROUNDING)


def test_spans_without_support_are_reported(correction):
    assert correction.unsupported == [(2.0, 6.0), (8.0, 10.0)]
