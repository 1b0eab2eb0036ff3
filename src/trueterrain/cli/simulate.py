"""The command ``trueterrain simulate``: recorded runs whose truth is known."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from trueterrain.cli._console import out_json, progress_bar, write_line
from trueterrain.cli._numbers import WHOLE
from trueterrain.core.errors import CoverageError

if TYPE_CHECKING:
    from trueterrain.simulate.body import Motion
    from trueterrain.simulate.scene import Scene, ScenePass, Stage


def simulate(
    scene: str | None = None,
    /,
    *,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    passes: Annotated[list[str] | None, Parameter(name="--pass", negative="")] = None,
    seed: Annotated[int | None, WHOLE] = None,
    show_scenes: Annotated[bool, Parameter(name="--list", negative="")] = False,
    json: Annotated[bool, Parameter(negative="")] = False,
    force: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Drive a virtual profiler over known ground and record what its instruments see.

    Each pass of the scene becomes one run, SCENE-PASS.zarr: scans, navigation and accelerometers
    with all their errors, and the truth. The same scene and seed give the same runs. They appear
    together when the last is whole. `trueterrain init scene` prints a scene to begin with.

    Example: `trueterrain simulate belgian-two-lanes -o runs`

    Parameters
    ----------
    scene
        Scene: a .toml file, or a ready scene by its name.
    output
        Folder for the runs; it is made if it does not exist.
    passes
        Record only the pass of this name; may be given several times. By default all.
    seed
        Seed of all noise; by default that of the scene.
    show_scenes
        List the ready scenes and do nothing else.
    json
        Print one JSON document {"scene", "title", "seed", "runs": [{"pass", "path", "scans",
        "beams", "seconds", "bytes"}]}; with --list [{"name", "title", "passes"}].
    force
        Replace recorded runs that exist.
    """
    if show_scenes:
        _list_scenes(json)
        return
    if scene is None:
        message = "name a scene: a .toml file, or a ready one (see `trueterrain simulate --list`)."
        raise ValueError(message)
    if output is None:
        message = "name the folder for the runs: --output DIR."
        raise ValueError(message)
    from trueterrain.core import whole_stores

    drives, stage = _prepare_stage(scene, passes or [], seed)
    todo = [
        (number, drive, stage.motion(drive), f"{stage.scene.name}-{drive.name}.zarr")
        for number, drive in drives
    ]
    runs = []
    with whole_stores(
        output, [name for *_, name in todo], ("run",), force=force, inputs=_scene_files(stage)
    ) as folder:
        for number, drive, motion, name in todo:
            _record_one(stage, drive, motion, folder / name, number=number)
            runs.append(_pass_summary(drive, motion, folder / name, output / name))
    if not json:
        for run in runs:
            write_line(_in_words(run, max(len(run["path"]) for run in runs)))
    if json:
        settings = stage.scene
        out_json(
            {"scene": settings.name, "title": settings.title, "seed": settings.seed, "runs": runs}
        )


def _list_scenes(json: bool) -> None:
    from trueterrain.simulate.scene import read_scene, scene_names

    scenes = [read_scene(name)[0] for name in scene_names()]
    if json:
        out_json(
            [
                {"name": s.name, "title": s.title, "passes": [drive.name for drive in s.passes]}
                for s in scenes
            ]
        )
        return
    width = max(len(scene.name) for scene in scenes)
    for scene in scenes:
        write_line(f"{scene.name:<{width}}  {scene.title}")


def _prepare_stage(
    name: str, passes: list[str], seed: int | None
) -> "tuple[list[tuple[int, ScenePass]], Stage]":
    """Passes to record with their numbers in the scene, and the scene with its ground."""
    from dataclasses import replace

    from trueterrain.simulate.scene import read_scene, set_stage

    scene, path = read_scene(name)
    if seed is not None:
        scene = replace(scene, seed=seed)
    return _chosen_passes(scene, name, passes), set_stage(scene, path=path)


def _chosen_passes(scene: "Scene", name: str, passes: list[str]) -> "list[tuple[int, ScenePass]]":
    known = [drive.name for drive in scene.passes]
    for wanted in passes:
        if wanted not in known:
            message = f"{name}: --pass must be one of {', '.join(known)}, got {wanted!r}."
            raise ValueError(message)
    # the number of a pass is its place in the scene, so that it has the same noise alone
    return [(n, drive) for n, drive in enumerate(scene.passes) if drive.name in (passes or known)]


def _scene_files(stage: "Stage") -> list[Path]:
    """Files that a scene is made from: its own, and measured ground beside it."""
    if stage.path is None:
        return []
    grounds = [part["file"] for part in stage.scene.ground if "file" in part]
    return [stage.path, *(stage.path.parent / name for name in grounds)]


def _record_one(
    stage: "Stage", drive: "ScenePass", motion: "Motion", target: Path, *, number: int
) -> None:
    from trueterrain.simulate.scene import record_pass

    with progress_bar() as progress:
        try:
            record_pass(stage, drive, motion, target, number=number, progress=progress)
        except CoverageError as error:
            where = f"pass {drive.name}" + (f", {error.place}" if error.place else "")
            raise CoverageError(
                error.problem, path=stage.path, place=where, cure=error.cure
            ) from None


def _pass_summary(
    drive: "ScenePass", motion: "Motion", written: Path, target: Path
) -> dict[str, Any]:
    from trueterrain.formats.run import open_run

    sizes = open_run(written)["scans"].sizes
    return {
        "pass": drive.name,
        "path": str(target),
        "scans": sizes["scan"],
        "beams": sizes["beam"],
        "seconds": motion.duration,
        "bytes": sum(file.stat().st_size for file in written.rglob("*") if file.is_file()),
    }


def _in_words(run: dict[str, Any], width: int) -> str:
    return (
        f"{run['path']:<{width}}  {run['scans']:>9,} scans of {run['beams']} beams in "
        f"{run['seconds']:.3f} s, {run['bytes'] / 1e6:.1f} MB"
    )
