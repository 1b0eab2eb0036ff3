"""Findings in reports: tables and sentences on the faults that a test looks for."""

import math
from collections.abc import Sequence

from trueterrain.report import Block, Column, Table, Warnings
from trueterrain.verify.dynamic import DynamicResult
from trueterrain.verify.findings.finding import Finding

_UNITS = {"s": ("ms", 1e3), "rad": ("deg", math.degrees(1.0)), "m": ("mm", 1e3)}
_DIGITS = 4  # of milliseconds, degrees and millimetres
_WORDS = {True: "found", False: "not found", None: "not observable"}
_PERCENT, _MILLI = 100, 1e3


def findings_blocks(findings: Sequence[Finding], *, caption: str = "") -> list[Block]:
    """Table of findings, and sentences on those that are significant.

    Parameters
    ----------
    findings : sequence of Finding
        Findings.
    caption : str
        Caption of the table.

    Returns
    -------
    list of Block
        Table with values in ms, deg and mm, and warnings.
    """
    table = Table(
        columns=(
            Column(label="Looked for"),
            Column(label="Value", digits=_DIGITS),
            Column(label="sd", digits=_DIGITS),
            Column(label="Unit"),
            Column(label="There"),
            Column(label="Meaning"),
        ),
        rows=[
            [
                one.name,
                _scale_value(one.value, one.unit),
                _scale_value(one.sd, one.unit),
                _shown_unit(one.unit),
                _WORDS[one.detected],
                one.meaning,
            ]
            for one in findings
        ],
        caption=caption,
    )
    there = [finding_text(one) for one in findings if one.detected]
    return [table, Warnings(items=there)] if there else [table]


def modes_table(result: DynamicResult) -> Table:
    """Table of the error by modes of the vehicle.

    Parameters
    ----------
    result : DynamicResult
        With its modes.

    Returns
    -------
    Table
        A row for each band of frequencies.
    """
    motions = list(dict.fromkeys(name for one in result.modes for name in one.coherence))
    threshold = max((one.threshold for one in result.modes), default=1.0)
    return Table(
        columns=(
            Column(label="Band"),
            Column(label="From", unit="Hz", digits=1),
            Column(label="To", unit="Hz", digits=1),
            Column(label="Fraction of the mean square", unit="%", digits=1),
            Column(label="RMS", unit="mm", digits=3),
            *(Column(label=f"Coherence with {name}", digits=2) for name in motions),
        ),
        rows=[
            [
                one.name,
                one.low,
                one.high,
                None if one.fraction is None else _PERCENT * one.fraction,
                None if one.rms is None else _MILLI * one.rms,
                *(one.coherence.get(name) for name in motions),
            ]
            for one in result.modes
        ],
        caption=f"{result.source} Errors on plate and floor that are independent of the body's "
        f"motion exceed a squared coherence of {threshold:.2f} in one of 100 cases.",
    )


def finding_text(finding: Finding) -> str:
    """Sentence on a finding, with its value in usual units.

    Parameters
    ----------
    finding : Finding
        The finding.

    Returns
    -------
    str
        Name, state, value and meaning.
    """
    value, sd = _scale_value(finding.value, finding.unit), _scale_value(finding.sd, finding.unit)
    found = _WORDS[finding.detected]
    if value is not None:
        found += f", {value:.4g} {_shown_unit(finding.unit) or ''}".rstrip()
        found += "" if sd is None else f" (sd {sd:.2g})"
    return f"{finding.name}: {found}. {finding.meaning}"


def _scale_value(value: float | None, unit: str) -> float | None:
    return None if value is None else value * _UNITS.get(unit, (unit, 1.0))[1]


def _shown_unit(unit: str) -> str | None:
    known = _UNITS.get(unit, (unit, 1.0))[0]
    return None if known == "1" else known
