"""Header of a table in text: titles, names of the columns, separator and decimal sign."""

import csv
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from trueterrain.core.errors import FormatError

_LINES = 200  # lines that are not blank, among which the header is searched
_SEPARATORS = ("\t", ";", ",")


@dataclass(frozen=True, kw_only=True)
class Head:
    """Header of a text table: names of the columns, separator, decimal sign, first line of data."""

    separator: str | None
    "Sign between two fields; None stands for blanks."

    decimal: str
    "Decimal sign: a point or a comma."

    labels: tuple[str, ...]
    "Names of the columns; of a table without names the fields of its first line."

    named: bool
    "Whether the labels are names."

    first: int
    "Number of the first line of data, from 1."


def find_head(lines: Iterable[str], understood: Callable[[list[str]], bool]) -> Head | None:
    r"""Find the header of a table in text.

    Titles may precede the names of the columns. The names are the first line that `understood`
    accepts. If there is none, they are the last line without numbers before the first two lines
    that hold numbers only, provided that the numbers of fields agree; else the columns have no
    names. A comment (#) directly before the data is accepted as names if `understood` accepts it.

    Parameters
    ----------
    lines : iterable of str
        Lines of the file.
    understood : callable
        Takes the fields of a line; returns whether they are names of columns.

    Returns
    -------
    Head or None
        None if there is no line with content.

    Examples
    --------
    >>> text = "Road A1\nmeasured in May\ns;height [mm]\n0,0;1,5\n0,1;2\n"
    >>> head = find_head(text.splitlines(), lambda labels: "s" in labels)
    >>> head.labels, head.separator, head.decimal, head.first
    (('s', 'height [mm]'), ';', ',', 4)
    """
    numbered = enumerate(lines, start=1)
    content = list(islice(((n, line) for n, line in numbered if line.strip()), _LINES))
    rows = [(n, line) for n, line in content if not line.startswith("#")]
    if not rows:
        return None
    data = next((at for at in range(len(rows)) if _numbers_begin(rows, at)), len(rows))
    for at, (_, line) in enumerate(rows[:data]):
        labels = split_line(line, separator_of(line))
        if len(labels) > 1 and understood(labels):
            return _named_head(rows, at)
    if data == len(rows):
        return _named_head(rows, 0)
    first, line = rows[data]
    separator, decimal = _signs_of_numbers(line) or (None, ".")
    fields = split_line(line, separator)
    # rows with empty cells may lie between the names and the first row of numbers only
    before = []
    for at in reversed(range(data)):
        words = split_line(rows[at][1], separator)
        if len(words) != len(fields):
            break
        before.append(at)
        if not any(map(_is_number, words)):
            break
    if before:
        return _named_head(rows, before[-1])
    comment = next((line for n, line in reversed(content) if n < first), "")
    labels = split_line(comment.lstrip("# "), separator_of(comment))
    if len(labels) == len(fields) and understood(labels):
        fields, named = labels, True
    else:
        named = False
    return Head(
        separator=separator, decimal=decimal, labels=tuple(fields), named=named, first=first
    )


def separator_of(line: str) -> str | None:
    """Separator of the columns in a line of text; None stands for blanks."""
    return next((separator for separator in _SEPARATORS if separator in line), None)


def split_line(line: str, separator: str | None, path: str | Path | None = None) -> list[str]:
    """Split a line into fields, without quotes and the blanks around them.

    Raises
    ------
    FormatError
        If a field is longer than any number or name, or a quote is not closed.
    """
    if separator is None:
        return line.split()
    rows = csv.reader([line.rstrip("\r\n")], delimiter=separator, skipinitialspace=True)
    try:
        return next(rows, [])
    except csv.Error as error:
        raise FormatError(
            f"cannot be split into fields ({error})",
            path=path,
            place=f"line that begins with {line[:40]!r}",
            cure="Export it again as plain CSV.",
        ) from None


def number_of(text: str, decimal: str = ".") -> float | None:
    """Number in a text, or None; a comma is accepted only as the decimal sign."""
    if decimal == ",":
        text = "" if "." in text else text.replace(",", ".")
    try:
        return float(text)
    except ValueError:
        return None


def _named_head(rows: list[tuple[int, str]], at: int) -> Head:
    """Header whose names are the row `at`; the rows that follow show the decimal sign."""
    line, text = rows[at]
    separator = separator_of(text)
    fields = [field for _, row in rows[at + 1 :] for field in split_line(row, separator)]
    comma = separator != "," and any(
        number_of(field) is None and number_of(field, ",") is not None for field in fields
    )
    return Head(
        separator=separator,
        decimal="," if comma else ".",
        labels=tuple(split_line(text, separator)),
        named=True,
        first=line + 1,
    )


def _numbers_begin(rows: list[tuple[int, str]], at: int) -> bool:
    """Whether a row and the next hold equally many numbers; the first and last row count alone."""
    signs = _signs_of_numbers(rows[at][1])
    if signs is None or at in (0, len(rows) - 1):
        return signs is not None
    fields = split_line(rows[at][1], signs[0])
    others = split_line(rows[at + 1][1], signs[0])
    return len(fields) == len(others) and all(_is_number(other) for other in others)


def _signs_of_numbers(line: str) -> tuple[str | None, str] | None:
    """Separator and decimal sign that split a line into two or more numbers, or None."""
    for separator in (*(sign for sign in _SEPARATORS if sign in line), None):
        fields = split_line(line, separator)
        for decimal in ".," if separator != "," else ".":
            if len(fields) > 1 and all(number_of(one, decimal) is not None for one in fields):
                return separator, decimal
    return None


def _is_number(text: str) -> bool:
    return number_of(text) is not None or number_of(text, ",") is not None
