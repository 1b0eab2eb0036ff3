"""Recording of passes: each instrument records the exact motion block by block."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core import Progress, no_progress, require_writable, whole_stores
from trueterrain.core.provenance import add_step
from trueterrain.core.schemas import make_surface
from trueterrain.formats.run import Mounting, RunWriter
from trueterrain.simulate.accelerometers import AccelerometerStream
from trueterrain.simulate.body import Motion
from trueterrain.simulate.ground import Ground
from trueterrain.simulate.navigation import NavigationStream
from trueterrain.simulate.pose import COMPONENTS, PoseKnots
from trueterrain.simulate.raster import Raster
from trueterrain.simulate.rotation import body_to_ground
from trueterrain.simulate.scanner import ScannerStream, SimulatedScans
from trueterrain.simulate.scene._kinds import MEASURED
from trueterrain.simulate.scene._parts import ScenePass
from trueterrain.simulate.scene._scene import Scene, Stage, set_stage

Float = npt.NDArray[np.float64]

#: Time recorded at once [s]: some 235,000 beams. Recordings do not depend on it.
BLOCK = 0.25

_RUN_IN = 0.1  # [s] recorded by navigation and accelerometers before and after the scans
_MARGIN = 0.1  # [s] of motion around a block
_MICROMETRE = 1e-6  # [m] step of the stored errors of ranges
_LOST = np.iinfo(np.int32).min
_LATERAL_MARGIN = 0.5  # [m] by which the true surface is wider than the swath on either side
_END_MARGIN = 1.0  # [m] by which it is longer than the path of the laser at either end
_MAX_TRUTH_NODES = 30_000_000  # [1]
_ROWS = 50  # [1] computed at a time, while the tiles of the raster are cached


def record_scene(
    scene: Scene,
    folder: str | Path,
    *,
    path: Path | None = None,
    force: bool = False,
    progress: Progress = no_progress,
) -> list[Path]:
    """Record all passes of a scene; the runs appear together when all are complete.

    Parameters
    ----------
    scene : Scene
        The scene.
    folder : str or Path
        Folder of the runs ``NAME-PASS.zarr``.
    path : Path, optional
        File of the scene, for messages.
    force : bool
        Replace runs that exist already.
    progress : callable, optional
        Called with the name of the pass, the seconds recorded, and the duration.

    Returns
    -------
    list of Path
        The runs.

    Raises
    ------
    FormatError
        If the scene is invalid or a pass is impossible.
    OutputError
        If a run exists and `force` is false, or the folder does not exist.
    """
    targets = [Path(folder) / f"{scene.name}-{drive.name}.zarr" for drive in scene.passes]
    for target in targets:
        require_writable(target, force=force, replaces=("run",))
    stage = set_stage(scene, path=path)
    motions = [
        stage.motion(drive) for drive in scene.passes
    ]  # checks all passes before the first recording
    with whole_stores(folder, [target.name for target in targets], ("run",), force=force) as whole:
        for number, (drive, motion, target) in enumerate(
            zip(scene.passes, motions, targets, strict=True)
        ):
            record_pass(stage, drive, motion, whole / target.name, number=number, progress=progress)
    return targets


def record_pass(
    stage: Stage,
    drive: ScenePass,
    motion: Motion,
    target: str | Path,
    *,
    number: int = 0,
    force: bool = False,
    block: float = BLOCK,
    progress: Progress = no_progress,
) -> None:
    """Record one pass.

    Parameters
    ----------
    stage : Stage
        Scene with its ground.
    drive : ScenePass
        The pass.
    motion : Motion
        Motion of the body in the pass.
    target : str or Path
        The run to write, NAME.zarr.
    number : int
        Number of the pass, from 0: each has its own noise and drift.
    force : bool
        Replace a run that exists already.
    block : float
        Time recorded at once [s]; the run is the same to the byte for any value.
    progress : callable, optional
        Called with the name of the pass, the seconds recorded, and the duration.

    Raises
    ------
    CoverageError
        If there is no ground under a wheel.
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
    navigation = NavigationStream(scene.navigation, begin=-_RUN_IN, **seeded)
    accelerometers = AccelerometerStream(scene.accelerometers, begin=-_RUN_IN, **seeded)
    duration = motion.duration
    true_surface = _start_true_surface(scene, mounting, motion, ground)
    with RunWriter(
        target,
        name=f"{scene.name}-{drive.name}",
        origin=scene.origin,
        time_reference="run",
        mounting=scene.declared or mounting,
        angle=scene.scanner.angle,
        delay=scene.scanner.delay,
        accelerometer_positions=np.array(scene.accelerometers.positions),
        max_range=scene.scanner.furthest,
        history=_scene_provenance(stage, drive, number),
        force=force,
    ) as run:
        for begin, end, knots in motion.blocks(-_RUN_IN, duration + _RUN_IN, block, margin=_MARGIN):
            epochs = navigation.record(knots, begin, end)
            run.append_navigation(epochs.recorded)
            run.append_truth("navigation", _block_dataset(epochs.truth, "epoch"))
            samples = accelerometers.record(knots, begin, end)
            run.append_accelerometers(**samples.recorded)
            sensors = _block_dataset(samples.truth, "sample", "sensor").merge(
                _constant_errors(accelerometers)
            )
            run.append_truth("accelerometers", sensors, dim="sample")
            driven = _motion_knots(knots, begin, end, last=end == duration + _RUN_IN)
            run.append_truth("body", driven)
            if drive.standing is None or begin == -_RUN_IN:
                true_surface.append(driven)
            first, last = max(begin, 0.0), min(end, duration)
            if last > first:
                scans = scanner.record(knots, first, last)
                run.append_scans(scans.time, scans.range, scans.intensity)
                run.append_truth("scanner", _scanner_poses(knots, scans, mounting))
                if scene.truth.returns:
                    run.append_truth("returns", _range_errors(scans), dim="scan")
                progress(drive.name, last, duration)
            for part in true_surface.rows(end=end == duration + _RUN_IN):
                run.append_truth("ground", part, dim="u")


