"""Agreement of two profiles of 20 km: compared with implementations on scipy and numpy.

All filter both profiles with the golden car and find the shift at which they agree best. The peer
on scipy filters with `scipy.signal.lfilter` and correlates at all lags with
`scipy.signal.correlate`; the peer on numpy correlates with `numpy.correlate`, lag by lag within the
search. Both know the shift to a whole sample only, and neither finds the error of the distance,
which ours is timed with as well. The later profile has 0.9 of the heights of the first, so that the
truth is a rating of 0.9, and all are held against it.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import correlate, ss2tf

from bench_iri import fastest, filter_start, road
from trueterrain.core.schemas import make_profile
from trueterrain.roughness import QuarterCar
from trueterrain.roughness.agreement import AgreementSettings, profile_agreement

LENGTH = 20_000.0  # [m]
SPACING = 0.025  # [m]
LATE = 130  # [samples] by which the second profile is late
GAIN = 0.9  # of its heights
ERROR = 1e-3  # [m/m] of its distance, in the row with distance error
MAX_SHIFT = 10.0  # [m]
BUDGET = 5.0  # [s]
AGREE = 1e-3  # [1] ratings; the start of the car, 30 m of 20 km
WITHIN = 1e-3  # [m]
REPEATS = 3


def bench() -> list[dict[str, Any]]:
    """Rows of name, ours, peer, unit, ratio and budget; all give the same ratings.

    Returns
    -------
    list of dict
        What was measured.
    """
    count = int(LENGTH / SPACING)
    ground = gaussian_filter1d(road(count + LATE), 4)
    station = SPACING * np.arange(count)
    first, second = ground[LATE:], GAIN * ground[:count]
    profiles = {"A": make_profile(station, first), "B": make_profile(station, second)}
    stretched = np.interp(station / (1 + ERROR), station, first)
    apart = {"A": profiles["A"], "B": make_profile(station, stretched)}

    shift_only = AgreementSettings(max_shift=MAX_SHIFT, max_scale=0)
    ours, found = fastest(lambda: profile_agreement(profiles, settings=shift_only), REPEATS)
    pair = found.sel(first="A", second="B").squeeze("track")
    require("our rating", float(pair.rating), GAIN, AGREE)
    require("our shift", float(pair.best_shift), LATE * SPACING, WITHIN)

    whole, found = fastest(lambda: profile_agreement(apart), REPEATS)
    scaled = found.sel(first="A", second="B").squeeze("track")
    require("our distance error", float(scaled.distance_error), ERROR, WITHIN / LENGTH)

    by_fft, rated = fastest(lambda: peer_rating(first, second, fft_products), REPEATS)
    require("the rating on scipy", rated, GAIN, AGREE)
    by_lag, rated = fastest(lambda: peer_rating(first, second, lag_products), 1)
    require("the rating on numpy", rated, GAIN, AGREE)
    return [
        row("shift within 10 m", ours, by_fft, "scipy lfilter + correlate, to a sample"),
        row("shift within 10 m", ours, by_lag, "scipy lfilter + numpy.correlate, to a sample"),
        row("shift and distance error", whole),
    ]


def row(
    name: str, ours: float, peer: float | None = None, peer_name: str | None = None
) -> dict[str, Any]:
    """Times of ours and the peer."""
    return {
        "name": f"agreement of two profiles, {LENGTH / 1000:g} km at {1000 * SPACING:g} mm, {name}",
        "ours": ours,
        "peer": peer,
        "peer_name": peer_name,
        "unit": "s",
        "ratio": None if peer is None else peer / ours,
        "budget": f"<= {BUDGET:g} s",
        "met": ours <= BUDGET,
    }


def peer_rating(
    first: np.ndarray, second: np.ndarray, products: Callable[..., np.ndarray]
) -> float:
    """Rating at the best whole sample: covariance over the larger variance."""
    a, b = car_response(first), car_response(second)
    a, b = a - a.mean(), b - b.mean()
    most = int(MAX_SHIFT / SPACING)
    best = products(a, b, most).max()
    return float(best / max(a @ a, b @ b))


def fft_products(a: np.ndarray, b: np.ndarray, most: int) -> np.ndarray:
    """Products at all lags, of which those within the search are kept."""
    every = correlate(b, a, mode="full", method="fft")
    return every[a.size - 1 - most : a.size + most]


def lag_products(a: np.ndarray, b: np.ndarray, most: int) -> np.ndarray:
    """Products at the lags within the search alone."""
    return np.correlate(np.pad(b, most), a, mode="valid")


def car_response(height: np.ndarray) -> np.ndarray:
    """Output of the golden car on scipy.signal.lfilter [m/m]."""
    S, p = QuarterCar().transition(SPACING)
    C = np.array([-1.0, 0.0, 1.0, 0.0])
    b, a = ss2tf(S, p[:, None], (C @ S)[None, :], np.array([[C @ p]]))
    base = round(0.25 / SPACING)
    lead = round(11 / SPACING) + 1
    first = (height[lead - 1] - height[0]) / (SPACING * lead)
    slope = (height[base:] - height[:-base]) / (base * SPACING)
    return filter_start(b[0], a, slope, S, C, np.array([first, 0.0, first, 0.0]))


def require(what: str, found: float, truth: float, tolerance: float) -> None:
    """Stop if a result is wrong: its time would mean nothing."""
    if not abs(found - truth) <= tolerance:
        message = f"{what} is {found!r}, the truth {truth!r}"
        raise AssertionError(message)


if __name__ == "__main__":
    for line in bench():
        print(f"{line['name']}: {line['ours']:.2f} {line['unit']} (budget {line['budget']})")
        if line["peer"] is not None:
            print(f"    {line['peer_name']}: {line['peer']:.2f}, ratio {line['ratio']:.1f}")
