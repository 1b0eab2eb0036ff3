"""Reports as PDF: A4 pages with all contents of the HTML page."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from trueterrain._version import __version__
from trueterrain.core import whole_output
from trueterrain.report import _numbers
from trueterrain.report._written import (
    file_entry,
    number_tile,
    provenance_entry,
    split_paragraphs,
    table_cells,
)
from trueterrain.report.parts import (
    Block,
    Column,
    Files,
    Number,
    Picture,
    Report,
    SurfaceView,
    Table,
    Text,
    Warnings,
)

_MARGIN = 51.0  # [pt] 18 mm
_TILES = 3  # in a row
_MAX_HEIGHT = 0.75  # of a picture over that of the page, which leaves space for a caption
_MIN_SPACE = 120.0  # [pt] below a heading, so that it does not end a page
_CODE_LINE = 112  # characters of a line of parameters


def write_report_pdf(report: Report, path: str | Path, *, force: bool = False) -> None:
    """Write a report as PDF, to print, sign and archive.

    Parameters
    ----------
    report : Report
        What the pages show.
    path : str or Path
        Path of the file.
    force : bool
        Replace a file that is there already.

    Raises
    ------
    OutputError
        If the file exists and `force` is false, if its folder does not exist, or if a file that
        the report lists does not exist.
    SchemaError
        If the data of a view are no surface, or a line on it is no profile.
    ValueError
        If the surface of a view has no height anywhere, or a line on it no easting and northing.

    Notes
    -----
    A4 pages with title, version and number at their foot; heads of tables are repeated on each.
    Pictures are images of 220 dots per inch; surfaces are seen from above. The same report gives
    the same bytes. Letters that DejaVu Sans does not hold are shown as boxes.

    Examples
    --------
    >>> import tempfile
    >>> from trueterrain.report import Number, Report
    >>> found = Number(label="Roughness IRI", value=2.417, unit="m/km", verdict="good")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_report_pdf(Report(title="Test road", headline=(found,)), Path(folder) / "r.pdf")
    ...     (Path(folder) / "r.pdf").read_bytes()[:5]
    b'%PDF-'
    """
    from reportlab.lib.pagesizes import A4
    from reportlab.platypus import BaseDocTemplate, Frame, PageTemplate

    from trueterrain.report._pdf_pages import numbered_canvas
    from trueterrain.report._pdf_style import register_fonts

    with whole_output(path, force=force) as temporary:
        register_fonts()
        document = BaseDocTemplate(
            str(temporary),
            pagesize=A4,
            title=report.title,
            subject=report.subtitle,
            creator=f"trueterrain {__version__}",
            author="",
            lang="en",
            invariant=1,
        )
        width, height = A4[0] - 2 * _MARGIN, A4[1] - 2 * _MARGIN
        frame = Frame(
            _MARGIN,
            _MARGIN,
            width,
            height,
            leftPadding=0,
            rightPadding=0,
            topPadding=0,
            bottomPadding=0,
        )
        document.addPageTemplates([PageTemplate(id="page", frames=[frame])])
        story = list(_page_flow(report, Path(path).absolute().parent, width, height))
        document.build(story, canvasmaker=numbered_canvas(report.title, _MARGIN))


def _page_flow(report: Report, folder: Path, width: float, height: float) -> Iterator[Any]:
    from reportlab.platypus import CondPageBreak, HRFlowable, Paragraph

    from trueterrain.report._pdf_pages import Heading
    from trueterrain.report._pdf_style import ACCENT, escape_text, paragraph_styles

    yield Paragraph(escape_text(report.title), paragraph_styles()["title"])
    if report.subtitle:
        yield Paragraph(escape_text(report.subtitle), paragraph_styles()["subtitle"])
    yield HRFlowable(width="100%", thickness=2, color=ACCENT, spaceAfter=12)
    if report.headline:
        yield from _number_tiles(report.headline, width)
    yield from _flag_pointer(report)
    for section in report.sections:
        content: list[Any] = [
            Paragraph(escape_text(text), paragraph_styles()["text"])
            for text in split_paragraphs(section.text)
        ]
        for block in section.blocks:
            content += _block_flow(block, folder, width, height)
        yield CondPageBreak(_MIN_SPACE)
        heading = [Heading(section.title)]
        if content and isinstance(content[0], list):  # keep the heading on the page of its contents
            heading += content.pop(0)
        yield from _keep_together([heading, *content])
    if report.provenance:
        yield CondPageBreak(_MIN_SPACE)
        yield Heading("Provenance")
        for name, steps in report.provenance.items():
            yield from _provenance_flow(provenance_entry(name, steps), width)


def _number_tiles(numbers: tuple[Number, ...], width: float) -> Iterator[Any]:
    """Tiles of the headline numbers, in rows."""
    from reportlab.platypus import Spacer
    from reportlab.platypus import Table as Grid

    from trueterrain.report._pdf_style import LINE, RAISED, VERDICT_INKS

    tiles = [number_tile(number) for number in numbers]
    for first in range(0, len(tiles), _TILES):
        row = tiles[first : first + _TILES]
        cells = [_number_tile(one) for one in row] + [""] * (_TILES - len(row))
        look: list[tuple[Any, ...]] = [("VALIGN", (0, 0), (-1, -1), "TOP")]
        for at, one in enumerate(row):
            here = (at, 0), (at, 0)
            look += [
                ("BACKGROUND", *here, RAISED),
                ("BOX", *here, 6, "#ffffff"),
                ("LINEABOVE", *here, 2, VERDICT_INKS.get(one["verdict"], LINE)),
                ("TOPPADDING", *here, 7),
                ("BOTTOMPADDING", *here, 8),
                ("LEFTPADDING", *here, 10),
                ("RIGHTPADDING", *here, 10),
            ]
        yield Grid([cells], colWidths=[width / _TILES] * _TILES, style=look)
        yield Spacer(0, 6)


def _number_tile(one: dict[str, Any]) -> list[Any]:
    from reportlab.platypus import Paragraph

    from trueterrain.report._pdf_style import (
        BOLD,
        PLAIN,
        VERDICT_INKS,
        escape_text,
        paragraph_styles,
    )

    unit = (
        f" <font name='{PLAIN}' size='9'>{escape_text(one['unit'])}</font>" if one["unit"] else ""
    )
    found = [
        Paragraph(escape_text(one["label"]), paragraph_styles()["label"]),
        Paragraph(escape_text(one["value"]) + unit, paragraph_styles()["value"]),
    ]
    if one["mark"]:
        words = f"<font name='{BOLD}' color='{VERDICT_INKS[one['verdict']]}'>"
        found.append(
            Paragraph(f"{words}{' '.join(one['mark'])}</font>", paragraph_styles()["label"])
        )
    if one["note"]:
        found.append(Paragraph(escape_text(one["note"]), paragraph_styles()["label"]))
    return found


def _flag_pointer(report: Report) -> Iterator[Any]:
    """Line that refers to the flags further down."""
    from reportlab.platypus import Paragraph

    from trueterrain.report._pdf_style import escape_text, paragraph_styles

    flagged = {
        section.title: count
        for section in report.sections
        if (count := sum(len(b.items) for b in section.blocks if isinstance(b, Warnings)))
    }
    if flagged:
        total = sum(flagged.values())
        text = f"⚠ {total} {'flag' if total == 1 else 'flags'} about this result: see "
        yield Paragraph(escape_text(text + ", ".join(flagged) + "."), paragraph_styles()["flag"])


def _block_flow(block: Block, folder: Path, width: float, height: float) -> Iterator[Any]:
    """Contents of a block; a list is kept on one page."""
    from reportlab.platypus import Paragraph

    from trueterrain.report._pdf_style import escape_text, paragraph_styles
    from trueterrain.report._pdf_table import table_flowables

    match block:
        case Text():
            for text in split_paragraphs(block.paragraph):
                yield Paragraph(escape_text(text), paragraph_styles()["text"])
        case Table():
            yield from table_flowables(table_cells(block), width)
        case Picture():
            yield _figure_flow(block.figure, [block.caption], width, height)
        case SurfaceView():
            from trueterrain.report._view import still_picture

            figure, stretch, drawn = still_picture(block)
            wide = f", the width drawn {stretch:g} times as large as the length"
            seen = f"Seen from above{wide if stretch != 1 else ''}; "
            seen += "the page in HTML turns and zooms it."
            yield _figure_flow(figure, [f"{block.caption} {drawn}".strip(), seen], width, height)
        case Warnings():
            yield _warning_box(block, width)
        case Files():
            files = [file_entry(file, folder) for file in block.files]
            table = Table(
                columns=(
                    Column(label="File"),
                    Column(label="What it holds"),
                    Column(label="Size"),
                ),
                rows=[(one["name"], one["note"] or None, one["size"]) for one in files],
            )
            yield from table_flowables(table_cells(table), width)


def _keep_together(flowables: list[Any]) -> Iterator[Any]:
    """Keep each list on one page."""
    from reportlab.platypus import KeepTogether

    yield from (KeepTogether(one) if isinstance(one, list) else one for one in flowables)


def _figure_flow(figure: Any, captions: list[str], width: float, height: float) -> list[Any]:
    """Figure at its natural size, or as large as the page allows, with its caption."""
    from reportlab.platypus import Image, Paragraph, Spacer

    from trueterrain.report._pdf_style import escape_text, paragraph_styles
    from trueterrain.report._picture import figure_image

    data, wide, high = figure_image(figure, width, _MAX_HEIGHT * height)
    found: list[Any] = [Image(data, width=wide, height=high, hAlign="LEFT")]
    found += [
        Paragraph(escape_text(text), paragraph_styles()["caption"]) for text in captions if text
    ]
    return [*found, Spacer(0, 8)]


def _warning_box(block: Warnings, width: float) -> Any:
    from reportlab.platypus import Paragraph
    from reportlab.platypus import Table as Grid

    from trueterrain.report._pdf_style import (
        BOLD,
        FLAG,
        FLAG_PAPER,
        escape_text,
        paragraph_styles,
    )

    if not block.items:
        return Paragraph("Nothing is flagged.", paragraph_styles()["note"])
    head = Paragraph(
        f"<font name='{BOLD}' color='{FLAG}'>⚠ Flagged</font>", paragraph_styles()["text"]
    )
    items = [
        Paragraph(f"• {escape_text(item)}", paragraph_styles()["text"]) for item in block.items
    ]
    look = [
        ("BACKGROUND", (0, 0), (-1, -1), FLAG_PAPER),
        ("LINEBEFORE", (0, 0), (0, -1), 2, FLAG),
        ("LEFTPADDING", (0, 0), (-1, -1), 9),
        ("RIGHTPADDING", (0, 0), (-1, -1), 9),
        ("TOPPADDING", (0, 0), (-1, -1), 3),
        ("BOTTOMPADDING", (0, 0), (-1, -1), 1),
    ]
    return Grid(
        [[row] for row in (head, *items)],
        colWidths=[width],
        style=look,
        spaceBefore=4,
        spaceAfter=10,
        splitInRow=1,
    )


def _provenance_flow(found: dict[str, Any], width: float) -> Iterator[Any]:
    """Provenance of a result, in full."""
    from reportlab.platypus import Paragraph, Preformatted

    from trueterrain.report._pdf_style import escape_text, paragraph_styles
    from trueterrain.report._pdf_table import table_flowables

    yield Paragraph(escape_text(found["name"]), paragraph_styles()["step"])
    for number, step in enumerate(found["steps"], start=1):
        version = f" (trueterrain {step['version']})" if step["version"] else ""
        words = f"{number}. {step['step'] or _numbers.UNKNOWN}{version}"
        yield Paragraph(escape_text(words), paragraph_styles()["text"])
        if step["inputs"]:
            hashes = Table(
                columns=(Column(label="Input"), Column(label="SHA-256")),
                rows=[(one.get("name"), one.get("sha256")) for one in step["inputs"]],
            )
            yield from _keep_together(table_flowables(table_cells(hashes), width))
        if step["parameters"] != "{}":
            yield Preformatted(
                step["parameters"],
                paragraph_styles()["code"],
                maxLineLength=_CODE_LINE,
                newLineChars="",
            )
