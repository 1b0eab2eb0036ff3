"""Path of a pass from the positions of its returns, for clouds without trajectory.

With times it is a function of time; without, stations along the pass replace them.
"""

import numpy as np
import numpy.typing as npt

from trueterrain.alignment.clouds.passes import CloudPass
from trueterrain.alignment.discontinuity.centre_line import centre_reference
from trueterrain.alignment.discontinuity.reference_path import ReferencePath, straight_reference
from trueterrain.alignment.observations import overlap as coarse
from trueterrain.alignment.observations.cells import PassCells, PassPath
from trueterrain.alignment.observations.overlap import Overlap
from trueterrain.alignment.settings import CellSettings
from trueterrain.core.errors import CoverageError

Floats = npt.NDArray[np.float64]

_STEP = 0.5  # [s] over which positions of returns are averaged
_MIN_STEPS = 40
_SMOOTH = 2.0  # [s] standard deviation of the Gaussian weights of the linear fit
_REACH = 4  # half-width of the weights, in standard deviations
_MIN_WEIGHT = 1e-12  # of the largest weight, below which there are no returns
_FULL = 0.5  # fraction of the bounding rectangle that a straight pass covers
_PARTS = 20  # minimum number of reference points along a pass
_SPACING = 1.0  # [m] of the reference points


def path_of_times(cells: PassCells) -> PassPath:
    """Path of a pass: a smooth curve through the mean positions of its returns.

    Parameters
    ----------
    cells : PassCells
        Cells of the pass, with times.

    Returns
    -------
    callable
        Easting, northing [m] and heading [rad] as functions of time.

    Notes
    -----
    Local linear regression: at each time a motion of constant velocity is fitted to the positions,
    with Gaussian weights of the time difference. The path must be smooth: if it followed the random
    positions of returns, offsets would too, and a roll common to all passes would appear
    observable.
    """
    begin, span = float(cells.time.min()), float(np.ptp(cells.time))
    steps = max(_MIN_STEPS, int(np.ceil(span / _STEP)))
    width = max(span / steps, 1e-9)
    step = np.minimum(((cells.time - begin) / width).astype(np.int64), steps - 1)
    weight, x, y = (
        np.asarray(np.bincount(step, cells.count * values, steps), dtype=np.float64)
        for values in (np.ones(len(cells)), cells.easting, cells.northing)
    )
    # relative to the mean, which avoids cancellation at map coordinates
    mean = x.sum() / weight.sum(), y.sum() / weight.sum()
    reach = min(steps, int(np.ceil(_REACH * _SMOOTH / width)))
    lag = np.arange(-reach, reach + 1) * width
    window = np.exp(-0.5 * (lag / _SMOOTH) ** 2)

    def near(values: Floats, power: int) -> Floats:
        """Weighted moments of the time difference about each step."""
        full = np.convolve(values, window * (-lag) ** power)
        return full[reach : reach + steps]

    s0, s1, s2 = (near(weight, power) for power in range(3))
    known = s0 > _MIN_WEIGHT * s0.max()
    places, speeds = [], []
    for values, centre in zip((x, y), mean, strict=True):
        about = values - centre * weight
        p0, p1 = near(about, 0)[known], near(about, 1)[known]
        determinant = s0[known] * s2[known] - s1[known] ** 2 + 1e-12 * s0[known] ** 2
        places.append(centre + (s2[known] * p0 - s1[known] * p1) / determinant)
        speeds.append((s0[known] * p1 - s1[known] * p0) / determinant)
    at = begin + (np.flatnonzero(known) + 0.5) * width

    def path(time: Floats) -> tuple[Floats, Floats, Floats]:
        beyond = time - np.clip(time, at[0], at[-1])
        vx, vy = (np.interp(time, at, values) for values in speeds)
        east, north = (np.interp(time, at, values) for values in places)
        return east + beyond * vx, north + beyond * vy, np.arctan2(vy, vx)

    return path


def unknown_path(time: Floats) -> tuple[Floats, Floats, Floats]:
    """Placeholder for a path that is not known yet.

    Parameters
    ----------
    time : numpy.ndarray
        Times [s].

    Returns
    -------
    tuple of numpy.ndarray
        Zeros.
    """
    none = np.zeros(time.size)
    return none, none, none


def path_of_stations(path: ReferencePath) -> PassPath:
    """Path as a function of station.

    Parameters
    ----------
    path : ReferencePath
        Reference path.

    Returns
    -------
    callable
        Easting, northing [m] and heading [rad] as functions of station [m].
    """
    heading = np.unwrap(path.curve.heading)

    def at(station: Floats) -> tuple[Floats, Floats, Floats]:
        easting, northing = path.curve.position_at(station)
        return easting, northing, np.interp(station, path.curve.s, heading)

    return at


def station_path(cloud: CloudPass, settings: CellSettings) -> ReferencePath:
    """Path along the centre of a pass.

    Parameters
    ----------
    cloud : CloudPass
        The pass, whose points are read.
    settings : CellSettings
        Size of the cells from which the path is found.

    Returns
    -------
    ReferencePath
        Straight along the principal axis if the pass covers half of its bounding rectangle, else
        along its centre line, curved or closed.
    """
    cells = coarse.occupied_cells(cloud.heights, settings.size, name=cloud.name)
    straight, fraction = _principal_axis(cells)
    if fraction >= _FULL:
        return straight
    whole = Overlap(names=(cloud.name, cloud.name), cells=(cells, cells), key=cells.covered)
    try:
        spacing = straight.curve.spacing
        return centre_reference(whole, spacing=spacing, smoothing=10 * spacing)
    except CoverageError:
        return straight  # scattered pieces have no centre line


def _principal_axis(cells: coarse.OccupiedCells) -> tuple[ReferencePath, float]:
    """Line along the principal axis of cells, and the covered fraction of their rectangle."""
    places = np.stack(coarse.cell_centres(cells.key, cells.cell))
    mean = places.mean(axis=1, keepdims=True)
    _, axes = np.linalg.eigh((places - mean) @ (places - mean).T)
    axis = axes[:, 1] * (1.0 if tuple(axes[:, 1]) > (0.0, 0.0) else -1.0)
    u = axis @ (places - mean)
    v = np.array([-axis[1], axis[0]]) @ (places - mean)
    begin, end = float(u.min()) - cells.cell, float(u.max()) + cells.cell
    start, stop = (tuple((mean[:, 0] + at * axis).tolist()) for at in (begin, end))
    spacing = min(_SPACING, (end - begin) / _PARTS)
    box = (end - begin - cells.cell) * (float(np.ptp(v)) + cells.cell)
    return straight_reference(start, stop, spacing=spacing), cells.key.size * cells.cell**2 / box
