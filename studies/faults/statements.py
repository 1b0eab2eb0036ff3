"""Statements of the page, checked against the results before the page is written."""

from collections.abc import Sequence

from inject import Tested
from page import looked_for

#: Faults that each test must detect.
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
#: Faults that are not observable in a test.
NOT_OBSERVABLE = {"dynamic": ("boresight, roll", "lever arm, up", "plate beside its place")}

_SIGNIFICANT = 4.0  # standard deviations
_NEAR = 0.25  # further error, as a fraction of the injected value


def require_statements(tested: Sequence[Tested]) -> None:
    """Raise SystemExit with every statement of the page that the results contradict."""
    wrong = [sentence for sentence, holds in check_statements(tested) if not holds]
    if wrong:
        raise SystemExit("The results contradict the page:\n- " + "\n- ".join(wrong))


def check_statements(tested: Sequence[Tested]) -> list[tuple[str, bool]]:
    """Statements, and whether they hold."""
    moved = {
        one.fault.name
        for one in tested
        if any(mode.moves_with and (mode.fraction or 0.0) > 0.05 for mode in one.dynamic.modes)
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
            elif fault.name in NOT_OBSERVABLE.get(test, ()):
                found.append(
                    (f"{what}: is not observable", finding is None or finding.detected is None)
                )
            if finding is not None and finding.value is not None and fault.injected is not None:
                off = abs(finding.value - fault.injected)
                if finding.detected:
                    near = off <= _SIGNIFICANT * (finding.sd or 0.0) + _NEAR * abs(fault.injected)
                    found.append((f"{what}: the value is the injected one", near))
    return found
