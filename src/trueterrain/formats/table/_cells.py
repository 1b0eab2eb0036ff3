"""Text in cells of CSV, guarded against being run as a formula by a spreadsheet."""

import re

import numpy as np
import numpy.typing as npt

# a spreadsheet runs a cell that begins so as a formula; an apostrophe before it makes it text
_FORMULA = re.compile(r"'*[=+\-@\t\r]")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")


def guard_text(text: str) -> str:
    """Text of a cell: an apostrophe is put before a text that would be a formula.

    Examples
    --------
    >>> guard_text("=1+2"), guard_text("-0.75"), guard_text("left")
    ("'=1+2", '-0.75', 'left')
    """
    return f"'{text}" if _FORMULA.match(text) and not _NUMBER.fullmatch(text) else text


def bare_texts(cells: npt.NDArray[np.str_]) -> npt.NDArray[np.str_]:
    """Texts without the apostrophe of `guard_text`."""
    names, place = np.unique(cells, return_inverse=True)
    bare = [name[1:] if name[:1] == "'" and _FORMULA.match(name) else name for name in names]
    return np.array(bare, dtype=np.str_)[place]
