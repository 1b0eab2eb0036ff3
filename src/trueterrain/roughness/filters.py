"""Filters of profiles, given by wavelength: moving average and Butterworth, zero phase.

Waves shorter than ``shortest`` or longer than ``longest`` are removed: the first alone is a low
pass, the second alone a high pass, both together a band pass. Nothing is shifted along the road.

Beyond its ends the profile is extended by odd reflection, its point reflection about the last
sample: no step, and the same grade. A uniform grade passes a low pass unchanged and is removed by a
high pass, up to the very ends.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import CoverageError, SchemaError
from trueterrain.core.provenance import add_step
from trueterrain.core.schemas import make_profile
from trueterrain.roughness._drive import equal_step
from trueterrain.roughness._segments import finite_tracks
from trueterrain.roughness.settings import require_positive

__all__ = ["FILTER_250_MM", "Butterworth", "Filter", "MovingAverage", "filter_profile"]

Array = npt.NDArray[np.float64]

_SPACING_TOLERANCE = 1e-3  # [steps] as for the car, see IriSettings
_MAX_ORDER = 50
_DECAY = 1e-4  # [1] fraction to which the impulse response of a filter decays within the extension


@dataclass(frozen=True, kw_only=True)
class Filter(ABC):
    """Filter of a profile, by the wavelengths that it removes."""

    shortest: float | None = None
    "Waves shorter than this are removed [m]."

    longest: float | None = None
    "Waves longer than this are removed [m]."

    def __post_init__(self) -> None:
        if self.shortest is None and self.longest is None:
            message = "one of shortest and longest must be given, got neither"
            raise ValueError(message)
        for name in ("shortest", "longest"):
            value = getattr(self, name)
            if value is not None:
                require_positive(name, value, " m")
        if self.shortest is not None and self.longest is not None and self.shortest >= self.longest:
            message = (
                f"shortest must be less than longest, got {self.shortest:g} and {self.longest:g} m"
            )
            raise ValueError(message)

    @abstractmethod
    def filtered(self, station: Array, height: Array) -> Array:
        """Heights [m] of one track after the filter."""

    @abstractmethod
    def gain(self, wavelength: npt.ArrayLike, *, spacing: float = 0.0) -> Array:
        """Amplitude of a sine after the filter over its amplitude before [1]."""


@dataclass(frozen=True, kw_only=True)
class MovingAverage(Filter):
    """Moving average: mean of the straight lines between the samples, over a length around each.

    The low pass is the mean over `shortest`, the high pass the profile less the mean over
    `longest`, as profile viewers define it. The gain is sin(x) / x with x = pi length / wavelength:
    0 for a wave as long as the window, half of the power at 2.26 lengths, and -0.2 (inverted) at
    0.7 lengths. Spacing may be unequal.

    Examples
    --------
    >>> MovingAverage(shortest=0.25).gain([0.25, 0.5, 10.0]).round(3)
    array([0.   , 0.637, 0.999])
    """

    def filtered(self, station: Array, height: Array) -> Array:
        """Heights [m] of one track after the filter."""
        _require_length(station, max(self.shortest or 0.0, self.longest or 0.0))
        low = height if self.shortest is None else _moving_mean(station, height, self.shortest)
        return low if self.longest is None else low - _moving_mean(station, low, self.longest)

    def gain(self, wavelength: npt.ArrayLike, *, spacing: float = 0.0) -> Array:
        """Amplitude of a sine after the filter over its amplitude before; negative if inverted.

        Parameters
        ----------
        wavelength : array_like
            Wavelength of the sine [m].
        spacing : float
            Spacing of the samples [m]; the straight lines between them flatten the sine.

        Returns
        -------
        numpy.ndarray, shape of wavelength
            Gain [1].
        """
        n = 1 / np.asarray(wavelength, dtype=float)
        low = np.ones_like(n) if self.shortest is None else _mean_gain(n, self.shortest, spacing)
        return low if self.longest is None else low * (1 - _mean_gain(n, self.longest, spacing))


@dataclass(frozen=True, kw_only=True)
class Butterworth(Filter):
    """Butterworth filter applied forward and backward: zero phase, half the power at the cut-offs.

    Each application has the order `order`, and its cut-off is moved such that both together pass
    half of the power, 0.71 of the amplitude, of a wave as long as `shortest` or `longest`; beyond,
    the gain falls by 12 `order` dB per octave. Spacing must be equal.

    Examples
    --------
    >>> Butterworth(shortest=8.0, longest=90.0).gain([4.0, 8.0, 27.0, 90.0, 180.0]).round(3)
    array([0.036, 0.707, 0.999, 0.707, 0.036])
    """

    order: int = 3
    "Order of each application, at most 50: steeper ones ring over the whole profile."

    def __post_init__(self) -> None:
        super().__post_init__()
        known = not isinstance(self.order, bool) and 1 <= self.order <= _MAX_ORDER
        if not known or self.order != int(self.order):
            message = f"order must be a whole number from 1 to {_MAX_ORDER}, got {self.order}"
            raise ValueError(message)

    def filtered(self, station: Array, height: Array) -> Array:
        """Heights [m] of one track after the filter."""
        from scipy.signal import sosfiltfilt

        _require_length(station, max(self.shortest or 0.0, self.longest or 0.0))
        step = require_equal(station, "for a Butterworth filter")
        self._require_waves(step)
        # without the chord the profile ends at 0, so that its odd reflection is continuous
        fraction = (station - station[0]) / (station[-1] - station[0])
        grade = height[0] + fraction * (height[-1] - height[0])
        out = height - grade
        for kind, length in (("lowpass", self.shortest), ("highpass", self.longest)):
            if length is not None:
                sections, ring = self._sections(kind, length, step)
                out = sosfiltfilt(sections, out, padtype="odd", padlen=min(ring, out.size - 1))
        return out + grade if self.longest is None else np.ascontiguousarray(out)

    def gain(self, wavelength: npt.ArrayLike, *, spacing: float = 0.0) -> Array:
        """Amplitude of a sine after the filter over its amplitude before.

        Parameters
        ----------
        wavelength : array_like
            Wavelength of the sine [m].
        spacing : float
            Spacing of the samples [m]; the bilinear transform warps waves of a few spacings.

        Returns
        -------
        numpy.ndarray, shape of wavelength
            Gain [1].
        """
        here = _warped_frequency(np.asarray(wavelength, dtype=float), spacing)
        total = np.ones_like(here)
        power = 2 * int(self.order)
        # each application has |H|^2 = 1 / (1 + (n / n_c)^(2 order)); both together have |H|^2 as
        # their gain, which is 2^-1/2 at the cut-off if (n / n_c)^(2 order) is 2^1/2 - 1 there
        edge = np.sqrt(2.0) - 1.0
        if self.shortest is not None:
            total = total / (1 + edge * (here / _warped_frequency(self.shortest, spacing)) ** power)
        if self.longest is not None:
            total = total / (1 + edge * (_warped_frequency(self.longest, spacing) / here) ** power)
        return total

    def _sections(self, kind: str, length: float, step: float) -> tuple[Array, int]:
        """Second-order sections of one application, and samples in which its response decays."""
        from scipy.signal import butter, sos2zpk

        # n / n_c at which each application passes 2^-1/4 of the amplitude, see `gain`
        edge = (np.sqrt(2.0) - 1.0) ** (1 / (2 * int(self.order)))
        warped = _warped_frequency(length, step) * (1 / edge if kind == "lowpass" else edge)
        frequency = 2 / np.pi * np.arctan(float(warped) * np.pi * step)  # [1] of Nyquist's
        sections = butter(int(self.order), frequency, btype=kind, output="sos")
        slowest = float(np.max(np.abs(sos2zpk(sections)[1])))  # pole nearest to the unit circle
        return sections, int(np.ceil(np.log(_DECAY) / np.log(slowest)))

    def _require_waves(self, step: float) -> None:
        for name in ("shortest", "longest"):
            length = getattr(self, name)
            if length is not None and length <= 2 * step:
                message = f"{name} must be more than two spacings of {step:g} m, got {length:g} m"
                raise ValueError(message)


#: The moving average that pavement engineers know as the 250 mm filter.
FILTER_250_MM = MovingAverage(shortest=0.25)


def filter_profile(profile: xr.Dataset, by: Filter) -> xr.Dataset:
    """Filter a profile; the stations stay.

    Parameters
    ----------
    profile : xarray.Dataset
        Profile with dimension s, optionally track [m].
    by : Filter
        `MovingAverage` or `Butterworth`.

    Returns
    -------
    xarray.Dataset
        Profile with filtered heights [m]; positions are kept. Counts and standard deviations are
        dropped, since they do not hold for the filtered heights.

    Raises
    ------
    ValueError
        If a Butterworth filter has a cut-off of at most two spacings.
    SchemaError
        If `profile` is not a Profile, or its spacing is unequal and the filter is a Butterworth.
    CoverageError
        If a height is not finite, or the profile is shorter than the longest wave of the filter.

    Examples
    --------
    >>> s = np.arange(0.0, 300.0, 0.1)
    >>> hill, wave = 0.05 * s, 0.01 * np.sin(2 * np.pi * s / 20)
    >>> road = make_profile(s, hill + wave)
    >>> band = filter_profile(road, Butterworth(shortest=8.0, longest=90.0))
    >>> print(f"{float(band.height[1500:].max()):.3f} m")
    0.010 m
    """
    station, heights, names = finite_tracks(profile)
    rows = np.array([by.filtered(station, height) for height in heights])
    several = "track" in profile.dims
    kept = {
        name: profile[name].values
        for name in ("easting", "northing", "heading")
        if name in profile.data_vars
    }
    out = make_profile(
        station,
        rows if several else rows[0],
        tracks=names if several else None,
        crs=profile.attrs.get("crs", ""),
        **kept,
    )
    attrs = profile.attrs | out.attrs
    return add_step(out.assign_attrs(attrs), "filter_profile", parameters={"by": by}, after=profile)


def require_equal(station: Array, purpose: str) -> float:
    """Spacing of equally spaced stations [m]; the error names the purpose if it is not equal."""
    step = equal_step(station, _SPACING_TOLERANCE) if station.size > 1 else None
    if step is None:
        spacing = np.diff(station)
        found = f"spacings from {spacing.min():g} to {spacing.max():g} m" if spacing.size else "one"
        raise SchemaError(
            f"must be equally spaced {purpose}, got {found}",
            place="axis s",
            cure="Resample it first: `trueterrain convert --spacing`, or `resample_profile`.",
        )
    return step


def _require_length(station: Array, length: float) -> None:
    extent = float(station[-1] - station[0])
    if extent < length:
        raise CoverageError(
            f"is shorter than the filter: {extent:g} m, which must be at least {length:g} m",
            place="axis s",
            cure="Give a longer profile or cut shorter waves.",
        )


def _moving_mean(station: Array, height: Array, length: float) -> Array:
    """Mean of the straight lines over a length around each sample, of the extended profile."""
    from trueterrain.roughness import _kernels

    # samples within half a window of either end are reflected about it
    head = int(np.searchsorted(station, station[0] + 0.5 * length, side="right")) + 1
    tail = int(np.searchsorted(station, station[-1] - 0.5 * length)) - 1
    head, tail = min(head, station.size), max(tail, 0)

    def extended(values: Array) -> Array:
        before = 2 * values[0] - values[head - 1 : 0 : -1]
        after = 2 * values[-1] - values[-2 : tail - 1 if tail else None : -1]
        return np.concatenate([before, values, after])

    out = np.empty(station.size)
    _kernels.mean_of_lines(extended(station), extended(height), length, head - 1, out)
    return out


def _mean_gain(n: Array, length: float, spacing: float) -> Array:
    """Gain of the moving average over a length for spatial frequencies n [1/m]."""
    if spacing == 0.0:
        return np.asarray(np.sinc(n * length))
    # weight of each sample: integral over the window of its hat function, since straight lines
    # between samples are a sum of hats
    reach = int(0.5 * length / spacing) + 1
    at = np.arange(-reach, reach + 1.0)
    half = 0.5 * length / spacing
    weight = (_hat_integral(half - at) - _hat_integral(-half - at)) * spacing / length
    return np.asarray(np.cos(2 * np.pi * n[..., None] * spacing * at) @ weight)


def _hat_integral(t: Array) -> Array:
    """Integral up to t of the hat function, 1 at 0 and 0 at -1 and 1."""
    t = np.clip(t, -1.0, 1.0)
    return np.where(t < 0, 0.5 * (1 + t) ** 2, 1 - 0.5 * (1 - t) ** 2)


def _warped_frequency(length: npt.ArrayLike, spacing: float) -> Array:
    """Spatial frequency of a wavelength, warped by the bilinear transform [1/m]."""
    n = 1 / np.asarray(length, dtype=float)
    return np.asarray(np.tan(np.pi * n * spacing) / (np.pi * spacing) if spacing else n)
