"""The command ``trueterrain rn``: Ride Number of profiles."""

import math
from pathlib import Path
from typing import Annotated, Any

import xarray as xr

from trueterrain import roughness
from trueterrain.cli._console import note_compilation, write_json, write_line
from trueterrain.cli._options import flatten_settings
from trueterrain.cli._profiles import (
    check_picture,
    draw_panels,
    explain_run,
    read_profile,
    warn_of_rating,
    write_table,
)
from trueterrain.core.errors import name_file_in_errors
from trueterrain.roughness import RideNumberSettings


def rn(
    file: Path,
    /,
    *more: Path,
    segment: float = 100.0,
    wheel_paths: tuple[str, str] | None = None,
    settings: Annotated[
        RideNumberSettings, flatten_settings("Conventions of the index", omit=["car"])
    ] = RideNumberSettings(),
    json: bool = False,
    plot: Path | None = None,
    force: bool = False,
) -> None:
    """Ride Number (RN) of profiles, from 0 (impassable) to 5 (perfectly smooth), after ASTM E1489.

    Each track is rated as a whole and in fixed segments, and two wheel paths together. The
    constants were not checked against the text of the standard.

    Example: trueterrain rn left_and_right.erd --segment 50 --json

    Parameters
    ----------
    file
        Profile: ERD, CSV or Parquet.
    more
        More profiles.
    segment
        Length of the fixed segments [m]; the last one may be shorter.
    wheel_paths
        Names of the left and the right track; by default both of two tracks, or of more those that
        are named left and right.
    json
        Print one JSON document instead of tables. One file gives {"file", "tracks": [{"name", "rn",
        "pi", "segments": [{"start", "end", "rn", "pi"}]}], "rn", "segments": [{"start", "end",
        "rn"}]}, several files a list of these; the last two are for both wheel paths together, null
        and empty without them. Stations are in m, the profile index pi in m/m.
    plot
        Picture to write: .svg, .pdf or .png.
    force
        Replace the picture if it exists.
    """
    files = (file, *more)
    check_picture(plot, force=force, inputs=files)
    with note_compilation():
        rated = [_rate_file(path, settings, segment, wheel_paths) for path in files]
    documents = [_json_document(path, one) for path, one in zip(files, rated, strict=True)]
    if json:
        write_json(documents if more else documents[0])
    else:
        for one, document in zip(rated, documents, strict=True):
            _print_result(one, document)
        start = f"first {settings.start_length:g} m"
        write_line(f"Car of the Ride Number {explain_run(settings, start)}")
        write_line("The constants were not checked against the text of ASTM E1489.")
    if plot is not None:
        from trueterrain import figures

        panels = [[lambda ax, one=one: figures.ride_number_segments(one, ax=ax)] for one in rated]
        draw_panels([path.name for path in files], panels, plot, force=force)


def _rate_file(
    path: Path,
    settings: RideNumberSettings,
    segment: float,
    wheel_paths: tuple[str, str] | None,
) -> xr.Dataset:
    profile = read_profile(path)
    warn_of_rating(path, profile, settings)
    with name_file_in_errors(path):
        return roughness.ride_number(
            profile, settings=settings, segment=segment, wheel_paths=wheel_paths
        )


def _json_document(path: Path, rated: xr.Dataset) -> dict[str, Any]:
    starts, ends = rated["start"].values.tolist(), rated["end"].values.tolist()
    tracks = []
    for name in rated["track"].values:
        one = rated.sel(track=name)
        values = zip(
            starts,
            ends,
            one["segment_rn"].values.tolist(),
            one["segment_pi"].values.tolist(),
            strict=True,
        )
        pieces = [{"start": a, "end": b, "rn": rn, "pi": pi} for a, b, rn, pi in values]
        whole = {"name": str(name), "rn": one["rn"].item(), "pi": one["pi"].item()}
        tracks.append(whole | {"segments": pieces})
    both = rated["rn_both"].item()
    together = zip(starts, ends, rated["segment_rn_both"].values.tolist(), strict=True)
    pieces = [{"start": a, "end": b, "rn": rn} for a, b, rn in together]
    segments = [] if math.isnan(both) else pieces
    return {"file": str(path), "tracks": tracks, "rn": both, "segments": segments}


def _print_result(rated: xr.Dataset, document: dict[str, Any]) -> None:
    tracks, both = document["tracks"], document["segments"]
    names = [track["name"] for track in tracks] + (["both"] if both else [])
    rows = [["from [m]", "to [m]", *names]]
    for row, complete in enumerate(rated["complete"].values):
        pieces = [track["segments"][row] for track in tracks] + both[row : row + 1]
        ends = [f"{pieces[0]['start']:.2f}", f"{pieces[0]['end']:.2f}"]
        values = [f"{piece['rn']:.2f}" for piece in pieces]
        rows.append([*ends, *values, *([] if complete else ["shorter"])])
    whole = [track["rn"] for track in tracks] + ([document["rn"]] if both else [])
    rows.append(["whole", "", *(f"{value:.2f}" for value in whole)])
    write_line(f"Ride Number of {document['file']}")
    write_table(rows)
    write_line()
