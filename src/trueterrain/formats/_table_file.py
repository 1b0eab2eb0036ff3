"""Columns of a table in text or Parquet, read block by block by pandas and pyarrow.

pandas reports neither the line nor the column of a cell that it cannot read, and fills lines that
are too short. So text is read by pandas, and only where that fails, or leaves gaps, the file is
read a second time in Python, up to the first line that breaks a rule.
"""

import json
import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
import pandas as pd

from trueterrain.core.errors import FormatError, TrueTerrainError, name_file_in_errors
from trueterrain.formats._text_head import Head, find_head, number_of, split_line
from trueterrain.formats.signature import open_regular

#: Values of some columns, by the index of the column.
Block = dict[int, npt.NDArray[Any]]

#: Key of the metadata of a Parquet file that hold CRS and provenance.
METADATA = b"trueterrain"

_GAPS = ("", "nan", "NaN", "NAN", "NA", "null")  # cells that hold no number on purpose
_BLANKS = r"\s+"  # separator, for pandas
_ALL = 1 << 62  # rows in a block of text: more than any file has
_ROWS = 1_000_000  # rows in a block of Parquet
_TAIL = 1 << 16  # [bytes] at the end of a text in which its last line is searched
_AGAIN = "Copy or export it again."


@dataclass(frozen=True, kw_only=True)
class ColumnRule:
    """What a column may hold."""

    label: str
    "Name of the column, for messages."

    is_text: bool = False
    "Whether it holds text, not numbers."

    accepts: Literal["any", "gaps", "finite"] = "any"
    "Whether numbers may be missing or infinite, may be missing, or must be finite."

    keep_type: bool = False
    "Whether whole numbers of Parquet keep their type; others become float64."

    def broken_by(self, values: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Whether numbers break the rule."""
        if self.accepts == "any":
            return np.zeros(np.shape(values), dtype=bool)
        return np.asarray(np.isinf(values) if self.accepts == "gaps" else ~np.isfinite(values))


class TextTable:
    """A table in text.

    Parameters
    ----------
    path : Path
        The file.
    head : Head
        Names of its columns, separator, decimal sign and first line of data.
    encoding : str
        Encoding of the file.
    """

    format = "CSV"

    def __init__(self, path: Path, head: Head, encoding: str = "utf-8-sig") -> None:
        self.path, self.head = path, head
        self.labels, self.named = head.labels, head.named
        self.attrs: dict[str, Any] = {}
        self._encoding = encoding

    def blocks(self, rules: Mapping[int, ColumnRule], size: int | None = None) -> Iterator[Block]:
        """Yield columns, `size` rows at a time.

        Parameters
        ----------
        rules : mapping of int to ColumnRule
            Rule of each column to read, by its index.
        size : int, optional
            Largest number of rows in a block; by default all.

        Raises
        ------
        FormatError
            At the first line that cannot be read or breaks a rule, or if there is no row.
        """
        is_checked, is_empty = False, True
        for frame in self._frames(rules, size):
            is_empty = False
            is_cut = frame.shape[1] != len(self.labels) or frame.iloc[:, -1].isna().any()
            if not is_checked and (is_cut or _break_rules(frame, rules)):
                self._check_lines(rules)
                is_checked = True
            yield {index: frame[index].to_numpy() for index in rules}
        if is_empty:
            raise FormatError(
                "has no rows", path=self.path, place=f"line {self.head.first}", cure=_AGAIN
            )

    def place(self, row: int) -> str:
        """Place of a row of data in the file; the first row is 0, the first line 1."""
        for index, (number, _) in enumerate(self._numbered_lines()):
            if index == row:
                return f"line {number}"
        return f"line {self.head.first + row}"

    def check_last_line(self) -> None:
        """Raise a FormatError if the last line is cut off, before anything else is read."""
        with self.path.open("rb") as stream:
            size = stream.seek(0, 2)
            stream.seek(max(0, size - _TAIL))
            tail = stream.read().decode(self._encoding, errors="replace")
        lines = [line for line in tail.splitlines() if _is_content(line)]
        last = split_line(lines[-1], self.head.separator, self.path) if lines else []
        if len(last) not in (0, len(self.labels)):
            count = sum(1 for _ in self._numbered_lines())
            self._check_count(self.place(count - 1), len(last))

    def _frames(self, rules: Mapping[int, ColumnRule], size: int | None) -> Iterator[pd.DataFrame]:
        # all columns are read: pandas overlooks surplus fields if only some columns are asked for
        dtypes = {
            index: float if index in rules and not rules[index].is_text else str
            for index in range(len(self.labels))
        }
        try:
            with pd.read_csv(
                self.path,
                sep=self.head.separator or _BLANKS,
                decimal=self.head.decimal,
                header=None,
                skiprows=self.head.first - 1,
                dtype=dtypes,
                chunksize=size or _ALL,
                encoding=self._encoding,
                encoding_errors="replace",
                keep_default_na=False,
                na_values=list(_GAPS),
                skipinitialspace=True,
                skip_blank_lines=True,
                comment="#",
                **_exact_parser(pd.__version__),
            ) as reader:
                yield from reader
        except pd.errors.EmptyDataError:
            return
        except ValueError as error:  # errors of pandas' parser are ValueErrors, too
            self._check_lines(rules)
            raise FormatError(
                f"cannot be read as a table ({error})",
                path=self.path,
                cure="Export it again as plain CSV.",
            ) from None

    def _numbered_lines(self) -> Iterator[tuple[int, list[str]]]:
        """Yield the number of each line of data, from 1, and its fields."""
        with self.path.open(encoding=self._encoding, errors="replace", newline=None) as stream:
            for number, line in enumerate(stream, start=1):
                if number >= self.head.first and _is_content(line):
                    yield number, split_line(line, self.head.separator, self.path)

    def _check_lines(self, rules: Mapping[int, ColumnRule]) -> None:
        """Raise a FormatError at the first line that breaks a rule."""
        for number, cells in self._numbered_lines():
            self._check_count(f"line {number}", len(cells))
            for index, rule in rules.items():
                if not rule.is_text:
                    self._check_number(number, rule, cells[index])

    def _check_count(self, place: str, found: int) -> None:
        if found != len(self.labels):
            raise FormatError(
                f"has {found} of {len(self.labels)} fields",
                path=self.path,
                place=place,
                cure="Complete or remove the line; if it is the last, the file was cut off.",
            )

    def _check_number(self, number: int, rule: ColumnRule, text: str) -> None:
        value = math.nan if text.strip() in _GAPS else number_of(text, self.head.decimal)
        place = f"line {number}, column {rule.label!r}"
        if value is None:
            cure = "Correct the line, or export the file again."
            if number_of(text.replace(",", ".")) is not None:
                cure = "Write all numbers with a decimal point, or all with a comma."
            message = f"must be a number, got {text[:80]!r}"
            raise FormatError(message, path=self.path, place=place, cure=cure)
        if rule.broken_by(value):
            raise FormatError(
                f"must be a finite number, got {text.strip() or 'nothing'!r}",
                path=self.path,
                place=place,
                cure="Remove the line, or fill in the number.",
            )


class ParquetTable:
    """A table in Parquet (extra ``parquet``)."""

    format, named = "Parquet", True

    def __init__(self, path: Path) -> None:
        _, pq = import_pyarrow(path)
        self.path = path
        with _damage_named(path):
            self._file = pq.ParquetFile(path, page_checksum_verification=True)
            self.labels = tuple(self._file.schema_arrow.names)
            self._count = int(self._file.metadata.num_rows)
            kept = (self._file.schema_arrow.metadata or {}).get(METADATA, b"{}")
            self.attrs: dict[str, Any] = dict(json.loads(kept))
        if not self._count:
            raise FormatError("has no rows", path=path, cure=_AGAIN)

    def blocks(self, rules: Mapping[int, ColumnRule], size: int | None = None) -> Iterator[Block]:
        """Yield columns, at most `size` rows at a time; as `TextTable.blocks`."""
        pa, _ = import_pyarrow(self.path)
        row = 0
        with _damage_named(self.path):
            for batch in self._file.iter_batches(
                batch_size=min(size or _ROWS, self._count),
                columns=[self.labels[index] for index in rules],
            ):
                block = {}
                for index, rule in rules.items():
                    array = batch.column(self.labels[index])
                    if rule.is_text:
                        block[index] = np.array(array.to_pylist(), dtype=str)
                    else:
                        block[index] = self._numbers(pa, array, rule, row)
                yield block
                row += batch.num_rows
            if row != self._count:
                message = f"{row} rows instead of {self._count}"
                raise ValueError(message)

    def place(self, row: int) -> str:
        """Place of a row of data in the file; the first row is 0."""
        return f"row {row + 1}"

    def _numbers(self, pa: Any, array: Any, rule: ColumnRule, row: int) -> npt.NDArray[Any]:
        if not (pa.types.is_integer(array.type) or pa.types.is_floating(array.type)):
            raise FormatError(
                f"must hold numbers, got {array.type}",
                path=self.path,
                place=f"column {rule.label!r}",
                cure="Convert the column to float64.",
            )
        keep = rule.keep_type and not array.null_count
        values: npt.NDArray[Any] = (array if keep else array.cast(pa.float64())).to_numpy(
            zero_copy_only=False
        )
        bad = np.flatnonzero(rule.broken_by(values))
        if bad.size:
            raise FormatError(
                f"must be a finite number, got {values[bad[0]]}",
                path=self.path,
                place=f"{self.place(row + int(bad[0]))}, column {rule.label!r}",
                cure="Remove the row, or fill in the number.",
            )
        return values


def open_table(path: Path, understood: Callable[[list[str]], bool]) -> TextTable | ParquetTable:
    """Open a table by its content.

    Parameters
    ----------
    path : Path
        Text or Parquet file.
    understood : callable
        Takes the fields of a line of text; returns whether they are names of columns.

    Raises
    ------
    FormatError
        If the file is empty, binary or damaged.
    """
    with open_regular(path) as stream:
        if stream.read(4) == b"PAR1":
            return ParquetTable(path)
    encoding = _detect_encoding(path)
    with path.open(encoding=encoding, newline=None) as text, name_file_in_errors(path):
        head = find_head(text, understood)
    if head is None:
        raise FormatError("is empty", path=path, place="line 1", cure=_AGAIN)
    return TextTable(path, head, encoding)


def import_pyarrow(path: Path) -> tuple[Any, Any]:
    """Return pyarrow and pyarrow.parquet, or raise an error that names the extra to install."""
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError:
        cure = "Install it with `pip install trueterrain[parquet]`, or use CSV."
        raise TrueTerrainError("Parquet needs the package pyarrow", path=path, cure=cure) from None
    return pa, pq


@contextmanager
def _damage_named(path: Path) -> Iterator[None]:
    """Turn exceptions of pyarrow over damaged files into a FormatError."""
    try:
        yield
    except (TrueTerrainError, FileNotFoundError, PermissionError):
        raise
    except Exception as error:  # pyarrow raises exceptions of many types
        words = " ".join(str(error).split()).rstrip(".")[:160] or type(error).__name__
        raise FormatError(f"is damaged or cut off ({words})", path=path, cure=_AGAIN) from None


def _break_rules(frame: pd.DataFrame, rules: Mapping[int, ColumnRule]) -> bool:
    """Whether a number of a frame breaks the rule of its column."""
    return any(
        rule.broken_by(frame[index].to_numpy()).any()
        for index, rule in rules.items()
        if not rule.is_text
    )


def _detect_encoding(path: Path) -> str:
    with open_regular(path) as stream:
        while block := stream.read(1 << 20):
            if b"\0" in block:
                raise FormatError(
                    "is binary, not text",
                    path=path,
                    place="start of the file",
                    cure="See with `trueterrain info` what the file is.",
                )
            if not block.isascii():
                break
        else:
            return "ascii"
    try:
        with path.open(encoding="utf-8-sig") as text:
            while text.read(1 << 20):
                pass
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8-sig"


def _is_content(line: str) -> bool:
    """Whether a line holds data: it is neither blank nor a comment."""
    return bool(line.strip()) and not line.startswith("#")


def _exact_parser(pandas: str) -> dict[str, Any]:
    """Option that makes pandas read numbers to the last bit: the default since version 3.1."""
    version = tuple(int(part) for part in pandas.split(".")[:2])
    return {} if version >= (3, 1) else {"float_precision": "round_trip"}
