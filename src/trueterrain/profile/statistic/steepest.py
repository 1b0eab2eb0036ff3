"""Height where the CPF is steepest, the mode of the heights (future work of the thesis, 5.3)."""

from dataclasses import dataclass

from trueterrain.profile.distribution import Float, HeightDistributions
from trueterrain.profile.statistic import _kernels

#: Points per bandwidth at which the density is evaluated before its maxima are refined.
_STEPS = 8

#: Modes whose densities differ by less than this fraction are equally high, despite round-off.
_TIE = 1e-9


@dataclass(frozen=True, kw_only=True)
class SteepestCpf:
    """Height where the smoothed CPF is steepest.

    The slope of the CPF is the density of heights, estimated with a triweight kernel: smooth enough
    for a unique maximum and of finite width. The height is the highest mode, found to round-off. Of
    modes equally high within 1e-9, the one nearest to the median is taken, of two equally near ones
    the lower.

    The standard deviation is that of an M-estimator (the root of the summed squared influences over
    the curvature at the mode); asymptotically it is that of Parzen (1962, Ann. Math. Statist. 33).
    The curvature is estimated with a wider bandwidth, since the curvature at an estimated mode is
    biased upward. Simulated with 15 to 80 heights of one clear mode, rms(error / sd) is 0.90 to
    1.08; with half of the default bandwidth up to 1.4. It contains neither the bias of smoothing a
    skewed density (0.2 to 0.3 standard deviations of a gamma density of shape 3) nor the risk of
    choosing the wrong one of two modes: on Belgian block with its joints, rms(error / sd) is 1.7.
    It is at most that of a single height.
    """

    bandwidth: float | None = None
    "Half width of the kernel [m]; by default 2.88 sd n^(-1/7), the rule for a normal density."

    min_bandwidth: float = 0.0005
    "Lower bound of the default bandwidth, about the noise of one height [m]."

    def __post_init__(self) -> None:
        """Check the settings."""
        for name in ("bandwidth", "min_bandwidth"):
            value = getattr(self, name)
            if value is not None and not 0 < value < float("inf"):
                message = f"{name} must be greater than 0 m, got {value}."
                raise ValueError(message)

    def estimate(self, distributions: HeightDistributions) -> tuple[Float, Float]:
        """Mode of each path point and its standard deviation.

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
        >>> heights = np.array([0.0, 0.0, 0.0, 0.02, 0.05])  # a plane with a stone on it
        >>> one = HeightDistributions(start=np.array([0, 5]), heights=heights, distances=heights)
        >>> SteepestCpf(bandwidth=0.01).estimate(one)[0].round(9)
        array([0.])
        """
        height, sd, _ = self._modes(distributions)
        return height, sd

    def bandwidths(self, distributions: HeightDistributions) -> Float:
        """Bandwidth used at each path point.

        Parameters
        ----------
        distributions : HeightDistributions
            Heights inside the search areas.

        Returns
        -------
        numpy.ndarray, shape (s,)
            Half widths of the kernel [m].
        """
        return self._modes(distributions)[2]

    def _modes(self, distributions: HeightDistributions) -> tuple[Float, Float, Float]:
        height, sd, used = _kernels.area_steepest(
            distributions.start,
            distributions.heights,
            self.bandwidth or 0.0,
            self.min_bandwidth,
            _STEPS,
            _TIE,
        )
        return height, sd, used
