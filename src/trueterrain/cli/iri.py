"""``trueterrain iri``: International Roughness Index of profiles."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from trueterrain.cli._console import compiling_noted, out, out_json
from trueterrain.cli._recordings import refuse_recording
from trueterrain.errors import SchemaError, concerning

if TYPE_CHECKING:
    import xarray as xr

    from trueterrain.roughness import IriOptions

# [m] below, the start of the car is felt in the index (more than 10 % has been seen at 91 m)
_SHORT = 100.0


def iri(
    file: Path,
    /,
    *more: Path,
    segment: float = 100.0,
    continuous: float | None = None,
    step: float | None = None,
    window: Literal["sayers", "centred", "exact", "none"] = "sayers",
    window_length: float = 0.25,
    start: Literal["11m", "0.5s", "level"] = "11m",
    restart: bool = False,
    wheel_paths: tuple[str, str] | None = None,
    json: bool = False,
) -> None:
    """International Roughness Index (IRI) of profiles [m/km], as by Sayers's program (ASTM E1926).

    Each track is rated as a whole and in fixed segments. Of two wheel paths, MRI is the mean of
    their IRI, HRI the IRI of their mean profile.

    Example: trueterrain iri left_and_right.erd --segment 20 --json

    Parameters
    ----------
    file
        Profile: ERD, CSV or Parquet.
    more
        More profiles.
    segment
        Length of the fixed segments [m]; the last one may be shorter.
    continuous
        Length of a window that slides along each track [m]; none by default.
    step
        Distance from one sliding window to the next [m]; by default 1.
    window
        Moving average before the car. sayers: slope over the whole number of samples nearest to the
        length, equal spacing only; centred: mean of the samples within half a length; exact: mean
        of the straight lines between the samples; none: for profiles that are smoothed already.
    window_length
        Length of the moving average [m].
    start
        Slope with which the car starts. 11m: chord of the first 11 m as in the program; 0.5s: chord
        of the first half second (11.11 m); level: 0.
    restart
        Start the car again in every segment, instead of one run over the whole profile.
    wheel_paths
        Names of the left and the right track; by default both of two tracks, or of more those that
        are named left and right.
    json
        Print one JSON document instead of tables. One file gives {"file", "tracks": [{"name",
        "iri", "segments": [{"start", "end", "iri"}]}], "mri", "hri"}, several files a list of
        these; stations are in m, indices in m/km, mri and hri null without two wheel paths.
        --continuous adds "continuous", a list like "segments", to each track.
    """
    from trueterrain.roughness import IriOptions

    if step is not None and continuous is None:
        message = "--step belongs to --continuous, which is not given."
        raise ValueError(message)
    options = IriOptions(window=window, window_length=window_length, start=start, restart=restart)
    with compiling_noted():
        rated = [
            _rate(path, options, segment, continuous, 1.0 if step is None else step, wheel_paths)
            for path in (file, *more)
        ]
    if json:
        documents = [document for document, _ in rated]
        out_json(documents if more else documents[0])
        return
    for document, index in rated:
        _show(document, index)
    _explain(options)


def _rate(
    path: Path,
    options: "IriOptions",
    segment: float,
    continuous: float | None,
    step: float,
    wheel_paths: tuple[str, str] | None,
) -> "tuple[dict[str, Any], xr.Dataset]":
    from trueterrain import roughness

    profile = _read(path)
    with concerning(path):
        index = roughness.iri(profile, options=options, segment=segment, wheel_paths=wheel_paths)
        document = _document(path, index)
        if continuous is not None:
            sliding = roughness.continuous_iri(profile, continuous, step=step, options=options)
            for track, values in zip(document["tracks"], sliding["iri"].values, strict=True):
                track["continuous"] = _stretches(sliding, values)
    return document, index


def _read(path: Path) -> "xr.Dataset":
    from trueterrain import formats
    from trueterrain.kinds import kind_of

    refuse_recording(path, formats.kind_of_file(path), "a profile")
    data = formats.open(path)
    kind = kind_of(data)
    if kind != "profile":
        found = "is a surface" if kind == "surface" else "holds points"
        raise SchemaError(
            f"{found}, not a profile",
            path=path,
            cure=f"Extract a profile first: trueterrain profile {path} ... -o FILE.erd",
        )
    return data


def _document(path: Path, index: "xr.Dataset") -> dict[str, Any]:
    tracks = [
        {"name": str(name), "iri": float(whole), "segments": _stretches(index, parts)}
        for name, whole, parts in zip(
            index["track"].values, index["iri"].values, index["segment_iri"].values, strict=True
        )
    ]
    mri, hri = index["mri"].item(), index["hri"].item()
    return {"file": str(path), "tracks": tracks, "mri": mri, "hri": hri}


def _stretches(index: "xr.Dataset", values: Any) -> list[dict[str, float]]:
    starts, ends = index["start"].values, index["end"].values
    return [
        {"start": float(start), "end": float(end), "iri": float(value)}
        for start, end, value in zip(starts, ends, values, strict=True)
    ]


def _show(document: dict[str, Any], index: "xr.Dataset") -> None:
    tracks = document["tracks"]
    rows = [["from [m]", "to [m]", *(f"{track['name']} [m/km]" for track in tracks)]]
    for row, complete in enumerate(index["complete"].values):
        stretch = tracks[0]["segments"][row]
        ends = [f"{stretch['start']:.2f}", f"{stretch['end']:.2f}"]
        values = [f"{track['segments'][row]['iri']:.3f}" for track in tracks]
        rows.append([*ends, *values, *([] if complete else ["shorter"])])
    rows.append(["whole", "", *(f"{track['iri']:.3f}" for track in tracks)])
    out(f"International Roughness Index of {document['file']}")
    _write_table(rows)
    for track in tracks:
        if windows := track.get("continuous"):
            worst = max(windows, key=lambda window: float(window["iri"]))
            place = f"{worst['start']:.2f} to {worst['end']:.2f} m"
            out(f"Roughest window of {track['name']}: {worst['iri']:.3f} m/km, {place}")
    for name, meaning in (("mri", "mean of the IRI"), ("hri", "IRI of the mean")):
        if not math.isnan(document[name]):
            out(f"{name.upper()} {document[name]:.3f} m/km ({meaning} of both wheel paths)")
    length = float(index["end"][-1] - index["start"][0])
    if length < _SHORT:
        out(f"Only {length:g} m long: the index depends on how the car starts.")
    out()


def _write_table(rows: list[list[str]]) -> None:
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    for row in rows:
        cells = [cell.rjust(width) for cell, width in zip(row, widths, strict=False)]
        out("  ".join([*cells, *row[len(widths) :]]))


def _explain(options: "IriOptions") -> None:
    """Name the conventions, since they change the index."""
    length = "" if options.window == "none" else f" ({options.window_length:g} m)"
    start = {"11m": "first 11 m", "0.5s": "first 0.5 s", "level": "level"}[options.start]
    run = "a new car in every segment" if options.restart else "one run over the whole profile"
    speed = 3.6 * options.speed
    out(f"Golden car at {speed:g} km/h; window {options.window}{length}; start {start}; {run}.")
