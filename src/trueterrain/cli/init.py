"""The command ``trueterrain init``: settings to start from."""

from pathlib import Path
from typing import Literal

from trueterrain.cli._console import write_line
from trueterrain.core.errors import SchemaError


def init(what: Literal["survey", "scene", "static", "dynamic", "drift"], /, *names: str) -> None:
    """Print complete settings with a comment for each.

    The output is a valid settings file. Each setting has its help, unit and default; settings
    without a default and alternatives are comments. Excitation events and calibration plates need
    no file: `trueterrain event design` and `trueterrain plate design` take options.

    Example: `trueterrain init survey left.zarr right.zarr > survey.toml`

    Parameters
    ----------
    what
        Kind of settings. survey: recorded runs and their processing, for `trueterrain run`. scene:
        ground, vehicle and instruments of the virtual profiler, for `trueterrain simulate`. static,
        dynamic, drift: a test of the accuracy of a profiler, for `trueterrain verify`.
    names
        survey: the recorded runs, NAME.zarr. scene: a ready scene (see `trueterrain simulate
        --list`) or a .toml file that provides the values; by default one lane of Belgian block.
        static: the run above the plate. dynamic: the runs over it. drift: profiles of repeated
        runs.
    """
    if what == "survey":
        text = _survey_template(names)
    elif what == "scene":
        text = _scene_template(names)
    else:
        from trueterrain.verify.certificate import description_template

        text = description_template(what, names)
    if what != "scene":
        for name in names:
            _require_kind(Path(name), "profile" if what == "drift" else "run")
    write_line(text.rstrip("\n"))


def _require_kind(path: Path, kind: str) -> None:
    """Raise SchemaError unless a file exists and has the required kind."""
    from trueterrain import formats

    found = formats.kind_of_file(path)
    if found != kind:
        cure = {"run": "Name the folder NAME.zarr of a run.", "profile": "Extract profiles first."}
        raise SchemaError(f"must be a {kind}, but is {found}", path=path, cure=cure[kind])


def _survey_template(runs: tuple[str, ...]) -> str:
    from trueterrain.survey import survey_of, survey_template

    return survey_template(survey_of(list(runs)) if runs else None)


def _scene_template(names: tuple[str, ...]) -> str:
    from trueterrain.simulate.scene import read_scene, scene_template

    if len(names) > 1:
        message = f"name one scene, got {', '.join(names)}."
        raise ValueError(message)
    return scene_template(read_scene(names[0])[0] if names else None)
