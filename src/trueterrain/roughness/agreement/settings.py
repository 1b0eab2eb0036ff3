"""Settings of a comparison of profiles: the filter, and the ranges of shift and distance error."""

from dataclasses import dataclass

import numpy as np

from trueterrain.roughness.filters import Butterworth, Filter
from trueterrain.roughness.settings import IriSettings, QuarterCarSettings

#: The filter of the International Roughness Index: 0.25 m moving average and golden car. The exact
#: window does not depend on the spacing, so that different profilers are compared by one filter.
IRI_FILTER = IriSettings(window="exact")

#: Band-pass from 8 m to 90 m, of the sixth order forward and backward together: cut-offs and order
#: are those that the scope of ASTM E950 names for airfields. Whether the standard applies it
#: backward as well was not checked.
AIRFIELD_FILTER = Butterworth(shortest=8.0, longest=90.0, order=3)

# [m] in which the transient of the golden car decays: exp(-2.59/s * 30 m / (80 km/h)) is 3 % of its
# amplitude, 0.1 % of its variance
_CAR_TRANSIENT = 30.0


@dataclass(frozen=True, kw_only=True)
class AgreementSettings:
    """Settings of a comparison of profiles; the defaults suit the International Roughness Index.

    Examples
    --------
    >>> AgreementSettings(filter=AIRFIELD_FILTER).transient_length  # [m]
    90.0
    >>> AgreementSettings(max_shift=-1)
    Traceback (most recent call last):
    ValueError: max_shift must be finite and at least 0 m, got -1
    """

    filter: QuarterCarSettings | Filter | None = IRI_FILTER
    """Filter applied before the comparison: a car (`IriSettings`: the slope whose mean magnitude is
    the IRI), a filter of `trueterrain.roughness.filters`, or None for the heights as they are."""

    transient: float | None = None
    """Length that is left out because of the transient of the filter [m]: after the start for a
    car, at both ends for other filters. By default 30 for a car, else the longest wave removed."""

    step: float | None = None
    "Spacing at which filtered profiles are compared [m]; by default the finer of the two."

    max_shift: float = 10.0
    "Maximum shift of stations in the search [m]."

    max_scale: float = 0.005
    "Maximum distance-measuring error in the search [m/m]; 0 for none."

    min_overlap: float = 20.0
    "Minimum length over which profiles are compared [m]: shorter ones agree by chance."

    align_starts: bool = False
    "Count stations from the start of each profile, as if all had begun at one place."

    def __post_init__(self) -> None:
        for name, value in (("transient", self.transient), ("max_shift", self.max_shift)):
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
    def transient_length(self) -> float:
        """Length that is left out because of the transient of the filter [m]."""
        if self.transient is not None:
            return self.transient
        if isinstance(self.filter, QuarterCarSettings):
            return _CAR_TRANSIENT
        if self.filter is None:
            return 0.0
        return self.filter.longest or self.filter.shortest or 0.0
