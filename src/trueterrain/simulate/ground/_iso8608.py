"""Random roads with a given displacement PSD: ISO 8608."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from trueterrain.simulate.ground import _kernels
from trueterrain.simulate.ground._ground import (
    Floats,
    Ground,
    check_finite,
    check_positive,
    check_seed,
)
from trueterrain.simulate.ground._noise import uniform_numbers

#: Reference spatial frequency of ISO 8608 [1/m].
N0 = 0.1

#: Geometric mean of Gd(N0) of the road classes [m^3].
GD_N0 = {name: 16e-6 * 4**k for k, name in enumerate("ABCDEFGH")}

Coherence = Literal["isotropic", "full"]

_PHASE, _RING, _ANGLE = 40, 41, 42  # salts of the hash: purpose of a random number
_GOLDEN_RATIO = (math.sqrt(5.0) - 1.0) / 2.0
_QUADRATURE = 64  # nodes; relative error below 1e-12 for wavinesses from 0 to 5


@dataclass(frozen=True, kw_only=True)
class Road(Ground):
    """Random road with a one-sided displacement PSD ``Gd(n) = Gd(n0) (n / n0) ** -waviness``.

    The road is a sum of plane waves. With isotropic coherence their wave vectors have all
    directions, and along *any* straight line the PSD is Gd(n) between `lowest` and `highest` and
    zero above. Below `lowest` it is that of waves oblique to the line, at most half of Gd(lowest)
    for a waviness of 2. The coherence of parallel tracks follows from isotropy, see
    `track_coherence`.

    Along any line an isotropic random surface has the spectrum

        Gd(n) = 4 * integral from n to infinity of S(k) k dk / sqrt(k^2 - n^2)

    of its spectral density S(k) over the plane (an Abel transform; Heath 1987, "An application of
    the isotropic road roughness assumption", Journal of Sound and Vibration 115). Its inverse
    gives the variance of all waves shorter than 1/k in closed form,

        T(k) = integral from k to highest of Gd(n) n dn / sqrt(n^2 - k^2),

    and each wave carries the variance T(k_i) - T(k_i+1) of a ring between two neighbouring k.

    Classes and Gd(n0) are those of ISO 8608:2016: geometric means, 16e-6 m^3 for A and four times
    as much for each further class.

    Examples
    --------
    >>> road = Road(road_class="C", seed=1)
    >>> road.gd(0.1)
    array(0.000256)
    >>> bool(abs(road.height(3.0, 1.5)) < 0.2)
    True
    """

    road_class: str | None = None
    "Class ``A`` to ``H`` of ISO 8608; this or `gd_n0` must be given."
    gd_n0: float | None = None
    "Displacement spectrum at 0.1 cycles/m, one-sided [m^3]."
    waviness: float = 2.0
    "Exponent of the fall of the spectrum with spatial frequency [1]."
    lowest: float = 0.01
    "Lowest spatial frequency [1/m]."
    highest: float = 10.0
    "Highest spatial frequency [1/m]: tyres envelop shorter waves (ISO 8608)."
    coherence: Coherence = "isotropic"
    """Coherence of parallel tracks: ``"isotropic"``, the same statistics along any line, or
    ``"full"``, the same profile in all tracks."""
    direction: float = 0.0
    "Direction of the road where coherence is full, counter-clockwise from east [rad]."
    waves: int = 8192
    """Number of plane waves. By default they are about 0.001 1/m apart in the spectrum at 1 1/m and
    0.004 1/m at 10 1/m; average a spectrum of a finer resolution over bands."""
    seed: int = 0
    "Seed of all random numbers."

    def __post_init__(self) -> None:
        if (self.road_class is None) == (self.gd_n0 is None):
            raise ValueError(
                "one of road_class and gd_n0 must be given, "
                f"got road_class={self.road_class} and gd_n0={self.gd_n0}."
            )
        if self.road_class is not None and self.road_class not in GD_N0:
            raise ValueError(f"road_class must be A to H, got {self.road_class!r}.")
        if self.gd_n0 is not None:
            check_positive(self, "gd_n0")
        check_positive(self, "lowest", "highest")
        check_finite(self, "direction", "waviness")
        if not 0 <= self.waviness <= 5:
            raise ValueError(f"waviness must be from 0 to 5, got {self.waviness}.")
        if not self.lowest < self.highest:
            raise ValueError(
                f"lowest must be less than highest, got {self.lowest} and {self.highest} 1/m."
            )
        if self.coherence not in get_args(Coherence):
            raise ValueError(
                f"coherence must be one of {', '.join(get_args(Coherence))}, "
                f"got {self.coherence!r}."
            )
        if isinstance(self.waves, bool) or self.waves != int(self.waves) or self.waves < 1:
            raise ValueError(f"waves must be a whole number of at least 1, got {self.waves}.")
        check_seed(self.seed)

    def gd(self, n: npt.ArrayLike) -> Floats:
        """One-sided displacement spectrum along a line, between `lowest` and `highest`.

        Parameters
        ----------
        n : array_like
            Spatial frequency [1/m].

        Returns
        -------
        ndarray
            Spectrum [m^3]; its integral over n is the variance in a band [m^2].
        """
        at_n0 = GD_N0[self.road_class] if self.road_class is not None else self.gd_n0
        return np.asarray(
            np.float64(at_n0) * (np.asarray(n, dtype=np.float64) / N0) ** -self.waviness
        )

    def to_dict(self) -> dict[str, Any]:
        """Kind and parameters of the ground, and Gd(n0) [m^3]."""
        return super().to_dict() | {"gd_n0": float(self.gd(N0))}

    def _height(self, x: Floats, y: Floats) -> Floats:
        return np.asarray(_kernels.plane_waves(self._waves, x, y))

    @cached_property
    def _waves(self) -> Floats:
        """Amplitude [m], wave vector [1/m, 1/m] and phase [turns] of each wave."""
        number = int(self.waves)
        # equal steps of the fourth root of the frequency: a compromise of logarithmic steps, for
        # long waves, and equal ones, for the resolution of short waves on long roads
        edges = np.linspace(self.lowest**0.25, self.highest**0.25, number + 1) ** 4
        edges[[0, -1]] = self.lowest, self.highest
        place = uniform_numbers(self.seed, _RING, number)
        k = edges[:-1] + place * np.diff(edges)
        if self.coherence == "isotropic":
            variance = -np.diff(self._variance_beyond(edges))
            # Steps of the golden ratio separate the directions of neighbouring rings, so that the
            # waves of each band of frequencies have all directions.
            start = uniform_numbers(self.seed, _ANGLE, 1)[0]
            angle = math.pi * np.remainder(start + _GOLDEN_RATIO * np.arange(number), 1.0)
        else:
            variance = np.diff(self._variance_up_to(edges))
            angle = np.full(number, self.direction)
        phase = uniform_numbers(self.seed, _PHASE, number)
        amplitude = np.sqrt(2.0 * variance)
        return np.column_stack([amplitude, k * np.cos(angle), k * np.sin(angle), phase])

    def _variance_beyond(self, k: Floats) -> Floats:
        """T(k): with n = k cosh(t), the integral of Gd(k) k cosh(t)^(1-w) over t."""
        node, weight = np.polynomial.legendre.leggauss(_QUADRATURE)
        half = 0.5 * np.arccosh(np.maximum(self.highest / k, 1.0))
        t = half[:, None] * (node + 1.0)
        return np.asarray(self.gd(k) * k * half * (np.cosh(t) ** (1.0 - self.waviness) @ weight))

    def _variance_up_to(self, n: Floats) -> Floats:
        """Integral of Gd from `lowest` to n."""
        power = 1.0 - self.waviness
        if power == 0.0:
            return np.asarray(self.gd(N0) * N0 * np.log(n / self.lowest))
        return np.asarray((self.gd(n) * n - self.gd(self.lowest) * self.lowest) / power)


def track_coherence(n: npt.ArrayLike, distance: float, *, waviness: float = 2.0) -> Floats:
    """Coherence of two parallel tracks on an isotropic road with a power-law spectrum.

    With x = 2 pi n d and nu = w / 2 it is ``2 ** (1 - nu) / Gamma(nu) * x ** nu * K_nu(x)``, K the
    modified Bessel function of the second kind; x K_1(x) for w = 2. It is the cross-spectrum of the
    two tracks, which is real, divided by the spectrum of either.

    Parameters
    ----------
    n : array_like
        Spatial frequency [1/m].
    distance : float
        Distance between the tracks [m].
    waviness : float
        Exponent of the spectrum [1].

    Returns
    -------
    ndarray
        Coherence [1]: 1 for waves much longer than the distance, 0 for much shorter ones.

    Examples
    --------
    >>> track_coherence([0.01, 0.1, 1.0], 1.5).round(4)
    array([0.9868, 0.6264, 0.0003])
    """
    from scipy.special import gamma, kv

    nu = 0.5 * waviness
    x = 2.0 * np.pi * np.asarray(n, dtype=np.float64) * distance
    with np.errstate(invalid="ignore"):
        value = 2.0 ** (1.0 - nu) / gamma(nu) * x**nu * kv(nu, x)
    return np.where(x == 0.0, 1.0, value)
