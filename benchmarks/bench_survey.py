"""The whole command `trueterrain run`, with report: time and peak memory over the length of a run.

The recording is plain: 10 m/s, 940 beams over 3.8 m, 1000 scans/s, navigation at 200 Hz, two
accelerometers at 1 kHz, nodes 10 mm apart, all else as `trueterrain init survey` prints it. Each
run is a process of its own, whose peak memory the operating system reports.
"""

import math
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from trueterrain.formats.run import Mounting, RunWriter

MINUTES = (1, 10)
LONG_MINUTES = 60
BEAMS = 940
SPEED = 10.0  # [m/s]
RATE = 1000  # [1/s] of scans
BLOCK = 4000  # scans that are written at once
HEAVE = 0.02, 9.0  # [m], [rad/s] of the body
NOISE = 0.0005  # [m] of the ranges
SENSORS = np.array([[1.0, 0.8, 0.0], [1.0, -0.8, 0.0]])
ROAD = "right = -1.9\nleft = 1.9\n"


class Measured(NamedTuple):
    """Time and memory of a command."""

    seconds: float
    gigabytes: float


def bench() -> list[dict[str, Any]]:
    """Rows of name, ours, peer, unit, ratio and budget.

    Returns
    -------
    list of dict
        What was measured.
    """
    return rows_of(MINUTES)


def bench_long() -> list[dict[str, Any]]:
    """The same with an hour of recording.

    Returns
    -------
    list of dict
        What was measured.
    """
    return rows_of((10, LONG_MINUTES))


def rows_of(minutes: tuple[int, int]) -> list[dict[str, Any]]:
    """Rows for a short and a long recording."""
    short, long = (measure(m) for m in minutes)
    rows = [
        row(
            f"run, {m} min of recording, {returns(m) / 1e6:.0f} M returns: peak memory",
            found.gigabytes,
            "GB",
            "<= 2 GB",
            found.gigabytes <= 2,
        )
        for m, found in zip(minutes, (short, long), strict=True)
    ]
    speed = returns(minutes[1]) / long.seconds / 1e6
    exponent = math.log(long.seconds / short.seconds) / math.log(minutes[1] / minutes[0])
    return [
        *rows,
        row(
            f"run with report, {minutes[1]} min of recording",
            speed,
            "M returns/s",
            ">= 6 M returns/s",
            speed >= 6,
        ),
        row(
            f"exponent of the time of run from {minutes[0]} to {minutes[1]} min",
            exponent,
            "1",
            "<= 1.05",
            exponent <= 1.05,
        ),
        row(
            f"peak memory of run, {minutes[1]} min over {minutes[0]} min",
            long.gigabytes / short.gigabytes,
            "1",
            "<= 1.2",
            long.gigabytes / short.gigabytes <= 1.2,
        ),
    ]


def row(name: str, ours: float, unit: str, budget: str, met: bool) -> dict[str, Any]:
    """One row without a peer: no other program does this chain."""
    return {
        "name": name,
        "ours": ours,
        "peer": None,
        "peer_name": None,
        "unit": unit,
        "ratio": None,
        "budget": budget,
        "met": met,
    }


def returns(minutes: float) -> float:
    """Returns of a recording."""
    return minutes * 60 * RATE * BEAMS


def measure(minutes: int) -> Measured:
    """Record so many minutes, and process them by the command."""
    with tempfile.TemporaryDirectory() as folder:
        recording, survey = Path(folder) / "road.zarr", Path(folder) / "survey.toml"
        record(recording, minutes * 60.0)
        template = subprocess.run(
            [*command(), "init", "survey", str(recording)],
            check=True,
            stdout=subprocess.PIPE,
            text=True,
        ).stdout
        sides = ("right =", "left =")
        lines = [line for line in template.splitlines() if not line.startswith(sides)]
        at = lines.index("[grid]") + 1
        survey.write_text("\n".join([*lines[:at], *ROAD.splitlines(), *lines[at:]]) + "\n")
        begin = time.perf_counter()
        process = subprocess.Popen(
            [*command(), "run", str(survey), "-o", str(Path(folder) / "result")],
            stdout=subprocess.DEVNULL,
        )
        _, status, usage = os.wait4(process.pid, 0)
        seconds = time.perf_counter() - begin
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            message = f"trueterrain run ended with {process.returncode}"
            raise RuntimeError(message)
    return Measured(seconds, usage.ru_maxrss * 1024 / 1e9)


def command() -> list[str]:
    """The program, as a user types it."""
    return [sys.executable, "-m", "trueterrain"]


def record(path: Path, seconds: float) -> None:
    """Write a recording over level ground, block by block."""
    angle, delay = np.linspace(-0.78, 0.78, BEAMS), np.arange(BEAMS) * 0.8e-3 / BEAMS
    rng = np.random.default_rng(1)
    heave, frequency = HEAVE
    with RunWriter(
        path,
        name="bench",
        origin=(11.0, 48.0, 500.0),
        time_reference="run",
        mounting=Mounting(),
        angle=angle,
        delay=delay,
        accelerometer_positions=SENSORS,
        max_range=6.0,
    ) as run:
        t = np.arange(-0.5, seconds + 0.5, 0.005)
        still = dict.fromkeys(("north", "roll", "pitch", "yaw"), np.zeros(t.size))
        sd = {f"sd_{name}": np.full(t.size, 0.01) for name in ("east", "north", "up")}
        sd |= {f"sd_{name}": np.full(t.size, 2e-4) for name in ("roll", "pitch", "yaw")}
        up = 2 + heave * np.sin(frequency * t)
        run.append_navigation({"time": t, "east": SPEED * t, "up": up, **still, **sd})
        t = np.arange(-0.5, seconds + 0.5, 0.001)
        force = 9.81 - heave * frequency**2 * np.sin(frequency * t)
        run.append_accelerometers(t, force[:, None] + rng.normal(0, 0.01, (t.size, 2)))
        for first in range(0, int(seconds * RATE), BLOCK):
            stamps = np.arange(first, min(first + BLOCK, int(seconds * RATE))) / RATE
            height = 2 + heave * np.sin(frequency * stamps)
            noise = rng.normal(0, NOISE, (stamps.size, BEAMS)).astype(np.float32)
            run.append_scans(stamps, height[:, None] / np.cos(angle) + noise)


if __name__ == "__main__":
    for line in bench_long() if "--long" in sys.argv else bench():
        print(f"{line['name']}: {line['ours']:.3g} {line['unit']} ({line['budget']})")
