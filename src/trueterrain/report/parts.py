"""Parts of a report."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Whether a requirement is met; "unknown" if the data do not determine it.
Verdict = Literal["good", "bad", "unknown"]

#: Value of a cell or a tile; None and NaN mean "not known".
Value = float | int | str | None

#: What the colour of a surface shows.
Colour = Literal["height", "sd", "sd_relative", "count"]


@dataclass(frozen=True, kw_only=True)
class Number:
    """Headline number, shown as a tile at the top."""

    label: str
    "Name of the quantity."

    value: Value
    "Number or word; None or NaN if it is not known."

    unit: str = ""
    "Its unit."

    digits: int | None = None
    "Decimals; by default four significant digits, none for integers."

    verdict: Verdict | None = None
    "Whether the requirement is met; None without one."

    note: str = ""
    "Note below the number, such as the requirement."

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
    "Contents."

    unit: str = ""
    "Unit of its numbers."

    digits: int | None = None
    "Decimals; by default four digits of the largest number."

    def __post_init__(self) -> None:
        """Check the digits."""
        _require_digits(self.digits)


@dataclass(frozen=True, kw_only=True)
class Table:
    """Rows of numbers and words; words in the first column name the rows."""

    columns: tuple[Column, ...]
    "Label, unit and digits of each column."

    rows: Sequence[Sequence[Value]]
    "Cells, row by row; None or NaN for unknown values."

    caption: str = ""
    "Caption of the table."

    verdicts: Sequence[Verdict | None] = ()
    "Whether each row meets its requirement, shown as a last column; empty for none."

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
    """Figure of matplotlib, as SVG if it is small, else as PNG."""

    figure: "Figure | Axes"
    "The figure, or any axes of it."

    alt: str
    "Description for readers who cannot see the figure."

    caption: str = ""
    "Caption, usually with the main number."


@dataclass(frozen=True, kw_only=True, eq=False)
class SurfaceView:
    """Interactive surface in 3D, with its vertical exaggeration stated.

    On paper, and where the page may not draw in three dimensions, the surface is seen from above.
    """

    surface: "xr.Dataset"
    "Surface along a reference line, or map."

    colour: Colour = "height"
    "Variable of the surface that the colour shows."

    vertical_exaggeration: float | None = None
    "Vertical exaggeration; by default by the range of the heights."

    lines: Mapping[str, "xr.Dataset"] = field(default_factory=dict)
    "Profiles with easting and northing [m] to draw on the surface, by name."

    caption: str = ""
    "Caption; scale and reduction are added to it."

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
    """Flags about the result, with a reference at the top of the report."""

    items: Sequence[str]
    "One or two sentences each; empty if nothing is flagged."


@dataclass(frozen=True, kw_only=True)
class File:
    """A file that belongs to the result."""

    path: str | Path
    "Path, relative to the folder of the report."

    note: str = ""
    "Contents."

    size: int | None = None
    "Size [bytes]; by default that of the file when the report is written."


@dataclass(frozen=True, kw_only=True)
class Files:
    """Files of the result, with links."""

    files: Sequence[File]
    "The files, in the order in which they are listed."


#: Part of a section.
Block = Text | Table | Picture | SurfaceView | Warnings | Files


@dataclass(frozen=True, kw_only=True)
class Section:
    """Section of a report."""

    title: str
    "Its heading."

    blocks: Sequence[Block] = ()
    "Text, tables, pictures, views, warnings and files, in order."

    text: str = ""
    "Introduction before the blocks."

    def __post_init__(self) -> None:
        """Check that it holds blocks."""
        known = [kind.__name__ for kind in get_args(Block)]
        for kind in (type(block).__name__ for block in self.blocks):
            if kind not in known:
                message = f"a block must be one of {', '.join(known)}, got {kind}."
                raise ValueError(message)


@dataclass(frozen=True, kw_only=True)
class Report:
    """A report: headline numbers, sections, provenance."""

    title: str
    "Title."

    subtitle: str = ""
    "Place, date, vehicle, crew."

    headline: tuple[Number, ...] = ()
    "Headline numbers."

    sections: tuple[Section, ...] = ()
    "Sections, in order."

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
