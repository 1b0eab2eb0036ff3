"""Results remember where they come from."""

import hashlib
import json

import xarray as xr

from trueterrain import __version__
from trueterrain.core import provenance
from trueterrain.profile import Disc


def test_steps_add_up_in_order():
    first = provenance.add_step(xr.Dataset(), "read")
    second = provenance.add_step(xr.Dataset(), "smooth", after=first)
    assert [step["step"] for step in provenance.provenance_steps(second)] == ["read", "smooth"]
    assert provenance.provenance_steps(second)[1]["version"] == __version__


def test_parameters_keep_their_names_and_values():
    data = provenance.add_step(xr.Dataset(), "profile", parameters={"area": Disc(radius=0.05)})
    assert provenance.provenance_steps(data)[0]["parameters"] == {
        "area": {"kind": "Disc", "radius": 0.05}
    }


def test_inputs_are_recorded_by_name_and_hash(tmp_path):
    (tmp_path / "a.crg").write_bytes(b"ground")
    data = provenance.add_step(xr.Dataset(), "read", inputs=[tmp_path / "a.crg"])
    expected = {"name": "a.crg", "sha256": hashlib.sha256(b"ground").hexdigest()}
    assert provenance.provenance_steps(data)[0]["inputs"] == [expected]


def test_the_dataset_given_is_not_changed():
    data = xr.Dataset()
    provenance.add_step(data, "read")
    assert data.attrs == {}


def test_the_record_is_plain_json():
    data = provenance.add_step(xr.Dataset(), "x", parameters={"n": 3, "list": [1, None]})
    assert json.loads(data.attrs["provenance"])[0]["parameters"] == {"n": 3, "list": [1, None]}


def test_a_store_is_known_by_the_names_and_contents_in_it(tmp_path):
    hashes = []
    for name, files in (
        ("a", {"x": b"1", "sub/y": b"2"}),
        ("same", {"sub/y": b"2", "x": b"1"}),
        ("content", {"x": b"1", "sub/y": b"3"}),
        ("name", {"z": b"1", "sub/y": b"2"}),
        ("moved", {"x": b"12", "sub/y": b""}),
    ):
        for path, content in files.items():
            file = tmp_path / name / path
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(content)
        described = provenance.describe_input(tmp_path / name)
        assert described["name"] == name
        hashes.append(described["sha256"])
    assert hashes[0] == hashes[1]
    assert len(set(hashes)) == 4
