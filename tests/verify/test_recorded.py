"""Recording times of runs from GPS time, and contradictions to a wrong date."""

import datetime as dt

import numpy as np
import pytest

from trueterrain.formats.run import Mounting, RunWriter
from trueterrain.verify.recorded import date_contradictions, recorded_run, recording_time

GPS = {"time_reference": "gps"}
EPOCH = dt.datetime(1980, 1, 6)


def gps_seconds(moment, leaps):
    """GPS seconds of a moment in UTC."""
    return (moment - EPOCH).total_seconds() + leaps


@pytest.mark.parametrize(
    ("moment", "leaps"),
    [
        (dt.datetime(2026, 3, 12, 8, 15, 4), 18),
        (dt.datetime(2017, 1, 1), 18),
        (dt.datetime(2016, 12, 31, 23, 59, 59), 17),
        (dt.datetime(2015, 7, 1), 17),
        (dt.datetime(2012, 7, 1), 16),
        (dt.datetime(2012, 6, 30, 23, 59, 58), 15),
    ],
)
def test_seconds_since_1980_are_given_in_utc(moment, leaps):
    seconds = gps_seconds(moment, leaps)
    found = recording_time("a.zarr", GPS, (seconds, seconds + 0.5))
    assert found.begin == str(moment)
    assert found.scale == "UTC"


def test_seconds_of_the_week_are_given_as_day_and_gps_time():
    found = recording_time("a.zarr", GPS, (0.0, 604_800.0 + 3661.0))
    assert (found.begin, found.end) == ("Sunday 00:00:00", "Sunday 01:01:01")
    assert found.scale == "GPS time; the week is not in the data"


@pytest.mark.parametrize("seconds", [(-5.0, 10.0), (5e6, 5e6 + 10), (4.6e8, 4.6e8 + 10)])
def test_other_seconds_are_not_guessed_at(seconds):
    found = recording_time("a.zarr", GPS, seconds)
    assert (found.begin, found.end, found.seconds) == (None, None, None)
    assert "neither of the GPS week nor since 1980" in found.scale


def test_what_counts_from_any_moment_and_profiles_tell_nothing():
    assert "any moment" in recording_time("a.zarr", {"time_reference": "run"}, (0.0, 1.0)).scale
    assert "profiles hold no times" in recording_time("a.csv", {}).scale


@pytest.mark.parametrize(
    ("stated", "flagged"),
    [
        ("2026-03-12", False),
        ("2026-03-11", False),
        ("2026-03-13", False),
        ("2026-03-14", True),
        ("2026-03-10", True),
        ("2026-03-12, morning", False),
        ("12 March 2025", False),
        ("", False),
    ],
)
@pytest.mark.parametrize("whole", [True, False])
def test_a_date_more_than_a_day_away_is_flagged(stated, flagged, whole):
    """Seconds of the week count in the week that is nearest to the date."""
    seconds = gps_seconds(dt.datetime(2026, 3, 12, 8, 15), 18)
    if not whole:
        seconds %= 604_800
    run = recording_time("a.zarr", GPS, (seconds, seconds + 60))
    found = date_contradictions(stated, (run, recording_time("b.csv", {})))
    assert bool(found) == flagged
    if flagged:
        assert "a.zarr was recorded on" in found[0]
        assert "2 days from the stated date" in found[0]


def test_a_run_over_midnight_is_of_both_days():
    seconds = gps_seconds(dt.datetime(2026, 3, 14, 23, 59), 0) % 604_800  # a Saturday
    run = recording_time("a.zarr", GPS, (seconds, seconds + 600))
    assert run.end == "Sunday 00:09:00"
    for day in ("2026-03-13", "2026-03-14", "2026-03-15", "2026-03-16"):
        assert date_contradictions(day, (run,)) == []
    assert len(date_contradictions("2026-03-12", (run,))) == 1


def test_a_run_tells_by_its_navigation(tmp_path):
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
    found = recorded_run(tmp_path / "a.zarr")
    assert (found.name, found.seconds) == ("a.zarr", (100.0, 102.0))
    assert found.to_dict()["begin"] == "Sunday 00:01:40"
