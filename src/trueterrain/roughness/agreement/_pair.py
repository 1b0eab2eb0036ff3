"""Two tracks, registered to each other."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from trueterrain.roughness.agreement._align import (
    SignalCorrelation,
    best_scale,
    best_shift,
    correlate_signals,
    refine_registration,
)
from trueterrain.roughness.agreement._signal import ProfileTrack, signal_of
from trueterrain.roughness.agreement.options import AgreementSettings


class RegisteredPair(NamedTuple):
    """A pair of tracks, registered."""

    plain: SignalCorrelation
    "How alike they are at the best shift."

    shift: float
    "The best shift [m]."

    corrected: SignalCorrelation
    "How alike they are at the best shift and scale; as `plain` if no scale was sought."

    corrected_shift: float
    "Shift at the start of the first, with that scale [m]."

    scale: float
    "Scale of the stations of the second [m/m]; NaN if it was not sought."

    rival: float | None
    "Another shift that is rated nearly as well [m]: the road is periodic; None if there is none."

    starts: tuple[float, float]
    "First stations of both that the filter leaves [m]; the scale counts from that of the first."

    @property
    def shift_back(self) -> float:
        """Corrected shift of the first against the second, at the second's first station [m]."""
        ahead = self.starts[1] - self.starts[0] - self.corrected_shift
        return -(self.corrected_shift + self.scale * ahead / (1 + self.scale))


def register_pair(
    first: ProfileTrack, second: ProfileTrack, options: AgreementSettings
) -> RegisteredPair:
    """Best shift of a pair, and best scale if it is sought."""
    step = options.step or min(first.spacing, second.spacing)
    one, other = signal_of(first, options, step), signal_of(second, options, step)
    starts = one.start, other.start
    shift, rival = best_shift(one, other, options)
    plain = correlate_signals(one, other, shift, 0.0)
    if options.max_scale == 0:
        return RegisteredPair(plain, shift, plain, shift, np.nan, rival, starts)
    found, coarse = best_scale(one, other, shift, options)
    # a filter works in metres: so the profile is scaled first, and filtered then
    origin = float(second.station[0])
    station = origin + (second.station - origin) / (1 + coarse)
    other = signal_of(replace(second, station=station), options, step)
    near = origin + (one.start + found - origin) / (1 + coarse) - one.start
    rest, fine = refine_registration(one, other, near, 0.0, options)
    corrected = correlate_signals(one, other, rest, fine)
    there = origin + (1 + coarse) * (one.start + rest - origin)
    scale = (1 + coarse) * (1 + fine) - 1
    return RegisteredPair(plain, shift, corrected, there - one.start, scale, rival, starts)
