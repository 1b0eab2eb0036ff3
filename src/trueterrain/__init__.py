"""Ground you can trust: terrain measurement for vehicle simulation and pavement engineering.

The package is the way of the data; each room is one step of it::

    formats ──► surface ──► profile ──► roughness
    files       where the   what a      what it
                nodes lie   tyre feels  amounts to

``simulate`` makes ground whose truth is known, ``figures`` shows it, ``cli`` is the command line.

Conventions: ground axes are easting, northing, up; u runs ahead along a reference line, v to its
left; headings turn counter-clockwise from east. Lengths are metres, angles radians, everywhere.
Data are `xarray.Dataset` of the kinds Points, Surface and Profile (see `trueterrain.core.schemas`).
Errors in arguments are `ValueError`, errors in data `TrueTerrainError`.

Examples
--------
>>> import trueterrain as tt
>>> road = tt.sample_road(tt.BelgianBlock(seed=1), length=2.0, width=1.0)
>>> path = tt.offset_path(road, 0.2, spacing=0.01)
>>> felt = tt.tyre_profile(road, path, area=tt.Disc(radius=0.025), statistic=tt.Median())
>>> felt.height.sizes["s"]
201
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from trueterrain._version import __version__
from trueterrain.core.errors import (
    CoverageError,
    FormatError,
    OutputError,
    SchemaError,
    TrueTerrainError,
)

if TYPE_CHECKING:
    from trueterrain.core.schemas import make_points, make_profile, make_surface
    from trueterrain.formats import PointFilter, info, open, point_blocks, write  # noqa: A004 - tt.open(...)
    from trueterrain.formats.run import check_run, import_run, open_run
    from trueterrain.profile import (
        Disc,
        Ellipse,
        InverseDistance,
        Mean,
        Median,
        Percentile,
        Rectangle,
        SteepestCpf,
        WheelPath,
        Window,
        arc_path,
        curve_path,
        function_path,
        height_distributions,
        offset_path,
        point_profile,
        polyline_path,
        straight_path,
        tyre_profile,
        waypoint_path,
    )
    from trueterrain.roughness import (
        Butterworth,
        IriSettings,
        MovingAverage,
        PsdSettings,
        RideNumberSettings,
        continuous_iri,
        filter_profile,
        iri,
        psd,
        ride_number,
        rolling_straightedge,
        waveband_rms,
    )
    from trueterrain.simulate.ground import (
        BelgianBlock,
        Cleats,
        Cracks,
        Measured,
        Plane,
        Road,
        Sine,
        Step,
        Stones,
        sample_points,
        sample_road,
        sample_surface,
    )
    from trueterrain.simulate.scene import Scene, read_scene, record_scene
    from trueterrain.surface import heights_at, surface_to_points

# each public name and the room it lives in: a room is imported when its first name is used
_ROOMS = {
    "trueterrain.formats": ("PointFilter", "info", "open", "point_blocks", "write"),
    "trueterrain.formats.run": ("check_run", "import_run", "open_run"),
    "trueterrain.core.schemas": ("make_points", "make_profile", "make_surface"),
    "trueterrain.profile": (
        "Disc",
        "Ellipse",
        "InverseDistance",
        "Mean",
        "Median",
        "Percentile",
        "Rectangle",
        "SteepestCpf",
        "WheelPath",
        "Window",
        "arc_path",
        "curve_path",
        "function_path",
        "height_distributions",
        "offset_path",
        "point_profile",
        "polyline_path",
        "straight_path",
        "tyre_profile",
        "waypoint_path",
    ),
    "trueterrain.roughness": (
        "Butterworth",
        "IriSettings",
        "MovingAverage",
        "PsdSettings",
        "RideNumberSettings",
        "continuous_iri",
        "filter_profile",
        "iri",
        "psd",
        "ride_number",
        "rolling_straightedge",
        "waveband_rms",
    ),
    "trueterrain.simulate.ground": (
        "BelgianBlock",
        "Cleats",
        "Cracks",
        "Measured",
        "Plane",
        "Road",
        "Sine",
        "Step",
        "Stones",
        "sample_points",
        "sample_road",
        "sample_surface",
    ),
    "trueterrain.simulate.scene": ("Scene", "read_scene", "record_scene"),
    "trueterrain.surface": ("heights_at", "surface_to_points"),
}
_ROOM_OF = {name: room for room, names in _ROOMS.items() for name in names}

__all__ = [
    "BelgianBlock",
    "Butterworth",
    "Cleats",
    "CoverageError",
    "Cracks",
    "Disc",
    "Ellipse",
    "FormatError",
    "InverseDistance",
    "IriSettings",
    "Mean",
    "Measured",
    "Median",
    "MovingAverage",
    "OutputError",
    "Percentile",
    "Plane",
    "PointFilter",
    "PsdSettings",
    "Rectangle",
    "RideNumberSettings",
    "Road",
    "Scene",
    "SchemaError",
    "Sine",
    "SteepestCpf",
    "Step",
    "Stones",
    "TrueTerrainError",
    "WheelPath",
    "Window",
    "__version__",
    "arc_path",
    "check_run",
    "continuous_iri",
    "curve_path",
    "filter_profile",
    "function_path",
    "height_distributions",
    "heights_at",
    "import_run",
    "info",
    "iri",
    "make_points",
    "make_profile",
    "make_surface",
    "offset_path",
    "open",
    "open_run",
    "point_blocks",
    "point_profile",
    "polyline_path",
    "psd",
    "read_scene",
    "record_scene",
    "ride_number",
    "rolling_straightedge",
    "sample_points",
    "sample_road",
    "sample_surface",
    "straight_path",
    "surface_to_points",
    "tyre_profile",
    "waveband_rms",
    "waypoint_path",
    "write",
]


def __getattr__(name: str) -> Any:
    if name not in _ROOM_OF:
        message = f"module 'trueterrain' has no attribute {name!r}"
        raise AttributeError(message)
    return getattr(import_module(_ROOM_OF[name]), name)


def __dir__() -> list[str]:
    return __all__
