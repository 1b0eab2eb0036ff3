"""Points and profiles from the columns of a table."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import FormatError
from trueterrain.core.schemas import RETURN_ATTRIBUTES, make_points, make_profile
from trueterrain.formats.table._columns import TableLayout, Values

_WHOLE_NUMBERS = (
    "lane",
    "count",
    "intensity",
    *(n for n, kind in RETURN_ATTRIBUTES.items() if kind[0] == "u"),
)

Place = Callable[[int], str]


def build_points(values: Values) -> xr.Dataset:
    """Points from the columns of a table."""
    named = {column.name: _as_integers(column.name, array) for column, array in values.items()}
    east, north, up = named.pop("easting"), named.pop("northing"), named.pop("up")
    return make_points(east, north, up, **named)


def build_profile(values: Values, layout: TableLayout, path: Path, place: Place) -> xr.Dataset:
    """Profile from the columns of a table; `place` gives the place of a row in the file."""
    named = {column.key: array for column, array in values.items()}
    if ("track", None) in named:
        return _from_rows(named, path, place)
    s = named.pop(("s", None))
    _require_ascending(s, np.arange(s.size), path, place)
    tracks = layout.tracks
    names = sorted({name for name, _ in named})
    gaps = np.full(s.size, np.nan)
    stacked = {
        name: _as_integers(name, np.stack([named.get((name, track), gaps) for track in tracks]))
        for name in names
    }
    if tracks == [None]:
        single = {name: array[0] for name, array in stacked.items()}
        return make_profile(s, single.pop("height"), **single)
    labels = [track or "height" for track in tracks]
    return make_profile(s, stacked.pop("height"), tracks=labels, **stacked)


def _from_rows(named: dict[tuple[str, str | None], Any], path: Path, place: Place) -> xr.Dataset:
    track = named.pop(("track", None))
    columns = {name: array for (name, _), array in named.items()}
    labels = list(dict.fromkeys(track.tolist()))
    rows = [np.flatnonzero(track == label) for label in labels]
    s = columns.pop("s")
    for label, own in zip(labels, rows, strict=True):
        _require_ascending(s[own], own, path, place)
        if own.size != rows[0].size or (s[own] != s[rows[0]]).any():
            raise FormatError(
                f"track {label!r} must have the same values of s as track {labels[0]!r}",
                path=path,
                place="column 's'",
                cure="Write one file per track, or bring them to the same stations.",
            )
    stacked = {
        name: _as_integers(name, np.stack([array[own] for own in rows]))
        for name, array in columns.items()
    }
    if len(labels) == 1:
        single = {name: array[0] for name, array in stacked.items()}
        profile = make_profile(s[rows[0]], single.pop("height"), **single)
        return profile.assign_attrs(track=labels[0])
    return make_profile(s[rows[0]], stacked.pop("height"), tracks=labels, **stacked)


def _require_ascending(
    s: npt.NDArray[Any], rows: npt.NDArray[np.intp], path: Path, place: Place
) -> None:
    falls = np.flatnonzero(np.diff(s) <= 0)
    if falls.size:
        at = int(falls[0]) + 1
        raise FormatError(
            f"s must ascend, but {s[at]:.10g} m follows {s[at - 1]:.10g} m",
            path=path,
            place=place(int(rows[at])),
            cure="Sort the rows along the path and remove repeated ones.",
        )


def _as_integers(name: str, array: Any) -> Any:
    """Counts and ids as integers, unless values are missing or not whole."""
    if name in _WHOLE_NUMBERS and np.isfinite(array).all() and (array == np.rint(array)).all():
        return array.astype(np.int64)
    return array
