"""Input of the wheels of a vehicle along its path."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trueterrain.core.errors import CoverageError
from trueterrain.simulate.course import OffsetLine
from trueterrain.simulate.ground import Ground
from trueterrain.vehicle import Tyre, contact_heights, contact_margin

Float = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class WheelPaths:
    """Mean heights under the wheels as functions of the distance of the body along its line.

    They are computed at whole multiples of `spacing`, so that they are independent of the speed,
    and interpolated linearly.
    """

    ground: Ground
    "The ground."

    line: OffsetLine
    "Line that the origin of the body follows."

    wheels: tuple[tuple[str, float, float], ...]
    "Name of each wheel, and its position in the body: x forward, y left [m]."

    tyre: Tyre
    "The contact patch."

    spacing: float
    "Sampling distance along the line [m]."

    def heights(self, distance: Float) -> Float:
        """Height of each wheel, shape (n, wheels) [m].

        Raises
        ------
        CoverageError
            If there is no ground under a wheel.
        """
        first = int(np.floor(distance.min() / self.spacing))
        last = int(np.floor(distance.max() / self.spacing)) + 1
        node = distance / self.spacing - first
        before = np.minimum(node.astype(np.int64), last - first - 1)
        fraction = (node - before)[:, None]
        table = self._table(first, last)
        return np.asarray((1.0 - fraction) * table[before] + fraction * table[before + 1])

    def _table(self, first: int, last: int) -> Float:
        """Heights for the body at `first` to `last` times the spacing."""
        margin = contact_margin(self.spacing, self.tyre.patch_length)
        placement = self.line.at(np.arange(first - margin, last + margin + 1) * self.spacing)
        c, s = np.cos(placement.heading)[:, None], np.sin(placement.heading)[:, None]
        east, north = placement.position[:, :1], placement.position[:, 1:]
        out = np.empty((last - first + 1, len(self.wheels)))
        for n, (name, x, y) in enumerate(self.wheels):
            v = y + self.tyre.offsets
            px, py = east + x * c - v * s, north + x * s + v * c
            heights = self.ground.height(px, py)
            if not np.isfinite(heights).all():
                i, j = np.argwhere(~np.isfinite(heights))[0]
                raise CoverageError(
                    f"there is no ground under the wheel {name}",
                    place=f"easting {px[i, j]:.3f} m, northing {py[i, j]:.3f} m",
                    cure="Drive where there is ground, start later or end earlier, or repeat the "
                    "measured surface",
                )
            out[:, n] = contact_heights(heights, self.spacing, self.tyre.patch_length)
        return out
