"""The command ``trueterrain psd``: power spectral density and road class of profiles."""

from pathlib import Path
from typing import Annotated, Any

import xarray as xr

from trueterrain import roughness
from trueterrain.cli._console import write_json, write_line
from trueterrain.cli._options import flatten_settings
from trueterrain.cli._profiles import check_picture, draw_panels, read_profile, write_table
from trueterrain.core.errors import name_file_in_errors
from trueterrain.roughness import PsdSettings

_MICRO = 1e6
_HEIGHT = 5.0  # [inches] of the picture of one file


def psd(
    file: Path,
    /,
    *more: Path,
    segment: float | None = None,
    settings: Annotated[PsdSettings, flatten_settings("Spectrum and its fit")] = PsdSettings(),
    json: bool = False,
    plot: Path | None = None,
    force: bool = False,
) -> None:
    """Power spectral density (PSD) of profiles, smoothed and classed as in ISO 8608.

    Gd(n0) is the displacement PSD at 0.1 cycles/m, the waviness w the exponent of its decrease with
    spatial frequency. Both are given with confidence intervals.

    Example: trueterrain psd road.erd --segment 500 --plot spectrum.svg

    Parameters
    ----------
    file
        Profile: ERD, CSV or Parquet; equally spaced.
    more
        More profiles.
    segment
        Length of fixed segments that are also rated separately [m]; none by default.
    json
        Print one JSON document instead of tables. One file gives {"file", "tracks": [{"name",
        "road_class", "gd_n0", "waviness", "segments": [{"start", "end", "road_class", "gd_n0",
        "waviness"}], "bands": [{"lower", "centre", "upper", "density", "low", "high", "fitted"}]}],
        "confidence"}, several files a list of these. gd_n0 and waviness are {"value", "low",
        "high"}; densities and Gd(n0) are in m³, frequencies in cycles/m, stations in m.
    plot
        Picture to write: .svg, .pdf or .png.
    force
        Replace the picture if it exists.
    """
    files = (file, *more)
    check_picture(plot, force=force, inputs=files)
    spectra = [_compute_psd(path, settings, segment) for path in files]
    documents = [
        _json_document(path, one, settings) for path, one in zip(files, spectra, strict=True)
    ]
    if json:
        write_json(documents if more else documents[0])
    else:
        for document in documents:
            _print_result(document)
        write_line(
            f"Fitted from {settings.lowest:g} to {settings.highest:g} cycles/m; blocks of "
            f"{settings.block:g} m; intervals of {100 * settings.confidence:g} % confidence."
        )
    if plot is not None:
        from trueterrain import figures

        panels = [[lambda ax, one=one: figures.road_spectrum(one, ax=ax)] for one in spectra]
        draw_panels([path.name for path in files], panels, plot, force=force, height=_HEIGHT)


def _compute_psd(path: Path, settings: PsdSettings, segment: float | None) -> xr.Dataset:
    profile = read_profile(path)
    with name_file_in_errors(path):
        return roughness.psd(profile, settings=settings, segment=segment)


def _json_document(path: Path, spectrum: xr.Dataset, settings: PsdSettings) -> dict[str, Any]:
    tracks = []
    for name in spectrum["track"].values:
        one = spectrum.sel(track=name)
        segments = []
        for at in range(one.sizes.get("segment", 0)):
            piece = one.isel(segment=at)
            ends = {"start": piece["start"].item(), "end": piece["end"].item()}
            segments.append(ends | _fit_values(piece, "segment_"))
        whole = {
            "name": str(name),
            **_fit_values(one, ""),
            "segments": segments,
            "bands": _band_values(one),
        }
        tracks.append(whole)
    return {"file": str(path), "tracks": tracks, "confidence": settings.confidence}


def _fit_values(one: xr.Dataset, prefix: str) -> dict[str, Any]:
    fitted: dict[str, Any] = {"road_class": one[f"{prefix}road_class"].item()}
    for name in ("gd_n0", "waviness"):
        ends = {end: one[f"{prefix}{name}_{end}"].item() for end in ("low", "high")}
        fitted[name] = {"value": one[f"{prefix}{name}"].item(), **ends}
    return fitted


def _band_values(one: xr.Dataset) -> list[dict[str, Any]]:
    columns = {
        "lower": "lower",
        "centre": "centre",
        "upper": "upper",
        "density": "smoothed",
        "low": "smoothed_low",
        "high": "smoothed_high",
        "fitted": "fitted",
    }
    values = zip(*(one[name].values.tolist() for name in columns.values()), strict=True)
    return [dict(zip(columns, row, strict=True)) for row in values]


def _print_result(document: dict[str, Any]) -> None:
    rows = [["track", "from [m]", "to [m]", "class", "Gd(n0) [1e-6 m³]", "w"]]
    for track in document["tracks"]:
        for piece in track["segments"]:
            ends = [f"{piece['start']:.2f}", f"{piece['end']:.2f}"]
            rows.append([track["name"], *ends, *_table_cells(piece)])
        rows.append([track["name"], "whole", "", *_table_cells(track)])
    write_line(f"Displacement spectrum of {document['file']}")
    write_table(rows)
    write_line()


def _table_cells(fit: dict[str, Any]) -> list[str]:
    """Class, Gd(n0) and waviness; dashes if the segment is too short."""
    gd, w = fit["gd_n0"], fit["waviness"]
    if not fit["road_class"]:
        return ["-", "too short", "-"]
    low, value, high = (_MICRO * gd[name] for name in ("low", "value", "high"))
    return [
        fit["road_class"],
        f"{value:.4g} ({low:.4g} to {high:.4g})",
        f"{w['value']:.2f} ({w['low']:.2f} to {w['high']:.2f})",
    ]
