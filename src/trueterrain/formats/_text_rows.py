"""Rows of a table in text: read fast by pandas, and line by line to explain an error.

pandas reports neither the line nor the column of a cell that it cannot read, and fills lines that
are too short. So tables are read by pandas, and only where that fails, or leaves gaps, the file is
read a second time in Python, up to the first line that breaks a rule.
"""

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from trueterrain.core.errors import FormatError
from trueterrain.formats._text_head import split_line

#: Texts of cells that hold no number on purpose.
GAPS = ("", "nan", "NaN", "NAN", "NA", "null")

_BLANKS = r"\s+"  # separator, for pandas
_ALL = 1 << 62  # rows in a block: more than any file has


@dataclass(frozen=True, kw_only=True)
class TextRows:
    """Where the rows of a text begin, and how they are divided into fields."""

    path: Path
    "The file."

    separator: str | None
    "Sign between two fields; None stands for blanks."

    decimal: str
    "Decimal sign: a point or a comma."

    first: int
    "Number of the first line of data, from 1."

    fields: int
    "Number of fields of each line."

    encoding: str = "utf-8-sig"
    "Encoding of the file."

    def frames(
        self, numeric: Collection[int], size: int | None, explain: Callable[[], None]
    ) -> Iterator[Any]:
        """Yield the rows as frames of pandas, `size` rows at a time.

        Parameters
        ----------
        numeric : collection of int
            Indices of the columns that hold numbers; all others are read as text.
        size : int or None
            Largest number of rows in a frame; None: all.
        explain : callable
            Called if pandas refuses a row; raises a FormatError that names the line, see `check`.

        Raises
        ------
        FormatError
            If a row cannot be read.
        """
        # all columns are read: pandas overlooks surplus fields if only some columns are asked for
        dtypes = {index: float if index in numeric else str for index in range(self.fields)}
        try:
            with pd.read_csv(
                self.path,
                sep=self.separator or _BLANKS,
                decimal=self.decimal,
                header=None,
                skiprows=self.first - 1,
                dtype=dtypes,
                chunksize=size or _ALL,
                encoding=self.encoding,
                encoding_errors="replace",
                keep_default_na=False,
                na_values=list(GAPS),
                skipinitialspace=True,
                skip_blank_lines=True,
                comment="#",
                **_exact_parser(pd.__version__),
            ) as reader:
                yield from reader
        except pd.errors.EmptyDataError:
            return
        except ValueError as error:  # errors of pandas' parser are ValueErrors, too
            explain()
            raise FormatError(
                f"cannot be read as a table ({error})",
                path=self.path,
                cure="Export it again as plain CSV.",
            ) from None

    def numbered(self) -> Iterator[tuple[int, list[str]]]:
        """Yield the number of each line of data, from 1, and its fields."""
        with self.path.open(encoding=self.encoding, errors="replace", newline=None) as stream:
            for number, line in enumerate(stream, start=1):
                if number >= self.first and is_content(line):
                    yield number, split_line(line, self.separator, self.path)

    def check(self, check_cell: Callable[[int, int, str], None], indices: Collection[int]) -> None:
        """Raise a FormatError at the first line that breaks a rule.

        Parameters
        ----------
        check_cell : callable
            Takes the number of a line, the index of a column and the text of the cell; raises a
            FormatError if it breaks a rule.
        indices : collection of int
            Columns whose cells are checked.
        """
        for number, cells in self.numbered():
            self.check_count(number, len(cells))
            for index in indices:
                check_cell(number, index, cells[index])

    def check_count(self, number: int, found: int) -> None:
        """Raise a FormatError if a line has too few or too many fields."""
        if found != self.fields:
            raise FormatError(
                f"has {found} of {self.fields} fields",
                path=self.path,
                place=f"line {number}",
                cure="Complete or remove the line; if it is the last, the file was cut off.",
            )

    def number_error(self, number: int, label: str, text: str, cure: str = "") -> FormatError:
        """Error of a cell that holds no number."""
        return FormatError(
            f"must be a number, got {text[:80]!r}",
            path=self.path,
            place=f"line {number}, column {label!r}",
            cure=cure or "Correct the line, or export the file again.",
        )


def is_content(line: str) -> bool:
    """Whether a line holds data: it is neither blank nor a comment."""
    return bool(line.strip()) and not line.startswith("#")


def _exact_parser(pandas: str) -> dict[str, Any]:
    """Option that makes pandas read numbers to the last bit: the default since version 3.1."""
    version = tuple(int(part) for part in pandas.split(".")[:2])
    return {} if version >= (3, 1) else {"float_precision": "round_trip"}
