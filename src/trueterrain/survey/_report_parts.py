"""Helpers for the tables of reports."""

import re

from trueterrain.report import Column

_COLUMN = re.compile(r"([^\[]+?)(?: \[([^\]]+)\])?(?: \.(\d))?")


def parse_columns(text: str) -> tuple[Column, ...]:
    """Columns of a table from text such as "Lane; Height [mm] .2": labels, units and decimals.

    Parameters
    ----------
    text : str
        Columns with semicolons between them.

    Returns
    -------
    tuple of Column
        One for each.

    Examples
    --------
    >>> parse_columns("Lane; Height [mm] .2")[1]
    Column(label='Height', unit='mm', digits=2)
    """
    found = [_COLUMN.fullmatch(part.strip()) for part in text.split(";")]
    return tuple(
        Column(label=one[1], unit=one[2] or "", digits=int(one[3]) if one[3] else None)
        for one in found
        if one is not None
    )


def to_millimetres(metres: float | None) -> float | None:
    """Length in mm.

    Parameters
    ----------
    metres : float or None
        Length [m], or None if it is not known.

    Returns
    -------
    float or None
        The same [mm].
    """
    return None if metres is None else 1000.0 * metres
