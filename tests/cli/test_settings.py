"""Settings as options: names, defaults and help come from the dataclasses."""

from dataclasses import dataclass
from typing import Annotated

import cyclopts
import pytest

from trueterrain.cli import command_line
from trueterrain.cli._options import check_number
from trueterrain.cli._settings import Flattened, flatten_settings
from trueterrain.formats.settings import attribute_docs
from trueterrain.motion import FusionSettings
from trueterrain.surface import GridSettings


@dataclass(frozen=True, kw_only=True)
class Inner:
    """Settings of a part."""

    depth: float = 1.0
    "Depth [m]."


@dataclass(frozen=True, kw_only=True)
class Disc:
    """Settings of some step."""

    radius: float = 0.1
    "Radius [m]."

    count: int = 3
    "Number of returns."

    limit: float = float("inf")
    "Maximum [m]."

    names: tuple[str, ...] = ()
    "Names of passes."

    hidden: bool = False
    "Not for users."

    inner: Inner = Inner()
    "A part."


@pytest.fixture
def parse():
    """Parse options of a command; returns its settings."""
    mark = Flattened(group="Disc", names={"names": "name", "hidden": None})
    found = []

    @flatten_settings
    def command(file: str, /, *, disc: Annotated[Disc, mark] = Disc(radius=0.2)) -> None:
        """Do something."""
        found.append((file, disc))

    app = cyclopts.App(
        default_parameter=cyclopts.Parameter(negative=(), validator=check_number),
        result_action="return_value",
    )
    app.default(command)

    def call(*options: str) -> Disc:
        app(
            ["a.csv", *options],
            exit_on_error=False,
            print_error=False,
            result_action="return_value",
        )
        return found[-1][1]

    return call


def test_an_option_that_is_not_given_has_the_value_of_the_command(parse):
    """Not that of the class, whether other options of the same settings are given or not."""
    assert parse() == Disc(radius=0.2)
    assert parse("--count", "5") == Disc(radius=0.2, count=5)


def test_options_set_fields(parse):
    expected = Disc(radius=0.3, limit=4.0, names=("left", "right"))
    assert parse("--radius", "0.3", "--limit", "4", "--name", "left", "--name", "right") == expected


@pytest.mark.parametrize(
    ("options", "rule"),
    [
        (["--count", "1.5"], "--count: must be a whole number"),
        (["--radius", "1e300"], "--radius.*in size"),
        (["--limit", "inf"], "--limit.*in size"),
        (["--hidden"], "Unknown option"),
        (["--names", "left"], "Unknown option"),
        (["--inner.depth", "2"], "Unknown option"),
        (["--disc.radius", "2"], "Unknown option"),
    ],
)
def test_numbers_are_checked_and_other_names_refused(parse, options, rule):
    with pytest.raises(cyclopts.CycloptsError, match=rule):
        parse(*options)


@pytest.mark.parametrize(
    ("command", "option", "settings", "field"),
    [
        ("grid", "--range-noise", GridSettings(range_noise=0.0005), "range_noise"),
        ("grid", "--max-gap", FusionSettings(), "max_gap"),
        ("georeference", "--method", FusionSettings(), "method"),
        ("calibrate", "--motion-drift-time", FusionSettings(), "drift_time"),
    ],
)
def test_defaults_and_help_are_those_of_the_settings(command, option, settings, field):
    options = command_line()[command].assemble_argument_collection(parse_docstring=True)
    (found,) = [one for one in options if one.name == option]
    assert found.field_info.default == getattr(settings, field)
    assert found.parameter.help == attribute_docs(type(settings))[field]
