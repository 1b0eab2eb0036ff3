"""One lane: from recorded runs to their surface and profiles, with everything that was found."""

import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from trueterrain import formats
from trueterrain.core import provenance
from trueterrain.core.errors import CoverageError, name_file_in_errors
from trueterrain.core.progress import Progress
from trueterrain.core.schemas import make_profile
from trueterrain.formats.run import open_run
from trueterrain.formats.table import read_waypoints
from trueterrain.georeference import georeference, mounting_of
from trueterrain.motion import FusedMotion, Trajectory, fuse_motion
from trueterrain.motion.scan_gaps import find_scan_problems
from trueterrain.profile import (
    WheelPath,
    offset_path,
    point_profile,
    straight_path,
    tyre_profile,
    waypoint_path,
)
from trueterrain.profile.area import area_flag, area_reach
from trueterrain.profile.envelope import tyre_envelope
from trueterrain.roughness import flag_profile, iri
from trueterrain.roughness.plausible import rating_flags
from trueterrain.surface.coarse import down_sample
from trueterrain.surface.evaluate import heights_at, node_coordinates, surface_to_points
from trueterrain.surface.grid import trim_surface
from trueterrain.surface.holes import fill_holes
from trueterrain.surface.runs import PassRecord, grid_runs
from trueterrain.surface.summary import summarise_surface
from trueterrain.survey._settings import ProfilePathSettings, RunSettings, Survey, lane_name
from trueterrain.verify.truth import TrueHeight, statistics_of

_PARALLEL = 1.01  # by which one wheel path may be longer than the other
_OF_MEASURED = ("sd", "sd_relative", "count", "filled")  # which the true ground has not
_VIEWED = 0.05  # [m] spacing of the coarse surface that is kept to look at and to compare

#: Called with a name and the surface of a lane, to draw what needs all of it.
Look = Callable[[str, xr.Dataset, "dict[str, xr.Dataset]"], None]


@dataclass(frozen=True, kw_only=True, eq=False)
class SurveyRun:
    """A run of the survey, and its motion."""

    name: str
    "Name of its lane."

    motion: FusedMotion
    "How the motion was found."

    taken: PassRecord
    "Where it is, the part of its motion that counts, and its mounting."

    numbers: dict[str, Any]
    "What it is, as JSON takes it."


@dataclass(frozen=True, kw_only=True, eq=False)
class SurfaceResult:
    """What one run became, or several together."""

    name: str
    "Name of the lane."

    coarse: xr.Dataset
    "Its surface with nodes some 50 mm apart."

    profiles: dict[str, xr.Dataset]
    "Its profiles by name."

    files: tuple[tuple[str, str], ...]
    "Names of the files that were written, and what they hold."

    numbers: dict[str, Any]
    "All that was found, as JSON takes it."

    steps: list[dict[str, Any]] = field(default_factory=list)
    "Steps that led to the surface."


def find_run(survey: Survey, run: RunSettings, progress: Progress) -> SurveyRun:
    """Open a run and find its motion.

    Parameters
    ----------
    survey : Survey
        How the motion is found.
    run : RunSettings
        The run.
    progress : callable
        Called with a task, the amount done and the total.

    Returns
    -------
    Run
        With all that is flagged about it.
    """
    name, path = lane_name(run), Path(run.path)
    progress(f"{name}: motion", 0, None)
    with name_file_in_errors(path), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what it warns of is among the problems as well
        tree = open_run(path)
        mounting = run.mounting.over(mounting_of(tree, path=path))
        motion = fuse_motion(tree, settings=survey.motion)
        problems = [*motion.problems, *find_scan_problems(tree, motion.trajectory)]
        trajectory = motion.trajectory.between(run.begin, run.end)
    numbers = {
        "name": name,
        **_of_run(tree, path, trajectory),
        "mounting": asdict(mounting),
        "motion": motion.to_dict(),
        "problems": problems,
    }
    taken = PassRecord(path=path, trajectory=trajectory, mounting=mounting)
    return SurveyRun(name=name, motion=motion, taken=taken, numbers=numbers)


