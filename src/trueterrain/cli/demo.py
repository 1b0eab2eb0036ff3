"""The command ``trueterrain demo``: a simulated survey, processed from runs to report."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from trueterrain.cli._console import (
    available_processors,
    note_compilation,
    progress_bar,
    write_json,
    write_line,
    write_note,
)
from trueterrain.cli._options import INTEGER

if TYPE_CHECKING:
    from trueterrain.simulate.scene import Scene
    from trueterrain.survey import Survey

_SCENE, _NAME = "belgian-two-lanes", "belgian-block"
# [m] length of the road: a shorter one cannot be rated, a longer one takes many minutes
_MIN_LENGTH, _MAX_LENGTH = 12.0, 500.0
_WHEEL = 0.75  # [m] lateral distance of a wheel path from the centre of the lane


def demo(
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])] = Path("demo"),
    length: float = 40.0,
    seed: Annotated[int, INTEGER] = 2009,
    json: bool = False,
    force: bool = False,
) -> None:
    """Simulate a survey of a Belgian block road in two lanes, and process it up to the report.

    A virtual profiler drives twice over Belgian block; its instruments have noise and drift. Both
    recordings are brought into agreement and gridded to one surface with a standard deviation for
    each height. Tyre profiles are extracted, rated, and compared with the true ground. No input is
    needed.

    Example: `trueterrain demo -o demo`, then `trueterrain run demo/survey.toml -o again`

    Parameters
    ----------
    output
        Folder for the recorded runs, the settings survey.toml, and the results.
    length
        Length of the road [m].
    seed
        Seed of the road and of all noise; the same seed gives the same results.
    json
        Print results/result.json instead of a summary, with "folder" and "files" added.
    force
        Replace an earlier result of the same command in the folder; other files in it stay.
    """
    from trueterrain.cli.run import summary_lines
    from trueterrain.core import whole_folder
    from trueterrain.simulate.scene import record_scene
    from trueterrain.survey import read_survey, run_survey, survey_template
    from trueterrain.verify import truth_of

    scene = _demo_scene(length, seed)
    with (
        whole_folder(
            output, result="demo", force=force, names=("runs", "survey.toml", "results")
        ) as folder,
        note_compilation(),
        progress_bar() as progress,
    ):
        write_note("simulating two recordings ...")
        (folder / "runs").mkdir()
        runs = record_scene(scene, folder / "runs", progress=progress)
        (folder / "survey.toml").write_text(survey_template(_demo_survey(scene, runs)))
        write_note("processing both recordings ...")
        found = run_survey(
            read_survey(folder / "survey.toml"),
            folder / "results",
            threads=available_processors(),
            truth=truth_of,
            progress=progress,
        )
    results = output / "results"
    if json:
        write_json({**found.numbers, "folder": str(results), "files": list(found.files)})
        return
    for line in summary_lines(found.numbers):
        write_line(line)
    write_line(f"{results / 'report.html'}: the report, with pictures")


def _demo_scene(length: float, seed: int) -> "Scene":
    """Scene of two lanes of a given length."""
    from dataclasses import replace

    from trueterrain.simulate.scene import read_scene

    if not _MIN_LENGTH <= length <= _MAX_LENGTH:
        message = f"length must be from {_MIN_LENGTH:g} m to {_MAX_LENGTH:g} m, got {length:g}."
        raise ValueError(message)
    scene, _ = read_scene(_SCENE)
    block = {**scene.ground[0], "seed": seed}
    return replace(scene, seed=seed, course={**scene.course, "length": length}, ground=(block,))


def _demo_survey(scene: "Scene", runs: list[Path]) -> "Survey":
    """Survey that merges both lanes, with tyre profiles in each lane and on the seam."""
    from trueterrain.alignment.merge import MergeSettings
    from trueterrain.profile import TyreProfileSettings
    from trueterrain.survey import ProfilePathSettings, RunSettings, Survey

    left, right = (drive.lane - scene.passes[0].lane for drive in scene.passes)
    offsets = {
        "left-lane-left": left + _WHEEL,
        "left-lane-right": left - _WHEEL,
        "seam": 0.5 * (left + right),
        "right-lane-left": right + _WHEEL,
        "right-lane-right": right - _WHEEL,
    }
    return Survey(
        name=_NAME,
        title=scene.title,
        runs=tuple(
            RunSettings(path=f"runs/{run.name}", name=drive.name)
            for run, drive in zip(runs, scene.passes, strict=True)
        ),
        lanes=MergeSettings(),
        profiles=(
            *(ProfilePathSettings(name=name, offset=at) for name, at in offsets.items()),
            ProfilePathSettings(
                name="left-lane-left-point",
                offset=offsets["left-lane-left"],
                tyre=TyreProfileSettings(statistic="point"),
            ),
        ),
    )
