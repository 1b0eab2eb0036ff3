"""Compare reductions of the ground by the response of vehicles, and write the page of results."""

import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from judge import judge
from page import page
from roads import COURSES
from spectra import draw_spectra
from statements import require_statements
from truck import roll

PAGE = Path(__file__).parents[2] / "docs" / "explanation" / "which-reduction.md"
SPECTRA = PAGE.parent / "images" / "which-reduction-spectra.svg"


def main() -> None:
    """Compare on all roads, two at a time; page and figure are written if their statements hold."""
    begin = time.monotonic()
    with ProcessPoolExecutor(max_workers=2) as pool:
        judged = []
        for road in pool.map(judge, COURSES):
            judged.append(road)
            sys.stderr.write(f"{road.course}: {time.monotonic() - begin:.0f} s\n")
        rolled = list(pool.map(roll, COURSES))
        sys.stderr.write(f"a truck's tyre: {time.monotonic() - begin:.0f} s\n")
    require_statements(judged, rolled)
    draw_spectra(judged, SPECTRA)
    PAGE.write_text(page(judged, rolled), encoding="utf-8")
    sys.stdout.write(f"{PAGE}\n{SPECTRA}\n")


if __name__ == "__main__":
    main()