def measure_lane(
    survey: Survey,
    name: str,
    runs: Sequence[SurveyRun],
    folder: Path,
    *,
    threads: int,
    truth: TrueHeight | None,
    look: Look,
    progress: Progress,
) -> SurfaceResult:
    """Turn runs into one surface and profiles, and write them.

    Parameters
    ----------
    survey : Survey
        What shall become of them.
    name : str
        Name of the lane.
    runs : sequence of Run
        The runs; the surface lies along the way of the first, unless the settings say otherwise.
    folder : Path
        Where files are written.
    threads : int
        Threads that grid at once.
    truth : callable, optional
        True ground, if it is known.
    look : callable
        Draws the surface and the profiles while the surface is there.
    progress : callable
        Called with a task, the amount done and the total.

    Returns
    -------
    Lane
        Everything but the surface itself, which is on disk.
    """
    passes = [run.taken for run in runs]
    cells = replace(survey.cells, agreed=len(passes) > 1)
    surface, tally = grid_runs(
        passes,
        survey.grid.of_runs(passes),
        cells,
        screening=survey.screening,
        threads=threads,
        progress=lambda run, done, total: progress(f"{run}: scans", done, total),
    )
    surface, holes = fill_holes(trim_surface(surface), survey.holes, in_place=True)
    loss = None
    if survey.down_sample is not None:
        surface, loss = down_sample(surface, survey.down_sample)
    surface = provenance.add_step(
        surface,
        "survey",
        parameters={
            "survey": survey.name,
            "runs": [run.taken.path.name for run in runs],
            "motion": survey.motion,
            "mounting": [run.taken.mounting for run in runs],
            "holes": survey.holes,
            "down_sample": survey.down_sample,
        },
    )
    progress(f"{name}: files", 0, None)
    files = [*_write_surfaces(survey, surface, name, folder)]
    progress(f"{name}: profiles", 0, None)
    profiles, left_out = _extract_profiles(survey, surface, name)
    files += _profile_files(survey, profiles, name, folder)
    index, unrated = _rate_profiles(survey, profiles)
    look(name, surface, profiles)
    numbers = {
        "name": name,
        "runs": [run.name for run in runs],
        "returns": tally,
        "surface": {**summarise_surface(surface), "holes": holes, "down_sample": loss},
        "profiles": [
            {**_of_profile(profile, index.get(one)), "name": one}
            for one, profile in profiles.items()
        ],
        "wheel_paths": list(_wheel_paths(survey, profiles, index)),
        "truth": None if truth is None else _compare_with_truth(survey, surface, truth, index),
        "problems": [*_list_problems(tally, holes), *left_out, *unrated],
        "files": [file for file, _ in files],
    }
    return SurfaceResult(
        name=name,
        coarse=_view_surface(surface),
        profiles=profiles,
        files=tuple(files),
        numbers=numbers,
        steps=provenance.provenance_steps(surface),
    )


def write_points(
    survey: Survey, run: SurveyRun, folder: Path, progress: Progress
) -> tuple[str, str] | None:
    """Write every return of a run as a point, if the survey asks for it.

    Parameters
    ----------
    survey : Survey
        In which format.
    run : Run
        The run.
    folder : Path
        Where the file is written.
    progress : callable
        Called with a task, the amount done and the total.

    Returns
    -------
    tuple of str or None
        Name of the file, and what it holds.
    """
    if not survey.outputs.points:
        return None
    scans = run.numbers["scans"]

    def blocks() -> Iterator[xr.Dataset]:
        for block in georeference(
            run.taken.path,
            run.taken.trajectory,
            run.taken.mounting,
            screening=survey.screening,
            range_noise=survey.cells.range_noise,
        ):
            yield block
            progress(f"{run.name}: points", block.attrs["scans"], scans)

    file = f"{run.name}-points.{survey.outputs.points}"
    formats.write(blocks(), folder / file)
    return file, f"every return of {run.name} at its own time"


def _write_surfaces(
    survey: Survey, surface: xr.Dataset, name: str, folder: Path
) -> Iterator[tuple[str, str]]:
    for ending in survey.outputs.surface:
        file = f"{name}.{ending}"
        formats.write(surface_to_points(surface) if ending == "laz" else surface, folder / file)
        yield file, f"{name}: surface" + (", nodes as points" if ending == "laz" else "")


