"""``trueterrain verify``: tests of simulated runs, whose plate, motion and errors are known."""

import json
import re

import numpy as np
import pandas as pd
import pytest

import trueterrain
from trueterrain.core.schemas import make_profile

RECOMPUTED = 1e-15  # [m]
SHIFT, SHIFT_TOLERANCE = -0.7, 2e-4  # [m] steps of 0.5 mm in the machined profile
NOISE, NOISE_TOLERANCE = 0.0005, 2e-5  # [m] range noise of the virtual scanner; beams to 20 degrees


@pytest.fixture
def static(tmp_path, machined, recorded):
    config = tmp_path / "static.toml"
    config.write_text(
        f'title = "Acceptance"\nsystem = "Scanner 12 <A&B>"\nrun = "{recorded}/stand-run.zarr"\n'
        f'machined = "{machined}"\nlimits = {{off_edges = 0.001, noise = 0.0001}}\n'
        "test = {screening = {saturation = 19999.0}}\n"
    )
    return config


@pytest.mark.slow
def test_static_certifies_a_standing_scanner(run, static, tmp_path):
    finished = run("verify", "static", static, "-o", tmp_path / "out", "--json")
    assert finished.code == 0, finished.err
    document = json.loads(finished.out)
    first, screened = document["rows"]
    assert [first["test"], screened["test"]] == ["static", "static, screened"]
    np.testing.assert_allclose(
        first["registration_found"]["shift"], SHIFT, rtol=0, atol=SHIFT_TOLERANCE
    )
    np.testing.assert_allclose(first["noise"], NOISE, rtol=0, atol=NOISE_TOLERANCE)
    assert first["verdicts"] == {"off_edges": True, "noise": False}
    assert document["passed"] is False
    assert json.loads((tmp_path / "out" / "result.json").read_text()) == document


@pytest.mark.slow
def test_every_figure_of_the_certificate_is_recomputed_from_its_files(run, static, tmp_path):
    run("verify", "static", static, "-o", tmp_path / "out")
    page = (tmp_path / "out" / "certificate.html").read_text()
    document = json.loads((tmp_path / "out" / "result.json").read_text())
    table = pd.read_csv(tmp_path / "out" / "errors-static.csv")
    row = document["rows"][0]
    for value, truth in (
        (row["rms"]["value"], np.sqrt(np.mean(table.error**2))),
        (row["off_edges"]["value"], np.sqrt(np.mean(table.error[table.edge == 0] ** 2))),
        (row["distance"]["value"], np.sqrt(np.mean(table.distance**2))),
        (row["maximum"], table.error.abs().max()),
        (row["bias"]["value"], table.error.mean()),
        (row["noise"], np.sqrt(np.mean(table.sd**2))),
    ):
        np.testing.assert_allclose(value, truth, rtol=0, atol=RECOMPUTED)
        assert f"{1000 * value:.3f}".replace("-", "\N{MINUS SIGN}") in page
    np.testing.assert_allclose(table.error, table.height - table.machined, rtol=0, atol=1e-12)
    for one in document["inputs"]:
        assert one["sha256"] in page
    assert "Scanner 12 &lt;A&amp;B&gt;" in page
    assert trueterrain.__version__ in page
    # one beam beside an edge is 0.6 mm wrong, the others 0.05 mm; and six faces are met once each
    assert "static, RMS, off edges, distance, bias: of no more than" in page


@pytest.mark.slow
def test_static_prints_a_table(run, static, tmp_path):
    finished = run("verify", "static", static, "-o", tmp_path / "out")
    assert re.search(r"test +RMS \[mm\] +off edges +distance +maximum", finished.out)
    assert "static: off_edges passed, limit 1 mm" in finished.out
    assert "static: noise FAILED, limit 0.1 mm" in finished.out
    assert finished.err.endswith("the certificate; certificate.pdf is for printing\n")


@pytest.mark.slow
def test_dynamic_compares_methods_and_rejects_motion(run, tmp_path, machined, recorded):
    config = tmp_path / "dynamic.toml"
    config.write_text(
        f'runs = {{wavy = "{recorded}/drive-run.zarr"}}\nmachined = "{machined}"\n'
        'methods = ["navigation", "rts"]\ntest = {floor = 1.5}\n'
    )
    finished = run("verify", "dynamic", config, "-o", tmp_path / "out", "--json")
    assert finished.code == 0, finished.err
    document = json.loads(finished.out)
    assert [row["test"] for row in document["rows"]] == ["wavy, navigation", "wavy, rts"]
    for row in document["rows"]:
        assert row["off_edges"]["value"] < 0.005  # [m] half of the motion
    assert document["passed"] is None
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert {"errors-wavy-rts.csv", "rejection-wavy-rts.csv", "certificate.html"} <= names


