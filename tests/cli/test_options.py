"""Numeric options of all commands: an invalid number is one line and exit code 2."""

import dataclasses
import types
import typing

import numpy as np
import pytest

import trueterrain as tt
from trueterrain.alignment.settings import CellSettings, NetworkSettings
from trueterrain.cli import command_line
from trueterrain.core.schemas import make_points, make_profile
from trueterrain.georeference import CalibrationSettings, Screening
from trueterrain.motion import FusionSettings
from trueterrain.profile import TyreProfileSettings
from trueterrain.roughness import IriSettings, PsdSettings, RideNumberSettings
from trueterrain.roughness.agreement import AgreementLimits, AgreementSettings
from trueterrain.simulate.scene import read_scene

SCENE = """
name = "drive"
raster = 0.02
scanner = {beams = 31, rate = 100.0, swath = 0.3}
course = {kind = "straight", length = 6.0}
vehicle = {model = "rigid", waves = [{component = "up", amplitude = 0.01, frequency = 3.0}]}
passes = [{name = "run", speed = {kind = "constant", speed = 5.0}}]
"""
CALLS = {
    "calibrate": ["run.zarr", "run2.zarr"],
    "compare": ["a.csv", "b.csv"],
    "convert": ["a.csv", "-o", "OUT.erd"],
    "demo": ["-o", "a.csv"],
    "evenness": ["a.csv"],
    "event": ["design"],
    "filter": ["a.csv", "-o", "OUT.csv", "--shortest", "1"],
    "georeference": ["run.zarr", "-o", "OUT.las"],
    "grid": ["p.csv", "-o", "OUT.tif", "--spacing", "0.2"],
    "iri": ["a.csv"],
    "merge": ["p.csv", "q.csv", "--check"],
    "plate": ["design"],
    "plot": ["a.csv", "-o", "OUT.png"],
    "profile": ["road.crg", "--offset", "0", "-o", "OUT.erd"],
    "psd": ["a.csv"],
    "rn": ["a.csv"],
    "run": ["survey.toml", "-o", "OUT"],
    "simulate": ["none.toml", "-o", "OUT"],
}
NO_NUMBERS = {"doctor", "info", "init", "verify"}
MOTION = {f"--{field.name.replace('_', '-')}" for field in dataclasses.fields(FusionSettings)}
NEVER = ("nan", "inf", "-inf", "1e300", "1e-300", "", "abc")  # refused before anything is read
PERHAPS = ("0", "-1")  # for the command to judge
MANY = ("70000", str(2**63 - 1))  # of whole numbers


def numbers_of(hint: object) -> list[type | None]:
    """Kinds of the numbers that an option takes, None for a word beside them."""
    if hint in (int, float):
        return [hint]
    parts = [part for part in typing.get_args(hint) if part is not types.NoneType]
    match typing.get_origin(hint):
        case typing.Annotated:
            return numbers_of(parts[0])
        case typing.Union | types.UnionType:
            return max((numbers_of(part) for part in parts), key=len, default=[])
        case origin if origin in (tuple, list):
            parts = [part for part in parts if part is not Ellipsis]
            kinds = [(numbers_of(part) or [None]) for part in parts]
            flat = [kind for one in kinds for kind in one]
            return flat if any(flat) else []
    return []


def numeric_options(command: str) -> list[tuple[str, list[type | None]]]:
    """Options of a command that take numbers."""
    options = command_line()[command].assemble_argument_collection(parse_docstring=False)
    if command in ("grid", "calibrate"):  # georeference has the same options of the motion
        of_motion = [one.parameter.group[0].name.startswith("Motion") for one in options]
        options = [
            one
            for one, moves in zip(options, of_motion, strict=True)
            if not (moves and one.name in MOTION)
        ]
    found = [(option.name, numbers_of(option.hint)) for option in options]
    return [(name, kinds) for name, kinds in found if kinds and name.startswith("--")]


