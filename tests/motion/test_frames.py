"""All attitude conventions agree; grid convergence and geoids are never ignored."""

import numpy as np
import pyproj
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from trueterrain.core.errors import CoverageError
from trueterrain.geometry import rotations

EXACT = 1e-14  # [1] elements of matrices: round-off only
ROUND_OFF = 1e-12  # [rad] angles converted and back
MICROMETRE = 1e-6  # [m] accuracy of PROJ's geocentric coordinates near the ground

RNG = np.random.default_rng(4)
ROLL = RNG.uniform(-1.5, 1.5, 300)
NOSE_UP = RNG.uniform(-1.5, 1.5, 300)
HEADING = RNG.uniform(0, 2 * np.pi, 300)

USES = ["flu to enu", "flu to nwu", "frd to ned", "enu to rfu"]


def rx(a):
    c, s, o = np.cos(a), np.sin(a), np.zeros_like(a)
    return np.moveaxis(np.array([[o + 1, o, o], [o, c, -s], [o, s, c]]), (0, 1), (-2, -1))


def ry(a):
    c, s, o = np.cos(a), np.sin(a), np.zeros_like(a)
    return np.moveaxis(np.array([[c, o, s], [o, o + 1, o], [-s, o, c]]), (0, 1), (-2, -1))


def rz(a):
    c, s, o = np.cos(a), np.sin(a), np.zeros_like(a)
    return np.moveaxis(np.array([[c, -s, o], [s, c, o], [o, o, o + 1]]), (0, 1), (-2, -1))


def truth():
    """Body to ground from first principles: north-east-down to east-north-up, body flipped."""
    swap = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])
    return swap @ rz(HEADING) @ ry(NOSE_UP) @ rx(ROLL) @ np.diag([1.0, -1, -1])


def test_sbet_angles():
    assert_allclose(
        rotations.from_sbet(ROLL, NOSE_UP, HEADING).as_matrix(), truth(), rtol=0, atol=EXACT
    )


def test_span_takes_the_same_values():
    found = rotations.from_span(ROLL, NOSE_UP, HEADING).as_matrix()
    assert_allclose(found, truth(), rtol=0, atol=EXACT)
    right_forward_up = rz(-HEADING) @ rx(NOSE_UP) @ ry(ROLL)
    assert_allclose(found[:, :, 0], right_forward_up[:, :, 1], rtol=0, atol=EXACT)
    assert_allclose(found[:, :, 1], -right_forward_up[:, :, 0], rtol=0, atol=EXACT)


def test_iso_8855_angles():
    yaw = np.pi / 2 - HEADING
    found = rotations.from_iso8855(ROLL, -NOSE_UP, yaw).as_matrix()
    assert_allclose(found, rz(yaw) @ ry(-NOSE_UP) @ rx(ROLL), rtol=0, atol=EXACT)
    assert_allclose(found, truth(), rtol=0, atol=EXACT)


def test_omega_phi_kappa_of_the_photogrammetric_matrix():
    body = truth()
    a = np.stack([-body[:, :, 1], body[:, :, 0], body[:, :, 2]], axis=-1)  # right, forward, up
    omega = np.arctan2(-a[:, 1, 2], a[:, 2, 2])
    phi = np.arcsin(a[:, 0, 2])
    kappa = np.arctan2(-a[:, 0, 1], a[:, 0, 0])
    assert_allclose(rotations.from_opk(omega, phi, kappa).as_matrix(), body, rtol=0, atol=EXACT)
    for found, expected in zip(
        rotations.to_opk(Rotation.from_matrix(body)), (omega, phi, kappa), strict=True
    ):
        assert_allclose(found, expected, rtol=0, atol=1e-9)  # [rad] near phi of a quarter turn


def test_omega_is_pitch_of_a_vehicle_to_the_north_and_roll_to_the_east():
    roll, nose_up = np.deg2rad([1.0, 2.0])
    omega, phi, _ = rotations.to_opk(rotations.from_sbet(roll, nose_up, 0.0))
    assert_allclose(np.rad2deg([omega, phi]), [2.0, 1.0], rtol=0, atol=1e-3)  # [deg] second order
    omega, phi, _ = rotations.to_opk(rotations.from_sbet(roll, nose_up, np.pi / 2))
    assert_allclose(np.rad2deg([omega, phi]), [1.0, -2.0], rtol=0, atol=0.04)  # [deg] roll * pitch


