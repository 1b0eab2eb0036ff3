"""Statistics of rank: median, percentile, and the mean of a window of ranks."""

from dataclasses import dataclass

import numpy as np

from trueterrain.profile.distribution import (
    NEXT_STEP,
    SAME_STEP,
    Float,
    HeightDistributions,
)
from trueterrain.profile.statistic import _kernels

_MIN_RESOLUTION = 1e-9  # [m] resolution of doubles at thousands of metres


@dataclass(frozen=True, kw_only=True)
class Percentile:
    """Percentile: height that a given fraction of the heights does not exceed.

    Linear between order statistics, as in ``numpy.percentile``. The standard deviation is that of
    Maritz and Jarrett (1978, JASA 73): the order statistics weighted with the beta distribution of
    the rank of the quantile, the exact bootstrap. Simulated with 15 to 80 heights, rms(error / sd)
    of the median is 1.00 to 1.06, of a percentile with 3 heights beyond it up to 1.14; with less
    than 2 heights beyond it, the standard deviation is much too small.

    The standard deviation of quantised heights is half of Woodruff's interval (1952, JASA 47) in
    the interpolated CPF; if a fraction q of the heights lies in the step of the percentile, it also
    contains q^2 times the uncertainty within one step. Its rms(error / sd) is 0.6 to 1.5.
    """

    percent: float
    "Fraction of the heights [%], 0 the lowest, 100 the highest."

    resolution: float | None = None
    "Step of quantised heights [m], between which the CPF is interpolated; None if not quantised."

    def __post_init__(self) -> None:
        """Check the settings."""
        if not 0 <= self.percent <= 100:
            message = f"percent must be from 0 to 100, got {self.percent}."
            raise ValueError(message)
        if self.resolution is not None and not _MIN_RESOLUTION <= self.resolution < float("inf"):
            message = (
                f"resolution must be finite and at least {_MIN_RESOLUTION:g} m, "
                f"got {self.resolution}."
            )
            raise ValueError(message)

    def estimate(self, distributions: HeightDistributions) -> tuple[Float, Float]:
        """Percentile of each path point and its standard deviation.

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
        >>> heights = np.array([0.0, 1.0, 2.0, 9.0])
        >>> one = HeightDistributions(start=np.array([0, 4]), heights=heights, distances=heights)
        >>> Percentile(percent=50).estimate(one)[0]
        array([1.5])
        """
        probability = self.percent / 100
        start, heights = distributions.start, distributions.heights
        if self.resolution is not None:
            settings = self.resolution, SAME_STEP, NEXT_STEP
            height, sd = _kernels.continued_quantile(start, heights, probability, *settings)
        else:
            weights, begin = _maritz_jarrett(np.unique(distributions.count), probability)
            height, sd = _kernels.area_quantile(start, heights, probability, weights, begin)
        return height, sd


@dataclass(frozen=True, kw_only=True)
class Median:
    """Median of the heights: the thesis's statistic.

    Its standard deviation is that of `Percentile`.
    """

    resolution: float | None = None
    "Step of quantised heights [m], between which the CPF is interpolated; None if not quantised."

    def __post_init__(self) -> None:
        """Check the settings."""
        Percentile(percent=50, resolution=self.resolution)

    def estimate(self, distributions: HeightDistributions) -> tuple[Float, Float]:
        """Median of each path point and its standard deviation.

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
        >>> heights = np.array([0.0, 1.0, 9.0])
        >>> one = HeightDistributions(start=np.array([0, 3]), heights=heights, distances=heights)
        >>> Median().estimate(one)[0]
        array([1.])
        """
        return Percentile(percent=50, resolution=self.resolution).estimate(distributions)


@dataclass(frozen=True, kw_only=True)
class Window:
    """Mean of a window of ranks: leave out a fraction of the highest, average the next fraction.

    With 0 < skip this is the bridge value of line lasers, with skip = (100 - size) / 2 the trimmed
    mean. A height at the edge of the window counts with the part of its rank that lies inside. The
    standard deviation is that of the winsorised heights over the fraction of the window (Tukey and
    McLaughlin 1963, Sankhya 25), also for asymmetric windows. For it, a window narrower than four
    standard deviations of a rank is widened to those. Simulated with 15 to 80 heights,
    rms(error / sd) is 1.00 to 1.05 for the default window and up to 1.2 for a narrow central one; a
    window that ends at the highest or lowest height needs some twenty heights in it.
    """

    skip: float = 15.0
    "Fraction of the highest heights that is left out [%]."

    size: float = 70.0
    "Fraction of the heights, below those, that is averaged [%]."

    def __post_init__(self) -> None:
        """Check the settings."""
        if not (self.skip >= 0 and self.size > 0 and self.skip + self.size <= 100):
            message = (
                "skip must be at least 0 %, size greater than 0 % and both at most 100 % together, "
                f"got {self.skip} and {self.size}."
            )
            raise ValueError(message)

    def estimate(self, distributions: HeightDistributions) -> tuple[Float, Float]:
        """Windowed mean of each path point and its standard deviation.

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
        >>> heights = np.array([0.0, 1.0, 3.0, 9.0])
        >>> one = HeightDistributions(start=np.array([0, 4]), heights=heights, distances=heights)
        >>> Window(skip=25, size=50).estimate(one)[0]
        array([2.])
        """
        high = 1 - self.skip / 100
        low = max(high - self.size / 100, 0.0)
        height, sd = _kernels.area_window(distributions.start, distributions.heights, low, high)
        return height, sd


def _maritz_jarrett(counts: np.ndarray, probability: float) -> tuple[Float, np.ndarray]:
    """Weights of the order statistics for each count, one after the other, and where they begin."""
    from scipy.special import betainc

    inner = min(max(probability, 1e-12), 1 - 1e-12)  # the beta distribution needs both shapes > 0
    begin = np.zeros(int(counts.max(initial=0)) + 1, np.int64)
    begin[counts] = np.concatenate([[0], np.cumsum(counts)[:-1]]) if counts.size else 0
    weights = [
        np.diff(betainc(inner * (n + 1), (1 - inner) * (n + 1), np.arange(n + 1) / n))
        for n in counts
        if n > 0
    ]
    return np.concatenate([np.empty(0), *weights]), begin
