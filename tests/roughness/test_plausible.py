"""Implausible heights are flagged, roads as they are built are not."""

import numpy as np
import pytest

from trueterrain.core.errors import CoverageError
from trueterrain.core.schemas import ASSUMED, make_profile
from trueterrain.formats import open as open_file
from trueterrain.roughness import IriSettings, RideNumberSettings, flag_profile, iri, ride_number
from trueterrain.roughness.plausible import rating_flags
from trueterrain.simulate.ground import BelgianBlock, Road

S = 0.1 * np.arange(3000)
FOOT = 0.3048  # [m]


def hilly(road_class="B"):
    """Road of a class on a hill: largest grade 8 %, 200 m above the sea [m]."""
    hill = 8.0 * np.sin(2 * np.pi * S / 600.0)
    return 200.0 + hill + Road(road_class=road_class, seed=1).height(S, 0 * S)


@pytest.mark.parametrize("road_class", ["A", "C", "D"])
def test_roads_are_not_flagged(road_class):
    assert flag_profile(make_profile(S, hilly(road_class))) == []


def test_belgian_block_is_not_flagged():
    assert flag_profile(make_profile(S, BelgianBlock(seed=1).height(S, 0 * S))) == []


@pytest.mark.parametrize(
    "name",
    ["asam/belgian_block.crg", "chrono/Horstwalde.crg", "chrono/detrended_rms_course_4in.crg"],
)
def test_measured_courses_are_not_flagged(data, name):
    surface = open_file(data / "opencrg" / name)
    for v in (0.5, -0.5):
        line = surface.height.sel(v=v, method="nearest")
        known = np.isfinite(line.values)
        assert flag_profile(make_profile(surface.u.values[known], line.values[known])) == []


@pytest.mark.parametrize("height", [lambda: 0.0 * S, lambda: 0.06 * S, lambda: 1e-3 * hilly("A")])
def test_profiles_without_roughness_are_flagged(height):
    """Smoothed, or kilometres taken for metres: the index would be 0.000."""
    (flag,) = flag_profile(make_profile(S, height()))
    assert flag.startswith("track profile: is smoother than any road, 0.0")


def test_without_a_unit_the_scale_of_roads_is_the_limit():
    block = make_profile(S, 2 * BelgianBlock(seed=1).height(S, 0 * S))
    (first, second) = flag_profile(block.assign_attrs({ASSUMED: "has no header"}))
    assert first == "has no header"
    assert "is rougher than roads are" in second


def test_feet_declared_as_metres_are_flagged():
    profile = make_profile(S, [hilly(), hilly() / FOOT], tracks=["metres", "feet"])
    (flag,) = flag_profile(profile)
    assert flag.startswith("track feet: climbs 0.2")
    assert flag.endswith("over 100 m; are its heights in metres, not in feet or millimetres?")


def test_millimetres_declared_as_metres_are_flagged(tmp_path):
    height = 1000 * hilly("A")
    found = flag_profile(make_profile(S, height))
    assert [flag.split(": ")[1].split(" ")[0] for flag in found] == ["has", "climbs", "is"]
    assert "has heights up to 20" in found[0]
    assert "is rougher than roads are" in found[2]
    table = np.column_stack([S, height])
    np.savetxt(tmp_path / "mm.csv", table, delimiter=",", header="s,height [mm]", comments="")
    assert flag_profile(open_file(tmp_path / "mm.csv")) == []  # with their unit declared


def test_short_profiles_have_no_grade_flag():
    assert flag_profile(make_profile([0.0, 0.1, 0.2], [0.0, 0.05, 0.1])) == []
    assert flag_profile(make_profile([0.0], [0.0])) == []


def test_missing_heights_are_an_error():
    with pytest.raises(CoverageError, match="has no finite height"):
        flag_profile(make_profile(S, np.full(S.size, np.nan)))


@pytest.mark.parametrize(
    ("spacing", "window", "idle"),
    [
        (0.05, "sayers", False),
        (0.1524, "sayers", False),
        (0.166, "sayers", False),
        (0.167, "sayers", True),
        (0.25, "sayers", True),
        (0.12, "centred", False),
        (0.13, "centred", True),
        (0.25, "exact", False),
        (0.25, "none", False),
    ],
)
@pytest.mark.parametrize("kind", [IriSettings, RideNumberSettings])
def test_windows_that_average_nothing_are_flagged(kind, spacing, window, idle):
    profile = make_profile(spacing * np.arange(50), np.zeros(50))
    settings = kind(window=window, max_spacing=0.61)
    found = [flag for flag in rating_flags(profile, settings) if "window" in flag]
    sentence = f"the window {window} of 0.25 m averages nothing at a spacing of {spacing:g} m"
    assert found == [sentence] * idle


def test_one_sample_has_no_window():
    assert rating_flags(make_profile([0.0], [0.0]), IriSettings()) == []


WAVES = 0.001 * np.random.default_rng(4).standard_normal(4000).cumsum()  # [m] at 0.1 m


@pytest.mark.parametrize(
    ("kind", "index", "spacing", "outcome"),
    [
        (IriSettings, iri, 0.305, "accurate"),
        (IriSettings, iri, 0.31, "flagged"),
        (IriSettings, iri, 0.6096, "flagged"),  # 2 ft
        (IriSettings, iri, 0.62, "refused"),
        (RideNumberSettings, ride_number, 0.05, "accurate"),
        (RideNumberSettings, ride_number, 0.06, "flagged"),
        (RideNumberSettings, ride_number, 0.1524, "flagged"),  # 6 in
        (RideNumberSettings, ride_number, 0.17, "refused"),
    ],
)
def test_indices_need_samples_that_resolve_the_waves_of_the_car(kind, index, spacing, outcome):
    s = np.append(0.05 * np.arange(400), 19.95 + spacing * np.arange(1, 400))  # coarse from 20 m on
    profile = make_profile(s, np.interp(s, 0.1 * np.arange(4000), WAVES))
    settings = kind(window="exact")
    found = [flag for flag in rating_flags(profile, settings) if "apart" in flag]
    assert bool(found) == (outcome == "flagged")
    if outcome == "refused":
        with pytest.raises(CoverageError, match=r"s = 19\.95 m: has samples .* m apart"):
            index(profile, settings=settings)
    else:
        index(profile, settings=settings)


#: Largest error of the IRI at the largest accurate spacing [1]: 2 % of Class 1 of ASTM E1364, and
#: the scatter of a single road of waviness 2.
ACCURATE = 0.04


@pytest.mark.slow
def test_the_index_is_accurate_up_to_the_stated_spacing():
    step = 0.01
    s = step * np.arange(100_000)
    height = Road(road_class="B", seed=5).height(s, 0 * s)
    fine = float(iri(make_profile(s, height)).iri[0])
    for every in (10, 25, 30):  # up to 0.3 m
        coarse = float(iri(make_profile(s[::every], height[::every])).iri[0])
        assert abs(coarse / fine - 1) < ACCURATE


def test_a_window_in_millimetres_is_refused():
    with pytest.raises(ValueError, match=r"window_length must be at most 1 m, got 250; is it in m"):
        IriSettings(window_length=250.0)
