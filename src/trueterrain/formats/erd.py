"""ERD: longitudinal profiles as text, the exchange format of pavement engineers.

A header of 8-column keys ends with ``END``; the heights of all tracks follow, sample by sample,
separated by blanks. Stations are in m or ft, heights in m, mm, in or ft; they are converted to
metres. The foot is the international foot, 0.3048 m exactly; the US survey foot differs by 2 parts
in a million (2 mm per km), and the format cannot name it.

Three keys of this package are written, too, which other readers ignore: ``XSTART``, the station of
the first sample in the unit of ``XUNITS``; ``TRACKS``, the full names of tracks that are longer
than 8 columns; ``HISTORY``, the provenance as JSON.

Sources: the description of ERD at UMTRI and the reader of the UMTRI program IRIMain.
"""

import json
import re
import warnings
from collections.abc import Iterable
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core import Checksums, provenance, whole_output
from trueterrain.core.errors import FormatError, SchemaError
from trueterrain.core.schemas import check_profile, make_profile
from trueterrain.formats._bounds import value_range
from trueterrain.formats._erd_text import COLUMNS, SIGNATURE, TEXT, UNITS, ErdHeader, load_erd
from trueterrain.formats._flags import profile_flags

#: Deviation from equal spacing that counts as rounding, as a fraction of the spacing.
SPACING_TOLERANCE = 1e-3

_OURS = ("SHORTNAM", "UNITSNAM", "XUNITS", "XSTART", "TRACKS", "HISTORY")  # keys that write sets
_DECIMALS = {"m": 9, "mm": 6, "in": 8, "ft": 9}  # keep heights within 0.5 nm
_UMTRI_STEP = 1.0  # [m] spacing from which on the UMTRI reader refuses a file


def read(path: str | Path) -> xr.Dataset:
    """Read a profile from an ERD text file.

    Tracks are named by SHORTNAM; one track gives a profile without dimension ``track``, its name in
    ``attrs["track"]``. Other keys of the header are kept in ``attrs["erd_header"]`` (JSON list of
    pairs) and written back by `write`. Channels that are not lengths are omitted with a warning.

    Parameters
    ----------
    path : str or Path
        The file.

    Returns
    -------
    xarray.Dataset
        Profile with dims (s,) or (track, s), heights [m].

    Raises
    ------
    FormatError
        If the file is not an ERD file, is binary (KEYNUM other than 5), or lacks units or numbers.
    """
    header, values = load_erd(Path(path))
    used = _used_channels(header, path)
    for channel in sorted(set(range(header.channels)) - set(used)):
        name, unit = header.names[channel], header.units[channel]
        message = f"{path}: channel {name} is left out, since its unit {unit!r} is no height"
        warnings.warn(message, stacklevel=2)
    factors = np.array([UNITS[header.units[channel]] for channel in used])
    height = values[:, used].T * factors[:, None]
    s = header.start + header.step * np.arange(header.samples)
    names = [header.names[channel] for channel in used]
    if len(names) == 1:
        profile = make_profile(s, height[0]).assign_attrs(track=names[0])
    else:
        profile = make_profile(s, np.ascontiguousarray(height), tracks=names)
    free = [pair for pair in header.keys if pair[0] not in _OURS]
    profile.attrs["erd_header"] = json.dumps(free)
    _restore_history(profile, header)
    parameters = {"format": "ERD", "units": [header.units[channel] for channel in used]}
    return provenance.add_step(profile, "read", parameters=parameters, inputs=[path])


def write(profile: xr.Dataset, path: str | Path, *, force: bool = False, units: str = "m") -> None:
    """Write a profile as ERD text.

    ERD holds heights and stations only; easting, northing, sd and count are lost. Heights are exact
    to 1e-9 m.

    Parameters
    ----------
    profile : xarray.Dataset
        Profile with dims (s,) or (track, s), equally spaced, without NaN.
    path : str or Path
        Path of the file to write.
    force : bool
        Replace an existing file.
    units : str
        Unit of the heights, ``"m"``, ``"mm"``, ``"in"`` or ``"ft"``; stations are in m with the
        first two, in ft with the last two.

    Raises
    ------
    ValueError
        If `units` is unknown.
    SchemaError
        If the spacing is not equal or a height is NaN.
    OutputError
        If the file exists and `force` is false, or differs when it is read back.

    Examples
    --------
    >>> import tempfile
    >>> road = make_profile([2.0, 2.5, 3.0], [0.0, 0.01, 0.0])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write(road, Path(folder) / "road.erd", units="in")
    ...     again = read(Path(folder) / "road.erd")
    >>> again.height.values
    array([0.  , 0.01, 0.  ])
    """
    if units not in UNITS:
        raise ValueError(f"units must be one of {', '.join(UNITS)}, got {units!r}.")
    check_profile(profile)
    step = _equal_step(profile.s.values)
    names = _track_names(profile)
    height = np.atleast_2d(profile.height.values)
    _require_finite(height, names, profile.s.values)
    lines = _header_lines(profile, names, step, units)
    with BytesIO() as stream:
        stream.writelines(f"{line}\n".encode() for line in lines)
        np.savetxt(stream, height.T / UNITS[units], fmt=f"%.{_DECIMALS[units]}f")
        text = stream.getvalue()
    written, found = Checksums(), Checksums()
    written.add("text", text)
    with whole_output(path, force=force) as temporary:
        temporary.write_bytes(text)
        found.add_file("text", temporary)
        found.require_same(written, path)


