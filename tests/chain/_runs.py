"""Recorded runs, changed as accidents change them."""

import json
import shutil
from pathlib import Path

import zarr


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
        with zarr.config.set({"array.write_empty_chunks": True}):  # as the writer of runs does
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
