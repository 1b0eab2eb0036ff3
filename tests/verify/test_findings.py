"""Faults of known size are found and named; without faults there are none."""

import json
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from trueterrain.formats.run import Mounting
from trueterrain.georeference import Screening
from trueterrain.verify.dynamic import DynamicSettings, dynamic_test
from trueterrain.verify.error_modes import COHERENCE_THRESHOLD, main_error_source, split_by_mode
from trueterrain.verify.findings.finding import Finding, is_significant
from trueterrain.verify.static import StaticSettings, static_test

from ._driven import BEGIN, LEVER, SPEED, WAVES, driven, motion
from ._plates import machined, standing

SURE = 4.0  # standard deviations within which a value is recovered
SHIFT = -0.55  # [m] of the plate in `standing`
TILT = 0.004  # [rad] of the plate there
PLACE = BEGIN + 0.05 * SPEED  # [m] from the first pose, 0.05 s before the first scan
STATIC = StaticSettings(assumed=SHIFT, search=0.02, level=TILT, min_scans=50)
DYNAMIC = DynamicSettings(assumed=PLACE, search=0.03, floor=4.0)
MARKS = (
    "clock of the scanner",
    "scale of the accelerometers",
    "lever arm ahead, or boresight pitch",
    "lever arm to the left",
)


def named(result):
    """Findings by name."""
    return {one.name: one for one in result.findings}


def detected(result):
    """Names of what was found."""
    return {one.name for one in result.findings if one.detected}


def recovered(finding, true):
    """Assert that a value is that of the fault, and found."""
    assert finding.detected is True
    assert abs(finding.value - true) < SURE * finding.sd


def standing_still(*, roll=0.0, sd=None, **faults):
    """The standing run, with navigation."""
    run = standing(scans=60, beams=401, **faults)
    time = np.linspace(-0.1, 0.3, 80)
    columns = {"time": ("epoch", time), "roll": ("epoch", np.full(80, roll))}
    if sd is not None:
        columns["sd_roll"] = ("epoch", np.full(80, sd))
    run["navigation"] = xr.DataTree(xr.Dataset(columns))
    return run


def test_certain_is_four_standard_deviations_and_no_trifle():
    assert is_significant(4.1, 1.0)
    assert not is_significant(-3.9, 1.0)
    assert not is_significant(4.1, 0.0, min_size=5.0)


def test_the_static_test_finds_nothing_without_a_fault():
    for seed in range(20):
        (found,) = static_test(standing_still(seed=seed), machined(), STATIC)
        assert detected(found) == set()
        assert named(found)["place of the plate"].detected is False
        assert named(found)["boresight roll"].detected is False


@pytest.mark.parametrize("beside", [0.005, -0.005])
def test_a_plate_beside_its_place_is_found(beside):
    (found,) = static_test(standing_still(shift=SHIFT + beside), machined(), STATIC)
    finding = named(found)["place of the plate"]
    recovered(finding, beside)
    side = "left" if beside > 0 else "right"
    assert f"The plate lies 5.0 mm to the {side} of its assumed place" in finding.meaning
    assert detected(found) == {"place of the plate"}


def test_the_standard_deviation_of_the_place_is_that_of_its_errors():
    """Root mean square of error over sd in 20 repeats: 1 within 4 times 1 / sqrt(40)."""
    fractions = []
    for seed in range(20):
        (found,) = static_test(standing(scans=60, seed=seed), machined(), STATIC)
        finding = named(found)["place of the plate"]
        fractions.append(finding.value / finding.sd)
    assert 0.4 < float(np.sqrt(np.mean(np.square(fractions)))) < 1.7


@pytest.mark.parametrize("roll", [0.3, -0.3])
def test_boresight_roll_is_found_by_spirit_level_and_navigation(roll):
    """The mounting states a roll of the scanner that is 0.1 degrees too large."""
    wrong = np.deg2rad(0.1)
    run = standing_still(roll=np.deg2rad(roll))
    run.attrs["mounting"] = Mounting(scanner_rotation=(float(wrong), 0.0, 0.0)).to_attrs()
    # with the roll of the body, a plate that slopes by as much appears level
    settings = replace(STATIC, level=TILT + np.deg2rad(roll), assumed=None, search=None)
    finding = named(static_test(run, machined(), settings)[0])["boresight roll"]
    recovered(finding, -wrong)
    assert "degrees too large" in finding.meaning
    navigation, level = np.deg2rad(0.015), 0.0002
    np.testing.assert_allclose(finding.sd, np.hypot(navigation, level), rtol=0, atol=2e-5)  # [rad]


