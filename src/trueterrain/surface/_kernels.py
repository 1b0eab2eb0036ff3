"""Loops over sets of nodes without height; callers check the arguments."""

import numpy as np
import numpy.typing as npt

from trueterrain.core.kernels import compile_kernel

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


@compile_kernel
def missing_runs(cells: Floats) -> npt.NDArray[np.int32]:
    """Runs of consecutive cells without a finite value.

    cells : shape (row, column)
    returns row, first and one past the last column of each run, shape (run, 3)
    """
    # the first sweep counts the runs, the second stores them
    runs = np.empty((0, 3), np.int32)
    for sweep in range(2):
        found = 0
        for i in range(cells.shape[0]):
            inside = False
            for j in range(cells.shape[1]):
                missing = not np.isfinite(cells[i, j])
                if missing and not inside:
                    if sweep == 1:
                        runs[found, 0] = i
                        runs[found, 1] = j
                    found += 1
                if sweep == 1 and missing:
                    runs[found - 1, 2] = j + 1
                inside = missing
        if sweep == 0:
            runs = np.empty((found, 3), np.int32)
    return runs


@compile_kernel
def connect_runs(runs: npt.NDArray[np.int32]) -> tuple[npt.NDArray[np.int32], int]:
    """Connected sets of runs, by union-find.

    runs : shape (run, 3), row by row
    returns the number of the set of each run, shape (run,), in the order of first runs, and the
    number of sets
    """
    number = np.arange(runs.shape[0]).astype(np.int32)
    above = 0
    for k in range(runs.shape[0]):
        while runs[above, 0] < runs[k, 0] - 1 or (
            runs[above, 0] == runs[k, 0] - 1 and runs[above, 2] <= runs[k, 1]
        ):
            above += 1
        neighbour = above
        while runs[neighbour, 0] == runs[k, 0] - 1 and runs[neighbour, 1] < runs[k, 2]:
            a, b = _find_root(number, neighbour), _find_root(number, k)
            number[max(a, b)] = min(a, b)
            neighbour += 1
    count = 0
    for k in range(runs.shape[0]):
        # the root of a set is its first run, so it has its number when the others come
        if number[k] == k:
            number[k] = count
            count += 1
        else:
            number[k] = number[number[k]]
    return number, count


@compile_kernel
def _find_root(number: npt.NDArray[np.int32], k: int) -> int:
    """First run of the set of run k, with path compression."""
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
    """Extent and size of each hole.

    runs : shape (run, 3)
    hole : hole of each run, shape (run,)
    low, high : output, first and one past the last cell along both axes, shape (hole, 2)
    nodes : output, number of cells, shape (hole,)
    """
    for k in range(runs.shape[0]):
        h = hole[k]
        nodes[h] += runs[k, 2] - runs[k, 1]
        low[h, 0] = min(low[h, 0], runs[k, 0])
        high[h, 0] = max(high[h, 0], runs[k, 0] + 1)
        low[h, 1] = min(low[h, 1], runs[k, 1])
        high[h, 1] = max(high[h, 1], runs[k, 2])
