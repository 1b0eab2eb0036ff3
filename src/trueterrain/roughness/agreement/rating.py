"""Agreement of profiles by cross-correlation: every pair, repeats, and against a reference."""

import itertools
import warnings
from collections.abc import Iterator, Mapping

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import SchemaError
from trueterrain.core.provenance import add_step
from trueterrain.core.renamed import rename_keyword
from trueterrain.roughness.agreement._registration import RegisteredPair, register_pair
from trueterrain.roughness.agreement._signal import ProfileTrack, signal_of, tracks_of
from trueterrain.roughness.agreement.settings import AgreementSettings
from trueterrain.roughness.plausible import flag_profile
from trueterrain.roughness.settings import QuarterCarSettings

Array = npt.NDArray[np.float64]

_PAIRWISE = {
    "rating": "1",
    "correlation": "1",
    "sd_ratio": "1",
    "best_shift": "m",
    "overlap": "m",
    "corrected_rating": "1",
    "corrected_shift": "m",
    "distance_error": "m/m",
}

# metres in a unit, inverse: the ratio that remains if it is taken for metres
_UNITS = {
    "feet": 1 / 0.3048,
    "inches": 1 / 0.0254,
    "millimetres": 1000.0,
    "centimetres": 100.0,
}

_UNIT_TOLERANCE = 0.03  # [1] by which a ratio may differ from that of two units
_MIN_CORRELATION = 0.7  # from which on a ratio of amplitudes is significant
_LENGTH_TOLERANCE = 0.01  # [1] by which lengths may differ without a flag
_AT_LIMIT = 0.02  # fraction of a search range that counts as its end

#: Tracks by names of profile and track: tracks[name][track].
Tracks = dict[str, dict[str, ProfileTrack]]


