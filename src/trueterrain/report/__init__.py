"""Reports: self-contained HTML pages and PDF files.

A report is built of parts (`Report`, `Section` and the blocks in it) and written by `write_report`
or `write_report_pdf`. It shows given values and computes nothing about terrain. The page loads
nothing: pictures, styles and scripts are embedded.
"""

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

__all__ = [
    "Block",
    "Column",
    "File",
    "Files",
    "Number",
    "Picture",
    "Report",
    "Section",
    "SurfaceView",
    "Table",
    "Text",
    "Verdict",
    "Warnings",
    "write_report",
    "write_report_pdf",
]