def describe(path: str | Path) -> dict[str, Any]:
    """Summary of an ERD file for ``trueterrain info``.

    Parameters
    ----------
    path : str or Path
        The file.

    Returns
    -------
    dict
        ``format``, ``kind``, ``tracks``, ``count``, ``spacing`` [m], ``extent`` [m], ``units``,
        ``header`` and ``problems``; all values are plain types that JSON can hold.

    Raises
    ------
    FormatError
        As by `read`.
    """
    header, values = load_erd(Path(path))
    used = _used_channels(header, path)
    problems = list(header.problems)
    s = header.start + header.step * np.arange(header.samples)
    tracks = []
    for channel, (name, unit) in enumerate(zip(header.names, header.units, strict=True)):
        if channel not in used:
            problems.append(f"channel {name} is in {unit!r}, which is no height, and is left out")
            continue
        height = values[:, channel] * UNITS[unit]
        problems += profile_flags(name, s, height)
        low, high = value_range(height) or (None, None)
        tracks.append({"name": name, "lowest": low, "highest": high})
    if header.step >= _UMTRI_STEP:
        problems.append(
            f"spacing {header.step:g} m: readers derived from that of UMTRI refuse 1 m and more"
        )
    return {
        "format": "ERD",
        "kind": "profile",
        "tracks": tracks,
        "count": header.samples,
        "spacing": header.step,
        "extent": {"s": [float(s[0]), float(s[-1])]},
        "units": {"s": header.x_units, "height": [header.units[channel] for channel in used]},
        "crs": "",
        "header": {key: value for key, value in header.keys if key not in _OURS},
        "problems": problems,
    }


def _used_channels(header: ErdHeader, path: str | Path) -> list[int]:
    used = [channel for channel, unit in enumerate(header.units) if unit in UNITS]
    if not used:
        raise FormatError(
            f"must be {', '.join(UNITS)} for at least one channel, got {', '.join(header.units)}",
            path=path,
            place="key UNITSNAM",
            cure="Export elevation, not another quantity.",
        )
    return used


def _restore_history(profile: xr.Dataset, header: ErdHeader) -> None:
    history = dict(header.keys).get("HISTORY", "")
    try:
        entries = json.loads(history)
    except ValueError:
        return
    if isinstance(entries, list) and all(isinstance(entry, dict) for entry in entries):
        profile.attrs["provenance"] = json.dumps(entries)


def _equal_step(s: npt.NDArray[np.float64]) -> float:
    if s.size < 2:
        raise SchemaError(
            "must have at least 2 samples to be written as ERD, got 1", place="axis s"
        )
    step = float(s[-1] - s[0]) / (s.size - 1)
    deviation = np.abs(s - (s[0] + step * np.arange(s.size)))
    worst = int(np.argmax(deviation))
    if deviation[worst] > SPACING_TOLERANCE * step:
        raise SchemaError(
            f"ERD needs equal spacing, but sample {worst} lies {deviation[worst]:.3g} m off "
            f"s = {s[0] + step * worst:.6g} m",
            place="axis s",
            cure="Write CSV, which keeps any spacing, or extract the profile at equal spacing.",
        )
    return step


def _require_finite(
    height: npt.NDArray[np.float64], names: list[str], s: npt.NDArray[np.float64]
) -> None:
    track, sample = np.nonzero(~np.isfinite(height))
    if track.size:
        raise SchemaError(
            f"ERD cannot hold missing heights, but {track.size} are, the first at "
            f"s = {s[sample[0]]:.6g} m of track {names[track[0]]}",
            place="variable height",
            cure="Write CSV, which keeps gaps, or take the part of the path that has ground.",
        )


def _track_names(profile: xr.Dataset) -> list[str]:
    if "track" in profile.dims:
        return [" ".join(str(name).replace(";", ",").split()) for name in profile.track.values]
    return [" ".join(str(profile.attrs.get("track", "height")).replace(";", ",").split())]


def _header_lines(profile: xr.Dataset, names: list[str], step: float, units: str) -> list[str]:
    x_units = "m" if units in ("m", "mm") else "ft"
    # repr keeps all digits: a rounded step would move the end of a long profile
    step_text = repr(float(step / UNITS[x_units]))
    start_text = repr(float(profile.s.values[0]) / UNITS[x_units])
    free = [(str(k), str(v)) for k, v in json.loads(profile.attrs.get("erd_header", "[]"))]
    given = {key for key, _ in free}
    defaults = [("TITLE", "Longitudinal profile"), ("XLABEL", "Distance")]
    keys = free + [pair for pair in defaults if pair[0] not in given]
    keys += [
        ("SHORTNAM", _in_columns(names)),
        ("UNITSNAM", _in_columns([units] * len(names))),
        ("XUNITS", x_units),
        ("XSTART", start_text),
    ]
    if any(len(name) > COLUMNS for name in names):
        keys.append(("TRACKS", "; ".join(names)))
    if history := profile.attrs.get("provenance"):
        keys.append(("HISTORY", history))
    storage = f"{len(names)}, {profile.sizes['s']}, -1, 1, {TEXT}, {step_text}, -1"
    body = [f"{key[:COLUMNS]:<{COLUMNS}}{_one_line(value)}" for key, value in keys]
    return [f"{SIGNATURE}2.00", storage, *body, "END"]


def _in_columns(words: Iterable[str]) -> str:
    return "".join(f"{word[:COLUMNS]:<{COLUMNS}}" for word in words).rstrip()


def _one_line(value: str) -> str:
    return re.sub(r"[\r\n]+", " ", value)
