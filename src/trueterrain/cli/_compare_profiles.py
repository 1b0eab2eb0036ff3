"""Comparison of profiles for ``trueterrain compare``: document, tables and pictures."""

import itertools
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import xarray as xr

from trueterrain.cli._console import write_line
from trueterrain.cli._profiles import write_table
from trueterrain.roughness import Butterworth
from trueterrain.roughness.agreement import (
    IRI_FILTER,
    AgreementLimits,
    AgreementSettings,
    LimitCheck,
    check_limits,
    filtered_profiles,
    height_errors,
    profile_agreement,
)
from trueterrain.roughness.agreement.heights import Registration

_PAIR = (
    "rating",
    "correlation",
    "sd_ratio",
    "best_shift",
    "overlap",
    "corrected_rating",
    "corrected_shift",
    "distance_error",
)
_SCORES = ("repeatability", "accuracy", "corrected_repeatability", "corrected_accuracy")
_ERRORS = ("best_shift", "scale", "mean", "rms", "nmad", "p95", "largest")
_MM = 1000.0
_MAX_LINES = 3  # profiles in one panel, besides the reference


@dataclass(frozen=True, kw_only=True, eq=False)
class ProfileComparison:
    """Ratings, height errors and verdicts on profiles."""

    data: Mapping[str, xr.Dataset]
    "Profiles by name."

    found: xr.Dataset
    "Ratings of all pairs, by `profile_agreement`."

    errors: xr.Dataset | None
    "Height errors, by `height_errors`; None without a reference."

    checks: list[LimitCheck]
    "Verdicts on the limits."

    settings: AgreementSettings
    "Filter and range of the search."

    @classmethod
    def of(
        cls,
        data: Mapping[str, xr.Dataset],
        reference: str | None,
        settings: AgreementSettings,
        limits: AgreementLimits,
        registration: Registration,
        trend: int | None,
    ) -> "ProfileComparison":
        """Compare profiles."""
        found = profile_agreement(data, reference=reference, settings=settings)
        errors = None
        if reference is not None:
            errors = height_errors(
                data, reference, registration=registration, trend=trend, settings=settings
            )
        return cls(
            data=data,
            found=found,
            errors=errors,
            checks=check_limits(found, errors, limits=limits),
            settings=settings,
        )

    def document(self) -> dict[str, Any]:
        """JSON document."""
        found = self.found
        return {
            "kind": "profiles",
            "filter": _filter_text(self.settings),
            "reference": found.attrs.get("reference"),
            "tracks": [self._track(str(track)) for track in found["track"].values],
            "checks": [asdict(check) for check in self.checks],
        }

    def show(self) -> None:
        """Print tables."""
        found = self.found
        reference = found.attrs.get("reference")
        against = "" if reference is None else f", reference {reference}"
        write_line(
            f"Agreement of {found.sizes['first']} profiles{against}; {_filter_text(self.settings)}."
        )
        for track in found["track"].values:
            write_line()
            if found.sizes["track"] > 1:
                write_line(f"Track {track}")
            one = found.sel(track=track)
            if found.sizes["first"] > 2:
                write_line("Ratings [%]")
                write_table(list(_rating_matrix(one)))
                write_line()
            write_table(list(_pair_rows(one, reference)))
            if self.errors is not None:
                write_line()
                write_line("Heights less those of the reference, registered [mm]")
                write_table(list(_error_rows(self.errors.sel(track=track))))
        write_line()
        for check in self.checks:
            write_line(_check_text(check, several=found.sizes["track"] > 1))
        usual = AgreementLimits()
        if any(check.limit in (usual.repeatability, usual.accuracy) for check in self.checks):
            write_line(
                "The limits of 92 % and 90 % are those commonly named for AASHTO R 56; "
                "neither they nor the formula were checked against its text."
            )

    def panels(self) -> tuple[list[str], list[list[Callable[[Any], object]]]]:
        """Titles and panels of the picture: filtered profiles, and ratings of all pairs."""
        from trueterrain import figures

        reference = self.found.attrs.get("reference")
        names = [str(name) for name in self.found["first"].values if name != reference]
        base = [names.pop(0)] if reference is None else [reference]
        titles, panels = [], []
        for track in self.found["track"].values:
            column: list[Callable[[Any], object]] = []
            for at in range(0, len(names), _MAX_LINES):
                shown = filtered_profiles(
                    {name: self.data[name] for name in [*base, *names[at : at + _MAX_LINES]]},
                    reference=base[0],
                    track=str(track),
                    settings=self.settings,
                )
                column.append(bind_panel(figures.agreement_overlay, shown))
            if self.found.sizes["first"] > 2:
                column.append(bind_panel(figures.agreement_matrix, self.found, track=str(track)))
            titles.append(f"Track {track}" if self.found.sizes["track"] > 1 else "Agreement")
            panels.append(column)
        return titles, panels

    def _track(self, track: str) -> dict[str, Any]:
        one = self.found.sel(track=track)
        document: dict[str, Any] = {"name": track}
        document |= {name: float(one[name]) for name in _SCORES}
        document["pairs"] = [
            {"first": str(first), "second": str(second)}
            | {name: float(one[name].sel(first=first, second=second)) for name in _PAIR}
            for first, second in _ordered_pairs(one, self.found.attrs.get("reference"))
        ]
        if self.errors is None:
            return document
        errors = self.errors.sel(track=track)
        document["heights"] = [
            {"profile": str(name)}
            | {value: float(errors[value].sel(profile=name)) for value in _ERRORS}
            for name in errors["profile"].values
        ]
        document |= {name: float(errors[name]) for name in ("bias", "precision")}
        return document


