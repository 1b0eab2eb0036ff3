"""How far the points of a file reach."""

from pathlib import Path

Four = tuple[float, float, float, float]


def extent_of(file: Path, crs: str | None) -> Four:
    """West, south, east and north of the points in a file.

    Parameters
    ----------
    file : Path
        Points.
    crs : str or None
        Coordinate reference system, if the file names none or a wrong one.

    Returns
    -------
    tuple of float
        Smallest easting and northing, largest easting and northing [m].
    """
    import numpy as np

    from trueterrain import formats

    if formats.recognise_format(file).module == "las":
        from trueterrain.formats import las

        _, (low, high) = las.header_of(file, crs)
        if np.isfinite([*low, *high]).all() and (low[:2] <= high[:2]).all():
            return float(low[0]), float(low[1]), float(high[0]), float(high[1])
    if formats.recognise_format(file).module == "store":
        extent = formats.info(file)["extent"]
        if "easting" in extent and "northing" in extent:
            (west, east), (south, north) = extent["easting"], extent["northing"]
            return west, south, east, north
    edges = [np.inf, np.inf, -np.inf, -np.inf]
    for block in formats.point_blocks(file, crs=crs, variables=()):
        for axis, name in enumerate(("easting", "northing")):
            edges[axis] = min(edges[axis], float(block[name].min()))
            edges[axis + 2] = max(edges[axis + 2], float(block[name].max()))
    return edges[0], edges[1], edges[2], edges[3]
