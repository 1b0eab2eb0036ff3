"""Cells of the ground as one pass saw them: what passes are compared by."""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

#: Easting, northing [m] and heading [rad] of a pass as functions of time.
PassPath = Callable[[Floats], tuple[Floats, Floats, Floats]]

_STEP = 0.5  # [s] or [m] difference quotient of the speed, and maximum change of a time
_SLOW = 1e-3  # [m/s] speed below which a pass stands still


@dataclass(frozen=True, kw_only=True, eq=False)
class PassCells:
    """Cells of a common grid as one pass saw them: mean position, height, slope, variance.

    The observations of all methods of alignment. A cell that the pass visits repeatedly occurs
    repeatedly.
    """

    name: str
    "Name of the pass."

    cell: Integers
    "Number of the cell in the common grid, shape (n,)."

    time: Floats
    "Mean time [s], or station [m], of its returns, shape (n,)."

    easting: Floats
    "Mean position of its returns [m], shape (n,)."

    northing: Floats
    "Mean position of its returns [m], shape (n,)."

    height: Floats
    "Mean height of its returns [m], shape (n,)."

    variance: Floats
    "Variance of that mean from the scatter of the returns about their plane [m²], shape (n,)."

    count: Integers
    "Number of returns, shape (n,)."

    slope_east: Floats
    "Slope of the ground towards east [1], shape (n,)."

    slope_north: Floats
    "Slope of the ground towards north [1], shape (n,)."

    offset: Floats
    "Lateral distance from the path of the pass, to the left positive [m], shape (n,)."

    longitudinal: Floats
    "Longitudinal distance from the body, forward positive [m], shape (n,)."

    sd_time: Floats | None = None
    "Times [s] or stations [m] of the reported standard deviations, ascending."

    sd_height: Floats | None = None
    "Reported standard deviation of the height at these times [m]."

    def __post_init__(self) -> None:
        """Check shapes and values."""
        if not self.name:
            message = "name must not be empty."
            raise ValueError(message)
        for entry in fields(self):
            value = getattr(self, entry.name)
            if entry.name in ("name", "sd_time", "sd_height"):
                continue
            if value.shape != self.cell.shape or value.ndim != 1:
                message = (
                    f"{entry.name} must hold one value for each of the {self.cell.size} cells of "
                    f"{self.name}, got the shape {value.shape}."
                )
                raise ValueError(message)
            if not np.isfinite(value).all():
                message = f"{entry.name} of {self.name} must be finite."
                raise ValueError(message)
        if not (self.variance >= 0).all():
            message = f"variance of {self.name} must not be negative."
            raise ValueError(message)
        if (self.sd_time is None) != (self.sd_height is None):
            message = f"sd_time and sd_height of {self.name} must both be given, or neither."
            raise ValueError(message)
        if self.sd_time is not None and self.sd_height is not None:
            good = (
                self.sd_time.shape == self.sd_height.shape
                and self.sd_time.ndim == 1
                and self.sd_time.size > 0
                and (np.diff(self.sd_time) >= 0).all()
                and (self.sd_height > 0).all()
            )
            if not good:
                message = (
                    f"sd_time of {self.name} must ascend and sd_height be greater than 0 m, one "
                    "for each time."
                )
                raise ValueError(message)

    def __len__(self) -> int:
        """Number of entries."""
        return self.cell.size

    def part(self, some: npt.NDArray[np.bool_] | Integers) -> "PassCells":
        """Select cells.

        Parameters
        ----------
        some : numpy.ndarray of bool or int
            Mask or indices.

        Returns
        -------
        PassCells
            The selected cells.
        """
        kept = {
            entry.name: getattr(self, entry.name)[some]
            for entry in fields(self)
            if entry.name not in ("name", "sd_time", "sd_height")
        }
        return PassCells(name=self.name, **kept, sd_time=self.sd_time, sd_height=self.sd_height)


