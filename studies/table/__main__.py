"""Reproduce Table 3-1 of the thesis with the virtual profiler, and write the page of results."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from thesis_page import draw_errors, draw_sensitivity, page_text, require_statements
from thesis_table import make_table

PAGE = Path(__file__).parents[2] / "docs" / "explanation" / "thesis-table.md"
IMAGES = PAGE.parent / "images"


def main() -> None:
    """Record and evaluate the rows; page and figures are written if their statements hold."""
    table = make_table()
    require_statements(table)
    draw_errors(table, IMAGES / "thesis-table-errors.svg")
    draw_sensitivity(table, IMAGES / "thesis-table-positions.svg")
    PAGE.write_text(page_text(table), encoding="utf-8")
    sys.stdout.write(f"{PAGE}\n")


if __name__ == "__main__":
    main()
