"""Recording: a pass is driven block by block, and every instrument writes what it sees."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.engine.progress import Progress, no_progress
from trueterrain.formats.run import RunWriter
from trueterrain.kinds import make_surface
from trueterrain.simulate.accelerometers import AccelerometerStream
from trueterrain.simulate.body import Motion
from trueterrain.simulate.ground import Ground
from trueterrain.simulate.navigation import NavigationStream
from trueterrain.simulate.pose import COMPONENTS, PoseKnots
from trueterrain.simulate.raster import Raster
from trueterrain.simulate.rotation import body_to_ground
from trueterrain.simulate.scanner import ScannerStream, Scans
from trueterrain.simulate.scene._parts import Drive
from trueterrain.simulate.scene._scene import Scene, Stage, set_stage

Float = npt.NDArray[np.float64]

_BLOCK = 0.25  # [s] recorded at a time: some 235,000 beams
_LEAD = 0.1  # [s] that navigation and accelerometers record before and after the scans
_MARGIN = 0.1  # [s] of motion around a block
_MICROMETRE = 1e-6  # [m] step in which the errors of ranges are kept
_LOST = np.int16(-32768)
_LARGEST_TRUTH = 30_000_000  # nodes of the surface that shows the ground


def record_scene(
    scene: Scene,
    folder: str | Path,
    *,
    path: Path | None = None,
    force: bool = False,
    progress: Progress = no_progress,
) -> list[Path]:
    """Record all passes of a scene.

    Parameters
    ----------
    scene : Scene
        The scene.
    folder : str or Path
        Folder in which the runs ``NAME-PASS.zarr`` shall be.
    path : Path, optional
        File of the scene, for messages.
    force : bool
        Replace runs that are there already.
    progress : callable, optional
        Called with the name of the pass, and the seconds driven and to drive.

    Returns
    -------
    list of Path
        The runs.

    Raises
    ------
    FormatError
        If the scene cannot be made or a pass is impossible.
    OutputError
        If a run exists and `force` is false, or the folder does not exist.
    """
    stage = set_stage(scene, path=path)
    motions = [stage.motion(drive) for drive in scene.passes]  # all are possible, or none is driven
    targets = [Path(folder) / f"{scene.name}-{drive.name}.zarr" for drive in scene.passes]
    for number, (drive, motion, target) in enumerate(
        zip(scene.passes, motions, targets, strict=True)
    ):
        record_pass(stage, drive, motion, target, number=number, force=force, progress=progress)
    return targets


def record_pass(
    stage: Stage,
    drive: Drive,
    motion: Motion,
    target: str | Path,
    *,
    number: int = 0,
    force: bool = False,
    progress: Progress = no_progress,
) -> None:
    """Record one pass.

    Parameters
    ----------
    stage : Stage
        Scene with its ground.
    drive : Drive
        The pass.
    motion : Motion
        Motion of the body in it.
    target : str or Path
        The run to write, NAME.zarr.
    number : int
        Number of the pass, from 0: each has noise and drift of its own.
    force : bool
        Replace a run that is there already.
    progress : callable, optional
        Called with the name of the pass, and the seconds driven and to drive.

    Raises
    ------
    OutputError
        If the run exists and `force` is false, or its folder does not exist.
    """
    scene = stage.scene
    mounting = replace(scene.mounting, accelerometer_clock=scene.accelerometers.clock_offset)
    ground = Raster(stage.ground, spacing=scene.raster) if scene.raster else stage.ground
    seeded: dict[str, Any] = {"seed": scene.seed, "pass_number": number}
    scanner = ScannerStream(
        scene.scanner, mounting, ground, reflectivity=scene.reflectivity, **seeded
    )
    navigation = NavigationStream(scene.navigation, begin=-_LEAD, **seeded)
    accelerometers = AccelerometerStream(scene.accelerometers, begin=-_LEAD, **seeded)
    duration = motion.duration
    with RunWriter(
        target,
        name=f"{scene.name}-{drive.name}",
        origin=scene.origin,
        time_reference="run",
        mounting=scene.declared or mounting,
        angle=scene.scanner.angle,
        delay=scene.scanner.delay,
        accelerometer_positions=np.array(scene.accelerometers.positions),
        largest_range=scene.scanner.furthest,
        force=force,
    ) as run:
        for begin, end, knots in motion.blocks(-_LEAD, duration + _LEAD, _BLOCK, margin=_MARGIN):
            epochs = navigation.record(knots, begin, end)
            run.append_navigation(epochs.recorded)
            run.append_truth("navigation", _along(epochs.truth, "epoch"))
            samples = accelerometers.record(knots, begin, end)
            run.append_accelerometers(**samples.recorded)
            run.append_truth(
                "accelerometers", _along(samples.truth, "sample", "sensor"), dim="sample"
            )
            run.append_truth("body", _knots(knots, begin, end, last=end == duration + _LEAD))
            first, last = max(begin, 0.0), min(end, duration)
            if last > first:
                scans = scanner.record(knots, first, last)
                run.append_scans(scans.time, scans.range, scans.intensity)
                run.append_truth("scanner", _poses(knots, scans, scanner))
                if scene.truth.returns:
                    run.append_truth("returns", _errors(scans), dim="scan")
                progress(drive.name, last, duration)
        for part in true_ground(stage, motion, ground):
            run.append_truth("ground", part, dim="u")


def true_ground(stage: Stage, motion: Motion, ground: Ground) -> Iterator[xr.Dataset]:
    """Surface that shows the ground under a pass, piece by piece along it.

    Parameters
    ----------
    stage : Stage
        Scene with its ground.
    motion : Motion
        Motion of the body.
    ground : Ground
        True ground.

    Yields
    ------
    xarray.Dataset
        Surface with the way of the body as reference line, wider than the swath; a standing
        vehicle looks along its x axis.
    """
    scene = stage.scene
    spacing = scene.truth.spacing
    half = 0.5 * scene.scanner.swath + 0.5
    v = _multiples(half, spacing)
    line = _way(motion, spacing)
    if line.shape[0] * v.size > _LARGEST_TRUTH:
        line = line[:: math.ceil(line.shape[0] * v.size / _LARGEST_TRUTH)]
    rows = 1000
    for begin in range(0, len(line) - 1, rows):
        part = line[begin : begin + rows]
        if len(part) < 2:
            break
        yield _strip(part, v, ground)


def _way(motion: Motion, spacing: float) -> Float:
    """Station, position and heading along the way of the body, shape (n, 4)."""
    pieces, travelled = [], 0.0
    for begin, end, knots in motion.blocks(0.0, motion.duration, 1.0, margin=_MARGIN):
        inside = (knots.time >= begin) & (knots.time <= end)
        pose = knots.pose[inside]
        steps = np.hypot(*np.diff(pose[:, :2], axis=0).T)
        s = travelled + np.concatenate([[0.0], np.cumsum(steps)])
        at = np.arange(math.ceil(s[0] / spacing), math.floor(s[-1] / spacing) + 1) * spacing
        if s[-1] > s[0]:
            columns = [np.interp(at, s, pose[:, c]) for c in (0, 1, 5)]
            pieces.append(np.stack([at, *columns], axis=1))
        travelled = s[-1]
    line = np.concatenate(pieces) if pieces else np.empty((0, 4))
    line = (
        line[np.concatenate([[True], np.diff(line[:, 0]) > 0.5 * spacing])] if len(line) else line
    )
    if len(line) >= 2:
        return line
    pose = motion.knots(0.0, min(motion.duration, 0.01)).pose[0]
    s = _multiples(1.0, spacing)
    ahead = np.array([np.cos(pose[5]), np.sin(pose[5])])
    return np.column_stack([s, pose[:2] + s[:, None] * ahead, np.full(s.size, pose[5])])


def _multiples(half: float, spacing: float) -> Float:
    """Multiples of the spacing from -half to half [m]."""
    most = math.ceil(half / spacing)
    return spacing * np.arange(-most, most + 1, dtype=float)


def _strip(line: Float, v: Float, ground: Ground) -> xr.Dataset:
    """Surface across a part of the way."""
    u, east, north, heading = line.T
    left = np.stack([-np.sin(heading), np.cos(heading)])
    x = east[:, None] + v * left[0][:, None]
    y = north[:, None] + v * left[1][:, None]
    return make_surface(
        ground.height(x, y), u=u, v=v, easting=east, northing=north, heading=heading
    )


def _along(block: Mapping[str, npt.ArrayLike], *dims: str) -> xr.Dataset:
    return xr.Dataset(
        {name: (dims[: np.ndim(values)], np.asarray(values)) for name, values in block.items()}
    )


def _knots(knots: PoseKnots, begin: float, end: float, *, last: bool) -> xr.Dataset:
    """Knots of the exact motion in [begin, end), and the one that closes the last block."""
    inside = (knots.time >= begin - 1e-9) & (knots.time < end + (1e-9 if last else -1e-9))
    columns: dict[str, Float] = {"time": knots.time[inside]}
    for number, name in enumerate(COMPONENTS):
        columns[name] = knots.pose[inside, number]
        columns[f"{name}_rate"] = knots.rate[inside, number]
        columns[f"{name}_acceleration"] = knots.acceleration[inside, number]
    return _along(columns, "knot")


def _poses(knots: PoseKnots, scans: Scans, scanner: ScannerStream) -> xr.Dataset:
    """Exact pose of the scanner at the first beam of every scan."""
    time = scans.time + scanner.mounting.scanner_clock
    pose, _, _ = knots.at(time)
    body = body_to_ground(pose[:, 3:])
    at = pose[:, :3] + body @ np.array(scanner.mounting.scanner_position)
    turned = body @ body_to_ground(scanner.mounting.scanner_rotation)
    angles = (
        np.arctan2(turned[:, 2, 1], turned[:, 2, 2]),
        -np.arcsin(np.clip(turned[:, 2, 0], -1, 1)),
        np.arctan2(turned[:, 1, 0], turned[:, 0, 0]),
    )
    columns = dict(zip(COMPONENTS, [*at.T, *angles], strict=True))
    return _along({"time": time, **columns}, "scan")


def _errors(scans: Scans) -> xr.Dataset:
    """Error of every range: recorded less exact."""
    error = scans.range - scans.true_range
    steps = np.where(np.isnan(error), float(_LOST), np.rint(error / _MICROMETRE))
    attrs = {"units": "m", "scale_factor": _MICROMETRE, "_FillValue": int(_LOST)}
    values = np.clip(steps, _LOST, 32767).astype(np.int16)
    return xr.Dataset({"range_error": (("scan", "beam"), values, attrs)})
