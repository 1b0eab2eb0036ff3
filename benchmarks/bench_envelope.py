"""Tyre envelopes along 1 km of rough road at 10 mm; the peer of the disc is grey dilation."""

from typing import Any

import numpy as np
import xarray as xr
from scipy.ndimage import grey_dilation, map_coordinates

from bench_profile import timed
from trueterrain.core.schemas import make_profile, make_surface
from trueterrain.profile import (
    Envelope,
    LineLaser,
    PatchMean,
    PlaneCurve,
    RadialSpringTyre,
    RigidDisc,
    TandemCams,
    offset_path,
    tyre_envelope,
)

NODES = 100_001  # along, 10 mm apart
OFFSET = 0.203  # [m]

#: [us] per path point, on 2 cores: a tenth of what a core would take at 100 km/h in real time
#: would be 36 us; springs, which seek the balance of their load, may take twice that.
BUDGETS: list[tuple[str, Envelope, float]] = [
    ("rigid disc", RigidDisc(), 36.0),
    ("tandem cams", TandemCams(), 36.0),
    ("radial springs", RadialSpringTyre(), 72.0),
    ("line laser", LineLaser(), 36.0),
    ("patch mean", PatchMean(), 36.0),
]

#: [m] a disc that touches samples only misses ground that is as steep as itself between them
SAMPLES_ONLY = 0.01**2 / (8 * RigidDisc().radius) * 4


def bench() -> list[dict[str, Any]]:
    """Rows of name, ours, peer, unit, ratio and budget.

    Returns
    -------
    list of dict
        What was measured.
    """
    rng = np.random.default_rng(2009)
    u, v = np.arange(NODES) * 0.01, np.arange(-60, 61) * 0.01
    height = rng.normal(0, 0.003, (u.size, v.size))
    surface = make_surface(height, u=u, v=v, easting=u, northing=np.zeros_like(u))
    path = offset_path(surface, OFFSET)
    return [on_a_line(path, height[:, 60]), *(cost(surface, path, *row) for row in BUDGETS)]


def on_a_line(path: PlaneCurve, height: np.ndarray) -> dict[str, Any]:
    """Microseconds per sample of a disc along a profile."""
    profile, disc = make_profile(path.s, height), RigidDisc()
    tyre_envelope(profile.isel(s=slice(0, 1000)), tyre=disc)  # compile
    envelope, seconds = timed(lambda: tyre_envelope(profile, tyre=disc))
    ours = 1e6 * seconds / len(path)
    dilated, seconds = timed(lambda: grey_dilation(height, structure=outline(disc)))
    compare(envelope.height.values, dilated)
    peer = 1e6 * seconds / len(path)
    return {
        "name": f"rigid disc along a profile, {len(path):,} samples every 10 mm",
        "ours": ours,
        "peer": peer,
        "peer_name": "scipy grey_dilation, samples only",
        "unit": "us per sample",
        "ratio": peer / ours,
        "budget": "<= 5 us",
        "met": ours <= 5,
    }


def cost(
    surface: xr.Dataset, path: PlaneCurve, name: str, tyre: Envelope, budget: float
) -> dict[str, Any]:
    """Microseconds per path point of one envelope."""
    tyre_envelope(surface, path.part(0, 1000), tyre=tyre)  # compile
    envelope, seconds = timed(lambda: tyre_envelope(surface, path, tyre=tyre))
    ours, peer = 1e6 * seconds / len(path), None
    if isinstance(tyre, RigidDisc):
        dilated, seconds = timed(lambda: dilation(surface, tyre))
        peer = 1e6 * seconds / len(path)
        compare(envelope.height.values, dilated)
    return {
        "name": f"{name}, {len(path):,} path points on a 10 mm grid",
        "ours": ours,
        "peer": peer,
        "peer_name": None
        if peer is None
        else "scipy map_coordinates + grey_dilation, samples only",
        "unit": "us per path point",
        "ratio": None if peer is None else peer / ours,
        "budget": f"<= {budget:g} us",
        "met": ours <= budget,
    }


def dilation(surface: xr.Dataset, disc: RigidDisc) -> np.ndarray:
    """Envelope of a disc as one would write it with scipy and numpy."""
    across = (OFFSET + disc.offsets - float(surface.v[0])) / 0.01
    along = np.arange(surface.sizes["u"], dtype=float)
    places = np.meshgrid(along, across, indexing="ij")
    strip = map_coordinates(surface.height.values, places, order=1)
    return np.asarray(grey_dilation(strip.max(axis=1), structure=outline(disc)))


def outline(disc: RigidDisc) -> np.ndarray:
    """Lower half of a disc every 10 mm, upside down."""
    x = np.arange(-int(disc.radius / 0.01), int(disc.radius / 0.01) + 1) * 0.01
    return np.asarray(np.sqrt(disc.radius**2 - x**2) - disc.radius)


def compare(exact: np.ndarray, dilated: np.ndarray) -> None:
    """Fail unless both are the same but for what lies between samples."""
    difference = (exact - dilated)[100:-100]  # at the ends the ground is held or mirrored
    assert difference.min() > -1e-9  # what is exact between samples is never lower
    assert difference.max() < SAMPLES_ONLY