def _extract_profiles(
    survey: Survey, surface: xr.Dataset, lane: str
) -> tuple[dict[str, xr.Dataset], list[str]]:
    """Profiles by name, and why others could not be taken."""
    found, problems = {}, []
    for wanted in survey.profiles:
        try:
            found[wanted.name] = taken_along(surface, wanted)
        except CoverageError as error:
            problems.append(f"profile {wanted.name} of {lane} is left out: {error}")
        if (flag := area_flag(wanted.tyre.search_area())) is not None:
            problems.append(f"profile {wanted.name}: {flag}")
    return found, problems


def taken_along(surface: xr.Dataset, wanted: ProfilePathSettings) -> xr.Dataset:
    """Profile that a tyre feels along a path.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface.
    wanted : ProfileSettings
        Path, search area and statistic.

    Returns
    -------
    xarray.Dataset
        Profile.
    """
    path, options = _covered_path(surface, wanted), wanted.tyre
    if wanted.envelope is not None:
        return tyre_envelope(surface, path, tyre=wanted.envelope.model(), thin=options.thin)
    taken = options.taken()
    if taken is None:
        return point_profile(surface, path)
    return tyre_profile(
        surface,
        path,
        area=options.search_area(),
        statistic=taken,
        level=options.level,
        min_count=options.min_count,
        thin=options.thin,
    )


def _covered_path(surface: xr.Dataset, wanted: ProfilePathSettings) -> WheelPath:
    """Path as far as the surface lies under it, search areas included."""
    if wanted.offset is not None:
        path = offset_path(surface, wanted.offset, spacing=wanted.spacing)
    elif wanted.line is not None:
        path = straight_path(wanted.line[:2], wanted.line[2:], spacing=wanted.spacing)
    else:
        assert wanted.path is not None  # one of them is given
        path = waypoint_path(*read_waypoints(Path(wanted.path)), spacing=wanted.spacing)
    seen = np.flatnonzero(np.isfinite(heights_at(surface, path.easting, path.northing)))
    margin = int(np.ceil(area_reach(wanted.tyre.search_area()) / wanted.spacing))
    if seen.size < 2 * margin + 2:
        raise CoverageError(
            "the surface does not lie under the path",
            place=f"profile {wanted.name}",
            cure="Compare the coordinates of path and runs.",
        )
    return path.part(int(seen[0]) + margin, int(seen[-1]) + 1 - margin)


def _profile_files(
    survey: Survey, profiles: dict[str, xr.Dataset], lane: str, folder: Path
) -> Iterator[tuple[str, str]]:
    for name, profile in profiles.items():
        for ending in survey.outputs.profile:
            file = f"{lane}-{name}.{ending}"
            formats.write(profile, folder / file)
            yield file, f"{lane}: profile {name}"


def _rate_profiles(
    survey: Survey, profiles: dict[str, xr.Dataset]
) -> tuple[dict[str, xr.Dataset], list[str]]:
    """Roughness of profiles, what is flagged about it, and why others have none."""
    found, problems = {}, []
    for name, profile in profiles.items():
        try:
            found[name] = iri(
                profile, options=survey.roughness.iri, segment=survey.roughness.segment
            )
        except (CoverageError, ValueError) as error:
            problems.append(f"profile {name} is not rated: {error}")
            continue
        problems += flag_profile(profile.assign_attrs(track=name))
        unsure = rating_flags(profile, survey.roughness.iri)
        problems += [f"profile {name}: {flag}" for flag in unsure]
    return found, problems


def _wheel_paths(
    survey: Survey, profiles: dict[str, xr.Dataset], index: dict[str, xr.Dataset]
) -> Iterator[dict[str, Any]]:
    """MRI and HRI [m/km] of rated profiles whose names differ in left and right at their end."""
    for left in index:
        right = left.removesuffix("left") + "right"
        if left.endswith("left") and right in index:
            mri = 0.5 * float(index[left].iri[0] + index[right].iri[0])
            hri = _half_car(survey, profiles[left], profiles[right])
            yield {"left": left, "right": right, "mri": mri, "hri": hri}


