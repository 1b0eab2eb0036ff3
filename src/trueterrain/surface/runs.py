"""From recorded runs to a surface, without points in between."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain import provenance
from trueterrain.engine.progress import Progress, no_progress
from trueterrain.errors import CoverageError, FormatError, SchemaError
from trueterrain.formats.run import Mounting, open_run
from trueterrain.georeference import ScanGeometry, Screening, mounting_of
from trueterrain.motion.trajectory import Trajectory
from trueterrain.surface.accumulate import CellSums
from trueterrain.surface.cells import Grid
from trueterrain.surface.grid import GridOptions, surface_of

#: Scans in a block, unless told otherwise: whole chunks of a store.
BLOCK = 4000


@dataclass(frozen=True, kw_only=True, eq=False)
class Pass:
    """A run and its motion."""

    path: Path
    "Store of the run, NAME.zarr."

    trajectory: Trajectory
    "Motion of the body."

    mounting: Mounting | None = None
    "Where the scanner sits, and its clock; by default what the run says."


def grid_runs(
    passes: Sequence[Pass],
    grid: Grid,
    options: GridOptions = GridOptions(),
    *,
    screening: Screening = Screening(),
    threads: int = 1,
    block: int = BLOCK,
    progress: Progress = no_progress,
) -> tuple[xr.Dataset, dict[str, Any]]:
    """Surface from recorded runs.

    Parameters
    ----------
    passes : sequence of Pass
        Runs with their motion; errors of their motion are taken as independent.
    grid : Grid
        The cells, in the local frame of the runs.
    options : GridOptions
        What is taken of the returns in each.
    screening : Screening
        Which returns are doubtful, and what becomes of them.
    threads : int
        Threads that work at once; the surface does not depend on it.
    block : int
        Scans that are read at once; the surface does not depend on it.
    progress : callable, optional
        Called with the name of the run, and the scans done and to do.

    Returns
    -------
    surface : xarray.Dataset
        With ``height``, ``count`` and ``sd``.
    report : dict
        How many returns were ``used``, ``doubtful``, ``outside`` of the grid or ``too_high``, and
        how many ``scans`` there were, ``scans_uncovered`` by the motion and ``bridged``.

    Raises
    ------
    ValueError
        If there is no pass, or `block` is less than 1.
    CoverageError
        If the motion covers no scan of a run, or no return lies on the grid.
    SchemaError
        If the runs have different origins.
    FormatError
        If a run is damaged.
    """
    if not passes or block < 1:
        message = "there must be at least one pass, and block must be at least 1 scan."
        raise ValueError(message)
    require_one_frame([one.path for one in passes])
    sums = CellSums(grid, options.wanted(), threads=threads)
    for number, one in enumerate(passes):
        if number:
            sums.next_pass()
        _add_run(sums, one, screening, block, progress)
    tally = sums.tally

    def again(these: CellSums) -> None:
        for one in passes:
            _add_run(these, one, screening, block, progress)

    surface = surface_of(sums, options, again=again)
    surface = provenance.add_step(
        surface, "grid",
        parameters={
            "runs": [one.path.name for one in passes], "options": options, "screening": screening,
            "spacing": grid.spacing,
        },
    )  # fmt: skip
    return surface, asdict(tally)


def require_one_frame(paths: Sequence[Path]) -> tuple[float, ...]:
    """Origin of the local frame that all runs share.

    Parameters
    ----------
    paths : sequence of Path
        Stores of the runs.

    Returns
    -------
    tuple of float
        Longitude [deg], latitude [deg] and ellipsoidal height [m].

    Raises
    ------
    SchemaError
        If one differs.
    """
    origins = [tuple(float(part) for part in open_run(path).attrs["origin"]) for path in paths]
    for path, origin in zip(paths, origins, strict=True):
        if origin != origins[0]:
            raise SchemaError(
                f"is {list(origin)}, but that of {Path(paths[0]).name} is {list(origins[0])}",
                path=path,
                place="attribute origin",
                cure="Grid runs of one local frame, or georeference them to points of one CRS.",
            )
    return origins[0]


def _add_run(
    sums: CellSums, one: Pass, screening: Screening, block: int, progress: Progress
) -> None:
    tree = open_run(one.path)
    mounting = one.mounting or mounting_of(tree, path=one.path)
    scans = tree["scans"]
    time = _read(one.path, "time", slice(None))
    geometry = ScanGeometry(one.trajectory, mounting, scans["angle"], scans["delay"])
    covered = np.flatnonzero(geometry.covers(time))
    if not covered.size:
        knots = one.trajectory.time
        raise CoverageError(
            f"the motion, {knots[0]:.3f} s to {knots[-1]:.3f} s, covers none of the {time.size} "
            "scans",
            path=one.path,
            place="scans",
            cure="Compare the clocks of scanner and navigation: `trueterrain info`.",
        )
    attrs = _attrs(one.path, "range")
    with_intensity = screening.needs_intensity and "intensity" in scans
    for start in range(0, time.size, block):
        rows = slice(start, start + block)
        sums.add_scans(
            geometry, time[rows], _read(one.path, "range", rows),
            _read(one.path, "intensity", rows) if with_intensity else None,
            scale=float(attrs.get("scale_factor", 1.0)), missing=attrs.get("_FillValue"),
            screening=screening,
        )  # fmt: skip
        progress(one.path.stem, min(start + block, time.size), time.size)


def _read(path: Path, name: str, rows: slice) -> npt.NDArray[Any]:
    """Scans as they are stored: decoding them all to metres would take longer than gridding."""
    try:
        return np.asarray(_array(path, name)[rows])
    except (RuntimeError, ValueError, OSError, KeyError) as error:
        raise FormatError(
            f"is damaged ({error})", path=path, place=f"scans/{name} from {rows.start or 0}",
            cure="Copy the whole folder again.",
        ) from None  # fmt: skip


def _attrs(path: Path, name: str) -> dict[str, Any]:
    return dict(_array(path, name).attrs)


def _array(path: Path, name: str) -> Any:
    import zarr

    return zarr.open_array(path / "scans" / name, mode="r")
