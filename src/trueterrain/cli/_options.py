"""Options of commands: converters and limits of numbers, and options of earlier versions."""

from collections.abc import Sequence

from cyclopts import Parameter, Token

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


def _parse_integer(_type: object, tokens: Sequence[Token]) -> int:
    (token,) = tokens
    try:
        return int(token.value)
    except ValueError:
        message = f"must be a whole number, got {token.value!r}."
        raise ValueError(message) from None


#: Parameter of an option that is an integer: 1.5 is refused, not rounded.
INTEGER = Parameter(converter=_parse_integer)


def check_number(_type: object, value: object) -> None:
    """Raise ValueError if an option holds a number that is not finite, too large or too small.

    Parameters
    ----------
    value : object
        Value of the option; each number of a tuple or list is checked.

    Examples
    --------
    >>> check_number(float, 1e300)
    Traceback (most recent call last):
    ValueError: must be 0, or from 1e-12 to 1e+12 in size, got 1e+300.
    """
    if isinstance(value, tuple | list):
        for one in value:
            check_number(_type, one)
    elif isinstance(value, int) and abs(value) > _MAX_INTEGER:
        message = f"must be at most {_MAX_INTEGER} in size, got {value}."
        raise ValueError(message)
    elif isinstance(value, float) and not (value == 0 or _MIN_SIZE <= abs(value) <= _MAX_SIZE):
        message = f"must be 0, or from {_MIN_SIZE:g} to {_MAX_SIZE:g} in size, got {value}."
        raise ValueError(message)
