"""Reports: a result as one page that opens, prints and can be sent on its own.

A report is built of plain parts (`Report`, `Section` and the blocks in it) and written by
`write_report`. It shows what it is given and computes nothing about terrain. The page loads nothing
from anywhere: pictures, styles and the program that turns the surface are all inside.
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
