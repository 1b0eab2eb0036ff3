"""The virtual scanner: beams per second on Belgian block, and peak memory over ten minutes."""

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from trueterrain.formats.run import Mounting
from trueterrain.simulate.body import Follower, PassPlan
from trueterrain.simulate.course import Straight
from trueterrain.simulate.ground import BelgianBlock
from trueterrain.simulate.raster import Raster
from trueterrain.simulate.scanner import Scanner, ScannerStream
from trueterrain.simulate.speed import Constant

MINUTES = 10  # of the run whose memory is measured
EARLY = 5  # [min] the cache of the ground is full by then: memory must not grow after it
_BLOCK = 0.25  # [s]


def bench() -> list[dict[str, Any]]:
    """Table rows: name, ours, peer, unit, ratio and budget."""
    return [
        measure_beam_rate("spot averaging off", Scanner(spot_rays=1), 5.0),
        measure_beam_rate("spot averaging on (5 rays)", Scanner(spot_rays=5), 1.0),
        measure_memory(),
    ]


def measure_beam_rate(name: str, scanner: Scanner, budget: float) -> dict[str, Any]:
    """Recorded beams per second, noise included, over ground that is already computed."""
    ground = Raster(BelgianBlock(seed=1))
    drive = PassPlan(course=Straight(length=10.0), speed=Constant(speed=5.0))
    best = 0.0
    for _ in range(3):  # the first drive computes the ground and compiles the kernels
        stream = ScannerStream(scanner, Mounting(), ground, seed=1)
        begin, count = time.perf_counter(), 0
        for early, late, knots in Follower(drive=drive, up=2.0).blocks(block=_BLOCK):
            count += stream.record(knots, early, late).range.size
        best = max(best, count / (time.perf_counter() - begin) / 1e6)
    return {
        "name": f"virtual scanner on Belgian block, {name}",
        "ours": best,
        "peer": None,
        "peer_name": None,
        "unit": "M beams/s",
        "ratio": None,
        "budget": f">= {budget:g} M beams/s",
        "met": best >= budget,
    }


def measure_memory() -> dict[str, Any]:
    """Peak memory of recording a long run, in a separate process."""
    finished = subprocess.run(
        [sys.executable, __file__, "record"], check=True, capture_output=True, text=True
    )
    early, peak, seconds, scans = (float(word) for word in finished.stdout.split())
    return {
        "name": f"recording {MINUTES} min ({scans:,.0f} scans) in {seconds:.0f} s, peak memory "
        f"({early:.2f} GB after {EARLY} min)",
        "ours": peak,
        "peer": None,
        "peer_name": None,
        "unit": "GB",
        "ratio": None,
        "budget": "< 1 GB",
        "met": peak < 1,
    }


def _peak_memory() -> float:
    """Peak memory of this process so far [GB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6


def _record_run() -> None:
    """Record a run with all instruments; print early and peak memory, time and scans."""
    from trueterrain.formats.run import open_run
    from trueterrain.simulate.scene import Scene, ScenePass, record_scene

    speed = 1.0  # [m/s] slow: beams take most of the time, stones little
    drive = ScenePass(
        name="run", length=60.0 * MINUTES * speed, speed={"kind": "constant", "speed": speed}
    )
    scene = Scene(
        name="long",
        ground=({"kind": "belgian-block"},),
        course={"kind": "oval", "straight": 200.0, "radius": 40.0, "transition": 30.0},
        passes=(drive,),
        scanner=Scanner(spot_rays=1),  # rays of a spot take time but no memory
        raster=0.01,
    )
    early = [0.0]

    def watch(_name: str, done: float, _total: float | None) -> None:
        if done <= 60.0 * EARLY:
            early[0] = _peak_memory()

    with tempfile.TemporaryDirectory() as folder:
        begin = time.perf_counter()
        (path,) = record_scene(scene, Path(folder), progress=watch)
        seconds = time.perf_counter() - begin
        scans = open_run(path)["scans"].sizes["scan"]
    print(early[0], _peak_memory(), seconds, scans)


if __name__ == "__main__":
    _record_run()
