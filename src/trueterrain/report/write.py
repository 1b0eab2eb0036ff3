"""Reports as HTML pages."""

import base64
import hashlib
import json
from importlib import resources
from pathlib import Path
from typing import Any

from trueterrain._version import __version__
from trueterrain.core import whole_output
from trueterrain.report._written import (
    file_entry,
    number_tile,
    provenance_entry,
    split_paragraphs,
    table_cells,
)
from trueterrain.report.parts import (
    Block,
    Files,
    Picture,
    Report,
    SurfaceView,
    Table,
    Text,
    Warnings,
)


def write_report(report: Report, path: str | Path, *, force: bool = False) -> None:
    """Write a report as one self-contained HTML page.

    Parameters
    ----------
    report : Report
        What the page shows.
    path : str or Path
        Path of the page.
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
        page = _render_page(report, Path(path).absolute().parent)
        temporary.write_text(page, encoding="utf-8", newline="\n")


def write_json_file(document: dict[str, Any], path: str | Path, *, force: bool = False) -> None:
    """Write the numbers of a report as a JSON file.

    Parameters
    ----------
    document : dict
        Finite numbers, text, lists and dictionaries of them.
    path : str or Path
        Path of the file.
    force : bool
        Replace a file that is there already.

    Raises
    ------
    OutputError
        If the file exists and `force` is false, or its folder does not exist.
    ValueError
        If a number is not finite.
    """
    with whole_output(path, force=force) as temporary:
        text = json.dumps(document, indent=2, allow_nan=False)
        temporary.write_text(text + "\n", encoding="utf-8", newline="\n")


def _render_page(report: Report, folder: Path) -> str:
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from markupsafe import Markup

    environment = Environment(
        loader=PackageLoader("trueterrain.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    sections: list[dict[str, Any]] = [
        {
            "id": f"section-{index}",
            "title": section.title,
            "text": split_paragraphs(section.text),
            "blocks": [
                _prepare_block(block, f"block-{index}-{place}", folder)
                for place, block in enumerate(section.blocks, start=1)
            ],
        }
        for index, section in enumerate(report.sections, start=1)
    ]
    blocks = [block for section in sections for block in section["blocks"]]
    scripts = [_template_text("page.js")]
    if any(block["kind"] == "view" for block in blocks):
        scripts = [_plotly_source(), _template_text("view.js"), *scripts]
    return environment.get_template("report.html.j2").render(
        report=report,
        tiles=[number_tile(number) for number in report.headline],
        sections=sections,
        flags=[block for block in blocks if block["kind"] == "warnings" and block["items"]],
        provenance=[provenance_entry(name, steps) for name, steps in report.provenance.items()],
        version=__version__,
        style=Markup(_template_text("style.css")),
        scripts=[Markup(script) for script in scripts],
        policy=_content_policy(scripts),
    )


def _prepare_block(block: Block, name: str, folder: Path) -> dict[str, Any]:
    """Block as arguments of the template."""
    found: dict[str, Any]
    match block:
        case Text():
            found = {"kind": "text", "paragraphs": split_paragraphs(block.paragraph)}
        case Table():
            found = {"kind": "table", **table_cells(block)}
        case Picture():
            from trueterrain.report._picture import embed_figure

            source, width = embed_figure(block.figure)
            found = {
                "kind": "picture",
                "source": source,
                "width": width,
                "alt": block.alt,
                "caption": block.caption,
            }
        case SurfaceView():
            from markupsafe import Markup

            from trueterrain.report._view import prepare_view

            found = {"kind": "view", **prepare_view(block)}
            # escaped, so that no text in the JSON can end the script element
            found["figure"] = Markup(found["figure"].replace("<", "\\u003c"))
            found["choices"] = [(value, f"{value:g}") for value in found["choices"]]
        case Warnings():
            found = {"kind": "warnings", "items": list(block.items)}
        case Files():
            found = {"kind": "files", "files": [file_entry(file, folder) for file in block.files]}
    return found | {"id": name}


def _plotly_source() -> str:
    from plotly.offline import get_plotlyjs

    return str(get_plotlyjs())


def _template_text(name: str) -> str:
    place = resources.files("trueterrain.report") / "templates" / name
    return place.read_text(encoding="utf-8")


def _content_policy(scripts: list[str]) -> str:
    """Content security policy: only these scripts run, and nothing is loaded."""
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
