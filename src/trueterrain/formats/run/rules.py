"""Rules of a run; each function reads block by block and raises at the first violation."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import SchemaError, suggest_name
from trueterrain.core.schemas.navigation import (
    TimeChecker,
    check_length,
    check_navigation,
    check_structure,
)
from trueterrain.core.schemas.run import (
    ACCELEROMETERS,
    GROUPS,
    KIND,
    ROW_CHUNK,
    SCHEMA,
    TIME_REFERENCES,
    Mounting,
)
from trueterrain.formats.run._handle import Run
from trueterrain.geometry.navigation_frames import check_origin

Floats = npt.NDArray[np.float64]

_GRAVITY = (5.0, 15.0)  # [m/s²] allowed median of the specific force along z
_LONG_ENOUGH = 5.0  # [s] shortest time for this rule: on rough ground a car may fall for a second
_IN_G = (0.5, 1.5)  # range of the median if the unit is g
_SLACK = 1.001  # factor by which a delay may exceed the time between two scans: rounding of clocks


def check_run(tree: xr.DataTree, path: str | Path | None = None) -> xr.DataTree:
    """Check that a tree is a run, and return it.

    All values except the ranges are checked, block by block.

    Parameters
    ----------
    tree : xarray.DataTree
        Tree to check.
    path : str or Path, optional
        Store of the tree, for the message.

    Returns
    -------
    xarray.DataTree
        `tree`, unchanged.

    Raises
    ------
    SchemaError
        Naming file, group and variable, rule, value and index: time that does not ascend, a value
        that is not finite, scans outside of the time span of the navigation, a wrong dimension or
        unit, an unknown group, variable or key, angles that are not in radians.
    FormatError
        If chunks of the store are missing or damaged.

    Examples
    --------
    >>> check_run(xr.DataTree(xr.Dataset(attrs={"kind": "log"})), "x.zarr")
    Traceback (most recent call last):
    trueterrain.core.errors.SchemaError: x.zarr: attribute kind: must be 'trueterrain/run', got ...
    """
    for rule in rules_of(tree, path):
        rule()
    return tree


def check_layout(tree: xr.DataTree, path: str | Path | None = None) -> xr.DataTree:
    """Check attributes, groups, variables, dimensions and units of a run, and return it.

    Values along time are not read, so the check is fast.

    Parameters
    ----------
    tree : xarray.DataTree
        Tree to check.
    path : str or Path, optional
        Store of the tree, for the message.

    Returns
    -------
    xarray.DataTree
        `tree`, unchanged.

    Raises
    ------
    SchemaError
        As by `check_run`.
    """
    check_attrs(tree, path)
    check_groups(tree, path)
    for name, schema in GROUPS.items():
        if name in tree.children:
            check_structure(group_of(tree, name), schema, path=path, place=name)
            _check_types(group_of(tree, name), path, name)
    return tree


def _check_types(data: xr.Dataset, path: str | Path | None, place: str) -> None:
    for name, variable in data.variables.items():
        if variable.dtype.kind not in ("fiu" if name == "intensity" else "f"):
            raise SchemaError(
                f"must hold floating-point numbers, got {variable.dtype}",
                path=path,
                place=f"{place}, variable {name}",
                cure="Convert the values to float64.",
            )


def rules_of(tree: xr.DataTree, path: str | Path | None) -> Iterator[Callable[[], Any]]:
    """Yield the rules in order; if the first (the layout) holds, each can be checked by itself."""
    yield lambda: check_layout(tree, path)
    if isinstance(tree, Run):
        yield tree.require_chunks
    yield lambda: check_scans(tree, path)
    yield lambda: check_navigation(group_of(tree, "navigation"), path=path, place="navigation")
    yield lambda: check_coverage(tree, path)
    if "accelerometers" in tree.children:
        yield lambda: check_accelerometers(tree, path)


def check_attrs(tree: xr.DataTree, path: str | Path | None) -> None:
    """Check kind, schema, name, origin, time reference and mounting."""
    attrs = tree.attrs
    if attrs.get("kind") != KIND:
        raise SchemaError(
            f"must be {KIND!r}, got {attrs.get('kind')!r}",
            path=path,
            place="attribute kind",
            cure="Write runs with RunWriter.",
        )
    if attrs.get("schema") != SCHEMA:
        raise SchemaError(
            f"must be {SCHEMA}, got {attrs.get('schema')!r}",
            path=path,
            place="attribute schema",
            cure="If it is newer, update trueterrain.",
        )
    if not isinstance(attrs.get("name"), str):
        raise SchemaError(
            f"must be a text, got {attrs.get('name')!r}", path=path, place="attribute name"
        )
    if attrs.get("time_reference") not in TIME_REFERENCES:
        raise SchemaError(
            f"must be {' or '.join(map(repr, TIME_REFERENCES))}, got "
            f"{attrs.get('time_reference')!r}",
            path=path,
            place="attribute time_reference",
        )
    try:
        check_origin(attrs.get("origin", ()))
    except (TypeError, ValueError, OverflowError) as error:
        raise SchemaError(str(error), path=path, place="attribute origin") from None
    Mounting.from_attrs(attrs.get("mounting"), path=path)


def check_groups(tree: xr.DataTree, path: str | Path | None) -> None:
    """Check that scans and navigation exist, and that there are no unknown groups."""
    known = (*GROUPS, "truth")
    for name in tree.children:
        if name not in known:
            raise SchemaError(
                f"is unknown{suggest_name(name, known)}; known are {', '.join(known)}",
                path=path,
                place=f"group {name}",
            )
    for name in ("scans", "navigation"):
        if name not in tree.children:
            raise SchemaError(
                "is missing",
                path=path,
                place=f"group {name}",
                cure="Record or import it again.",
            )


def check_scans(tree: xr.DataTree, path: str | Path | None) -> None:
    """Check angles and delays of the beams, and times of the scans."""
    scans = group_of(tree, "scans")
    check_length(scans, "beam", 1, path=path, place="scans")
    check_length(scans, "scan", 1, path=path, place="scans")
    _check_angles(scans["angle"].values, path)
    clock = TimeChecker(path=path, place="scans, variable time")
    for block in row_blocks(scans, "scan", ("time",)):
        clock.check(block["time"])
    _check_delays(scans["delay"].values, _first_interval(scans), path)


def _check_angles(angle: Floats, path: str | Path | None) -> None:
    place = "scans, variable angle"
    _require_finite(angle, place, path)
    far = np.abs(angle) > np.pi
    if far.any():
        first = int(np.flatnonzero(far)[0])
        raise SchemaError(
            f"must be within half a turn (pi rad), got {angle[first]:g} at index {first}",
            path=path,
            place=place,
            cure="Convert degrees to radians.",
        )
    steps = np.diff(angle)
    wrong = steps * np.sign(steps[0] if steps.size else 1.0) <= 0
    if wrong.any():
        first = int(np.flatnonzero(wrong)[0])
        raise SchemaError(
            f"must rise or fall throughout, but value {first + 1} ({angle[first + 1]:g} rad) "
            f"follows {angle[first]:g} rad",
            path=path,
            place=place,
            cure="Sort the beams by their angle.",
        )


def _check_delays(delay: Floats, interval: float, path: str | Path | None) -> None:
    place = "scans, variable delay"
    _require_finite(delay, place, path)
    bad = (delay < 0) | (delay > interval * _SLACK)
    if bad.any():
        first = int(np.flatnonzero(bad)[0])
        raise SchemaError(
            f"must be from 0 s to the time between two scans ({interval:g} s), got "
            f"{delay[first]:g} s at index {first}",
            path=path,
            place=place,
            cure="Give the delays in seconds after the first beam.",
        )


def check_coverage(tree: xr.DataTree, path: str | Path | None) -> None:
    """Check that all beams of all scans lie within the time span of the navigation."""
    scans, navigation = group_of(tree, "scans"), group_of(tree, "navigation")
    clock = Mounting.from_attrs(tree.attrs["mounting"]).scanner_clock
    start, end = span_of(navigation, "epoch")
    delay = scans["delay"].values
    count, largest = 0, 0.0
    for block in row_blocks(scans, "scan", ("time",)):
        true = block["time"] + clock
        beyond = np.maximum(start - true - delay.min(), true + delay.max() - end)
        count += int(np.count_nonzero(beyond > 0))
        largest = max(largest, float(beyond.max()))
    if count:
        first, last = span_of(scans, "scan")
        raise SchemaError(
            f"{count} of {scans.sizes['scan']} scans lie outside of the navigation by up to "
            f"{largest:.6g} s: scans from {first + clock:.6f} s to {last + clock:.6f} s (with the "
            f"scanner's clock of {clock:g} s), navigation from {start:.6f} s to {end:.6f} s",
            path=path,
            place="scans, variable time",
            cure="Cut those scans off, or correct mounting.scanner_clock.",
        )


def check_accelerometers(tree: xr.DataTree, path: str | Path | None) -> None:
    """Check times, positions and units of the accelerometers."""
    group, place = group_of(tree, "accelerometers"), "accelerometers"
    check_structure(group, ACCELEROMETERS, path=path, place=place)
    check_length(group, "sample", 2, path=path, place=place)
    check_length(group, "sensor", 1, path=path, place=place)
    if group.sizes["axis"] != 3:
        raise SchemaError(
            f"must have 3 axes, got {group.sizes['axis']}",
            path=path,
            place=f"{place}, variable position",
        )
    _require_finite(group["position"].values, f"{place}, variable position", path)
    clock = TimeChecker(path=path, place=f"{place}, variable time")
    for block in row_blocks(group, "sample", ("time", "acceleration")):
        done, values = clock.count, block["acceleration"]
        clock.check(block["time"])
        _require_finite(values, f"{place}, variable acceleration", path, first=done)
        if done == 0 and block["time"][-1] - block["time"][0] >= _LONG_ENOUGH:
            _check_gravity(values, path)


def _check_gravity(acceleration: Floats, path: str | Path | None) -> None:
    for sensor, median in enumerate(np.median(acceleration, axis=0)):
        if _GRAVITY[0] <= median <= _GRAVITY[1]:
            continue
        cure = "Write the specific force along body z: +9.81 m/s2 for a body at rest."
        if _IN_G[0] <= abs(median) <= _IN_G[1]:
            cure = "Multiply by 9.80665 if the values are in g."
        elif median < 0:
            cure = "Change the sign if the axis points down."
        raise SchemaError(
            f"must have a median from {_GRAVITY[0]:g} to {_GRAVITY[1]:g} m/s2 (near gravity), "
            f"got {median:.4g} at sensor {sensor}",
            path=path,
            place="accelerometers, variable acceleration",
            cure=cure,
        )


def _require_finite(values: Floats, place: str, path: str | Path | None, *, first: int = 0) -> None:
    bad = ~np.isfinite(values)
    if bad.any():
        index = np.argwhere(bad)[0]
        where = ", ".join(str(int(i)) for i in (index[0] + first, *index[1:]))
        raise SchemaError(
            f"must be finite everywhere, got {values[tuple(index)]:g} at index {where}",
            path=path,
            place=place,
        )


def group_of(tree: xr.DataTree, name: str) -> xr.Dataset:
    """Variables of a group."""
    return tree.children[name].to_dataset(inherit=False)


def row_blocks(
    data: xr.Dataset, dim: str, names: tuple[str, ...], size: int = ROW_CHUNK
) -> Iterator[dict[str, Any]]:
    """Yield the values of some variables, block by block along a dimension."""
    for start in range(0, data.sizes[dim], size):
        rows = slice(start, start + size)
        yield {name: data[name].isel({dim: rows}).values for name in names}


def span_of(data: xr.Dataset, dim: str) -> tuple[float, float]:
    """First and last time of a group [s]."""
    ends = data["time"].isel({dim: [0, -1]}).values
    return float(ends[0]), float(ends[1])


def _first_interval(scans: xr.Dataset) -> float:
    """Median time between the first scans [s]; infinite for a single scan."""
    time = scans["time"].isel(scan=slice(0, ROW_CHUNK)).values
    return float(np.median(np.diff(time))) if time.size > 1 else np.inf
