"""trueterrain: terrain measurement for vehicle simulation and pavement engineering.

The data pass through these stages; one function for each is in this namespace::

    recorded run ──► motion ──► alignment ──► surface ──► profile ──► roughness
    open_run      process_run  align_passes  build_      tyre_       iri
    import_run    fuse_motion                surface     profile     ride_number

Enter anywhere: a point cloud goes to `grid_points`, a CRG file to `tyre_profile`, an ERD file to
`iri`. `run_survey` runs all stages from one file of settings. Everything else is in the namespaces
``tt.ground``, ``tt.paths``, ``tt.statistics``, ``tt.figures``, ..., imported when first used.

Conventions: ground axes are easting, northing, up; u runs along a reference line, v to its left;
headings are counter-clockwise from east. Lengths are in metres, angles in radians. Data are
`xarray.Dataset` with the schemas Points, Surface and Profile (see `trueterrain.core.schemas`).
Errors in arguments are `ValueError`, errors in data `TrueTerrainError`.

Examples
--------
>>> import trueterrain as tt
>>> road = tt.sample_road(tt.ground.BelgianBlock(seed=1), length=2.0, width=1.0)
>>> path = tt.offset_path(road, 0.2, spacing=0.01)
>>> profile = tt.tyre_profile(road, path, area=tt.Disc(radius=0.025), statistic=tt.Median())
>>> profile.height.sizes["s"]
201
"""

import sys
import warnings
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType
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
    from trueterrain import alignment as alignment
    from trueterrain import figures as figures
    from trueterrain import formats as formats
    from trueterrain import geometry as geometry
    from trueterrain import motion as motion
    from trueterrain import profile as profile
    from trueterrain import report as report
    from trueterrain import roughness as roughness
    from trueterrain import simulate as simulate
    from trueterrain import surface as surface
    from trueterrain import survey as survey
    from trueterrain import vehicle as vehicle
    from trueterrain import verify as verify
    from trueterrain.core.schemas import make_points, make_profile, make_surface
    from trueterrain.formats import info, open, point_blocks, write  # noqa: A004 - used as tt.open
    from trueterrain.formats.run import import_run, open_run
    from trueterrain.geometry.path import offset_path, straight_path, waypoint_path
    from trueterrain.georeference import calibrate_mounting
    from trueterrain.motion import fuse_motion
    from trueterrain.profile import (
        Disc,
        Median,
        height_distributions,
        point_profile,
        tyre_envelope,
        tyre_profile,
    )
    from trueterrain.roughness import IriSettings, filter_profile, iri, psd, ride_number
    from trueterrain.simulate.ground import sample_road, sample_surface
    from trueterrain.simulate.scene import read_scene, record_scene
    from trueterrain.surface import (
        GridPlacement,
        GridSettings,
        grid_points,
        heights_at,
        surface_to_points,
    )
    from trueterrain.survey import (
        align_passes,
        build_surface,
        georeference_run,
        process_run,
        read_survey,
        run_survey,
    )
    from trueterrain.verify.static import static_test

# Modules of this package and the public names that each provides. They import numpy, numba and
# scipy, which takes seconds, so each is imported when one of its names is first used.
_MODULES = {
    "core.schemas": (
        "make_points",
        "make_profile",
        "make_surface",
    ),
    "formats": (
        "info",
        "open",
        "point_blocks",
        "write",
    ),
    "formats.run": (
        "import_run",
        "open_run",
    ),
    "geometry.path": (
        "offset_path",
        "straight_path",
        "waypoint_path",
    ),
    "georeference": ("calibrate_mounting",),
    "motion": ("fuse_motion",),
    "profile": (
        "Disc",
        "Median",
        "height_distributions",
        "point_profile",
        "tyre_envelope",
        "tyre_profile",
    ),
    "roughness": (
        "IriSettings",
        "filter_profile",
        "iri",
        "psd",
        "ride_number",
    ),
    "simulate.ground": (
        "sample_road",
        "sample_surface",
    ),
    "simulate.scene": (
        "read_scene",
        "record_scene",
    ),
    "surface": (
        "GridPlacement",
        "GridSettings",
        "grid_points",
        "heights_at",
        "surface_to_points",
    ),
    "survey": (
        "align_passes",
        "build_surface",
        "georeference_run",
        "process_run",
        "read_survey",
        "run_survey",
    ),
    "verify.static": ("static_test",),
}
_MODULE_OF = {name: module for module, names in _MODULES.items() for name in names}

# Namespaces, and the modules they are.
_NAMESPACES = {
    "alignment": "alignment",
    "figures": "figures",
    "formats": "formats",
    "geometry": "geometry",
    "ground": "simulate.ground",
    "motion": "motion",
    "paths": "geometry.path",
    "profile": "profile",
    "report": "report",
    "roughness": "roughness",
    "scenes": "simulate.scene",
    "simulate": "simulate",
    "statistics": "profile.statistic",
    "surface": "surface",
    "survey": "survey",
    "vehicle": "vehicle",
    "verify": "verify",
}