def test_drift_certifies_repeated_runs(run, tmp_path):
    s = np.arange(1201.0)
    rng = np.random.default_rng(3)
    for name in ("a", "b"):
        trueterrain.write(
            make_profile(s, 1e-3 * rng.normal(size=s.size).cumsum()), tmp_path / f"{name}.csv"
        )
    config = tmp_path / "drift.toml"
    config.write_text('profiles = ["a.csv", "b.csv"]\n')
    finished = run("verify", "drift", config, "-o", tmp_path / "out")
    assert finished.code == 0, finished.err
    assert "No limits were given" in finished.out
    assert (tmp_path / "out" / "growth-drift.csv").exists()
    page = (tmp_path / "out" / "certificate.html").read_text()
    assert "Repeatability of a single run" in page
    # a random walk is as long as its path, of which no interval is certain
    assert "the interval is a lower bound" in page


def _failed(run, tmp_path, kind, config):
    finished = run("verify", kind, config, "-o", tmp_path / "out")
    assert (finished.code, finished.out) == (2, "")
    assert len(finished.err.splitlines()) == 1
    assert not (tmp_path / "out").exists()
    return finished.err


def test_fewer_scans_than_needed_are_one_line(run, static, tmp_path):
    static.write_text(static.read_text().replace("test = {", "test = {min_scans = 5000, "))
    message = _failed(run, tmp_path, "static", static)
    assert "stand-run.zarr: scans: holds 200 scans, the static test needs 5000" in message


def test_a_machined_profile_in_millimetres_is_one_line(run, static, tmp_path, machined):
    wrong = tmp_path / "wrong.csv"
    profile = trueterrain.open(machined)
    trueterrain.write(make_profile(profile.s, 1000 * profile.height.values), wrong)
    static.write_text(static.read_text().replace(str(machined), "wrong.csv"))
    finished = run("verify", "static", static, "-o", tmp_path / "out")
    assert finished.code == 2
    assert "wrong.csv: machined profile, height: spans 38 m" in finished.err
    assert "Name the unit" in finished.err


def test_a_plate_that_is_not_in_the_scan_is_one_line(run, static, tmp_path):
    s = np.arange(1201) / 1000
    comb = 0.04 * (np.mod(s, 0.1) < 0.05)
    trueterrain.write(make_profile(s, comb), tmp_path / "comb.csv")
    text = re.sub(r"machined = .*", 'machined = "comb.csv"', static.read_text())
    static.write_text(text)
    finished = run("verify", "static", static, "-o", tmp_path / "out")
    assert finished.code == 2
    assert "stand-run.zarr: the plate is not found" in finished.err


def test_a_run_that_does_not_cross_the_plate_is_one_line(run, tmp_path, machined, recorded):
    config = tmp_path / "dynamic.toml"
    config.write_text(
        f'runs = {{still = "{recorded}/stand-run.zarr"}}\nmachined = "{machined}"\n'
        'methods = ["navigation"]\n'
    )
    finished = run("verify", "dynamic", config, "-o", tmp_path / "out")
    assert finished.code == 2
    assert "does not cross the plate" in finished.err
    config.write_text(
        f'runs = {{short = "{recorded}/drive-run.zarr"}}\nmachined = "{machined}"\n'
        'methods = ["navigation"]\ntest = {begin = 1.3}\n'
    )
    finished = run("verify", "dynamic", config, "-o", tmp_path / "out")
    assert finished.code == 2
    assert "plate is not found" in finished.err


@pytest.mark.parametrize("setting", ['clock = "none.zarr"', 'boresight = ["none.zarr", "b.zarr"]'])
def test_a_missing_run_for_the_instruments_is_one_line_before_any_work(
    run, static, tmp_path, setting
):
    static.write_text(f"{setting}\n{static.read_text()}")
    message = _failed(run, tmp_path, "static", static)
    assert re.search(r"there is no run .*none\.zarr", message)


@pytest.mark.slow
def test_results_are_overwritten_only_with_force(run, static, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine.txt").write_text("mine")
    finished = run("verify", "static", static, "-o", tmp_path / "out")
    assert finished.code == 2
    assert "not empty" in finished.err
    assert run("verify", "static", static, "-o", tmp_path / "out", "--force").code == 0
    assert (tmp_path / "out" / "mine.txt").exists()


@pytest.mark.parametrize("test", ["static", "dynamic", "drift"])
def test_a_test_asks_for_its_settings(run, tmp_path, test):
    finished = run("verify", test, "-o", tmp_path / "out")
    assert finished.code == 2
    assert finished.err.count("\n") == 1
    assert f"verify {test} CONFIG" in finished.err
    assert not (tmp_path / "out").exists()


def test_the_table_of_earlier_versions_names_its_study(run, tmp_path):
    finished = run("verify", "table", "-o", tmp_path / "out")
    assert finished.code == 2
    assert finished.err.count("\n") == 1
    assert "make study-table" in finished.err
    assert not (tmp_path / "out").exists()
