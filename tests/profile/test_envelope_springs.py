"""The radial-spring tyre: planes, load and energy, and the shape over a cleat."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import nnls

from trueterrain.core.schemas import make_profile, make_surface
from trueterrain.profile import straight_path
from trueterrain.profile.envelope import (
    PASSENGER_TYRE,
    TRUCK_TYRE,
    PatchMean,
    RadialSpringTyre,
    RigidDisc,
    TandemCams,
    effective_road,
    tyre_envelope,
)
from trueterrain.profile.envelope._kernels import tyre_forces
from trueterrain.profile.envelope.springs import LOAD_BALANCE

EXACT = 1e-12  # [m] round-off; the load is met within 1e-11, 2e-13 m of deflection
BALANCE = 2 * LOAD_BALANCE  # of the load: what the solver promises, and round-off
DIFFERENCE = 1e-6  # of the load: a central difference over 2 um, and the kinks of the force

STEP = 0.005  # [m] between samples
S = np.arange(-200, 201) * STEP
TYRE = RadialSpringTyre()
TYRES = [TYRE, RadialSpringTyre.of(TRUCK_TYRE), RadialSpringTyre.of(PASSENGER_TYRE, load=2500)]


def profile(height):
    return make_profile(S, height)


def cleat(half, rise):
    return np.where(np.abs(S) <= half + 1e-9, rise, 0.0)


def pressed(tyre, ground, hub, at=0.0):
    """Forces on the hub [N] up and forward, and energy [J], over sections of ground."""
    ground = np.atleast_2d(ground)
    tension = tyre.tension(STEP, len(ground))
    work = np.empty((4, S.size))
    return tyre_forces(
        ground, 0, S.size, S[0] - at, STEP, hub, tyre.radius, tyre.decay, tension, work
    )


def hub_over(tyre, ground, at=0.0):
    """Height of the hub that carries the load, found by bisection over the force."""
    low, high = 0.5 * tyre.radius, tyre.radius + np.max(ground)
    for _ in range(60):
        centre = (low + high) / 2
        if pressed(tyre, ground, centre, at)[0] > tyre.load:
            low = centre
        else:
            high = centre
    return (low + high) / 2


@pytest.mark.parametrize("tyre", TYRES)
@pytest.mark.parametrize("level", [0.0, 1234.5])
def test_a_level_plane_gives_the_plane(tyre, level):
    road = effective_road(profile(np.full(S.size, level)), tyre=tyre)
    assert_allclose(road.height, level, rtol=0, atol=EXACT)
    assert_allclose(road.slope, 0, rtol=0, atol=EXACT)


@pytest.mark.parametrize("slope", [-0.1, 0.03])
def test_an_inclined_plane_gives_a_parallel_plane_and_its_slope(slope):
    road = effective_road(profile(slope * S), tyre=TYRE)
    inner = np.abs(S) < 0.5
    higher = (road.height - slope * S)[inner]
    hub = TYRE.radius - PASSENGER_TYRE.deflection
    assert_allclose(higher, higher[0], rtol=0, atol=EXACT)
    # tilted, the tyre presses by F / cos: a deflection some m^2 / 2 larger, which the samples,
    # 5 mm apart, tell to some 10 um
    assert_allclose(higher, hub * (np.sqrt(1 + slope**2) - 1), rtol=0, atol=1.5e-4)
    assert_allclose(road.slope[inner], slope, rtol=0, atol=1e-4)


def test_the_rated_load_gives_the_stated_deflection_and_contact_length():
    hub = TYRE.radius - TYRE.rated_load / TYRE.stiffness
    up, forward, _ = pressed(TYRE, 0 * S, hub)
    assert_allclose(up, TYRE.rated_load, rtol=1e-12, atol=0)
    assert_allclose(forward, 0, rtol=0, atol=1e-9)
    lifted = 0 * S
    for beyond, touches in ((0.008, True), (-0.008, False)):
        # ground that falls away outside of the patch is not missed, inside of it is
        ground = np.where(np.abs(S) > TYRE.contact_length / 2 - beyond, -0.05, lifted)
        missed = up - pressed(TYRE, ground, hub)[0]
        assert (missed > 1e-3 * up) == touches


def energy_of_least_shape(tyre, ground, hub):
    """Energy [J] of the band over samples, from its compliance and scipy's nnls.

    The compliance of an endless band between two samples falls off exponentially with the angle
    between them; the reactions are those that are never negative and of least dual energy.
    """
    y = hub - ground
    angle, deep = np.arctan2(S, y), tyre.radius - np.hypot(S, y)
    angle, deep = angle[deep > 0], deep[deep > 0]
    decay = tyre.decay
    compliance = np.exp(-np.abs(angle[:, None] - angle) / decay)
    compliance *= tyre.radius * decay / (2 * tyre.tension(STEP, 1))
    root = np.linalg.cholesky(compliance)
    push, _ = nnls(root.T, np.linalg.solve(root, deep))
    return 0.5 * push @ compliance @ push


@pytest.mark.parametrize("seed", range(4))
def test_the_band_has_the_shape_of_minimum_energy(seed):
    ground = np.random.default_rng(seed).normal(0, 0.004, S.size) + cleat(0.01, 0.012)
    hub = TYRE.radius - 0.015
    _, _, energy = pressed(TYRE, ground, hub)
    assert_allclose(energy, energy_of_least_shape(TYRE, ground, hub), rtol=1e-9, atol=0)


@pytest.mark.parametrize("at", [-0.03, 0.0, 0.041])
def test_forces_are_the_derivatives_of_the_energy(at):
    ground = np.stack([cleat(0.01, 0.01), cleat(0.03, 0.02)])
    hub, d = TYRE.radius - 0.012, 1e-6
    up, forward, _ = pressed(TYRE, ground, hub, at)
    higher, lower = (pressed(TYRE, ground, hub + shift, at)[2] for shift in (d, -d))
    ahead, behind = (pressed(TYRE, ground, hub, at + shift)[2] for shift in (d, -d))
    assert_allclose(-(higher - lower) / (2 * d), up, rtol=0, atol=DIFFERENCE * TYRE.load)
    assert_allclose(-(ahead - behind) / (2 * d), forward, rtol=0, atol=DIFFERENCE * TYRE.load)


def test_no_energy_is_dissipated_over_a_closed_cycle():
    """Down before a cleat, over it, up behind it and back: what the springs take they give back."""
    ground = cleat(0.01, 0.015)
    away, low, count = TYRE.radius + 0.02, TYRE.radius - 0.015, 4000
    rise = np.linspace(low, away, count)
    positions = np.linspace(-0.06, 0.03, count)
    down, up = (
        np.trapezoid([pressed(TYRE, ground, z, at)[0] for z in rise], rise)
        for at in (positions[0], positions[-1])
    )
    along = np.trapezoid([pressed(TYRE, ground, low, x)[1] for x in positions], positions)
    stored = pressed(TYRE, ground, low, positions[0])[2]
    assert_allclose(down, stored, rtol=1e-5, atol=0)  # the rule of trapezoids over 8 um
    assert_allclose(-down + along + up, 0, rtol=0, atol=2e-5 * stored)


def test_the_load_balances_at_every_path_point():
    ground = np.random.default_rng(3).normal(0, 0.005, S.size)
    felt = tyre_envelope(profile(ground), tyre=TYRE).height.values
    over_level = hub_over(TYRE, 0 * S)
    for i in range(120, 281, 20):
        up, _, _ = pressed(TYRE, ground, felt[i] + over_level, S[i])
        assert_allclose(up, TYRE.load, rtol=0, atol=BALANCE * TYRE.load)
        assert_allclose(felt[i], hub_over(TYRE, ground, S[i]) - over_level, rtol=0, atol=EXACT)


def test_under_a_light_load_there_is_no_dip():
    """The less the tyre is pressed, the more it rides on the cleat, at last as a rigid wheel."""
    ground = profile(cleat(0.01, 0.01))
    centre = [
        tyre_envelope(ground, tyre=RadialSpringTyre(load=load)).height.values[S.size // 2]
        for load in (6000.0, 4000.0, 2500.0, 500.0)
    ]
    assert np.all(np.diff(centre) > 0)
    light = tyre_envelope(ground, tyre=RadialSpringTyre(load=500.0)).height.values
    assert np.argmax(light) == S.size // 2


@pytest.mark.parametrize("tyre", TYRES[:2])
def test_over_a_cleat_shorter_than_the_patch_the_hub_rises_twice_with_a_dip_between(tyre):
    height = tyre_envelope(profile(cleat(0.01, 0.01)), tyre=tyre).height.values
    assert_allclose(height, height[::-1], rtol=0, atol=1e-9)
    front, behind = height[S < 0], height[S > 0]
    centre = height[S.size // 2]
    assert front.max() > 1.3 * centre
    assert 0.1 * 0.01 < centre < 0.01  # most of the cleat is swallowed
    # one bump on either side: it rises to its top and falls from there
    top = int(np.argmax(front))
    assert np.all(np.diff(front[: top + 1]) >= -1e-12)
    assert np.all(np.diff(front[top:]) <= 1e-12)
    # as with cams, which are fitted to measurements, the bumps are about a patch apart
    apart = S[S > 0][np.argmax(behind)] - S[top]
    assert 0.4 * tyre.contact_length < apart < 1.1 * tyre.contact_length


def test_the_bumps_are_at_those_of_the_cams_of_the_same_tyre():
    """Cams are fitted to measurements of this tyre, the springs only to its patch and stiffness."""
    for half, rise in ((0.01, 0.01), (0.025, 0.01), (0.05, 0.02)):
        ground = profile(cleat(half, rise))
        springs = tyre_envelope(ground, tyre=TYRE).height.values
        cams = tyre_envelope(ground, tyre=TandemCams()).height.values
        difference = np.sqrt(np.mean((springs - cams)[np.abs(S) < 0.2] ** 2))
        assert difference < 0.12 * rise


def test_the_integral_of_the_slope_is_the_height_gained():
    fine = np.arange(-1200, 1201) * 0.0005
    ground = 0.01 * (1 + np.tanh(fine / 0.01))
    road = effective_road(make_profile(fine, ground), tyre=TYRE, step=0.0005)
    for begin, end in ((120, -120), (600, 1800)):  # the whole of it, and level to level
        gained = np.trapezoid(road.slope.values[begin:end], fine[begin:end])
        assert_allclose(
            gained, road.height.values[end - 1] - road.height.values[begin], rtol=0, atol=2e-6
        )  # samples 0.5 mm apart


def test_a_gap_narrower_than_the_patch_is_nearly_bridged():
    gap = np.where(np.abs(S) < 0.015, -0.03, 0.0)
    felt = tyre_envelope(profile(gap), tyre=TYRE).height
    assert -0.003 < felt.min() < -1e-4
    mean = tyre_envelope(profile(gap), tyre=PatchMean(width=0)).height
    assert felt.min() > mean.min()


def test_a_much_stiffer_tyre_is_a_rigid_disc():
    """As load over stiffness goes to nothing, all that is left is the envelope of its circle."""
    ground = profile(np.random.default_rng(5).normal(0, 0.005, S.size))
    hard = RadialSpringTyre(
        load=1.0, rated_load=1.0, stiffness=1e8, contact_length=0.5 * np.sqrt(2 * 0.3135e-8)
    )
    disc = tyre_envelope(ground, tyre=RigidDisc())
    # a tyre that touches samples only: pieces between them are missed by STEP^2 / (8 R)
    felt = tyre_envelope(ground, tyre=hard).height
    assert_allclose(felt, disc.height, rtol=0, atol=STEP**2 / (8 * 0.3135) + 1e-6)


def test_the_load_is_distributed_over_the_sections():
    axis = np.arange(-60, 61) * 0.01
    path = straight_path((-0.1, 0.0), (0.1, 0.0), spacing=0.01)

    def felt(height, **settings):
        surface = make_surface(height(*np.meshgrid(axis, axis)), easting=axis, northing=axis)
        return tyre_envelope(surface, path, tyre=RadialSpringTyre(width=0.14, **settings)).height

    def bar(x, _):
        return np.where(np.abs(x) < 0.015, 0.012, 0.0)

    # across, all sections feel the same: as one wide section
    assert_allclose(felt(bar), felt(bar, sections=1), rtol=0, atol=EXACT)
    # a cross slope through the centre lifts no more than the load's curvature over deflection
    assert abs(felt(lambda _, y: 0.05 * y)).max() < 5e-4
    # a stone under part of the width lifts the hub, less than a bar over all of it
    stone = felt(lambda x, y: np.where((np.abs(x) < 0.015) & (np.abs(y) < 0.03), 0.012, 0.0))
    assert 0.001 < stone.max() < felt(bar).max()


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"load": 0.0}, "load must be greater than 0 N"),
        ({"stiffness": -1.0}, "stiffness must be greater than 0 N/m"),
        ({"stiffness": 1e4}, "deflects the tyre by less than half of its radius"),
        ({"contact_length": 0.25}, "contact_length must be less than 0.219 m, the chord"),
        ({"radius": float("inf")}, "radius must be greater than 0 m"),
        ({"sections": 0}, "sections must be a whole number"),
    ],
)
def test_impossible_tyres_are_refused(given, says):
    with pytest.raises(ValueError, match=says):
        RadialSpringTyre(**given)