@pytest.fixture(scope="module")
def folder(tmp_path_factory, recorded_scene):
    """Small inputs of every kind."""
    folder = tmp_path_factory.mktemp("inputs")
    (folder / "scene.toml").write_text(SCENE)
    (run,) = recorded_scene(read_scene(folder / "scene.toml")[0])
    for name in ("run.zarr", "run2.zarr"):
        (folder / name).symlink_to(run)
    (folder / "survey.toml").write_text('[[runs]]\npath = "run.zarr"\n')
    rng = np.random.default_rng(5)
    tt.write(
        tt.sample_road(tt.ground.BelgianBlock(seed=1), length=1.0, width=0.5), folder / "road.crg"
    )
    s = 0.1 * np.arange(300.0)
    height = 0.001 * np.cumsum(rng.normal(size=s.size))
    for name in ("a", "b"):
        tt.write(make_profile(s, height), folder / f"{name}.csv")
    for name in ("p", "q"):
        east, north = rng.uniform(0, 2, (2, 1000))
        tt.write(make_points(east, north, 0.01 * np.sin(east)), folder / f"{name}.csv")
    return folder


def test_every_command_is_called():
    listed = {name for name in command_line() if not name.startswith("-")}
    assert listed == set(CALLS) | NO_NUMBERS
    assert all(numeric_options(command) for command in CALLS)
    assert not any(numeric_options(command) for command in NO_NUMBERS)


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("command", CALLS)
def test_no_number_ends_in_a_traceback(run, command, folder, tmp_path, monkeypatch):
    monkeypatch.chdir(folder)
    count = 0
    for option, kinds in numeric_options(command):
        for place, kind in enumerate(kinds):
            if kind is None:
                continue
            for value in (*NEVER, *PERHAPS, *(MANY if kind is int else ())):
                values = ["one" if other is None else "1" for other in kinds]
                values[place] = value
                count += 1
                call = [part.replace("OUT", str(tmp_path / f"{count}")) for part in CALLS[command]]
                if option in call:
                    del call[call.index(option) : call.index(option) + 2]
                finished = run(command, *call, option, *values)
                asked = f"{command} {option} {' '.join(values)}"
                assert finished.code in ((2,) if value in NEVER else (0, 2)), asked
                assert value not in NEVER or option in finished.err, asked
                if finished.code == 2:
                    assert not finished.out, asked
                    assert finished.err.splitlines()[-1].startswith("trueterrain: error: "), asked


@pytest.mark.parametrize(
    ("arguments", "rule"),
    [
        (["event", "design", "--length", "70000"], "at most 1000 m long"),
        (["event", "design", "--wheelbase", "70000"], "at most 1000 m long"),
        (["event", "design", "--width-ratio", "1e-9"], "must move the vehicle"),
        (["plate", "design", "--length", "70000"], "at most 10 m"),
        (["plate", "design", "--rise", "70000"], "at most 10 m"),
        (["merge", "p.csv", "q.csv", "--check", "--cell", "70000"], "at most 100 m"),
        (["grid", "p.csv", "-o", "o.tif", "--smoothing", "70000"], "from 0 to 1000 m"),
        (["filter", "a.csv", "-o", "o.csv", "--order", "51", "--shortest", "1"], "from 1 to 50"),
        (["profile", "road.crg", "--offset", "0", "-o", "o.erd", "--resolution", "1e-11"], "1e-09"),
        (["georeference", "run.zarr", "-o", "o.las", "--lane", "65536"], "from 0 to 65535"),
    ],
)
def test_sizes_that_no_machine_could_hold_are_refused_at_once(
    run, folder, monkeypatch, arguments, rule
):
    monkeypatch.chdir(folder)
    finished = run(*arguments)
    assert (finished.code, finished.out) == (2, "")
    assert rule in finished.err


