"""Cholesky factors of sparse matrices that keep their pattern while their values change."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trueterrain.core.errors import TrueTerrainError

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


@dataclass(frozen=True, kw_only=True, eq=False)
class SparsePattern:
    """Where a symmetric matrix has elements, and an order of elimination with little fill-in."""

    order: Integers
    "Place of each unknown in the order of elimination, shape (n,)."

    pointers: Integers
    "First element of each column of the lower half, in that order, shape (n + 1,)."

    rows: Integers
    "Rows of these elements, ascending from the diagonal."

    begin: Integers
    "First element of each column of the factor, shape (n + 1,)."

    fill: Integers
    "Rows of the elements of the factor, ascending."

    slot: Integers
    "Element in which each of the places lies that the pattern was made of."

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.pointers.size - 1

    def sum(self, values: Floats) -> Floats:
        """Elements of the matrix from values at the last of the places it was made of.

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
        """Cholesky factor.

        Parameters
        ----------
        elements : numpy.ndarray
            Elements of the lower half.

        Returns
        -------
        Factor
            To solve with.

        Raises
        ------
        TrueTerrainError
            If the matrix is not positive definite.
        """
        from trueterrain.alignment.adjustment import _kernels

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
    """Cholesky factor of a matrix."""

    pattern: SparsePattern
    "Where its elements are."

    values: Floats
    "Its elements."

    @property
    def log_determinant(self) -> float:
        """Logarithm of the determinant of the matrix."""
        return 2.0 * float(np.log(self.values[self.pattern.begin[:-1]]).sum())

    def solve(self, right: Floats) -> Floats:
        """Solution for one right side, shape (n,)."""
        from trueterrain.alignment.adjustment import _kernels

        order = self.pattern.order
        x = np.empty(order.size)
        x[order] = right
        _kernels.solve_cholesky(self.pattern.begin, self.pattern.fill, self.values, x)
        return x[order]

    def whiten(self, values: Floats) -> Floats:
        """Values times the transposed factor.

        Of errors whose covariance is the inverse of the matrix that makes independent ones with
        variance 1.

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
        """Elements of the inverse where the factor has elements.

        Parameters
        ----------
        row, column : numpy.ndarray of int
            Unknowns, places of the pattern.

        Returns
        -------
        numpy.ndarray
            Elements of the inverse there.
        """
        from trueterrain.alignment.adjustment import _kernels

        pattern = self.pattern
        inverse = np.empty(pattern.fill.size)
        _kernels.selected_inverse(pattern.begin, pattern.fill, self.values, inverse)
        low, high = _lower_elements(pattern.order[row], pattern.order[column])
        keys = np.repeat(np.arange(pattern.size), np.diff(pattern.begin)) * pattern.size
        return inverse[np.searchsorted(keys + pattern.fill, high * pattern.size + low)]


def pattern_of(
    row: Integers, column: Integers, size: int, wide: Integers | None = None
) -> SparsePattern:
    """Pattern of a symmetric matrix.

    Parameters
    ----------
    row, column : numpy.ndarray of int, shape (place,)
        Places of elements, each in either half; the same place may come several times.
    size : int
        Number of unknowns.
    wide : numpy.ndarray of int, shape (n,), optional
        Unknowns that meet many others: each is eliminated as soon as all of these are.

    Returns
    -------
    Pattern
        With a diagonal everywhere.
    """
    from trueterrain.alignment.adjustment import _kernels

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
    """Place of each unknown in an order in which those that meet are close (Cuthill and McKee)."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import reverse_cuthill_mckee

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