def _scene_provenance(stage: Stage, drive: ScenePass, number: int) -> str:
    """Provenance: the scene, the pass, and the measured surfaces."""
    folder = stage.path.parent if stage.path else Path()
    measured = [table["file"] for table in stage.scene.ground if table.get("kind") == MEASURED]
    step = add_step(
        xr.Dataset(),
        "simulate",
        parameters={"scene": stage.scene, "pass": drive.name, "pass_number": number},
        inputs=[folder / file for file in measured],
    )
    return str(step.attrs["provenance"])


def _start_true_surface(
    scene: Scene, mounting: Mounting, motion: Motion, ground: Ground
) -> "_TrueSurface":
    """Surface wider than the swath, with a wider longitudinal spacing for a very long path."""
    half, spacing = 0.5 * scene.scanner.swath + _LATERAL_MARGIN, scene.truth.spacing
    drive = getattr(motion, "drive", None)  # None for a standing vehicle
    length = float(drive.speed.at(motion.duration).distance[0]) if drive else 0.0
    nodes = (length / spacing + 1.0) * (2.0 * half / spacing + 1.0)
    times = math.ceil(nodes / _MAX_TRUTH_NODES)
    return _TrueSurface(ground, mounting, along=times * spacing, across=spacing, half=half)


class _TrueSurface:
    """Surface of the true ground, row by row as the laser drives over it.

    Its reference line is the horizontal path of the laser, with nodes at whole multiples of a
    spacing and straight extensions at both ends. A cross-section is on the bisector of the
    two chords at its node.
    """

    def __init__(
        self, ground: Ground, mounting: Mounting, *, along: float, across: float, half: float
    ) -> None:
        self._ground = ground
        self._lever = mounting.scanner_position[:2]
        self._spacing = along
        columns = math.ceil(half / across)
        self._v = across * np.arange(-columns, columns + 1, dtype=float)
        self._next = 0  # number of the next node
        self._last = np.empty(
            (0, 4)
        )  # station, easting, northing and yaw of the last point of the path
        self._nodes = np.empty(
            (0, 4)
        )  # the same of the nodes of pending rows, and of the node before
        self._started = False

    def append(self, knots: xr.Dataset) -> None:
        """Extend the path along knots of the body."""
        yaw = knots["yaw"].values
        x, y = self._lever
        east = knots["east"].values + x * np.cos(yaw) - y * np.sin(yaw)
        north = knots["north"].values + x * np.sin(yaw) + y * np.cos(yaw)
        laser = np.stack([np.zeros(yaw.size), east, north, yaw], axis=1)
        line = np.concatenate([self._last if len(self._last) else laser[:1], laser])
        # a running sum, so that stations are independent of the ends of blocks
        steps = np.hypot(*np.diff(line[:, 1:3], axis=0).T)
        line[:, 0] = np.cumsum(np.append(line[:1, 0], steps))
        numbers = np.arange(self._next, math.floor(line[-1, 0] / self._spacing) + 1)
        at = numbers * self._spacing
        new = np.stack([at, *(np.interp(at, line[:, 0], column) for column in line.T[1:])], axis=1)
        self._nodes = np.concatenate([self._nodes, new])
        self._next += numbers.size
        self._last = line[-1:]

    def rows(self, *, end: bool) -> Iterator[xr.Dataset]:
        """Rows that are complete; at the end all remaining ones."""
        if len(self._nodes) < _ROWS and not end:
            return
        nodes = self._nodes
        before = np.empty((0, 4)) if self._started else self._extrapolate(self._nodes[:2], -1)
        after = self._extrapolate(self._nodes[-2:], 1) if end else np.empty((0, 4))
        nodes = np.concatenate([before, nodes, after])
        row = np.arange(1 if self._started else 0, len(nodes) - (0 if end else 1))
        chords = np.diff(nodes[:, 1:3], axis=0)
        heading = np.arctan2(chords[:, 1], chords[:, 0])
        left = np.stack([-np.sin(heading), np.cos(heading)], axis=1)
        previous, following = np.maximum(row - 1, 0), np.minimum(row, len(chords) - 1)
        normal = left[previous] + left[following]
        # bisector of two chords, scaled to the same offset from both
        normal /= 1.0 + np.sum(left[previous] * left[following], axis=1)[:, None]
        u, east, north, yaw = nodes[row].T
        heading = heading[previous] + 2 * np.pi * np.rint((yaw - heading[previous]) / (2 * np.pi))
        self._nodes, self._started = nodes[row[-1] :], True
        for part in np.array_split(np.arange(row.size), math.ceil(row.size / _ROWS)):
            x = east[part, None] + self._v * normal[part, :1]
            y = north[part, None] + self._v * normal[part, 1:]
            yield make_surface(
                self._ground.height(x, y),
                u=u[part],
                v=self._v,
                easting=east[part],
                northing=north[part],
                heading=heading[part],
            )

    def _extrapolate(self, nodes: Float, side: int) -> Float:
        """Straight extension before the first (side -1) or after the last (1) of two nodes."""
        end = nodes[0 if side < 0 else -1]
        tangent = np.array([np.cos(end[3]), np.sin(end[3])])
        if len(nodes) > 1:
            tangent = (nodes[1, 1:3] - nodes[0, 1:3]) / np.hypot(*(nodes[1, 1:3] - nodes[0, 1:3]))
        line = side * self._spacing * np.arange(1, math.ceil(_END_MARGIN / self._spacing) + 1)
        return np.asarray(end + line[:, None] * np.array([1.0, *tangent, 0.0]))[::side]