@pytest.mark.parametrize(
    ("command", "settings", "omitted"),
    [
        (
            "iri",
            IriSettings(
                window="exact",
                window_length=0.3,
                restart=True,
                speed=20.0,
                spacing_tolerance=0.01,
                start="level",
                max_spacing=0.5,
            ),
            {"car"},
        ),
        (
            "rn",
            RideNumberSettings(
                window="none",
                window_length=0.2,
                restart=True,
                speed=20.0,
                spacing_tolerance=0.01,
                start_length=11.0,
                best=10.0,
                steepness=80.0,
                max_spacing=0.1,
            ),
            {"car"},
        ),
        ("psd", PsdSettings(block=50, lowest=0.1, highest=1, waviness=2, confidence=0.9), set()),
        (
            "compare",
            AgreementSettings(
                step=0.1, max_shift=1.0, max_scale=0.0, min_overlap=5.0, align_starts=True
            ),
            {"filter", "transient"},
        ),
        (
            "compare",
            AgreementLimits(
                repeatability=0.0, accuracy=0.8, distance_error=0.01, bias=0.1, precision=0.2
            ),
            set(),
        ),
        (
            "grid",
            Screening(floor=5.0, saturation=90.0, nearest=1.0, furthest=9.0, weight=0.5),
            set(),
        ),
        (
            "georeference",
            FusionSettings(method="wiener", rate=500.0, gravity=9.8, drift_time=(5.0, 6.0, 7.0)),
            set(),
        ),
        (
            "calibrate",
            CalibrationSettings(area=(0.0, 0.0, 1.0, 1.0), drift_time=(5.0, 6.0), max_iterations=9),
            {"parameters", "unobservable", "screening"},
        ),
        ("merge", NetworkSettings(correlation_time=9.0, sample=500, datum_sd=0.01), set()),
        ("merge", CellSettings(scans=0, max_sd=0.01), {"size"}),
        ("profile", TyreProfileSettings(patch=(0.2, 0.1), level=True, min_count=5), set()),
        ("profile", TyreProfileSettings(statistic="bridge", skip=5.0, average=50.0), set()),
    ],
)
def test_each_setting_is_an_option_with_the_name_and_default_of_its_field(
    command, settings, omitted
):
    fields = {field.name: getattr(settings, field.name) for field in dataclasses.fields(settings)}
    listed = command_line()[command].assemble_argument_collection()
    names = {f"--{name.replace('_', '-')}" for name in fields if name not in omitted}
    assert names <= {option.name for option in listed if option.show}
    usual = type(settings)()
    words = []
    for name, value in fields.items():
        if value != getattr(usual, name):
            values = value if isinstance(value, tuple) else () if value is True else (value,)
            words += [f"--{name.replace('_', '-')}", *map(str, values)]
    call = [part.replace("OUT", "out") for part in CALLS[command]]
    for given, expected in ((words, settings), ([], usual)):
        _, bound, _ = command_line().parse_args([command, *call, *given], exit_on_error=False)
        bound.apply_defaults()
        assert expected in bound.arguments.values()


@pytest.mark.parametrize(
    ("command", "option"), [("iri", "--car"), ("iri", "--car.damping"), ("compare", "--transient")]
)
def test_a_field_that_is_no_option_is_unknown(run, command, option):
    finished = run(command, "a.csv", "b.csv", option, "1")
    assert (finished.code, finished.out) == (2, "")
    assert finished.err.startswith(f"trueterrain: error: Unknown option: {option}.")


@pytest.mark.parametrize(
    ("arguments", "rule"),
    [
        (("iri", "--window", "box"), 'Invalid value "box" for --window. Choose from: "sayers"'),
        (("iri", "--window-length", "-1"), "window_length must be finite and greater than 0 m"),
        (("iri", "--segment", "nan"), "--segment: must be 0, or from 1e-12"),
        (("evenness", "--band", "a", "1", "inf"), "--band: must be 0, or from 1e-12"),
        (("profile", "-o", "b.crg", "--line", "1", "2", "nan", "4"), "--line: must be 0, or from"),
        (("profile", "-o", "b.crg", "--min-count", "2.5"), "--min-count: must be a whole number"),
        (("profile", "-o", "b.crg", "--radius", "1", "--patch", "1", "1"), "only one of radius,"),
        (("compare", "--bias", "0"), "bias must be finite and greater than 0"),
    ],
)
def test_an_invalid_setting_is_one_line_that_names_it(run, arguments, rule):
    command, *given = arguments
    finished = run(command, "a.csv", *given)
    assert (finished.code, finished.out, len(finished.err.splitlines())) == (2, "", 1)
    assert rule in finished.err
