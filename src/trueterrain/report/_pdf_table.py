"""Tables of a PDF report: as wide as their contents, at most as wide as the page."""

from collections.abc import Sequence
from typing import Any

from trueterrain.report._pdf_style import (
    BOLD,
    INK,
    LINE,
    PLAIN,
    QUIET,
    TEXT,
    TINY,
    VERDICT_INKS,
    escape_text,
    paragraph_styles,
)

_PAD = 4.0  # [pt] on both sides of a cell
_STEP = 0.5  # [pt] by which the font size of a wide table is reduced
_WORD = 70.0  # [pt] min width of a column of words while the font can be smaller
_MIN_SPACE = 75.0  # [pt] for caption, head and a row or two at the start of a table
_TALL = 250.0  # [pt] up to which a table stays on one page, a third of a page
_MANY = 50  # rows that are taller in any case
_SLACK = 0.5  # [pt] of rounding that must not break a word


def table_flowables(block: dict[str, Any], width: float) -> list[Any]:
    """A table with its caption; too many columns for a page become several tables.

    Parameters
    ----------
    block : dict
        Cells as `trueterrain.report._written.table_cells` gives them.
    width : float
        Width of the page between its margins [pt].

    Returns
    -------
    list
        What stands on the paper; a list in it stays on one page.
    """
    from reportlab.platypus import CondPageBreak, Paragraph, Spacer

    heads = [(column.label, column.unit) for column, _ in block["columns"]]
    columns = [
        _Column(*head, numeric, [row["cells"][index] for row in block["rows"]])
        for index, (head, numeric) in enumerate(zip(heads, block["numeric"], strict=True))
    ]
    if block["judged"]:
        marks = [" ".join(row["mark"]) if row["mark"] else "" for row in block["rows"]]
        inks = [VERDICT_INKS.get(row["verdict"], INK) for row in block["rows"]]
        columns.append(_Column("Verdict", "", False, marks, inks))
    if block["named"]:
        columns[0].bold = True
    found: list[Any] = []
    if block["caption"]:
        found.append(Paragraph(escape_text(block["caption"]), paragraph_styles()["caption"]))
    size, groups = _fit_columns(columns, width)
    for group in groups:
        found += [_draw_table(group, size, width), Spacer(0, 8)]
    if len(block["rows"]) <= _MANY and sum(one.wrap(width, _TALL)[1] for one in found) <= _TALL:
        return [found]
    return [CondPageBreak(_MIN_SPACE), *found]


class _Column:
    """A column of cells, and its width at a font size."""

    def __init__(
        self, label: str, unit: str, numeric: bool, cells: Sequence[str], inks: Sequence[str] = ()
    ) -> None:
        self.label, self.unit, self.numeric = label, unit, numeric
        self.cells, self.inks = list(cells), list(inks)
        self.bold = bool(inks)

    def natural(self, size: float) -> float:
        """Width without line breaks [pt]."""
        unit = f" [{self.unit}]" if self.unit else ""
        return self._around([self.label + unit], self.cells, size)

    def min_widths(self, size: float) -> float:
        """Width without breaks in words and numbers [pt]."""
        words = [word for cell in self.cells for word in cell.split()]
        heads = [*self.label.split(), f"[{self.unit}]" if self.unit else ""]
        return self._around(heads, self.cells if self.numeric else words, size)

    def squeezed(self, size: float) -> float:
        """Min readable width [pt]."""
        return self.min_widths(size) if self.numeric else min(self.min_widths(size), _WORD)

    def head(self) -> str:
        unit = f" <font color='{QUIET}' name='{PLAIN}'>[{escape_text(self.unit)}]</font>"
        return escape_text(self.label) + (unit if self.unit else "")

    def _around(self, heads: list[str], cells: list[str], size: float) -> float:
        widths = [_text_width(text, size, bold=True) for text in heads]
        widths += [_text_width(text, size, bold=self.bold) for text in cells]
        return max(widths) + 2 * _PAD + _SLACK


