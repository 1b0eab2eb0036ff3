"""Certificates: every figure follows from the files, and inputs are named by their hash."""

import hashlib
import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import trueterrain
from trueterrain.core.errors import CoverageError, FormatError, SchemaError
from trueterrain.core.schemas import make_points, make_profile
from trueterrain.formats.run import Mounting, RunWriter
from trueterrain.motion import FusionSettings
from trueterrain.verify.certificate import certify_profiler, write_error_tables
from trueterrain.verify.results import AccuracyLimits, ResultRow
from trueterrain.verify.statistics.uncertainty import AccuracyFigure

RECOMPUTED = 1e-15  # [m] rounding of sums of some hundred errors
LENGTH = 1500  # [m]


@pytest.fixture
def drift(tmp_path):
    """Description of a drift test with its inputs."""
    s = np.arange(LENGTH + 1.0)
    rng = np.random.default_rng(2)
    for run in range(3):
        error = 0.002 + 0.001 * rng.normal(size=s.size)
        trueterrain.write(make_profile(s, 0.1 * np.sin(s / 30) + error), tmp_path / f"{run}.csv")
    trueterrain.write(make_profile(s, 0.1 * np.sin(s / 30)), tmp_path / "true.csv")
    config = tmp_path / "drift.toml"
    config.write_text(
        'system = "Van 3"\nprofiles = ["0.csv", "1.csv", "2.csv"]\nreference = "true.csv"\n'
        "limits = {rms = 0.0025, bias = 0.001}\n"
    )
    return config


def test_figures_are_recomputed_from_the_files(drift):
    found = certify_profiler("drift", drift)
    files = dict(write_error_tables(found, drift.parent))
    table = pd.read_csv(drift.parent / "errors-drift.csv")
    errors = table[["error_0", "error_1", "error_2"]].to_numpy()
    (row,) = found.to_dict()["rows"]
    for value, truth in (
        (row["rms"]["value"], np.sqrt(np.mean(errors**2))),
        (row["bias"]["value"], errors.mean()),
        (row["maximum"], np.abs(errors).max()),
        (row["noise"], np.sqrt(np.mean(errors.var(axis=1, ddof=1)))),
    ):
        np.testing.assert_allclose(value, truth, rtol=0, atol=RECOMPUTED)
    assert set(files) == {"errors-drift.csv", "growth-drift.csv"}


def test_limits_are_kept_or_not(drift):
    found = certify_profiler("drift", drift)
    assert found.verdicts == {"drift": {"rms": True, "bias": False}}
    assert found.passed is False


def test_the_upper_end_of_the_interval_is_asked_where_caution_is(drift):
    rms = certify_profiler("drift", drift).results["drift"].row.rms
    limit = 0.5 * (rms.value + rms.high)
    text = drift.read_text().replace("rms = 0.0025, bias = 0.001", f"rms = {limit!r}")
    drift.write_text(text)
    assert certify_profiler("drift", drift).passed is True
    drift.write_text("cautious = true\n" + text)
    assert certify_profiler("drift", drift).passed is False


def test_without_limits_nothing_is_passed_or_failed(drift):
    lines = drift.read_text().splitlines()
    drift.write_text("\n".join(line for line in lines if not line.startswith("limits")))
    found = certify_profiler("drift", drift)
    assert found.passed is None
    assert found.verdicts == {"drift": {}}


def test_inputs_are_named_by_their_hash(drift):
    found = certify_profiler("drift", drift)
    names = ["drift.toml", "0.csv", "1.csv", "2.csv", "true.csv"]
    assert [one["name"] for one in found.inputs] == names
    for one in found.inputs:
        content = (drift.parent / one["name"]).read_bytes()
        assert one["sha256"] == hashlib.sha256(content).hexdigest()


def test_all_of_it_can_be_written_as_json(drift):
    text = json.dumps(certify_profiler("drift", drift).to_dict(), allow_nan=False)
    assert json.loads(text)["settings"]["system"] == "Van 3"


def test_a_misspelt_setting_is_named_with_the_right_one(drift):
    drift.write_text(drift.read_text().replace("profiles", "profile"))
    with pytest.raises(FormatError, match=r"profile: is unknown \(did you mean 'profiles'\?\)"):
        certify_profiler("drift", drift)


def test_a_limit_that_is_none_is_refused(drift):
    drift.write_text(drift.read_text().replace("0.0025", "-1.0"))
    with pytest.raises(FormatError, match="rms must be greater than 0 m"):
        certify_profiler("drift", drift)


def test_an_unknown_method_is_refused_before_any_work(tmp_path):
    config = tmp_path / "d.toml"
    config.write_text('runs = {a = "a.zarr"}\nmachined = "p.csv"\nmethods = ["kalman"]\n')
    with pytest.raises(FormatError, match="methods must be some of navigation, thesis"):
        certify_profiler("dynamic", config)


