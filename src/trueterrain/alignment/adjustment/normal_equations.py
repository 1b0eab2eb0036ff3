"""Normal equations of the adjustment, what is known before, and their solution."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trueterrain.alignment.adjustment.sparse_cholesky import CholeskyFactor
from trueterrain.alignment.adjustment.spline import GaussMarkovProcess

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class ComponentPrior:
    """What is known of one component before."""

    wander: GaussMarkovProcess
    "How it wanders."

    offset_sd: float
    "Standard deviation of its constant part [m] or [rad]; infinite for the height."


@dataclass(frozen=True, kw_only=True, eq=False)
class NormalEquations:
    """Normal equations of some cells."""

    blocks: Floats
    "Of pairs of intervals, shape (pair, 4 k, 4 k)."

    right: Floats
    "Right sides, shape (interval, 4 k)."

    square: float
    "Weighted sum of squares of heights less the mean of their cell."

    degrees_of_freedom: int
    "Entries less cells."

    def plus(self, other: "NormalEquations") -> "NormalEquations":
        """Equations with other cells as well."""
        return NormalEquations(
            blocks=self.blocks + other.blocks,
            right=self.right + other.right,
            square=self.square + other.square,
            degrees_of_freedom=self.degrees_of_freedom + other.degrees_of_freedom,
        )

    def less(self, other: "NormalEquations") -> "NormalEquations":
        """Equations without some of the cells."""
        return NormalEquations(
            blocks=self.blocks - other.blocks,
            right=self.right - other.right,
            square=self.square - other.square,
            degrees_of_freedom=self.degrees_of_freedom - other.degrees_of_freedom,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class PriorInformation:
    """What is known of all unknowns before."""

    elements: Floats
    "Elements of its normal matrix."

    log_determinant: float
    "Logarithm of the determinant of what is not free."


@dataclass(frozen=True, kw_only=True, eq=False)
class AdjustmentSolution:
    """Solved normal equations."""

    factor: CholeskyFactor
    "Cholesky factor of their matrix, the prior included."

    x: Floats
    "Unknowns."

    coefficients: Floats
    "Coefficients of each interval, offsets included, shape (interval, 4 k)."

    log_likelihood: float
    "Logarithm of the marginal likelihood of the data, up to a constant of the data."
