"""The command ``trueterrain evenness``: wavebands and rolling straightedge."""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import xarray as xr
from cyclopts import Parameter

from trueterrain import roughness
from trueterrain.cli._console import write_json, write_line
from trueterrain.cli._profiles import (
    check_picture,
    draw_panels,
    read_profile,
    worst_stretches,
    write_table,
    write_warning,
)
from trueterrain.core.errors import name_file_in_errors
from trueterrain.roughness import WAVEBANDS, Butterworth, Filter

_MM = 1000.0
_MAX_THRESHOLD = 0.5  # [m] no road deviates as much; a larger value is probably in mm


@dataclass(frozen=True, kw_only=True)
class _EvennessRequest:
    """What is rated and marked."""

    segment: float = 100.0
    "Length of the fixed segments [m]; the last one may be shorter."

    straightedge: float = 3.0
    """Distance between the wheels of the straightedge [m]. 3.048 m (10 ft) and 4.877 m (16 ft) are
    also in use."""

    threshold: float | None = None
    """Maximum allowed deviation above or below the beam [m], e.g. 0.004; stretches that exceed it
    are listed."""

    band: Annotated[list[tuple[str, float, float]] | None, Parameter(show_default=False)] = None
    """Name, shortest and longest wavelength [m] of a band, instead of the three above; may be given
    several times."""

    def __post_init__(self) -> None:
        threshold, names = self.threshold, [name for name, _, _ in self.band or ()]
        if threshold is not None and not 0 < threshold < _MAX_THRESHOLD:
            rule = f"greater than 0 and less than {_MAX_THRESHOLD:g} m"
            cure = f"; {threshold:g} mm are {threshold / _MM:g}" if threshold > 0 else ""
            message = f"--threshold must be {rule}, got {threshold:g}{cure}."
            raise ValueError(message)
        if len(set(names)) < len(names):
            message = f"--band must give each name once, got {', '.join(names)}."
            raise ValueError(message)
        self.bands()

    def bands(self) -> Mapping[str, Filter]:
        """Filters of the bands by name."""
        if not self.band:
            return WAVEBANDS
        return {name: Butterworth(shortest=low, longest=high) for name, low, high in self.band}


def evenness(
    file: Path,
    /,
    *more: Path,
    request: Annotated[_EvennessRequest, Parameter(name="*")] = _EvennessRequest(),
    json: bool = False,
    plot: Path | None = None,
    force: bool = False,
) -> None:
    """Evenness of profiles: RMS in bands of wavelength, and deviation from a rolling straightedge.

    Each track is rated as a whole and in fixed segments. The bands are short (0.707 to 2.828 m),
    medium (2.828 to 11.312 m) and long (11.312 to 45.248 m), in the style of EN 13036-5. The
    straightedge is a beam on two wheels, one at each end; the deviation is the height of the ground
    above its midpoint. None of this was checked against the texts of the standards.

    Example: trueterrain evenness left_and_right.erd --threshold 0.004 --plot evenness.svg

    Parameters
    ----------
    file
        Profile: ERD, CSV or Parquet; equally spaced.
    more
        More profiles.
    json
        Print one JSON document instead of tables. One file gives {"file", "bands": [{"name",
        "shortest", "longest"}], "straightedge", "tracks": [{"name", "rms": {BAND: ...},
        "deviation": {"p95", "peak", "peak_at"}, "segments": [{"start", "end", "rms",
        "deviation"}]}]}, several files a list of these; all values are in m. p95 is the 95 %
        quantile of the magnitude, peak is positive above the beam; a value is null if the profile
        is too short or too coarse for it. --threshold adds to each track "beyond", the length
        beyond it, and "stretches": [{"start", "end", "peak", "peak_at"}].
    plot
        Picture to write: .svg, .pdf or .png. Deviation along the road and RMS of the segments, of
        each file.
    force
        Replace the picture if it exists.
    """
    files = (file, *more)
    check_picture(plot, force=force, inputs=files)
    rated = [_rate_file(path, request) for path in files]
    documents = [_json_document(one, request) for one in rated]
    if json:
        write_json(documents if more else documents[0])
    else:
        for one, document in zip(rated, documents, strict=True):
            _print_result(one, document, request)
        _print_conventions(request)
    if plot is not None:
        panels = [_picture_panels(one, request) for one in rated]
        draw_panels([path.name for path in files], panels, plot, force=force)


