"""Where a pass was, by where its returns lie: clouds do not say it themselves."""

import numpy as np
import numpy.typing as npt

from trueterrain.alignment.discontinuity.path import ReferencePath
from trueterrain.alignment.observations.cells import PassCells
from trueterrain.alignment.observations.centring import Path

Floats = npt.NDArray[np.float64]

_STEP = 0.5  # [s] over which returns are brought together
_STEPS = 40  # at least
_SMOOTH = 2.0  # [s] standard deviation of the window in which the way is taken for straight
_REACH = 4  # of these, to which the window extends
_LEAST = 1e-12  # of the largest weight, below which there is nothing near


def path_of_times(cells: PassCells) -> Path:
    """Way of a pass: a smooth line through the mean places of its returns.

    Parameters
    ----------
    cells : LaneCells
        What the pass saw, with times.

    Returns
    -------
    callable
        Easting, northing [m] and heading [rad] at some times.

    Notes
    -----
    At each time a straight line is fitted, with a constant speed, to places at about that time.
    The path is smooth on purpose: if it swung with where returns happen to lie, offsets would, and
    a roll that all lanes share would seem to be seen.
    """
    begin, span = float(cells.time.min()), float(np.ptp(cells.time))
    steps = max(_STEPS, int(np.ceil(span / _STEP)))
    width = max(span / steps, 1e-9)
    step = np.minimum(((cells.time - begin) / width).astype(np.int64), steps - 1)
    weight, x, y = (
        np.asarray(np.bincount(step, cells.count * values, steps), dtype=np.float64)
        for values in (np.ones(len(cells)), cells.easting, cells.northing)
    )
    middle = x.sum() / weight.sum(), y.sum() / weight.sum()  # small numbers stay exact
    reach = min(steps, int(np.ceil(_REACH * _SMOOTH / width)))
    lag = np.arange(-reach, reach + 1) * width
    window = np.exp(-0.5 * (lag / _SMOOTH) ** 2)

    def near(values: Floats, power: int) -> Floats:
        """Sums over the steps near each, times powers of how much later these are."""
        full = np.convolve(values, window * (-lag) ** power)
        return full[reach : reach + steps]

    s0, s1, s2 = (near(weight, power) for power in range(3))
    known = s0 > _LEAST * s0.max()
    places, speeds = [], []
    for values, centre in zip((x, y), middle, strict=True):
        about = values - centre * weight
        p0, p1 = near(about, 0)[known], near(about, 1)[known]
        free = s0[known] * s2[known] - s1[known] ** 2 + 1e-12 * s0[known] ** 2
        places.append(centre + (s2[known] * p0 - s1[known] * p1) / free)
        speeds.append((s0[known] * p1 - s1[known] * p0) / free)
    at = begin + (np.flatnonzero(known) + 0.5) * width

    def path(time: Floats) -> tuple[Floats, Floats, Floats]:
        ahead = time - np.clip(time, at[0], at[-1])
        vx, vy = (np.interp(time, at, values) for values in speeds)
        east, north = (np.interp(time, at, values) for values in places)
        return east + ahead * vx, north + ahead * vy, np.arctan2(vy, vx)

    return path


def unknown_path(time: Floats) -> tuple[Floats, Floats, Floats]:
    """Path that is not known yet.

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


def path_of_stations(way: ReferencePath) -> Path:
    """Where a path is at its stations.

    Parameters
    ----------
    way : ReferencePath
        The path.

    Returns
    -------
    callable
        Easting, northing [m] and heading [rad] at stations [m].
    """
    heading = np.unwrap(way.heading)

    def at(station: Floats) -> tuple[Floats, Floats, Floats]:
        easting, northing = way.at(station)
        return easting, northing, np.interp(station, way.station, heading)

    return at
