"""Points on the command line: filters, extents, counters, and notes on units and classes."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from trueterrain.cli._console import write_note

if TYPE_CHECKING:
    from collections.abc import Iterator

    import xarray as xr

    from trueterrain.core import Progress
    from trueterrain.formats import PointFilter
    from trueterrain.profile import PlaneCurve

_MAX_CELLS = 1024  # cells per axis of the mask of points near a path

#: Option ``--class`` of a command that reads points.
Classes = Annotated[str | None, Parameter(name="--class")]

#: Option ``--return`` of a command that reads points.
Returns = Annotated[str | None, Parameter(name="--return")]


def point_filter(classes: str | None, returns: str | None) -> "PointFilter | None":
    """Filter of points by the options ``--class`` and ``--return``.

    Parameters
    ----------
    classes : str or None
        Class numbers separated by commas.
    returns : str or None
        "first", "last", or the number of the return.

    Returns
    -------
    PointFilter or None
        None if neither option is given.

    Raises
    ------
    ValueError
        If an option is neither of these.
    """
    if classes is None and returns is None:
        return None
    from trueterrain.formats import PointFilter

    try:
        numbers = tuple(int(number) for number in (classes or "").split(",") if classes)
    except ValueError:
        message = f"--class takes numbers between commas, such as 2,11, got {classes!r}."
        raise ValueError(message) from None
    which: str | int | None = returns
    if returns is not None and returns not in ("first", "last"):
        if not returns.isdecimal():
            message = f"--return takes first, last or a number, got {returns!r}."
            raise ValueError(message)
        which = int(returns)
    return PointFilter(classes=numbers, returns=which)  # type: ignore[arg-type]  # PointFilter checks it


def require_points(only: "PointFilter | None", path: Path, kind: str) -> None:
    """Raise ValueError if a filter of points is given for a file that holds no points.

    Parameters
    ----------
    only : PointFilter or None
        Filter by the options.
    path : Path
        The file.
    kind : str
        Kind of the file, as by `trueterrain.formats.kind_of_file`.
    """
    if only is not None and kind != "points":
        message = f"--class and --return choose points, got {path}, which holds a {kind}."
        raise ValueError(message)


def note_conversion(files: Iterable[Path], crs: str | None = None) -> None:
    """Note the files that are in feet, and how they are converted to metres.

    Parameters
    ----------
    files : iterable of Path
        Files of points.
    crs : str, optional
        Coordinate reference system that replaces those of the files.
    """
    from trueterrain import formats

    for file in files:
        if text := formats.conversion_of(file, crs):
            write_note(f"{file}: {text}")


class PointCounter:
    """Iterator over blocks of points that counts them and shows progress.

    Parameters
    ----------
    blocks : iterator of xarray.Dataset
        Points.
    progress : callable
        Shows progress.
    """

    def __init__(self, blocks: "Iterator[xr.Dataset]", progress: "Progress") -> None:
        self._blocks = blocks
        self._progress = progress
        self.points = 0
        self.last: xr.Dataset | None = None

    def __iter__(self) -> "Iterator[xr.Dataset]":
        for block in self._blocks:
            yield block
            # counted after the yield: a block counts when its consumer asks for the next one
            self.points += block.sizes["point"]
            self.last = block
            self._progress(f"{self.points:,} points", 0, None)


class PointsAlong:
    """Blocks of points near a path, with a count of the points in each class.

    Points of classes above the ground, such as vegetation, are counted only within `reach` of the
    path: elsewhere they do not affect the profile and need no warning.

    Parameters
    ----------
    blocks : iterator of xarray.Dataset
        Points.
    path : PlaneCurve
        Points of the path.
    reach : float
        Maximum distance from a point of the path [m].
    """

    def __init__(self, blocks: "Iterator[xr.Dataset]", path: "PlaneCurve", reach: float) -> None:
        import numpy as np
        from scipy.ndimage import binary_dilation
        from scipy.spatial import cKDTree

        from trueterrain.formats.point_filter import ReturnCounts

        self._blocks = blocks
        self._reach = reach
        self._counts = ReturnCounts()
        position = np.stack([path.easting, path.northing], axis=1)
        self._tree = cKDTree(position)
        self._corner = position.min(axis=0) - reach
        extent = np.ptp(position, axis=0) + 2 * reach
        # a coarse mask of cells near the path, at least `reach` wide, spares most points the tree
        self._cell = max(reach, float(extent.max()) / _MAX_CELLS)
        shape = np.floor(extent / self._cell).astype(int) + 1
        touched = np.zeros(shape, bool)
        touched[tuple(((position - self._corner) / self._cell).astype(int).T)] = True
        self._near = binary_dilation(touched, np.ones((3, 3), bool))

    def __iter__(self) -> "Iterator[xr.Dataset]":
        for block in self._blocks:
            if "classification" in block:
                self._count(block)
            yield block

    @property
    def classes(self) -> dict[str, int]:
        """Number of points by class; classes above the ground are counted near the path only."""
        return self._counts.classes

    def _count(self, block: "xr.Dataset") -> None:
        import numpy as np

        from trueterrain.formats.point_filter import ABOVE_GROUND

        classes = block["classification"].values
        above = np.isin(classes, ABOVE_GROUND)
        self._counts.add({"classification": classes[~above]})
        position = np.stack([block[name].values[above] for name in ("easting", "northing")], axis=1)
        cell = np.floor((position - self._corner) / self._cell)
        inside = np.flatnonzero(((cell >= 0) & (cell < self._near.shape)).all(axis=1))
        inside = inside[self._near[tuple(cell[inside].astype(int).T)]]
        distance, _ = self._tree.query(position[inside], distance_upper_bound=self._reach)
        near = inside[np.isfinite(distance)]
        self._counts.add({"classification": classes[above][near]})
