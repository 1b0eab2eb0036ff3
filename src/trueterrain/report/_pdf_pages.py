"""Pages of a PDF report: footer, and headings in the outline."""

from typing import Any

from reportlab.pdfgen.canvas import Canvas
from reportlab.platypus import Paragraph

from trueterrain._version import __version__
from trueterrain.report._pdf_style import LINE, PLAIN, QUIET, escape_text, paragraph_styles

_SIZE = 7.5  # [pt] of the foot
_FOOT = 30.0  # [pt] above the edge of the paper
_ELLIPSIS = "…"


class Heading(Paragraph):  # type: ignore[misc]  # reportlab has no types
    """Heading of a section, with an entry in the outline."""

    def __init__(self, title: str) -> None:
        super().__init__(escape_text(title), paragraph_styles()["heading"])
        self._title = title

    def draw(self) -> None:
        """Draw it, and record its position."""
        self.canv.headings.append((self._title, self.canv.absolutePosition(0, self.height)[1]))
        super().draw()


def numbered_canvas(title: str, margin: float) -> type[Any]:
    """Kind of canvas that writes title, version and "page i of n" at the foot of every page.

    Parameters
    ----------
    title : str
        Title of the report.
    margin : float
        Left and right of the pages [pt].

    Returns
    -------
    type
        For reportlab, which calls it.
    """

    class Numbered(Canvas):  # type: ignore[misc]  # reportlab has no types
        """Buffers the pages until their number is known."""

        def __init__(self, *args: Any, **kwargs: Any) -> None:
            super().__init__(*args, **kwargs)
            self._kept: list[dict[str, Any]] = []
            self.headings: list[tuple[str, float]] = []

        def showPage(self) -> None:  # noqa: N802 - reportlab's name
            self._kept.append(dict(self.__dict__))
            self.headings = []
            self._startPage()

        def save(self) -> None:
            for state in self._kept:
                self.__dict__.update(state)
                self._foot(len(self._kept))
                for number, (title, height) in enumerate(self.headings):
                    key = f"heading-{self._pageNumber}-{number}"  # unique on each page
                    self.bookmarkHorizontalAbsolute(key, height)
                    self.addOutlineEntry(title, key, 0)
                super().showPage()
            super().save()

        def _foot(self, pages: int) -> None:
            number = f"trueterrain {__version__} · Page {self._pageNumber} of {pages}"
            right = self._pagesize[0] - margin
            self.setStrokeColor(LINE)
            self.setLineWidth(0.5)
            self.line(margin, _FOOT + 11, right, _FOOT + 11)
            self.setFont(PLAIN, _SIZE)
            self.setFillColor(QUIET)
            self.drawRightString(right, _FOOT, number)
            width = right - margin - self.stringWidth(number, PLAIN, _SIZE) - 12
            self.drawString(margin, _FOOT, _shorten_text(title, width, self))

    return Numbered


def _shorten_text(text: str, width: float, canvas: Any) -> str:
    """Text, cut to a width [pt]."""
    if canvas.stringWidth(text, PLAIN, _SIZE) <= width:
        return text
    while text and canvas.stringWidth(text + _ELLIPSIS, PLAIN, _SIZE) > width:
        text = text[:-1]
    return text.rstrip() + _ELLIPSIS
