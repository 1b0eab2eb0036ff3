"""Options of commands: settings, values and limits of numbers, and options of earlier versions."""

import re
from collections.abc import Iterator, Sequence
from typing import Any

from cyclopts import CoercionError, Group, Parameter, Token, convert

# a length, time or angle beyond these is a mistake; within them its square stays in range
_MIN_SIZE, _MAX_SIZE = 1e-12, 1e12
_MAX_INTEGER = 2**63 - 1  # of counts and seeds: a signed integer of 64 bits

#: Options of earlier versions and their present names; they are accepted for one release.
RENAMED = {
    "calibrate": {
        "--largest-angle": "--max-angle",
        "--largest-angle-sd": "--max-angle-sd",
        "--largest-clock-sd": "--max-clock-sd",
        "--largest-lever-sd": "--max-lever-sd",
        "--largest-rounds": "--max-iterations",
    },
    "compare": {"--settle": "--settling-length"},
    "grid": {"--minimum-count": "--min-count"},
    "profile": {"--minimum-count": "--min-count"},
}


def rename_options(command: str, arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """Replace options of earlier versions by their present names.

    Parameters
    ----------
    command : str
        Name of the command.
    arguments : sequence of str
        Arguments of the command.

    Returns
    -------
    arguments : list of str
        Arguments with the present names.
    notes : list of str
        One line for each option that was replaced.

    Examples
    --------
    >>> rename_options("grid", ["run.zarr", "--minimum-count=2"])
    (['run.zarr', '--min-count=2'], ['--minimum-count is now --min-count; ...'])
    """
    present = RENAMED.get(command, {})
    renamed, notes = [], []
    for argument in arguments:
        name, equals, value = argument.partition("=")
        if name in present:
            renamed.append(f"{present[name]}{equals}{value}")
            notes.append(f"{name} is now {present[name]}; the old name goes with the next release")
        else:
            renamed.append(argument)
    return renamed, list(dict.fromkeys(notes))


def flatten_settings(title: str, *, omit: Sequence[str] = (), sort_key: int = 1) -> Parameter:
    """Make each field of a dataclass of settings an option, with its docstring as help.

    Parameters
    ----------
    title : str
        Heading of these options in the help.
    omit : sequence of str
        Fields that are not options of the command.
    sort_key : int
        Place of the heading among others.

    Returns
    -------
    cyclopts.Parameter
        Annotation of the parameter that takes the dataclass.
    """
    # cyclopts parses the fields whose names the pattern matches
    parsed = re.compile(rf"^(?!({'|'.join(omit)})$)") if omit else None
    return Parameter(name="*", group=Group(title, sort_key=sort_key), parse=parsed)


def convert_value(kind: Any, tokens: Sequence[Token]) -> Any:
    """Convert the words of an option to its value.

    Parameters
    ----------
    kind : type
        Type of the option.
    tokens : sequence of cyclopts.Token
        Words of the command line.

    Returns
    -------
    object
        Value of the option.

    Raises
    ------
    cyclopts.CoercionError
        If a number is not finite, too large or too small, or a whole number is not written as one:
        1.5 is refused, not rounded.
    """
    value = convert(kind, tokens)
    for number, token in zip(_flatten_values(value), tokens, strict=True):
        try:
            check_number(number, token.value)
        except ValueError as error:
            raise CoercionError(msg=str(error), token=token) from None
    return value


#: Parameter of an option that is an integer; `convert_value`, the default, checks it as well.
INTEGER = Parameter(converter=convert_value)


def check_number(value: object, text: str) -> None:
    """Raise ValueError if a number of the command line is not valid; other values are ignored.

    Parameters
    ----------
    value : object
        Value.
    text : str
        The word of the command line that gave it.

    Examples
    --------
    >>> check_number(1e300, "1e300")
    Traceback (most recent call last):
    ValueError: must be 0, or from 1e-12 to 1e+12 in size, got 1e+300.
    """
    if isinstance(value, float) and not (value == 0 or _MIN_SIZE <= abs(value) <= _MAX_SIZE):
        message = f"must be 0, or from {_MIN_SIZE:g} to {_MAX_SIZE:g} in size, got {value}."
        raise ValueError(message)
    if not isinstance(value, int) or isinstance(value, bool):
        return
    if not re.fullmatch(r"[+-]?[0-9]+", text):
        message = f"must be a whole number, got {text!r}."
        raise ValueError(message)
    if abs(value) > _MAX_INTEGER:
        message = f"must be at most {_MAX_INTEGER} in size, got {value}."
        raise ValueError(message)


def _flatten_values(value: object) -> Iterator[object]:
    if isinstance(value, tuple | list):
        for one in value:
            yield from _flatten_values(one)
    else:
        yield value
