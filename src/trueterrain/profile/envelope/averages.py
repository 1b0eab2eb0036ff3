"""Averages of the ground: the bridge value of a line laser, the mean under a contact patch."""

from dataclasses import dataclass

import numpy as np

from trueterrain.profile.area import require_positive
from trueterrain.profile.distribution import HeightDistributions
from trueterrain.profile.envelope._strip import Float, GroundStrip
from trueterrain.profile.envelope.rigid import lines_amid_strips, lines_to_the_edges, require_width
from trueterrain.profile.envelope.tyres import PASSENGER_TYRE, TyreData
from trueterrain.profile.statistic import Window
from trueterrain.vehicle import contact_heights, contact_margin


@dataclass(frozen=True, kw_only=True)
class LineLaser:
    """Bridge value of a line laser: mean of a window of ranks of the heights across the path.

    Notes
    -----
    From the highest, `skip` is left out and the next `size` is averaged, as in `Window`, which also
    gives the standard deviation. Source: manuals of Gocator profile sensors (bridge value); AASHTO
    R 56 (scope read) names a line of about 4 in, 0.1 m, that gives a single bridged elevation.

    Examples
    --------
    >>> LineLaser(width=0.1, spots=5).offsets
    array([-0.05 , -0.025,  0.   ,  0.025,  0.05 ])
    """

    width: float = 0.1
    "Length of the line, across the path [m]."

    spots: int = 51
    "Number of heights on the line, ends included."

    skip: float = 15.0
    "Fraction of the highest heights that is left out [%]."

    size: float = 70.0
    "Fraction of the heights, below those, that is averaged [%]."

    def __post_init__(self) -> None:
        """Check the settings."""
        require_positive("width", self.width)
        require_width(self.width, self.spots, "spots")
        Window(skip=self.skip, size=self.size)

    @property
    def reach(self) -> float:
        """Longitudinal reach of the line [m]: none."""
        return 0.0

    @property
    def offsets(self) -> Float:
        """Offsets of the heights, left positive [m]."""
        return lines_to_the_edges(self.width, self.spots)

    def roll(self, strip: GroundStrip) -> dict[str, Float]:
        """Bridge value at each path point.

        Parameters
        ----------
        strip : GroundStrip
            Ground.

        Returns
        -------
        dict
            ``height`` and its ``sd`` [m].
        """
        heights = np.sort(strip.at_points().T, axis=1)  # NaN comes last
        known = np.isfinite(heights)
        finite = heights[known]
        distributions = HeightDistributions(
            start=np.append(0, np.cumsum(known.sum(axis=1))),
            heights=finite,
            distances=np.zeros_like(finite),
        )
        height, sd = Window(skip=self.skip, size=self.size).estimate(distributions)
        return {"height": height, "sd": sd}


@dataclass(frozen=True, kw_only=True)
class PatchMean:
    """Mean of the ground under a rectangle that moves with the wheel: a moving average.

    Without a width it is the moving average of a line, e.g. that of 250 mm. Exact for ground that
    is linear between samples along the path.

    Examples
    --------
    >>> PatchMean(width=0.1, lines=5).offsets
    array([-0.04, -0.02,  0.  ,  0.02,  0.04])
    """

    length: float = round(PASSENGER_TYRE.contact_length, 3)
    "Length of the patch along the path [m]."

    width: float = round(PASSENGER_TYRE.contact_width, 3)
    "Width of the patch [m]; 0 is a line."

    lines: int = 15
    "Number of lines across the width, at the centres of equal strips."

    def __post_init__(self) -> None:
        """Check the sizes."""
        require_positive("length", self.length)
        require_width(self.width, self.lines, "lines")

    @classmethod
    def of(cls, tyre: TyreData) -> "PatchMean":
        """Patch of a typical tyre.

        Parameters
        ----------
        tyre : TyreData
            Tyre.

        Returns
        -------
        PatchMean
            Its contact patch under its rated load.
        """
        return cls(length=tyre.contact_length, width=tyre.contact_width)

    @property
    def reach(self) -> float:
        """Longitudinal reach of the patch [m]."""
        return self.length / 2

    @property
    def offsets(self) -> Float:
        """Offsets of the lines, left positive [m]."""
        return lines_amid_strips(self.width, self.lines)

    def roll(self, strip: GroundStrip) -> dict[str, Float]:
        """Mean under the patch at each path point.

        Parameters
        ----------
        strip : GroundStrip
            Ground.

        Returns
        -------
        dict
            ``height`` [m]; missing samples are left out of the mean.
        """
        begin = strip.first - contact_margin(strip.step, self.length)
        end = begin + (strip.count - 1) * strip.stride + 1

        def mean(values: Float) -> Float:
            means = contact_heights(values.T, strip.step, self.length)
            return means[begin : end : strip.stride]

        known = np.isfinite(strip.height)
        if known.all():
            return {"height": mean(strip.height)}
        fraction = mean(known.astype(float))
        with np.errstate(invalid="ignore"):
            return {"height": mean(np.where(known, strip.height, 0.0)) / fraction}
