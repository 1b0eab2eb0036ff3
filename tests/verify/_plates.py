"""Plates and scans that the tests of accuracy know all about."""

import numpy as np
import xarray as xr

from trueterrain.core.schemas import make_profile
from trueterrain.formats.run import Mounting

HEIGHT = 2.0  # [m] of the scanner above the ground
LENGTH = 1.2  # [m] of the plate

#: Corners of the machined profile [m]: a rectangle, a triangle, and a thick plate.
CORNERS = np.array(
    [
        [0.0, 0.2, 0.200001, 0.28, 0.280001, 0.6, 0.65, 0.7, LENGTH],
        [0.02, 0.02, 0.06, 0.06, 0.02, 0.02, 0.06, 0.02, 0.02],
    ]
)


def machined(scale: float = 1.0) -> xr.Dataset:
    """Machined profile; its heights times a scale."""
    return make_profile(CORNERS[0], scale * CORNERS[1])


def height_at(s):
    """True height over the ground, 0 beside the plate."""
    inside = (s >= 0) & (s <= LENGTH)
    return np.where(inside, np.interp(s, *CORNERS), 0.0)


def standing(
    *, scans=200, beams=701, shift=-0.55, tilt=0.004, noise=0.0004, seed=1, bright=None, plate=True
):
    """Run of a standing scanner over the plate, beams cast straight onto its heights."""
    angle = np.linspace(-0.6, 0.6, beams)

    def above(up):
        """Height of a point of each beam over the ground."""
        left = (HEIGHT - up) * np.tan(angle)
        return up - tilt * left - (height_at(left - shift) if plate else 0.0)

    # the first point of a beam that is not above the ground, then between it and the one before
    levels = np.arange(0.08, -0.03, -2.5e-4)
    first = np.argmax([above(np.full(beams, up)) <= 0 for up in levels], axis=0)
    low, high = levels[first], levels[first - 1]
    for _ in range(40):
        middle = 0.5 * (low + high)
        hit = above(middle) <= 0
        low, high = np.where(hit, middle, low), np.where(hit, high, middle)
    up = low
    left = (HEIGHT - up) * np.tan(angle)
    ranges = np.hypot(left, HEIGHT - up)
    rng = np.random.default_rng(seed)
    measured = ranges + noise * rng.normal(size=(scans, beams))
    intensity = np.full((scans, beams), 5000.0)
    if bright is not None:
        low, high, error = bright
        there = (left - shift >= low) & (left - shift <= high)
        measured[:, there] -= error
        intensity[:, there] = 20000.0
    blocks = xr.Dataset(
        {
            "time": ("scan", 0.001 * np.arange(scans), {"units": "s"}),
            "range": (("scan", "beam"), measured, {"units": "m"}),
            "intensity": (("scan", "beam"), intensity),
            "angle": ("beam", angle, {"units": "rad"}),
            "delay": ("beam", np.zeros(beams), {"units": "s"}),
        }
    )
    tree = xr.DataTree.from_dict({"/scans": blocks})
    tree.attrs["mounting"] = Mounting().to_attrs()
    return tree
