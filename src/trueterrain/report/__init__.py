"""Reports: self-contained HTML pages and PDF files.

A report is built of parts (`Report`, `Section` and the blocks in it) and written by `write_report`
or `write_report_pdf`. It shows given values and computes nothing about terrain. The page loads
nothing: pictures, styles and scripts are embedded. The pages of the commands event, plate and
verify are functions: `write_event_page`, `write_plate_page`, `write_certificate`.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from trueterrain.report.parts import (
    Block,
    Column,
    File,
    Files,
    Number,
    Picture,
    Report,
    Section,
    SurfaceView,
    Table,
    Text,
    Verdict,
    Warnings,
)
from trueterrain.report.pdf import write_report_pdf
from trueterrain.report.write import write_report

if TYPE_CHECKING:
    from trueterrain.report.certificate import write_certificate
    from trueterrain.report.event import write_event_page
    from trueterrain.report.event_text import PredictedEvent, predict_event
    from trueterrain.report.plate import write_plate_page

# imported when they are used: they need figures and verify
_MODULE_OF = {
    "PredictedEvent": "event_text",
    "predict_event": "event_text",
    "write_certificate": "certificate",
    "write_event_page": "event",
    "write_plate_page": "plate",
}

__all__ = [
    "Block",
    "Column",
    "File",
    "Files",
    "Number",
    "Picture",
    "PredictedEvent",
    "Report",
    "Section",
    "SurfaceView",
    "Table",
    "Text",
    "Verdict",
    "Warnings",
    "predict_event",
    "write_certificate",
    "write_event_page",
    "write_plate_page",
    "write_report",
    "write_report_pdf",
]


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        message = f"module {__name__!r} has no attribute {name!r}"
        raise AttributeError(message)
    return getattr(import_module(f"{__name__}.{_MODULE_OF[name]}"), name)
