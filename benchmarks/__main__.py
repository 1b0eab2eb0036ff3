"""Run all benchmarks and print a table of results, peers and budgets."""

import json
import subprocess
import sys
from pathlib import Path

from rich.console import Console
from rich.table import Table

_COMMAND = "import json, {module}; print(json.dumps({module}.bench(), default=lambda x: x.item()))"


def main() -> int:
    """Print the table; 1 if a budget is not met or a benchmark fails."""
    here = Path(__file__).parent
    rows, failed = [], False
    for module in sorted(path.stem for path in here.glob("bench_*.py")):
        print(f"{module} ...", file=sys.stderr)
        # one process for each module, so that peak memory is its own
        done = subprocess.run(
            [sys.executable, "-c", _COMMAND.format(module=module)],
            cwd=here,
            stdout=subprocess.PIPE,
            text=True,
            check=False,
        )
        if done.returncode:  # the other modules still run
            failed = True
        else:
            rows += json.loads(done.stdout.splitlines()[-1])
    table = Table(title="trueterrain benchmarks")
    for heading in ("what", "ours", "peer", "unit", "peer is", "ratio", "budget", "met"):
        table.add_column(heading)
    for row in rows:
        table.add_row(
            row["name"],
            f"{row['ours']:.3g}",
            "-" if row["peer"] is None else f"{row['peer']:.3g}",
            row["unit"],
            row["peer_name"] or "-",
            "-" if row["ratio"] is None else f"{row['ratio']:.1f}",
            row["budget"],
            "yes" if row["met"] else "NO",
        )
    Console(width=150).print(table)
    return 0 if all(row["met"] for row in rows) and not failed else 1


if __name__ == "__main__":
    sys.exit(main())