@dataclass(frozen=True)
class _EvennessResult:
    """Results for one file."""

    path: Path
    waves: xr.Dataset
    beam: xr.Dataset
    beyond: xr.Dataset | None


def _rate_file(path: Path, request: _EvennessRequest) -> _EvennessResult:
    profile = read_profile(path)
    with name_file_in_errors(path):
        beam = roughness.rolling_straightedge(profile, request.straightedge)
        bands = _resolved_bands(path, profile, request.bands())
        waves = roughness.waveband_rms(profile, bands=bands, segment=request.segment)
        beyond = None
        if request.threshold is not None:
            beyond = roughness.find_stretches(abs(beam["deviation"]), request.threshold)
    return _EvennessResult(path, waves, beam, beyond)


def _resolved_bands(
    path: Path, profile: xr.Dataset, bands: Mapping[str, Filter]
) -> Mapping[str, Filter]:
    """Bands that the profile resolves, with a warning for each other band."""
    s = profile["s"].values
    length = float(s[-1] - s[0])
    spacing = length / (s.size - 1)
    flags = {}
    for name, band in bands.items():
        if band.longest is not None and band.longest > length:
            flags[name] = (
                f"the profile is {length:g} m long, its waves are up to {band.longest:g} m"
            )
        elif band.shortest is not None and band.shortest <= 2 * spacing:
            flags[name] = (
                f"its waves of {band.shortest:g} m need a spacing below {0.5 * band.shortest:g} m, "
                f"got {spacing:.4g} m"
            )
    if len(flags) == len(bands):
        return bands  # waveband_rms raises the error
    for name, flag in flags.items():
        write_warning(f"{path}: band {name} is left out: {flag}.")
    return {name: band for name, band in bands.items() if name not in flags}


def _json_document(rated: _EvennessResult, request: _EvennessRequest) -> dict[str, Any]:
    tracks = []
    for name in rated.waves["track"].values:
        waves, deviation = rated.waves.sel(track=name), rated.beam["deviation"].sel(track=name)
        track: dict[str, Any] = {
            "name": str(name),
            "rms": _band_rms(waves["rms"], request),
            "deviation": _deviation_values(deviation),
            "segments": list(_segment_values(waves, deviation, request)),
        }
        if rated.beyond is not None:
            found = _track_stretches(rated.beyond, str(name), deviation)
            track["beyond"] = sum(one["end"] - one["start"] for one in found)
            track["stretches"] = found
        tracks.append(track)
    bands = [
        {"name": name, "shortest": band.shortest, "longest": band.longest}
        for name, band in request.bands().items()
    ]
    return {
        "file": str(rated.path),
        "bands": bands,
        "straightedge": request.straightedge,
        "tracks": tracks,
    }


def _band_rms(values: xr.DataArray, request: _EvennessRequest) -> dict[str, float]:
    """RMS of each requested band [m]; NaN for those left out."""
    known = dict(zip(values["band"].values.tolist(), values.values.tolist(), strict=True))
    return {name: known.get(name, math.nan) for name in request.bands()}


def _segment_values(
    waves: xr.Dataset, deviation: xr.DataArray, request: _EvennessRequest
) -> Iterator[dict[str, Any]]:

    start, end = waves["start"].values, waves["end"].values
    rounding = 1e-9 * float(
        end[-1] - start[0]
    )  # [m] a sample at a boundary belongs to the next segment
    first = np.searchsorted(deviation["s"].values, start - rounding)
    stop_at = np.append(first[1:], deviation.size)
    for at, (begin, stop) in enumerate(zip(first, stop_at, strict=True)):
        yield {
            "start": float(start[at]),
            "end": float(end[at]),
            "rms": _band_rms(waves["segment_rms"].isel(segment=at), request),
            "deviation": _deviation_values(deviation[begin:stop]),
        }


