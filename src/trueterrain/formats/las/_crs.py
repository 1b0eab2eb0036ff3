"""Coordinate reference systems of LAS files: WKT records, GeoTIFF keys, or nothing."""

from dataclasses import dataclass, field, replace
from typing import Any

import pyproj
from pyproj.exceptions import CRSError

from trueterrain.geometry.crs import Units, crs_in_metres, parse_crs, units_of

_PROJECTION = "LASF_Projection"
_WKT_RECORD, _GEOTIFF_RECORD = 2112, 34735

# keys of GeoTIFF 1.1
_MODEL, _CITATION, _GEODETIC, _PROJECTED, _UNITS, _VERTICAL, _VERTICAL_UNITS = (
    1024,
    1026,
    2048,
    3072,
    3076,
    4096,
    4099,
)
_GEOCENTRIC_MODEL = 3
_EPSG_CODES = range(1024, 32767)
_LINEAR_UNITS = {
    9001: ("metre", 1.0),
    9002: ("foot", 0.3048),
    9003: ("US survey foot", 1200 / 3937),
}
_NO_HEIGHTS = "the CRS names no unit of heights: taken to be the same; if not, name a compound CRS"
_SAME_UNIT = 1e-9  # within which two units are equal; both kinds of feet differ by 2e-6


@dataclass(frozen=True, kw_only=True)
class CrsReference:
    """Coordinate reference system of a file, the units of its coordinates, and flags."""

    crs: str = ""
    "EPSG code, or WKT if no code fits, with axes in metres; empty if unknown."

    name: str = ""
    "Name in messages and reports."

    units: Units = field(default_factory=Units)
    "Units of the coordinates in the file."

    assumed: str = ""
    "Assumption about units that the file does not state; empty if it states them."

    obstacle: str = ""
    "Why the coordinates are not easting, northing and up; empty if they are."

    flags: tuple[str, ...] = ()
    "Problems of the record itself."

    @property
    def conversion(self) -> str:
        """Conversion of lengths to metres, in words; empty if they are in metres."""
        if self.units.metres or self.obstacle:
            return ""
        text = f"converted from {self.units} to metres"
        return f"{text} ({self.assumed})" if self.assumed else text


def reference_of(header: Any) -> CrsReference:
    """Reference of a LAS header."""
    records = [*header.vlrs.get_by_id(_PROJECTION)]
    if header.evlrs is not None:
        records += header.evlrs.get_by_id(_PROJECTION)
    by_id = {record.record_id: record for record in records}
    flags = []
    crs, keys = None, dict[int, int]()
    if wkt := getattr(by_id.get(_WKT_RECORD), "string", ""):
        try:
            crs = pyproj.CRS.from_wkt(wkt)
        except CRSError:
            flags.append("the WKT record cannot be understood")
    if crs is None and _GEOTIFF_RECORD in by_id:
        crs, keys, more = _from_geotiff(by_id)
        flags += more
    if crs is None:
        return CrsReference(flags=("the CRS is missing", *flags))
    return _by_keys(_make_reference(crs, flags), keys)


def reference_named(crs: str) -> CrsReference:
    """Reference that the user states instead of that of the file.

    Raises
    ------
    ValueError
        If the name is not a CRS.
    """
    return _make_reference(parse_crs(crs), [])


def wkt_of(crs: str) -> str:
    """WKT for a LAS file: version 1 as required by LAS 1.4, or 2 if that cannot express the CRS."""
    parsed = parse_crs(crs)
    try:
        return str(parsed.to_wkt("WKT1_GDAL"))
    except CRSError:
        return str(parsed.to_wkt())


def _make_reference(crs: pyproj.CRS, flags: list[str]) -> CrsReference:
    obstacle = _unit_obstacle(crs)
    code = crs.to_epsg(min_confidence=100)
    found = CrsReference(
        crs=f"EPSG:{code}" if code else crs.to_wkt(),
        name=crs.name,
        obstacle=obstacle,
        flags=tuple(flags),
    )
    if obstacle or (units := units_of(crs)).metres:
        return found
    assumed = "" if crs.is_compound or len(crs.axis_info) > 2 else _NO_HEIGHTS
    metric = crs_in_metres(crs)
    return replace(found, crs=metric, name=parse_crs(metric).name, units=units, assumed=assumed)


def _unit_obstacle(crs: pyproj.CRS) -> str:
    if crs.is_geocentric:
        return "geocentric x, y, z"
    return "degrees" if crs.is_geographic else ""


def _by_keys(reference: CrsReference, keys: dict[int, int]) -> CrsReference:
    """Reference with the units that GeoTIFF keys name besides an EPSG code."""
    if reference.obstacle or not keys:
        return reference
    across, up = (_LINEAR_UNITS.get(keys.get(key, 0)) for key in (_UNITS, _VERTICAL_UNITS))
    units = reference.units
    if across is not None and abs(across[1] - units.horizontal) > _SAME_UNIT:
        return replace(
            reference,
            obstacle=f"in {across[0]} by the GeoTIFF key 3076 (unit of length), but in "
            f"{units.names[0]} by the CRS that the keys name",
        )
    if up is None and keys.get(_VERTICAL) in _EPSG_CODES:
        up = _unit_of_heights(keys[_VERTICAL])
    if up is None:
        return reference
    names = (units.names[0], up[0])
    return replace(reference, units=replace(units, vertical=up[1], names=names), assumed="")


def _unit_of_heights(code: int) -> tuple[str, float] | None:
    try:
        axis = pyproj.CRS.from_epsg(code).axis_info[-1]
    except CRSError:
        return None
    return (axis.unit_name, axis.unit_conversion_factor) if axis.direction == "up" else None


def _from_geotiff(
    by_id: dict[int, Any],
) -> tuple[pyproj.CRS | None, dict[int, int], list[str]]:
    keys = {key.id: key for key in getattr(by_id[_GEOTIFF_RECORD], "geo_keys", [])}
    values = {number: key.value_offset for number, key in keys.items()}
    codes = (_PROJECTED, _GEODETIC)
    code = next((values[k] for k in codes if values.get(k) in _EPSG_CODES), None)
    if values.get(_MODEL) == _GEOCENTRIC_MODEL:
        return pyproj.CRS.from_epsg(4978), {}, []
    try:
        if code is not None:
            return pyproj.CRS.from_epsg(code), values, []
        citation = _key_citation(keys, by_id)
        named = pyproj.CRS.from_user_input(citation)
    except CRSError:
        return None, {}, ["the GeoTIFF keys name no CRS that is known"]
    flag = f"the GeoTIFF keys hold no EPSG code; {citation!r} is taken by its name"
    return named, values, [flag]


def _key_citation(keys: dict[int, Any], by_id: dict[int, Any]) -> str:
    key = keys.get(_CITATION)
    record = by_id.get(key.tiff_tag_location) if key is not None else None
    if key is None or record is None:
        return ""
    text = "|".join(getattr(record, "strings", []))
    return text[key.value_offset : key.value_offset + key.count].split("|")[0].strip()
