"""Ground read from a measured surface."""

from pathlib import Path

import numpy as np
import numpy.testing as npt
import pytest

from trueterrain.core import provenance
from trueterrain.core.errors import SchemaError
from trueterrain.core.schemas import make_points, make_surface
from trueterrain.simulate.ground import Measured, Plane, sample_road, sample_surface

ROUND_OFF = 1e-9  # [m] of coordinates of 200 m on slopes of 1 m/m, and then some


def test_a_ground_read_from_opencrg_has_the_recorded_heights(data: Path):
    """Truth: points evaluated by the OpenCRG C library."""
    ground = Measured.from_file(data / "opencrg" / "asam" / "belgian_block.crg")
    table = np.genfromtxt(
        data / "opencrg" / "reference" / "belgian_block_capi201_nomods.csv",
        delimiter=",",
        names=True,
        skip_header=1,
    )
    # Beyond the grid the library goes on with the last height, which is no measured ground.
    inside = (table["u"] >= 730) & (table["u"] <= 740) & (np.abs(table["v"]) <= 1.7)
    height = ground.height(table["x"][inside], table["y"][inside])
    npt.assert_allclose(
        height, table["z"][inside], rtol=0, atol=ROUND_OFF
    )  # NaN in the same places


def test_a_road_sampled_from_a_measured_ground_is_that_ground():
    slope = Plane(elevation=1.0, slope=0.02, camber=-0.01)
    ground = Measured(
        surface=sample_road(slope, length=5.0, width=2.0, spacing_u=0.5, spacing_v=0.5)
    )
    x, y = np.random.default_rng(1).uniform(0.0, 0.9, (2, 100))
    npt.assert_allclose(ground.height(x, y), slope.height(x, y), rtol=0, atol=1e-12)  # round-off
    assert np.isnan(ground.height(100.0, 0.0))
    assert np.isnan((ground + slope).height(100.0, 0.0))


def test_provenance_includes_the_steps_of_a_measured_ground():
    flat = make_surface(np.zeros((2, 2)), easting=[0, 1], northing=[0, 1])
    ground = Measured(surface=provenance.add_step(flat, "read"))
    sampled = sample_surface(ground + Plane(), easting=[0.0, 0.5], northing=[0.0, 0.5])
    described = provenance.provenance_steps(sampled)[-1]["parameters"]["ground"]
    assert described["kind"] == "Sum"
    assert [part["kind"] for part in described["parts"]] == ["Measured", "Plane"]
    assert described["parts"][0]["steps"][0]["step"] == "read"


def test_points_are_no_ground():
    with pytest.raises(SchemaError):
        Measured(surface=make_points([0.0], [0.0], [0.0]))
