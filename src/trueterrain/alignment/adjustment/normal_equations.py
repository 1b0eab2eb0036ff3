"""Normal equations of the adjustment, prior information, and their solution."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trueterrain.alignment.adjustment.cholesky.factorisation import CholeskyFactor
from trueterrain.alignment.adjustment.spline import GaussMarkovProcess

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


@dataclass(frozen=True, kw_only=True)
class ComponentPrior:
    """Prior of one component of the corrections."""

    process: GaussMarkovProcess
    "Drift about the constant part."

    offset_sd: float
    "Standard deviation of its constant part [m] or [rad]; infinite for the height."


@dataclass(frozen=True, kw_only=True, eq=False)
class NormalEquations:
    """Normal equations of some cells."""

    blocks: Floats
    "Blocks of the normal matrix, one for each pair of intervals, shape (pair, 4 k, 4 k)."

    right: Floats
    "Right-hand sides, shape (interval, 4 k)."

    square: float
    "Weighted sum of squares of heights less the mean of their cell."

    degrees_of_freedom: int
    "Entries less cells."

    def plus(self, other: "NormalEquations") -> "NormalEquations":
        """Normal equations with those of other cells added."""
        return NormalEquations(
            blocks=self.blocks + other.blocks,
            right=self.right + other.right,
            square=self.square + other.square,
            degrees_of_freedom=self.degrees_of_freedom + other.degrees_of_freedom,
        )

    def less(self, other: "NormalEquations") -> "NormalEquations":
        """Normal equations with those of some cells removed."""
        return NormalEquations(
            blocks=self.blocks - other.blocks,
            right=self.right - other.right,
            square=self.square - other.square,
            degrees_of_freedom=self.degrees_of_freedom - other.degrees_of_freedom,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class PriorInformation:
    """Prior information on all unknowns."""

    elements: Floats
    "Elements of its normal matrix."

    log_determinant: float
    "Logarithm of the determinant of its non-singular part."


@dataclass(frozen=True, kw_only=True, eq=False)
class AdjustmentSolution:
    """Solution of the normal equations."""

    factor: CholeskyFactor
    "Cholesky factor of their matrix, the prior included."

    x: Floats
    "Unknowns."

    coefficients: Floats
    "Coefficients of each interval, offsets included, shape (interval, 4 k)."

    log_likelihood: float
    "Logarithm of the marginal likelihood of the data, up to a constant."


def pair_places(unknown: Integers, one: Integers, two: Integers) -> tuple[Integers, Integers]:
    """Rows and columns of the elements of the blocks of pairs, in the order of assembly."""
    size = unknown.shape[1]
    row = np.broadcast_to(unknown[one][:, :, None], (one.size, size, size))
    column = np.broadcast_to(unknown[two][:, None, :], (one.size, size, size))
    lower = np.tril(np.ones((size, size), bool))
    used = np.where((one == two)[:, None, None], lower, True)
    return row[used], column[used]


def squared_band(rows: Floats) -> list[Floats]:
    """Diagonals of RᵀR, R having `rows` as its diagonals."""
    n = rows.shape[1]
    a, b, c = rows
    main = a**2
    main[:-1] += b[1:] ** 2
    main[:-2] += c[2:] ** 2
    first = a[1:] * b[1:]
    first[:-1] += b[2:] * c[2:]
    return [main, first, (a * c)[2:] if n > 2 else np.zeros(0)]
