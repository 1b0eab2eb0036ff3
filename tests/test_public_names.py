"""The public names are a promise: they change on purpose or not at all."""

import subprocess
import sys

import trueterrain
import trueterrain.profile
import trueterrain.report

PUBLIC = {
    "BelgianBlock",
    "Butterworth",
    "Cleats",
    "CoverageError",
    "Cracks",
    "Disc",
    "Ellipse",
    "FormatError",
    "InverseDistance",
    "IriOptions",
    "Mean",
    "Measured",
    "Median",
    "MovingAverage",
    "OutputError",
    "Percentile",
    "Plane",
    "PointFilter",
    "PsdOptions",
    "Rectangle",
    "RideNumberOptions",
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
}

PROFILE = {
    "PASSENGER_TYRE",
    "TRUCK_TYRE",
    "Disc",
    "Ellipse",
    "Envelope",
    "EnvelopeOptions",
    "HeightDistribution",
    "HeightDistributions",
    "InverseDistance",
    "LineLaser",
    "Mean",
    "Median",
    "PatchMean",
    "Percentile",
    "ProfileOptions",
    "RadialSpringTyre",
    "Rectangle",
    "RigidDisc",
    "SearchArea",
    "Statistic",
    "SteepestCpf",
    "TandemCams",
    "TyreData",
    "WheelPath",
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
    "Report",
    "Section",
    "SurfaceView",
    "Table",
    "Text",
    "Verdict",
    "Warnings",
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


def test_public_names_are_sorted_and_listed_by_dir():
    assert trueterrain.__all__ == sorted(trueterrain.__all__)
    assert dir(trueterrain) == trueterrain.__all__


def test_every_public_name_can_be_had():
    for name in trueterrain.__all__:
        assert getattr(trueterrain, name) is not None


def test_an_unknown_name_is_an_attribute_error():
    assert not hasattr(trueterrain, "tire_profile")


def test_importing_the_package_imports_nothing_heavy():
    assert imported_by("import trueterrain") == set()


def test_help_imports_nothing_heavy():
    code = (
        "from trueterrain.cli import main\ntry:\n    main(['--help'])\nexcept SystemExit:\n    pass"
    )
    assert imported_by(code) == set()


def test_the_help_of_a_command_imports_nothing_heavy():
    code = (
        "from trueterrain.cli import main\n"
        "try:\n    main(['profile', '--help'])\nexcept SystemExit:\n    pass"
    )
    assert imported_by(code) == set()