# Names of earlier versions, kept for one release: the module and the name that replace them.
_RENAMED = {
    "IriOptions": ("roughness", "IriSettings"),
    "PsdOptions": ("roughness", "PsdSettings"),
    "RideNumberOptions": ("roughness", "RideNumberSettings"),
    "PointFilter": ("formats", "PointFilter"),
    "Scene": ("scenes", "Scene"),
    "WheelPath": ("paths", "PlaneCurve"),
    "check_run": ("formats.run", "check_run"),
    **{
        name: ("ground", name)
        for name in (
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
        )
    },
    **{
        name: ("paths", name)
        for name in ("arc_path", "curve_path", "function_path", "polyline_path")
    },
    **{name: ("profile", name) for name in ("Ellipse", "Rectangle")},
    **{
        name: ("statistics", name)
        for name in ("InverseDistance", "Mean", "Percentile", "SteepestCpf", "Window")
    },
    **{
        name: ("roughness", name)
        for name in (
            "Butterworth",
            "MovingAverage",
            "continuous_iri",
            "rolling_straightedge",
            "waveband_rms",
        )
    },
}

# Modules of earlier versions, kept for one release, and those that replace them.
_MOVED = {
    "alignment.clouds.stations": "alignment.clouds.trajectory",
    "alignment.difference_summary": "surface.difference",
    "alignment.discontinuity.seam": "alignment.discontinuity.seams",
    "alignment.observations.visit_sums": "alignment.observations.collection",
    "alignment.seams": "alignment.discontinuity.seams",
    "core.newey_west": "core.statistics",
    "engine": "core",
    "errors": "core.errors",
    "figures.roughness.iri": "figures.roughness.segments",
    "figures.roughness.ride_number": "figures.roughness.segments",
    "kinds": "core.schemas",
    "lanes": "alignment",
    "motion.scan_gaps": "georeference.scans",
    "profile.envelope.cams": "profile.envelope.rigid",
    "profile.envelope.disc": "profile.envelope.rigid",
    "profile.search.grid": "profile.search.gather",
    "profile.search.scattered": "profile.search.gather",
    "provenance": "core.provenance",
    "surface.summary": "surface.evaluate",
}

__all__ = [
    "CoverageError",
    "Disc",
    "FormatError",
    "GridPlacement",
    "GridSettings",
    "IriSettings",
    "Median",
    "OutputError",
    "SchemaError",
    "TrueTerrainError",
    "__version__",
    "align_passes",
    "build_surface",
    "calibrate_mounting",
    "filter_profile",
    "fuse_motion",
    "georeference_run",
    "grid_points",
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
    "process_run",
    "psd",
    "read_scene",
    "read_survey",
    "record_scene",
    "ride_number",
    "run_survey",
    "sample_road",
    "sample_surface",
    "static_test",
    "straight_path",
    "surface_to_points",
    "tyre_envelope",
    "tyre_profile",
    "waypoint_path",
    "write",
]


def __getattr__(name: str) -> Any:
    if name in _MODULE_OF:
        return getattr(import_module(f"{__name__}.{_MODULE_OF[name]}"), name)
    if name in _NAMESPACES:
        return import_module(f"{__name__}.{_NAMESPACES[name]}")
    if name in _RENAMED:
        module, new = _RENAMED[name]
        _warn_renamed(f"tt.{name}", f"tt.{module}.{new}")
        return getattr(import_module(f"{__name__}.{_NAMESPACES.get(module, module)}"), new)
    if name in _MOVED:
        _warn_renamed(f"tt.{name}", f"tt.{_MOVED[name]}")
        return import_module(f"{__name__}.{_MOVED[name]}")
    message = f"module 'trueterrain' has no attribute {name!r}"
    raise AttributeError(message)


def __dir__() -> list[str]:
    return sorted([*__all__, *_NAMESPACES])


def _warn_renamed(old: str, new: str) -> None:
    text = f"{old} is {new} now; the old name goes with the next release."
    warnings.warn(text, DeprecationWarning, stacklevel=3)


class _MovedModule(MetaPathFinder, Loader):
    """Import of a module by the name that it had in earlier versions."""

    def find_spec(self, fullname: str, *_unused: object) -> ModuleSpec | None:
        package, _, name = fullname.partition(".")
        if package != __name__ or name not in _MOVED:
            return None
        _warn_renamed(fullname, f"{__name__}.{_MOVED[name]}")
        return ModuleSpec(fullname, self)

    def exec_module(self, module: ModuleType) -> None:
        # the import system returns what is in sys.modules once this is done
        name = module.__name__
        new = _MOVED[name.partition(".")[2]]
        sys.modules[name] = import_module(f"{__name__}.{new}")


sys.meta_path.append(_MovedModule())