def make_pass_cells(
    name: str,
    cell: npt.ArrayLike,
    time: npt.ArrayLike,
    height: npt.ArrayLike,
    *,
    variance: npt.ArrayLike,
    easting: npt.ArrayLike = 0.0,
    northing: npt.ArrayLike = 0.0,
    count: npt.ArrayLike = 1,
    slope_east: npt.ArrayLike = 0.0,
    slope_north: npt.ArrayLike = 0.0,
    offset: npt.ArrayLike = 0.0,
    longitudinal: npt.ArrayLike = 0.0,
    sd_time: npt.ArrayLike | None = None,
    sd_height: npt.ArrayLike | None = None,
) -> PassCells:
    """Make cells of a pass or of control points from arrays, or numbers for all cells.

    Parameters
    ----------
    name : str
        Name of the pass.
    cell : array_like of int, shape (n,)
        Number of the cell in the common grid.
    time : array_like
        Time [s], or station [m].
    height : array_like
        Mean height [m].
    variance : array_like
        Variance of the mean height [m²].
    easting, northing : array_like
        Mean position of the returns [m].
    count : array_like of int
        Number of returns.
    slope_east, slope_north : array_like
        Slope of the ground [1].
    offset, longitudinal : array_like
        Lateral distance from the path, to the left positive, and longitudinal distance from the
        body [m].
    sd_time, sd_height : array_like, optional
        Times, and reported standard deviations of the height [m].

    Returns
    -------
    PassCells
        In the order given.

    Examples
    --------
    >>> len(make_pass_cells("south", [7, 8], [0.1, 0.2], [1.0, 1.1], variance=1e-6))
    2
    """
    number = np.asarray(cell, dtype=np.int64)

    def column(values: npt.ArrayLike) -> Floats:
        return np.broadcast_to(np.asarray(values, dtype=np.float64), number.shape).copy()

    return PassCells(
        name=name,
        cell=number,
        time=column(time),
        easting=column(easting),
        northing=column(northing),
        height=column(height),
        variance=column(variance),
        count=np.broadcast_to(np.asarray(count, dtype=np.int64), number.shape).copy(),
        slope_east=column(slope_east),
        slope_north=column(slope_north),
        offset=column(offset),
        longitudinal=column(longitudinal),
        sd_time=None if sd_time is None else np.asarray(sd_time, dtype=np.float64),
        sd_height=None if sd_height is None else np.asarray(sd_height, dtype=np.float64),
    )


def move_to_centres(cells: PassCells, path: PassPath, size: float) -> PassCells:
    """Move times and offsets of cells to their centres, which are the same for all passes.

    Parameters
    ----------
    cells : PassCells
        Cells with the times of the mean positions of their returns.
    path : callable
        Position and heading of the pass as functions of time.
    size : float
        Size of the cells [m].

    Returns
    -------
    PassCells
        With the time at which the pass saw the centre of the cell, and ``offset`` and
        ``longitudinal`` of the centre.

    Notes
    -----
    The returns of two passes in a cell have different mean positions; heights are reduced to a
    common position along the slope of the ground. Time and offset must refer to the same position:
    otherwise a tilt that all passes have in common would change their differences, and would be
    confused with errors of the slope.
    """
    x, y = ((np.floor(at / size) + 0.5) * size for at in (cells.easting, cells.northing))
    east, north, heading = path(cells.time)
    later = path(cells.time + _STEP)
    speed = np.hypot(later[0] - east, later[1] - north) / _STEP
    cos, sin = np.cos(heading), np.sin(heading)
    # distance from the mean position to the centre along the path, divided by the speed
    along = (x - cells.easting) * cos + (y - cells.northing) * sin
    shift = np.divide(along, speed, out=np.zeros_like(along), where=speed > _SLOW)
    time = cells.time + np.clip(shift, -_STEP, _STEP)
    time = np.clip(time, cells.time.min(), cells.time.max())
    east, north, heading = path(time)
    cos, sin = np.cos(heading), np.sin(heading)
    return replace(
        cells,
        time=time,
        offset=(y - north) * cos - (x - east) * sin,
        longitudinal=(x - east) * cos + (y - north) * sin,
    )
