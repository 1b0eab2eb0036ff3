"""Page of the documentation, from its text and the results."""

import math
from collections.abc import Sequence
from pathlib import Path

from inject import Tested
from trueterrain.verify.dynamic import DynamicResult
from trueterrain.verify.findings.finding import Finding
from trueterrain.verify.static import StaticResult

TEXT = Path(__file__).parent / "page.md"
HEAD = (
    "<!-- Made by `make study-faults` from studies/faults/page.md: change that, not this. -->\n\n"
)

_FOUND = {True: "**found**", False: "not found", None: "not observable"}
_SHOWN = {"s": (1e3, "ms", 2), "m": (1e3, "mm", 2), "rad": (math.degrees(1.0), "°", 3)}


def page(tested: Sequence[Tested]) -> str:
    """Text of the page with its numbers and tables."""
    by_name = {one.fault.name: one for one in tested}
    pitch = looked_for(
        by_name["boresight, pitch"].dynamic, by_name["boresight, pitch"].fault.finding
    )
    place = looked_for(by_name["plate beside its place"].dynamic, "place of the plate")
    assert pitch is not None
    assert place is not None
    text = TEXT.read_text(encoding="utf-8")
    for name, value in {
        "{{table}}": _table(tested),
        "{{modes}}": _modes(tested),
        "{pitch_mm}": f"{1e3 * (by_name['boresight, pitch'].fault.injected or 0.0):.1f}",
        "{pitch_value}": _written(pitch),
        "{pitch_word}": _FOUND[pitch.detected].strip("*"),
        "{place_sd}": place.meaning.split(":")[0].split("deviation ")[-1],
    }.items():
        text = text.replace(name, value)
    return HEAD + text


def looked_for(result: StaticResult | DynamicResult, name: str) -> Finding | None:
    """Finding by its name; None if the test does not look for it."""
    return next((one for one in result.findings if one.name == name), None)


def _table(tested: Sequence[Tested]) -> str:
    rows = []
    for one in tested:
        fault = one.fault
        if not fault.finding:
            found = [
                finding.name
                for result in (one.static, one.dynamic)
                for finding in result.findings
                if finding.detected
            ]
            rows.append([fault.name, fault.size, *[", ".join(found) or "nothing found"] * 2])
            continue
        cells = []
        for result in (one.static, one.dynamic):
            finding = looked_for(result, fault.finding)
            cells.append("–" if finding is None else _written(finding, with_word=True))
        rows.append([fault.name, fault.size, *cells])
    return _lines(["injected", "size", "static test", "dynamic test"], rows)


def _modes(tested: Sequence[Tested]) -> str:
    rows = []
    for one in tested:
        rms = one.dynamic.row.off_edges
        rows.append(
            [
                one.fault.name,
                "–" if rms is None else f"{1e3 * rms.value:.3f} mm",
                one.dynamic.source.replace("Nothing of the error", "Nothing"),
            ]
        )
    return _lines(
        ["injected", "RMS over the plate, off edges", "which mode the error comes from"], rows
    )


def _written(finding: Finding, *, with_word: bool = False) -> str:
    """Value and standard deviation as text."""
    word = f", {_FOUND[finding.detected]}" if with_word else ""
    if finding.value is None:
        return _FOUND[finding.detected]
    if finding.name == "scans lost":
        return f"{finding.value:.0f}{word}"
    factor, unit, digits = _SHOWN.get(finding.unit, (100.0, "%", 2))
    text = f"{factor * finding.value:.{digits}f}"
    if finding.sd is not None:
        text += f" ± {factor * finding.sd:.{digits}f}"
    return f"{text} {unit}{word}".replace("-", "−").replace(" °", "°")


def _lines(heads: list[str], rows: list[list[str]]) -> str:
    rule = ["---"] * len(heads)
    return "\n".join("| " + " | ".join(row) + " |" for row in [heads, rule, *rows])
