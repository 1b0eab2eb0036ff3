"""Findings and modes as a certificate shows them."""

from types import SimpleNamespace

import numpy as np

from trueterrain.report.findings import finding_text, findings_blocks, modes_table
from trueterrain.verify.error_modes import main_error_source, split_by_mode
from trueterrain.verify.findings.finding import Finding


def _finding(**parts):
    return Finding(**{"name": "clock", "unit": "s", "meaning": "It is late.", **parts})


def test_findings_are_also_stated_as_text():
    findings = [
        _finding(value=0.001, sd=1e-5, detected=True),
        _finding(value=1e-6, sd=1e-5, detected=False),
        _finding(value=None, sd=None, detected=None),
    ]
    table, warnings = findings_blocks(findings)
    assert list(warnings.items) == [finding_text(findings[0])]
    assert [row[4] for row in table.rows] == ["found", "not found", "not observable"]
    assert [row[1] for row in table.rows][::2] == [1.0, None]  # [ms]
    assert len(findings_blocks(findings[1:])) == 1
    assert finding_text(findings[0]) == "clock: found, 1 ms (sd 0.01). It is late."


def test_modes_are_a_row_each_and_their_fractions_add_up():
    time = np.linspace(0, 3, 1500, endpoint=False)
    pitch = np.sin(2 * np.pi * 1.5 * time)
    error = 1e-3 * pitch + 1e-4 * np.sin(2 * np.pi * 11 * time)
    modes = split_by_mode(time, error, {"pitch": pitch}, ride=(0.5, 3.0), hop=(8.0, 16.0))
    table = modes_table(SimpleNamespace(modes=modes, source=main_error_source(modes)))
    assert [row[0] for row in table.rows][1] == "primary ride"
    np.testing.assert_allclose(sum(row[3] for row in table.rows), 100.0, rtol=0, atol=1e-9)
    assert table.columns[-1].label == "Coherence with pitch"
    assert "moves with pitch" in table.caption