def _half_car(survey: Survey, left: xr.Dataset, right: xr.Dataset) -> float | None:
    """HRI of two wheel paths [m/km], None if they are not parallel."""
    step = float(left.s[1] - left.s[0])
    numbers = [np.rint(profile.s.values / step).astype(int) for profile in (left, right)]
    both, at_left, at_right = np.intersect1d(*numbers, return_indices=True)
    # paths of a bend are not equally long, so equal stations do not lie side by side there
    lengths = [profile.sizes["s"] for profile in (left, right)]
    if both.size < 2 or max(lengths) > _PARALLEL * min(lengths):
        return None
    heights = np.stack([left.height.values[at_left], right.height.values[at_right]])
    tracks = make_profile(both * step, heights, tracks=["left", "right"])
    try:
        return float(iri(tracks, options=survey.roughness.iri).hri)
    except (CoverageError, ValueError):
        return None  # too short where both are


def _compare_with_truth(
    survey: Survey, surface: xr.Dataset, truth: TrueHeight, index: dict[str, xr.Dataset]
) -> dict[str, Any]:
    """Errors of the heights, and the IRI [m/km] of the true ground along the same paths."""
    # only where there are heights, so that both profiles begin and end at the same stations
    true = np.where(np.isfinite(surface["height"]), truth(*node_coordinates(surface)), np.nan)
    ground = surface.assign(height=surface["height"].copy(data=true))
    ground = ground.drop_vars([name for name in ground.data_vars if name in _OF_MEASURED])
    rated = {
        wanted.name: iri(taken_along(ground, wanted), options=survey.roughness.iri).iri[0]
        for wanted in survey.profiles
        if wanted.name in index
    }
    return {
        "surface": statistics_of(surface["height"].values - true),
        "iri": {name: float(value) for name, value in rated.items()},
    }


def _of_run(tree: xr.DataTree, path: Path, trajectory: Trajectory) -> dict[str, Any]:
    scans = tree["scans"]
    time = np.asarray(scans["time"], dtype=np.float64)
    way = trajectory.position
    return {
        "path": path.name,
        "scans": int(scans.sizes["scan"]),
        "beams": int(scans.sizes["beam"]),
        "seconds": float(np.nanmax(time) - np.nanmin(time)),
        "driven": float(np.hypot(*np.diff(way[:, :2], axis=0).T).sum()),
        "origin": [float(part) for part in tree.attrs["origin"]],
    }


def _of_profile(profile: xr.Dataset, index: xr.Dataset | None) -> dict[str, Any]:
    s = profile["s"].values
    sd = profile["sd"].values if "sd" in profile else np.empty(0)
    known = sd[np.isfinite(sd)]
    numbers: dict[str, Any] = {
        "points": int(s.size),
        "length": float(s[-1] - s[0]),
        "sd_median": float(np.median(known)) if known.size else None,
        "iri": None if index is None else float(index.iri[0]),
        "segments": [],
    }
    if index is not None:
        numbers["segments"] = [
            {"start": float(a), "end": float(b), "iri": float(value)}
            for a, b, value in zip(index.start, index.end, index.segment_iri[0], strict=True)
        ]
    return numbers


def _list_problems(tally: dict[str, Any], holes: dict[str, Any]) -> Iterator[str]:
    words = {
        "scans_uncovered": "scans without motion are left out",
        "bridged": "scans lie at times that navigation did not see",
        "too_high": "returns have no height",
    }
    for name, what in words.items():
        if tally.get(name):
            yield f"{tally[name]:,} {what}"
    if holes["open_holes"]:
        many = "1 hole is" if holes["open_holes"] == 1 else f"{holes['open_holes']:,} holes are"
        yield f"{many} left open, {holes['open_nodes']:,} nodes in all"


def _view_surface(surface: xr.Dataset) -> xr.Dataset:
    dims = surface["height"].dims
    factor = tuple(
        max(1, min(round(_VIEWED / float(np.diff(surface[dim]).mean())), surface.sizes[dim] - 1))
        for dim in dims
    )
    return down_sample(surface, (factor[0], factor[1]))[0]
