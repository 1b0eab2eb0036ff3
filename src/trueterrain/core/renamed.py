"""Keywords of earlier versions: accepted for one release, with a warning."""

import warnings
from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")


def rename_keyword(
    old: str, new: str
) -> Callable[[Callable[Parameters, Result]], Callable[Parameters, Result]]:
    """Decorate a function so that it also accepts a keyword by its earlier name.

    Parameters
    ----------
    old : str
        Name in earlier versions.
    new : str
        Present name.

    Returns
    -------
    callable
        The decorator.

    Examples
    --------
    >>> @rename_keyword("options", "settings")
    ... def rate_profile(*, settings: str) -> str:
    ...     return settings
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("ignore")
    ...     rate_profile(options="exact")
    'exact'
    """

    def decorate(function: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
        @wraps(function)
        def call(*args: Parameters.args, **kwargs: Parameters.kwargs) -> Result:
            if old in kwargs and new not in kwargs:
                name = f"{function.__name__}({old}=...)"
                text = f"{name} is {new}=... now; the old name goes with the next release."
                warnings.warn(text, DeprecationWarning, stacklevel=2)
                kwargs[new] = kwargs.pop(old)
            return function(*args, **kwargs)

        return call

    return decorate
