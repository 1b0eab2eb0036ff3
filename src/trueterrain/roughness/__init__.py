"""Roughness of profiles: indices, spectra and road classes, filters.

IRI, MRI and HRI, Ride Number, ISO 8608, root mean squares in bands of wavelength and the rolling
straightedge; `flag_profile` names implausible heights, which mostly come from a wrong unit.
"""

from trueterrain.roughness.filters import (
    FILTER_250_MM,
    Butterworth,
    Filter,
    MovingAverage,
    filter_profile,
)
from trueterrain.roughness.iri import IN_PER_MI, IriSettings, continuous_iri, iri
from trueterrain.roughness.iso8608 import CLASS_LIMITS, N0, road_class, smoothing_bands
from trueterrain.roughness.plausible import flag_profile
from trueterrain.roughness.psd import PsdSettings, psd
from trueterrain.roughness.quarter_car import IRI_SPEED, QuarterCar
from trueterrain.roughness.resample import resample_profile
from trueterrain.roughness.ride_number import RIDE_NUMBER_CAR, RideNumberSettings, ride_number
from trueterrain.roughness.settings import QuarterCarSettings
from trueterrain.roughness.straightedge import rolling_straightedge
from trueterrain.roughness.stretches import (
    LONG_CONTINUOUS,
    SHORT_CONTINUOUS,
    find_stretches,
    iri_histogram,
    localised_roughness,
)
from trueterrain.roughness.wavebands import WAVEBANDS, waveband_rms

__all__ = [
    "CLASS_LIMITS",
    "FILTER_250_MM",
    "IN_PER_MI",
    "IRI_SPEED",
    "LONG_CONTINUOUS",
    "N0",
    "RIDE_NUMBER_CAR",
    "SHORT_CONTINUOUS",
    "WAVEBANDS",
    "Butterworth",
    "Filter",
    "IriSettings",
    "MovingAverage",
    "PsdSettings",
    "QuarterCar",
    "QuarterCarSettings",
    "RideNumberSettings",
    "continuous_iri",
    "filter_profile",
    "find_stretches",
    "flag_profile",
    "iri",
    "iri_histogram",
    "localised_roughness",
    "psd",
    "resample_profile",
    "ride_number",
    "road_class",
    "rolling_straightedge",
    "smoothing_bands",
    "waveband_rms",
]
