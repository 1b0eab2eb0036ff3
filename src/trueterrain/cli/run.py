"""The command ``trueterrain run``: the whole chain from one file of settings."""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from trueterrain.cli._console import (
    compiling_noted,
    out_json,
    progress_bar,
    worker_threads,
    write_line,
    write_note,
)
from trueterrain.cli._numbers import WHOLE
from trueterrain.cli._profiles import write_warning


def run(
    survey: Annotated[Path, Parameter(name="SURVEY")],
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    threads: Annotated[int | None, WHOLE] = None,
    json: Annotated[bool, Parameter(negative="")] = False,
    force: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Turn the recorded runs of a survey into surfaces, profiles, roughness and a report.

    Each run becomes a lane: its motion is found, it is gridded with a standard deviation for each
    height, profiles are taken and rated. Where lanes overlap, their heights are compared. All files
    appear together at the end, or none does; a stopped run can be started again. The exit code is 1
    if no lane has one of the profiles.

    Example: `trueterrain init survey left.zarr right.zarr > survey.toml`, then
    `trueterrain run survey.toml -o out`

    Parameters
    ----------
    survey
        Settings, a .toml file; `trueterrain init survey` prints one to begin with.
    output
        Folder for report.html, result.json, surfaces, profiles and pictures.
    threads
        Threads that work at once; by default one for each processor. Results do not depend on it.
    json
        Print result.json instead of a summary, with "folder" and "files" added.
    force
        Replace an earlier result of the same command in the folder; other files in it stay.
    """
    from trueterrain.core import require_writable
    from trueterrain.survey import read_survey, run_survey
    from trueterrain.verify.truth import truth_of

    require_writable(output, force=force, inputs=[survey], replaces="folder")
    settings = read_survey(survey)
    with compiling_noted(), progress_bar() as progress:
        found = run_survey(
            settings,
            output,
            force=force,
            threads=worker_threads(threads),
            truth=truth_of,
            progress=progress,
        )
    if json:
        out_json({**found.numbers, "folder": str(output), "files": list(found.files)})
    else:
        for line in in_words(found.numbers):
            write_line(line)
        write_note(f"{output / 'report.html'}: the report")
    taken = {profile["name"] for lane in found.numbers["lanes"] for profile in lane["profiles"]}
    missing = [profile.name for profile in settings.profiles if profile.name not in taken]
    if missing:
        write_warning(
            f"no lane has the profile {', '.join(missing)}; the report says why under each lane"
        )
        sys.exit(1)


def describe_deviations(surface: dict[str, Any]) -> str:
    """Standard deviations of a surface, to follow the numbers of its nodes.

    Parameters
    ----------
    surface : dict
        Summary of the surface, as `summarise` makes it.

    Returns
    -------
    str
        Empty if none is known.

    Examples
    --------
    >>> describe_deviations({"sd": {"median": 0.02}, "sd_relative": {"median": 0.003}})
    ', standard deviation 20.00 mm, relative 3.00 mm (median)'
    """
    known = {name: surface[name]["median"] for name in ("sd", "sd_relative")}
    words = [
        f"{what} {1000 * known[name]:.2f} mm"
        for name, what in (("sd", "standard deviation"), ("sd_relative", "relative"))
        if known[name] is not None
    ]
    if known["sd"] is None and words:
        words = [f"standard deviation {words[0]}, absolute not known"]
    return f", {', '.join(words)} (median)" if words else ""


def in_words(numbers: dict[str, Any]) -> Iterator[str]:
    """Main numbers of a survey, line by line.

    Parameters
    ----------
    numbers : dict
        What stands in result.json.

    Yields
    ------
    str
        Lines.
    """
    if numbers["merge"]:
        from trueterrain.cli.merge import in_words as merged_in_words

        yield from merged_in_words(numbers["merge"])
    runs = {run["name"]: run for run in numbers["runs"]}
    for lane in numbers["lanes"]:
        surface = lane["surface"]
        driven = sum(runs[name]["driven"] for name in lane["runs"])
        text = f"{lane['name']}: {driven:,.1f} m, {surface['nodes']:,} nodes"
        yield text + describe_deviations(surface)
        if lane["truth"]:
            truth = lane["truth"]["surface"]
            yield (
                f"  against the true ground: {1000 * truth['median']:+.2f} mm (median), "
                f"{1000 * truth['nmad']:.2f} mm about it (NMAD)"
            )
        for profile in lane["profiles"]:
            if profile["iri"] is None:
                continue
            text = f"  {profile['name']}: IRI {profile['iri']:.2f} m/km"
            text += f" over {profile['length']:.1f} m"
            if lane["truth"]:
                text += f", of the true ground {lane['truth']['iri'][profile['name']]:.2f} m/km"
            yield text
        for pair in lane["wheel_paths"]:
            yield f"  {pair['left']} and {pair['right']}: MRI {pair['mri']:.2f} m/km"
        flags = [problem for name in lane["runs"] for problem in runs[name]["problems"]]
        for problem in (*flags, *lane["problems"]):
            yield f"  flagged: {problem}"
    for compared in numbers["agreement"]:
        one, other = compared["lanes"]
        yield (
            f"{other} lies {1000 * compared['median']:+.2f} mm above {one} where they overlap "
            f"(median; NMAD {1000 * compared['nmad']:.2f} mm)"
        )
