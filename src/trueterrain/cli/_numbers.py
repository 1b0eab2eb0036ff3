"""Numbers as options take them."""

from collections.abc import Sequence

from cyclopts import Parameter, Token


def _whole(_type: object, tokens: Sequence[Token]) -> int:
    (token,) = tokens
    try:
        return int(token.value)
    except ValueError:
        message = f"must be a whole number, got {token.value!r}."
        raise ValueError(message) from None


#: Of an option that is a whole number: 1.5 is refused, not rounded.
WHOLE = Parameter(converter=_whole)
