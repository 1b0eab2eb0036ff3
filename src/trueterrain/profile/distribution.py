"""Distributions of the heights inside search areas: the CPF of each path point (thesis 5.2.3).

The cumulative probability function F(h) is the fraction of heights that do not exceed h, a step
function. For heights quantised to a step (1 mm in the thesis) it is interpolated by PCHIP (thesis
5.3, Fig. 5-7): a height recorded as h lies within half a step of h, so F is known at both edges of
every occupied step, and PCHIP keeps it monotonic in between.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

#: Heights that differ by less than this fraction of a step were recorded in the same step.
SAME_STEP = 1e-6

#: Neighbouring heights farther apart than this number of steps have an empty step between them.
NEXT_STEP = 1.01

Float = npt.NDArray[np.float64]
Integer = npt.NDArray[np.int64]


@dataclass(frozen=True, kw_only=True, eq=False)
class HeightDistribution:
    """Heights inside the search area of one path point."""

    heights: Float
    "Heights in ascending order, shape (n,) [m]."

    distances: Float
    "Horizontal distances from the path point, shape (n,) [m]."

    def cpf(self, height: npt.ArrayLike) -> Float:
        """Cumulative probability: fraction of the heights that do not exceed `height`.

        Parameters
        ----------
        height : array_like
            Heights at which to evaluate [m].

        Returns
        -------
        numpy.ndarray
            Values from 0 to 1, in the shape of `height`; NaN if there are no heights.

        Examples
        --------
        >>> one = HeightDistribution(heights=np.array([0.0, 0.0, 0.2]), distances=np.zeros(3))
        >>> one.cpf([-0.1, 0.0, 0.2])
        array([0.    , 0.6667, 1.    ])
        """
        rank = np.searchsorted(self.heights, height, side="right")
        return np.asarray(rank / (self.heights.size or np.nan), dtype=float)

    def steps(self, resolution: float) -> tuple[Float, Float]:
        """Edges of the occupied steps of quantised heights and the CPF there.

        Parameters
        ----------
        resolution : float
            Step of the quantised heights [m].

        Returns
        -------
        heights : numpy.ndarray, shape (m,)
            Edges in ascending order, half a step below and above each recorded height [m]; the
            common edge of two neighbouring steps once.
        probabilities : numpy.ndarray, shape (m,)
            CPF at these edges, from 0 to 1; equal at both edges of an empty step.

        Raises
        ------
        ValueError
            If the resolution is not greater than 0.
        """
        if not resolution > 0:
            message = f"resolution must be greater than 0 m, got {resolution}."
            raise ValueError(message)
        if not self.heights.size:
            return np.empty(0), np.empty(0)
        begins = [0]  # first index of the heights recorded in each step
        while begins[-1] < self.heights.size:
            same = self.heights[begins[-1]] + SAME_STEP * resolution
            begins.append(int(np.searchsorted(self.heights, same, side="right")))
        recorded = self.heights[begins[:-1]]
        probability = np.array(begins[1:-1]) / self.heights.size
        apart = np.diff(recorded) > NEXT_STEP * resolution
        midpoint = 0.5 * (recorded[:-1] + recorded[1:])
        # neighbouring steps have one common edge; an empty step between them has two edges, at
        # which the CPF is equal
        upper = np.where(apart, recorded[:-1] + 0.5 * resolution, midpoint)
        inner = np.stack([upper, recorded[1:] - 0.5 * resolution], axis=-1)
        used = np.stack([np.ones_like(apart), apart], axis=-1)
        ends = recorded[[0, -1]] + np.array([-0.5, 0.5]) * resolution
        return (
            np.concatenate([ends[:1], inner[used], ends[1:]]),
            np.concatenate([[0.0], np.stack([probability] * 2, axis=-1)[used], [1.0]]),
        )

    def continued_cpf(self, height: npt.ArrayLike, resolution: float) -> Float:
        """CPF of quantised heights, interpolated between the steps by PCHIP (thesis Fig. 5-7).

        Parameters
        ----------
        height : array_like
            Heights at which to evaluate [m].
        resolution : float
            Step of the quantised heights [m].

        Returns
        -------
        numpy.ndarray
            Values from 0 to 1, in the shape of `height`; NaN if there are no heights.

        Raises
        ------
        ValueError
            If the resolution is not greater than 0.

        Examples
        --------
        >>> one = HeightDistribution(heights=np.array([1e-3, 2e-3]), distances=np.zeros(2))
        >>> one.continued_cpf(1.5e-3, resolution=1e-3)
        array(0.5)
        """
        from scipy.interpolate import PchipInterpolator

        edges, probabilities = self.steps(resolution)
        if not edges.size:
            return np.full(np.shape(height), np.nan)
        inside = np.clip(height, edges[0], edges[-1])
        return np.asarray(np.clip(PchipInterpolator(edges, probabilities)(inside), 0.0, 1.0))


@dataclass(frozen=True, kw_only=True, eq=False)
class HeightDistributions:
    """Heights inside the search areas of many path points, one slice of the arrays each."""

    start: Integer
    "First index of the slice of each path point, then the end of the last, shape (s + 1,)."

    heights: Float
    "Heights, ascending within each slice, shape (start[-1],) [m]."

    distances: Float
    "Horizontal distances from the path point, shape (start[-1],) [m]."

    @property
    def count(self) -> Integer:
        """Number of heights of each path point, shape (s,)."""
        return np.diff(self.start)

    def __len__(self) -> int:
        return self.start.size - 1

    def __getitem__(self, index: int) -> HeightDistribution:
        index = range(len(self))[index]  # negative indices and IndexError as of a sequence
        cut = slice(self.start[index], self.start[index + 1])
        return HeightDistribution(heights=self.heights[cut], distances=self.distances[cut])

    def __iter__(self) -> Iterator[HeightDistribution]:
        return (self[index] for index in range(len(self)))
