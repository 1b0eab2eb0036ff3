"""Read scans from tables, block by block."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from trueterrain.core.errors import FormatError
from trueterrain.formats.number_table import table_blocks, table_columns
from trueterrain.formats.run._files import ScanTable

Floats = npt.NDArray[np.float64]

ROWS = 1_000_000  # cells of ranges read at a time
_STAMP = 2e-6  # [s] tolerance of the times of beams: rounded stamps
_NEAR = 0.25  # tolerance of the angles of beams, as a fraction of the spacing of the fan


@dataclass(frozen=True, kw_only=True)
class ScanBlock:
    """Times [s], ranges [m] and intensities of some scans."""

    time: Floats
    range: Floats
    intensity: Floats | None


def scan_table_blocks(path: Path, table: ScanTable, cells: int = ROWS) -> Iterator[ScanBlock]:
    """Read the scans of a table block by block.

    Parameters
    ----------
    path : Path
        The table.
    table : ScanTable
        Description of its columns.
    cells : int
        Approximate number of ranges in a block.

    Yields
    ------
    ScanBlock
        Times [s], ranges [m], NaN where there was no return, and intensities.

    Raises
    ------
    FormatError
        Naming row and column: a missing column, a beam that the fan does not have, a beam twice in
        a scan, times of beams that do not follow the fan.
    """
    if table.layout == "scans":
        yield from _wide_scans(path, table, cells)
    else:
        yield from _long_scans(path, table, cells)


def _wide_scans(path: Path, table: ScanTable, cells: int) -> Iterator[ScanBlock]:
    _, delay = table.fan()
    labels = table_columns(path)
    ranges = _numbered_columns(path, labels, table.range, delay.size)
    returns = (
        _numbered_columns(path, labels, table.intensity, delay.size) if table.intensity else []
    )
    names = [table.time, *ranges, *returns]
    for block in table_blocks(path, names, max(1, cells // delay.size)):
        yield ScanBlock(
            time=block[table.time] * table.time_scale,
            range=_in_metres(np.stack([block[name] for name in ranges], axis=-1), table),
            intensity=np.stack([block[name] for name in returns], axis=-1) if returns else None,
        )


def _numbered_columns(path: Path, labels: list[str], start: str, beams: int) -> list[str]:
    found = {
        int(label.removeprefix(start)): label
        for label in labels
        if label.startswith(start) and label.removeprefix(start).isdecimal()
    }
    if len(found) != beams:
        raise FormatError(
            f"has {len(found)} columns {start}0, {start}1, ..., but the fan has {beams} beams",
            path=path,
            place="header",
            cure="Correct the fan in the description, or the names of the columns.",
        )
    return [found[number] for number in sorted(found)]


def _long_scans(path: Path, table: ScanTable, cells: int) -> Iterator[ScanBlock]:
    """Scans of a table with a row per return; the last scan of a block waits for its other rows."""
    where = table.beam or table.angle
    names = [table.time, where, table.range]
    names += [name for name in (table.intensity, table.scan) if name]
    waiting: dict[str, Floats] | None = None
    row = 0  # index of the first row of the block, including those that wait
    for block in table_blocks(path, names, max(cells, table.fan()[0].size)):
        rows = block if waiting is None else _join_columns(waiting, block)
        sorter = _ScanSorter(path, table, rows, row)
        last = int(sorter.starts[-1])
        if last:
            yield sorter.scans(last)
        waiting = {name: values[last:] for name, values in rows.items()}
        row += last
    if waiting is not None:
        sorter = _ScanSorter(path, table, waiting, row)
        yield sorter.scans(waiting[table.time].size)


def _join_columns(first: dict[str, Floats], then: dict[str, Floats]) -> dict[str, Floats]:
    return {name: np.concatenate([first[name], then[name]]) for name in then}


class _ScanSorter:
    """Assignment of the rows of a table to scans and beams."""

    def __init__(self, path: Path, table: ScanTable, rows: dict[str, Floats], row: int) -> None:
        self._path, self._table, self._rows, self._row = path, table, rows, row
        self._angle, self._delay = table.fan()
        self._beam = self._beams_of(rows)
        stamps = rows[table.time] * table.time_scale
        self._time = stamps - self._delay[self._beam] if table.time_of == "beam" else stamps
        self.starts = self._starts_of(rows)

    def scans(self, end: int) -> ScanBlock:
        """Scans of the rows before row `end`."""
        starts = self.starts[self.starts < end]
        number = np.repeat(np.arange(starts.size), np.diff([*starts, end]))
        time, beam = self._time[:end], self._beam[:end]
        self._check_times(time, time[starts][number])
        cell = number * self._delay.size + beam
        self._check_doubles(cell)
        shape = (starts.size, self._delay.size)
        ranges = np.full(shape, np.nan)
        ranges.flat[cell] = self._rows[self._table.range][:end]
        intensity = None
        if self._table.intensity:
            intensity = np.full(shape, np.nan)
            intensity.flat[cell] = self._rows[self._table.intensity][:end]
        return ScanBlock(
            time=time[starts], range=_in_metres(ranges, self._table), intensity=intensity
        )

    def _starts_of(self, rows: dict[str, Floats]) -> npt.NDArray[np.intp]:
        """Indices of the rows at which scans begin."""
        if self._table.scan:
            begins = np.diff(rows[self._table.scan]) != 0
        else:
            # the times of two scans differ by more than the delay of the last beam
            apart = self._delay.max() / 2 if self._table.time_of == "beam" else 0.0
            begins = np.abs(np.diff(self._time)) > apart
        return np.concatenate([[0], np.flatnonzero(begins) + 1])

    def _beams_of(self, rows: dict[str, Floats]) -> npt.NDArray[np.intp]:
        table, beams = self._table, self._delay.size
        if table.beam:
            number = rows[table.beam]
            bad = ~((number >= 0) & (number < beams) & (number == np.rint(number)))
            self._refuse(bad, table.beam, f"must be a beam from 0 to {beams - 1}", number)
            return number.astype(np.intp)
        angle = np.deg2rad(rows[table.angle]) if table.degrees else rows[table.angle]
        order = np.argsort(self._angle)
        edges = (self._angle[order][1:] + self._angle[order][:-1]) / 2
        beam = order[np.searchsorted(edges, angle)]
        spacing = float(np.min(np.abs(np.diff(self._angle)))) if beams > 1 else np.inf
        bad = ~(np.abs(angle - self._angle[beam]) <= _NEAR * spacing)
        self._refuse(bad, table.angle, "must be the angle of a beam of the fan", rows[table.angle])
        return np.asarray(beam, dtype=np.intp)

    def _check_times(self, time: Floats, of_scan: Floats) -> None:
        tolerance = max(_STAMP, self._table.beam_interval / 2)
        if self._table.time_of == "scan":
            tolerance = 0.0
        self._refuse(
            np.abs(time - of_scan) > tolerance,
            self._table.time,
            "must be the time of the scan, plus beam_interval for each beam where "
            "time_of is 'beam'",
            self._rows[self._table.time],
        )

    def _check_doubles(self, cell: npt.NDArray[np.intp]) -> None:
        if not cell.size:
            return
        first = np.full(int(cell.max()) + 1, -1)
        first[cell[::-1]] = np.arange(cell.size)[::-1]
        bad = first[cell] != np.arange(cell.size)
        name = self._table.beam or self._table.angle
        rule = "must hold each beam of a scan once (keep the first or the strongest return)"
        self._refuse(bad, name, rule, self._rows[name])

    def _refuse(self, bad: Any, name: str, rule: str, values: Floats) -> None:
        if bad.any():
            index = int(np.flatnonzero(bad)[0])
            raise FormatError(
                f"{rule}, got {values[index]:.10g}",
                path=self._path,
                place=f"row {self._row + index + 1}, column {name!r}",
                cure="Correct the description or the table.",
            )


def _in_metres(ranges: Floats, table: ScanTable) -> Floats:
    lost = ranges == 0
    if table.no_return is not None:
        lost |= ranges == table.no_return
    return np.where(lost, np.nan, ranges * table.range_scale)