@pytest.mark.parametrize(
    ("use", "sign", "turn"),
    [
        ("flu to enu", (-1, 1, 1), -np.pi / 2),
        ("flu to nwu", (-1, 1, 1), 0.0),
        ("frd to ned", (-1, -1, -1), 0.0),
    ],
)
def test_thesis_equation_2_1_with_the_angles_of_each_use(use, sign, turn):
    angles = sign[0] * ROLL, sign[1] * NOSE_UP, sign[2] * HEADING + turn
    found = rotations.from_thesis_eq_2_1(*angles, use=use).as_matrix()
    assert_allclose(found, truth(), rtol=0, atol=EXACT)


def test_thesis_equation_2_1_is_the_photogrammetric_matrix():
    found = rotations.from_thesis_eq_2_1(ROLL, NOSE_UP, HEADING, use="enu to rfu").as_matrix()
    expected = rotations.from_opk(ROLL, NOSE_UP, HEADING).as_matrix()
    assert_allclose(found, expected, rtol=0, atol=EXACT)
    printed = rz(-HEADING) @ ry(-NOSE_UP) @ rx(-ROLL)
    found = rotations.from_thesis_eq_2_1(ROLL, NOSE_UP, HEADING).as_matrix()
    assert_allclose(found, printed, rtol=0, atol=EXACT)


def test_golden_matrix():
    """Roll 0.1, nose up 0.2, heading 0.3 rad: forward and up worked by hand."""
    found = rotations.from_sbet(0.1, 0.2, 0.3).as_matrix()
    c, s = np.cos([0.1, 0.2, 0.3]), np.sin([0.1, 0.2, 0.3])
    forward = [s[2] * c[1], c[2] * c[1], s[1]]
    up = [s[2] * -s[1] * c[0] + c[2] * s[0], c[2] * -s[1] * c[0] - s[2] * s[0], c[1] * c[0]]
    assert_allclose(found[:, 0], forward, rtol=0, atol=EXACT)
    assert_allclose(found[:, 2], up, rtol=0, atol=EXACT)


@pytest.mark.parametrize("name", ["iso8855", "sbet", "span", "opk"])
def test_round_trip(name):
    attitude = Rotation.from_matrix(truth())
    angles = getattr(rotations, f"to_{name}")(attitude)
    back = getattr(rotations, f"from_{name}")(*angles)
    assert_allclose((back.inv() * attitude).magnitude(), 0, rtol=0, atol=ROUND_OFF)


@pytest.mark.parametrize("use", USES)
def test_round_trip_by_the_thesis(use):
    attitude = Rotation.from_matrix(truth())
    angles = rotations.to_thesis_eq_2_1(attitude, use=use)
    back = rotations.from_thesis_eq_2_1(*angles, use=use)
    assert_allclose((back.inv() * attitude).magnitude(), 0, rtol=0, atol=ROUND_OFF)


def test_sbet_angles_return():
    roll, nose_up, heading = rotations.to_sbet(rotations.from_sbet(ROLL, NOSE_UP, HEADING))
    assert_allclose(roll, ROLL, rtol=0, atol=ROUND_OFF)
    assert_allclose(nose_up, NOSE_UP, rtol=0, atol=ROUND_OFF)
    assert_allclose(heading, HEADING, rtol=0, atol=ROUND_OFF)


def test_error_of_a_wrong_sign_of_roll_is_as_published():
    """A point 2 m right and 2 m below, roll 1 deg and nose up 0.5 deg: 70 mm."""
    point = [0.0, -2.0, -2.0]
    roll, nose_up = np.deg2rad([1.0, 0.5])
    right = rotations.from_sbet(roll, nose_up, 0.7).apply(point)
    wrong = rotations.from_sbet(-roll, nose_up, 0.7).apply(point)
    assert_allclose(abs(right - wrong)[2], 0.070, rtol=0, atol=0.0005)  # [m] as printed


