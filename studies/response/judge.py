"""Drive two vehicles over every reduction of a road, and compare each with the reference."""

from dataclasses import dataclass

import numpy as np
import xarray as xr

from reductions import CAR, Reduce, reductions, reference
from roads import OFFSETS, Course
from spectra import DRAWN, REFERENCE, Which, densities
from trueterrain.core.schemas import make_profile
from trueterrain.profile import PlaneCurve
from trueterrain.roughness import iri
from trueterrain.verify.response import QUANTITIES, compare_responses, vehicle_response

QUARTER = CAR.corner("front")
WEIGHT = 9.81 * (QUARTER.sprung_mass + QUARTER.unsprung_mass)  # [N]
LEAD = 1.5  # [s] of the transient of the vehicle, left out of the comparison
OTHER_TYRE = "envelope on the surface", "tandem cams"  # a reference of another kind

Strips = list[tuple[xr.Dataset, PlaneCurve]]


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """Comparison of the response on a reduction with that on the reference."""

    group: str
    name: str
    quarter: xr.Dataset
    full: xr.Dataset
    otherwise: xr.Dataset
    "Quarter car, but compared with tandem cams on the surface."
    iri: float
    "MRI of the two wheel paths over that of the reference."


@dataclass(frozen=True, kw_only=True)
class Judged:
    """Results of a road: the response on the reference, and the comparison of each reduction."""

    course: str
    rms: dict[str, float]
    "Of each quantity, of the quarter car on the reference."
    off_the_ground: float
    "Fraction of the time in which the force of the linear tyre is tensile."
    mri: float
    "Of the reference [m/km]."
    spectra: dict[Which, xr.Dataset]
    "Densities of the quarter car's response, on the reference and on what the figure shows."
    verdicts: list[Verdict]


def judge(course: Course) -> Judged:
    """Drive over one road."""
    strips, speed = course.strips(), course.speed / 3.6
    lead = LEAD * speed

    def drive(profile: xr.Dataset) -> tuple[xr.Dataset, xr.Dataset]:
        quarter = vehicle_response(profile, QUARTER, speed=speed, lead=lead)
        return quarter, vehicle_response(profile, CAR, speed=speed, lead=lead)

    truth = _reduced(strips, reference)
    true_quarter, true_full = drive(truth)
    mri = float(iri(truth).mri)
    found = [(one, _reduced(strips, one.profile)) for one in reductions()]
    driven = {(one.group, one.name): drive(profile) for one, profile in found}
    other, _ = driven[OTHER_TYRE]
    verdicts = [
        Verdict(
            group=one.group,
            name=one.name,
            quarter=compare_responses(driven[one.group, one.name][0], true_quarter),
            full=compare_responses(driven[one.group, one.name][1], true_full),
            otherwise=compare_responses(driven[one.group, one.name][0], other),
            iri=float(iri(profile).mri) / mri,
        )
        for one, profile in found
    ]
    return Judged(
        course=course.name,
        rms={name: float(true_quarter[name].std()) for name in QUANTITIES},
        off_the_ground=float((true_quarter.tyre_force < -WEIGHT).mean()),
        mri=mri,
        spectra={
            REFERENCE: densities(true_quarter),
            **{which: densities(driven[which][0]) for which in DRAWN},
        },
        verdicts=verdicts,
    )


def _reduced(strips: Strips, reduce: Reduce) -> xr.Dataset:
    """Profile of both wheels."""
    profiles = [reduce(surface, path) for surface, path in strips]
    heights = [np.asarray(profile.height) for profile in profiles]
    return make_profile(profiles[0].s, heights, tracks=list(OFFSETS))
