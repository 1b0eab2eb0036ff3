"""Figures embedded in a page or a PDF."""

import base64
import io
from typing import Any

_LARGEST_SVG = 300_000  # [bytes] above, an image of the same figure is smaller and opens faster
_PAGE = 96.0  # [1/inch] dots of a page at its natural size
_PAPER = 220.0  # [1/inch] dots on paper
_INCH = 72.0  # [pt]
_DENSITY = 2.0  # dots of an image for each dot of the page, for fine screens and for paper


def embed_figure(figure: Any) -> tuple[str, int]:
    """Data URL of a figure, and its natural width on the page [px].

    The same figure gives the same bytes: no date, and names within it from a fixed salt.
    """
    import matplotlib as mpl

    whole = _whole_figure(figure)
    kind, data = "svg+xml", io.BytesIO()
    with mpl.rc_context({"svg.hashsalt": "trueterrain", "svg.fonttype": "path"}):
        whole.savefig(data, format="svg", dpi=_DENSITY * _PAGE, metadata={"Date": None})
    if data.tell() > _LARGEST_SVG:
        kind, data = "png", io.BytesIO()
        whole.savefig(data, format="png", dpi=_DENSITY * _PAGE, metadata={"Software": None})
    encoded = base64.b64encode(data.getvalue()).decode()
    return f"data:image/{kind};base64,{encoded}", round(whole.get_figwidth() * _PAGE)


def figure_image(figure: Any, widest: float, highest: float) -> tuple[io.BytesIO, float, float]:
    """Figure as PNG for paper, with its width and height there [pt]."""
    whole, data = _whole_figure(figure), io.BytesIO()
    width, height = whole.get_figwidth(), whole.get_figheight()
    scale = min(_INCH, widest / width, highest / height)
    whole.savefig(
        data,
        format="png",
        dpi=_PAPER * scale / _INCH,
        facecolor="white",
        metadata={"Software": None},
    )
    data.seek(0)
    return data, scale * width, scale * height


def _whole_figure(figure: Any) -> Any:
    return figure if hasattr(figure, "savefig") else figure.get_figure(root=True)
