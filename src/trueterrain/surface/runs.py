"""Gridding of recorded runs, straight from ranges without points in between."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from trueterrain.core import provenance
from trueterrain.core.errors import SchemaError
from trueterrain.core.progress import Progress, no_progress
from trueterrain.formats.run import Run, open_run
from trueterrain.georeference import Screening
from trueterrain.surface._nodes import NodeValues, halo_of
from trueterrain.surface._recordings import Recording, read_ahead
from trueterrain.surface._windows import WindowPlan, plan_windows
from trueterrain.surface.accumulate import CellSums
from trueterrain.surface.cells import Grid
from trueterrain.surface.grid import compute_rows, name_deviations, require_heights
from trueterrain.surface.pass_record import PassRecord
from trueterrain.surface.settings import GridSettings

__all__ = ["BLOCK", "MEMORY", "PassRecord", "RunGridding", "grid_runs", "require_one_frame"]

#: Default number of scans in a block: whole chunks of a store.
BLOCK = 4000

#: Default memory for sums [bytes].
MEMORY = 256 << 20


def grid_runs(
    passes: Sequence[PassRecord],
    grid: Grid,
    options: GridSettings = GridSettings(),
    *,
    screening: Screening = Screening(),
    threads: int = 1,
    block: int = BLOCK,
    memory: int = MEMORY,
    progress: Progress = no_progress,
) -> tuple[xr.Dataset, dict[str, Any]]:
    """Grid recorded runs to a surface.

    `trueterrain.survey.build_surface` also fills holes; use this one for the gridding alone.

    Parameters
    ----------
    passes : sequence of PassRecord
        Runs with their motion, whose errors are independent unless `options.agreed` is set.
    grid : Grid
        The cells, in the local frame of the runs.
    options : GridSettings
        Statistic of the heights in a cell.
    screening : Screening
        Which returns are flagged, and whether they are kept.
    threads : int
        Threads that work at once; the surface does not depend on it.
    block : int
        Scans that are read at once; the surface does not depend on it.
    memory : int
        Memory for sums over the returns in cells [bytes]; a long grid is computed window by
        window, so that they take no more unless scans reach far along it. The surface does not
        depend on it.
    progress : callable, optional
        Called with the name of the run, and the scans done and to do.

    Returns
    -------
    surface : xarray.Dataset
        With ``height``, ``count`` and ``sd``; for aligned passes also ``sd_relative``, which leaves
        out the uncertainty of their common datum, see `name_deviations`.
    report : dict
        How many returns were ``used``, ``flagged``, ``outside`` of the grid or ``too_high``, and
        how many ``scans`` there were, ``scans_uncovered`` by the motion and ``bridged``.

    Raises
    ------
    ValueError
        If there is no pass, or `block` or `memory` is less than 1.
    CoverageError
        If the motion covers no scan of a run, or no return lies on the grid.
    SchemaError
        If the runs have different origins.
    FormatError
        If a run is damaged.
    """
    gridding = RunGridding(
        passes,
        grid,
        options,
        screening=screening,
        threads=threads,
        block=block,
        memory=memory,
        progress=progress,
    )
    return gridding.in_memory()


class RunGridding:
    """Gridding of recorded runs window by window, for surfaces that do not fit into memory.

    Parameters
    ----------
    passes, grid, options, screening, threads, block, memory, progress
        As of `grid_runs`.

    Raises
    ------
    ValueError, CoverageError, SchemaError, FormatError
        As by `grid_runs`.
    """

    def __init__(
        self,
        passes: Sequence[PassRecord],
        grid: Grid,
        options: GridSettings = GridSettings(),
        *,
        screening: Screening = Screening(),
        threads: int = 1,
        block: int = BLOCK,
        memory: int = MEMORY,
        progress: Progress = no_progress,
    ) -> None:
        if not passes or block < 1 or memory < 1:
            message = (
                "there must be at least one pass, block must be at least 1 scan, and memory at "
                "least 1 byte."
            )
            raise ValueError(message)
        self.grid, self._options = grid, options
        self._screening, self._block, self._progress = screening, block, progress
        require_one_frame([one.run for one in passes])
        self._names = [one.run.file_name for one in passes]
        self._recordings = [
            Recording(one, with_intensity=screening.needs_intensity) for one in passes
        ]
        wanted = options.kept_sums()
        self._plan = plan_windows(
            grid,
            self._recordings,
            wanted,
            margin=halo_of(options, grid),
            memory=memory,
            threads=threads,
            furthest=screening.furthest,
        )
        self._return_totals = self._plan.return_totals
        self._found = False  # whether a node has a height
        self._sums = CellSums(
            grid, wanted, threads=threads, rows=slice(self._plan.rows), poses=self._plan.poses
        )
        for one in self._recordings:
            self._sums.note_datum(one.geometry.trajectory.datum_sd)

    def windows(self) -> Iterator[range]:
        """Windows of rows to compute, in order; those that a scan reached unexpectedly come twice.

        Yields
        ------
        range
            Rows, for `compute`.
        """
        yield from self._plan.windows
        yield from sorted(self._plan.missed, key=lambda window: window.start)

    def compute(self, window: range, nodes: NodeValues | None = None) -> NodeValues:
        """Compute the nodes of a window.

        Parameters
        ----------
        window : range
            One of `windows`.
        nodes : NodeValues, optional
            Nodes to fill, those of the window among them; by default new ones.

        Returns
        -------
        NodeValues
            The nodes.
        """
        nodes = NodeValues.empty(window, self.grid.shape[1]) if nodes is None else nodes
        self._sums.move(self._plan.first(window))

        def add(those: CellSums) -> None:
            _add_scans(
                those,
                self._recordings,
                self._plan,
                window,
                self._screening,
                self._block,
                self._progress,
            )

        add(self._sums)
        self._return_totals.add(self._sums.return_totals)
        compute_rows(self._sums, self._options, window, nodes, add_data=add)
        self._found = self._found or bool(np.isfinite(nodes.of(window).height).any())
        return nodes

    def in_memory(self) -> tuple[xr.Dataset, dict[str, Any]]:
        """Compute all windows, and keep all nodes in memory.

        Returns
        -------
        surface : xarray.Dataset
            As by `grid_runs`.
        report : dict
            As by `grid_runs`.
        """
        nodes = NodeValues.empty(range(self.grid.shape[0]), self.grid.shape[1])
        for rows in self.windows():
            self.compute(rows, nodes)
        report = self.report()
        return self._surface(self.variables(nodes)), report

    def template(self, **others: Any) -> xr.Dataset:
        """Surface whose nodes all have the same values, which takes no memory.

        Parameters
        ----------
        **others
            Values of further variables, such as ``filled``.

        Returns
        -------
        xarray.Dataset
            Surface with the axes, variables and attributes of the result.
        """
        one = self.variables(NodeValues.empty(range(1), 1))
        values = {name: np.ravel(value)[0] for name, value in one.items()} | others
        return self._surface(
            {name: np.broadcast_to(value, self.grid.shape) for name, value in values.items()}
        )

    def variables(self, nodes: NodeValues) -> dict[str, Any]:
        """Variables of a surface: ``height``, ``count``, ``sd`` and ``sd_relative``.

        Parameters
        ----------
        nodes : NodeValues
            Nodes of some rows.

        Returns
        -------
        dict of numpy.ndarray
            Values by name, see `name_deviations`.
        """
        return {
            "height": nodes.height,
            "count": nodes.count,
            **name_deviations(nodes.sd, self._sums.datum_sd),
        }

    def _surface(self, variables: Mapping[str, Any]) -> xr.Dataset:
        return provenance.add_step(
            self.grid.surface(**variables),
            "grid",
            parameters={
                "runs": self._names,
                "options": self._options,
                "screening": self._screening,
                "spacing": self.grid.spacing,
            },
        )

    def report(self) -> dict[str, Any]:
        """Counts of returns and scans, after the last window.

        Returns
        -------
        dict
            As by `grid_runs`.

        Raises
        ------
        CoverageError
            If no node has a height.
        """
        require_heights(self._found, self._options, self._return_totals)
        return asdict(self._return_totals)


def require_one_frame(runs: Sequence[Run | str | Path]) -> tuple[float, ...]:
    """Origin of the local frame that all runs have in common.

    Parameters
    ----------
    runs : sequence of Run or path
        The runs, or their stores.

    Returns
    -------
    tuple of float
        Longitude [deg], latitude [deg] and ellipsoidal height [m].

    Raises
    ------
    SchemaError
        If one differs.
    """
    opened = [open_run(run) for run in runs]
    first = opened[0]
    for run in opened:
        if run.origin != first.origin:
            raise SchemaError(
                f"is {list(run.origin)}, but that of {first.file_name} is {list(first.origin)}",
                path=run.source,
                place="attribute origin",
                cure="Grid runs of one local frame, or georeference them to points of one CRS.",
            )
    return first.origin


def _add_scans(
    sums: CellSums,
    recordings: Sequence[Recording],
    plan: WindowPlan,
    window: range,
    screening: Screening,
    block: int,
    progress: Progress,
) -> None:
    """Add the scans that reach a window, pass by pass."""
    wanted = (
        (number, index)
        for number, one in enumerate(recordings)
        for index in one.blocks(plan.reaching(number, window), block)
    )
    for number, index, ranges, intensity in read_ahead(recordings, wanted):
        one = recordings[number]
        while sums.passes <= number:
            sums.next_pass()
        reach = plan.reach_of(number, index)
        sums.add_scans(
            one.geometry,
            one.time[index],
            ranges,
            intensity,
            scale=one.scale,
            missing=one.missing,
            screening=screening,
            reach=reach,
        )
        done = int(index[-1]) + 1
        if reach is not None:
            plan.note(number, index, reach, window)
            done = plan.done(number)
        progress(one.name, done, one.time.size)
    while sums.passes < len(recordings):
        sums.next_pass()