def test_the_standard_deviation_of_the_roll_is_the_one_reported():
    run = standing_still(sd=0.001)
    finding = named(static_test(run, machined(), replace(STATIC, level=TILT + 0.003))[0])
    assert finding["boresight roll"].detected is False  # 3 mrad by 1 mrad
    np.testing.assert_allclose(finding["boresight roll"].value, 0.003, rtol=0, atol=1e-4)


def test_faults_unobservable_at_rest_are_reported():
    settings = StaticSettings(min_scans=50)
    found = named(static_test(standing(scans=60), machined(), settings)[0])
    for name, cure in {
        "place of the plate": "assumed",
        "boresight roll": "spirit level",
        "error of bright ground": "white stripe",
        "flagged intensity": "saturation",
    }.items():
        assert (found[name].value, found[name].sd, found[name].detected) == (None, None, None)
        assert cure in found[name].meaning
    bare = standing(scans=60)
    bare["scans"] = bare["scans"].to_dataset().drop_vars("intensity")
    found = named(static_test(bare, machined(), replace(settings, level=0.0))[0])
    assert "no navigation" in found["boresight roll"].meaning
    assert "no intensities" in found["error of bright ground"].meaning


@pytest.mark.parametrize("saturation", [1e4, np.inf])
def test_a_saturated_stripe_is_found_with_and_without_screening(saturation):
    run = standing_still(bright=(0.8, 0.9, 0.0006))
    settings = replace(STATIC, screening=Screening(saturation=saturation))
    found = named(static_test(run, machined(), settings)[0])
    finding = found["error of bright ground"]
    assert finding.detected is True
    # along beams that are up to 17 degrees inclined
    np.testing.assert_allclose(finding.value, 0.0006, rtol=0, atol=SURE * finding.sd + 2e-5)
    assert "too high" in finding.meaning
    assert found["flagged intensity"].detected is (True if saturation < np.inf else None)


def test_lost_scans_and_returns_are_counted():
    run = standing_still()
    kept = np.ones(60, bool)
    kept[20:25] = False
    scans = run["scans"].to_dataset().isel(scan=kept)
    ranges = scans["range"].values.copy()
    ranges[np.random.default_rng(2).random(ranges.shape) < 0.1] = np.nan
    run["scans"] = scans.assign(range=(("scan", "beam"), ranges, {"units": "m"}))
    found = static_test(run, machined(), STATIC)[0]
    assert named(found)["scans lost"].value == 5
    np.testing.assert_allclose(named(found)["returns lost"].value, 0.1, rtol=0, atol=0.01)
    assert detected(found) == {"scans lost", "returns lost"}


def test_the_place_is_found_wherever_cells_begin():
    """Cells of 10 mm tell upright faces badly: the flanks make up for it."""
    for beside in np.arange(0.0, 0.01, 0.0013):
        settings = replace(DYNAMIC, assumed=PLACE + beside)
        found = dynamic_test(driven(beside=beside), machined(), motion(), settings)
        finding = named(found)["place of the plate"]
        assert abs(finding.value) < SURE * finding.sd < 1e-4  # [m]


@pytest.mark.slow
def test_the_dynamic_test_finds_nothing_without_a_fault():
    for seed in range(20):
        found = dynamic_test(driven(seed=seed), machined(), motion(), DYNAMIC)
        assert detected(found) == set()
        assert all(named(found)[name].detected is False for name in MARKS)
        assert all(one.moves_with is None for one in found.modes)


