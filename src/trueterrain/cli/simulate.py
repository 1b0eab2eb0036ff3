"""The command ``trueterrain simulate``: recorded runs whose true ground is known."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from trueterrain.cli._console import progress_bar, write_json, write_line
from trueterrain.cli._options import INTEGER
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
    seed: Annotated[int | None, INTEGER] = None,
    show_scenes: Annotated[bool, Parameter(name="--list", negative="")] = False,
    json: Annotated[bool, Parameter(negative="")] = False,
    force: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Simulate the recordings of a virtual profiler on known ground.

    Each pass of the scene gives one run, SCENE-PASS.zarr: scans, navigation and accelerometers with
    their errors, and the truth. The same scene and seed give the same runs. All runs appear
    together when the last one is complete. `trueterrain init scene` prints a scene to start from.

    Example: `trueterrain simulate belgian-two-lanes -o runs`

    Parameters
    ----------
    scene
        Scene: a .toml file, or the name of a ready scene.
    output
        Folder for the runs; it is created if it does not exist.
    passes
        Record only the pass of this name; may be given several times. By default all.
    seed
        Seed of all noise; by default that of the scene.
    show_scenes
        List the ready scenes and exit.
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
            write_line(_summary_text(run, max(len(run["path"]) for run in runs)))
    if json:
        settings = stage.scene
        write_json(
            {"scene": settings.name, "title": settings.title, "seed": settings.seed, "runs": runs}
        )


def _list_scenes(json: bool) -> None:
    from trueterrain.simulate.scene import read_scene, scene_names

    scenes = [read_scene(name)[0] for name in scene_names()]
    if json:
        write_json(
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
    # numbered by position in the scene: a pass has the same noise if it is recorded alone
    return [(n, drive) for n, drive in enumerate(scene.passes) if drive.name in (passes or known)]


def _scene_files(stage: "Stage") -> list[Path]:
    """Files of a scene: its settings and its files of measured ground."""
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


def _summary_text(run: dict[str, Any], width: int) -> str:
    return (
        f"{run['path']:<{width}}  {run['scans']:>9,} scans of {run['beams']} beams in "
        f"{run['seconds']:.3f} s, {run['bytes'] / 1e6:.1f} MB"
    )
