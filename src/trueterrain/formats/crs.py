"""Coordinate reference systems by name."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pyproj


def parse_crs(crs: str) -> "pyproj.CRS":
    """Coordinate reference system that a text names.

    Parameters
    ----------
    crs : str
        EPSG code such as ``"EPSG:25832"`` (``"EPSG:2154+5720"`` with heights), or WKT.

    Returns
    -------
    pyproj.CRS
        The system.

    Raises
    ------
    ValueError
        If the text means nothing.

    Examples
    --------
    >>> parse_crs("EPSG:25832").name
    'ETRS89 / UTM zone 32N'
    """
    import pyproj
    from pyproj.exceptions import CRSError

    try:
        return pyproj.CRS.from_user_input(crs)
    except CRSError:
        message = f"crs must be an EPSG code such as EPSG:25832, or WKT, got {crs[:60]!r}."
        raise ValueError(message) from None
