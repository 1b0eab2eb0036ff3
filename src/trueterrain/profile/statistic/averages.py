"""Averages: the mean, and mean or median weighted by inverse distance."""

from dataclasses import dataclass
from typing import Literal

from trueterrain.profile.distribution import Float, HeightDistributions
from trueterrain.profile.statistic import _kernels
from trueterrain.profile.statistic.ranks import Median


@dataclass(frozen=True, kw_only=True)
class Mean:
    """Mean of the heights.

    Its standard deviation is s / sqrt(n). Simulated with 15 to 80 heights, rms(error / sd) is 1.00
    to 1.08, to 1.14 if they are skewed.
    """

    def estimate(self, distributions: HeightDistributions) -> tuple[Float, Float]:
        """Mean of each path point and its standard deviation.

        Parameters
        ----------
        distributions : HeightDistributions
            Heights inside the search areas.

        Returns
        -------
        height, sd : numpy.ndarray, shape (s,)
            Heights and their standard deviations [m].

        Examples
        --------
        >>> import numpy as np
        >>> heights = np.array([1.0, 2.0, 6.0])
        >>> one = HeightDistributions(start=np.array([0, 3]), heights=heights, distances=heights)
        >>> Mean().estimate(one)[0]
        array([3.])
        """
        height, sd = _kernels.area_mean(distributions.start, distributions.heights)
        return height, sd


@dataclass(frozen=True, kw_only=True)
class InverseDistance:
    """Mean or median of the heights, weighted by a power of the inverse distance.

    The weight is constant within the core, so that a node that happens to lie on the path does not
    outweigh all others. The standard deviation is that of the plain mean or median, times the root
    of n over the effective number of heights (sum w)^2 / sum w^2: the scatter is taken as equal at
    all distances and estimated from all heights. Simulated with 15 to 80 heights, rms(error / sd)
    is 0.96 to 1.07; on Belgian block, where neighbouring heights are correlated, 0.6.
    """

    power: float = 2.0
    "Power of the distance; with 0 all weights are equal."

    of: Literal["mean", "median"] = "mean"
    "Statistic that is weighted."

    core: float = 0.005
    "Distance below which the weight is constant [m]."

    def __post_init__(self) -> None:
        """Check the settings."""
        if not 0 <= self.power < float("inf"):
            message = f"power must be at least 0, got {self.power}."
            raise ValueError(message)
        if not 0 < self.core < float("inf"):
            message = f"core must be greater than 0 m, got {self.core}."
            raise ValueError(message)
        if self.of not in ("mean", "median"):
            message = f"of must be 'mean' or 'median', got {self.of!r}."
            raise ValueError(message)

    def estimate(self, distributions: HeightDistributions) -> tuple[Float, Float]:
        """Weighted mean or median of each path point and its standard deviation.

        Parameters
        ----------
        distributions : HeightDistributions
            Heights inside the search areas.

        Returns
        -------
        height, sd : numpy.ndarray, shape (s,)
            Heights and their standard deviations [m].

        Examples
        --------
        >>> import numpy as np
        >>> one = HeightDistributions(start=np.array([0, 2]), heights=np.array([0.0, 1.0]),
        ...                           distances=np.array([0.01, 0.02]))
        >>> InverseDistance(power=1).estimate(one)[0]
        array([0.3333])
        """
        plain, kernel = (
            (Mean(), _kernels.weighted_mean)
            if self.of == "mean"
            else (Median(), _kernels.weighted_median)
        )
        height, growth = kernel(
            distributions.start,
            distributions.heights,
            distributions.distances,
            float(self.power),
            self.core,
        )
        return height, growth * plain.estimate(distributions)[1]
