"""What a navigation dataset must hold, and the rules its values obey."""

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import SchemaError

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class SchemaVariable:
    """One variable of a schema."""

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

_BLOCK = 1 << 16  # epochs looked at at a time


def make_navigation(columns: Mapping[str, npt.ArrayLike], **attrs: Any) -> xr.Dataset:
    """Navigation from arrays.

    Parameters
    ----------
    columns : mapping of array_like, shape (epoch,)
        ``time`` [s], ``east``, ``north``, ``up`` [m], ``roll``, ``pitch``, ``yaw`` [rad] after
        ISO 8855, and any of ``sd_east`` ... ``sd_yaw`` [m, rad].
    **attrs
        Attributes, such as ``origin`` = [longitude deg, latitude deg, ellipsoidal height m].

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
    """Navigation from arrays, unchecked."""
    variables = {
        name: ("epoch", np.asarray(values, dtype=np.float64), {"units": NAVIGATION[name].units})
        for name, values in columns.items()
    }
    return xr.Dataset(variables, attrs={"kind": "trueterrain/navigation", "schema": 1, **attrs})


def check_navigation(
    data: xr.Dataset, *, path: str | Path | None = None, place: str = ""
) -> xr.Dataset:
    """Return the dataset if it is navigation, else say what is wrong with it.

    Parameters
    ----------
    data : xarray.Dataset
        What shall be navigation; it is looked at block by block.
    path : str or Path, optional
        File that it came from, for the message.
    place : str
        Where in the file it stands, for the message.

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
    """The rules for the values of navigation, kept up from block to block."""

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
    """Times that must be finite and run forward, kept up from block to block."""

    def __init__(self, *, path: str | Path | None, place: str) -> None:
        self._path, self._place = path, place
        self._last = -np.inf
        self.count = 0

    def check(self, time: Floats) -> None:
        """Raise a SchemaError at the first time that is not finite or does not run forward."""
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
    data: xr.Dataset, dim: str, least: int, *, path: str | Path | None, place: str
) -> None:
    """Raise a SchemaError if there are too few values along a dimension."""
    if data.sizes[dim] < least:
        found = data.sizes[dim] or "none"
        raise SchemaError(
            f"must have at least {least} {dim}{'s' if least > 1 else ''}, got {found}",
            path=path,
            place=place or None,
            cure="Copy or record it again.",
        )


def suggest_name(name: str, known: Iterable[str]) -> str:
    """``" (did you mean 'x'?)"`` if a known name is near."""
    near = difflib.get_close_matches(name, list(known), n=1, cutoff=0.6)
    return f" (did you mean {near[0]!r}?)" if near else ""


def _join_place(place: str, inner: str) -> str:
    return f"{place}, {inner}" if place else inner
