"""The command ``trueterrain init``: settings to begin with."""

from typing import Literal

from trueterrain.cli._console import out


def init(what: Literal["survey", "scene"], /, *names: str) -> None:
    """Print complete settings, with a comment for each.

    What is printed can be used as it is. Every setting stands there with its help, unit and
    default; what has no default, and everything else that there is to choose from, in comments.

    Example: `trueterrain init survey left.zarr right.zarr > survey.toml`

    Parameters
    ----------
    what
        What the settings are for. survey: recorded runs and what shall become of them, for
        `trueterrain run`. scene: ground, vehicle and instruments of the virtual profiler, for
        `trueterrain simulate`.
    names
        survey: the recorded runs, NAME.zarr. scene: a ready scene (see `trueterrain simulate
        --list`) or a .toml file to take the values from; by default one lane of Belgian block.
    """
    makers = {"survey": _survey, "scene": _scene}
    out(makers[what](names).rstrip("\n"))


def _survey(runs: tuple[str, ...]) -> str:
    from trueterrain.survey import survey_of, survey_template

    return survey_template(survey_of(list(runs)) if runs else None)


def _scene(names: tuple[str, ...]) -> str:
    from trueterrain.simulate.scene import read_scene, scene_template

    if len(names) > 1:
        message = f"name one scene, got {', '.join(names)}."
        raise ValueError(message)
    return scene_template(read_scene(names[0])[0] if names else None)
