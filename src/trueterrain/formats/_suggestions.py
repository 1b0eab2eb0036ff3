"""Suggestion of the known name that is nearest to a misspelt one, for error messages."""

import difflib
from collections.abc import Iterable

_CUTOFF = 0.6  # least similarity, from 0 to 1 (ratio of `difflib`), of a name that is suggested


def suggest_name(name: str, known: Iterable[str]) -> str:
    """``" (did you mean 'x'?)"`` if a known name is similar, else nothing.

    Examples
    --------
    >>> suggest_name("beems", ["beams", "angles"])
    " (did you mean 'beams'?)"
    """
    near = difflib.get_close_matches(name, list(known), n=1, cutoff=_CUTOFF)
    return f" (did you mean {near[0]!r}?)" if near else ""
