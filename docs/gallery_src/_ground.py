"""Road of the gallery: the measured Belgian block, or a simulated one."""

import os
from pathlib import Path

import xarray as xr

import trueterrain as tt

_NAMED = os.environ.get("TRUETERRAIN_DATA")
_DATA = Path(_NAMED) if _NAMED else Path(__file__).resolve().parents[3] / "shared" / "data"
_FILE = _DATA / "opencrg" / "asam" / "belgian_block.crg"


def belgian_block() -> tuple[xr.Dataset, str]:
    """Surface of a Belgian block road, 10 m by 3.4 m on a grid of 10 mm, and its name."""
    if _FILE.is_file():
        return tt.open(_FILE), "Belgian block, measured (ASAM OpenCRG sample belgian_block.crg)"
    road = tt.sample_road(tt.ground.BelgianBlock(seed=2009), length=10.0, width=3.4)
    return road, "Belgian block, simulated (BelgianBlock(seed=2009))"
