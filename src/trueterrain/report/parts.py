"""What a report is made of."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Whether a requirement is met; "unknown" if the data do not tell.
Verdict = Literal["good", "bad", "unknown"]

#: What can stand in a cell of a table or in a tile; None and NaN are "not known".
Value = float | int | str | None

#: What the colour of a surface shows.
Colour = Literal["height", "sd", "sd_relative", "count"]


@dataclass(frozen=True, kw_only=True)
class Number:
    """A number that the reader should see first."""

    label: str
    "What it is."

    value: Value
    "The number, or a word; None or NaN if it is not known."

    unit: str = ""
    "Its unit."

    digits: int | None = None
    "Decimals; by default four significant digits, whole numbers whole."

    verdict: Verdict | None = None
    "Whether it is as required; None if nothing is required."

    note: str = ""
    "A few words below it, such as the requirement."

    def __post_init__(self) -> None:
        """Check the verdict and the digits."""
        _require_verdict(self.verdict)
        _require_digits(self.digits)


@dataclass(frozen=True, kw_only=True)
class Text:
    """Plain text; an empty line begins a new paragraph."""

    paragraph: str
    "The text."


@dataclass(frozen=True, kw_only=True)
class Column:
    """A column of a table."""

    label: str
    "What it holds."

    unit: str = ""
    "Unit of its numbers."

    digits: int | None = None
    "Decimals; by default as many as show four digits of its largest number."

    def __post_init__(self) -> None:
        """Check the digits."""
        _require_digits(self.digits)


@dataclass(frozen=True, kw_only=True)
class Table:
    """Rows of numbers and words; words in the first column name the rows."""

    columns: tuple[Column, ...]
    "Label, unit and digits of each column."

    rows: Sequence[Sequence[Value]]
    "Cells, row by row; None or NaN for what is not known."

    caption: str = ""
    "What the table shows."

    verdicts: Sequence[Verdict | None] = ()
    "Whether each row is as required, shown as a last column; empty for none."

    def __post_init__(self) -> None:
        """Check that there is a cell for each column and a verdict for each row."""
        if not self.columns:
            message = "a table must have at least one column."
            raise ValueError(message)
        for index, row in enumerate(self.rows):
            if len(row) != len(self.columns):
                message = (
                    f"each row must have {len(self.columns)} cells, one for each column, "
                    f"got {len(row)} in row {index}."
                )
                raise ValueError(message)
        if self.verdicts and len(self.verdicts) != len(self.rows):
            message = (
                f"verdicts must be as many as rows ({len(self.rows)}), got {len(self.verdicts)}."
            )
            raise ValueError(message)
        for verdict in self.verdicts:
            _require_verdict(verdict)


@dataclass(frozen=True, kw_only=True, eq=False)
class Picture:
    """A figure of matplotlib; drawn as lines if these are few, else as an image."""

    figure: "Figure | Axes"
    "The figure, or any axes of it."

    alt: str
    "What is to be seen, in words, for those who cannot see it."

    caption: str = ""
    "What the figure shows; as a rule with its main number."


@dataclass(frozen=True, kw_only=True, eq=False)
class SurfaceView:
    """A surface to turn and zoom, with its vertical exaggeration always stated.

    On paper, and where the page may not draw in three dimensions, the surface is seen from above.
    """

    surface: "xr.Dataset"
    "Surface along a reference line, or map."

    colour: Colour = "height"
    "Variable of the surface that the colour shows."

    vertical_exaggeration: float | None = None
    "How many times as large as distances heights are drawn; by default by their range."

    lines: Mapping[str, "xr.Dataset"] = field(default_factory=dict)
    "Profiles with easting and northing [m] to draw on the surface, by name."

    caption: str = ""
    "What the surface is; how it is drawn is added to it."

    def __post_init__(self) -> None:
        """Check the colour and the exaggeration."""
        if self.colour not in get_args(Colour):
            message = f"colour must be one of {', '.join(get_args(Colour))}, got {self.colour!r}."
            raise ValueError(message)
        if self.colour not in self.surface:
            message = f"colour must be a variable of the surface, which has no {self.colour!r}."
            raise ValueError(message)
        factor = self.vertical_exaggeration
        if factor is not None and not 0 < factor < float("inf"):
            message = f"vertical_exaggeration must be greater than 0, got {factor}."
            raise ValueError(message)


@dataclass(frozen=True, kw_only=True)
class Warnings:
    """What is flagged about the result: shown where it stands, and pointed to at the top."""

    items: Sequence[str]
    "One or two sentences each; empty if nothing is flagged."


@dataclass(frozen=True, kw_only=True)
class File:
    """A file that belongs to the result."""

    path: str | Path
    "Where it is, from the folder of the report."

    note: str = ""
    "What it holds."

    size: int | None = None
    "Its size [bytes]; by default looked up when the report is written."


@dataclass(frozen=True, kw_only=True)
class Files:
    """Files that belong to the result, with links to them."""

    files: Sequence[File]
    "The files, in the order in which they are listed."


#: What can stand in a section.
Block = Text | Table | Picture | SurfaceView | Warnings | Files


@dataclass(frozen=True, kw_only=True)
class Section:
    """A part of a report with a title of its own."""

    title: str
    "Its heading."

    blocks: Sequence[Block] = ()
    "Text, tables, pictures, views, warnings and files, in order."

    text: str = ""
    "What the section is about, before the blocks."

    def __post_init__(self) -> None:
        """Check that it holds blocks."""
        known = [kind.__name__ for kind in get_args(Block)]
        for kind in (type(block).__name__ for block in self.blocks):
            if kind not in known:
                message = f"a block must be one of {', '.join(known)}, got {kind}."
                raise ValueError(message)


@dataclass(frozen=True, kw_only=True)
class Report:
    """A result to read, to print and to send."""

    title: str
    "What was measured or made."

    subtitle: str = ""
    "Place, date, vehicle, crew: what tells this report from others."

    headline: tuple[Number, ...] = ()
    "The numbers to see first."

    sections: tuple[Section, ...] = ()
    "All else, in order."

    provenance: Mapping[str, Sequence[Mapping[str, Any]]] = field(default_factory=dict)
    "Provenance of each result by its name, as by `trueterrain.core.provenance`."


def _require_verdict(verdict: Verdict | None) -> None:
    if verdict is not None and verdict not in get_args(Verdict):
        message = f"verdict must be one of {', '.join(get_args(Verdict))} or None, got {verdict!r}."
        raise ValueError(message)


def _require_digits(digits: int | None) -> None:
    if digits is not None and not 0 <= digits <= 15:
        message = f"digits must be between 0 and 15, got {digits}."
        raise ValueError(message)