def _text_width(text: str, size: float, *, bold: bool = False) -> float:
    from reportlab.pdfbase.pdfmetrics import stringWidth

    return float(stringWidth(text, BOLD if bold else PLAIN, size))


def _fit_columns(columns: list[_Column], width: float) -> tuple[float, list[list[_Column]]]:
    """Font size, and the columns of each part: all in one part if they fit."""
    size = TEXT - 2 * _STEP
    while size > TINY and sum(one.min_widths(size) for one in columns) > width:
        size -= _STEP
    groups: list[list[_Column]] = [[columns[0]]]
    for column in columns[1:]:
        if sum(one.squeezed(size) for one in [*groups[-1], column]) > width and len(groups[-1]) > 1:
            groups.append([columns[0]])
        groups[-1].append(column)
    return size, groups


def _column_widths(columns: list[_Column], size: float, width: float) -> list[float]:
    """Natural widths if they fit, else between the min widths and these."""
    natural = [one.natural(size) for one in columns]
    if sum(natural) <= width:
        return natural
    min_widths = [one.min_widths(size) for one in columns]
    if sum(min_widths) > width:
        natural, min_widths = min_widths, [one.squeezed(size) for one in columns]
    if sum(min_widths) >= width:  # one or two numbers that are wider than the page
        return [width * one / sum(min_widths) for one in min_widths]
    slack = [high - low for high, low in zip(natural, min_widths, strict=True)]
    fraction = (width - sum(min_widths)) / sum(slack)
    return [low + fraction * more for low, more in zip(min_widths, slack, strict=True)]


def _draw_table(columns: list[_Column], size: float, width: float) -> Any:
    from reportlab.lib.styles import ParagraphStyle
    from reportlab.platypus import LongTable, Paragraph

    text = ParagraphStyle(
        "cell", parent=paragraph_styles()["text"], fontSize=size, leading=1.25 * size, spaceAfter=0
    )
    head = ParagraphStyle("head", parent=text, fontName=BOLD)

    def aligned(style: Any, column: _Column) -> Any:
        return ParagraphStyle("right", parent=style, alignment=2) if column.numeric else style

    def cell(column: _Column, row: int) -> Any:
        words = escape_text(column.cells[row])
        if column.numeric:  # one line, which needs no paragraph
            return column.cells[row]
        if column.inks:
            words = f"<font color='{column.inks[row]}'>{words}</font>"
        return Paragraph(words, head if column.bold else text)

    rows = [[Paragraph(column.head(), aligned(head, column)) for column in columns]]
    rows += [[cell(column, row) for column in columns] for row in range(len(columns[0].cells))]
    look: list[tuple[Any, ...]] = [
        ("FONT", (0, 0), (-1, -1), PLAIN, size, 1.25 * size),
        ("TEXTCOLOR", (0, 0), (-1, -1), INK),
        ("VALIGN", (0, 0), (-1, 0), "BOTTOM"),
        ("VALIGN", (0, 1), (-1, -1), "TOP"),
        ("LEFTPADDING", (0, 0), (-1, -1), _PAD),
        ("RIGHTPADDING", (0, 0), (-1, -1), _PAD),
        ("TOPPADDING", (0, 0), (-1, -1), 2.5),
        ("BOTTOMPADDING", (0, 0), (-1, -1), 2.5),
        ("LINEBELOW", (0, 0), (-1, 0), 0.8, QUIET),
        ("LINEBELOW", (0, 1), (-1, -1), 0.4, LINE),
    ]
    look += [("ALIGN", (k, 1), (k, -1), "RIGHT") for k, one in enumerate(columns) if one.numeric]
    return LongTable(
        rows,
        colWidths=_column_widths(columns, size, width),
        repeatRows=1,
        hAlign="LEFT",
        style=look,
        splitInRow=1,  # a cell that is longer than a page continues on the next one
    )
