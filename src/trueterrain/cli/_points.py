"""Points on the command line: which are taken, and what is said of their units and classes."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from trueterrain.cli._console import write_note

if TYPE_CHECKING:
    from collections.abc import Iterator

    import xarray as xr

    from trueterrain.formats import PointFilter
    from trueterrain.profile import WheelPath

_CELLS = 1024  # most cells per axis in which points near a path are looked for

#: Option of a command that reads points: their classes.
Classes = Annotated[str | None, Parameter(name="--class")]

#: Option of a command that reads points: their returns.
Returns = Annotated[str | None, Parameter(name="--return")]


def point_filter(classes: str | None, returns: str | None) -> "PointFilter | None":
    """Filter that the options name.

    Parameters
    ----------
    classes : str or None
        Numbers of classes between commas.
    returns : str or None
        first, last, or a number.

    Returns
    -------
    PointFilter or None
        None if no option is given.

    Raises
    ------
    ValueError
        If an option means nothing.
    """
    if classes is None and returns is None:
        return None
    from trueterrain.formats import PointFilter

    try:
        numbers = tuple(int(one) for one in (classes or "").split(",") if classes)
    except ValueError:
        message = f"--class takes numbers between commas, such as 2,11, got {classes!r}."
        raise ValueError(message) from None
    which: str | int | None = returns
    if returns is not None and returns not in ("first", "last"):
        if not returns.isdecimal():
            message = f"--return takes first, last or a number, got {returns!r}."
            raise ValueError(message)
        which = int(returns)
    return PointFilter(classes=numbers, returns=which)  # type: ignore[arg-type]  # checked by itself


def require_points(only: "PointFilter | None", path: Path, kind: str) -> None:
    """Raise ValueError if points are chosen in a file that holds something else.

    Parameters
    ----------
    only : PointFilter or None
        What the options name.
    path : Path
        The file.
    kind : str
        Its kind, as by `trueterrain.formats.kind_of_file`.
    """
    if only is not None and kind != "points":
        message = f"--class and --return choose points, got {path}, which holds a {kind}."
        raise ValueError(message)


def note_conversion(files: Iterable[Path], crs: str | None = None) -> None:
    """Say which files are in feet, and how they become metres.

    Parameters
    ----------
    files : iterable of Path
        Files of points.
    crs : str, optional
        Coordinate reference system that is taken instead of what the files say.
    """
    from trueterrain import formats

    for file in files:
        if text := formats.conversion_of(file, crs):
            write_note(f"{file}: {text}")


class PointsAlong:
    """Blocks of points, and what of them is no ground within reach of a path.

    Parameters
    ----------
    blocks : iterator of xarray.Dataset
        Points.
    path : WheelPath
        Path points.
    reach : float
        Largest distance from a path point [m].
    """

    def __init__(self, blocks: "Iterator[xr.Dataset]", path: "WheelPath", reach: float) -> None:
        import numpy as np
        from scipy.ndimage import binary_dilation
        from scipy.spatial import cKDTree

        from trueterrain.formats.point_filter import ReturnCounts

        self._blocks = blocks
        self._reach = reach
        self._counts = ReturnCounts()
        at = np.stack([path.easting, path.northing], axis=1)
        self._tree = cKDTree(at)
        self._low = at.min(axis=0) - reach
        extent = np.ptp(at, axis=0) + 2 * reach
        self._cell = max(reach, float(extent.max()) / _CELLS)
        shape = np.floor(extent / self._cell).astype(int) + 1
        touched = np.zeros(shape, bool)
        touched[tuple(((at - self._low) / self._cell).astype(int).T)] = True
        self._touched = binary_dilation(touched, np.ones((3, 3), bool))

    def __iter__(self) -> "Iterator[xr.Dataset]":
        for block in self._blocks:
            if "classification" in block:
                self._count(block)
            yield block

    @property
    def classes(self) -> dict[str, int]:
        """Points by class; of those above the ground only the ones along the path."""
        return self._counts.classes

    def _count(self, block: "xr.Dataset") -> None:
        import numpy as np

        from trueterrain.formats.point_filter import ABOVE_GROUND

        classes = block["classification"].values
        other = np.isin(classes, ABOVE_GROUND)
        self._counts.add({"classification": classes[~other]})
        at = np.stack([block[name].values[other] for name in ("easting", "northing")], axis=1)
        cell = np.floor((at - self._low) / self._cell)
        inside = np.flatnonzero(((cell >= 0) & (cell < self._touched.shape)).all(axis=1))
        inside = inside[self._touched[tuple(cell[inside].astype(int).T)]]
        distance, _ = self._tree.query(at[inside], distance_upper_bound=self._reach)
        near = inside[np.isfinite(distance)]
        self._counts.add({"classification": classes[other][near]})
