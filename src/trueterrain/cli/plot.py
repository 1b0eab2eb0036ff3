"""The command ``trueterrain plot``: figures of surfaces, points, profiles, runs, navigation."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from trueterrain.cli._console import write_note
from trueterrain.cli._points import (
    Classes,
    Returns,
    note_conversion,
    point_filter,
    require_points,
)
from trueterrain.core.errors import FormatError

if TYPE_CHECKING:
    import xarray as xr

    from trueterrain.formats import PointFilter

_DURATION = 1.0  # [s] of a range image that starts at a given time
_SEGMENT = 4.0  # [s] of the segments of a spectrum: a resolution of 0.4 Hz
_BAND = (0.25, 100.0)  # [Hz] of a spectrum
_PEAKS = {"ride": (0.8, 3.0), "hop": (8.0, 16.0)}  # [Hz] bands of the modes of vehicles


def plot(
    file: Path,
    /,
    *more: Path,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    show: Literal["ranges", "scan", "motion", "drift", "spectrum"] | None = None,
    at: float | None = None,
    frame: Literal["grid", "ground"] = "grid",
    resolution: float = 160.0,
    classes: Classes = None,
    returns: Returns = None,
    force: bool = False,
) -> None:
    """Draw a surface, a point cloud, profiles, a recorded run, or navigation.

    Example: `trueterrain plot tyre.erd point.erd -o both.svg`

    Parameters
    ----------
    file
        Surface, point cloud, profile, run (.zarr) or navigation (SBET, CSV), in any format that is
        read.
    more
        More profiles, drawn in the same picture, or more runs, whose drift is drawn.
    output
        Picture to write: .svg, .pdf or .png.
    show
        Figure of a run. ranges: image of the depth of all returns below the scanner; scan: one scan
        from behind, and 200 from above if the truth is known; motion: heave, pitch and roll; drift:
        errors of navigation (simulated runs only); spectrum: PSD of the accelerometers. By default
        ranges for one run, drift for several.
    at
        Time in a run [s]: of the scan, or of the start of one second of ranges.
    frame
        Coordinates of a surface with a reference line. grid: station and offset, which straightens
        the road; ground: easting and northing.
    resolution
        Resolution of a PNG picture [dots per inch].
    classes
        Classes of the points to draw, e.g. 2,11 (ground and road surface); by default all.
    returns
        Return of each pulse to draw: last, first or its number; by default all.
    force
        Replace the output if it exists.
    """
    from trueterrain import figures

    files = (file, *more)
    figures.require_picture(output, force=force, inputs=files)
    kinds = {path: _plotted_kind(path) for path in files}
    _check_kinds(kinds)
    kind = kinds[file]
    if kind != "run" and (show is not None or at is not None):
        message = f"{file}: --show and --at are for runs, this is {kind}."
        raise ValueError(message)
    only = point_filter(classes, returns)
    require_points(only, file, kind)
    if kind == "run":
        drawn = _plot_run(files, show, at)
    elif kind == "navigation":
        drawn = _plot_navigation(file)
    else:
        drawn = _plotted_data(files, frame, only)
    figures.save_figure(drawn, output, force=force, resolution=resolution)
    write_note(f"{output}: written")


def _plotted_kind(path: Path) -> str:
    from trueterrain import formats

    if _is_parquet_of_navigation(path):
        return "navigation"
    kind = formats.kind_of_file(path)
    if kind in ("accuracy", "path"):
        what = {"accuracy": "accuracies without positions", "path": "a path without heights"}[kind]
        cure = {
            "accuracy": "Plot the SBET file that they belong to.",
            "path": "Plot what it lies on, or a profile along it.",
        }[kind]
        raise FormatError(f"holds {what}", path=path, cure=cure)
    return kind


def _is_parquet_of_navigation(path: Path) -> bool:
    from trueterrain import formats

    if formats.recognise_format(path).name != "Parquet":
        return False
    from trueterrain.formats.navigation_signature import is_navigation
    from trueterrain.formats.number_table import table_columns

    return is_navigation(table_columns(path))


def _check_kinds(kinds: dict[Path, str]) -> None:
    """Raise ValueError unless several files are all profiles or all runs."""
    first = next(iter(kinds.values()))
    if len(kinds) == 1:
        return
    allowed = first if first in ("profile", "run") else "profile"
    other = next((path for path, kind in kinds.items() if kind != allowed), None)
    if other is not None:
        rule = f"only {allowed}s are drawn together"
        message = f"{other}: {rule}, this is {kinds[other]}. Plot it alone."
        raise ValueError(message)


def _plotted_data(
    files: tuple[Path, ...], frame: Literal["grid", "ground"], only: "PointFilter | None"
) -> Any:
    """Figure of a surface, of points or of profiles."""
    from trueterrain import figures, formats
    from trueterrain.core.schemas import kind_of

    first = formats.open(files[0], only=only)
    match kind_of(first):
        case "surface":
            return figures.surface_map(first, frame=frame)
        case "points":
            note_conversion(files[:1])
            return figures.points_map(first)
        case _:
            others = {path.name: formats.open(path) for path in files[1:]}
            return figures.profiles({files[0].name: first} | others)


def _plot_navigation(path: Path) -> Any:
    """Figure of navigation: plan and heights."""
    import matplotlib.pyplot as plt

    from trueterrain import figures, formats
    from trueterrain.formats import navigation

    read = navigation.read_columns if _is_parquet_of_navigation(path) else formats.open
    data: xr.Dataset = read(path)
    figure, (above, below) = plt.subplots(
        2, 1, figsize=(8, 8), layout="constrained", height_ratios=(5, 2)
    )
    figures.navigation_plan(data, ax=above)
    figures.navigation_heights(data, ax=below)
    figures.head_figure(figure, path.name)
    return figure


def _plot_run(files: tuple[Path, ...], show: str | None, at: float | None) -> Any:
    from trueterrain import figures
    from trueterrain.formats.run import open_run

    show = show or ("ranges" if len(files) == 1 else "drift")
    if len(files) > 1 and show != "drift":
        message = f"{files[1]}: of several runs only the drift is drawn, got --show {show}."
        raise ValueError(message)
    if at is not None and show not in ("ranges", "scan"):
        message = f"--at is for --show ranges and --show scan, got --show {show}."
        raise ValueError(message)
    runs = {path: open_run(path) for path in files}
    run = runs[files[0]]
    match show:
        case "ranges":
            end = None if at is None else at + _DURATION
            drawn: Any = figures.range_image(run, begin=at, end=end, below=True)
        case "scan":
            drawn = _plot_scan(run, at)
        case "motion":
            drawn = _plot_motion(run)
        case "spectrum":
            drawn = _plot_spectrum(run)
        case _:
            drawn = figures.navigation_errors({path.stem: run for path, run in runs.items()})
    if len(files) == 1:
        whole = drawn if hasattr(drawn, "suptitle") else drawn.get_figure(root=True)
        figures.head_figure(whole, run.attrs["name"])
    return drawn


def _plot_scan(run: "xr.DataTree", at: float | None) -> Any:
    """Figure of one scan from behind, and of scans from above if the truth is known."""
    import matplotlib.pyplot as plt

    from trueterrain import figures

    if "truth" not in run.children:
        return figures.scan_elevation(run, at=at)
    figure, (above, below) = plt.subplots(2, 1, figsize=(8, 7), layout="constrained")
    figures.scan_plan(run, at=at, ax=above)
    figures.scan_elevation(run, at=at, ax=below)
    return figure


def _plot_motion(run: "xr.DataTree") -> Any:
    """Figure of the motion of the body, and of the laser if the truth is known."""
    import matplotlib.pyplot as plt

    from trueterrain import figures

    if "truth" not in run.children:
        return figures.body_motion(run)
    figure, (above, below) = plt.subplots(2, 1, figsize=(8, 6), layout="constrained")
    figures.body_motion(run, ax=above)
    figures.laser_displacement(run, ax=below)
    return figure


def _plot_spectrum(run: "xr.DataTree") -> Any:
    """Figure of the spectra of all accelerometers."""
    import numpy as np

    from trueterrain import figures
    from trueterrain.core.errors import SchemaError

    if "accelerometers" not in run.children:
        raise SchemaError(
            "holds no accelerometers, whose spectrum is to be drawn",
            place=f"run {run.attrs['name']}",
            cure="Choose another --show.",
        )
    samples = run["accelerometers"].to_dataset().load()
    rate = 1.0 / float(np.median(np.diff(samples["time"].values)))
    signals = {
        f"sensor {number}": column
        for number, column in enumerate(samples["acceleration"].values.T, start=1)
    }
    span = samples.sizes["sample"] / rate
    return figures.spectrum(
        signals,
        rate,
        segment=min(_SEGMENT, span),
        frequencies=_BAND,
        peaks=_PEAKS,
        name="Specific force",
    )
