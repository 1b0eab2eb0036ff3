"""Sparse Cholesky factorisation for matrices of constant pattern and changing values."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array
from scipy.sparse.csgraph import reverse_cuthill_mckee

from trueterrain.alignment.adjustment.cholesky import _kernels
from trueterrain.core.errors import TrueTerrainError

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


@dataclass(frozen=True, kw_only=True, eq=False)
class SparsePattern:
    """Pattern of a sparse symmetric matrix, with an order of elimination of little fill-in."""

    order: Integers
    "Position of each unknown in the order of elimination, shape (n,)."

    pointers: Integers
    "First element of each column of the lower half, in that order, shape (n + 1,)."

    rows: Integers
    "Rows of these elements, ascending from the diagonal."

    begin: Integers
    "First element of each column of the factor, shape (n + 1,)."

    fill: Integers
    "Rows of the elements of the factor, ascending."

    slot: Integers
    "Element of each of the places from which the pattern was made."

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.pointers.size - 1

    def sum(self, values: Floats) -> Floats:
        """Sum values at the last of its places to elements of the matrix.

        Parameters
        ----------
        values : numpy.ndarray, shape (m,)
            Values at the last m places; those of the same element add up.

        Returns
        -------
        numpy.ndarray
            Elements of the lower half.
        """
        elements = np.zeros(self.rows.size)
        np.add.at(elements, self.slot[self.slot.size - values.size :], values)
        return elements

    def factor(self, elements: Floats) -> "CholeskyFactor":
        """Factorise a matrix of this pattern.

        Parameters
        ----------
        elements : numpy.ndarray
            Elements of the lower half.

        Returns
        -------
        CholeskyFactor
            Factor L with L Lᵀ equal to the matrix.

        Raises
        ------
        TrueTerrainError
            If the matrix is not positive definite.
        """
        values = np.empty(self.fill.size)
        failed = _kernels.factorise_cholesky(
            self.pointers, self.rows, elements, self.begin, self.fill, values
        )
        if failed >= 0:
            raise TrueTerrainError(
                f"the normal equations are not positive definite (unknown {failed} of {self.size})",
                cure="Leave out components of the correction, or give stiffer priors.",
            )
        return CholeskyFactor(pattern=self, values=values)


@dataclass(frozen=True, kw_only=True, eq=False)
class CholeskyFactor:
    """Cholesky factor L of a sparse matrix."""

    pattern: SparsePattern
    "Pattern of the matrix."

    values: Floats
    "Elements of the factor."

    @property
    def log_determinant(self) -> float:
        """Logarithm of the determinant of the matrix."""
        return 2.0 * float(np.log(self.values[self.pattern.begin[:-1]]).sum())

    def solve(self, right: Floats) -> Floats:
        """Solution for one right side, shape (n,)."""
        order = self.pattern.order
        x = np.empty(order.size)
        x[order] = right
        _kernels.solve_cholesky(self.pattern.begin, self.pattern.fill, self.values, x)
        return x[order]

    def whiten(self, values: Floats) -> Floats:
        """Multiply by the transposed factor: Lᵀ x.

        Errors whose covariance is the inverse of the matrix become independent, of variance 1.

        Parameters
        ----------
        values : numpy.ndarray, shape (n,)
            Values of the unknowns.

        Returns
        -------
        numpy.ndarray, shape (n,)
            In the order of elimination.
        """
        ordered = np.empty(values.size)
        ordered[self.pattern.order] = values
        return np.add.reduceat(self.values * ordered[self.pattern.fill], self.pattern.begin[:-1])

    def inverse_at(self, row: Integers, column: Integers) -> Floats:
        """Elements of the inverse within the pattern of the factor.

        Parameters
        ----------
        row, column : numpy.ndarray of int
            Unknowns, at places of the pattern.

        Returns
        -------
        numpy.ndarray
            Elements of the inverse.
        """
        pattern = self.pattern
        inverse = np.empty(pattern.fill.size)
        _kernels.selected_inverse(pattern.begin, pattern.fill, self.values, inverse)
        low, high = _lower_elements(pattern.order[row], pattern.order[column])
        keys = np.repeat(np.arange(pattern.size), np.diff(pattern.begin)) * pattern.size
        return inverse[np.searchsorted(keys + pattern.fill, high * pattern.size + low)]


def pattern_of(
    row: Integers, column: Integers, size: int, wide: Integers | None = None
) -> SparsePattern:
    """Find the pattern of a symmetric matrix and of its factor.

    Parameters
    ----------
    row, column : numpy.ndarray of int, shape (place,)
        Places of elements in either half, which may repeat.
    size : int
        Number of unknowns.
    wide : numpy.ndarray of int, shape (n,), optional
        Unknowns connected to many others: each is eliminated after all of these.

    Returns
    -------
    SparsePattern
        With a full diagonal.
    """
    pointers, low, first = _kernels.compress_pattern(row, column, size)
    high = np.repeat(np.arange(size), np.diff(pointers))
    order = _elimination_order(low, high, size, np.zeros(0, np.int64) if wide is None else wide)
    pointers, rows, second = _kernels.compress_pattern(order[low], order[high], size)
    begin, fill = _kernels.symbolic_cholesky(pointers, rows)
    return SparsePattern(
        order=order, pointers=pointers, rows=rows, begin=begin, fill=fill, slot=second[first]
    )


def _lower_elements(one: Integers, two: Integers) -> tuple[Integers, Integers]:
    """Row and column of elements in the lower half."""
    return np.maximum(one, two), np.minimum(one, two)


def _elimination_order(row: Integers, column: Integers, size: int, wide: Integers) -> Integers:
    """Order of elimination by reverse Cuthill-McKee; wide unknowns follow their neighbours."""
    broad = np.zeros(size, bool)
    broad[wide] = True
    plain = ~(broad[row] | broad[column])
    half = csr_array((np.ones(int(plain.sum())), (row[plain], column[plain])), shape=(size, size))
    place = np.empty(size)
    place[reverse_cuthill_mckee(csr_array(half + half.T), symmetric_mode=True)] = np.arange(size)
    reach = np.full(size, -1.0)
    for one, other in ((row, column), (column, row)):
        mixed = broad[one] & ~broad[other]
        np.maximum.at(reach, one[mixed], place[other[mixed]])
    place[wide] = reach[wide] + 0.5
    order = np.empty(size, np.int64)
    order[np.argsort(place, kind="stable")] = np.arange(size)
    return order
