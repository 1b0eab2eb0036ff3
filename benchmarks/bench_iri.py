"""IRI, Ride Number and spectrum of a long profile, compared with implementations on scipy.

For the indices both take heights to the index: 0.25 m window, start on the first 11 or 19 m, mean
of the absolute output or of its square. The peer turns the state recursion into a transfer function
(ss2tf), filters the slope with it, and puts the start in either as the state of the filter or as a
free response in eigen form over the whole profile; both forms are timed. For the spectrum the peer
is scipy.signal.welch, alone; ours goes on to bands, confidence, Gd(n0), waviness and class.
"""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.signal import lfilter, ss2tf, welch

from trueterrain.core.schemas import make_profile
from trueterrain.roughness import RIDE_NUMBER_CAR, IriSettings, QuarterCar, iri, psd, ride_number

SAMPLES = 4_000_000
SPACING = 0.05  # [m]
BUDGET = 20.0  # [M samples/s]
DIGITS = 1e-9  # [1] relative difference of the results
REPEATS = 5


def bench() -> list[dict[str, Any]]:
    """Rows of name, ours, peer, unit, ratio and budget; the results agree to 9 digits.

    Returns
    -------
    list of dict
        What was measured.
    """
    height = road(SAMPLES)
    station = SPACING * np.arange(SAMPLES)
    profile = make_profile(station, height)
    jitter = np.random.default_rng(2).uniform(-0.4, 0.4, SAMPLES) * SPACING
    unequal = make_profile(station + jitter, height)
    exact = IriSettings(window="exact")

    ours, index = fastest(lambda: iri(profile).iri.item())
    state, state_index = fastest(lambda: lfilter_iri(height, filter_start))
    eigen, eigen_index = fastest(lambda: lfilter_iri(height, eigen_start), repeats=2)
    for other in (state_index, eigen_index):
        if not abs(other / index - 1) <= DIGITS:
            message = f"the peer's IRI {other!r} differs from ours, {index!r}, beyond 9 digits"
            raise AssertionError(message)
    ride, square = fastest(lambda: ride_number(profile).pi.item() ** 2)
    peer_ride, peer_square = fastest(lambda: lfilter_square(height))
    if not abs(peer_square / square - 1) <= DIGITS:
        message = f"the peer's PI² {peer_square!r} differs from ours, {square!r}, beyond 9 digits"
        raise AssertionError(message)
    spectrum, density = fastest(lambda: psd(profile).density.values[0, 99])
    block = round(1000.0 / SPACING)
    peer_spectrum, peer_density = fastest(
        lambda: welch(height, 1 / SPACING, "hann", block, detrend="linear")[1][100]
    )
    if not abs(peer_density / density - 1) <= DIGITS:
        message = f"the peer's density {peer_density!r} differs from ours, {density!r}"
        raise AssertionError(message)
    segments, _ = fastest(lambda: iri(profile, segment=100.0).iri.item())
    irregular, _ = fastest(lambda: iri(unequal, settings=exact).iri.item(), repeats=2)
    return [
        row("IRI, equal spacing", ours, state, "scipy lfilter, start as filter state"),
        row("IRI, equal spacing", ours, eigen, "scipy lfilter + eigen free response"),
        row("IRI, equal spacing, 100 m segments", segments),
        row("IRI, unequal spacing, exact window", irregular, budget=None),
        row("Ride Number, equal spacing", ride, peer_ride, "scipy lfilter, start as filter state"),
        row("PSD and ISO 8608 class", spectrum, peer_spectrum, "scipy welch alone", budget=None),
    ]


def row(
    name: str,
    ours: float,
    peer: float | None = None,
    peer_name: str | None = None,
    budget: float | None = BUDGET,
) -> dict[str, Any]:
    """Speeds from the seconds of ours and the peer."""
    speed = SAMPLES / ours / 1e6
    return {
        "name": f"{name}, {SAMPLES:,} samples",
        "ours": speed,
        "peer": None if peer is None else SAMPLES / peer / 1e6,
        "peer_name": peer_name,
        "unit": "M samples/s",
        "ratio": None if peer is None else peer / ours,
        "budget": "-" if budget is None else f">= {budget:g} M samples/s",
        "met": budget is None or speed >= budget,
    }


def road(count: int) -> np.ndarray:
    """Heights of a road, a random walk that stays within metres [m]."""
    walk = np.random.default_rng(1).standard_normal(count) * 1e-3
    return lfilter([1.0], [1.0, -0.9999], walk)


def lfilter_iri(height: np.ndarray, start: Callable[..., np.ndarray]) -> float:
    """IRI on scipy.signal.lfilter [m/km]."""
    return 1000 * float(np.mean(np.abs(lfilter_output(height, start, QuarterCar(), 11.0))))


def lfilter_square(height: np.ndarray) -> float:
    """Square of the profile index of the Ride Number on scipy.signal.lfilter [m²/m²]."""
    return float(np.mean(np.square(lfilter_output(height, filter_start, RIDE_NUMBER_CAR, 19.0))))


def lfilter_output(
    height: np.ndarray, start: Callable[..., np.ndarray], car: QuarterCar, length: float
) -> np.ndarray:
    """Output of a car that starts with the slope of the first length [m/m]."""
    S, p = car.transition(SPACING)
    C = np.array([-1.0, 0.0, 1.0, 0.0])
    # the output after a step is C (S x + p slope), x being the state before it
    b, a = ss2tf(S, p[:, None], (C @ S)[None, :], np.array([[C @ p]]))
    base = max(round(0.25 / SPACING), 1)
    lead = round(length / SPACING) + 1
    first = (height[lead - 1] - height[0]) / (SPACING * lead)
    slope = (height[base:] - height[:-base]) / (base * SPACING)
    return start(b[0], a, slope, S, C, np.array([first, 0.0, first, 0.0]))


def eigen_start(
    b: np.ndarray, a: np.ndarray, slope: np.ndarray, S: np.ndarray, C: np.ndarray, x: np.ndarray
) -> np.ndarray:
    """Filter at rest, plus the free response C S^k x from eigenvalues and eigenvectors."""
    values, vectors = np.linalg.eig(S)
    weights = (C @ vectors) * np.linalg.solve(vectors, x.astype(complex))
    k = np.arange(1, slope.size + 1)
    free = sum(
        weight * np.exp(np.log(value) * k) for weight, value in zip(weights, values, strict=True)
    )
    return lfilter(b, a, slope) + free.real


def filter_start(
    b: np.ndarray, a: np.ndarray, slope: np.ndarray, S: np.ndarray, C: np.ndarray, x: np.ndarray
) -> np.ndarray:
    """Filter that starts in the state whose free response is that of the car."""
    free = []
    for _ in range(4):
        x = S @ x
        free.append(C @ x)
    state = np.array([sum(a[j] * free[k - j] for j in range(k + 1)) for k in range(4)])
    return lfilter(b, a, slope, zi=state)[0]


def fastest(work: Callable[[], float], repeats: int = REPEATS) -> tuple[float, float]:
    """Shortest time [s] of some repeats, after one that compiles, and the result."""
    result = work()
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        work()
        times.append(time.perf_counter() - begin)
    return min(times), result


if __name__ == "__main__":
    for line in bench():
        print(f"{line['name']}: {line['ours']:.1f} {line['unit']} (budget {line['budget']})")
        if line["peer"] is not None:
            print(f"    {line['peer_name']}: {line['peer']:.1f}, ratio {line['ratio']:.1f}")
