"""Fonts, colours and paragraph styles of a PDF report."""

from functools import cache
from pathlib import Path
from typing import Any

from trueterrain.report.parts import Verdict

#: Names of the fonts: text, bold, and for what a program reads.
PLAIN, BOLD, MONO = "DejaVuSans", "DejaVuSans-Bold", "DejaVuSansMono"

#: Inks, as on the page.
INK, QUIET, LINE, RAISED, ACCENT = "#1f2529", "#5b656c", "#d9dee2", "#f5f7f8", "#0b5c7d"
FLAG, FLAG_PAPER = "#8a5a00", "#fdf6e3"
VERDICT_INKS: dict[Verdict | None, str] = {"good": "#1a6b3c", "bad": "#a5221b", "unknown": FLAG}

#: Size of text [pt]; that of a table may be smaller, down to the second.
TEXT, TINY = 9.0, 6.0


def register_fonts() -> None:
    """Register the fonts of matplotlib, which have µ, ², ±, ⁻ and the symbols."""
    import matplotlib as mpl
    from reportlab.pdfbase import pdfmetrics
    from reportlab.pdfbase.ttfonts import TTFont

    folder = Path(mpl.get_data_path()) / "fonts" / "ttf"
    for name in (PLAIN, BOLD, MONO):
        if name not in pdfmetrics.getRegisteredFontNames():
            pdfmetrics.registerFont(TTFont(name, folder / f"{name}.ttf"))
    pdfmetrics.registerFontFamily(PLAIN, normal=PLAIN, bold=BOLD, italic=PLAIN, boldItalic=BOLD)


@cache
def paragraph_styles() -> dict[str, Any]:
    """Styles of paragraphs by name."""
    from reportlab.lib.styles import ParagraphStyle

    def style(name: str, **other: Any) -> Any:
        size = other.pop("fontSize", TEXT)
        given = {
            "fontName": PLAIN,
            "textColor": INK,
            "leading": 1.35 * size,
            "splitLongWords": 1,
            **other,
        }
        return ParagraphStyle(name, fontSize=size, **given)

    found = [
        style("title", fontName=BOLD, fontSize=18, leading=22, spaceAfter=4),
        style("subtitle", fontSize=10.5, textColor=QUIET, spaceAfter=10),
        style("heading", fontName=BOLD, fontSize=12.5, spaceBefore=16, spaceAfter=5),
        style("text", spaceAfter=5),
        style("caption", fontSize=8, textColor=QUIET, spaceAfter=3),
        style("note", fontSize=8, textColor=QUIET, spaceAfter=5),
        style("label", fontSize=8, textColor=QUIET),
        style("value", fontName=BOLD, fontSize=14, leading=17, spaceBefore=2, spaceAfter=1),
        style("flag", textColor=FLAG, spaceAfter=3),
        style("step", fontName=BOLD, spaceBefore=6, spaceAfter=2),
        style("code", fontName=MONO, fontSize=6.5, leading=8.5, textColor=QUIET, leftIndent=10),
    ]
    return {one.name: one for one in found}


def escape_text(text: object) -> str:
    """Text with markup escaped; narrow spaces in numbers become non-breaking."""
    from xml.sax.saxutils import escape

    return escape(str(text).replace("\N{NARROW NO-BREAK SPACE}", "\N{NO-BREAK SPACE}"))
