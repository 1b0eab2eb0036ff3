"""Stations: lengths along points, and points at equal spacing."""

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

#: Most points of a curve: 1000 km at 10 mm, an array of which takes 0.8 GB.
MOST_POINTS = 100_000_000


def chord_lengths(easting: Floats, northing: Floats) -> Floats:
    """Length along straight chords up to each point.

    Parameters
    ----------
    easting, northing : numpy.ndarray, shape (n,)
        Points [m].

    Returns
    -------
    numpy.ndarray, shape (n,)
        Lengths, 0 at the first point [m].

    Examples
    --------
    >>> chord_lengths(np.array([0.0, 3.0, 3.0]), np.array([0.0, 4.0, 5.0]))
    array([0., 5., 6.])
    """
    return np.append(0.0, np.cumsum(np.hypot(np.diff(easting), np.diff(northing))))


def equal_stations(length: float, spacing: float) -> Floats:
    """Stations at equal spacing from 0.

    Parameters
    ----------
    length, spacing : float
        Length of the curve and spacing of its points [m].

    Returns
    -------
    numpy.ndarray, shape (s,)
        Stations, at least 2 [m].

    Raises
    ------
    ValueError
        If the spacing is not greater than 0 or longer than the curve, or leaves too many points.
    """
    require_spacing(spacing)
    count = np.floor(length / spacing + 1e-6) + 1  # less than that is round-off
    if not count <= MOST_POINTS:
        message = (
            f"spacing must leave at most {MOST_POINTS:,} points on a path of {length:g} m, "
            f"got {spacing:g} m: choose a coarser one."
        )
        raise ValueError(message)
    if count < 2:
        message = f"the path is {length:g} m long, shorter than the spacing of {spacing:g} m."
        raise ValueError(message)
    return spacing * np.arange(count)


def require_spacing(spacing: float) -> None:
    """Raise ValueError unless a spacing is greater than 0 m and finite.

    Parameters
    ----------
    spacing : float
        Distance between points [m].
    """
    if not (spacing > 0 and np.isfinite(spacing)):
        message = f"spacing must be greater than 0 m, got {spacing}."
        raise ValueError(message)
