"""Reductions of the ground to a profile, and the reference tyre."""

from collections.abc import Callable
from dataclasses import dataclass

import xarray as xr

from trueterrain.profile import (
    PASSENGER_TYRE,
    Disc,
    Envelope,
    InverseDistance,
    LineLaser,
    Mean,
    Median,
    PatchMean,
    Percentile,
    PlaneCurve,
    RadialSpringTyre,
    Rectangle,
    RigidDisc,
    SearchArea,
    Statistic,
    SteepestCpf,
    TandemCams,
    Window,
    point_profile,
    tyre_envelope,
    tyre_profile,
)
from trueterrain.vehicle import named_vehicle

CAR = named_vehicle("sedan")
LOAD = CAR.total_mass * 9.81 / 4  # [N] on a wheel
TYRE = RadialSpringTyre.of(PASSENGER_TYRE, load=LOAD)
STEP = 0.005  # [m] between samples of the ground along which tyres roll
RADII = (10, 25, 50, 75, 100)  # [mm] of search areas

Reduce = Callable[[xr.Dataset, PlaneCurve], xr.Dataset]


@dataclass(frozen=True, kw_only=True)
class Reduction:
    """Method that reduces a surface to a profile."""

    group: str
    "Heading of its group in the tables."

    name: str
    "Name in the tables."

    profile: Reduce
    "Function from surface and path to the profile."


def reference(surface: xr.Dataset, path: PlaneCurve) -> xr.Dataset:
    """Deformable tyre on the whole surface."""
    return tyre_envelope(surface, path, tyre=TYRE, step=STEP)


def reductions() -> list[Reduction]:
    """All that are compared."""
    patch = Rectangle(length=PASSENGER_TYRE.contact_length, width=PASSENGER_TYRE.contact_width)
    line: Reduce = point_profile
    median = _taken(Median(), Disc())
    disc, cams = RigidDisc.of(PASSENGER_TYRE), TandemCams.of(PASSENGER_TYRE)
    return [
        *_group("line", {"bare line": line, "moving average of 250 mm": _rolls_on(line, _AVERAGE)}),
        *_group("median", {f"r = {r} mm": _taken(Median(), _disc(r)) for r in RADII}),
        *_group("mean", {f"r = {r} mm": _taken(Mean(), _disc(r)) for r in RADII}),
        *_group("70th percentile", _percentiles(70.0, 50, 100)),
        *_group("85th percentile", _percentiles(85.0, 25, 50, 75, 100)),
        *_group("95th percentile", _percentiles(95.0, 50, 100)),
        *_group(
            "other statistics, r = 50 mm",
            {
                "bridge value (15 % skipped, 70 % averaged)": _taken(
                    Window(skip=15, size=70), _disc(50)
                ),
                "trimmed mean (10 % at either end)": _taken(Window(skip=10, size=80), _disc(50)),
                "mean weighted by distance": _taken(InverseDistance(of="mean"), _disc(50)),
                "median weighted by distance": _taken(InverseDistance(of="median"), _disc(50)),
                "steepest CPF": _taken(SteepestCpf(), _disc(50)),
            },
        ),
        *_group(
            "contact patch, 130 mm by 140 mm",
            {
                "median": _taken(Median(), patch),
                "mean": _rolls(PatchMean.of(PASSENGER_TYRE)),
                "85th percentile": _taken(Percentile(percent=85.0), patch),
            },
        ),
        *_group(
            "envelope on the surface",
            {
                "line laser of 100 mm": _rolls(LineLaser()),
                "rigid disc": _rolls(disc),
                "tandem cams": _rolls(cams),
            },
        ),
        *_group(
            "envelope on a profile",
            {
                "rigid disc on the bare line": _rolls_on(line, disc),
                "tandem cams on the bare line": _rolls_on(line, cams),
                "radial springs on the bare line": _rolls_on(line, TYRE),
                "rigid disc on the median, r = 25 mm": _rolls_on(median, disc),
                "tandem cams on the median, r = 25 mm": _rolls_on(median, cams),
                "radial springs on the median, r = 25 mm": _rolls_on(median, TYRE),
                "radial springs on the mean, r = 50 mm": _rolls_on(_taken(Mean(), _disc(50)), TYRE),
                "radial springs on the line laser": _rolls_on(_rolls(LineLaser()), TYRE),
            },
        ),
        *_group(
            "the reference, otherwise",
            {
                "radial springs under half as much load again": _rolls(
                    RadialSpringTyre.of(PASSENGER_TYRE, load=1.5 * LOAD)
                ),
            },
        ),
    ]


_AVERAGE = PatchMean(length=0.25, width=0.0, lines=1)


def _group(heading: str, methods: dict[str, Reduce]) -> list[Reduction]:
    return [Reduction(group=heading, name=name, profile=one) for name, one in methods.items()]


def _disc(radius: float) -> Disc:
    return Disc(radius=radius / 1000)


def _percentiles(percent: float, *radii: float) -> dict[str, Reduce]:
    return {f"r = {r} mm": _taken(Percentile(percent=percent), _disc(r)) for r in radii}


def _taken(statistic: Statistic, area: SearchArea) -> Reduce:
    return lambda surface, path: tyre_profile(surface, path, statistic=statistic, area=area)


def _rolls(tyre: Envelope) -> Reduce:
    return lambda surface, path: tyre_envelope(surface, path, tyre=tyre, step=STEP)


def _rolls_on(profile: Reduce, tyre: Envelope) -> Reduce:
    return lambda surface, path: tyre_envelope(profile(surface, path), tyre=tyre, step=STEP)
