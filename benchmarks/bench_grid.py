"""Gridding: ranges in memory and on disk to cells, beside numpy and scipy; LAZ beside laspy.

The peer georeferences with vectors, by `scipy.spatial.transform`, and takes count, mean and
standard deviation by `scipy.stats.binned_statistic_2d`, in one thread. Both give the same counts.

All times are elapsed times: on a machine that is busy with other things they are too long.
"""

import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import laspy
import numpy as np
from scipy.spatial.transform import Rotation, Slerp
from scipy.stats import binned_statistic_2d

from trueterrain.core.schemas import make_points
from trueterrain.formats import point_blocks
from trueterrain.formats import write as write_file
from trueterrain.formats.run import Mounting, RunWriter
from trueterrain.geometry.reference_line import line_from_trajectory, straight_line
from trueterrain.georeference import ScanGeometry
from trueterrain.motion import Trajectory
from trueterrain.surface.accumulate import CellSums
from trueterrain.surface.cells import Grid, grid_along, grid_over
from trueterrain.surface.grid import GridSettings, grid_points, trim_surface
from trueterrain.surface.holes import fill_holes
from trueterrain.surface.runs import PassRecord, grid_runs

SCANS = 32_000  # 30 million returns
PEER_SCANS = 2_000
LONG = 10  # times as many scans for a long run
BEAMS = 940
RATE = 1000.0  # [Hz]
SPEED = 5.0  # [m/s]
THREADS = 2
POINTS = 3_000_000
STEP = 1e-4  # [m] of the ranges
APART = 1e-3  # of the returns, next to the edge of a cell, may fall to either side
CURVE = 0.002  # [rad/s] by which the body turns
PLAIN = GridSettings(level=False)


def bench() -> list[dict[str, Any]]:
    """Rows of name, ours, peer, unit, ratio and budget.

    Returns
    -------
    list of dict
        What was measured.
    """
    return [*in_memory(), growth(), *on_disk(), long_run(), cloud()]


def in_memory() -> list[dict[str, Any]]:
    """Ranges in memory to cells, and the same by numpy and scipy."""
    trajectory, angle, delay = drive(SCANS / RATE), *fan()
    geometry = ScanGeometry(trajectory, Mounting(), angle, delay)
    grid = road(SCANS)
    stamps, ranges = recorded(SCANS)
    add(grid, geometry, stamps[:3000], ranges[:3000])  # compile
    speed = max(rate(lambda: add(grid, geometry, stamps, ranges), ranges.size) for _ in range(4))

    few = slice(0, PEER_SCANS)
    part = road(PEER_SCANS)
    ours = add(part, geometry, stamps[few], ranges[few]).total().count.reshape(part.shape)
    rows = []
    for each, name, least in ((True, "a pose for each return", 50), (False, "one per scan", None)):
        begin = time.perf_counter()
        count = by_scipy(trajectory, part, stamps[few], ranges[few], angle, delay, each)
        peer = ranges[few].size / (time.perf_counter() - begin) / 1e6
        apart = np.abs(ours - count).sum() / ranges[few].size
        if apart > APART:
            message = f"{apart:.2%} of the peer's returns lie in other cells"
            raise AssertionError(message)
        rows.append(
            {
                "name": f"ranges in memory -> (u,v) cells, {ranges.size / 1e6:.0f} M returns",
                "ours": speed,
                "peer": peer,
                "peer_name": f"numpy + binned_statistic_2d, {name}",
                "unit": "M returns/s",
                "ratio": speed / peer,
                "budget": ">= 120 M returns/s" + (f", ratio >= {least}" if least else ""),
                "met": speed >= 120 and (least is None or speed / peer >= least),
            }
        )
    return rows


