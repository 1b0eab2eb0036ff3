"""The command filter: known gains, kept variables, provenance, and bad input."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from trueterrain import formats
from trueterrain.core.provenance import provenance_steps
from trueterrain.core.schemas import make_profile
from trueterrain.roughness import FILTER_250_MM, Butterworth, MovingAverage

DECAYED = 1e-7  # [m] 1e-5 of the wave: effect of the mirrored ends at the centre of the road
WRITTEN = 1e-9  # [m] to which heights are rounded in ERD files

STEP = 0.05  # [m]
S = STEP * np.arange(20_001)
CENTRE = slice(8_000, 12_000)  # [samples] 200 m: whole periods of all waves below
SIZE = 0.01  # [m]


def wave(length):
    return SIZE * np.sin(2 * np.pi * S / length)


@pytest.fixture
def road(tmp_path):
    """Two wheel paths, each of one wave on a hill of 2 %."""
    heights = [0.02 * S + wave(0.5), 0.02 * S + wave(20.0)]
    formats.write(make_profile(S, heights, tracks=["left", "right"]), tmp_path / "road.erd")
    return tmp_path / "road.erd"


@pytest.mark.parametrize(
    ("arguments", "kind"),
    [
        (("--kind", "250mm"), FILTER_250_MM),
        (("--shortest", 2), Butterworth(shortest=2)),
        (("--longest", 5, "--order", 2), Butterworth(longest=5, order=2)),
        (("--shortest", 8, "--longest", 90), Butterworth(shortest=8, longest=90)),
        (("--kind", "moving-average", "--shortest", 0.7), MovingAverage(shortest=0.7)),
        (("--kind", "moving-average", "--longest", 25), MovingAverage(longest=25)),
        (
            ("--kind", "moving-average", "--shortest", 3, "--longest", 25),
            MovingAverage(shortest=3, longest=25),
        ),
    ],
)
def test_waves_pass_by_the_gain(run, road, tmp_path, arguments, kind):
    finished = run("filter", road, "-o", tmp_path / "out.erd", *arguments)
    assert (finished.code, finished.out) == (0, ""), finished.err
    out = formats.open(tmp_path / "out.erd")
    assert list(out.track.values) == ["left", "right"]
    assert_allclose(out.s, S, rtol=0, atol=1e-9)
    hill = 0.02 * S if kind.longest is None else 0 * S
    for track, length in zip(out.height.values, (0.5, 20.0), strict=True):
        truth = hill + float(kind.gain(length, spacing=STEP)) * wave(length)
        assert_allclose(track[CENTRE], truth[CENTRE], rtol=0, atol=DECAYED + WRITTEN)


@pytest.mark.parametrize("ending", ["erd", "csv", "parquet", "zarr"])
def test_every_format_of_profiles_can_be_written(run, road, tmp_path, ending):
    if ending == "parquet":
        pytest.importorskip("pyarrow")
    output = tmp_path / f"out.{ending}"
    assert run("filter", road, "--shortest", 2, "-o", output).code == 0
    out = formats.open(output)
    assert out.sizes["track"] == 2
    if ending != "csv":  # which has no place for it
        (read,) = [step for step in provenance_steps(out) if step["step"] == "filter_profile"]
        assert read["parameters"]["by"] == {
            "kind": "Butterworth",
            "shortest": 2.0,
            "longest": None,
            "order": 3,
        }
        assert [step["inputs"][0]["name"] for step in provenance_steps(out)[:1]] == ["road.erd"]


def test_it_notes_the_band_and_the_uncertain_ends(run, road, tmp_path):
    band = run("filter", road, "-o", tmp_path / "a.erd", "--shortest", 8, "--longest", 90)
    lines = band.err.splitlines()
    assert lines[0].endswith(
        "20,001 samples of 2 tracks from 0 to 1000 m, with waves from 8 to 90 m"
    )
    assert "within 90 m of the ends depend on the assumed profile beyond" in lines[1]
    mean = run("filter", road, "-o", tmp_path / "b.erd", "--kind", "250mm")
    assert "with waves longer than 0.25 m" in mean.err
    assert "within 0.125 m of the ends" in mean.err
    long = run("filter", road, "-o", tmp_path / "c.erd", "--longest", 600)
    assert "with waves shorter than 600 m" in long.err
    assert "warning" in long.err
    assert "no height is farther than 600 m from the ends" in long.err


def test_it_notes_omitted_variables(run, tmp_path):
    data = make_profile(S, wave(20.0), easting=S, northing=0 * S, crs="EPSG:32632", sd=0 * S + 1e-3)
    formats.write(data, tmp_path / "in.zarr")
    finished = run("filter", tmp_path / "in.zarr", "-o", tmp_path / "out.zarr", "--shortest", 2)
    assert finished.err.splitlines()[-1].endswith("since the heights have changed: sd")
    out = formats.open(tmp_path / "out.zarr")
    assert out.crs == "EPSG:32632"
    assert_allclose(out.easting, S, rtol=0, atol=0)
    finished = run("filter", tmp_path / "in.zarr", "-o", tmp_path / "out.erd", "--shortest", 2)
    assert finished.err.splitlines()[-1].endswith("cannot hold it: easting, northing, CRS")


def test_windows_that_average_little_and_implausible_heights_are_questioned(run, tmp_path):
    coarse = make_profile(10 * S[:500], wave(2.0)[:500])
    formats.write(coarse, tmp_path / "coarse.csv")
    finished = run("filter", tmp_path / "coarse.csv", "-o", tmp_path / "a.csv", "--kind", "250mm")
    assert finished.code == 0
    assert "the window of 0.25 m averages little at a spacing of 0.5 m" in finished.err
    formats.write(make_profile(S, 1000 * wave(20.0)), tmp_path / "mm.csv")
    finished = run("filter", tmp_path / "mm.csv", "-o", tmp_path / "b.csv", "--kind", "250mm")
    assert "are its heights in metres, not in feet or millimetres?" in finished.err


def test_unequal_spacing_is_for_moving_averages(run, tmp_path):
    s = np.cumsum(np.random.default_rng(1).uniform(0.05, 0.15, 3000))
    formats.write(make_profile(s, 1e-3 * np.sin(s)), tmp_path / "u.csv")
    finished = run("filter", tmp_path / "u.csv", "-o", tmp_path / "o.csv", "--shortest", 2)
    assert finished.code == 2
    assert "u.csv: axis s: must be equally spaced for a Butterworth filter" in finished.err
    arguments = ("-o", tmp_path / "o.csv", "--kind", "moving-average", "--shortest", 2)
    assert run("filter", tmp_path / "u.csv", *arguments).code == 0
    truth = MovingAverage(shortest=2).filtered(s, 1e-3 * np.sin(s))
    # [m] text keeps every bit of heights and stations
    assert_allclose(formats.open(tmp_path / "o.csv").height, truth, rtol=0, atol=1e-15)


def test_nothing_is_overwritten_without_force(run, road, tmp_path):
    output = tmp_path / "out.erd"
    assert run("filter", road, "-o", output, "--kind", "250mm").code == 0
    before = output.read_bytes()
    finished = run("filter", road, "-o", output, "--shortest", 2)
    assert finished.code == 2
    assert "exists already and is not overwritten" in finished.err
    assert output.read_bytes() == before
    assert run("filter", road, "-o", output, "--shortest", 2, "--force").code == 0
    assert output.read_bytes() != before
    finished = run("filter", road, "-o", road, "--kind", "250mm", "--force")
    assert "is an input as well" in finished.err


def test_bad_files_leave_nothing_behind(run, tmp_path):
    formats.write(make_profile(S[:200], wave(2.0)[:200]), tmp_path / "short.csv")
    gap = np.where(np.arange(S.size) == 100, np.nan, wave(2.0))
    formats.write(make_profile(S, gap), tmp_path / "gap.csv")
    for name, message in (
        (
            "short",
            "short.csv: axis s: is shorter than the filter: 9.95 m, which must be at least 90",
        ),
        ("gap", "s = 5 m: has no finite height (1 of 20001 samples have none)"),
        ("none", "none.csv: No such file or directory"),
    ):
        output = tmp_path / f"{name}.erd"
        finished = run("filter", tmp_path / f"{name}.csv", "-o", output, "--longest", 90)
        assert (finished.code, finished.out) == (2, "")
        assert message in finished.err
        assert finished.err.count("\n") == 1
        assert not output.exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "--shortest, --longest or both must be given: the waves to remove"),
        (("--kind", "250mm", "--longest", 5), "--kind 250mm is a moving average over 0.25 m"),
        (
            ("--kind", "moving-average", "--shortest", 5, "--order", 2),
            "--order is for --kind butterworth, got --kind moving-average",
        ),
        (("--shortest", 0.1), "shortest must be more than two spacings of 0.05 m, got 0.1 m"),
        (("--shortest", -1), "shortest must be finite and greater than 0 m"),
        (("--shortest", 9, "--longest", 8), "shortest must be less than longest, got 9 and 8 m"),
        (("--shortest", 8, "--order", 0), "order must be a whole number from 1 to 50"),
        (("--kind", "gaussian"), "gaussian"),
    ],
)
def test_bad_arguments(run, road, tmp_path, arguments, message):
    finished = run("filter", road, "-o", tmp_path / "out.erd", *arguments)
    assert (finished.code, finished.out) == (2, "")
    assert finished.err.count("\n") == 1
    assert message in finished.err
    assert not (tmp_path / "out.erd").exists()


def test_the_ending_of_the_output_must_hold_a_profile(run, road, tmp_path):
    finished = run("filter", road, "-o", tmp_path / "out.crg", "--kind", "250mm")
    assert finished.code == 2
    assert "a profile can be written to .erd, .csv, .parquet, .zarr, got ending '.crg'" in (
        finished.err
    )
