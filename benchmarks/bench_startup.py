"""Start-up: what a user waits for before anything happens."""

import subprocess
import sys
import time
from typing import Any

_RUNS = 7


def bench() -> list[dict[str, Any]]:
    """Rows of name, ours, peer, unit, ratio and budget."""
    bare = _seconds("pass")
    return [
        _row("trueterrain --help", "from trueterrain.cli import main; main(['--help'])", 0.3, bare),
        _row("import trueterrain", "import trueterrain", 0.2, bare),
    ]


def _row(name: str, code: str, budget: float, bare: float) -> dict[str, Any]:
    seconds = _seconds(code)
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


def _seconds(code: str) -> float:
    """Shortest wall time of several fresh interpreters [s]."""
    times = []
    for _ in range(_RUNS):
        begin = time.perf_counter()
        subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL)
        times.append(time.perf_counter() - begin)
    return min(times)
