"""Two passes of the pages on merging, recorded once."""

import tempfile
from dataclasses import replace
from functools import cache
from pathlib import Path

from trueterrain.formats.run import open_run
from trueterrain.motion import fuse_motion
from trueterrain.simulate.scene import read_scene, record_scene
from trueterrain.surface.runs import PassRecord


@cache
def two_lanes() -> dict[str, PassRecord]:
    """Passes over 20 m of the scene belgian-two-lanes, with fewer beams and scans."""
    scene, _ = read_scene("belgian-two-lanes")
    short = replace(
        scene,
        course={"kind": "straight", "length": 20.0},
        raster=0.01,
        scanner=replace(scene.scanner, beams=235, rate=500.0, spot_rays=1),
        truth=replace(scene.truth, returns=False),
    )
    paths = record_scene(short, Path(tempfile.mkdtemp()))
    return {
        drive.name: PassRecord(run=path, trajectory=fuse_motion(open_run(path)).trajectory)
        for drive, path in zip(short.passes, paths, strict=True)
    }
