"""Provenance of a result: version, steps, parameters and the hashes of the inputs.

The record is JSON text in ``attrs["provenance"]``, so that every store keeps it.
"""

import dataclasses
import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import xarray as xr

from trueterrain._version import __version__

_HASH_BLOCK = 1 << 20  # [bytes] read at a time, so that a survey is never held in memory


def describe_input(path: str | Path) -> dict[str, str]:
    """Name and SHA-256 of a file, or of a Zarr store.

    Parameters
    ----------
    path : str or Path
        The file; of a folder, the names and contents of all files in it are hashed in order.

    Returns
    -------
    dict
        ``{"name": ..., "sha256": ...}``; the folder is left out, since it means nothing elsewhere.
    """
    path = Path(path)
    digest = hashlib.sha256()
    if path.is_dir():
        inside = {file.relative_to(path).as_posix(): file for file in path.rglob("*")}
        files = [(name, file) for name, file in sorted(inside.items()) if file.is_file()]
    else:
        files = [("", path)]
    for name, file in files:
        if name:
            digest.update(f"{name}\0{file.stat().st_size}\0".encode())
        with file.open("rb") as stream:
            while block := stream.read(_HASH_BLOCK):
                digest.update(block)
    return {"name": path.name, "sha256": digest.hexdigest()}


def provenance_steps(data: xr.Dataset) -> list[dict[str, Any]]:
    """Steps that led to a dataset, oldest first.

    Parameters
    ----------
    data : xarray.Dataset
        Any dataset of this package.

    Returns
    -------
    list of dict
        One entry per step: ``step``, ``version``, ``parameters``, ``inputs``.
    """
    return list(json.loads(data.attrs.get("provenance", "[]")))


def add_step(
    data: xr.Dataset,
    step: str,
    *,
    parameters: Mapping[str, Any] | None = None,
    inputs: Sequence[str | Path] = (),
    after: xr.Dataset | None = None,
) -> xr.Dataset:
    """Return the dataset with one more step in its provenance.

    Parameters
    ----------
    data : xarray.Dataset
        The result of the step.
    step : str
        Name of the step, e.g. ``"read"`` or ``"tyre_profile"``.
    parameters : mapping, optional
        Settings of the step; dataclasses are written with their names and values.
    inputs : sequence of path, optional
        Files that the step read; their hashes are recorded.
    after : xarray.Dataset, optional
        The dataset that the step started from; by default `data` itself.

    Returns
    -------
    xarray.Dataset
        The same data with new attributes.

    Examples
    --------
    >>> data = add_step(xr.Dataset(), "smooth", parameters={"length": 0.25})
    >>> provenance_steps(data)[0]["parameters"]
    {'length': 0.25}
    """
    entry = {
        "step": step,
        "version": __version__,
        "parameters": {name: _json_value(value) for name, value in (parameters or {}).items()},
        "inputs": [describe_input(path) for path in inputs],
    }
    history = [*provenance_steps(data if after is None else after), entry]
    return data.assign_attrs(provenance=json.dumps(history))


def _json_value(value: Any) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = {f.name: _json_value(getattr(value, f.name)) for f in dataclasses.fields(value)}
        return {"kind": type(value).__name__, **fields}
    if isinstance(value, str | int | float | bool | None):
        return value
    if isinstance(value, Mapping):
        return {str(name): _json_value(item) for name, item in value.items()}
    if isinstance(value, Sequence):
        return [_json_value(item) for item in value]
    return str(value)
