"""Inject faults into the virtual profiler, test it, and write the page of the results."""

import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from inject import tested
from page import page
from scenes import FAULTS
from statements import require_statements

PAGE = Path(__file__).parents[2] / "docs" / "explanation" / "faults.md"


def main() -> None:
    """Test all faults, two at a time; write the page if its statements hold."""
    begin = time.monotonic()
    with ProcessPoolExecutor(max_workers=2) as pool:
        found = []
        for one in pool.map(tested, FAULTS):
            found.append(one)
            sys.stderr.write(f"{one.fault.name}: {time.monotonic() - begin:.0f} s\n")
    require_statements(found)
    PAGE.write_text(page(found), encoding="utf-8")
    sys.stdout.write(f"{PAGE}\n")


if __name__ == "__main__":
    main()
