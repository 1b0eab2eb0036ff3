"""What profiles are compared by: the filter before, and how far shift and distance are sought."""

from dataclasses import dataclass

import numpy as np

from trueterrain.roughness._track import IriSettings, QuarterCarSettings
from trueterrain.roughness.filters import Butterworth, Filter

#: The filter of the International Roughness Index: 0.25 m moving average and golden car. The exact
#: window is the same whatever the spacing, so that unlike profilers are compared by one filter.
IRI_FILTER = IriSettings(window="exact")

#: Band-pass from 8 m to 90 m, of the sixth order in both runs together: cut-offs and order are what
#: the scope of ASTM E950 names for airfields. Whether it runs back as well was not checked there.
AIRFIELD_FILTER = Butterworth(shortest=8.0, longest=90.0, order=3)

# [m] in which the golden car forgets how it started: exp(-2.59/s * 30 m / (80 km/h)) is 3 %, which
# is 0.1 % of the variance there
_SETTLING = 30.0


@dataclass(frozen=True, kw_only=True)
class AgreementSettings:
    """How two profiles are compared; the defaults suit the International Roughness Index.

    Examples
    --------
    >>> AgreementOptions(filter=AIRFIELD_FILTER).settled  # [m]
    90.0
    >>> AgreementOptions(max_shift=-1)
    Traceback (most recent call last):
    ValueError: max_shift must be finite and at least 0 m, got -1
    """

    filter: QuarterCarSettings | Filter | None = IRI_FILTER
    """What the profiles pass before they are compared: a car (`IriSettings`: the slope whose mean
    magnitude is the IRI), a filter of `trueterrain.roughness.filters`, or None for the heights as
    they are."""

    settle: float | None = None
    """Length that is left out because a filter has not settled [m]: behind the start for a car, at
    both ends for other filters. By default 30 for a car, else the longest wave that is cut."""

    step: float | None = None
    "Spacing at which filtered profiles are compared [m]; default the finer one of the two."

    max_shift: float = 10.0
    "Largest shift that is sought between the stations of two profiles [m]."

    max_scale: float = 0.005
    """Largest error of the measured distance that is sought, as a share of the distance [m/m]; 0
    leaves that search out."""

    min_overlap: float = 20.0
    "Least length over which profiles are compared [m]: shorter ones agree by chance."

    align_starts: bool = False
    "Count all stations from the start of each profile, as if all had begun at one place."

    def __post_init__(self) -> None:
        for name, value in (("settle", self.settle), ("max_shift", self.max_shift)):
            if value is not None and not (np.isfinite(value) and value >= 0):
                message = f"{name} must be finite and at least 0 m, got {value}"
                raise ValueError(message)
        for name, value in (("step", self.step), ("min_overlap", self.min_overlap)):
            if value is not None and not (np.isfinite(value) and value > 0):
                message = f"{name} must be finite and greater than 0 m, got {value}"
                raise ValueError(message)
        if not 0 <= self.max_scale <= 0.1:
            message = f"max_scale must be within 0 and 0.1 m/m, got {self.max_scale}"
            raise ValueError(message)

    @property
    def settled(self) -> float:
        """Length that is left out where the filter settles [m]."""
        if self.settle is not None:
            return self.settle
        if isinstance(self.filter, QuarterCarSettings):
            return _SETTLING
        if self.filter is None:
            return 0.0
        return self.filter.longest or self.filter.shortest or 0.0
