"""Results of a comparison checked against limits of the user."""

from collections.abc import Iterator
from dataclasses import dataclass, fields

import numpy as np
import xarray as xr


@dataclass(frozen=True, kw_only=True)
class AgreementLimits:
    """Limits of a comparison; None for a check without a limit.

    The default ratings are a starting point only. No other limit has a default.

    Examples
    --------
    >>> AgreementLimits().repeatability
    0.92
    """

    repeatability: float | None = 0.92
    """Minimum mean rating of all pairs of repeats [1], 0 for none. The default is the one commonly
    quoted for AASHTO R 56; it was not checked against its text."""

    accuracy: float | None = 0.90
    "Minimum mean rating of repeats against the reference [1], 0 for none; as for repeatability."

    distance_error: float | None = None
    "Maximum magnitude of the distance-measuring error against the reference [m/m]."

    bias: float | None = None
    "Maximum mean magnitude of the mean error of repeats [m]."

    precision: float | None = None
    "Maximum mean standard deviation of repeats [m]."

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if value == 0 and field.name in ("repeatability", "accuracy"):
                continue
            if value is not None and not (np.isfinite(value) and value > 0):
                message = f"{field.name} must be finite and greater than 0, or None, got {value}"
                raise ValueError(message)


@dataclass(frozen=True, kw_only=True)
class LimitCheck:
    """Result of one check."""

    name: str
    "Quantity that is checked."

    track: str
    "Name of the track."

    value: float
    "Value, in units of `unit`; NaN if it could not be computed."

    limit: float | None
    "The limit, in units of `unit`; None if there is none."

    unit: str
    "Unit of value and limit."

    passed: bool | None
    "Whether the limit is kept; None if it could not be checked."

    reason: str
    "Why it could not be checked; else empty."


def check_limits(
    found: xr.Dataset,
    errors: xr.Dataset | None = None,
    *,
    limits: AgreementLimits = AgreementLimits(),
) -> list[LimitCheck]:
    """Check results against limits; a check that cannot be made gives the reason.

    Parameters
    ----------
    found : xarray.Dataset
        Result of `profile_agreement`.
    errors : xarray.Dataset, optional
        Result of `height_errors`, for bias and precision.
    limits : AgreementLimits
        The limits.

    Returns
    -------
    list of LimitCheck
        Repeatability, accuracy, distance error, bias and precision of each track.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_profile
    >>> from trueterrain.roughness.agreement import profile_agreement
    >>> s = np.arange(0.0, 100.0, 0.05)
    >>> runs = {name: make_profile(s, 0.01 * np.sin(s**1.2)) for name in ("1", "2")}
    >>> for check in check_limits(profile_agreement(runs))[:2]:
    ...     print(check.name, check.passed, check.reason)
    repeatability True
    accuracy None no reference is given
    """
    return [
        check
        for track in found["track"].values
        for check in _check_each(
            found.sel(track=track),
            None if errors is None else errors.sel(track=track),
            str(track),
            limits,
        )
    ]


def _check_each(
    found: xr.Dataset, errors: xr.Dataset | None, track: str, limits: AgreementLimits
) -> Iterator[LimitCheck]:
    reference = found.attrs.get("reference")
    alone = "there are less than two repeats"
    unknown = "no reference is given"
    for name, limit, missing in (
        ("repeatability", limits.repeatability, alone),
        ("accuracy", limits.accuracy, unknown),
    ):
        yield _check_min(name, track, float(found[name]), limit or None, missing)
    worst, why = np.nan, unknown
    if reference is not None:
        against = found["distance_error"].sel(first=reference)
        worst = float(np.abs(against.values).max())
        why = "the distance error was not searched"
    yield _check_max("distance error", track, worst, limits.distance_error, "m/m", why)
    for name, limit in (("bias", limits.bias), ("precision", limits.precision)):
        value = np.nan if errors is None else float(errors[name])
        missing = "no errors of heights are given" if errors is None else alone
        yield _check_max(name, track, value, limit, "m", missing)


def _check_min(
    name: str, track: str, value: float, limit: float | None, missing: str
) -> LimitCheck:
    passed = bool(limit is not None and value >= limit)
    return _make_check(name, track, value, limit, "1", missing, passed)


def _check_max(
    name: str, track: str, value: float, limit: float | None, unit: str, missing: str
) -> LimitCheck:
    passed = bool(limit is not None and value <= limit)
    return _make_check(name, track, value, limit, unit, missing, passed)


def _make_check(
    name: str, track: str, value: float, limit: float | None, unit: str, missing: str, passed: bool
) -> LimitCheck:
    reason = ""
    if not np.isfinite(value):
        reason = missing
    elif limit is None:
        reason = "no limit is given"
    return LimitCheck(
        name=name,
        track=track,
        value=value,
        limit=limit,
        unit=unit,
        passed=None if reason else passed,
        reason=reason,
    )
