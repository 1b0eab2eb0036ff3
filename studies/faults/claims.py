"""What the text of the page says in words, checked against each run before it is written."""

from collections.abc import Sequence

from inject import Tested
from page import looked_for

#: Who must find what.
FOUND = {
    "static": (
        "boresight, roll",
        "saturated cleat",
        "plate beside its place",
        "scans dropped",
    ),
    "dynamic": (
        "clock of the scanner",
        "lever arm, ahead",
        "lever arm, to the left",
        "saturated cleat",
        "scale of the accelerometers",
        "scans dropped",
    ),
}
UNTOLD = {"dynamic": ("boresight, roll", "lever arm, up", "plate beside its place")}

_SURE = 4.0  # standard deviations
_NEAR = 0.25  # of what was injected, by which a value may be off besides


def require_claims(tested: Sequence[Tested]) -> None:
    """Raise SystemExit with every sentence of the page that this run contradicts."""
    wrong = [sentence for sentence, holds in claims(tested) if not holds]
    if wrong:
        raise SystemExit("The page would say what was not found:\n- " + "\n- ".join(wrong))


def claims(tested: Sequence[Tested]) -> list[tuple[str, bool]]:
    """Sentences, and whether they hold."""
    moved = {
        one.fault.name
        for one in tested
        if any(mode.moves_with and (mode.share or 0.0) > 0.05 for mode in one.dynamic.modes)
    }
    found = [
        (
            "only clock and scale make the error move with the body",
            moved == {"clock of the scanner", "scale of the accelerometers"},
        ),
    ]
    for one in tested:
        fault = one.fault
        for test, result in (("static", one.static), ("dynamic", one.dynamic)):
            finding = looked_for(result, fault.finding)
            what = f"{test}, {fault.name}"
            if not fault.finding:
                quiet = not any(each.detected for each in result.findings)
                found.append((f"{what}: nothing is found", quiet))
            elif fault.name in FOUND.get(test, ()):
                found.append(
                    (f"{what}: is found", finding is not None and finding.detected is True)
                )
            elif fault.name in UNTOLD.get(test, ()):
                found.append(
                    (f"{what}: cannot be told", finding is None or finding.detected is None)
                )
            if finding is not None and finding.value is not None and fault.injected is not None:
                off = abs(finding.value - fault.injected)
                if finding.detected:
                    near = off <= _SURE * (finding.sd or 0.0) + _NEAR * abs(fault.injected)
                    found.append((f"{what}: the value is that which was injected", near))
    return found
