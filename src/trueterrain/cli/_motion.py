"""Motion of recorded runs on the command line."""

from pathlib import Path
from typing import TYPE_CHECKING

from trueterrain.cli._console import write_note
from trueterrain.core.errors import SchemaError

if TYPE_CHECKING:
    from trueterrain.formats.run import Run
    from trueterrain.motion import FusionSettings
    from trueterrain.survey import ProcessedRun


def process_and_note(
    run: "Run | Path",
    motion: "FusionSettings",
    begin: float | None = None,
    end: float | None = None,
) -> "ProcessedRun":
    """Estimate the motion of a run, and note problems of motion and scans on stderr.

    Parameters
    ----------
    run : Run or Path
        The run, or its store.
    motion : FusionSettings
        Settings of the fusion.
    begin, end : float, optional
        Times between which the run is used [s]; by default all of it.

    Returns
    -------
    ProcessedRun
        As by `trueterrain.survey.process_run`.
    """
    from trueterrain.survey import process_run

    processed = process_run(run, motion, begin=begin, end=end)
    for problem in processed.problems:
        write_note(f"{processed.record.run.source}: {problem}")
    return processed


def require_run(path: Path) -> None:
    """Raise SchemaError if a file is not a recorded run.

    Parameters
    ----------
    path : Path
        The file.
    """
    from trueterrain import formats

    kind = formats.kind_of_file(path)
    if kind != "run":
        raise SchemaError(
            f"must be a recorded run, but is {kind}",
            path=path,
            cure="Name the folder NAME.zarr of a run.",
        )
