"""From the parts of a report to the page."""

import base64
import hashlib
import json
import os
from importlib import resources
from pathlib import Path
from typing import Any
from urllib.parse import quote

from trueterrain._version import __version__
from trueterrain.engine import whole_output
from trueterrain.errors import OutputError
from trueterrain.report import _numbers
from trueterrain.report.parts import (
    Block,
    File,
    Files,
    Number,
    Picture,
    Report,
    SurfaceView,
    Table,
    Text,
    Verdict,
    Warnings,
)

#: How a verdict is marked and said: never by its colour alone.
_VERDICTS: dict[Verdict | None, tuple[str, str]] = {
    "good": ("✓", "as required"),
    "bad": ("✗", "not as required"),
    "unknown": ("?", "not known"),
}


def write_report(report: Report, path: str | Path, *, force: bool = False) -> None:
    """Write a report as one HTML page that needs nothing else.

    Parameters
    ----------
    report : Report
        What the page shows.
    path : str or Path
        Where the page shall be.
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
    The page contacts no other computer, and forbids itself to. The same report gives the same
    bytes. A page with a view is some 5 MB larger, since the program that turns the surface is in
    it, once for all views.

    Examples
    --------
    >>> import tempfile
    >>> from trueterrain.report import Number, Report, Section, Table, Column
    >>> found = Number(label="Roughness IRI", value=2.417, unit="m/km", verdict="good")
    >>> tracks = Table(columns=(Column(label="Track"), Column(label="IRI", unit="m/km")),
    ...                rows=[("left", 2.417), ("right", 2.38)])
    >>> report = Report(title="Test road", headline=(found,),
    ...                 sections=(Section(title="Roughness", blocks=(tracks,)),))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_report(report, Path(folder) / "report.html")
    ...     "2.380" in (Path(folder) / "report.html").read_text(encoding="utf-8")
    True
    """
    with whole_output(path, force=force) as temporary:
        page = _render(report, Path(path).absolute().parent)
        temporary.write_text(page, encoding="utf-8", newline="\n")


def _render(report: Report, folder: Path) -> str:
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from markupsafe import Markup

    environment = Environment(
        loader=PackageLoader("trueterrain.report"), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True,
    )  # fmt: skip
    sections: list[dict[str, Any]] = [
        {
            "id": f"section-{index}",
            "title": section.title,
            "text": _paragraphs(section.text),
            "blocks": [
                _prepared(block, f"block-{index}-{place}", folder)
                for place, block in enumerate(section.blocks, start=1)
            ],
        }
        for index, section in enumerate(report.sections, start=1)
    ]
    blocks = [block for section in sections for block in section["blocks"]]
    scripts = [_template("page.js")]
    if any(block["kind"] == "view" for block in blocks):
        scripts = [_plotly(), _template("view.js"), *scripts]
    return environment.get_template("report.html.j2").render(
        report=report,
        tiles=[_tile(number) for number in report.headline],
        sections=sections,
        doubts=[block for block in blocks if block["kind"] == "warnings" and block["items"]],
        provenance=[_origin(name, steps) for name, steps in report.provenance.items()],
        version=__version__,
        style=Markup(_template("style.css")),
        scripts=[Markup(script) for script in scripts],
        policy=_policy(scripts),
    )


def _prepared(block: Block, name: str, folder: Path) -> dict[str, Any]:
    """A block as the template wants it."""
    found: dict[str, Any]
    match block:
        case Text():
            found = {"kind": "text", "paragraphs": _paragraphs(block.paragraph)}
        case Table():
            found = {"kind": "table", **_table(block)}
        case Picture():
            from trueterrain.report._picture import embed

            source, width = embed(block.figure)
            found = {
                "kind": "picture", "source": source, "width": width, "alt": block.alt,
                "caption": block.caption,
            }  # fmt: skip
        case SurfaceView():
            from markupsafe import Markup

            from trueterrain.report._view import prepare

            found = {"kind": "view", **prepare(block)}
            # JSON stays the same, and nothing in it can end the element that holds it
            found["figure"] = Markup(found["figure"].replace("<", "\\u003c"))
            found["choices"] = [(value, f"{value:g}") for value in found["choices"]]
        case Warnings():
            found = {"kind": "warnings", "items": list(block.items)}
        case Files():
            found = {"kind": "files", "files": [_file(file, folder) for file in block.files]}
    return found | {"id": name}


