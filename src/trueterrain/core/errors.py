"""Errors in data, and their messages.

::

    Exception
     ├── ValueError            an argument breaks its rule
     └── TrueTerrainError      the data break a rule
          ├── FormatError      a file is damaged or not of its stated format
          ├── SchemaError      a dataset lacks a variable, unit or dimension
          ├── CoverageError    data do not cover what is asked for
          └── OutputError      an output cannot be written

Every message is one line: the file, the place in it, the rule and what was found, and the cure.
"""

import difflib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

_CUTOFF = 0.6  # least similarity, from 0 to 1 (ratio of `difflib`), of a name that is suggested


class TrueTerrainError(Exception):
    """The data break a rule.

    Parameters
    ----------
    problem : str
        The rule, and what was found instead.
    path : str or Path, optional
        File in which it was found.
    place : str, optional
        Where in the file or dataset: a line, a record, a variable, a station.
    cure : str, optional
        What the user can do about it.

    Examples
    --------
    >>> print(FormatError("has 3 of 8 columns", path="p.erd", place="line 12", cure="Copy it."))
    p.erd: line 12: has 3 of 8 columns. Copy it.
    """

    def __init__(
        self,
        problem: str,
        *,
        path: str | Path | None = None,
        place: str | None = None,
        cure: str | None = None,
    ) -> None:
        self.problem = problem.rstrip(".")
        self.path = None if path is None else Path(path)
        self.place = place
        self.cure = cure
        super().__init__(problem)

    def __str__(self) -> str:
        where = [str(part) for part in (self.path, self.place) if part is not None]
        message = ": ".join([*where, self.problem]) + "."
        return " ".join(" ".join(part.split()) for part in (message, self.cure) if part)


class FormatError(TrueTerrainError):
    """A file is damaged or not of its stated format."""


class SchemaError(TrueTerrainError):
    """A dataset lacks a variable, a unit or a dimension that its schema requires."""


class CoverageError(TrueTerrainError):
    """Data do not cover what is asked for."""


class OutputError(TrueTerrainError):
    """An output cannot be written."""


@contextmanager
def name_file_in_errors(path: str | Path | None) -> Iterator[None]:
    """Name a file in the errors of a block that do not name one themselves.

    Parameters
    ----------
    path : str, Path or None
        The file; None for data that came from no file.

    Examples
    --------
    >>> try:
    ...     with name_file_in_errors("p.erd"):
    ...         raise CoverageError("there is no height", place="s = 2 m")
    ... except CoverageError as error:
    ...     print(error)
    p.erd: s = 2 m: there is no height.
    """
    try:
        yield
    except TrueTerrainError as error:
        if path is not None:
            error.path = error.path or Path(path)
        raise


def suggest_name(name: str, known: Iterable[str]) -> str:
    """``" (did you mean 'x'?)"`` if a known name is similar, else nothing.

    Examples
    --------
    >>> suggest_name("beems", ["beams", "angles"])
    " (did you mean 'beams'?)"
    """
    near = difflib.get_close_matches(name, list(known), n=1, cutoff=_CUTOFF)
    return f" (did you mean {near[0]!r}?)" if near else ""
