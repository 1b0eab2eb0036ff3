"""Statistics of differences of height between two passes."""

from dataclasses import dataclass

import numpy.typing as npt

from trueterrain.surface.difference import HeightDifferences


@dataclass(frozen=True, kw_only=True)
class DifferenceSummary:
    """Statistics of differences of height between two passes."""

    n: int
    "Number of differences."

    median: float
    "Their median [m]."

    nmad: float
    "Normalised median absolute deviation: ``1.4826 median(|x - median(x)|)`` [m]."

    rmse: float
    "Their root mean square [m]."

    p95: float
    "95 % quantile of their absolute values [m]."

    @classmethod
    def of(cls, differences: npt.ArrayLike) -> "DifferenceSummary":
        """Statistics of differences.

        Parameters
        ----------
        differences : array_like
            Differences [m]; values that are not finite are ignored.

        Returns
        -------
        DifferenceSummary
            All NaN if there is no difference.

        Examples
        --------
        >>> DifferenceSummary.of([0.001, 0.003, 0.002, float("nan")])
        DifferenceSummary(n=3, median=0.002, nmad=0.0014826, rmse=0.0021602, p95=0.0029)
        """
        found = HeightDifferences.of(differences)
        return cls(n=found.n, median=found.median, nmad=found.nmad, rmse=found.rms, p95=found.p95)
