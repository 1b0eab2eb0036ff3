"""Tyre envelopes by name: for settings files and for ``trueterrain profile``."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import trueterrain as tt
from trueterrain.cli import main
from trueterrain.core import provenance
from trueterrain.formats import opencrg
from trueterrain.profile import (
    PASSENGER_TYRE,
    TRUCK_TYRE,
    EnvelopeSettings,
    LineLaser,
    PatchMean,
    RadialSpringTyre,
    RigidDisc,
    TandemCams,
    offset_path,
    tyre_envelope,
)

ENVELOPES = ("disc", "cams", "springs", "laser", "patch")
FLOAT32 = 1e-8  # [m] heights of a CRG around 0.04 m


@pytest.fixture(scope="module")
def road(tmp_path_factory):
    """A 3 m road with a cleat, as a CRG file."""
    u, v = np.arange(301) * 0.01, np.arange(-40, 41) * 0.01
    height = np.where(np.abs(u - 1.5) < 0.015, 0.01, 0.0)[:, None] + 0 * v
    surface = tt.make_surface(height, u=u, v=v, easting=u, northing=0 * u)
    path = tmp_path_factory.mktemp("road") / "road.crg"
    opencrg.write(surface, path)
    return path


@pytest.fixture
def run(capsys):
    """Call the command line; returns exit code and stderr."""

    def call(*arguments):
        capsys.readouterr()
        code = 0
        try:
            main([str(argument) for argument in arguments])
        except SystemExit as stopped:
            code = int(stopped.code or 0)
        return code, capsys.readouterr().err

    return call


def test_every_name_gives_its_model():
    assert EnvelopeSettings() == EnvelopeSettings(envelope="disc")
    kinds = [RigidDisc, TandemCams, RadialSpringTyre, LineLaser, PatchMean]
    for name, kind in zip(ENVELOPES, kinds, strict=True):
        assert isinstance(EnvelopeSettings(envelope=name).model(), kind)
    assert EnvelopeSettings(tyre="truck").model() == RigidDisc.of(TRUCK_TYRE)
    springs = EnvelopeSettings(envelope="springs", load=3000.0).model()
    assert springs == RadialSpringTyre.of(PASSENGER_TYRE, load=3000.0)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"envelope": "balloon"}, "envelope must be one of disc, cams, springs, laser, patch"),
        ({"tyre": "bicycle"}, "tyre must be one of passenger, truck"),
        ({"envelope": "cams", "load": 1.0}, "load belongs to the envelope springs, not to cams"),
        ({"envelope": "springs", "load": -1.0}, "load must be greater than 0 N"),
        ({"envelope": "laser", "tyre": "truck"}, "tyre does not belong to the envelope laser"),
    ],
)
def test_inconsistent_settings_are_refused(given, says):
    with pytest.raises(ValueError, match=says):
        EnvelopeSettings(**given)


@pytest.mark.parametrize("envelope", ENVELOPES)
def test_the_command_gives_what_the_library_gives(run, road, tmp_path, envelope):
    code, err = run(
        "profile", road, "--offset", 0.1, "--envelope", envelope, "-o", tmp_path / "p.csv"
    )
    assert code == 0, err
    written = tt.open(tmp_path / "p.csv")
    surface = tt.open(road)
    model = EnvelopeSettings(envelope=envelope).model()
    expected = tyre_envelope(surface, offset_path(surface, 0.1), tyre=model)
    assert_allclose(written.height, expected.height, rtol=0, atol=1e-12)
    assert ("sd" in written) == (envelope == "laser")
    assert ("heights are held" in err) == (envelope != "laser")


def test_a_tyre_rolls_along_a_profile_from_a_file(run, road, tmp_path):
    line = tmp_path / "line.csv"
    assert run("profile", road, "--offset", 0, "--statistic", "point", "-o", line)[0] == 0
    truck = ("--envelope", "springs", "--tyre", "truck", "--load", 30000)
    code, err = run("profile", line, *truck, "-o", tmp_path / "felt.zarr")
    assert code == 0, err
    felt = tt.open(tmp_path / "felt.zarr")
    expected = tyre_envelope(tt.open(line), tyre=RadialSpringTyre.of(TRUCK_TYRE, load=30000.0))
    assert_array_equal(felt.height, expected.height)
    steps = provenance.provenance_steps(felt)
    assert [step["step"] for step in steps][-2:] == ["tyre_envelope", "profile"]
    assert steps[-2]["parameters"]["tyre"]["load"] == 30000.0
    assert steps[-1]["inputs"][0]["name"] == "line.csv"
    assert json.loads(felt.attrs["provenance"]) == steps


def test_errors_of_the_command_are_one_line(run, road, tmp_path):
    line = tmp_path / "line.csv"
    tt.write(tt.make_profile([0.0, 0.1, 0.2], [0.0, 0.0, 0.0]), line)
    cloud = tmp_path / "cloud.csv"
    tt.write(tt.make_points([0.0, 1.0], [0.0, 0.0], [0.0, 0.0]), cloud)
    for ground, options, says in [
        (road, ("--offset", 0, "--tyre", "truck"), "--tyre and --load are for --envelope"),
        (road, ("--offset", 0, "--envelope", "disc", "--radius", 0.1), "no option of a search"),
        (road, ("--offset", 0, "--envelope", "disc", "--load", 9), "load belongs to the envelope"),
        (road, ("--envelope", "disc"), "exactly one of --offset, --line and --path"),
        (line, ("--offset", 0, "--envelope", "disc"), "a profile is its own path"),
        (line, ("--offset", 0), "or roll a tyre along the profile with --envelope"),
        (cloud, ("--line", 0, 0, 1, 0, "--envelope", "disc"), "no height between them"),
        (road, ("--offset", 0.39, "--envelope", "disc"), "too little ground under the tyre"),
    ]:
        code, err = run("profile", ground, *options, "-o", tmp_path / "p.erd")
        assert code == 2
        assert says in err, err
        assert len(err.splitlines()) == 1
        assert not (tmp_path / "p.erd").exists()


def test_holes_become_nan_and_are_counted(run, tmp_path):
    u, v = np.arange(301) * 0.01, np.arange(-40, 41) * 0.01
    height = np.zeros((u.size, v.size))
    height[150, 40] = np.nan
    tt.write(tt.make_surface(height, u=u, v=v, easting=u, northing=0 * u), tmp_path / "holed.zarr")
    arguments = ("--offset", 0, "--envelope", "patch", "--thin", "nan")
    code, err = run("profile", tmp_path / "holed.zarr", *arguments, "-o", tmp_path / "p.csv")
    assert code == 0, err
    lost = int(np.isnan(tt.open(tmp_path / "p.csv").height).sum())
    assert lost > 10
    assert f"{lost} points with too little ground under the tyre are NaN" in err
