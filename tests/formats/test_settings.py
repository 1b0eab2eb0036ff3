"""Settings: TOML to frozen dataclasses and back."""

import enum
import math
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import pytest
from pydantic import Field

from trueterrain.core.errors import FormatError
from trueterrain.formats.settings import (
    attribute_docs,
    parse_settings,
    read_settings,
    settings_template,
)


class Side(enum.Enum):
    LEFT = "left"
    RIGHT = "right"


@dataclass(frozen=True, kw_only=True)
class Sine:
    """A sine wave."""

    kind: Literal["sine"] = "sine"
    "Which ground it is."

    amplitude: float = 0.02
    "Amplitude [m]."

    def __post_init__(self):
        if not self.amplitude > 0:
            raise ValueError(f"amplitude must be greater than 0 m, got {self.amplitude}.")


@dataclass(frozen=True, kw_only=True)
class Step:
    """A step."""

    kind: Literal["step"] = "step"
    height: float = 0.1


@dataclass(frozen=True, kw_only=True)
class Scanner:
    """A line scanner with a mirror.

    More about it.
    """

    beams: int = 940
    "Beams per scan."

    position: tuple[float, float, float] = (0.0, 0.0, 2.0)
    """Position in the body frame [m],
    forward, left and up."""

    side: Side = Side.LEFT
    "Side that it looks to."


