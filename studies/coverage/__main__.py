"""Coverage of the intervals of accuracy tests, from repeated tests.

The table is written into the page on uncertainty, between two comments. Usage: ``python
studies/coverage [REPEATS]``.
"""

import math
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import numpy as np
from scipy.stats import binom

from repeats import drift, dynamic, static
from trueterrain.verify.results import ResultRow

PAGE = Path(__file__).parents[2] / "docs" / "explanation" / "uncertainty.md"
BEGIN = "<!-- From `python studies/coverage`: change that, not this table. -->\n"
END = "<!-- Until here. -->\n"
FIGURES = {"rms": "RMS", "off_edges": "off edges", "distance": "distance", "bias": "bias"}
CONFIDENCE = 0.95
CHANCE = 0.01  # of counts outside of the limits at this coverage


def main() -> None:
    """Repeat the tests, two at a time, and write the table."""
    repeats = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    begin = time.monotonic()
    rows: list[list[str]] = []
    with ProcessPoolExecutor(max_workers=2) as pool:
        for test in (drift, static, dynamic):
            found = list(pool.map(test, range(1, repeats + 1), chunksize=5))
            for same in zip(*found, strict=True):
                rows += _counted(same)
            sys.stderr.write(f"{test.__name__}: {time.monotonic() - begin:.0f} s\n")
    low, high = (int(binom.ppf(p, repeats, CONFIDENCE)) for p in (CHANCE / 2, 1 - CHANCE / 2))
    caption = (
        f"{repeats} repeats, {100 * CONFIDENCE:g} % confidence. At that coverage, {low} to {high} "
        f"repeats hold the true value, but for {100 * CHANCE:g} % of all such studies."
    )
    heads = ["test", "figure", "true value [mm]", "held", "trusted", "independent errors"]
    lines = [heads, ["---", "---", *["--:"] * 4], *rows]
    table = "\n".join("| " + " | ".join(line) + " |" for line in lines)
    before, rest = PAGE.read_text(encoding="utf-8").split(BEGIN)
    after = rest.split(END)[1]
    PAGE.write_text(f"{before}{BEGIN}\n{table}\n\n{caption}\n\n{END}{after}", encoding="utf-8")
    sys.stdout.write(f"{table}\n{caption}\n{PAGE}\n")


def _counted(rows: tuple[ResultRow, ...]) -> Iterator[list[str]]:
    """Rows of the table for one test."""
    for name, label in FIGURES.items():
        found = [getattr(row, name) for row in rows]
        if None in found:
            continue
        values = np.array([one.value for one in found])
        truth = values.mean() if name == "bias" else math.sqrt(np.mean(values**2))
        held = sum(one.low <= truth <= one.high for one in found)
        trusted = sum(one.trusted for one in found)
        independent = float(np.median([one.independent for one in found]))
        yield [
            rows[0].test,
            label,
            f"{1000 * truth:.3f}",
            str(held),
            str(trusted),
            f"{independent:.0f}",
        ]


if __name__ == "__main__":
    main()
