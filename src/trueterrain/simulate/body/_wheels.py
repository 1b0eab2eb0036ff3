"""The ground that the wheels feel along a lane."""

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
    """Heights on which the wheels stand when the body is at a distance along the lane.

    They are computed where the distance is a whole multiple of `spacing`, so that they do not
    depend on when the body is there, and joined by straight lines.
    """

    ground: Ground
    "The ground."

    lane: OffsetLine
    "The lane."

    wheels: tuple[tuple[str, float, float], ...]
    "Name of each wheel, and its place in the body: x forward, y left [m]."

    tyre: Tyre
    "The contact patch."

    spacing: float
    "Distance along the lane from height to height [m]."

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
        share = (node - before)[:, None]
        table = self._table(first, last)
        return np.asarray((1.0 - share) * table[before] + share * table[before + 1])

    def _table(self, first: int, last: int) -> Float:
        """Heights where the body is at `first` to `last` times the spacing."""
        margin = contact_margin(self.spacing, self.tyre.patch_length)
        place = self.lane.at(np.arange(first - margin, last + margin + 1) * self.spacing)
        c, s = np.cos(place.heading)[:, None], np.sin(place.heading)[:, None]
        east, north = place.position[:, :1], place.position[:, 1:]
        out = np.empty((last - first + 1, len(self.wheels)))
        for n, (name, x, y) in enumerate(self.wheels):
            v = y + self.tyre.offsets
            px, py = east + x * c - v * s, north + x * s + v * c
            strip = self.ground.height(px, py)
            if not np.isfinite(strip).all():
                i, j = np.argwhere(~np.isfinite(strip))[0]
                raise CoverageError(
                    f"there is no ground under the wheel {name}",
                    place=f"easting {px[i, j]:.3f} m, northing {py[i, j]:.3f} m",
                    cure="Drive where there is ground, begin later or end sooner, or let a "
                    "measured surface be repeated",
                )
            out[:, n] = contact_heights(strip, self.spacing, self.tyre.patch_length)
        return out