@rename_keyword("options", "settings")
def profile_agreement(
    profiles: Mapping[str, xr.Dataset],
    *,
    reference: str | None = None,
    settings: AgreementSettings = AgreementSettings(),
) -> xr.Dataset:
    """Cross-correlation rating of profiles: each pair, all repeats, and each against a reference.

    Use it to certify a profiler, or to see whether two profilers measure the same roughness in the
    same places.

    Parameters
    ----------
    profiles : mapping of str to xarray.Dataset
        Two or more Profiles with their names, all with the same tracks [m].
    reference : str, optional
        Name of the reference; it does not count as a repeat.
    settings : AgreementSettings
        Filter, and ranges of the search.

    Returns
    -------
    xarray.Dataset
        For each ``track`` and pair (``first``, ``second``):

        - ``rating``: cross-correlation rating at the best shift, at most 1 [1];
        - ``correlation`` and ``sd_ratio`` (second over first), its two factors [1];
        - ``best_shift``: station of a feature in the second less that in the first [m];
        - ``overlap``: length that is compared [m];
        - ``distance_error``: metres that the second counts too many per metre of the first [m/m],
          NaN if ``max_scale`` is 0; ``corrected_rating`` and ``corrected_shift`` (at the first
          station of the first after the transient) with the stations scaled by it.

        For each track: ``repeatability``, the mean rating of all pairs of repeats, ``accuracy``,
        that of all repeats against the reference, and both with corrected distance,
        ``corrected_repeatability`` and ``corrected_accuracy`` [1]; NaN where there is no such pair.
        ``attrs["flags"]`` lists the flags.

    Raises
    ------
    ValueError
        If there are less than two profiles, or `reference` is none of them.
    SchemaError
        If one is not a Profile, their tracks differ, or the spacing is unequal and the filter needs
        it equal.
    CoverageError
        If a height is not finite, a profile is flat or shorter than the filter needs, or two
        profiles do not overlap.

    Warns
    -----
    UserWarning
        For each flag: units that look wrong, lengths that differ, a search that ends at its limit.

    Notes
    -----
    With filtered profiles P and Q, less their means over the overlap at shift d,

        rating = max over d of sum P(x) Q(x + d) / max(sum P(x)^2, sum Q(x + d)^2):

    their correlation, times the smaller standard deviation over the larger. It is 1 only if both
    shape and amplitude agree: Q = k P is rated min(k, 1/k) for k > 0, and Q = P + independent noise
    with r times the variance of P is rated 1 / (1 + r). The method is that of Karamihas and
    Gillespie, "Development of Cross Correlation for Objective Comparison of Profiles", UMTRI
    (2002), which ASTM E950 and AASHTO R 56 adopted. Only its abstract and the scopes of both
    standards could be read: the formula is the commonly used form and was not checked against them.

    The shift is found from the ratings at all whole samples, then between samples by least squares,
    where the correlation is largest. For the distance-measuring error, the correlation is maximised
    over shift and scale together: first of short stretches, each of which a scale shifts by a
    different length, then of the whole; the second profile is scaled before it is filtered. A pair
    is computed once, from the reference or the name that comes first; its reverse is the inverse.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_profile
    >>> s = np.arange(0.0, 200.0, 0.05)
    >>> road = lambda x: 0.01 * np.sin(x / 2) + 0.004 * np.sin(2.7 * x)
    >>> late = make_profile(s, 0.9 * road(s - 0.123))
    >>> found = profile_agreement({"R": make_profile(s, road(s)), "A": late}, reference="R")
    >>> one = found.sel(first="R", second="A").squeeze("track")
    >>> print(f"{one.rating:.2f} at {1000 * one.best_shift:.1f} mm")
    0.90 at 123.0 mm
    """
    tracks = check_tracks(profiles, reference, settings)
    names = list(profiles)
    labels = list(tracks[names[0]])
    values = {name: np.zeros((len(labels), len(names), len(names))) for name in _PAIRWISE}
    flags = [
        f"{name}: {flag.removeprefix('track profile: ')}"
        for name, profile in profiles.items()
        for flag in flag_profile(profile)
    ]
    for row, label in enumerate(labels):
        by_name = {name: tracks[name][label] for name in names}
        for (i, one), (j, other) in _list_pairs(names, reference):
            pair = register_pair(by_name[one], by_name[other], settings)
            _write_pair(values, row, i, j, pair)
            flags += _flag_pair(by_name[one], by_name[other], pair, settings)
        for i, name in enumerate(names):
            _write_diagonal(values, row, i, by_name[name].length, settings)
    flags = list(dict.fromkeys(flags))
    for flag in flags:
        warnings.warn(flag, stacklevel=2)
    data = xr.Dataset(
        {
            name: (("track", "first", "second"), values[name], {"units": unit})
            for name, unit in _PAIRWISE.items()
        },
        {"track": labels, "first": names, "second": names},
        {"flags": flags} | ({} if reference is None else {"reference": reference}),
    )
    data = data.assign(_track_scores(data, reference))
    return add_step(data, "agreement", parameters={"options": settings, "reference": reference})