def test_settings_of_the_fusion_hold_for_every_method(tmp_path, monkeypatch):
    """Each method in turn, all else as the crew set it."""
    used = []

    def fuse(run, *, settings):
        used.append(settings)
        raise CoverageError("stopped here")

    monkeypatch.setattr("trueterrain.verify.certificate.fuse_motion", fuse)
    s = np.arange(0.0, 1.2, 0.0005)
    height = 0.04 * np.exp(-(((s - 0.5) / 0.05) ** 2))
    trueterrain.write(make_profile(s, height), tmp_path / "plate.csv")
    still = {name: np.zeros(3) for name in ("east", "north", "up", "roll", "pitch", "yaw")}
    with RunWriter(
        tmp_path / "a.zarr",
        name="a",
        origin=(11.0, 48.0, 500.0),
        time_reference="gps",
        mounting=Mounting(),
        angle=[0.0],
        delay=[0.0],
    ) as run:
        run.append_navigation({"time": np.array([100.0, 101.0, 102.0]), **still})
        run.append_scans(np.array([100.5, 100.6]), np.ones((2, 1)))
    config = tmp_path / "d.toml"
    for method in ("thesis", "rts"):
        config.write_text(
            f'runs = {{a = "a.zarr"}}\nmachined = "plate.csv"\nmethods = ["{method}"]\n'
            'fusion = {smoothing_window = 2.0, crossover = 8.0, method = "navigation"}\n'
        )
        with pytest.raises(CoverageError, match=r"a\.zarr: stopped here"):
            certify_profiler("dynamic", config)
    assert used == [
        FusionSettings(method=method, smoothing_window=2.0, crossover=8.0)
        for method in ("thesis", "rts")
    ]


def test_a_wrong_setting_of_the_fusion_is_refused(tmp_path):
    config = tmp_path / "d.toml"
    config.write_text(
        'runs = {a = "a.zarr"}\nmachined = "p.csv"\nfusion = {smoothing_window = 0.0}\n'
    )
    with pytest.raises(FormatError, match="smoothing_window must be greater than 0"):
        certify_profiler("dynamic", config)


def test_a_date_that_is_not_that_of_the_runs_is_flagged(drift):
    still = {name: np.zeros(3) for name in ("east", "north", "up", "roll", "pitch", "yaw")}
    folder, first = drift.parent, 1_457_338_518.0  # [s] of GPS: 2026-03-12 08:15:00 UTC
    with RunWriter(
        folder / "bounce.zarr",
        name="bounce",
        origin=(11.0, 48.0, 500.0),
        time_reference="gps",
        mounting=Mounting(),
        angle=[0.0],
        delay=[0.0],
    ) as run:
        run.append_navigation({"time": first + np.arange(3.0), **still})
        run.append_scans(first + np.array([0.5, 0.6]), np.ones((2, 1)))
    text = 'clock = "bounce.zarr"\n' + drift.read_text()
    drift.write_text('date = "2026-03-12"\n' + text)
    found = certify_profiler("drift", drift)
    assert found.flags == []
    assert found.recorded[-1].begin == "2026-03-12 08:15:00"
    assert [one.detected for one in found.instruments] == [None, None]  # no accelerometers
    drift.write_text('date = "2026-04-12"\n' + text)
    (flag,) = certify_profiler("drift", drift).flags
    assert "bounce.zarr was recorded on 2026-03-12 08:15:00 (UTC), 31 days from" in flag


def test_an_unknown_test_is_refused(drift):
    with pytest.raises(ValueError, match="one of static, dynamic, drift"):
        certify_profiler("highway", drift)


def test_tracks_are_to_be_chosen(drift):
    s = np.arange(LENGTH + 1.0)
    both = make_profile(s, [0 * s, 0 * s + 1], tracks=["left", "right"])
    trueterrain.write(both, drift.parent / "0.csv", force=True)
    with pytest.raises(SchemaError, match=r"0\.csv: holds the tracks left, right"):
        certify_profiler("drift", drift)


def test_points_are_no_profile(drift):
    points = make_points(easting=[0.0, 1.0], northing=[0.0, 0.0], up=[0.0, 0.0])
    trueterrain.write(points, drift.parent / "0.csv", force=True)
    with pytest.raises(SchemaError, match="must be a profile, but holds points"):
        certify_profiler("drift", drift)


def test_caution_trusts_no_interval_of_few_independent_errors():
    """However wide the limit: what is not known is not kept."""
    wide = AccuracyFigure(
        value=1e-3, low=5e-4, high=2e-3, confidence=0.95, block=9, independent=8.0
    )
    row = ResultRow(
        test="one",
        rms=wide,
        off_edges=replace(wide, independent=30.0),
        distance=None,
        maximum=2e-3,
        bias=wide,
        noise=None,
        registration=None,
        count=120,
    )
    limits = AccuracyLimits(rms=1.0, off_edges=1.0, bias=1.0)
    assert row.verdicts(limits) == {"rms": True, "off_edges": True, "bias": True}
    assert row.verdicts(limits, cautious=True) == {"rms": False, "off_edges": True, "bias": False}
