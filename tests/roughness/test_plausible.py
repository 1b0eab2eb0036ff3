"""Implausible heights are questioned, roads as they are built are not."""

import numpy as np
import pytest

from trueterrain.errors import CoverageError
from trueterrain.formats import open as open_file
from trueterrain.kinds import make_profile
from trueterrain.roughness import IriOptions, RideNumberOptions, doubts
from trueterrain.roughness.plausible import idle_window
from trueterrain.simulate.ground import BelgianBlock, Road

S = 0.1 * np.arange(3000)
FOOT = 0.3048  # [m]


def hilly(road_class="B"):
    """A road of some class on a hill: 8 % where it is steepest, 200 m above the sea [m]."""
    hill = 8.0 * np.sin(2 * np.pi * S / 600.0)
    return 200.0 + hill + Road(road_class=road_class, seed=1).height(S, 0 * S)


@pytest.mark.parametrize("road_class", ["A", "C", "D"])
def test_roads_are_not_questioned(road_class):
    assert doubts(make_profile(S, hilly(road_class))) == []


def test_belgian_block_is_not_questioned():
    assert doubts(make_profile(S, BelgianBlock(seed=1).height(S, 0 * S))) == []


def test_feet_declared_as_metres_are_questioned():
    profile = make_profile(S, [hilly(), hilly() / FOOT], tracks=["metres", "feet"])
    (doubt,) = doubts(profile)
    assert doubt.startswith("track feet: climbs 0.2")
    assert doubt.endswith("over 100 m; are its heights in metres, not in feet or millimetres?")


def test_millimetres_declared_as_metres_are_questioned(tmp_path):
    height = 1000 * hilly("A")
    found = doubts(make_profile(S, height))
    assert [doubt.split(": ")[1].split(" ")[0] for doubt in found] == ["has", "climbs", "is"]
    assert "has heights up to 20" in found[0]
    assert "is rougher than roads are" in found[2]
    table = np.column_stack([S, height])
    np.savetxt(tmp_path / "mm.csv", table, delimiter=",", header="s,height [mm]", comments="")
    assert doubts(open_file(tmp_path / "mm.csv")) == []  # declared as what they are


def test_short_profiles_are_not_judged_by_grade():
    assert doubts(make_profile([0.0, 0.1, 0.2], [0.0, 0.05, 0.1])) == []
    assert doubts(make_profile([0.0], [0.0])) == []


def test_missing_heights_are_an_error():
    with pytest.raises(CoverageError, match="has no finite height"):
        doubts(make_profile(S, np.full(S.size, np.nan)))


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
@pytest.mark.parametrize("kind", [IriOptions, RideNumberOptions])
def test_windows_that_average_nothing_are_known(kind, spacing, window, idle):
    profile = make_profile(spacing * np.arange(50), np.zeros(50))
    sentence = idle_window(profile, kind(window=window))
    assert (sentence is not None) == idle
    if sentence is not None:
        assert sentence == (
            f"the window {window} of 0.25 m averages nothing at a spacing of {spacing:g} m"
        )


def test_one_sample_has_no_window():
    assert idle_window(make_profile([0.0], [0.0]), IriOptions()) is None