def _tile(number: Number) -> dict[str, Any]:
    value = _numbers.text(number.value, number.digits)
    return {
        "label": number.label,
        "value": value,
        "unit": "" if value == _numbers.UNKNOWN else number.unit,
        "verdict": number.verdict,
        "mark": _VERDICTS.get(number.verdict),
        "note": number.note,
    }


def _table(table: Table) -> dict[str, Any]:
    values = [[_numbers.plain(value) for value in row] for row in table.rows]
    by_column = list(zip(*values, strict=True)) or [()] * len(table.columns)
    numeric = [
        any(map(_numbers.is_number, cells)) and not any(isinstance(cell, str) for cell in cells)
        for cells in by_column
    ]
    digits = [
        _numbers.decimals(cells) if column.digits is None else column.digits
        for column, cells in zip(table.columns, by_column, strict=True)
    ]
    rows = []
    for index, row in enumerate(values):
        cells = [
            # whole numbers are counts: they get decimals only if these are asked for
            _numbers.text(cell, column.digits if isinstance(cell, int) else places)
            for cell, column, places in zip(row, table.columns, digits, strict=True)
        ]
        verdict = table.verdicts[index] if table.verdicts else None
        rows.append({"cells": cells, "verdict": verdict, "mark": _VERDICTS.get(verdict)})
    return {
        "caption": table.caption,
        "columns": list(zip(table.columns, numeric, strict=True)),
        "named": not numeric[0],
        "numeric": numeric,
        "rows": rows,
        "judged": any(table.verdicts),
    }


def _file(file: File, folder: Path) -> dict[str, str]:
    place = folder / file.path
    size = file.size
    if size is None:
        if not place.exists():
            raise OutputError("is listed in the report but does not exist", path=place)
        parts = sorted(place.rglob("*")) if place.is_dir() else [place]
        size = sum(part.stat().st_size for part in parts if part.is_file())
    name = Path(os.path.relpath(place, folder)).as_posix()
    # the dot keeps a browser from taking the beginning of a name for a protocol
    return {
        "name": name, "link": f"./{quote(name)}", "size": _numbers.size(size), "note": file.note,
    }  # fmt: skip


def _origin(name: str, steps: Any) -> dict[str, Any]:
    return {
        "name": name,
        "steps": [
            {
                "step": str(step.get("step", "")),
                "version": str(step.get("version", "")),
                "parameters": json.dumps(step.get("parameters", {}), indent=2, ensure_ascii=False),
                "inputs": list(step.get("inputs", ())),
            }
            for step in steps
        ],
    }


def _paragraphs(text: str) -> list[str]:
    return [part.strip() for part in text.split("\n\n") if part.strip()]


def _plotly() -> str:
    from plotly.offline import get_plotlyjs

    return str(get_plotlyjs())


def _template(name: str) -> str:
    place = resources.files("trueterrain.report") / "templates" / name
    return place.read_text(encoding="utf-8")


def _policy(scripts: list[str]) -> str:
    """What the page may do: run just these scripts, and load nothing from anywhere."""
    hashes = [
        f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}'"
        for script in scripts
    ]
    return "; ".join(
        (
            "default-src 'none'",
            "img-src data: blob:",
            "style-src 'unsafe-inline'",
            f"script-src {' '.join(hashes)}",
            "base-uri 'none'",
            "form-action 'none'",
        )
    )
