"""The whole chain on a short survey of two lanes: every number against the files and the truth."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import laspy
import numpy as np
import numpy.testing as npt
import pytest

import trueterrain as tt
from trueterrain.core.errors import CoverageError, FormatError, OutputError, SchemaError
from trueterrain.core.manifest import missing_files
from trueterrain.core.row_blocks import stored_rows
from trueterrain.formats.run import open_run
from trueterrain.formats.run._handle import open_unchecked
from trueterrain.formats.store import SurfaceStore
from trueterrain.motion import fuse_motion
from trueterrain.profile import EnvelopeSettings, TyreProfileSettings, offset_path
from trueterrain.profile.envelope import tyre_envelope
from trueterrain.simulate.scene import read_scene, record_scene
from trueterrain.surface.holes import HoleSettings
from trueterrain.surface.placement import GridPlacement
from trueterrain.surface.runs import PassRecord, RunGridding, grid_runs
from trueterrain.survey import (
    MountingOverride,
    OutputSettings,
    ProfilePathSettings,
    RunSettings,
    Survey,
    extract_profiles,
    rate_profiles,
    read_survey,
    run_survey,
    survey_of,
    survey_template,
)
from trueterrain.verify import truth_of

pytestmark = pytest.mark.slow

FILE = 1e-6  # [m] of a height near 0 as float32 in an OpenCRG file, half a step of the mantissa
LIFTED = 0.010  # [m] by which a scanner is said to sit higher than it does
TRUE_IRI = 0.03  # relative change of the IRI of a class B road by 20 mm of range noise per point


@pytest.fixture(scope="module")
def runs(recorded_scene):
    """Two lanes of 13 m that overlap, with default errors; the second 20 mm too low by drift."""
    scene, _ = read_scene("belgian-two-lanes")
    scene = replace(
        scene,
        course={"kind": "straight", "length": 13.0},
        raster=0.01,
        ground=({"kind": "road", "road_class": "B", "seed": 3, "waves": 200},),
        scanner=replace(scene.scanner, beams=400),
    )
    return recorded_scene(scene)


@pytest.fixture(scope="module")
def survey(runs):
    """Settings with a coarse grid and two profiles."""
    return survey_of(
        runs,
        title="two <lanes>",
        grid=GridPlacement(spacing=0.02, left=1.9, right=-1.9),
        profiles=(
            ProfilePathSettings(name="left", offset=0.75, spacing=0.02),
            ProfilePathSettings(
                name="right", offset=-0.75, spacing=0.02, tyre=TyreProfileSettings(radius=0.06)
            ),
        ),
        outputs=OutputSettings(surface=("crg", "laz"), points="laz"),
    )


@pytest.fixture(scope="module")
def found(survey, tmp_path_factory):
    """What the survey found."""
    return run_survey(survey, tmp_path_factory.mktemp("found") / "out", truth=truth_of)


def test_everything_is_written(found):
    one, other = (lane["name"] for lane in found.numbers["lanes"])
    kinds = (
        ".crg",
        ".laz",
        "-points.laz",
        "-left.erd",
        "-left.csv",
        "-right.erd",
        "-right.csv",
        "-surface.png",
        "-part.png",
        "-profiles.png",
        "-motion.png",
    )
    expected = {f"{lane}{kind}" for lane in (one, other) for kind in kinds}
    assert set(found.files) == expected | {"report.html", "result.json"}
    assert {path.name for path in found.folder.iterdir()} == {*found.files, "manifest.json"}
    assert missing_files(found.folder) == []
    assert json.loads((found.folder / "result.json").read_text()) == found.numbers


def test_surfaces_are_those_of_gridding_step_by_step(found, survey, runs):
    motion = fuse_motion(open_run(runs[0]))
    one = PassRecord(run=runs[0], trajectory=motion.trajectory)
    surface, tally = grid_runs([one], survey.grid.of_runs([one]), survey.cells)
    lane = found.numbers["lanes"][0]
    assert lane["returns"] == tally
    assert lane["surface"]["nodes"] - lane["surface"]["holes"]["filled_nodes"] == int(
        np.isfinite(surface.height).sum()
    )
    written = tt.open(found.folder / f"{lane['name']}.crg")
    there = surface.height.sel(u=written.u, method="nearest", tolerance=1e-6)
    npt.assert_allclose(
        written.height.values[np.isfinite(there)],
        there.values[np.isfinite(there)],
        rtol=0,
        atol=FILE,
    )


def test_the_functions_of_the_chain_give_the_result_of_the_survey(found, survey, runs):
    run = tt.process_run(runs[0], survey.motion)
    surface, report = tt.build_surface([run], survey.grid, survey.cells, holes=survey.holes)
    profiles, left_out = extract_profiles(surface, survey.profiles)
    ratings, unrated = rate_profiles(profiles, survey.roughness)
    lane = found.numbers["lanes"][0]
    assert run.to_dict()["driven"] == found.numbers["runs"][0]["driven"]
    assert report["returns"] == lane["returns"]
    assert report["holes"]["filled_nodes"] == lane["surface"]["holes"]["filled_nodes"]
    assert left_out == []
    assert [problem in lane["problems"] for problem in unrated] == [True] * len(unrated)
    assert [float(ratings[one["name"]].iri[0]) for one in lane["profiles"]] == [
        one["iri"] for one in lane["profiles"]
    ]


def test_a_run_is_opened_once_from_recording_to_surface(survey, runs, monkeypatch):
    opened = []

    def count_openings(path):
        opened.append(Path(path))
        return open_unchecked(path)

    monkeypatch.setattr("trueterrain.formats.run._open.open_unchecked", count_openings)
    processed, _ = tt.align_passes([tt.process_run(path) for path in runs])
    tt.build_surface(processed, survey.grid)
    next(tt.georeference_run(processed[0]))
    assert opened == list(runs)


def test_runs_of_one_name_are_not_aligned(runs):
    run = tt.process_run(runs[0], name="first")
    with pytest.raises(ValueError, match="different names, got 'first' more than once"):
        tt.align_passes([run, run])


def test_profiles_and_their_roughness_are_those_of_the_files(found):
    for lane in found.numbers["lanes"]:
        surface = tt.open(found.folder / f"{lane['name']}.crg")
        for profile, area in zip(lane["profiles"], (tt.Disc(), tt.Disc(radius=0.06)), strict=True):
            written = tt.open(found.folder / f"{lane['name']}-{profile['name']}.csv")
            npt.assert_allclose(tt.iri(written).iri[0], profile["iri"], rtol=1e-12)
            offset = 0.75 if profile["name"] == "left" else -0.75
            path = offset_path(surface, offset, spacing=0.02)
            at = int(np.argmin(abs(path.s - 5.0)))
            again = tt.tyre_profile(surface, path.part(at, at + 9), area=area)
            near = written.sel(s=again.s, method="nearest", tolerance=0.011)
            npt.assert_allclose(near.height, again.height, rtol=0, atol=5e-4)
        (both,) = lane["wheel_paths"]
        assert (both["left"], both["right"]) == ("left", "right")
        mean = np.mean([profile["iri"] for profile in lane["profiles"]])
        npt.assert_allclose(both["mri"], mean, rtol=1e-12)
        assert both["hri"] < both["mri"]


def test_results_are_near_the_truth_and_say_how_near(found):
    for lane in found.numbers["lanes"]:
        truth = lane["truth"]
        assert truth["surface"]["nmad"] < 0.01  # drift over 2.6 s of some mm per s
        for profile in lane["profiles"]:
            npt.assert_allclose(profile["iri"], truth["iri"][profile["name"]], rtol=TRUE_IRI)


def test_lanes_are_compared_and_mountings_overridden(found, survey, tmp_path):
    one, other = survey.runs
    x, y, z = open_run(other.path).attrs["mounting"]["scanner_position"]
    lifted = replace(other, mounting=MountingOverride(scanner_position=(x, y, z + LIFTED)))
    plain = replace(survey, runs=(one, lifted), outputs=OutputSettings(surface=("zarr",)))
    again = run_survey(plain, tmp_path / "out")
    (before,), (after,) = found.numbers["agreement"], again.numbers["agreement"]
    assert before["n"] > 1000
    # the scanner said to sit higher sees the ground as much higher
    npt.assert_allclose(after["median"] - before["median"], LIFTED, rtol=0, atol=2e-5)
    truths = [lane["truth"]["surface"]["median"] for lane in found.numbers["lanes"]]
    npt.assert_allclose(before["median"], truths[1] - truths[0], rtol=0, atol=0.005)
    assert again.numbers["runs"][1]["mounting"]["scanner_position"][2] == z + LIFTED
    assert all(lane["truth"] is None for lane in again.numbers["lanes"])


def test_points_hold_every_return(found):
    for lane in found.numbers["lanes"]:
        with laspy.open(found.folder / f"{lane['name']}-points.laz") as points:
            assert points.header.point_count >= lane["returns"]["used"]
            returns = lane["returns"]["used"] + lane["returns"]["outside"]
            assert points.header.point_count == returns


def test_results_do_not_depend_on_threads(found, survey, tmp_path):
    again = run_survey(survey, tmp_path / "out", truth=truth_of, threads=2)
    assert again.files == found.files
    for name in found.files:
        if not name.endswith(".laz"):  # which holds the day it was made
            assert (again.folder / name).read_bytes() == (found.folder / name).read_bytes(), name


def test_the_report_stands_alone_and_says_what_was_found(found):
    page = (found.folder / "report.html").read_text()
    assert "two &lt;lanes&gt;" in page
    for lane in found.numbers["lanes"]:
        assert f"{1000 * lane['surface']['sd']['median']:.3f}" in page
    assert "Against the true ground" in page
    assert 'src="http' not in page


def test_one_run_alone_cannot_tell_its_drift(survey, tmp_path):
    alone = replace(survey, runs=survey.runs[:1], outputs=OutputSettings(pictures=False))
    found = run_survey(alone, tmp_path / "out")
    assert found.numbers["agreement"] == []
    assert not [name for name in found.files if name.endswith(".png")]
    assert "One pass does not show the drift" in (tmp_path / "out" / "report.html").read_text()


def test_a_profile_beside_the_ground_is_left_out_and_said(survey, tmp_path):
    beside = replace(
        survey,
        runs=survey.runs[:1],
        profiles=(
            ProfilePathSettings(name="far", line=(0.0, 50.0, 10.0, 50.0)),
            ProfilePathSettings(name="short", line=(4.0, 1.8, 4.2, 1.8), spacing=0.02),
        ),
    )
    (lane,) = run_survey(beside, tmp_path / "out").numbers["lanes"]
    assert [profile["name"] for profile in lane["profiles"]] == ["short"]
    assert any("profile far" in problem for problem in lane["problems"])
    assert any("profile short is not rated" in problem for problem in lane["problems"])


def test_a_tyre_that_rolls(survey, tmp_path):
    rolled = replace(
        survey,
        runs=survey.runs[:1],
        profiles=(
            ProfilePathSettings(
                name="cams",
                offset=0.5,
                spacing=0.02,
                envelope=EnvelopeSettings(envelope="cams"),
                tyre=TyreProfileSettings(thin="nan"),
            ),
        ),
        outputs=OutputSettings(surface=("zarr",), pictures=False),
    )
    found = run_survey(rolled, tmp_path / "out")
    (lane,) = found.numbers["lanes"]
    surface = tt.open(tmp_path / "out" / f"{lane['name']}.zarr")
    written = tt.open(tmp_path / "out" / f"{lane['name']}-cams.csv")
    path = offset_path(surface, 0.5, spacing=0.02)
    at = int(np.argmin(abs(path.s - 5.0)))
    again = tyre_envelope(
        surface, path.part(at - 150, at + 150), tyre=EnvelopeSettings(envelope="cams").model()
    )
    middle = again.sel(s=slice(4.5, 5.5))
    near = written.sel(s=middle.s, method="nearest", tolerance=0.011)
    npt.assert_allclose(near.height, middle.height, rtol=0, atol=5e-4)


def test_a_survey_of_a_map(survey, tmp_path):
    over = replace(
        survey,
        grid=GridPlacement(spacing=0.05, as_map=True),
        runs=survey.runs[:1],
        profiles=(
            ProfilePathSettings(
                name="line",
                line=(0.0, 1.8, 12.9, 1.8),
                spacing=0.05,
                tyre=TyreProfileSettings(radius=0.1),
            ),
        ),
        outputs=OutputSettings(surface=("tif",)),
    )
    found = run_survey(over, tmp_path / "out")
    (lane,) = found.numbers["lanes"]
    assert f"{lane['name']}.tif" in found.files
    assert lane["profiles"][0]["iri"] is not None


def test_an_output_that_is_there_is_kept_unless_forced(survey, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine.txt").write_text("mine")
    with pytest.raises(OutputError, match="is not empty"):
        run_survey(survey, tmp_path / "out")
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["mine.txt"]


def test_runs_of_different_frames_are_refused(runs, survey, tmp_path):
    scene, _ = read_scene("belgian-two-lanes")
    elsewhere = replace(
        scene,
        origin=(11.0, 48.1, 500.0),
        passes=scene.passes[:1],
        raster=0.01,
        ground=({"kind": "road", "road_class": "B", "seed": 3, "waves": 200},),
        course={"kind": "straight", "length": 2.0},
        name="elsewhere",
        scanner=replace(scene.scanner, beams=50),
    )
    (other,) = record_scene(elsewhere, tmp_path)
    with pytest.raises(SchemaError, match="origin"):
        run_survey(
            replace(survey, runs=(*survey.runs, RunSettings(path=str(other)))), tmp_path / "out"
        )
    assert not (tmp_path / "out").exists()


def test_the_template_is_the_default_and_names_the_runs(runs, tmp_path):
    text = survey_template(survey_of(runs))
    (tmp_path / "survey.toml").write_text(text)
    read = read_survey(tmp_path / "survey.toml")
    assert [run.path for run in read.runs] == [str(run) for run in runs]
    assert replace(read, runs=survey_of(runs).runs) == survey_of(runs)
    with_one = survey_template()
    assert "[[runs]]" in with_one
    assert "[m]" in with_one


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ('[[runs]]\npath = "missing.zarr"\n', "runs 1: missing.zarr does not exist"),
        ("runs = []\n", "runs are missing"),
        ('[[runs]]\npath = "a.zarr"\n[[runs]]\npath = "b/a.zarr"\n', "names that differ, got 'a'"),
        ('[[runs]]\npth = "a.zarr"\n', "did you mean 'path'?"),
        ('[[runs]]\npath = "a.zarr"\n[grid]\nas_map = true\nline = [0, 0, 1, 1]\n', "not a map"),
        (
            '[[runs]]\npath = "a.zarr"\n[grid]\nas_map = true\n[[profiles]]\nname = "l"\n'
            "offset = 0.7\n",
            "offset needs a reference line",
        ),
        ('[[runs]]\npath = "a.zarr"\n[outputs]\nsurface = ["tif"]\n', "cannot be GeoTIFF"),
        ('[[runs]]\npath = "a.zarr"\n[[profiles]]\nname = "l"\n', "exactly one of offset"),
        ('[[runs]]\npath = "a.zarr"\n[roughness]\nsegment = 0\n', "segment must be greater than 0"),
        ('name = "a/b"\n[[runs]]\npath = "a.zarr"\n', "without slashes"),
    ],
)
def test_settings_that_make_no_sense_are_named(tmp_path, text, part):
    (tmp_path / "survey.toml").write_text(text)
    with pytest.raises(FormatError) as error:
        read_survey(tmp_path / "survey.toml")
    assert part in str(error.value)
    assert "survey.toml" in str(error.value)


def test_a_survey_needs_a_run():
    with pytest.raises(ValueError, match="runs are missing"):
        Survey(runs=())


def test_a_run_that_is_missing_is_named(survey, tmp_path):
    missing = replace(survey, runs=(RunSettings(path=str(tmp_path / "none.zarr")),))
    with pytest.raises(FileNotFoundError, match=r"none\.zarr"):
        run_survey(missing, tmp_path / "out")


def test_a_run_without_navigation_where_it_scans_is_refused(runs, survey, tmp_path):
    late = replace(
        survey.runs[0], mounting=MountingOverride(scanner_clock=1000.0)
    )  # as if scanner and navigation had clocks of their own
    with pytest.raises((CoverageError, ValueError)):
        run_survey(replace(survey, runs=(late,)), tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "sent", [pytest.param(signal.SIGKILL, marks=pytest.mark.slow), signal.SIGTERM]
)
def test_a_killed_survey_leaves_nothing_half_written_and_starts_again(runs, tmp_path, sent):
    (tmp_path / "survey.toml").write_text(
        survey_template(
            survey_of(
                runs[:1],
                grid=GridPlacement(spacing=0.05),
                profiles=(),
            )
        )
    )
    arguments = [
        sys.executable,
        "-m",
        "trueterrain",
        "run",
        str(tmp_path / "survey.toml"),
        "-o",
        str(tmp_path / "out"),
    ]
    with subprocess.Popen(arguments, stderr=subprocess.PIPE, text=True) as program:
        while not list(tmp_path.glob(".out.*")):
            assert program.poll() is None
            time.sleep(0.01)
        os.kill(program.pid, sent)
        program.wait()
    assert program.returncode in (-signal.SIGKILL, 143)
    assert not (tmp_path / "out").exists()
    if sent == signal.SIGTERM:
        assert [path.name for path in tmp_path.iterdir()] == ["survey.toml"]
    subprocess.run(arguments, check=True, capture_output=True)
    assert missing_files(Path(arguments[-1])) == []
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out", "survey.toml"]


@pytest.mark.slow
@pytest.mark.parametrize(("memory", "windows"), [(1 << 28, 1), (1 << 21, 2)])
def test_a_surface_on_disk_is_that_in_memory(runs, tmp_path, monkeypatch, memory, windows):
    """Bit for bit, with its report, in one window and in several."""
    written, write = [], SurfaceStore.write

    def note_write(self, rows, values):
        if "count" in values:  # a window, not a filled hole
            written.append(rows)
        write(self, rows, values)

    monkeypatch.setattr(SurfaceStore, "write", note_write)
    processed = [tt.survey.process_run(runs[0])]
    settings = {"holes": HoleSettings(largest=0.05)}
    whole, report = tt.build_surface(processed, **settings)
    monkeypatch.setitem(RunGridding.__init__.__kwdefaults__, "memory", memory)
    stored, same = tt.build_surface(processed, **settings, store=tmp_path / "road.zarr")
    assert stored_rows(stored) is not None
    assert len(written) >= windows
    assert same == report
    assert stored.load().identical(whole)
