"""Results as JSON takes them."""

import math
from typing import Any


def finite(value: Any) -> Any:
    """As JSON gives it back: tuples become lists, what is not finite null.

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
    >>> finite({"sd": (0.1, float("nan"))})
    {'sd': [0.1, None]}
    """
    if isinstance(value, dict):
        return {name: finite(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