@pytest.mark.parametrize(
    ("declared", "scale", "mark", "true"),
    [
        ({"scanner_clock": 0.001}, 1.0, MARKS[0], -0.001),
        ({"scanner_clock": -0.001}, 1.0, MARKS[0], 0.001),
        ({}, 1.02, MARKS[1], 0.02),
        ({}, 0.98, MARKS[1], -0.02),
        ({"scanner_position": (LEVER[0] + 0.01, 0.0, 0.5)}, 1.0, MARKS[2], -0.01),
        ({"scanner_rotation": (0.0, 0.005, 0.0)}, 1.0, MARKS[2], 0.005 * 2.0),  # 2 m high
        ({"scanner_position": (LEVER[0], 0.01, 0.5)}, 1.0, MARKS[3], -0.01),
    ],
)
def test_a_fault_is_found_by_its_mark(declared, scale, mark, true):
    found = dynamic_test(driven(declared=declared), machined(), motion(scale=scale), DYNAMIC)
    finding = named(found)[mark]
    # marks are those of the motion as it was measured, and so as wrong as the fault makes it
    recovered(replace(finding, sd=finding.sd + 0.01 * abs(true)), true)
    assert detected(found) - {"place of the plate"} == {mark}


def test_marks_are_found_without_any_noise():
    declared = {"scanner_clock": 0.001}
    found = dynamic_test(driven(declared=declared, noise=0.0), machined(), motion(), DYNAMIC)
    np.testing.assert_allclose(named(found)[MARKS[0]].value, -0.001, rtol=0, atol=2e-5)  # [s]


def test_faults_are_separated_from_each_other():
    declared = {"scanner_clock": 0.0005, "scanner_position": (LEVER[0] + 0.02, 0.01, 0.5)}
    found = dynamic_test(driven(declared=declared), machined(), motion(), DYNAMIC)
    recovered(named(found)[MARKS[0]], -0.0005)
    recovered(named(found)[MARKS[2]], -0.02)
    recovered(named(found)[MARKS[3]], -0.01)
    beside = named(found)["place of the plate"]
    # heights on the flanks of the plate are off by up to 0.2 mm themselves
    np.testing.assert_allclose(beside.value, 0.02 + 0.0005 * SPEED, rtol=0, atol=3e-4)  # [m]
    assert named(found)[MARKS[1]].detected is False


def test_correlated_signatures_are_reported_as_a_pair():
    """Heave and pitch move as one: a wrong scale and a wrong lever arm look the same."""
    one = ((0.006, 1.7, 0.3), (0.002, 5.3, 1.0))
    waves = {"heave": one, "pitch": tuple((size, f, p + 0.02) for size, f, p in one)}
    found = dynamic_test(driven(waves), machined(), motion(waves, scale=1.05), DYNAMIC)
    pair = f"{MARKS[1]} or {MARKS[2]}"
    assert {named(found)[name].detected for name in MARKS[1:3]} == {None}
    assert named(found)[pair].detected is True
    assert "to separate them" in named(found)[pair].meaning
    found = dynamic_test(driven(waves), machined(), motion(waves), DYNAMIC)
    assert named(found)[pair].detected is False


def test_faults_unobservable_while_driving_are_reported():
    still = {"heave": WAVES["heave"]}
    found = named(dynamic_test(driven(still), machined(), motion(still), DYNAMIC))
    assert found[MARKS[0]].detected is False
    for name, cure in {
        MARKS[2]: "pitch",
        MARKS[3]: "staggered",
        "lever arm up": "surveyed",
        "boresight roll": "static test",
        "error of bright ground": "white stripe",
    }.items():
        assert (found[name].value, found[name].detected) == (None, None)
        assert cure in found[name].meaning
    bare = driven(still)
    del bare["accelerometers"]
    found = named(dynamic_test(bare, machined(), motion(still), DYNAMIC))
    assert "no accelerometers" in found[MARKS[1]].meaning
    found = named(
        dynamic_test(driven(still), machined(), motion(still), replace(DYNAMIC, edge=0.1))
    )
    assert found[MARKS[0]].detected is False


def test_bright_ground_and_lost_scans_are_found_while_driving():
    found = dynamic_test(driven(white=(0.75, 0.95), drop=20), machined(), motion(), DYNAMIC)
    recovered(named(found)["error of bright ground"], 5e-4)
    assert named(found)["scans lost"].value == 20
    assert detected(found) == {"error of bright ground", "scans lost"}
    screened = replace(DYNAMIC, screening=Screening(saturation=2e4))
    found = dynamic_test(driven(white=(0.8, 0.85)), machined(), motion(), screened)
    assert detected(found) == {"flagged intensity"}
    np.testing.assert_allclose(
        named(found)["flagged intensity"].value, 0.05 / 1.2, rtol=0, atol=0.01
    )


