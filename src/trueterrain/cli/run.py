"""The command ``trueterrain run``: the whole chain from one settings file."""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from trueterrain.cli._console import (
    note_compilation,
    progress_bar,
    worker_threads,
    write_json,
    write_line,
    write_note,
)
from trueterrain.cli._options import INTEGER
from trueterrain.cli._profiles import write_warning


def run(
    survey: Annotated[Path, Parameter(name="SURVEY")],
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    threads: Annotated[int | None, INTEGER] = None,
    json: Annotated[bool, Parameter(negative="")] = False,
    force: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Process the recorded runs of a survey to surfaces, profiles, roughness and a report.

    For each run the motion is estimated, the returns are gridded with a standard deviation for each
    height, and profiles are extracted and rated. Heights of overlapping surfaces are compared. All
    files appear together at the end, or none does; after a stop the command can be repeated. The
    exit code is 1 if no surface contains one of the profiles.

    Example: `trueterrain init survey left.zarr right.zarr > survey.toml`, then
    `trueterrain run survey.toml -o out`

    Parameters
    ----------
    survey
        Settings, a .toml file; `trueterrain init survey` prints one to start from.
    output
        Folder for report.html, result.json, surfaces, profiles and pictures.
    threads
        Number of threads; by default one for each processor. Results do not depend on it.
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
    with note_compilation(), progress_bar() as progress:
        found = run_survey(
            settings,
            output,
            force=force,
            threads=worker_threads(threads),
            truth=truth_of,
            progress=progress,
        )
    if json:
        write_json({**found.numbers, "folder": str(output), "files": list(found.files)})
    else:
        for line in summary_lines(found.numbers):
            write_line(line)
        write_note(f"{output / 'report.html'}: the report")
    taken = {profile["name"] for lane in found.numbers["lanes"] for profile in lane["profiles"]}
    missing = [profile.name for profile in settings.profiles if profile.name not in taken]
    if missing:
        write_warning(
            f"no lane has the profile {', '.join(missing)}; the report says why under each lane"
        )
        sys.exit(1)


def deviation_text(surface: dict[str, Any]) -> str:
    """Standard deviations of a surface as text, to follow its number of nodes.

    Parameters
    ----------
    surface : dict
        Summary by `trueterrain.surface.evaluate.summarise_surface`.

    Returns
    -------
    str
        Empty if no standard deviation is known.

    Examples
    --------
    >>> deviation_text({"sd": {"median": 0.02}, "sd_relative": {"median": 0.003}})
    ', standard deviation 20.00 mm, relative 3.00 mm (median)'
    """
    known = {name: surface[name]["median"] for name in ("sd", "sd_relative")}
    texts = [
        f"{what} {1000 * known[name]:.2f} mm"
        for name, what in (("sd", "standard deviation"), ("sd_relative", "relative"))
        if known[name] is not None
    ]
    if known["sd"] is None and texts:
        texts = [f"standard deviation {texts[0]}, absolute not known"]
    return f", {', '.join(texts)} (median)" if texts else ""


def summary_lines(numbers: dict[str, Any]) -> Iterator[str]:
    """Lines that summarise a survey.

    Parameters
    ----------
    numbers : dict
        Content of result.json.

    Yields
    ------
    str
        Lines.
    """
    if numbers["merge"]:
        from trueterrain.cli.merge import summary_lines as merge_lines

        yield from merge_lines(numbers["merge"])
    runs = {run["name"]: run for run in numbers["runs"]}
    for lane in numbers["lanes"]:
        surface = lane["surface"]
        driven = sum(runs[name]["driven"] for name in lane["runs"])
        text = f"{lane['name']}: {driven:,.1f} m, {surface['nodes']:,} nodes"
        yield text + deviation_text(surface)
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
        first, second = compared["lanes"]
        yield (
            f"{second} lies {1000 * compared['median']:+.2f} mm above {first} where they overlap "
            f"(median; NMAD {1000 * compared['nmad']:.2f} mm)"
        )
