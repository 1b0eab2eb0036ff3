"""Statistics of differences of height between two passes."""

from dataclasses import dataclass

import numpy.typing as npt

from trueterrain.surface.difference import HeightDifferences


@dataclass(frozen=True, kw_only=True)
class DifferenceSummary:
    """Statistics of differences of height between two passes."""

    n: int
    "How many differences there are."

    median: float
    "Their median [m]."

    nmad: float
    "Their scatter: 1.4826 times the median of absolute deviations from the median [m]."

    rmse: float
    "Their root mean square [m]."

    p95: float
    "What 95 % of them do not exceed in size [m]."

    @classmethod
    def of(cls, differences: npt.ArrayLike) -> "DifferenceSummary":
        """Statistics of differences.

        Parameters
        ----------
        differences : array_like
            Differences [m]; such as are not finite do not count.

        Returns
        -------
        Agreement
            All NaN if there are none.

        Examples
        --------
        >>> Agreement.of([0.001, 0.003, 0.002, float("nan")])
        Agreement(n=3, median=0.002, nmad=0.0014826, rmse=0.0021602, p95=0.0029)
        """
        found = HeightDifferences.of(differences)
        return cls(n=found.n, median=found.median, nmad=found.nmad, rmse=found.rms, p95=found.p95)