def test_an_unknown_use_of_equation_2_1():
    with pytest.raises(ValueError, match="use must be one of flu to enu"):
        rotations.from_thesis_eq_2_1(0, 0, 0, use="xyz")
    with pytest.raises(ValueError, match="use must be one of"):
        rotations.to_thesis_eq_2_1(Rotation.identity(), use="xyz")


def test_round_trip_of_the_local_frame():
    position = RNG.uniform(-3000, 3000, (50, 3))
    place = rotations.geodetic_of_enu(position, (11.0, 48.0, 500.0))
    back = rotations.enu_of_geodetic(*place, (11.0, 48.0, 500.0))
    assert_allclose(back, position, rtol=0, atol=MICROMETRE)


@pytest.mark.parametrize(("longitude", "latitude"), [(11.0, 48.0), (7.0, 48.0), (10.5, -33.0)])
def test_convergence_is_the_direction_of_a_step_to_true_north(longitude, latitude):
    to_grid = pyproj.Transformer.from_crs(4326, 32632, always_xy=True)
    east, north = to_grid.transform([longitude] * 2, [latitude, latitude + 1e-4])
    heading_of_true_north = np.arctan2(east[1] - east[0], north[1] - north[0])
    place = np.deg2rad([longitude]), np.deg2rad([latitude])
    found = rotations.true_heading(heading_of_true_north, "EPSG:32632", *place)
    assert_allclose(found, 0.0, rtol=0, atol=2e-6)  # [rad] the step is 11 m long


def test_convergence_needs_a_grid():
    with pytest.raises(ValueError, match="must be a projected system"):
        rotations.meridian_convergence("EPSG:4326", [0.1], [0.8])


def test_projected_positions_in_the_local_frame():
    to_grid = pyproj.Transformer.from_crs(4326, 32632, always_xy=True)
    east, north = to_grid.transform([11.0, 11.01], [48.0, 48.01])
    found = rotations.enu_of_projected(
        east, north, [500.0, 510.0], "EPSG:32632", (11.0, 48.0, 500.0), undulation=0.0
    )
    place = np.deg2rad([11.0, 11.01]), np.deg2rad([48.0, 48.01])
    expected = rotations.enu_of_geodetic(*place, [500.0, 510.0], (11.0, 48.0, 500.0))
    assert_allclose(found, expected, rtol=0, atol=2e-4)  # [m] the series of UTM and its inverse


def test_heights_need_a_vertical_reference():
    with pytest.raises(ValueError, match="compound system"):
        rotations.geodetic_of_projected([649187.0], [5318235.0], [500.0], "EPSG:32632")
    with pytest.raises(ValueError, match="compound system"):
        rotations.geodetic_of_projected(
            [649187.0], [5318235.0], [500.0], "EPSG:32632+5773", undulation=46.0
        )
    with pytest.raises(ValueError, match="either vertical or undulation"):
        rotations.ellipsoidal_height([0.2], [0.8], [500.0])
    with pytest.raises(ValueError, match="vertical must be the EPSG code"):
        rotations.ellipsoidal_height([0.2], [0.8], [500.0], vertical="EPSG:4326")


def test_a_missing_geoid_is_refused_not_ignored(tmp_path):
    """Whether or not grids are installed: PROJ is given a folder without any."""
    before = pyproj.datadir.get_data_dir()
    for file in ("proj.db", "proj.ini"):
        (tmp_path / file).symlink_to(f"{before}/{file}")
    pyproj.datadir.set_data_dir(str(tmp_path))
    try:
        with pytest.raises(CoverageError, match="Install the grid of the geoid"):
            rotations.ellipsoidal_height([0.2], [0.84], [500.0], vertical="EPSG:5773")
    finally:
        pyproj.datadir.set_data_dir(before)


def test_a_position_off_the_projection():
    with pytest.raises((CoverageError, ValueError)):
        rotations.geodetic_of_projected([1e30], [1e30], [0.0], "EPSG:32632", undulation=0.0)
