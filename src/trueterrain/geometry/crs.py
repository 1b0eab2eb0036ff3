"""Coordinate reference systems by name, and those in feet brought to metres."""

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

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


@dataclass(frozen=True, kw_only=True)
class Units:
    """Units of length of coordinates."""

    horizontal: float = 1.0
    "Metres in the unit of easting and northing."

    vertical: float = 1.0
    "Metres in the unit of heights."

    names: tuple[str, str] = ("metre", "metre")
    "Names of both units."

    @property
    def metres(self) -> bool:
        """Whether both are metres."""
        return self.horizontal == self.vertical == 1.0

    @property
    def factors(self) -> tuple[float, float, float]:
        """Metres in the unit of easting, northing and up."""
        return self.horizontal, self.horizontal, self.vertical

    def __str__(self) -> str:
        across, up = self.names
        return across if across == up else f"{across}, heights in {up}"


def units_of(crs: "pyproj.CRS") -> Units:
    """Units of a projected coordinate reference system, alone or with one of heights.

    Parameters
    ----------
    crs : pyproj.CRS
        Projected, engineering or compound system. Heights of one without heights are taken to be
        in the unit of its easting, as in nearly all files that have such a system.

    Returns
    -------
    Units
        Of easting and northing, and of heights.

    Examples
    --------
    >>> str(units_of(parse_crs("EPSG:2264+5703")))
    'US survey foot, heights in metre'
    """
    axes = crs.axis_info
    if not axes and crs.source_crs is not None:  # bound to another by a transformation
        axes = crs.source_crs.axis_info
    if not axes:
        return Units()
    across, up = axes[0], axes[2] if len(axes) > 2 else axes[0]
    return Units(
        horizontal=across.unit_conversion_factor,
        vertical=up.unit_conversion_factor,
        names=(across.unit_name, up.unit_name),
    )


def crs_in_metres(crs: "pyproj.CRS") -> str:
    """The same coordinate reference system with axes in metres.

    Parameters
    ----------
    crs : pyproj.CRS
        System whose axes may be in feet.

    Returns
    -------
    str
        EPSG code of each part where there is one, else WKT.

    Examples
    --------
    >>> crs_in_metres(parse_crs("EPSG:2913+8228"))
    'EPSG:2838+5703'
    """
    import pyproj

    document = crs.to_json_dict()
    _set_metres(document)
    found = pyproj.CRS.from_json_dict(document)
    codes = [part.to_epsg(min_confidence=100) for part in found.sub_crs_list or [found]]
    return f"EPSG:{'+'.join(map(str, codes))}" if all(codes) else str(found.to_wkt())


def _set_metres(node: dict[str, Any]) -> None:
    """Set the linear units of axes in PROJJSON; parameters of a projection have their own."""
    for part in (*node.get("components", ()), node.get("source_crs")):
        if part is not None:
            _set_metres(part)
    node.pop("id", None)  # that of the system in feet
    node["name"] = re.sub(r" \((ftUS|ft)\)", "", node.get("name", ""))
    for axis in node.get("coordinate_system", {}).get("axis", ()):
        unit = axis.get("unit")
        if isinstance(unit, dict) and unit.get("type") == "LinearUnit":
            axis["unit"] = "metre"
