"""Coordinate reference systems of LAS files: WKT records, GeoTIFF keys, or nothing."""

from dataclasses import dataclass
from typing import Any

import pyproj
from pyproj.exceptions import CRSError

from trueterrain.formats.crs import parse_crs

_PROJECTION = "LASF_Projection"
_WKT_RECORD, _GEOTIFF_RECORD = 2112, 34735

# keys of GeoTIFF 1.1
_MODEL, _CITATION, _GEODETIC, _PROJECTED, _UNITS, _VERTICAL_UNITS = (
    1024,
    1026,
    2048,
    3072,
    3076,
    4099,
)
_GEOCENTRIC_MODEL = 3
_METRE = 9001
_EPSG_CODES = range(1024, 32767)
_LINEAR_UNITS = {9002: "feet", 9003: "US survey feet"}


@dataclass(frozen=True, kw_only=True)
class Reference:
    """What a file says about the ground that its coordinates refer to."""

    crs: str = ""
    "EPSG code, or WKT if no code fits; empty if unknown."

    name: str = ""
    "Name for people."

    obstacle: str = ""
    "Why the coordinates are not easting, northing, up in metres; empty if they are."

    doubts: tuple[str, ...] = ()
    "What is wrong with the record itself."


def reference_of(header: Any) -> Reference:
    """Reference of a LAS header."""
    records = [*header.vlrs.get_by_id(_PROJECTION)]
    if header.evlrs is not None:
        records += header.evlrs.get_by_id(_PROJECTION)
    by_id = {record.record_id: record for record in records}
    doubts = []
    crs, unit = None, ""
    if wkt := getattr(by_id.get(_WKT_RECORD), "string", ""):
        try:
            crs = pyproj.CRS.from_wkt(wkt)
        except CRSError:
            doubts.append("the WKT record cannot be understood")
    if crs is None and _GEOTIFF_RECORD in by_id:
        crs, unit, more = _from_geotiff(by_id)
        doubts += more
    if crs is None:
        return Reference(doubts=("the CRS is missing", *doubts))
    return _reference(crs, unit, doubts)


def reference_named(crs: str) -> Reference:
    """Reference that the user names instead of the file's own.

    Raises
    ------
    ValueError
        If the name means nothing.
    """
    return _reference(parse_crs(crs), "", [])


def wkt_of(crs: str) -> str:
    """WKT for a LAS file: of version 1, as LAS 1.4 asks for, where that can express the CRS."""
    parsed = parse_crs(crs)
    try:
        return str(parsed.to_wkt("WKT1_GDAL"))
    except CRSError:
        return str(parsed.to_wkt())


def _reference(crs: pyproj.CRS, unit: str, doubts: list[str]) -> Reference:
    code = crs.to_epsg(min_confidence=100)
    return Reference(
        crs=f"EPSG:{code}" if code else crs.to_wkt(),
        name=crs.name,
        obstacle=unit or _obstacle(crs),
        doubts=tuple(doubts),
    )


def _obstacle(crs: pyproj.CRS) -> str:
    if crs.is_geocentric:
        return "geocentric x, y, z"
    if crs.is_geographic:
        return "degrees"
    if crs.is_engineering:
        return ""
    units = {axis.unit_name for axis in crs.axis_info if axis.unit_conversion_factor != 1}
    return " and ".join(sorted(units))


def _from_geotiff(by_id: dict[int, Any]) -> tuple[pyproj.CRS | None, str, list[str]]:
    keys = {key.id: key for key in getattr(by_id[_GEOTIFF_RECORD], "geo_keys", [])}
    values = {number: key.value_offset for number, key in keys.items()}
    codes = (_PROJECTED, _GEODETIC)
    code = next((values[k] for k in codes if values.get(k) in _EPSG_CODES), None)
    if values.get(_MODEL) == _GEOCENTRIC_MODEL:
        return pyproj.CRS.from_epsg(4978), "", []
    units = [values.get(key, _METRE) for key in (_UNITS, _VERTICAL_UNITS)]
    unit = next((_LINEAR_UNITS[number] for number in units if number in _LINEAR_UNITS), "")
    try:
        if code is not None:
            return pyproj.CRS.from_epsg(code), unit, []
        citation = _citation(keys, by_id)
        named = pyproj.CRS.from_user_input(citation)
    except CRSError:
        return None, "", ["the GeoTIFF keys name no CRS that is known"]
    return named, unit, [f"the GeoTIFF keys hold no EPSG code; {citation!r} is taken by its name"]


def _citation(keys: dict[int, Any], by_id: dict[int, Any]) -> str:
    key = keys.get(_CITATION)
    record = by_id.get(key.tiff_tag_location) if key is not None else None
    if key is None or record is None:
        return ""
    text = "|".join(getattr(record, "strings", []))
    return text[key.value_offset : key.value_offset + key.count].split("|")[0].strip()
