"""Products of a survey: surface, profiles and roughness of one or several runs, and their files."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from trueterrain import formats
from trueterrain.core import provenance
from trueterrain.core.progress import Progress
from trueterrain.roughness import iri
from trueterrain.surface.coarse import down_sample
from trueterrain.surface.evaluate import node_coordinates, surface_to_points
from trueterrain.surface.summary import summarise_surface
from trueterrain.survey._settings import Survey
from trueterrain.survey.profiles import (
    extract_profile,
    extract_profiles,
    rate_profiles,
    rate_wheel_paths,
)
from trueterrain.survey.runs import ProcessedRun, georeference_run
from trueterrain.survey.surfaces import build_surface
from trueterrain.verify.truth import TrueHeight, statistics_of

_MEASURED_ONLY = ("sd", "sd_relative", "count", "filled")  # variables that true ground has not
_OVERVIEW_SPACING = 0.05  # [m] of the coarse surface that is kept for figures and comparisons

#: Called with the name of a surface, the surface and its profiles while all nodes are in memory.
DrawSurface = Callable[[str, xr.Dataset, "dict[str, xr.Dataset]"], None]


@dataclass(frozen=True, kw_only=True, eq=False)
class SurfaceResult:
    """What remains of a surface once its files are written."""

    name: str
    "Name of the surface."

    coarse: xr.Dataset
    "The surface with nodes some 50 mm apart."

    profiles: dict[str, xr.Dataset]
    "Its profiles by name."

    files: tuple[tuple[str, str], ...]
    "Names of the files that were written, and their contents in words."

    numbers: dict[str, Any]
    "Entry of result.json."

    steps: list[dict[str, Any]] = field(default_factory=list)
    "Provenance of the surface."


def write_products(
    survey: Survey,
    name: str,
    runs: Sequence[ProcessedRun],
    folder: Path,
    *,
    threads: int,
    truth: TrueHeight | None,
    draw: DrawSurface,
    progress: Progress,
) -> SurfaceResult:
    """Grid runs to one surface, take and rate its profiles, and write both.

    Parameters
    ----------
    survey : Survey
        Settings of all steps.
    name : str
        Name of the surface.
    runs : sequence of ProcessedRun
        The runs; the surface follows the trajectory of the first unless `survey.grid` says
        otherwise.
    folder : Path
        Where files are written.
    threads : int
        Threads that grid at once.
    truth : callable, optional
        True height of the ground, if it is known.
    draw : callable
        Draws the surface and the profiles while the whole surface is in memory.
    progress : callable
        Called with a task, the amount done and the total.

    Returns
    -------
    SurfaceResult
        All but the surface itself, which is on disk.
    """
    surface, report = build_surface(
        runs,
        survey.grid,
        survey.cells,
        holes=survey.holes,
        down_sample=survey.down_sample,
        screening=survey.screening,
        threads=threads,
        step="survey",
        parameters={"survey": survey.name},
        progress=progress,
    )
    progress(f"{name}: files", 0, None)
    files = [*_write_surfaces(survey, surface, name, folder)]
    progress(f"{name}: profiles", 0, None)
    profiles, left_out = extract_profiles(surface, survey.profiles, name=name)
    files += _write_profiles(survey, profiles, name, folder)
    ratings, unrated = rate_profiles(profiles, survey.roughness)
    draw(name, surface, profiles)
    numbers = {
        "name": name,
        "runs": [run.name for run in runs],
        "returns": report["returns"],
        "surface": {
            **summarise_surface(surface),
            "holes": report["holes"],
            "down_sample": report["down_sample"],
        },
        "profiles": [
            {**_profile_numbers(profile, ratings.get(one)), "name": one}
            for one, profile in profiles.items()
        ],
        "wheel_paths": rate_wheel_paths(profiles, ratings, survey.roughness.iri),
        "truth": None if truth is None else _compare_with_truth(survey, surface, truth, ratings),
        "problems": [*_list_problems(report["returns"], report["holes"]), *left_out, *unrated],
        "files": [file for file, _ in files],
    }
    return SurfaceResult(
        name=name,
        coarse=_overview(surface),
        profiles=profiles,
        files=tuple(files),
        numbers=numbers,
        steps=provenance.provenance_steps(surface),
    )


def write_points(
    survey: Survey, run: ProcessedRun, folder: Path, progress: Progress
) -> tuple[str, str] | None:
    """Write every return of a run as a point, if the survey asks for it.

    Parameters
    ----------
    survey : Survey
        Format, screening and noise.
    run : ProcessedRun
        The run.
    folder : Path
        Where the file is written.
    progress : callable
        Called with a task, the amount done and the total.

    Returns
    -------
    tuple of str or None
        Name of the file, and its contents in words.
    """
    if not survey.outputs.points:
        return None
    file = f"{run.name}-points.{survey.outputs.points}"
    blocks = georeference_run(
        run,
        screening=survey.screening,
        range_noise=survey.cells.range_noise,
        progress=progress,
    )
    formats.write(blocks, folder / file)
    return file, f"every return of {run.name} at its own time"


def _write_surfaces(
    survey: Survey, surface: xr.Dataset, name: str, folder: Path
) -> Iterator[tuple[str, str]]:
    for ending in survey.outputs.surface:
        file = f"{name}.{ending}"
        formats.write(surface_to_points(surface) if ending == "laz" else surface, folder / file)
        yield file, f"{name}: surface" + (", nodes as points" if ending == "laz" else "")


def _write_profiles(
    survey: Survey, profiles: Mapping[str, xr.Dataset], surface: str, folder: Path
) -> Iterator[tuple[str, str]]:
    for name, profile in profiles.items():
        for ending in survey.outputs.profile:
            file = f"{surface}-{name}.{ending}"
            formats.write(profile, folder / file)
            yield file, f"{surface}: profile {name}"


def _compare_with_truth(
    survey: Survey, surface: xr.Dataset, truth: TrueHeight, ratings: Mapping[str, xr.Dataset]
) -> dict[str, Any]:
    """Errors of the heights, and the IRI [m/km] of the true ground along the same paths."""
    # only where there are heights, so that both profiles begin and end at the same stations
    true = np.where(np.isfinite(surface["height"]), truth(*node_coordinates(surface)), np.nan)
    ground = surface.assign(height=surface["height"].copy(data=true))
    ground = ground.drop_vars([name for name in ground.data_vars if name in _MEASURED_ONLY])
    true_ratings = {
        one.name: iri(extract_profile(ground, one), settings=survey.roughness.iri).iri[0]
        for one in survey.profiles
        if one.name in ratings
    }
    return {
        "surface": statistics_of(surface["height"].values - true),
        "iri": {name: float(value) for name, value in true_ratings.items()},
    }


def _profile_numbers(profile: xr.Dataset, rating: xr.Dataset | None) -> dict[str, Any]:
    s = profile["s"].values
    sd = profile["sd"].values if "sd" in profile else np.empty(0)
    known = sd[np.isfinite(sd)]
    numbers: dict[str, Any] = {
        "points": int(s.size),
        "length": float(s[-1] - s[0]),
        "sd_median": float(np.median(known)) if known.size else None,
        "iri": None if rating is None else float(rating.iri[0]),
        "segments": [],
    }
    if rating is not None:
        numbers["segments"] = [
            {"start": float(a), "end": float(b), "iri": float(value)}
            for a, b, value in zip(rating.start, rating.end, rating.segment_iri[0], strict=True)
        ]
    return numbers


def _list_problems(returns: dict[str, Any], holes: dict[str, Any]) -> Iterator[str]:
    sentences = {
        "scans_uncovered": "scans without motion are left out",
        "bridged": "scans lie at times that navigation did not see",
        "too_high": "returns have no height",
    }
    for name, sentence in sentences.items():
        if returns.get(name):
            yield f"{returns[name]:,} {sentence}"
    if holes["open_holes"]:
        many = "1 hole is" if holes["open_holes"] == 1 else f"{holes['open_holes']:,} holes are"
        yield f"{many} left open, {holes['open_nodes']:,} nodes in all"


def _overview(surface: xr.Dataset) -> xr.Dataset:
    dims = surface["height"].dims
    factor = tuple(
        max(
            1,
            min(
                round(_OVERVIEW_SPACING / float(np.diff(surface[dim]).mean())),
                surface.sizes[dim] - 1,
            ),
        )
        for dim in dims
    )
    return down_sample(surface, (factor[0], factor[1]))[0]
