"""Numbers as options take them."""

from collections.abc import Sequence

from cyclopts import Parameter, Token

_SMALLEST, _LARGEST = 1e-12, 1e12  # of any length, time or angle: their squares stay in range
_MOST = 2**63 - 1  # of what is counted, and of seeds: a whole number of 64 bits


def _parse_integer(_type: object, tokens: Sequence[Token]) -> int:
    (token,) = tokens
    try:
        return int(token.value)
    except ValueError:
        message = f"must be a whole number, got {token.value!r}."
        raise ValueError(message) from None


#: Of an option that is a whole number: 1.5 is refused, not rounded.
WHOLE = Parameter(converter=_parse_integer)


def require_usable(_type: object, value: object) -> None:
    """Raise ValueError if an option holds a number that no quantity has: not finite, or absurd.

    Parameters
    ----------
    value : object
        What the option holds; numbers in tuples and lists are looked at as well.

    Examples
    --------
    >>> require_usable(float, 1e300)
    Traceback (most recent call last):
    ValueError: must be 0, or from 1e-12 to 1e+12 in size, got 1e+300.
    """
    if isinstance(value, tuple | list):
        for one in value:
            require_usable(_type, one)
    elif isinstance(value, int) and abs(value) > _MOST:
        message = f"must be at most {_MOST} in size, got {value}."
        raise ValueError(message)
    elif isinstance(value, float) and not (value == 0 or _SMALLEST <= abs(value) <= _LARGEST):
        message = f"must be 0, or from {_SMALLEST:g} to {_LARGEST:g} in size, got {value}."
        raise ValueError(message)