def test_results_tell_findings_and_modes_as_plain_words():
    found = dynamic_test(driven(), machined(), motion(), DYNAMIC).to_dict()
    assert json.loads(json.dumps(found))["findings"] == found["findings"]
    assert [one["name"] for one in found["modes"]][1] == "primary ride"
    assert found["source"].startswith("Nothing of the error moves with the body")


TIME = np.linspace(0, 3, 1500, endpoint=False)
BANDS = {"ride": (0.5, 3.0), "hop": (8.0, 16.0)}


def sine(frequency, phase=0.0):
    """Of amplitude 1 over `TIME`."""
    return np.sin(2 * np.pi * frequency * TIME + phase)


def test_fractions_are_those_of_the_composition_and_add_up():
    """Amplitudes 3, 2, 1: squares 9, 4, 1 of 14; ends of the record leak a little."""
    error = 3 * sine(1.5) + 2 * sine(11.0) + sine(5.0)
    modes = split_by_mode(TIME, error, {"pitch": sine(1.5)}, **BANDS)
    fractions = {one.name: one.fraction for one in modes}
    for name, true in (
        ("primary ride", 9 / 14),
        ("wheel hop", 4 / 14),
        ("between ride and hop", 1 / 14),
    ):
        np.testing.assert_allclose(fractions[name], true, rtol=0, atol=0.03)
    np.testing.assert_allclose(sum(fractions.values()), 1.0, rtol=0, atol=1e-12)
    whole = np.sqrt(sum(one.rms**2 for one in modes))
    np.testing.assert_allclose(whole, np.sqrt(7.0), rtol=0, atol=0.05)


def test_the_coherent_motion_is_named():
    pitch, heave = sine(1.5), sine(1.9, 1.0) + sine(11.0)
    error = 3 * sine(1.5, 0.4) + sine(11.0, 1.0)  # late, as by a clock
    noise = np.random.default_rng(3).normal(size=TIME.size)
    modes = {
        one.name: one
        for one in split_by_mode(
            TIME,
            error + 0.05 * noise,
            {"pitch": pitch, "heave": heave, "roll": noise[::-1]},
            **BANDS,
        )
    }
    assert modes["primary ride"].moves_with == "pitch"
    assert modes["wheel hop"].moves_with == "heave"
    assert modes["above wheel hop"].moves_with is None
    source = main_error_source(tuple(modes.values()))
    assert source.endswith("at the primary ride (0.5 to 3 Hz) and moves with pitch.")


def test_coherence_of_noise_stays_below_the_threshold_at_the_stated_rate():
    """200 bands of independent errors; the mean over a band exceeds the threshold more rarely."""
    rng = np.random.default_rng(5)
    above = 0
    for _ in range(100):
        modes = split_by_mode(TIME, rng.normal(size=1500), {"roll": rng.normal(size=1500)}, **BANDS)
        above += sum(one.coherence["roll"] > COHERENCE_THRESHOLD for one in modes if one.coherence)
    assert above <= 8  # of 400, one in 100, and two standard deviations


def test_a_band_that_a_short_record_does_not_resolve_is_reported():
    short = TIME[:100]  # 0.2 s
    modes = split_by_mode(short, sine(11.0)[:100], {"pitch": sine(1.5)[:100]}, **BANDS)
    by_name = {one.name: one for one in modes}
    assert by_name["primary ride"].fraction is None
    assert "does not resolve frequencies below 5.0 Hz" in by_name["primary ride"].meaning
    resolved = [one.fraction for one in modes if one.fraction is not None]
    np.testing.assert_allclose(sum(resolved), 1.0, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("settings", "message"),
    [({"ride": (3.0, 1.0)}, "ride and hop must ascend"), ({"hop": (2.0, 9.0)}, "must ascend")],
)
def test_bands_that_overlap_are_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        DynamicSettings(**settings)


@pytest.mark.parametrize(
    ("settings", "message"), [({"level": 3.0}, "slope in rad"), ({"level_sd": -1.0}, "level_sd")]
)
def test_levels_that_are_none_are_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        StaticSettings(**settings)


def test_a_finding_as_plain_numbers():
    finding = Finding(
        name="place", value=0.005, sd=1e-5, unit="m", detected=True, meaning="It lies beside."
    )
    assert finding.to_dict()["value"] == 0.005
