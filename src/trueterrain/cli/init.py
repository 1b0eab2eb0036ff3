"""The command ``trueterrain init``: settings to begin with."""

from typing import Literal

from trueterrain.cli._console import out


def init(what: Literal["scene"], name: str | None = None, /) -> None:
    """Print complete settings, with a comment for each.

    What is printed can be used as it is. Every setting stands there with its help, unit and
    default; what has no default, and everything else that there is to choose from, in comments.

    Example: `trueterrain init scene belgian-two-lanes > scene.toml`

    Parameters
    ----------
    what
        What the settings are for. scene: ground, vehicle and instruments of the virtual profiler,
        for `trueterrain simulate`.
    name
        Ready scene (see `trueterrain simulate --list`) or .toml file to take the values from; by
        default those of one lane of Belgian block.
    """
    makers = {"scene": _scene}
    out(makers[what](name).rstrip("\n"))


def _scene(name: str | None) -> str:
    from trueterrain.simulate.scene import read_scene, scene_template

    return scene_template(None if name is None else read_scene(name)[0])
