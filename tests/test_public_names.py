"""Public names of `import trueterrain as tt`: the list is fixed, changes are deliberate."""

import importlib
import subprocess
import sys
from operator import attrgetter

import pytest

import trueterrain
import trueterrain.profile
import trueterrain.report

PUBLIC = {
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
}

NAMESPACES = {
    "alignment",
    "figures",
    "formats",
    "geometry",
    "ground",
    "motion",
    "paths",
    "profile",
    "report",
    "roughness",
    "scenes",
    "simulate",
    "statistics",
    "surface",
    "survey",
    "vehicle",
    "verify",
}

# names of version 0.1 that moved, and the words that their warnings name
RENAMED = {
    "BelgianBlock": "tt.ground.BelgianBlock",
    "Butterworth": "tt.roughness.Butterworth",
    "Cleats": "tt.ground.Cleats",
    "Cracks": "tt.ground.Cracks",
    "Ellipse": "tt.profile.Ellipse",
    "InverseDistance": "tt.statistics.InverseDistance",
    "IriOptions": "tt.roughness.IriSettings",
    "Mean": "tt.statistics.Mean",
    "Measured": "tt.ground.Measured",
    "MovingAverage": "tt.roughness.MovingAverage",
    "Percentile": "tt.statistics.Percentile",
    "Plane": "tt.ground.Plane",
    "PointFilter": "tt.formats.PointFilter",
    "PsdOptions": "tt.roughness.PsdSettings",
    "Rectangle": "tt.profile.Rectangle",
    "RideNumberOptions": "tt.roughness.RideNumberSettings",
    "Road": "tt.ground.Road",
    "Scene": "tt.scenes.Scene",
    "Sine": "tt.ground.Sine",
    "SteepestCpf": "tt.statistics.SteepestCpf",
    "Step": "tt.ground.Step",
    "Stones": "tt.ground.Stones",
    "WheelPath": "tt.paths.PlaneCurve",
    "Window": "tt.statistics.Window",
    "arc_path": "tt.paths.arc_path",
    "check_run": "tt.formats.run.check_run",
    "continuous_iri": "tt.roughness.continuous_iri",
    "curve_path": "tt.paths.curve_path",
    "figures.lane_correction": "tt.figures.pass_correction",
    "figures.lane_histograms": "tt.figures.pass_histograms",
    "figures.lane_overlap": "tt.figures.overlap_map",
    "figures.mode_shares": "tt.figures.mode_energies",
    "figures.place_spread": "tt.figures.position_sensitivity",
    "function_path": "tt.paths.function_path",
    "polyline_path": "tt.paths.polyline_path",
    "rolling_straightedge": "tt.roughness.rolling_straightedge",
    "sample_points": "tt.ground.sample_points",
    "waveband_rms": "tt.roughness.waveband_rms",
}

MOVED = {
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

PROFILE = {
    "PASSENGER_TYRE",
    "TRUCK_TYRE",
    "Disc",
    "Ellipse",
    "Envelope",
    "EnvelopeSettings",
    "HeightDistribution",
    "HeightDistributions",
    "InverseDistance",
    "LineLaser",
    "Mean",
    "Median",
    "PatchMean",
    "Percentile",
    "RadialSpringTyre",
    "Rectangle",
    "RigidDisc",
    "SearchArea",
    "Statistic",
    "SteepestCpf",
    "TandemCams",
    "TyreData",
    "TyreProfileSettings",
    "PlaneCurve",
    "Window",
    "arc_path",
    "curve_path",
    "effective_road",
    "function_path",
    "height_distributions",
    "named_tyre",
    "offset_path",
    "point_profile",
    "polyline_path",
    "straight_path",
    "tyre_envelope",
    "tyre_profile",
    "waypoint_path",
}

REPORT = {
    "Block",
    "Column",
    "File",
    "Files",
    "Number",
    "Picture",
    "PredictedEvent",
    "Report",
    "Section",
    "SurfaceView",
    "Table",
    "Text",
    "Verdict",
    "Warnings",
    "predict_event",
    "write_certificate",
    "write_event_page",
    "write_plate_page",
    "write_report",
    "write_report_pdf",
}

HEAVY = ("numba", "numpy", "scipy", "xarray", "pandas", "matplotlib", "laspy", "pyproj", "pycrg")


def imported_by(code: str) -> set[str]:
    """Heavy modules that some code imports, in an interpreter of its own."""
    show = f"import sys; sys.stderr.write(' '.join(m for m in {HEAVY} if m in sys.modules))"
    finished = subprocess.run(
        [sys.executable, "-c", f"{code}\n{show}"], check=True, capture_output=True, text=True
    )
    return set(finished.stderr.split())


def test_public_names_are_the_promised_ones():
    assert set(trueterrain.__all__) == PUBLIC


def test_the_names_of_reports_are_the_promised_ones():
    assert set(trueterrain.report.__all__) == REPORT
    assert trueterrain.report.__all__ == sorted(trueterrain.report.__all__)


def test_the_names_of_profiles_are_the_promised_ones():
    assert set(trueterrain.profile.__all__) == PROFILE


def test_public_names_are_sorted_and_listed_by_dir_with_the_namespaces():
    assert trueterrain.__all__ == sorted(trueterrain.__all__)
    assert dir(trueterrain) == sorted(PUBLIC | NAMESPACES)


def test_every_public_name_can_be_imported():
    for name in dir(trueterrain):
        assert getattr(trueterrain, name) is not None


@pytest.mark.parametrize("old", sorted(RENAMED))
def test_an_earlier_name_works_and_warns_with_the_new_one(old):
    new = RENAMED[old]
    with pytest.warns(DeprecationWarning, match=rf"tt\.{old} is {new} now"):
        found = attrgetter(old)(trueterrain)
    assert found is attrgetter(new.removeprefix("tt."))(trueterrain)


@pytest.mark.parametrize("old", sorted(MOVED))
def test_an_earlier_module_works_and_warns_with_the_new_one(old):
    sys.modules.pop(f"trueterrain.{old}", None)
    with pytest.warns(DeprecationWarning, match=f"{old} is trueterrain.{MOVED[old]} now"):
        found = importlib.import_module(f"trueterrain.{old}")
    assert found is importlib.import_module(f"trueterrain.{MOVED[old]}")


def test_an_unknown_module_is_an_import_error():
    with pytest.raises(ModuleNotFoundError, match=r"trueterrain\.nothing"):
        importlib.import_module("trueterrain.nothing")


def test_an_unknown_name_is_an_attribute_error():
    assert not hasattr(trueterrain, "tire_profile")


def test_importing_the_package_imports_nothing_heavy():
    assert imported_by("import trueterrain") == set()


def test_help_imports_nothing_heavy():
    code = (
        "from trueterrain.cli import main\ntry:\n    main(['--help'])\nexcept SystemExit:\n    pass"
    )
    assert imported_by(code) == set()


@pytest.mark.parametrize("command", ["info", "convert", "plot", "run", "verify"])
def test_the_help_of_a_command_without_settings_imports_nothing_heavy(command):
    """Commands with settings import these to list them, and their packages with them."""
    code = (
        "from trueterrain.cli import main\n"
        f"try:\n    main(['{command}', '--help'])\nexcept SystemExit:\n    pass"
    )
    assert imported_by(code) == set()
