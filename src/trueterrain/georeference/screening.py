"""Screening of returns by intensity and range (thesis 3.6).

Ranges of a saturated receiver are wrong by millimetres, and returns near its noise floor are noisy.
Such returns are flagged: they are rejected, or weighted less than good ones.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Screening:
    """Limits of intensity and range, and the weight of flagged returns.

    Examples
    --------
    >>> Screening(floor=800.0, saturation=20000.0).weights(
    ...     np.array([[2.0, 2.0, np.nan]]), np.array([[900, 30000, 900]]))
    array([[1., 0., 0.]])
    """

    floor: float = 0.0
    "Intensity below which a return is flagged [counts]."

    saturation: float = math.inf
    "Intensity above which a return is flagged [counts]."

    nearest: float = 0.0
    "Range below which a return is not ground [m]; it is always rejected."

    furthest: float = math.inf
    "Range above which a return is not ground [m]; it is always rejected."

    weight: float = 0.0
    """Weight of a flagged return relative to a good one, from 0 (rejected) to 1 [1]; surfaces round
    it to sixteenths."""

    def __post_init__(self) -> None:
        """Check the values."""
        if not 0 <= self.floor < self.saturation:
            message = (
                "floor must be at least 0 and less than saturation, got "
                f"{self.floor} and {self.saturation}."
            )
            raise ValueError(message)
        if not 0 <= self.nearest < self.furthest:
            message = (
                "nearest must be at least 0 m and less than furthest, got "
                f"{self.nearest} and {self.furthest} m."
            )
            raise ValueError(message)
        if not 0 <= self.weight <= 1:
            message = f"weight must be from 0 to 1, got {self.weight}."
            raise ValueError(message)

    @property
    def needs_intensity(self) -> bool:
        """Whether the limits need intensities."""
        return self.floor > 0 or self.saturation < math.inf

    def flagged(self, intensity: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Whether returns are flagged.

        Parameters
        ----------
        intensity : array_like
            Intensities [counts].

        Returns
        -------
        numpy.ndarray of bool
            Of the same shape; an unknown intensity (NaN) is flagged.
        """
        values = np.asarray(intensity)
        return np.asarray(~((values >= self.floor) & (values <= self.saturation)))

    def weights(self, ranges: npt.ArrayLike, intensity: npt.ArrayLike | None = None) -> Floats:
        """Weights of returns.

        Parameters
        ----------
        ranges : array_like, shape (scan, beam)
            Ranges [m]; NaN where there was no return.
        intensity : array_like, shape (scan, beam), optional
            Intensities [counts].

        Returns
        -------
        numpy.ndarray
            1 for good returns, `weight` for flagged ones, 0 for missing or rejected ones.

        Raises
        ------
        ValueError
            If intensities are needed and not given.
        """
        ranges = np.asarray(ranges)
        weights = ((ranges >= self.nearest) & (ranges <= self.furthest)).astype(np.float64)
        if self.needs_intensity:
            if intensity is None:
                message = "floor and saturation need intensities, which were not recorded."
                raise ValueError(message)
            weights[self.flagged(intensity)] *= self.weight
        return weights
