"""Page of the documentation, from its text and the results.

In the text, ``{force|median|r = 25 mm|asphalt}`` stands for a number: what, of which group, of
which reduction, on which road (or ``mean``, of all roads); ``{{overview}}`` and the like for
tables.
"""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np

from judge import LEAD, Judged, Verdict
from reductions import LOAD
from roads import COURSES
from truck import (
    LASER,
    LENGTH,
    LINE,
    STATISTICS,
    TYRES,
    WIDE_LASER,
    Rolled,
    Which,
    best_radius,
    growths,
)

TEXT = Path(__file__).parent / "page.md"
HEAD = "<!-- Made by `make study` from studies/response/page.md: change that, not this. -->\n\n"

#: What can be asked of a verdict, and how it is written.
NUMBERS: dict[str, Callable[[Verdict], float]] = {
    "acceleration": lambda v: float(v.quarter.error.sel(quantity="body_acceleration")),
    "force": lambda v: float(v.quarter.error.sel(quantity="tyre_force")),
    "travel": lambda v: float(v.quarter.error.sel(quantity="suspension_travel")),
    "full_acceleration": lambda v: float(v.full.error.sel(quantity="body_acceleration")),
    "full_force": lambda v: float(v.full.error.sel(quantity="tyre_force")),
    "full_travel": lambda v: float(v.full.error.sel(quantity="suspension_travel")),
    "by_cams": lambda v: float(v.otherwise.error.sel(quantity="tyre_force")),
    "acceleration_rms": lambda v: _rms(v, "body_acceleration"),
    "force_rms": lambda v: _rms(v, "tyre_force"),
    "travel_rms": lambda v: _rms(v, "suspension_travel"),
    "damage": lambda v: float(v.quarter.damage_ratio.sel(quantity="tyre_force")),
    "iri": lambda v: v.iri - 1,
    "highest_band": lambda v: float(v.quarter.band_ratio.sel(quantity="tyre_force")[-1]) - 1,
}
SIGNED = ("acceleration_rms", "force_rms", "travel_rms", "iri", "highest_band")


def page(judged: list[Judged], rolled: list[Rolled]) -> str:
    """Text with its numbers and tables."""
    tables = {
        "roads": _roads(judged),
        "overview": _overview(judged),
        "best": _best(judged),
        "tyres": _tyres(rolled),
        **{road.course.replace(" ", "-"): _details(road) for road in judged},
    }
    text = TEXT.read_text(encoding="utf-8")
    for name, written in {"lead": f"{LEAD:g} s", **_of_tyres(rolled)}.items():
        text = text.replace(f"{{{name}}}", written)
    text = re.sub(r"\{\{([\w-]+)\}\}", lambda found: tables[found[1]], text)
    return HEAD + re.sub(
        r"\{(\w+)\|([^|}]+)\|([^|}]+)\|([^|}]+)\}",
        lambda found: _number(judged, *found.groups()),
        text,
    )


def value(judged: list[Judged], what: str, group: str, name: str, road: str) -> float:
    """Number of a reduction on a road, or the mean of its sizes over all roads."""
    ask = NUMBERS[what]
    found = [
        ask(verdict)
        for one in judged
        if road in (one.course, "mean")
        for verdict in one.verdicts
        if (verdict.group, verdict.name) == (group, name)
    ]
    if not found:
        raise KeyError(f"{what} of {group}, {name} on {road}")
    return float(np.mean(np.abs(found))) if road == "mean" else found[0]


def _number(judged: list[Judged], what: str, group: str, name: str, road: str) -> str:
    return _written(what, value(judged, what, group, name, road))


def _written(what: str, number: float) -> str:
    """Number as text: damage as a factor, all others in per cent."""
    if what == "damage":
        return f"× {number:.{2 if number < 9.995 else 0}f}"
    return _percent(number, signed=what in SIGNED)


def _percent(number: float, *, signed: bool = False) -> str:
    digits = 0 if abs(number) >= 0.0995 else 1
    percent = round(100 * number, digits) + 0.0  # not -0.0
    return f"{percent:{'+' if signed else ''}.{digits}f} %".replace("-", "−")


def _rms(verdict: Verdict, quantity: str) -> float:
    return float(verdict.quarter.rms_ratio.sel(quantity=quantity)) - 1


def _table(heads: list[str], rows: list[list[str]]) -> str:
    rule = ["---"] + ["--:"] * (len(heads) - 1)
    return "\n".join("| " + " | ".join(row) + " |" for row in [heads, rule, *rows])


def _roads(judged: list[Judged]) -> str:
    rows = []
    for course, road in zip(COURSES, judged, strict=True):
        rms = road.rms
        rows.append(
            [
                f"{course.name}: {course.what}; {course.length:.0f} m",
                f"{course.speed:.0f} km/h",
                f"{rms['body_acceleration']:.2f} m/s²",
                f"{rms['tyre_force']:.0f} N",
                f"{1000 * rms['suspension_travel']:.1f} mm",
                _percent(road.off_the_ground),
                f"{road.mri:.2f} m/km",
            ]
        )
    heads = [
        "road",
        "speed",
        "body acceleration",
        "tyre force",
        "suspension travel",
        "pulls",
        "MRI",
    ]
    return _table(heads, rows)


