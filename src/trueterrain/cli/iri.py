"""The command ``trueterrain iri``: International Roughness Index of profiles."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import xarray as xr
from cyclopts import Parameter

from trueterrain import roughness
from trueterrain.cli._console import note_compilation, write_json, write_line
from trueterrain.cli._options import flatten_settings
from trueterrain.cli._profiles import (
    check_picture,
    draw_panels,
    explain_run,
    read_profile,
    warn_of_rating,
    worst_stretches,
    write_table,
)
from trueterrain.core.errors import name_file_in_errors
from trueterrain.roughness import IN_PER_MI, IriSettings

_MAX_CLASSES = 1000  # of a histogram; more is a mistake in the width

# [m] below this length the initial state of the car affects the index (10 % and more at 91 m)
_MIN_LENGTH = 100.0

_STARTS = {"11m": "first 11 m", "0.5s": "first 0.5 s", "level": "level"}


@dataclass(frozen=True, kw_only=True)
class _IriRequest:
    """What is rated and marked."""

    segment: float = 100.0
    "Length of the fixed segments [m]; the last one may be shorter."

    continuous: float | None = None
    """Length of a window that slides along each track [m]; none by default. 7.62 m (25 ft) and
    160.93 m (528 ft) are common."""

    step: float | None = None
    "Distance from one sliding window to the next [m]; by default 1."

    threshold: float | None = None
    """Maximum allowed IRI, in --unit: segments above it are marked, and with --continuous the
    stretches above it are listed."""

    histogram: float | None = None
    """Width of the classes of a histogram of the IRI, in --unit; the fraction of the length in each
    class is printed."""

    unit: Literal["m/km", "in/mi"] = "m/km"
    "Unit of the IRI; 1 m/km is 63.36 in/mi. Lengths are in metres with either."

    wheel_paths: tuple[str, str] | None = None
    """Names of the left and the right track; by default both of two tracks, or of more those that
    are named left and right."""

    def __post_init__(self) -> None:
        if self.step is not None and self.continuous is None:
            message = "--step needs --continuous, which is not given."
            raise ValueError(message)
        for name, value in (("--threshold", self.threshold), ("--histogram", self.histogram)):
            if value is not None and not value > 0:
                message = f"{name} must be finite and greater than 0 {self.unit}, got {value}."
                raise ValueError(message)

    @property
    def factor(self) -> float:
        """1 m/km in the unit."""
        return 1.0 if self.unit == "m/km" else IN_PER_MI

    @property
    def limit(self) -> float | None:
        """Threshold [m/km]."""
        return None if self.threshold is None else self.threshold / self.factor


def iri(
    file: Path,
    /,
    *more: Path,
    request: Annotated[_IriRequest, Parameter(name="*")] = _IriRequest(),
    settings: Annotated[
        IriSettings, flatten_settings("Conventions of the index", omit=["car"])
    ] = IriSettings(),
    json: bool = False,
    plot: Path | None = None,
    force: bool = False,
) -> None:
    """International Roughness Index (IRI) of profiles, as by Sayers's program (ASTM E1926).

    Each track is rated as a whole and in fixed segments. For two wheel paths, MRI is the mean of
    their IRI, HRI the IRI of their mean profile. --continuous with --threshold lists localised
    roughness: the stretches in which the IRI of a sliding window exceeds the threshold.

    Example: trueterrain iri left_and_right.erd --continuous 7.62 --threshold 2.5 --json

    Parameters
    ----------
    file
        Profile: ERD, CSV or Parquet.
    more
        More profiles.
    json
        Print one JSON document instead of tables. One file gives {"file", "tracks": [{"name",
        "iri", "segments": [{"start", "end", "iri"}]}], "mri", "hri", "unit"}, several files a list
        of these; stations are in m, indices in the unit, mri and hri null without two wheel paths.
        --continuous adds "continuous", a list like "segments", to each track, --threshold
        "too_rough", the length of the segments above it [m], and both together "stretches":
        [{"start", "end", "peak", "peak_at"}]; --histogram adds "histogram": [{"above", "below",
        "length", "share"}].
    plot
        Picture to write: .svg, .pdf or .png. Segments, the sliding window and the histogram of each
        file, always in m/km.
    force
        Replace the picture if it exists.
    """
    files = (file, *more)
    check_picture(plot, force=force, inputs=files)
    with note_compilation():
        rated = [_rate_file(path, settings, request) for path in files]
    documents = [_json_document(one, request) for one in rated]
    if json:
        write_json(documents if more else documents[0])
    else:
        for one, document in zip(rated, documents, strict=True):
            _print_result(one, document, request)
        write_line(f"Golden car {explain_run(settings, _STARTS[settings.start])}")
    if plot is not None:
        panels = [_picture_panels(one, request) for one in rated]
        draw_panels([path.name for path in files], panels, plot, force=force)


@dataclass(frozen=True)
class _IriResult:
    """Results for one file."""

    path: Path
    index: xr.Dataset
    sliding: xr.Dataset | None
    too_rough: xr.Dataset | None
    histogram: xr.Dataset | None


def _rate_file(path: Path, settings: IriSettings, request: _IriRequest) -> _IriResult:
    profile = read_profile(path)
    warn_of_rating(path, profile, settings)
    sliding = too_rough = histogram = None
    with name_file_in_errors(path):
        index = roughness.iri(
            profile, settings=settings, segment=request.segment, wheel_paths=request.wheel_paths
        )
        if request.continuous is not None:
            step = 1.0 if request.step is None else request.step
            sliding = roughness.continuous_iri(
                profile, request.continuous, step=step, settings=settings
            )
            if request.limit is not None:
                too_rough = roughness.find_stretches(sliding["iri"], request.limit)
        if request.histogram is not None:
            histogram = _iri_histogram(index, request.histogram / request.factor)
    return _IriResult(path, index, sliding, too_rough, histogram)


def _iri_histogram(index: xr.Dataset, width: float) -> xr.Dataset:
    count = math.floor(float(index["segment_iri"].max()) / width) + 1
    if count > _MAX_CLASSES:
        message = f"--histogram must leave at most {_MAX_CLASSES} classes, got {count}."
        raise ValueError(message)
    edges = [width * number for number in range(1, count + 1)]
    return roughness.iri_histogram(index, edges).isel({"class": slice(0, count)})


def _json_document(rated: _IriResult, request: _IriRequest) -> dict[str, Any]:
    index, factor = rated.index, request.factor
    tracks = []
    for name in index["track"].values:
        one = index.sel(track=name)
        track = {
            "name": str(name),
            "iri": factor * one["iri"].item(),
            "segments": _segment_values(index, factor * one["segment_iri"].values),
        }
        if rated.sliding is not None:
            values = factor * rated.sliding["iri"].sel(track=name).values
            track["continuous"] = _segment_values(rated.sliding, values)
        if request.limit is not None:
            above = one["segment_iri"].values > request.limit
            track["too_rough"] = float((index["end"] - index["start"]).values[above].sum())
        if rated.too_rough is not None:
            track["stretches"] = _track_stretches(rated.too_rough, str(name), factor)
        if rated.histogram is not None:
            track["histogram"] = _histogram_classes(rated.histogram.sel(track=name), factor)
        tracks.append(track)
    return {
        "file": str(rated.path),
        "tracks": tracks,
        "mri": factor * index["mri"].item(),
        "hri": factor * index["hri"].item(),
        "unit": request.unit,
    }


def _segment_values(index: xr.Dataset, values: Any) -> list[dict[str, float]]:
    starts, ends = index["start"].values, index["end"].values
    return [
        {"start": float(start), "end": float(end), "iri": float(value)}
        for start, end, value in zip(starts, ends, values, strict=True)
    ]


def _track_stretches(found: xr.Dataset, track: str, factor: float) -> list[dict[str, float]]:
    own = found.isel(stretch=found["track"].values == track)
    return [
        {"start": start, "end": end, "peak": factor * peak, "peak_at": at}
        for start, end, peak, at in zip(
            *(own[name].values.tolist() for name in ("start", "end", "peak", "peak_at")),
            strict=True,
        )
    ]


def _histogram_classes(histogram: xr.Dataset, factor: float) -> list[dict[str, float]]:
    columns = (histogram[name].values.tolist() for name in ("above", "below", "length", "fraction"))
    return [
        {"above": factor * above, "below": factor * below, "length": length, "share": fraction}
        for above, below, length, fraction in zip(*columns, strict=True)
    ]


def _print_result(rated: _IriResult, document: dict[str, Any], request: _IriRequest) -> None:
    tracks, unit, index = document["tracks"], request.unit, rated.index
    digits = 3 if unit == "m/km" else 1
    rows = [["from [m]", "to [m]", *(f"{track['name']} [{unit}]" for track in tracks)]]
    for row, complete in enumerate(index["complete"].values):
        piece = tracks[0]["segments"][row]
        values = [track["segments"][row]["iri"] for track in tracks]
        remarks = [] if complete else ["shorter"]
        if request.threshold is not None and max(values) > request.threshold:
            remarks.append("too rough")
        ends = [f"{piece['start']:.2f}", f"{piece['end']:.2f}"]
        rows.append([*ends, *(f"{value:.{digits}f}" for value in values), *remarks])
    rows.append(["whole", "", *(f"{track['iri']:.{digits}f}" for track in tracks)])
    write_line(f"International Roughness Index of {document['file']}")
    write_table(rows)
    length = float(index["end"][-1] - index["start"][0])
    for track in tracks:
        _show_track(track, request, length, digits)
    if request.histogram is not None:
        _show_histogram(tracks, unit)
    for name, meaning in (("mri", "mean of the IRI"), ("hri", "IRI of the mean")):
        if not math.isnan(document[name]):
            value = f"{document[name]:.{digits}f} {unit}"
            write_line(f"{name.upper()} {value} ({meaning} of both wheel paths)")
    if length < _MIN_LENGTH:
        write_line(f"Only {length:g} m long: the index depends on the initial state of the car.")
    write_line()


def _show_track(track: dict[str, Any], request: _IriRequest, length: float, digits: int) -> None:
    """Print roughest window, rough segments and stretches of one track."""
    name, unit = track["name"], request.unit
    if windows := track.get("continuous"):
        worst = max(windows, key=lambda window: float(window["iri"]))
        place = f"{worst['start']:.2f} to {worst['end']:.2f} m"
        write_line(f"Roughest window of {name}: {worst['iri']:.{digits}f} {unit}, {place}")
    if request.threshold is not None:
        limit = f"{request.threshold:g} {unit}"
        write_line(f"Segments of {name} above {limit}: {track['too_rough']:.2f} of {length:.2f} m")
        if (found := track.get("stretches")) is not None:
            write_line(f"Stretches of {name} above {limit}: {len(found)}")
        shown, others = worst_stretches(found or ())
        for one in shown:
            peak = f"{one['peak']:.{digits}f} {unit} at {one['peak_at']:.2f} m"
            write_line(f"  {one['start']:.2f} to {one['end']:.2f} m, up to {peak}")
        if others:
            write_line(others)


def _show_histogram(tracks: list[dict[str, Any]], unit: str) -> None:
    """Print the fraction of the length of each track in the classes of the index."""
    rows = [[f"IRI [{unit}]", *(f"{track['name']} [%]" for track in tracks)]]
    for classes in zip(*(track["histogram"] for track in tracks), strict=True):
        name = f"{classes[0]['above']:.4g} to {classes[0]['below']:.4g}"
        rows.append([name, *(f"{100 * one['share']:.1f}" for one in classes)])
    write_table(rows)


def _picture_panels(rated: _IriResult, request: _IriRequest) -> list[Callable[[Any], object]]:
    """Panels of a file: functions that draw into given axes."""
    from trueterrain import figures

    def segments(ax: Any) -> None:
        figures.iri_segments(rated.index, ax=ax)
        if request.limit is not None:
            ax.axhline(request.limit, color="0.3", linewidth=1.0, linestyle="--")
            ax.set_ylim(top=max(ax.get_ylim()[1], 1.08 * request.limit))

    panels: list[Callable[[Any], object]] = [segments]
    if (sliding := rated.sliding) is not None:
        panels.append(
            lambda ax: figures.continuous_roughness(sliding, threshold=request.limit, ax=ax)
        )
    if (histogram := rated.histogram) is not None:
        panels.append(lambda ax: figures.roughness_histogram(histogram, ax=ax))
    return panels
