"""The command iri: tables, JSON, and bad input."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

from trueterrain import roughness
from trueterrain.cli import main
from trueterrain.core.schemas import make_points, make_profile
from trueterrain.formats import erd, table

WRITTEN = 1e-5  # [m/km] heights in the files are rounded to 1e-9 m, slopes over 0.1 m to 1e-8


def rough(n, seed):
    return np.cumsum(np.random.default_rng(seed).standard_normal(n)) * 1e-3


@pytest.fixture
def two():
    s = 0.1 * np.arange(2501)
    return make_profile(s, [rough(s.size, 1), rough(s.size, 2)], tracks=["left", "right"])


@pytest.fixture
def erd_file(tmp_path, two):
    erd.write(two, tmp_path / "two.erd")
    return tmp_path / "two.erd"


@pytest.fixture
def csv_file(tmp_path, two):
    table.write(two.isel(track=0, drop=True), tmp_path / "one.csv")
    return tmp_path / "one.csv"


def run(capsys, *arguments):
    """Standard output of a command that succeeds."""
    with pytest.raises(SystemExit) as stop:
        main(["iri", *(str(argument) for argument in arguments)])
    assert stop.value.code in (0, None)
    captured = capsys.readouterr()
    assert captured.err == ""
    return captured.out


def refused(capsys, *arguments):
    """The one line on standard error of a command that fails."""
    with pytest.raises(SystemExit) as stop:
        main(["iri", *(str(argument) for argument in arguments)])
    assert stop.value.code == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    return captured.err


def test_json_of_one_file(capsys, erd_file, two):
    document = json.loads(run(capsys, erd_file, "--json"))
    assert list(document) == ["file", "tracks", "mri", "hri", "unit"]
    assert document["file"] == str(erd_file)
    truth = roughness.iri(two, segment=100.0)
    assert_allclose(document["mri"], truth.mri, rtol=0, atol=WRITTEN)
    assert_allclose(document["hri"], truth.hri, rtol=0, atol=WRITTEN)
    for at, track in enumerate(document["tracks"]):
        assert list(track) == ["name", "iri", "segments"]
        assert track["name"] == ("left", "right")[at]
        assert_allclose(track["iri"], truth.iri[at], rtol=0, atol=WRITTEN)
        for part, segment in enumerate(track["segments"]):
            assert list(segment) == ["start", "end", "iri"]
            expected = [100.0 * part, min(100.0 * (part + 1), 250.0)]
            assert_allclose([segment["start"], segment["end"]], expected, rtol=0, atol=1e-9)
            assert_allclose(segment["iri"], truth.segment_iri[at, part], rtol=0, atol=WRITTEN)
        assert len(track["segments"]) == 3


def test_json_of_one_track_has_no_mri(capsys, csv_file):
    document = json.loads(run(capsys, csv_file, "--segment", "50", "--json"))
    assert document["mri"] is None
    assert document["hri"] is None
    assert [segment["end"] for segment in document["tracks"][0]["segments"]] == pytest.approx(
        [50, 100, 150, 200, 250]
    )


def test_json_of_several_files_is_a_list(capsys, erd_file, csv_file):
    documents = json.loads(run(capsys, erd_file, csv_file, "--json"))
    assert [document["file"] for document in documents] == [str(erd_file), str(csv_file)]
    same = [document["tracks"][0]["iri"] for document in documents]
    assert_allclose(same[0], same[1], rtol=0, atol=WRITTEN)


def test_options_reach_the_index(capsys, csv_file, two):
    arguments = ["--window", "exact", "--window-length", "0.3", "--start", "0.5s", "--restart"]
    document = json.loads(run(capsys, csv_file, *arguments, "--segment", "60", "--json"))
    options = roughness.IriSettings(window="exact", window_length=0.3, start="0.5s", restart=True)
    truth = roughness.iri(two.isel(track=0, drop=True), settings=options, segment=60.0)
    values = [segment["iri"] for segment in document["tracks"][0]["segments"]]
    assert_allclose(values, truth.segment_iri[0], rtol=0, atol=WRITTEN)


def test_continuous_windows(capsys, csv_file, two):
    document = json.loads(run(capsys, csv_file, "--continuous", "25", "--step", "5", "--json"))
    windows = document["tracks"][0]["continuous"]
    truth = roughness.continuous_iri(two.isel(track=0, drop=True), 25.0, step=5.0)
    assert list(windows[0]) == ["start", "end", "iri"]
    values = [window["iri"] for window in windows]
    assert_allclose(values, truth.iri[0], rtol=0, atol=WRITTEN)


def test_wheel_paths_swapped(capsys, erd_file):
    document = json.loads(run(capsys, erd_file, "--wheel-paths", "right", "left", "--json"))
    assert document["mri"] is not None


def test_table(capsys, erd_file, two):
    lines = run(capsys, erd_file, "--continuous", "50").splitlines()
    truth = roughness.iri(two, segment=100.0)
    assert lines[0] == f"International Roughness Index of {erd_file}"
    assert lines[1].split("  ") == ["from [m]", "to [m]", "left [m/km]", "right [m/km]"]
    assert lines[2].split() == ["0.00", "100.00", *(f"{v:.3f}" for v in truth.segment_iri[:, 0])]
    assert lines[4].endswith("shorter")
    assert lines[5].split() == ["whole", *(f"{v:.3f}" for v in truth.iri)]
    column = [*truth.segment_iri.values[0], truth.iri.values[0]]
    texts = [f"{value:.3f}" for value in column]
    ends = {line.index(text) + len(text) for line, text in zip(lines[2:6], texts, strict=True)}
    assert len(ends) == 1  # aligned
    text = "\n".join(lines)
    assert f"MRI {truth.mri.item():.3f} m/km" in text
    assert f"HRI {truth.hri.item():.3f} m/km" in text
    assert "Roughest window of left: " in text
    assert lines[-1] == (
        "Golden car at 80 km/h; window sayers (0.25 m); start first 11 m; "
        "one run over the whole profile."
    )


def test_short_profiles_are_rated_with_a_warning_word(capsys, tmp_path):
    erd.write(make_profile(0.1 * np.arange(101), rough(101, 3)), tmp_path / "short.erd")
    text = run(capsys, tmp_path / "short.erd", "--window", "none", "--restart")
    assert "Only 10 m long: the index depends on the initial state of the car." in text
    assert "window none; start first 11 m; a new car in every segment." in text


def test_help_names_units_and_the_document(capsys):
    text = " ".join(run(capsys, "--help").replace("│", " ").split())
    assert "[m]" in text
    assert "[default: 100.0]" in text
    assert '"segments": [{"start", "end", "iri"}]' in text


def test_missing_file(capsys, tmp_path):
    message = refused(capsys, tmp_path / "none.erd", "--json")
    assert "none.erd" in message


def test_no_file(capsys):
    assert "FILE" in refused(capsys)


def test_missing_heights(capsys, tmp_path):
    rows = [f"{0.1 * i:.1f},{'nan' if i == 50 else '0.01'}" for i in range(300)]
    (tmp_path / "gap.csv").write_text("s,height\n" + "\n".join(rows) + "\n")
    message = refused(capsys, tmp_path / "gap.csv")
    assert "gap.csv: track" in message
    assert "s = 5 m: has no finite height (1 of 300 samples have none). Fill the gap" in message


def test_nothing_is_printed_if_the_second_file_is_bad(capsys, erd_file, tmp_path):
    assert "none.erd" in refused(capsys, erd_file, tmp_path / "none.erd")


def test_too_short(capsys, tmp_path):
    erd.write(make_profile([0.0, 0.1], [0.0, 0.1]), tmp_path / "short.erd")
    message = refused(capsys, tmp_path / "short.erd")
    assert "short.erd: axis s: is too short for the window" in message


def test_unequal_spacing_needs_another_window(capsys, tmp_path):
    s = np.cumsum(np.random.default_rng(1).uniform(0.05, 0.15, 300))
    table.write(make_profile(s, rough(300, 4)), tmp_path / "unequal.csv")
    message = refused(capsys, tmp_path / "unequal.csv")
    assert "unequal.csv: axis s: must be equally spaced for the window sayers" in message
    assert "Choose the window exact" in message
    run(capsys, tmp_path / "unequal.csv", "--window", "exact")


def test_window_longer_than_the_profile(capsys, csv_file):
    message = refused(capsys, csv_file, "--continuous", "300")
    assert "one.csv: axis s: is shorter than the window" in message


def test_points_are_no_profile(capsys, tmp_path):
    easting = np.arange(10.0)
    table.write(make_points(easting, easting, easting), tmp_path / "points.csv")
    message = refused(capsys, tmp_path / "points.csv")
    assert "points.csv: holds points, not a profile" in message
    assert "trueterrain profile" in message


def test_surfaces_are_no_profile(capsys, data):
    message = refused(capsys, data / "opencrg" / "asam" / "belgian_block.crg")
    assert "belgian_block.crg: is a surface, not a profile" in message
    assert "trueterrain profile" in message


@pytest.mark.parametrize(
    ("option", "value", "message"),
    [
        ("--segment", "-1", "segment must be finite and at least"),
        ("--segment", "abc", "abc"),
        ("--continuous", "0", "length must be finite and greater than 0 m"),
        ("--step", "0", "step must be finite and greater than 0 m"),
        ("--window-length", "-0.25", "window_length must be finite"),
        ("--window", "box", "sayers"),
        ("--start", "11", "0.5s"),
    ],
)
def test_bad_arguments(capsys, erd_file, option, value, message):
    extra = ["--continuous", "20"] if option == "--step" else []
    assert message in refused(capsys, erd_file, *extra, f"{option}={value}")


def test_unknown_wheel_paths(capsys, erd_file):
    message = refused(capsys, erd_file, "--wheel-paths", "left", "middle")
    assert "wheel_paths must name two of the tracks left, right, got left, middle" in message


def test_a_step_needs_sliding_windows(capsys, erd_file):
    assert "--step needs --continuous" in refused(capsys, erd_file, "--step", 2)


def test_restart_and_sliding_windows_exclude_each_other(capsys, erd_file):
    assert "restart" in refused(capsys, erd_file, "--restart", "--continuous", "20")


def test_inches_per_mile_are_63_36_times_as_many(capsys, erd_file):
    metric = json.loads(run(capsys, erd_file, "--continuous", "25", "--json"))
    inches = json.loads(run(capsys, erd_file, "--continuous", "25", "--unit", "in/mi", "--json"))
    assert (metric["unit"], inches["unit"]) == ("m/km", "in/mi")
    for name in ("mri", "hri"):
        assert_allclose(inches[name], 63.36 * metric[name], rtol=1e-12, atol=0)
    for one, other in zip(metric["tracks"], inches["tracks"], strict=True):
        assert_allclose(other["iri"], 63.36 * one["iri"], rtol=1e-12, atol=0)
        for name in ("segments", "continuous"):
            assert_allclose(
                [piece["iri"] for piece in other[name]],
                [63.36 * piece["iri"] for piece in one[name]],
                rtol=1e-12,
                atol=0,
            )
            assert other[name][-1]["end"] == one[name][-1]["end"]  # lengths stay metres


def test_localised_roughness(capsys, csv_file, two):
    arguments = ("--continuous", "7.62", "--step", "0.1", "--threshold", "4.5")
    track = json.loads(run(capsys, csv_file, *arguments, "--segment", "50", "--json"))["tracks"][0]
    profile = two.isel(track=0, drop=True)
    truth = roughness.localised_roughness(profile, 4.5)
    assert truth.sizes["stretch"] > 0
    for name in ("start", "end", "peak_at"):
        values = [stretch[name] for stretch in track["stretches"]]
        assert_allclose(values, truth[name], rtol=0, atol=1e-3)  # [m] rounded heights
    assert_allclose([one["peak"] for one in track["stretches"]], truth.peak, rtol=0, atol=WRITTEN)
    parts = roughness.iri(profile, segment=50.0).segment_iri.values[0]
    assert_allclose(track["too_rough"], 50.0 * (parts > 4.5).sum(), rtol=0, atol=1e-6)
    text = run(capsys, csv_file, *arguments, "--segment", "50")
    assert f"Stretches of {track['name']} above 4.5 m/km: {truth.sizes['stretch']}" in text
    assert f"m, up to {truth.peak.values[0]:.3f} m/km at" in text


def test_thresholds_are_in_the_unit(capsys, erd_file):
    def marked(*arguments):
        text = run(capsys, erd_file, "--segment", "50", *arguments)
        return [line.endswith("too rough") for line in text.splitlines()]

    metric = marked("--threshold", "4")
    assert any(metric)
    assert metric == marked("--threshold", str(4 * 63.36), "--unit", "in/mi")


def test_histogram(capsys, erd_file, two):
    arguments = (erd_file, "--segment", "25", "--histogram", "1")
    document = json.loads(run(capsys, *arguments, "--json"))
    values = roughness.iri(two, segment=25.0).segment_iri
    for track in document["tracks"]:
        classes = track["histogram"]
        assert [one["above"] for one in classes] == list(range(len(classes)))
        assert sum(one["length"] for one in classes) == pytest.approx(250.0)
        parts = values.sel(track=track["name"]).values
        for one in classes:
            inside = (parts >= one["above"]) & (parts < one["below"])
            assert one["share"] == pytest.approx(inside.mean())
    lines = [line.split() for line in run(capsys, *arguments).splitlines()]
    assert ["IRI", "[m/km]", "left", "[%]", "right", "[%]"] in lines


@pytest.mark.parametrize(
    "extra", [(), ("--continuous", "20", "--threshold", "4", "--histogram", "1")]
)
def test_pictures_are_drawn_of_all_files(capsys, erd_file, csv_file, tmp_path, extra):
    picture = tmp_path / "iri.svg"
    with pytest.raises(SystemExit):
        main(["iri", str(erd_file), str(csv_file), "--plot", str(picture), *extra])
    captured = capsys.readouterr()
    assert captured.err == f"{picture}: written\n"
    assert "International Roughness Index" in captured.out
    text = picture.read_text()
    assert "two.erd" in text or "<svg" in text
    message = refused(capsys, erd_file, "--plot", picture)
    assert "exists" in message
    assert str(picture) in message


def warned(capsys, *arguments):
    """What a command says on standard error that succeeds."""
    with pytest.raises(SystemExit) as stop:
        main(["iri", *(str(argument) for argument in arguments)])
    assert stop.value.code in (0, None)
    return capsys.readouterr().err


def test_a_window_that_averages_nothing_is_warned_of(capsys, tmp_path):
    erd.write(make_profile(0.25 * np.arange(500), rough(500, 3)), tmp_path / "coarse.erd")
    message = warned(capsys, tmp_path / "coarse.erd", "--json")
    assert message == (
        f"trueterrain: warning: {tmp_path / 'coarse.erd'}: "
        "the window sayers of 0.25 m averages nothing at a spacing of 0.25 m.\n"
    )
    assert warned(capsys, tmp_path / "coarse.erd", "--window", "exact") == ""


def test_feet_declared_as_metres_are_questioned(capsys, tmp_path):
    s = 0.1 * np.arange(2000)
    table.write(make_profile(s, 0.08 * s / 0.3048 + rough(2000, 3)), tmp_path / "feet.csv")
    message = warned(capsys, tmp_path / "feet.csv")
    assert message == (
        f"trueterrain: warning: {tmp_path / 'feet.csv'}: track profile: "
        "climbs 0.26 m/m over 100 m; are its heights in metres, not in feet or millimetres?\n"
    )


def test_wheel_paths_of_different_lengths_are_refused(capsys, tmp_path):
    (tmp_path / "ragged.csv").write_text("s,height_left,height_right\n0,0,0\n0.1,0\n0.2,0,0\n")
    assert "ragged.csv: line 3" in refused(capsys, tmp_path / "ragged.csv")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--threshold", "0"), "--threshold must be finite and greater than 0 m/km, got 0.0"),
        (("--histogram=-1",), "--histogram must be finite and greater than 0 m/km"),
        (("--histogram", "1e-9"), "--histogram must leave at most 1000 classes"),
        (("--unit", "ft"), "in/mi"),
    ],
)
def test_bad_thresholds_and_classes(capsys, erd_file, arguments, message):
    assert message in refused(capsys, erd_file, *arguments)


@pytest.mark.parametrize("inches", [3.0, 6.0])
def test_inches_that_nobody_named_are_not_rated_in_silence(capsys, tmp_path, inches):
    """Their IRI was 6.67 m/km for 1.51."""
    metres = 0.0254 * inches * np.arange(1000)
    rows = np.column_stack([metres, rough(1000, 3)]) / 0.0254
    np.savetxt(tmp_path / "bare.csv", rows, delimiter=",")
    with pytest.raises(SystemExit) as stop:
        main(["iri", str(tmp_path / "bare.csv")])
    assert stop.value.code == 2
    message = capsys.readouterr().err
    assert "taken as s, height in metres" in message
    assert "if the stations are not in metres, name their unit" in message
    np.savetxt(
        tmp_path / "named.csv", rows, delimiter=",", header="s [in],height [in]", comments=""
    )
    table.write(make_profile(metres, rough(1000, 3)), tmp_path / "metres.csv")
    found = run(capsys, tmp_path / "named.csv", tmp_path / "metres.csv", "--json")
    one, other = (document["tracks"][0]["iri"] for document in json.loads(found))
    assert_allclose(one, other, rtol=1e-9, atol=0)
