"""Findings as people read them: what was looked for, how large it is, and what it means."""

import math
from collections.abc import Sequence

from trueterrain.report import Column, Table
from trueterrain.verify.findings import Finding

_UNITS = {"s": ("ms", 1e3), "rad": ("deg", math.degrees(1.0)), "m": ("mm", 1e3)}
_DIGITS = 4  # of milliseconds, degrees and millimetres
_WORDS = {True: "found", False: "not found", None: "cannot be told"}


def findings_table(findings: Sequence[Finding], *, caption: str = "") -> Table:
    """Table of what was looked for.

    Parameters
    ----------
    findings : sequence of Finding
        What was looked for.
    caption : str
        What they have in common.

    Returns
    -------
    Table
        Values in ms, deg and mm.
    """
    return Table(
        columns=(
            Column(label="Looked for"), Column(label="Value", digits=_DIGITS),
            Column(label="sd", digits=_DIGITS), Column(label="Unit"), Column(label="There"),
            Column(label="Meaning"),
        ),
        rows=[
            [one.name, _scaled(one.value, one.unit), _scaled(one.sd, one.unit), _unit(one.unit),
             _WORDS[one.detected], one.meaning]
            for one in findings
        ],
        caption=caption,
    )  # fmt: skip


def in_words(finding: Finding) -> str:
    """A finding in a line.

    Parameters
    ----------
    finding : Finding
        What was looked for.

    Returns
    -------
    str
        Its name, what was found of it, and what that means.
    """
    value, sd = _scaled(finding.value, finding.unit), _scaled(finding.sd, finding.unit)
    found = _WORDS[finding.detected]
    if value is not None:
        found += f", {value:.4g} {_unit(finding.unit) or ''}".rstrip()
        found += "" if sd is None else f" (sd {sd:.2g})"
    return f"{finding.name}: {found}. {finding.meaning}"


def _scaled(value: float | None, unit: str) -> float | None:
    return None if value is None else value * _UNITS.get(unit, (unit, 1.0))[1]


def _unit(unit: str) -> str | None:
    known = _UNITS.get(unit, (unit, 1.0))[0]
    return None if known == "1" else known
