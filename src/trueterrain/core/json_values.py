"""Values for JSON, and text for terminals and figures."""

import math
import re
from typing import Any

# what commands a terminal, or turns the order of what it shows: all but tab and line feed
_CONTROLS = re.compile("[\\x00-\\x08\\x0b-\\x1f\\x7f-\\x9f\\u2028-\\u202e\\u2066-\\u2069]")


def printable_text(text: str) -> str:
    """Text in which control characters, as of file names or headers, are written as escapes.

    Parameters
    ----------
    text : str
        Any text.

    Returns
    -------
    str
        Text that shows what it is, whoever wrote it.

    Examples
    --------
    >>> len("a" + chr(27) + "[31m"), len(printable_text("a" + chr(27) + "[31m"))
    (6, 9)
    """
    return _CONTROLS.sub(lambda found: found[0].encode("unicode_escape").decode("ascii"), text)


def json_values(value: Any) -> Any:
    """Value for JSON: tuples become lists, numbers that are not finite become None.

    Parameters
    ----------
    value : object
        Dictionaries, lists, tuples, words and numbers in each other.

    Returns
    -------
    object
        The same, to be written.

    Examples
    --------
    >>> json_values({"sd": (0.1, float("nan"))})
    {'sd': [0.1, None]}
    """
    if isinstance(value, dict):
        return {name: json_values(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [json_values(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
