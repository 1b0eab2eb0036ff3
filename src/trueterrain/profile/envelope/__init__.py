"""Tyre envelopes: the effective road of a tyre model that rolls over the ground.

===================  ===========================================================================
`RigidDisc`          a rigid wheel that touches one point
`TandemCams`         rows of cams at the edges of the contact patch (MF-Swift)
`RadialSpringTyre`   springs under a tread band, deflected until they carry the load
`LineLaser`          the bridge value of a line across the path
`PatchMean`          the mean under the contact patch, a moving average
===================  ===========================================================================

Each has ``offsets``, the lateral offsets of the lines on which it needs the ground, a ``reach``
along the path, and ``roll(strip)``, which gives height and slope at each path point.
"""

from trueterrain.profile.envelope.along import Envelope, effective_road, tyre_envelope
from trueterrain.profile.envelope.averages import LineLaser, PatchMean
from trueterrain.profile.envelope.rigid import RigidDisc, TandemCams
from trueterrain.profile.envelope.springs import RadialSpringTyre
from trueterrain.profile.envelope.tyres import (
    PASSENGER_TYRE,
    TRUCK_TYRE,
    TyreData,
    TyreName,
    named_tyre,
)

__all__ = [
    "PASSENGER_TYRE",
    "TRUCK_TYRE",
    "Envelope",
    "LineLaser",
    "PatchMean",
    "RadialSpringTyre",
    "RigidDisc",
    "TandemCams",
    "TyreData",
    "TyreName",
    "effective_road",
    "named_tyre",
    "tyre_envelope",
]