@dataclass(frozen=True, kw_only=True)
class Lane:
    offset: float = 0.0
    "Offset of the lane [m]."


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A scene."""

    name: str = 'say "hi" \\ é'
    "Name of the scene."

    seed: int | None = None
    "Seed of all randomness."

    steady: bool = True
    limit: float = math.inf
    tiny: float = 1e-7
    scanner: Scanner = Scanner()
    spare: Scanner | None = None
    "A second scanner."

    ground: Annotated[Sine | Step, Field(discriminator="kind")] = Sine()
    lanes: tuple[Lane, ...] = (Lane(), Lane(offset=3.5))
    extra: dict[str, float] = field(default_factory=lambda: {"a b": 1.0})


@dataclass(frozen=True, kw_only=True)
class Needs:
    """Something with a required value."""

    mass: float
    "Mass [kg]."

    file: Path
    mode: Literal["slow", "fast"]
    size: tuple[int, ...]
    inner: Scanner


def written(folder, text):
    path = folder / "scene.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_an_empty_file_gives_the_defaults(tmp_path):
    assert read_settings(Scene, written(tmp_path, "")) == Scene()


def test_values_replace_defaults_at_any_depth(tmp_path):
    path = written(
        tmp_path,
        'name = "kerb"\n[scanner]\nposition = [1, 0, 2.5]\nside = "right"\n'
        '[ground]\nkind = "step"\nheight = 0.2\n[[lanes]]\noffset = -1\n',
    )
    scene = read_settings(Scene, path)
    assert scene.scanner == Scanner(position=(1.0, 0.0, 2.5), side=Side.RIGHT)
    assert scene.ground == Step(height=0.2)
    assert scene.lanes == (Lane(offset=-1.0),)
    assert type(scene.scanner.position[0]) is float


def test_the_template_reads_back_to_the_same_settings(tmp_path):
    for scene in (Scene(), Scene(name="x", seed=3, spare=Scanner(beams=2), ground=Step())):
        assert read_settings(Scene, written(tmp_path, settings_template(scene))) == scene
    assert read_settings(Scene, written(tmp_path, settings_template(Scene))) == Scene()


def test_the_template_is_complete_and_explained():
    lines = settings_template(Scene).splitlines()
    assert lines[0] == "# A scene."
    for wanted in (
        "# Name of the scene.",
        "# seed = ... (not set: whole number)",
        "limit = inf",
        "tiny = 1e-07",
        "# A line scanner with a mirror.",
        "[scanner]",
        "# Beams per scan.",
        "beams = 940",
        "# Position in the body frame [m], forward, left and up.",
        "position = [0.0, 0.0, 2.0]",
        '# Side that it looks to. One of "left", "right".',
        'side = "left"',
        "# A second scanner.",
        "# [spare]",
        "# beams = 940",
        "[ground]",
        "[[lanes]]",
        "offset = 3.5",
    ):
        assert wanted in lines, wanted
    # no key of the scene may stand below a table, where it would belong to the table
    assert set(tomllib.loads("\n".join(lines))) == {
        "name",
        "steady",
        "limit",
        "tiny",
        "extra",
        "scanner",
        "ground",
        "lanes",
    }


def test_required_values_stand_in_comments():
    text = settings_template(Needs, title="Fill in")
    assert text.startswith("# Fill in\n")
    assert "# mass = ... (required: number)" in text
    assert '# mode = ... (required: "slow" or "fast")' in text
    assert "# size = ... (required: [whole number, ...])" in text
    assert "# file = ... (required: text)" in text
    assert '# One of "slow", "fast".' in text
    # a table that must be there stands open, with what has a default
    assert set(tomllib.loads(text)) == {"inner"}
    assert tomllib.loads(text)["inner"]["beams"] == 940


def test_a_misspelt_key_names_the_right_one(tmp_path):
    path = written(tmp_path, "[scanner]\nbeems = 3\n")
    with pytest.raises(FormatError) as error:
        read_settings(Scene, path)
    assert str(error.value) == f"{path}: scanner.beems: is unknown (did you mean 'beams'?)."


def test_an_unknown_key_lists_the_known_ones():
    with pytest.raises(FormatError, match=r"xyz: is unknown .known are beams, position, side"):
        parse_settings(Scanner, {"xyz": 1})


def test_misspelt_keys_in_arrays_and_unions_are_found():
    with pytest.raises(FormatError) as error:
        parse_settings(
            Scene, {"lanes": [{}, {"ofset": 1}], "ground": {"kind": "step", "heigth": 0.1}}
        )
    assert "lanes.1.ofset: is unknown (did you mean 'offset'?" in str(error.value)
    assert "ground.heigth: is unknown (did you mean 'height'?" in str(error.value)


def test_all_problems_are_listed_in_one_line():
    with pytest.raises(FormatError) as error:
        parse_settings(
            Scene,
            {
                "seed": "3",
                "steady": 1,
                "scanner": {"beams": 2.5, "position": [0, 0], "side": "up"},
                "ground": {"kind": "sine", "amplitude": -1.0},
            },
        )
    text = str(error.value)
    assert "\n" not in text
    assert 'seed: must be a valid integer, got "3"' in text
    assert "steady: must be a valid boolean, got 1" in text
    assert "scanner.beams: must be a valid integer" in text
    assert "scanner.position.2: is missing" in text
    assert "scanner.side: must be 'left' or 'right', got \"up\"" in text
    assert "ground: amplitude must be greater than 0 m, got -1.0" in text
    assert text.count("; ") == 5


def test_missing_values_are_named():
    with pytest.raises(FormatError) as error:
        parse_settings(Needs, {"mass": 1, "size": [1], "inner": {}, "mode": "slow"})
    assert str(error.value) == "file: is missing."


def test_an_unknown_kind_of_union_is_named():
    with pytest.raises(FormatError, match=r"ground: .*'sine', 'step'"):
        parse_settings(Scene, {"ground": {"kind": "cosine"}})


def test_a_table_where_a_value_must_be():
    with pytest.raises(FormatError, match=r"steady: must be a valid boolean, got a table"):
        parse_settings(Scene, {"steady": {"a": 1}})


def test_text_that_is_no_toml_names_the_line(tmp_path):
    path = written(tmp_path, "name = 'a'\nseed = \n")
    with pytest.raises(FormatError, match=r"scene.toml: line 2, column 8: is no TOML: invalid"):
        read_settings(Scene, path)


def test_a_file_that_is_not_utf8(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_bytes(b'name = "\xe9"\n')
    with pytest.raises(FormatError, match="is not written in UTF-8"):
        read_settings(Scene, path)


def test_a_byte_order_mark_is_ignored(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_bytes(b'\xef\xbb\xbfname = "a"\n')
    assert read_settings(Scene, path).name == "a"


def test_help_is_inherited():
    @dataclass(frozen=True, kw_only=True)
    class Child(Scanner):
        rate: float = 1000.0
        "Scans per second [1/s]."

    docs = attribute_docs(Child)
    assert docs["beams"] == "Beams per scan."
    assert docs["rate"] == "Scans per second [1/s]."


# --- tables that complete the defaults of their fields --------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Mount:
    """A mounting."""

    place: tuple[float, float] = (0.0, 0.0)
    "Place [m]."

    clock: float = 0.0
    "Clock [s]."


@dataclass(frozen=True, kw_only=True)
class RandomDrift:
    """Drift as a random process."""

    sd: float = 0.02

    def __post_init__(self):
        if not self.sd >= 0:
            raise ValueError(f"sd must be at least 0 m, got {self.sd}.")


@dataclass(frozen=True, kw_only=True)
class Series:
    """Drift as measured."""

    time: tuple[float, ...]
    height: tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class Rig:
    """What carries instruments."""

    mount: Mount = field(default_factory=lambda: Mount(place=(-2.0, 1.0)))
    reported: Mount | None = field(default=None, metadata={"table": Mount(place=(-2.0, 1.0))})
    drift: RandomDrift | Series = field(default_factory=lambda: RandomDrift(sd=0.5))
    layers: tuple[dict[str, object], ...] = ()


@dataclass(frozen=True, kw_only=True)
class Fleet:
    """Some rigs."""

    rigs: tuple[Rig, ...] = ()
    first: Rig = field(default_factory=lambda: Rig(mount=Mount(place=(7.0, 7.0), clock=1.0)))


def test_a_table_completes_the_default_of_its_field():
    rig = parse_settings(Rig, {"mount": {"clock": 0.5}, "reported": {}})
    assert rig.mount == Mount(place=(-2.0, 1.0), clock=0.5)
    assert rig.reported == Mount(place=(-2.0, 1.0))
    assert parse_settings(Rig, {}).reported is None
    assert parse_settings(Rig, {"mount": {"place": [0.0, 0.0]}}).mount == Mount()


def test_a_table_completes_defaults_at_any_depth():
    fleet = parse_settings(
        Fleet, {"rigs": [{"mount": {"clock": 2.0}}], "first": {"mount": {"clock": 3.0}}}
    )
    assert fleet.rigs[0].mount == Mount(place=(-2.0, 1.0), clock=2.0)
    assert fleet.first.mount == Mount(place=(7.0, 7.0), clock=3.0)
    assert parse_settings(Fleet, {"first": {"drift": {}}}).first.mount.clock == 1.0


def test_tables_of_another_class_are_not_completed():
    series = {"time": [0.0, 1.0], "height": [0.0, 0.1]}
    assert parse_settings(Rig, {"drift": series}).drift == Series(
        **{name: tuple(values) for name, values in series.items()}
    )
    assert parse_settings(Rig, {"drift": {}}).drift == RandomDrift(sd=0.5)


@pytest.mark.parametrize(
    ("drift", "message"),
    [
        ({"sd": -1.0}, r"^drift: sd must be at least 0 m, got -1\.0\.$"),
        ({"sdd": 1.0}, r"^drift\.sdd: is unknown \(did you mean 'sd'\?\)\.$"),
        (
            {"time": [0.0], "hight": [1.0]},
            r"^drift\.height: is missing; drift\.hight: is unknown \(did you mean 'height'\?\)\.$",
        ),
        ({"time": "now", "height": [1.0]}, r"^drift\.time: must be a valid .*array, got"),
    ],
)
def test_messages_concern_the_nearest_class_of_a_union(drift, message):
    with pytest.raises(FormatError, match=message):
        parse_settings(Rig, {"drift": drift})


def test_long_arrays_take_a_line_for_each_value(tmp_path):
    layers = tuple({"kind": "road", "seed": n, "two words": "a" * 30} for n in range(3))
    text = settings_template(Rig(layers=layers))
    assert '    { kind = "road", seed = 1, "two words"' in text
    assert max(map(len, text.splitlines())) <= 100
    (tmp_path / "rig.toml").write_text(text)
    assert read_settings(Rig, tmp_path / "rig.toml") == Rig(layers=layers)
    assert "# place = [-2.0, 1.0]" in text  # what a table would be completed with
