"""Surfaces and points sampled from a ground."""

from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.provenance import add_step
from trueterrain.core.schemas import make_points, make_surface
from trueterrain.simulate.ground._ground import Floats, Ground, check_seed

_TOLERANCE = 1e-6  # [1] of a length over its spacing, from a whole number


def sample_surface(
    ground: Ground, *, easting: npt.ArrayLike, northing: npt.ArrayLike
) -> xr.Dataset:
    """Surface of a ground over a map.

    Parameters
    ----------
    ground : Ground
        The ground.
    easting, northing : array_like, shape (easting,), (northing,)
        Axes of the map [m], ascending.

    Returns
    -------
    xarray.Dataset
        Surface with the dimensions northing and easting.

    Raises
    ------
    SchemaError
        If an axis does not ascend or has fewer than 2 nodes.

    Examples
    --------
    >>> from trueterrain.simulate.ground import Plane
    >>> sample_surface(Plane(slope=0.1), easting=[0.0, 1.0, 2.0], northing=[0.0, 1.0]).height.values
    array([[0. , 0.1, 0.2], [0. , 0.1, 0.2]])
    """
    x = np.asarray(easting, dtype=np.float64)
    y = np.asarray(northing, dtype=np.float64)
    surface = make_surface(ground.height(x, y[:, None]), easting=x, northing=y)
    return add_step(surface, "sample_surface", parameters={"ground": ground.to_dict()})


def sample_road(
    ground: Ground,
    *,
    length: float,
    width: float,
    spacing_u: float = 0.01,
    spacing_v: float = 0.01,
    start: tuple[float, float] = (0.0, 0.0),
    heading: float = 0.0,
    curvature: float = 0.0,
) -> xr.Dataset:
    """Surface of a ground along a straight or circular reference line.

    The reference line has equal chords between its nodes, and each cross-section is on the
    bisector of the two chords at its node, as in OpenCRG.

    Parameters
    ----------
    ground : Ground
        The ground.
    length : float
        Length of the reference line, as the sum of its chords [m].
    width : float
        Width of the surface, half of it on either side [m].
    spacing_u, spacing_v : float
        Length of a chord, and distance between nodes across [m]. `length` and `width` must be whole
        multiples of them.
    start : tuple of float
        Easting and northing of the first node [m].
    heading : float
        Direction of the reference line at its start, counter-clockwise from east [rad].
    curvature : float
        Curvature of the reference line, positive to the left [1/m].

    Returns
    -------
    xarray.Dataset
        Surface with the dimensions u, from 0 to `length`, and v, from ``-width / 2`` to
        ``width / 2``.

    Raises
    ------
    ValueError
        If a length is not positive or not a whole multiple of its spacing, or if the centre of
        the curve is on the road.

    Examples
    --------
    >>> from trueterrain.simulate.ground import Plane
    >>> road = sample_road(Plane(camber=0.1), length=20.0, width=2.0, spacing_u=5.0, spacing_v=1.0)
    >>> road.height.values[0]
    array([-0.1,  0. ,  0.1])
    """
    from trueterrain.surface.evaluate import node_coordinates

    chords = _whole_number("length", length, "spacing_u", spacing_u)
    columns = _whole_number("width", width, "spacing_v", spacing_v)
    if not np.isfinite([*start, heading, curvature]).all():
        raise ValueError("start, heading and curvature must be finite.")
    if not abs(curvature) * max(0.5 * width, 0.5 * spacing_u) < 1:
        raise ValueError(
            f"curvature must be less than {1 / max(0.5 * width, 0.5 * spacing_u):g} 1/m, so that "
            f"the centre of the curve is not on the road, got {curvature} 1/m."
        )
    chord_angle = 2.0 * np.arcsin(0.5 * curvature * spacing_u)  # [rad] between chords of a circle
    direction = heading + chord_angle * (np.arange(chords) + 0.5)
    line: dict[str, Any] = {
        "u": spacing_u * np.arange(chords + 1),
        "v": spacing_v * (np.arange(columns + 1) - 0.5 * columns),
        "easting": start[0] + _running_sum(spacing_u * np.cos(direction)),
        "northing": start[1] + _running_sum(spacing_u * np.sin(direction)),
        "heading": np.concatenate([direction[:1], direction]),
    }
    level = make_surface(np.zeros((chords + 1, columns + 1)), **line)
    surface = make_surface(ground.height(*node_coordinates(level)), **line)
    parameters = {
        "ground": ground.to_dict(),
        "start": start,
        "heading": heading,
        "curvature": curvature,
    }
    return add_step(surface, "sample_road", parameters=parameters)


def sample_points(
    ground: Ground,
    number: int,
    extent: tuple[float, float, float, float],
    *,
    seed: int = 0,
    noise_sd: float = 0.0,
) -> xr.Dataset:
    """Points of a ground at uniform random positions.

    Parameters
    ----------
    ground : Ground
        The ground.
    number : int
        Number of points.
    extent : tuple of float
        Minimum easting and northing, maximum easting and northing [m].
    seed : int
        Seed of the positions and of the noise.
    noise_sd : float
        Standard deviation of normal noise added to the heights [m].

    Returns
    -------
    xarray.Dataset
        Points; with the variable ``sd`` if noise was added.

    Raises
    ------
    ValueError
        If an argument breaks its rule.

    Examples
    --------
    >>> from trueterrain.simulate.ground import Plane
    >>> points = sample_points(Plane(elevation=2.0), 1000, (0.0, 0.0, 10.0, 5.0), seed=1)
    >>> points.sizes["point"], float(points.up.max())
    (1000, 2.0)
    """
    if isinstance(number, bool) or number != int(number) or number < 1:
        raise ValueError(f"number must be a whole number of at least 1, got {number}.")
    west, south, east, north = extent
    if not (np.isfinite(extent).all() and west < east and south < north):
        raise ValueError(
            "extent must be (min easting, min northing, max easting, max northing) "
            f"of an area, got {extent}."
        )
    if not (np.isfinite(noise_sd) and noise_sd >= 0):
        raise ValueError(f"noise_sd must be at least 0 m, got {noise_sd}.")
    check_seed(seed)
    random = np.random.default_rng(seed)
    easting = random.uniform(west, east, int(number))
    northing = random.uniform(south, north, int(number))
    up = ground.height(easting, northing)
    optional: dict[str, Any] = {}
    if noise_sd > 0:
        up = up + noise_sd * random.standard_normal(int(number))
        optional["sd"] = np.full(int(number), float(noise_sd))
    points = make_points(easting, northing, up, **optional)
    parameters = {"ground": ground.to_dict(), "extent": extent, "seed": seed, "noise_sd": noise_sd}
    return add_step(points, "sample_points", parameters=parameters)


def _whole_number(name: str, length: float, name_of_spacing: str, spacing: float) -> int:
    for argument, value in ((name, length), (name_of_spacing, spacing)):
        if not (np.isfinite(value) and value > 0):
            raise ValueError(f"{argument} must be greater than 0 m, got {value}.")
    number = round(length / spacing)
    if number < 1 or abs(length / spacing - number) > _TOLERANCE:
        raise ValueError(
            f"{name} must be a whole multiple of {name_of_spacing} {spacing} m, got {length} m."
        )
    return number


def _running_sum(steps: Floats) -> Floats:
    return np.concatenate([[0.0], np.cumsum(steps)])