@rename_keyword("options", "settings")
def filtered_profiles(
    profiles: Mapping[str, xr.Dataset],
    *,
    reference: str | None = None,
    track: str | None = None,
    correct_distance: bool = False,
    settings: AgreementSettings = AgreementSettings(),
) -> xr.Dataset:
    """Filtered profiles at the stations of one of them, each at its best shift.

    For figures that show where profiles differ.

    Parameters
    ----------
    profiles : mapping of str to xarray.Dataset
        Two or more Profiles with their names [m].
    reference : str, optional
        Name of the profile to which the others are shifted; by default the first.
    track : str, optional
        Name of the track; required if there are several.
    correct_distance : bool
        Whether to scale the stations as well, by the distance-measuring error.
    settings : AgreementSettings
        Filter, and ranges of the search.

    Returns
    -------
    xarray.Dataset
        ``filtered`` (profile, s): slope [m/m] if the filter is a car, else height [m], less its
        mean; NaN outside of a profile. Of each profile ``rating`` [1], ``best_shift`` [m] and
        ``scale`` [m/m]. The reference comes first.

    Raises
    ------
    ValueError
        If there are less than two profiles, or `reference` or `track` is not among them.
    SchemaError, CoverageError
        As by `profile_agreement`.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_profile
    >>> s = np.arange(0.0, 100.0, 0.05)
    >>> both = {"R": make_profile(s, np.sin(s) / 99), "A": make_profile(s, np.sin(s - 0.2) / 99)}
    >>> print(filtered_profiles(both).best_shift.values.round(4))
    [0.  0.2]
    """
    tracks = check_tracks(profiles, reference, settings)
    base = next(iter(profiles)) if reference is None else reference
    label = _one_track(list(tracks[base]), track)
    names = [base, *(name for name in profiles if name != base)]
    rows, ratings, shifts, scales = [], [1.0], [0.0], [0.0]
    step = (
        min(tracks[name][label].spacing for name in names) if not settings.step else settings.step
    )
    target = signal_of(tracks[base][label], settings, step)
    for name in names[1:]:
        pair = register_pair(tracks[base][label], tracks[name][label], settings)
        scaled = correct_distance and np.isfinite(pair.scale)
        rating = pair.corrected.rating if scaled else pair.plain.rating
        shift, scale = (pair.corrected_shift, pair.scale) if scaled else (pair.shift, 0.0)
        other = signal_of(tracks[name][label], settings, step)
        at = target.station + shift + scale * (target.station - target.start)
        inside = (at >= other.start) & (at <= other.start + other.length)
        rows.append(np.where(inside, other.spline(at), np.nan))
        ratings, shifts, scales = [*ratings, rating], [*shifts, shift], [*scales, scale]
    unit = {"units": "m/m" if isinstance(settings.filter, QuarterCarSettings) else "m"}
    return xr.Dataset(
        {
            "filtered": (("profile", "s"), np.array([target.values, *rows]), unit),
            "rating": ("profile", ratings, {"units": "1"}),
            "best_shift": ("profile", shifts, {"units": "m"}),
            "scale": ("profile", scales, {"units": "m/m"}),
        },
        {"profile": names, "s": ("s", target.station, {"units": "m"})},
    )


def check_tracks(
    profiles: Mapping[str, xr.Dataset], reference: str | None, settings: AgreementSettings
) -> Tracks:
    """Tracks of all profiles, which must be the same."""
    if len(profiles) < 2:
        message = f"profiles must be two or more, got {len(profiles)}"
        raise ValueError(message)
    if reference is not None and reference not in profiles:
        message = f"reference must be one of {', '.join(profiles)}, got {reference!r}"
        raise ValueError(message)
    tracks: Tracks = {}
    for name, profile in profiles.items():
        tracks[name] = tracks_of(name, profile, from_zero=settings.align_starts)
    head, *others = tracks
    for name in others:
        if set(tracks[name]) != set(tracks[head]):
            found, expected = ", ".join(tracks[name]), ", ".join(tracks[head])
            raise SchemaError(
                f"has the tracks {found}, but {head} has {expected}",
                place=name,
                cure="Choose one track of each.",
            )
    return tracks


def _list_pairs(
    names: list[str], reference: str | None
) -> list[tuple[tuple[int, str], tuple[int, str]]]:
    """All pairs; the reference is the first of its own, else that whose name comes first."""
    order = sorted(enumerate(names), key=lambda item: (item[1] != reference, item[1]))
    return list(itertools.combinations(order, 2))


def _write_pair(values: dict[str, Array], row: int, i: int, j: int, pair: RegisteredPair) -> None:
    """Write the results of a pair, and of its reverse, to matrices (track, first, second)."""
    plain, corrected, scale = pair.plain, pair.corrected, pair.scale
    known = np.isfinite(scale)
    there = {
        "rating": plain.rating,
        "correlation": plain.correlation,
        "sd_ratio": plain.sd_ratio,
        "best_shift": pair.shift,
        "overlap": plain.overlap,
        "corrected_rating": corrected.rating if known else np.nan,
        "corrected_shift": pair.corrected_shift if known else np.nan,
        "distance_error": scale,
    }
    back = there | {
        "sd_ratio": 1 / plain.sd_ratio,
        "best_shift": -pair.shift,
        "corrected_shift": pair.shift_back if known else np.nan,
        "distance_error": -scale / (1 + scale),
    }
    for name, value in there.items():
        values[name][row, i, j] = value
        values[name][row, j, i] = back[name]


