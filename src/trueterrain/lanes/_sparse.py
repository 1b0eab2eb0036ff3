"""Cholesky factors of sparse matrices that keep their pattern while their values change."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trueterrain.errors import TrueTerrainError

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Pattern:
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

    def factor(self, elements: Floats) -> "Factor":
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
        from trueterrain.lanes import _kernels

        values = np.empty(self.fill.size)
        failed = _kernels.factorise(
            self.pointers, self.rows, elements, self.begin, self.fill, values
        )
        if failed >= 0:
            raise TrueTerrainError(
                f"the normal equations are not positive definite (unknown {failed} of {self.size})",
                cure="Leave out components of the correction, or give stiffer priors.",
            )
        return Factor(pattern=self, values=values)


@dataclass(frozen=True, kw_only=True, eq=False)
class Factor:
    """Cholesky factor of a matrix."""

    pattern: Pattern
    "Where its elements are."

    values: Floats
    "Its elements."

    @property
    def log_determinant(self) -> float:
        """Logarithm of the determinant of the matrix."""
        return 2.0 * float(np.log(self.values[self.pattern.begin[:-1]]).sum())

    def solve(self, right: Floats) -> Floats:
        """Solution for one right side, shape (n,)."""
        from trueterrain.lanes import _kernels

        order = self.pattern.order
        x = np.empty(order.size)
        x[order] = right
        _kernels.solve(self.pattern.begin, self.pattern.fill, self.values, x)
        return x[order]

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
        from trueterrain.lanes import _kernels

        pattern = self.pattern
        inverse = np.empty(pattern.fill.size)
        _kernels.selected_inverse(pattern.begin, pattern.fill, self.values, inverse)
        low, high = _lower(pattern.order[row], pattern.order[column])
        keys = np.repeat(np.arange(pattern.size), np.diff(pattern.begin)) * pattern.size
        return inverse[np.searchsorted(keys + pattern.fill, high * pattern.size + low)]


def pattern_of(row: Integers, column: Integers, size: int) -> Pattern:
    """Pattern of a symmetric matrix.

    Parameters
    ----------
    row, column : numpy.ndarray of int, shape (place,)
        Places of elements, each in either half; the same place may come several times.
    size : int
        Number of unknowns.

    Returns
    -------
    Pattern
        With a diagonal everywhere.
    """
    from trueterrain.lanes import _kernels

    order = _order(row, column, size)
    low, high = _lower(order[row], order[column])
    keys = high * size + low
    diagonal = np.arange(size, dtype=np.int64) * (size + 1)
    elements = np.unique(np.concatenate([keys, diagonal]))
    rows = elements % size
    pointers = np.searchsorted(elements // size, np.arange(size + 1)).astype(np.int64)
    begin, fill = _kernels.symbolic(pointers, rows)
    slot = np.searchsorted(elements, keys).astype(np.int64)
    return Pattern(
        order=order, pointers=pointers, rows=rows, begin=begin, fill=fill, slot=slot
    )  # fmt: skip


def _lower(one: Integers, two: Integers) -> tuple[Integers, Integers]:
    """Row and column of elements in the lower half."""
    return np.maximum(one, two), np.minimum(one, two)


def _order(row: Integers, column: Integers, size: int) -> Integers:
    """Place of each unknown in an order of least degree, as SuperLU finds it."""
    from scipy.sparse import coo_array, csc_array, identity
    from scipy.sparse.linalg import splu

    half = coo_array((np.full(row.size, 1e-9), (row, column)), shape=(size, size))
    whole = csc_array(half + half.T + identity(size, format="coo"))
    whole.sum_duplicates()
    whole.data[:] = 1e-9  # only the pattern counts: a matrix that is nearly the unit matrix
    whole.setdiag(1.0)
    found = splu(
        whole.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )  # fmt: skip
    # SuperLU's permutation is that of the columns: column k goes to place perm_c[k]
    return np.asarray(found.perm_c, dtype=np.int64)
