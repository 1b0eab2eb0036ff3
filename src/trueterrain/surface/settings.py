"""Settings of gridding, shared by points and recorded runs."""

from dataclasses import dataclass
from typing import Literal, get_args

from trueterrain.surface.accumulate import KeptSums

Statistic = Literal["mean", "minimum", "maximum", "median", "percentile"]


@dataclass(frozen=True, kw_only=True)
class GridSettings:
    """Settings of gridding: statistic of the heights in a cell, search disc, and noise."""

    statistic: Statistic = "mean"
    "Height of a node: mean, minimum, maximum, median or percentile of the heights in its cell."

    percent: float = 50.0
    "Percentile that is taken [%]."

    level: bool = True
    "Whether a mean is reduced along the slope from the mean position of the returns to the node."

    radius: float = 0.0
    """Radius of the disc around a node [m]: the height is the mean over the cells whose centre lies
    in it, reduced along their slope to the node. 0 for the cell of the node alone."""

    power: float = 0.0
    """Power of the inverse distance from the node that weights the returns of a disc; 0 for equal
    weights [1]."""

    min_count: int = 1
    "Cells with fewer returns have no height."

    range_noise: float = 0.0
    """Standard deviation of a return without that of its motion [m]; where the scatter within cells
    is greater, that is used."""

    agreed: bool = False
    """Whether passes were brought into agreement: errors of their motion then are common to all,
    otherwise independent."""

    def __post_init__(self) -> None:
        """Check the values."""
        if self.statistic not in get_args(Statistic):
            message = (
                f"statistic must be one of {', '.join(get_args(Statistic))}, got "
                f"{self.statistic!r}."
            )
            raise ValueError(message)
        if not 0 < self.percent < 100:
            message = f"percent must be greater than 0 % and less than 100 %, got {self.percent}."
            raise ValueError(message)
        if not (self.radius >= 0 and self.power >= 0):
            message = (
                "radius must be at least 0 m and power at least 0, got "
                f"{self.radius} m and {self.power}."
            )
            raise ValueError(message)
        if self.radius and self.statistic != "mean":
            message = f"radius goes with the mean, got the statistic {self.statistic}."
            raise ValueError(message)
        if self.power and not self.radius:
            message = "power needs a radius, which is 0 m."
            raise ValueError(message)
        if self.min_count < 1:
            message = f"min_count must be at least 1, got {self.min_count}."
            raise ValueError(message)
        if not self.range_noise >= 0:
            message = f"range_noise must be at least 0 m, got {self.range_noise}."
            raise ValueError(message)

    def kept_sums(self, *, point_sd: bool = False) -> KeptSums:
        """Sums over returns that the statistic needs.

        Parameters
        ----------
        point_sd : bool
            Whether points have a standard deviation of their own.

        Returns
        -------
        KeptSums
            For `CellSums`.
        """
        return KeptSums(
            extremes=self.statistic in ("minimum", "maximum"),
            places=self.statistic == "mean" and self.level,
            point_sd=point_sd,
            agreed=self.agreed,
        )

    @property
    def fraction(self) -> float | None:
        """Fraction of the heights below a median or percentile [1]; None for other statistics."""
        if self.statistic == "median":
            return 0.5
        return 0.01 * self.percent if self.statistic == "percentile" else None
