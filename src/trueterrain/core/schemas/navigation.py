"""Schema of navigation: required variables, dimensions and units, and the rules of their values."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import SchemaError, suggest_name

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class SchemaVariable:
    """Dimensions and units of one variable of a schema."""

    dims: tuple[str, ...]
    "Dimensions."

    units: str
    "Units, as in the attribute of that name."

    required: bool = True
    "Whether the variable must be there."


def _epoch_variable(units: str, *, required: bool = True) -> SchemaVariable:
    return SchemaVariable(dims=("epoch",), units=units, required=required)


POSITION = ("east", "north", "up")
ATTITUDE = ("roll", "pitch", "yaw")
ACCURACY = tuple(f"sd_{name}" for name in (*POSITION, *ATTITUDE))

NAVIGATION = {
    "time": _epoch_variable("s"),
    **{name: _epoch_variable("m") for name in POSITION},
    **{name: _epoch_variable("rad") for name in ATTITUDE},
    **{f"sd_{name}": _epoch_variable("m", required=False) for name in POSITION},
    **{f"sd_{name}": _epoch_variable("rad", required=False) for name in ATTITUDE},
}

_BLOCK = 1 << 16  # epochs that are checked at a time


def make_navigation(columns: Mapping[str, npt.ArrayLike], **attrs: Any) -> xr.Dataset:
    """Create navigation from arrays, and check it.

    Parameters
    ----------
    columns : mapping of array_like, shape (epoch,)
        ``time`` [s], ``east``, ``north``, ``up`` [m], ``roll``, ``pitch``, ``yaw`` [rad] after
        ISO 8855, and any of ``sd_east`` ... ``sd_yaw`` [m, rad].
    **attrs
        Attributes, for example ``origin`` = [longitude deg, latitude deg, ellipsoidal height m].

    Returns
    -------
    xarray.Dataset
        Checked navigation.

    Raises
    ------
    SchemaError
        As by `check_navigation`.

    Examples
    --------
    >>> still = dict.fromkeys(("east", "north", "up", "roll", "pitch", "yaw"), [0.0, 0.0])
    >>> make_navigation({"time": [0.0, 0.005], **still}).sizes["epoch"]
    2
    """
    return check_navigation(navigation_of(columns, **attrs))


def navigation_of(columns: Mapping[str, npt.ArrayLike], **attrs: Any) -> xr.Dataset:
    """Create navigation from arrays without a check."""
    variables = {
        name: ("epoch", np.asarray(values, dtype=np.float64), {"units": NAVIGATION[name].units})
        for name, values in columns.items()
    }
    return xr.Dataset(variables, attrs={"kind": "trueterrain/navigation", "schema": 1, **attrs})


def check_navigation(
    data: xr.Dataset, *, path: str | Path | None = None, place: str = ""
) -> xr.Dataset:
    """Check that a dataset is navigation, and return it.

    Parameters
    ----------
    data : xarray.Dataset
        Dataset to check; it is read block by block.
    path : str or Path, optional
        File of the dataset, for the message.
    place : str
        Place in the file, for the message.

    Returns
    -------
    xarray.Dataset
        `data`, unchanged.

    Raises
    ------
    SchemaError
        Naming the file, the variable, the rule, the value and its index: a missing or unknown
        variable, a wrong dimension or unit, time that does not run forward, a value that is not
        finite, a roll or pitch beyond a quarter turn, a negative standard deviation.
    """
    check_structure(data, NAVIGATION, path=path, place=place)
    check_length(data, "epoch", 2, path=path, place=place)
    rules = EpochRules(path=path, place=place)
    for start in range(0, data.sizes["epoch"], _BLOCK):
        rules.check(data.isel(epoch=slice(start, start + _BLOCK)))
    return data


class EpochRules:
    """Checks of the values of navigation, block by block."""

    def __init__(self, *, path: str | Path | None = None, place: str = "") -> None:
        self._path, self._place = path, place
        self._clock = TimeChecker(path=path, place=_join_place(place, "variable time"))
        self._count = 0

    def check(self, block: xr.Dataset) -> None:
        """Raise a SchemaError if a value of the block breaks a rule."""
        columns = {str(name): block[name].values for name in block.data_vars}
        time = columns["time"]
        for name, values in columns.items():
            if name != "time":
                self._check_values(name, values, time)
        self._clock.check(time)
        self._count += time.size

    def _check_values(self, name: str, values: Floats, time: Floats) -> None:
        bad = ~np.isfinite(values)
        if bad.any():
            raise self._error(
                name,
                "must be finite everywhere",
                values,
                bad,
                time,
                "Cut the gap out of the recording, or fill it in the navigation software.",
            )
        if name in ("roll", "pitch"):
            bad = np.abs(values) > np.pi / 2
            if bad.any():
                raise self._error(
                    name,
                    "must lie within a quarter turn (pi/2 rad)",
                    values,
                    bad,
                    time,
                    "Convert degrees to radians.",
                )
        if name.startswith("sd_"):
            bad = values < 0
            if bad.any():
                raise self._error(name, "must not be negative", values, bad, time, None)

    def _error(
        self, name: str, rule: str, values: Floats, bad: Any, time: Floats, cure: str | None
    ) -> SchemaError:
        first = int(np.flatnonzero(bad)[0])
        count = int(np.count_nonzero(bad))
        others = f" and {count - 1} more near it" if count > 1 else ""
        return SchemaError(
            f"{rule}, got {values[first]:g} at index {self._count + first} "
            f"(time {time[first]:.6f} s){others}",
            path=self._path,
            place=_join_place(self._place, f"variable {name}"),
            cure=cure,
        )


class TimeChecker:
    """Check that times are finite and strictly ascending, block by block."""

    def __init__(self, *, path: str | Path | None, place: str) -> None:
        self._path, self._place = path, place
        self._last = -np.inf
        self.count = 0

    def check(self, time: Floats) -> None:
        """Raise a SchemaError at the first time that is not finite or does not ascend."""
        if time.size == 0:
            return
        bad = ~np.isfinite(time)
        if bad.any():
            first = int(np.flatnonzero(bad)[0])
            raise SchemaError(
                f"must be finite everywhere, got {time[first]:g} at index {self.count + first}",
                path=self._path,
                place=self._place,
                cure="Leave out the records without a time.",
            )
        bad = np.diff(time, prepend=self._last) <= 0
        if bad.any():
            first = int(np.flatnonzero(bad)[0])
            before = time[first - 1] if first else self._last
            raise SchemaError(
                f"must run forward, but value {self.count + first} ({time[first]:.6f} s) follows "
                f"{before:.6f} s",
                path=self._path,
                place=self._place,
                cure="Cut the recording there, or sort it by time and remove doubles.",
            )
        self._last = float(time[-1])
        self.count += time.size


def check_structure(
    data: xr.Dataset,
    schema: Mapping[str, SchemaVariable],
    *,
    path: str | Path | None,
    place: str,
) -> None:
    """Raise a SchemaError if variables are missing or unknown, or have other dims or units."""
    for name in data.data_vars:
        if name not in schema:
            raise SchemaError(
                f"is unknown{suggest_name(str(name), schema)}; known are {', '.join(schema)}",
                path=path,
                place=_join_place(place, f"variable {name}"),
            )
    for name, rule in schema.items():
        if name not in data:
            if rule.required:
                raise SchemaError(
                    "is missing", path=path, place=_join_place(place, f"variable {name}")
                )
            continue
        variable, where = data[name], _join_place(place, f"variable {name}")
        if variable.dims != rule.dims:
            found = ", ".join(str(dim) for dim in variable.dims)
            raise SchemaError(
                f"must have the dimensions ({', '.join(rule.dims)}), got ({found})",
                path=path,
                place=where,
            )
        if variable.attrs.get("units") != rule.units:
            raise SchemaError(
                f"must be in {rule.units}, got units {variable.attrs.get('units')!r}",
                path=path,
                place=where,
                cure="Convert the values and set the attribute units.",
            )


def check_length(
    data: xr.Dataset, dim: str, minimum: int, *, path: str | Path | None, place: str
) -> None:
    """Raise a SchemaError if there are too few values along a dimension."""
    if data.sizes[dim] < minimum:
        found = data.sizes[dim] or "none"
        raise SchemaError(
            f"must have at least {minimum} {dim}{'s' if minimum > 1 else ''}, got {found}",
            path=path,
            place=place or None,
            cure="Copy or record it again.",
        )


def _join_place(place: str, inner: str) -> str:
    return f"{place}, {inner}" if place else inner