def _rows(verdicts: list[Verdict], cells: Callable[[Verdict], list[str]]) -> list[list[str]]:
    rows, before = [], ""
    for verdict in verdicts:
        label = verdict.name if verdict.group == before else f"**{verdict.group}:** {verdict.name}"
        before = verdict.group
        rows.append([label, *cells(verdict)])
    return rows


def _overview(judged: list[Judged]) -> str:
    def cells(verdict: Verdict) -> list[str]:
        which = verdict.group, verdict.name
        errors = [
            _percent(value(judged, what, *which, "mean"))
            for what in ("acceleration", "force", "travel", "full_force", "by_cams")
        ]
        ranges = []
        for what in ("damage", "iri"):
            found = [value(judged, what, *which, road.course) for road in judged]
            ranges.append(f"{_written(what, min(found))} to {_written(what, max(found))}")
        return [*errors, *ranges]

    heads = [
        "reduction",
        "body acceleration",
        "tyre force",
        "suspension travel",
        "tyre force, full car",
        "tyre force, cams as reference",
        "damage",
        "MRI",
    ]
    return _table(heads, _rows(judged[0].verdicts, cells))


def _details(road: Judged) -> str:
    def cells(verdict: Verdict) -> list[str]:
        quarter, full = verdict.quarter, verdict.full
        bands = quarter.band_ratio.sel(quantity="tyre_force").values
        return [
            *(
                f"{_percent(float(error))} ({_percent(float(rms) - 1, signed=True)})"
                for error, rms in zip(quarter.error, quarter.rms_ratio, strict=True)
            ),
            f"{float(quarter.correlation.sel(quantity='tyre_force')):.3f}",
            " ".join(f"{band:.2f}" for band in bands),
            _written("damage", NUMBERS["damage"](verdict)),
            " / ".join(_percent(float(error)) for error in full.error),
            _percent(verdict.iri - 1, signed=True),
        ]

    heads = [
        "reduction",
        "body acceleration",
        "tyre force",
        "suspension travel",
        "correlation of force",
        "force by band",
        "damage",
        "full car: acceleration / force / travel",
        "MRI",
    ]
    return _table(heads, _rows(road.verdicts, cells))


def _of_tyres(rolled: list[Rolled]) -> dict[str, str]:
    """Sizes of the patches, and how the best radius grows with them."""
    passenger, truck = TYRES["passenger"], TYRES["truck"]
    found = growths(rolled)
    patches = {
        f"{name} patch": " by ".join(
            f"{1000 * size:.0f} mm" for size in (tyre.contact_length, tyre.contact_width)
        )
        for name, tyre in TYRES.items()
    }
    return {
        **patches,
        "load": f"{LOAD / 1000:.1f} kN",
        "truck road": f"{LENGTH:g} m",
        "growth": f"{np.mean(found):.2f}",
        "least growth": f"{min(found):.2f}",
        "greatest growth": f"{max(found):.2f}",
        "longer patch": f"{truck.contact_length / passenger.contact_length:.1f}",
    }


def _tyres(rolled: list[Rolled]) -> str:
    """Difference of heights from either tyre's; of search areas, for the best radius of each."""

    def cell(road: Rolled, tyre: str, which: Which) -> str:
        felt = road.felt[tyre][which]
        return f"{1000 * felt.longer:.2f} / {1000 * felt.shorter:.2f}"

    rows = []
    for tyre in TYRES:
        alone = {"bare line": LINE, "median, r = 25 mm": ("median", 25)}
        lasers = {which[0]: which for which in (LASER, WIDE_LASER)}
        table = {
            name: [cell(road, tyre, which) for road in rolled] for name, which in alone.items()
        }
        for name in STATISTICS:
            radii = [best_radius(road, tyre, name) for road in rolled]
            table[f"{name}, best radius"] = [
                f"{radius} mm: {cell(road, tyre, (name, radius))}"
                for road, radius in zip(rolled, radii, strict=True)
            ]
        table |= {
            name: [cell(road, tyre, which) for road in rolled] for name, which in lasers.items()
        }
        for number, (name, cells) in enumerate(table.items()):
            rows.append([name if number else f"**{tyre}:** {name}", *cells])
    return _table(["difference of heights [mm]", *(road.course for road in rolled)], rows)


def _best(judged: list[Judged]) -> str:
    """For each road and quantity, the best height of a search area and the best tyre on a line."""
    families = {
        "search area": lambda v: "percentile" in v.group or v.group in ("median", "mean"),
        "tyre on a profile": lambda v: v.group == "envelope on a profile",
    }
    rows = []
    for family, belongs in families.items():
        for road in judged:
            some = [verdict for verdict in road.verdicts if belongs(verdict)]
            row = [f"{family}, {road.course}"]
            for what in ("acceleration", "force", "travel", "iri"):
                least = min(some, key=lambda v: abs(NUMBERS[what](v)))
                name = least.name if "profile" in least.group else f"{least.group}, {least.name}"
                row.append(f"{name}: {_percent(NUMBERS[what](least), signed=what == 'iri')}")
            rows.append(row)
    return _table(["from", "body acceleration", "tyre force", "suspension travel", "MRI"], rows)
