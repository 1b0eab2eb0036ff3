"""Results remember where they come from."""

import hashlib
import json

import xarray as xr

from trueterrain import __version__, provenance
from trueterrain.profile import Disc


def test_steps_add_up_in_order():
    first = provenance.add_step(xr.Dataset(), "read")
    second = provenance.add_step(xr.Dataset(), "smooth", after=first)
    assert [step["step"] for step in provenance.steps(second)] == ["read", "smooth"]
    assert provenance.steps(second)[1]["version"] == __version__


def test_parameters_keep_their_names_and_values():
    data = provenance.add_step(xr.Dataset(), "profile", parameters={"area": Disc(radius=0.05)})
    assert provenance.steps(data)[0]["parameters"] == {"area": {"kind": "Disc", "radius": 0.05}}


def test_inputs_are_recorded_by_name_and_hash(tmp_path):
    (tmp_path / "a.crg").write_bytes(b"ground")
    data = provenance.add_step(xr.Dataset(), "read", inputs=[tmp_path / "a.crg"])
    expected = {"name": "a.crg", "sha256": hashlib.sha256(b"ground").hexdigest()}
    assert provenance.steps(data)[0]["inputs"] == [expected]


def test_the_dataset_given_is_not_changed():
    data = xr.Dataset()
    provenance.add_step(data, "read")
    assert data.attrs == {}


def test_the_record_is_plain_json():
    data = provenance.add_step(xr.Dataset(), "x", parameters={"n": 3, "list": [1, None]})
    assert json.loads(data.attrs["provenance"])[0]["parameters"] == {"n": 3, "list": [1, None]}