def bind_panel(draw: Callable[..., object], data: Any, **keywords: Any) -> Callable[[Any], object]:
    """Function that draws data into given axes."""
    return lambda ax: draw(data, ax=ax, **keywords)


def format_millimetres(value: float) -> str:
    """Length in millimetres; zero is written without a sign."""
    return f"{round(_MM * value, 3) + 0.0:.3f}"


def _filter_text(settings: AgreementSettings) -> str:
    """Description of the filter."""
    by = settings.filter
    if by is None:
        return "heights as they are"
    if by == IRI_FILTER:
        return f"IRI filter (exact window 0.25 m), settling length {settings.transient_length:g} m"
    if isinstance(by, Butterworth):
        return (
            f"Butterworth filter from {by.shortest:g} to {by.longest:g} m, order {by.order} "
            f"forward and backward, settling length {settings.transient_length:g} m"
        )
    return f"filter {by}"


def _ordered_pairs(one: xr.Dataset, reference: str | None) -> Iterator[tuple[str, str]]:
    """All pairs, those with the reference first."""
    names = [str(name) for name in one["first"].values]
    names.sort(key=lambda name: name != reference)
    yield from itertools.combinations(names, 2)


def _rating_matrix(one: xr.Dataset) -> Iterator[list[str]]:
    names = [str(name) for name in one["first"].values]
    yield ["", *names]
    for name, ratings in zip(names, one["rating"].values, strict=True):
        yield [name, *(f"{100 * rating:.1f}" for rating in ratings)]


def _pair_rows(one: xr.Dataset, reference: str | None) -> Iterator[list[str]]:
    """One row for each profile with the reference, or for each pair without a reference."""
    with_distance = bool(one["distance_error"].notnull().any())
    corrected = ["distance [%]", "corrected [%]"] if with_distance else []
    yield ["first", "second", "rating [%]", "shift [m]", "correlation", "sd ratio", *corrected]
    for first, second in _ordered_pairs(one, reference):
        if reference is not None and first != reference:
            continue
        pair = one.sel(first=first, second=second)
        row = [first, second, f"{100 * float(pair['rating']):.2f}"]
        row += [f"{float(pair['best_shift']):+.4f}", f"{float(pair['correlation']):.4f}"]
        row.append(f"{float(pair['sd_ratio']):.4f}")
        if with_distance:
            row.append(f"{100 * float(pair['distance_error']):+.4f}")
            row.append(f"{100 * float(pair['corrected_rating']):.2f}")
        yield row


def _error_rows(errors: xr.Dataset) -> Iterator[list[str]]:
    names = ("mean", "rms", "nmad", "p95", "largest")
    yield ["profile", "mean", "RMS", "NMAD", "95 %", "largest"]
    for profile in errors["profile"].values:
        one = errors.sel(profile=profile)
        yield [str(profile), *(format_millimetres(float(one[name])) for name in names)]


def _check_text(check: LimitCheck, *, several: bool) -> str:
    where = f" of {check.track}" if several else ""
    value = _format_quantity(check.value, check.unit)
    if check.value != check.value:  # NaN: unknown
        return f"{check.name}{where}: not judged, {check.reason}"
    if check.passed is None or check.limit is None:
        return f"{check.name}{where}: {value}, not judged: {check.reason}"
    side = "at least" if check.unit == "1" else "at most"
    kept = "kept" if check.passed else "MISSED"
    return (
        f"{check.name}{where}: {value}, {side} {_format_quantity(check.limit, check.unit)}: {kept}"
    )


def _format_quantity(value: float, unit: str) -> str:
    if unit == "m":
        return f"{format_millimetres(value)} mm"
    return f"{100 * value:.2f} %" if unit == "1" else f"{100 * value:.4f} %"
