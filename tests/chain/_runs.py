"""Recorded runs, changed as accidents change them, and their exact motion."""

import json
import shutil
from pathlib import Path

import numpy as np
import zarr
from scipy.spatial.transform import Rotation

from trueterrain.formats.run import open_run
from trueterrain.motion import Trajectory


def exact(run):
    """Trajectory through the knots of the true motion of the body, 0.5 ms apart."""
    body = open_run(run)["truth/body"].to_dataset().load()
    position, velocity = (
        np.stack([body[f"{name}{what}"].values for name in ("east", "north", "up")], axis=1)
        for what in ("", "_rate")
    )
    roll, pitch, yaw = (body[name].values for name in ("roll", "pitch", "yaw"))
    r, p, y = (body[f"{name}_rate"].values for name in ("roll", "pitch", "yaw"))
    turning = [
        r - y * np.sin(pitch),
        p * np.cos(roll) + y * np.sin(roll) * np.cos(pitch),
        -p * np.sin(roll) + y * np.cos(roll) * np.cos(pitch),
    ]
    n = body.sizes["knot"]
    return Trajectory(
        time=body["time"].values, position=position, velocity=velocity,
        quaternion=Rotation.from_euler("ZYX", np.stack([yaw, pitch, roll], axis=1)).as_quat(),
        angular_velocity=np.stack(turning, axis=1), covariance=np.zeros((n, 6, 6)),
        flag=np.zeros(n, np.uint8),
    )  # fmt: skip


class Damaged:
    """A copy of a run in a folder, and what happens to it."""

    def __init__(self, run: Path, folder: Path) -> None:
        self.path = folder / run.name
        shutil.copytree(run, self.path)

    def values(self, name):
        """Values of an array as they are stored."""
        return zarr.open_array(self.path / name, mode="r")[...]

    def replace(self, name, values):
        """Other values of an array."""
        zarr.open_array(self.path / name, mode="r+")[...] = values
        return self

    def keep(self, group, rows):
        """Only some rows of a group, such as some epochs."""
        for _, array in zarr.open_group(self.path / group, mode="r+").arrays():
            if array.shape[0] == rows.size:
                kept = array[...][rows]
                array.resize(kept.shape)
                array[...] = kept
        return self

    def lose(self, group):
        """Without a group."""
        shutil.rmtree(self.path / group)
        return self

    def attribute(self, name, value):
        """Another attribute of the run."""
        document = json.loads((self.path / "zarr.json").read_text())
        document["attributes"][name] = value
        (self.path / "zarr.json").write_text(json.dumps(document))
        return self