def growth() -> dict[str, Any]:
    """Exponent with which the cost grows from 10 M to 300 M returns, over the same ground."""
    angle, delay = fan()
    stamps, ranges = recorded(SCANS)
    geometry = ScanGeometry(drive(SCANS / RATE), Mounting(), angle, delay)
    grid = road(SCANS)
    sums = CellSums(grid, threads=THREADS)
    third = slice(0, SCANS // 3)

    def some(rows: slice) -> None:
        sums.add_scans(geometry, stamps[rows], ranges[rows], scale=STEP, missing=65535)

    some(slice(None))  # compile, and take the memory
    least = float(np.median([elapsed(lambda: some(third)) for _ in range(5)]))
    most = sum(elapsed(lambda: some(slice(None))) for _ in range(10))
    exponent = float(np.log(most / least) / np.log(10 * SCANS / (SCANS // 3)))
    return {
        "name": "exponent of the cost of gridding from 10 M to 300 M returns",
        "ours": exponent,
        "peer": None,
        "peer_name": None,
        "unit": "1",
        "ratio": None,
        "budget": "<= 1.05",
        "met": exponent <= 1.05,
    }


def on_disk() -> list[dict[str, Any]]:
    """A run on disk to a surface and to a CRG file, in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.zarr"
        write_run(path, SCANS)
        finished = subprocess.run(
            [sys.executable, __file__, str(path)], check=True, stdout=subprocess.PIPE, text=True
        )
    surface, whole, gigabytes, nodes = (float(word) for word in finished.stdout.split())
    what = f"{SCANS * BEAMS / 1e6:.0f} M returns, {nodes / 1e6:.1f} M nodes"
    return [
        {
            "name": f"Zarr on disk -> surface with sd, {what}, peak {gigabytes:.2f} GB",
            "ours": surface,
            "peer": None,
            "peer_name": None,
            "unit": "M returns/s",
            "ratio": None,
            "budget": ">= 60 M returns/s, < 2 GB",
            "met": surface >= 60 and gigabytes < 2,
        },
        {
            "name": f"Zarr on disk -> CRG, read back and compared, {what}",
            "ours": whole,
            "peer": None,
            "peer_name": None,
            "unit": "M returns/s",
            "ratio": None,
            "budget": ">= 60 M returns/s",
            "met": whole >= 60,
        },
    ]


def long_run() -> dict[str, Any]:
    """Memory for a long run on disk to a surface without small holes, in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.zarr"
        write_run(path, SCANS, times=LONG)
        finished = subprocess.run(
            [sys.executable, __file__, str(path), str(LONG)],
            check=True,
            stdout=subprocess.PIPE,
            text=True,
        )
    surface, gigabytes, filled, nodes = (float(word) for word in finished.stdout.split())
    return {
        "name": f"Zarr on disk -> surface with sd, {LONG * SCANS * BEAMS / 1e6:.0f} M returns, "
        f"{nodes / 1e6:.0f} M nodes, peak {gigabytes:.2f} GB, {filled:.2f} GB with holes filled",
        "ours": surface,
        "peer": None,
        "peer_name": None,
        "unit": "M returns/s",
        "ratio": None,
        "budget": ">= 60 M returns/s, < 2 GB",
        "met": surface >= 60 and max(gigabytes, filled) < 2,
    }


def cloud() -> dict[str, Any]:
    """LAZ to a map, beside laspy reading the file alone."""
    rng = np.random.default_rng(1)
    x, y = np.sort(rng.uniform(0, 500, POINTS)), rng.uniform(0, 20, POINTS)
    points = make_points(x, y, 0.01 * rng.standard_normal(POINTS))
    grid = grid_over(0, 0, 500, 20, spacing=0.1)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cloud.laz"
        write_file(points, path)

        def work() -> None:
            """Grid a file; read of it what the command `grid` reads."""
            grid_points(point_blocks(path, variables=("sd", "classification")), grid, PLAIN)

        work()
        ours = min(elapsed(work) for _ in range(3))
        peer = min(elapsed(lambda: laspy.read(path)) for _ in range(3))
    return {
        "name": f"LAZ -> map, {POINTS:,} points",
        "ours": ours,
        "peer": peer,
        "peer_name": "laspy.read alone",
        "unit": "s",
        "ratio": ours / peer,
        "budget": "ratio <= 1.3",
        "met": ours / peer <= 1.3,
    }


def drive(duration: float) -> Trajectory:
    """A slight curve with heave, 2 m above the ground."""
    t = np.arange(-0.1, duration + 0.2, 0.005)
    yaw = CURVE * t
    x, y = SPEED / CURVE * np.sin(yaw), SPEED / CURVE * (1 - np.cos(yaw))
    position = np.stack([x, y, 2 + 0.02 * np.sin(9 * t)], axis=1)
    velocity = np.stack([SPEED * np.cos(yaw), SPEED * np.sin(yaw), 0.18 * np.cos(9 * t)], axis=1)
    return Trajectory(
        time=t,
        position=position,
        velocity=velocity,
        quaternion=Rotation.from_euler("Z", yaw[:, None]).as_quat(),
        angular_velocity=np.tile([0, 0, CURVE], (t.size, 1)),
        covariance=np.tile(1e-6 * np.eye(6), (t.size, 1, 1)),
        flag=np.zeros(t.size, np.uint8),
    )


def fan() -> tuple[np.ndarray, np.ndarray]:
    """Angles and delays of the beams."""
    return np.linspace(-0.78, 0.78, BEAMS), np.arange(BEAMS) * 0.8e-3 / BEAMS


def recorded(scans: int) -> tuple[np.ndarray, np.ndarray]:
    """Stamps, and ranges to level ground with noise, as they are stored."""
    angle, _ = fan()
    stamps = np.arange(scans) / RATE
    up = 2 + 0.02 * np.sin(9 * stamps)
    noise = np.random.default_rng(1).normal(0, 0.0005, (scans, BEAMS)).astype(np.float32)
    steps = np.rint((up[:, None] / np.cos(angle) + noise) / STEP)
    return stamps, steps.astype(np.uint16)


def road(scans: int) -> Grid:
    """Grid along the whole run, 4 m wide at 10 mm; a straight line, which the run leaves."""
    length = max(SPEED * scans / RATE, 1.0)
    return grid_along(straight_line((0.0, 0.0), (length, 0.0)), right=-2.0, left=2.0 + 6.0)


def add(grid: Grid, geometry: ScanGeometry, stamps: np.ndarray, ranges: np.ndarray) -> CellSums:
    """Sums by trueterrain."""
    sums = CellSums(grid, threads=THREADS)
    sums.add_scans(geometry, stamps, ranges, scale=STEP, missing=65535)
    sums.total()
    return sums


def by_scipy(
    trajectory: Trajectory,
    grid: Grid,
    stamps: np.ndarray,
    ranges: np.ndarray,
    angle: np.ndarray,
    delay: np.ndarray,
    each: bool,
) -> np.ndarray:
    """Count, mean and standard deviation as one would write them with numpy and scipy.

    With a pose for `each` return, as accuracy asks for, or one attitude for a scan.
    """
    metres = ranges * STEP
    beams = np.stack([np.zeros(angle.size), np.sin(angle), -np.cos(angle)], axis=1)
    slerp = Slerp(trajectory.time, Rotation.from_quat(trajectory.quaternion))
    times = (stamps[:, None] + delay).ravel()
    if each:
        arms = metres.reshape(-1, 1) * np.tile(beams, (stamps.size, 1))
        turned = slerp(times).apply(arms)
    else:
        matrices = slerp(stamps + 0.5 * delay[-1]).as_matrix()
        turned = np.einsum("sij,bj->sbi", matrices, beams) * metres[:, :, None]
        turned = turned.reshape(-1, 3)
    x, y, z = (
        turned[:, axis] + np.interp(times, trajectory.time, trajectory.position[:, axis])
        for axis in range(3)
    )
    edges = [
        np.append(axis - 0.5 * step, axis[-1] + 0.5 * step)
        for axis, step in zip((grid.u, grid.v), grid.spacing, strict=True)
    ]
    found = [
        binned_statistic_2d(x, y, z, statistic, bins=edges)[0]
        for statistic in ("count", "mean", "std")
    ]
    assert np.isfinite(found[1][found[0] > 0]).all()
    return found[0]


def rate(work: Callable[[], Any], size: int) -> float:
    """M returns per second."""
    return size / elapsed(work) / 1e6


def elapsed(work: Callable[[], Any]) -> float:
    """Elapsed time [s]."""
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


def write_run(path: Path, scans: int, times: int = 1) -> None:
    """A run of plain scans, which are repeated so many times."""
    angle, delay = fan()
    with RunWriter(
        path,
        name="bench",
        origin=(11.0, 48.0, 500.0),
        time_reference="run",
        mounting=Mounting(),
        angle=angle,
        delay=delay,
        max_range=6.0,
    ) as run:
        t = np.arange(-0.1, times * scans / RATE + 0.2, 0.01)
        still = dict.fromkeys(("north", "up", "roll", "pitch", "yaw"), np.zeros(t.size))
        run.append_navigation({"time": t, "east": SPEED * t, **still})
        stamps, steps = recorded(scans)
        for again in range(times):
            for start in range(0, scans, 4000):
                rows = slice(start, start + 4000)
                run.append_scans(stamps[rows] + again * scans / RATE, steps[rows] * STEP)


def _from_disk(path: Path, times: int) -> tuple[Callable[[], Any], list[Any]]:
    """What grids a run, and a list into which it puts the surface; all is compiled."""
    duration = times * SCANS / RATE
    trajectory = drive(duration)
    one = PassRecord(run=path, trajectory=trajectory)
    warm, _ = grid_runs([one], grid_along(straight_line((0, 0), (9, 0))), threads=THREADS)
    write_file(warm, path.with_suffix(".crg"))
    line = line_from_trajectory(trajectory, begin=0.0, end=duration - 0.01)
    grid = grid_along(line, right=-1.9, left=1.9)
    results: list[Any] = []

    def work() -> None:
        results.clear()
        results.append(grid_runs([one], grid, threads=THREADS)[0])

    return work, results


def _to_crg(path: Path) -> None:
    """Print M returns/s from the run to a surface and to a CRG file, and peak memory [GB]."""
    work, results = _from_disk(path, 1)
    surface = max(rate(work, SCANS * BEAMS) for _ in range(3))
    peak = _peak()
    file = path.with_suffix(".crg")
    write = min(elapsed(lambda: write_file(results[0], file, force=True)) for _ in range(3))
    whole = 1 / (1 / surface + 1 / (SCANS * BEAMS / 1e6 / write))
    print(surface, whole, peak, results[0].height.size)


def _to_surface(path: Path, times: int) -> None:
    """Print M returns/s from the run to a surface, and peak memory, with filled holes too [GB]."""
    work, results = _from_disk(path, times)
    surface = max(rate(work, times * SCANS * BEAMS) for _ in range(2))
    peak = _peak()
    filled, _ = fill_holes(trim_surface(results[0]), in_place=True)
    print(surface, peak, _peak(), filled.height.size)


def _peak() -> float:
    """Most memory that this process had so far [GB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9


if __name__ == "__main__":
    if len(sys.argv) > 2:
        _to_surface(Path(sys.argv[1]), int(sys.argv[2]))
    elif len(sys.argv) > 1:
        _to_crg(Path(sys.argv[1]))
    else:
        for line in bench():
            print({key: line[key] for key in ("name", "ours", "peer", "ratio", "budget", "met")})
