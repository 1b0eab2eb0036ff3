"""``trueterrain init survey`` and ``trueterrain run``, as a user calls them."""

import json
from dataclasses import replace

import pytest

from trueterrain.simulate.scene import read_scene, record_scene


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Two short lanes."""
    scene, _ = read_scene("belgian-two-lanes")
    scene = replace(
        scene, course={"kind": "straight", "length": 13.0}, raster=0.01,
        ground=({"kind": "road", "road_class": "B", "seed": 3, "waves": 200},),
        scanner=replace(scene.scanner, beams=200),
    )  # fmt: skip
    return record_scene(scene, tmp_path_factory.mktemp("runs"))


def test_the_commands_init_and_run(run, runs, tmp_path):
    finished = run("init", "survey", *runs)
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
