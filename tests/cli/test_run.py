"""The commands init survey and run."""

import json
from dataclasses import replace

import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from trueterrain.surface.placement import GridPlacement
from trueterrain.survey import ProfilePathSettings, RunSettings, run_survey, survey_of

pytestmark = pytest.mark.slow


@pytest.mark.slow
def test_the_commands_init_and_run(run, two_lanes, tmp_path):
    finished = run("init", "survey", *two_lanes)
    assert finished.code == 0, finished.err
    text = finished.out.replace("spacing = 0.01", "spacing = 0.02")
    (tmp_path / "survey.toml").write_text(text)
    finished = run("run", tmp_path / "survey.toml", "-o", tmp_path / "out", "--json")
    assert finished.code == 0, finished.err
    numbers = json.loads(finished.out)
    result = json.loads((tmp_path / "out" / "result.json").read_text())
    assert {key: numbers[key] for key in result} == result
    finished = run("run", tmp_path / "survey.toml", "-o", tmp_path / "out")
    assert (finished.code, finished.out) == (2, "")
    assert "is not empty" in finished.err
    finished = run("run", tmp_path / "survey.toml", "-o", tmp_path / "out", "--force")
    assert finished.code == 0, finished.err
    iri = numbers["lanes"][0]["profiles"][0]["iri"]
    assert f"IRI {iri:.2f} m/km" in finished.out
    assert "report.html" in finished.err
    assert run("init", "scene", "kerb", "kerb").code == 2


@pytest.mark.slow
def test_a_profile_of_no_lane_is_exit_code_1(run, two_lanes, tmp_path):
    """What was found is kept; who called the command sees that something is missing."""
    text = run("init", "survey", two_lanes[0]).out.replace("spacing = 0.01", "spacing = 0.02")
    (tmp_path / "survey.toml").write_text(text.replace("offset = 0.75", "offset = 30.0"))
    finished = run("run", tmp_path / "survey.toml", "-o", tmp_path / "out")
    assert finished.code == 1
    assert "no lane has the profile left; " in finished.err
    result = json.loads((tmp_path / "out" / "result.json").read_text())
    assert [profile["name"] for profile in result["lanes"][0]["profiles"]] == ["right"]


@pytest.mark.parametrize("threads", ["0", "-1", "70000"])
def test_threads_are_counted_before_the_work(run, two_lanes, tmp_path, threads):
    (tmp_path / "survey.toml").write_text(run("init", "survey", two_lanes[0]).out)
    (tmp_path / "p.csv").write_text("easting,northing,up\n0,0,0\n1,0,0\n")
    for arguments in (
        ["run", tmp_path / "survey.toml", "-o", tmp_path / "out"],
        ["grid", two_lanes[0], "-o", tmp_path / "o.crg"],
        ["grid", tmp_path / "p.csv", "-o", tmp_path / "o.tif"],
        ["merge", *two_lanes, "-o", tmp_path / "out"],
    ):
        finished = run(*arguments, "--threads", threads)
        assert finished.code == 2, arguments
        assert finished.err == (
            f"trueterrain: error: threads must be from 1 to 1024, got {threads}.\n"
        )
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_names_that_look_like_mathematics_or_formulas(two_lanes, tmp_path, monkeypatch):
    """A survey must not fail at its end for a name, nor be drawn under another one."""
    drawn = []
    save = Figure.savefig

    def saved(figure, *arguments, **options):
        texts = [text for text in figure.findobj(Text) if text.get_visible()]
        drawn.extend(text for text in texts if "$" in text.get_text())
        return save(figure, *arguments, **options)

    monkeypatch.setattr(Figure, "savefig", saved)
    named = tuple(
        RunSettings(path=str(path), name=name)
        for path, name in zip(two_lanes, ("$^$", "a$_{b$"), strict=True)
    )
    survey = survey_of(
        list(two_lanes),
        name="=$^$",
        title="$^$ <b>",
        grid=GridPlacement(spacing=0.02),
        profiles=(ProfilePathSettings(name="$_$", offset=0.5, spacing=0.02),),
    )
    found = run_survey(replace(survey, runs=named), tmp_path / "out")
    assert any("$_$" in file for file in found.files)
    ours = [text for text in drawn if "mathdefault" not in text.get_text()]
    assert any("$_$" in text.get_text() for text in ours)
    assert not [text.get_text() for text in ours if text.get_parse_math()]
    assert "$^$ &lt;b&gt;" in (tmp_path / "out" / "report.html").read_text()
