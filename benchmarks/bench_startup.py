"""Start-up time of the command line and of the import, beside the bare interpreter."""

import subprocess
import sys
import time
from typing import Any

_REPEATS = 7
_HELP = "from trueterrain.cli import main; main(['--help'])"


def bench() -> list[dict[str, Any]]:
    """Table rows: name, ours, peer, unit, ratio and budget."""
    bare = _measure_start("pass")
    return [
        _table_row("trueterrain --help", _HELP, 0.3, bare),
        _table_row("import trueterrain", "import trueterrain", 0.2, bare),
    ]


def _table_row(name: str, code: str, budget: float, bare: float) -> dict[str, Any]:
    seconds = _measure_start(code)
    return {
        "name": name,
        "ours": seconds,
        "peer": bare,
        "peer_name": "python -c pass",
        "unit": "s",
        "ratio": bare / seconds,
        "budget": f"< {budget} s",
        "met": seconds < budget,
    }


def _measure_start(code: str) -> float:
    """Minimum wall time over several new interpreters [s].

    The minimum, since other processes only add to it.
    """
    times = []
    for _ in range(_REPEATS):
        start = time.perf_counter()
        subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL)
        times.append(time.perf_counter() - start)
    return min(times)
