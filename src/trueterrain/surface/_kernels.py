"""Loops over sets of nodes without height; all checks are made by the callers."""

import numpy as np
import numpy.typing as npt

from trueterrain.core.kernels import compile_kernel

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


@compile_kernel
def missing_runs(cells: Floats) -> npt.NDArray[np.int32]:
    """Row, begin and end of cells without a finite value side by side, row by row."""
    runs = np.empty((0, 3), np.int32)
    for turn in range(2):
        found = 0
        for i in range(cells.shape[0]):
            inside = False
            for j in range(cells.shape[1]):
                missing = not np.isfinite(cells[i, j])
                if missing and not inside:
                    if turn == 1:
                        runs[found, 0] = i
                        runs[found, 1] = j
                    found += 1
                if turn == 1 and missing:
                    runs[found - 1, 2] = j + 1
                inside = missing
        if turn == 0:
            runs = np.empty((found, 3), np.int32)
    return runs


@compile_kernel
def connect_runs(runs: npt.NDArray[np.int32]) -> tuple[npt.NDArray[np.int32], int]:
    """Number of the set that each run belongs to, by its first run, and how many sets there are."""
    number = np.arange(runs.shape[0]).astype(np.int32)
    above = 0
    for k in range(runs.shape[0]):
        while runs[above, 0] < runs[k, 0] - 1 or (
            runs[above, 0] == runs[k, 0] - 1 and runs[above, 2] <= runs[k, 1]
        ):
            above += 1
        beside = above
        while runs[beside, 0] == runs[k, 0] - 1 and runs[beside, 1] < runs[k, 2]:
            a, b = _find_root(number, beside), _find_root(number, k)
            number[max(a, b)] = min(a, b)
            beside += 1
    count = 0
    for k in range(runs.shape[0]):
        # the first run of a set comes before all others, and has its number already
        if number[k] == k:
            number[k] = count
            count += 1
        else:
            number[k] = number[number[k]]
    return number, count


@compile_kernel
def _find_root(number: npt.NDArray[np.int32], k: int) -> int:
    """First run of the set of a run."""
    while number[k] != k:
        number[k] = number[number[k]]
        k = number[k]
    return k


@compile_kernel
def measure_holes(
    runs: npt.NDArray[np.int32],
    hole: npt.NDArray[np.int32],
    low: Integers,
    high: Integers,
    nodes: Integers,
) -> None:
    """First and last cells of each hole along both axes, and how many it has."""
    for k in range(runs.shape[0]):
        h = hole[k]
        nodes[h] += runs[k, 2] - runs[k, 1]
        low[h, 0] = min(low[h, 0], runs[k, 0])
        high[h, 0] = max(high[h, 0], runs[k, 0] + 1)
        low[h, 1] = min(low[h, 1], runs[k, 1])
        high[h, 1] = max(high[h, 1], runs[k, 2])