def _write_diagonal(
    values: dict[str, Array], row: int, i: int, length: float, settings: AgreementSettings
) -> None:
    """Write the comparison of a profile with itself."""
    for name in ("rating", "correlation", "sd_ratio"):
        values[name][row, i, i] = 1.0
    values["overlap"][row, i, i] = length
    searched = settings.max_scale > 0
    values["corrected_rating"][row, i, i] = 1.0 if searched else np.nan
    values["corrected_shift"][row, i, i] = 0.0 if searched else np.nan
    values["distance_error"][row, i, i] = 0.0 if searched else np.nan


def _track_scores(data: xr.Dataset, reference: str | None) -> dict[str, xr.DataArray]:
    """Repeatability and accuracy of each track."""
    repeats = [name for name in data["first"].values if name != reference]
    scores = {}
    for prefix in ("", "corrected_"):
        ratings = data[f"{prefix}rating"]
        among = ratings.sel(first=repeats, second=repeats).values
        upper = np.triu_indices(len(repeats), 1)
        pairs = among[:, upper[0], upper[1]]
        mean = pairs.mean(axis=1) if pairs.size else np.full(len(among), np.nan)
        scores[f"{prefix}repeatability"] = xr.DataArray(mean, dims="track", attrs={"units": "1"})
        against = np.full(len(among), np.nan)
        if reference is not None:
            against = ratings.sel(first=reference, second=repeats).values.mean(axis=1)
        scores[f"{prefix}accuracy"] = xr.DataArray(against, dims="track", attrs={"units": "1"})
    return scores


def _one_track(known: list[str], asked: str | None) -> str:
    if asked is None and len(known) == 1:
        return known[0]
    if asked is None or asked not in known:
        message = f"track must be one of {', '.join(known)}, got {asked!r}"
        raise ValueError(message)
    return asked


def _flag_pair(
    first: ProfileTrack, second: ProfileTrack, pair: RegisteredPair, settings: AgreementSettings
) -> Iterator[str]:
    """Flags of a pair: wrong units, different lengths, a search that ends at its limit."""
    plain, shift, scale = pair.plain, pair.shift, pair.scale
    both = f"{first.name} and {second.name}"
    unit = _suspected_unit(second.length / first.length)
    longer, shorter = (second, first) if second.length > first.length else (first, second)
    lengths = f"{longer.name} is {longer.length:g} m long, {shorter.name} {shorter.length:g} m"
    if unit:
        yield f"{lengths}: are the stations of {longer.name} in {unit}?"
    elif longer.length - shorter.length > max(
        _LENGTH_TOLERANCE * longer.length, settings.max_shift
    ):
        yield f"{lengths}: only the {plain.overlap:.4g} m of overlap are compared"
    if abs(plain.correlation) > _MIN_CORRELATION and (unit := _suspected_unit(plain.sd_ratio)):
        taller, lower = (second, first) if plain.sd_ratio > 1 else (first, second)
        ratio = max(plain.sd_ratio, 1 / plain.sd_ratio)
        yield (
            f"{taller.name} is {ratio:.4g} times as high as {lower.name}: "
            f"are its heights in {unit}?"
        )
    if pair.rival is not None:
        yield (
            f"{both}: a shift of {pair.rival:.3f} m is rated nearly as well as {shift:.3f} m: "
            "the road repeats itself; allow less, or set the stations right"
        )
    if settings.max_shift > 0 and abs(shift) >= (1 - _AT_LIMIT) * settings.max_shift:
        yield f"{both}: the best shift, {shift:.3f} m, is at the end of the search; allow more"
    if settings.max_scale > 0 and abs(scale) >= (1 - _AT_LIMIT) * settings.max_scale:
        yield f"{both}: the best scale, {scale:.3%}, is at the end of the search; allow more"


def _suspected_unit(ratio: float) -> str:
    """Unit that may have been taken for metres, by a ratio of lengths or heights; "" if none."""
    ratio = max(ratio, 1 / ratio) if ratio > 0 else np.inf
    for name, factor in _UNITS.items():
        if abs(ratio / factor - 1) < _UNIT_TOLERANCE:
            return name
    return ""