def _deviation_values(deviation: xr.DataArray) -> dict[str, float]:
    """95 % quantile of the magnitude, peak and its station [m]; NaN for an empty segment."""
    if deviation.size == 0:
        return {"p95": math.nan, "peak": math.nan, "peak_at": math.nan}
    magnitude = np.abs(deviation.values)
    at = int(magnitude.argmax())
    return {
        "p95": float(np.quantile(magnitude, 0.95)),
        "peak": float(deviation[at]),
        "peak_at": float(deviation["s"][at]),
    }


def _track_stretches(
    found: xr.Dataset, track: str, deviation: xr.DataArray
) -> list[dict[str, float]]:
    """Stretches of a track; peaks have their sign."""
    own = found.isel(stretch=found["track"].values == track)
    ends = zip(*(own[name].values.tolist() for name in ("start", "end", "peak_at")), strict=True)
    return [
        {"start": start, "end": end, "peak": deviation.sel(s=at).item(), "peak_at": at}
        for start, end, at in ends
    ]


def _print_result(
    rated: _EvennessResult, document: dict[str, Any], request: _EvennessRequest
) -> None:
    names = [f"{name} [mm]" for name in request.bands()]
    rows = [["track", "from [m]", "to [m]", *names, "95 % [mm]", "peak [mm]", "at [m]"]]
    complete = rated.waves["complete"].values
    for track in document["tracks"]:
        for piece, whole in zip(track["segments"], complete, strict=True):
            ends = [f"{piece['start']:.2f}", f"{piece['end']:.2f}"]
            rows.append(
                [track["name"], *ends, *_table_cells(piece), *([] if whole else ["shorter"])]
            )
        rows.append([track["name"], "whole", "", *_table_cells(track)])
    write_line(f"Evenness of {document['file']}")
    write_table(rows)
    if request.threshold is not None:
        length = float(rated.beam["s"][-1] - rated.beam["s"][0])
        for track in document["tracks"]:
            _show_stretches(track, _MM * request.threshold, length)
    write_line()


def _table_cells(rated: dict[str, Any]) -> list[str]:
    found = rated["deviation"]
    values = [*(f"{_MM * value:.2f}" for value in rated["rms"].values())]
    values += [
        f"{_MM * found['p95']:.2f}",
        f"{round(_MM * found['peak'], 2) + 0.0:+.2f}",
        f"{found['peak_at']:.2f}",
    ]
    return ["-" if "nan" in value else value for value in values]


def _show_stretches(track: dict[str, Any], threshold: float, length: float) -> None:
    found = track["stretches"]
    total = f"{track['beyond']:.2f} of {length:.2f} m"
    write_line(f"Stretches of {track['name']} beyond {threshold:g} mm: {len(found)}, {total}")
    shown, others = worst_stretches(found)
    for one in shown:
        side = "above" if one["peak"] > 0 else "below"
        peak = f"{_MM * abs(one['peak']):.2f} mm {side} the beam at {one['peak_at']:.2f} m"
        write_line(f"  {one['start']:.2f} to {one['end']:.2f} m, up to {peak}")
    if others:
        write_line(others)


def _print_conventions(request: _EvennessRequest) -> None:
    """Print the conventions: they change the numbers."""
    edges = [
        f"{name} {band.shortest:g} to {band.longest:g} m" for name, band in request.bands().items()
    ]
    write_line(f"RMS in bands: {', '.join(edges)}; Butterworth, half of the power at the edges.")
    write_line(
        "Nearer to an end than the longest wave of a band, RMS depends on the road beyond that end."
    )
    write_line(
        f"95 % and peak: ground above (+) or below (-) the midpoint of a beam of "
        f"{request.straightedge:g} m on two wheels."
    )
    write_line("Bands, filter and straightedge were not checked against the texts of EN 13036.")


def _picture_panels(
    rated: _EvennessResult, request: _EvennessRequest
) -> list[Callable[[Any], object]]:
    """Panels of a file: functions that draw into given axes."""
    from trueterrain import figures

    return [
        lambda ax: figures.straightedge_deviation(rated.beam, threshold=request.threshold, ax=ax),
        lambda ax: figures.waveband_segments(rated.waves, ax=ax),
    ]
