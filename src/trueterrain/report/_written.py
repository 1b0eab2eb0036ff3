"""Text of the parts of a report, for screen and paper."""

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

from trueterrain.core.errors import OutputError
from trueterrain.report import _numbers
from trueterrain.report.parts import File, Number, Table, Verdict

#: How a verdict is marked and said: never by its colour alone.
VERDICTS: dict[Verdict | None, tuple[str, str]] = {
    "good": ("✓", "as required"),
    "bad": ("✗", "not as required"),
    "unknown": ("?", "not known"),
}


def number_tile(number: Number) -> dict[str, Any]:
    """Text of a number of the headline."""
    value = _numbers.format_value(number.value, number.digits)
    return {
        "label": number.label,
        "value": value,
        "unit": "" if value == _numbers.UNKNOWN else number.unit,
        "verdict": number.verdict,
        "mark": VERDICTS.get(number.verdict),
        "note": number.note,
    }


def table_cells(table: Table) -> dict[str, Any]:
    """Text of the cells of a table, and which of its columns are numbers."""
    values = [[_numbers.python_value(value) for value in row] for row in table.rows]
    by_column = list(zip(*values, strict=True)) or [()] * len(table.columns)
    numeric = [
        any(map(_numbers.is_number, cells)) and not any(isinstance(cell, str) for cell in cells)
        for cells in by_column
    ]
    digits = [
        _numbers.column_decimals(cells) if column.digits is None else column.digits
        for column, cells in zip(table.columns, by_column, strict=True)
    ]
    rows = []
    for index, row in enumerate(values):
        cells = [
            # whole numbers are counts: they get decimals only if these are asked for
            _numbers.format_value(cell, column.digits if isinstance(cell, int) else places)
            for cell, column, places in zip(row, table.columns, digits, strict=True)
        ]
        verdict = table.verdicts[index] if table.verdicts else None
        rows.append({"cells": cells, "verdict": verdict, "mark": VERDICTS.get(verdict)})
    return {
        "caption": table.caption,
        "columns": list(zip(table.columns, numeric, strict=True)),
        "named": not numeric[0],
        "numeric": numeric,
        "rows": rows,
        "judged": any(table.verdicts),
    }


def file_entry(file: File, folder: Path) -> dict[str, str]:
    """A file by its name from the folder of the report, with its size."""
    place = folder / file.path
    size = file.size
    if size is None:
        if not place.exists():
            raise OutputError("is listed in the report but does not exist", path=place)
        parts = sorted(place.rglob("*")) if place.is_dir() else [place]
        size = sum(part.stat().st_size for part in parts if part.is_file())
    name = Path(os.path.relpath(place, folder)).as_posix()
    # with a leading dot no browser reads the start of a name as a protocol
    return {
        "name": name,
        "link": f"./{quote(name)}",
        "size": _numbers.format_size(size),
        "note": file.note,
    }


def provenance_entry(name: str, steps: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Provenance of a result as text."""
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


def split_paragraphs(text: str) -> list[str]:
    """Paragraphs of a text, separated by empty lines."""
    return [part.strip() for part in text.split("\n\n") if part.strip()]
