"""The command ``trueterrain iri``: International Roughness Index of profiles."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from trueterrain.cli._console import note_compilation, write_json, write_line
from trueterrain.cli._profiles import (
    Window,
    draw_panels,
    explain_run,
    read_profile,
    warn_of_rating,
    worst_stretches,
    write_table,
)
from trueterrain.core.errors import name_file_in_errors

if TYPE_CHECKING:
    import xarray as xr

    from trueterrain.roughness import IriSettings

Unit = Literal["m/km", "in/mi"]

_MAX_CLASSES = 1000  # of a histogram; more is a mistake in the width

# [m] below this length the initial state of the car affects the index (10 % and more at 91 m)
_MIN_LENGTH = 100.0


def iri(
    file: Path,
    /,
    *more: Path,
    segment: float = 100.0,
    continuous: float | None = None,
    step: float | None = None,
    threshold: float | None = None,
    histogram: float | None = None,
    unit: Unit = "m/km",
    window: Window = "sayers",
    window_length: float = 0.25,
    start: Literal["11m", "0.5s", "level"] = "11m",
    restart: bool = False,
    wheel_paths: tuple[str, str] | None = None,
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
    segment
        Length of the fixed segments [m]; the last one may be shorter.
    continuous
        Length of a window that slides along each track [m]; none by default. 7.62 m (25 ft) and
        160.93 m (528 ft) are common.
    step
        Distance from one sliding window to the next [m]; by default 1.
    threshold
        Maximum allowed IRI, in --unit: segments above it are marked, and with --continuous the
        stretches above it are listed.
    histogram
        Width of the classes of a histogram of the IRI, in --unit; the fraction of the length in
        each class is printed.
    unit
        Unit of the IRI; 1 m/km is 63.36 in/mi. Lengths are in metres with either.
    window
        Moving average before the car. sayers: slope over the whole number of samples nearest to the
        length, equal spacing only; centred: mean of the samples within half a length; exact: mean
        of the linearly interpolated profile; none: for profiles that are smoothed already.
    window_length
        Length of the moving average [m].
    start
        Initial slope of the car. 11m: chord of the first 11 m as in the program; 0.5s: chord of the
        first half second (11.11 m); level: 0.
    restart
        Start the car anew in each segment, instead of one run over the whole profile.
    wheel_paths
        Names of the left and the right track; by default both of two tracks, or of more those that
        are named left and right.
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
    from trueterrain import figures
    from trueterrain.roughness import IriSettings

    if step is not None and continuous is None:
        message = "--step needs --continuous, which is not given."
        raise ValueError(message)
    for name, value in (("--threshold", threshold), ("--histogram", histogram)):
        if value is not None and not (math.isfinite(value) and value > 0):
            message = f"{name} must be finite and greater than 0 {unit}, got {value}."
            raise ValueError(message)
    files = (file, *more)
    if plot is not None:
        figures.require_picture(plot, force=force, inputs=files)
    settings = IriSettings(window=window, window_length=window_length, start=start, restart=restart)
    wanted = _IriRequest(
        unit, segment, continuous, 1.0 if step is None else step, threshold, histogram
    )
    with note_compilation():
        rated = [_rate_file(path, settings, wanted, wheel_paths) for path in files]
    documents = [_json_document(one, wanted) for one in rated]
    if json:
        write_json(documents if more else documents[0])
    else:
        for one, document in zip(rated, documents, strict=True):
            _print_result(one, document, wanted)
        names = {"11m": "first 11 m", "0.5s": "first 0.5 s", "level": "level"}
        write_line(f"Golden car {explain_run(settings, names[start])}")
    if plot is not None:
        panels = [_picture_panels(one, wanted) for one in rated]
        draw_panels([path.name for path in files], panels, plot, force=force)


@dataclass(frozen=True)
class _IriRequest:
    """Settings of the command, besides the conventions of the index."""

    unit: Unit
    segment: float
    continuous: float | None
    step: float
    threshold: float | None  # in the unit
    histogram: float | None  # in the unit

    @property
    def factor(self) -> float:
        """1 m/km in the unit."""
        from trueterrain.roughness import IN_PER_MI

        return 1.0 if self.unit == "m/km" else IN_PER_MI

    @property
    def limit(self) -> float | None:
        """Threshold [m/km]."""
        return None if self.threshold is None else self.threshold / self.factor


@dataclass(frozen=True)
class _IriResult:
    """Results for one file."""

    path: Path
    index: "xr.Dataset"
    sliding: "xr.Dataset | None"
    too_rough: "xr.Dataset | None"
    histogram: "xr.Dataset | None"


def _rate_file(
    path: Path, settings: "IriSettings", wanted: _IriRequest, wheel_paths: tuple[str, str] | None
) -> _IriResult:
    from trueterrain import roughness

    profile = read_profile(path)
    warn_of_rating(path, profile, settings)
    sliding = too_rough = histogram = None
    with name_file_in_errors(path):
        index = roughness.iri(
            profile, settings=settings, segment=wanted.segment, wheel_paths=wheel_paths
        )
        if wanted.continuous is not None:
            sliding = roughness.continuous_iri(
                profile, wanted.continuous, step=wanted.step, settings=settings
            )
            if wanted.limit is not None:
                too_rough = roughness.find_stretches(sliding["iri"], wanted.limit)
        if wanted.histogram is not None:
            histogram = _iri_histogram(index, wanted.histogram / wanted.factor)
    return _IriResult(path, index, sliding, too_rough, histogram)


def _iri_histogram(index: "xr.Dataset", width: float) -> "xr.Dataset":
    from trueterrain import roughness

    count = math.floor(float(index["segment_iri"].max()) / width) + 1
    if count > _MAX_CLASSES:
        message = f"--histogram must leave at most {_MAX_CLASSES} classes, got {count}."
        raise ValueError(message)
    edges = [width * number for number in range(1, count + 1)]
    return roughness.iri_histogram(index, edges).isel({"class": slice(0, count)})


def _json_document(rated: _IriResult, wanted: _IriRequest) -> dict[str, Any]:
    index, factor = rated.index, wanted.factor
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
        if wanted.limit is not None:
            above = one["segment_iri"].values > wanted.limit
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
        "unit": wanted.unit,
    }


def _segment_values(index: "xr.Dataset", values: Any) -> list[dict[str, float]]:
    starts, ends = index["start"].values, index["end"].values
    return [
        {"start": float(start), "end": float(end), "iri": float(value)}
        for start, end, value in zip(starts, ends, values, strict=True)
    ]


def _track_stretches(found: "xr.Dataset", track: str, factor: float) -> list[dict[str, float]]:
    own = found.isel(stretch=found["track"].values == track)
    return [
        {"start": start, "end": end, "peak": factor * peak, "peak_at": at}
        for start, end, peak, at in zip(
            *(own[name].values.tolist() for name in ("start", "end", "peak", "peak_at")),
            strict=True,
        )
    ]


def _histogram_classes(histogram: "xr.Dataset", factor: float) -> list[dict[str, float]]:
    columns = (histogram[name].values.tolist() for name in ("above", "below", "length", "fraction"))
    return [
        {"above": factor * above, "below": factor * below, "length": length, "share": fraction}
        for above, below, length, fraction in zip(*columns, strict=True)
    ]


def _print_result(rated: _IriResult, document: dict[str, Any], wanted: _IriRequest) -> None:
    tracks, unit, index = document["tracks"], wanted.unit, rated.index
    digits = 3 if unit == "m/km" else 1
    rows = [["from [m]", "to [m]", *(f"{track['name']} [{unit}]" for track in tracks)]]
    for row, complete in enumerate(index["complete"].values):
        piece = tracks[0]["segments"][row]
        values = [track["segments"][row]["iri"] for track in tracks]
        remarks = [] if complete else ["shorter"]
        if wanted.threshold is not None and max(values) > wanted.threshold:
            remarks.append("too rough")
        ends = [f"{piece['start']:.2f}", f"{piece['end']:.2f}"]
        rows.append([*ends, *(f"{value:.{digits}f}" for value in values), *remarks])
    rows.append(["whole", "", *(f"{track['iri']:.{digits}f}" for track in tracks)])
    write_line(f"International Roughness Index of {document['file']}")
    write_table(rows)
    length = float(index["end"][-1] - index["start"][0])
    for track in tracks:
        _show_track(track, wanted, length, digits)
    if wanted.histogram is not None:
        _show_histogram(tracks, unit)
    for name, meaning in (("mri", "mean of the IRI"), ("hri", "IRI of the mean")):
        if not math.isnan(document[name]):
            value = f"{document[name]:.{digits}f} {unit}"
            write_line(f"{name.upper()} {value} ({meaning} of both wheel paths)")
    if length < _MIN_LENGTH:
        write_line(f"Only {length:g} m long: the index depends on the initial state of the car.")
    write_line()


def _show_track(track: dict[str, Any], wanted: _IriRequest, length: float, digits: int) -> None:
    """Print roughest window, rough segments and stretches of one track."""
    name, unit = track["name"], wanted.unit
    if windows := track.get("continuous"):
        worst = max(windows, key=lambda window: float(window["iri"]))
        place = f"{worst['start']:.2f} to {worst['end']:.2f} m"
        write_line(f"Roughest window of {name}: {worst['iri']:.{digits}f} {unit}, {place}")
    if wanted.threshold is not None:
        limit = f"{wanted.threshold:g} {unit}"
        write_line(f"Segments of {name} above {limit}: {track['too_rough']:.2f} of {length:.2f} m")
        if (found := track.get("stretches")) is not None:
            write_line(f"Stretches of {name} above {limit}: {len(found)}")
        shown, others = worst_stretches(found or ())
        for one in shown:
            peak = f"{one['peak']:.{digits}f} {unit} at {one['peak_at']:.2f} m"
            write_line(f"  {one['start']:.2f} to {one['end']:.2f} m, up to {peak}")
        if others:
            write_line(others)


def _show_histogram(tracks: list[dict[str, Any]], unit: Unit) -> None:
    """Print the fraction of the length of each track in the classes of the index."""
    rows = [[f"IRI [{unit}]", *(f"{track['name']} [%]" for track in tracks)]]
    for classes in zip(*(track["histogram"] for track in tracks), strict=True):
        name = f"{classes[0]['above']:.4g} to {classes[0]['below']:.4g}"
        rows.append([name, *(f"{100 * one['share']:.1f}" for one in classes)])
    write_table(rows)


def _picture_panels(rated: _IriResult, wanted: _IriRequest) -> list[Callable[[Any], object]]:
    """Panels of a file: functions that draw into given axes."""
    from trueterrain import figures

    def segments(ax: Any) -> None:
        figures.iri_segments(rated.index, ax=ax)
        if wanted.limit is not None:
            ax.axhline(wanted.limit, color="0.3", linewidth=1.0, linestyle="--")
            ax.set_ylim(top=max(ax.get_ylim()[1], 1.08 * wanted.limit))

    panels: list[Callable[[Any], object]] = [segments]
    if (sliding := rated.sliding) is not None:
        panels.append(
            lambda ax: figures.continuous_roughness(sliding, threshold=wanted.limit, ax=ax)
        )
    if (histogram := rated.histogram) is not None:
        panels.append(lambda ax: figures.roughness_histogram(histogram, ax=ax))
    return panels