def _block_dataset(block: Mapping[str, npt.ArrayLike], *dims: str) -> xr.Dataset:
    return xr.Dataset(
        {name: (dims[: np.ndim(values)], np.asarray(values)) for name, values in block.items()}
    )


def _motion_knots(knots: PoseKnots, begin: float, end: float, *, last: bool) -> xr.Dataset:
    """Knots of the exact motion in [begin, end), and one more after the last block."""
    step = knots.time[1] - knots.time[0]
    inside = (knots.time >= begin - 1e-9) & (knots.time < end + (step if last else 0.0) - 1e-9)
    columns: dict[str, Float] = {"time": knots.time[inside]}
    for number, name in enumerate(COMPONENTS):
        columns[name] = knots.pose[inside, number]
        columns[f"{name}_rate"] = knots.rate[inside, number]
        columns[f"{name}_acceleration"] = knots.acceleration[inside, number]
    return _block_dataset(columns, "knot")


def _constant_errors(accelerometers: AccelerometerStream) -> xr.Dataset:
    """Scale errors, and the unit vector of each sensitive axis in the body."""
    scale, axis = accelerometers.scale, accelerometers.axes
    return xr.Dataset({"scale_error": ("sensor", scale), "axis": (("sensor", "component"), axis)})


def _scanner_poses(knots: PoseKnots, scans: SimulatedScans, mounting: Mounting) -> xr.Dataset:
    """Exact pose of the scanner at the first beam of every scan, and the true mounting."""
    time = scans.time + mounting.scanner_clock
    pose, _, _ = knots.at(time)
    body = body_to_ground(pose[:, 3:])
    at = pose[:, :3] + body @ np.array(mounting.scanner_position)
    rotation = body @ body_to_ground(mounting.scanner_rotation)
    angles = (
        np.arctan2(rotation[:, 2, 1], rotation[:, 2, 2]),
        -np.arcsin(np.clip(rotation[:, 2, 0], -1, 1)),
        np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0]),
    )
    columns = dict(zip(COMPONENTS, [*at.T, *angles], strict=True))
    poses = _block_dataset({"time": time, **columns}, "scan")
    return poses.assign_attrs(mounting=mounting.to_attrs())


def _range_errors(scans: SimulatedScans) -> xr.Dataset:
    """Error of every range: recorded less exact."""
    error = (scans.range - scans.true_range) / _MICROMETRE
    steps = np.where(np.isnan(error), _LOST, np.rint(error)).astype(np.int32)
    attrs = {"units": "m", "scale_factor": _MICROMETRE, "_FillValue": int(_LOST)}
    return xr.Dataset({"range_error": (("scan", "beam"), steps, attrs)})
