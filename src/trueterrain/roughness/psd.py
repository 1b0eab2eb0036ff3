"""Power spectral density of profiles, smoothed and rated as in ISO 8608.

Spectra are one-sided displacement spectra Gd(n) over the spatial frequency n [cycles/m], in m³: the
integral of Gd over a band is the variance of the heights in it. A road is described by
Gd(n) = Gd(n0) (n / n0) ** -w with n0 = 0.1 cycles/m and the waviness w, and classed by Gd(n0).

Of ISO 8608:2016 the class limits, the smoothing and the range of the fit were found in public
programs and excerpts; its body was not available. How the standard weights the bands in its fit is
therefore not known: here the weight of a band is the inverse of its variance.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import CoverageError
from trueterrain.core.provenance import add_step
from trueterrain.core.renamed import rename_keyword
from trueterrain.roughness import _spectrum
from trueterrain.roughness._segments import cut_segments, finite_tracks, sample_range
from trueterrain.roughness._spectrum import FrequencyBands, SpectralLines
from trueterrain.roughness.filters import require_equal
from trueterrain.roughness.iso8608 import N0, road_class, smoothing_bands
from trueterrain.roughness.settings import require_positive

__all__ = ["PsdSettings", "psd"]

Array = npt.NDArray[np.float64]

_MIN_BANDS = 3  # for a line of two parameters, so that degrees of freedom are left
_SCATTER_TEST = 0.95  # [1] level of the chi-squared test; if it fails, the intervals are widened
_MAX_ITERATIONS = 20  # of the fit, which takes about 4

_DENSITY = {"units": "m3"}
_FREQUENCY = {"units": "1/m"}
_RATED = ("gd_n0", "gd_n0_low", "gd_n0_high", "waviness", "waviness_low", "waviness_high")


@dataclass(frozen=True, kw_only=True)
class PsdSettings:
    """Settings of Welch's method and of the fit of a power law.

    Examples
    --------
    >>> PsdSettings(waviness=2.0).block
    1000.0
    >>> PsdSettings(lowest=3.0)
    Traceback (most recent call last):
    ValueError: lowest must be less than highest, got 3.0 and 2.83 1/m
    """

    block: float = 1000.0
    """Length of the blocks whose spectra are averaged, Hann windows that overlap by half; the
    resolution is its inverse, and a shorter profile is one block [m]."""

    lowest: float = 0.011
    "Lowest spatial frequency of the fit: centres of bands count [1/m]."

    highest: float = 2.83
    "Highest spatial frequency of the fit [1/m]."

    waviness: float | None = None
    "Waviness to assume, 2 in the classes of the standard; fitted by default [1]."

    confidence: float = 0.95
    "Confidence level of the intervals [1]."

    def __post_init__(self) -> None:
        require_positive("block", self.block, " m")
        for name in ("lowest", "highest"):
            require_positive(name, getattr(self, name), " 1/m")
        if not self.lowest < self.highest:
            message = f"lowest must be less than highest, got {self.lowest} and {self.highest} 1/m"
            raise ValueError(message)
        if self.waviness is not None and not np.isfinite(self.waviness):
            message = f"waviness must be finite, got {self.waviness}"
            raise ValueError(message)
        if not 0 < self.confidence < 1:
            message = f"confidence must be between 0 and 1, got {self.confidence}"
            raise ValueError(message)


@rename_keyword("options", "settings")
def psd(
    profile: xr.Dataset, *, settings: PsdSettings = PsdSettings(), segment: float | None = None
) -> xr.Dataset:
    """Power spectral density of each track, smoothed, with class, Gd(n0) and waviness.

    Parameters
    ----------
    profile : xarray.Dataset
        Profile with dimension s, optionally track [m]; equally spaced.
    settings : PsdSettings
        Blocks, range of the fit, confidence.
    segment : float, optional
        Length of fixed segments that are also rated each by itself [m].

    Returns
    -------
    xarray.Dataset
        ``density`` (track, n), Gd at the lines n [m³]; ``smoothed``, ``smoothed_low`` and
        ``smoothed_high`` (track, band), its mean in bands and the confidence interval of that mean
        [m³], with the coordinates ``lower``, ``centre``, ``upper`` (band) [1/m], ``fitted`` (band),
        whether the fit used it, and ``degrees`` (band), its degrees of freedom. Of the fit
        ``gd_n0`` [m³] and ``waviness`` [1] (track) with ``..._low`` and ``..._high``, and
        ``road_class`` (track). With `segment` the fit of each segment as ``segment_...`` (track,
        segment), with the coordinates ``start``, ``end`` [m] and ``complete`` (segment); NaN and ""
        for a last one too short.

    Raises
    ------
    ValueError
        If `segment` is shorter than the spacing.
    SchemaError
        If `profile` is not a Profile, or its spacing is not equal.
    CoverageError
        If a height is not finite, or the profile is too short or flat for the fit.

    Notes
    -----
    The density is Welch's (1967). A band holds the mean of its lines, those at its edges by the
    fraction inside; its ratio to the true density is distributed as chi² of v degrees of freedom
    over v, where v allows for the correlation of neighbouring lines and of overlapping blocks under
    the window. Gd(n0) and w are fitted by weighted least squares to the logarithms of the bands,
    less their known bias, with the inverse of their known variance as weight; the model is the
    power law with the leakage of the window and the averaging over bands. If a chi² test at 95 %
    rejects the power law, the variance factor of the fit widens the intervals.

    Bands less than three lines wide, as those of long waves on a short profile, are left out. All
    of this assumes a stationary random road; potholes and repairs violate that. Waves shorter than
    two spacings must have been removed by the profiler, or they are aliased to longer ones.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_profile
    >>> from trueterrain.simulate.ground import Road
    >>> s = np.arange(0.0, 2000.0, 0.1)
    >>> road = make_profile(s, Road(road_class="B", seed=1).height(s, 0 * s))
    >>> rated = psd(road)
    >>> print(rated.road_class.item(), rated.gd_n0.item() < 128e-6)
    B True
    """
    station, heights, names = finite_tracks(profile)
    step = require_equal(station, "for a spectrum")
    spectra = [_analyse_track(height, step, settings) for height in heights]
    data = _psd_dataset(spectra, names)
    if segment is not None:
        segments = cut_segments(station, segment)
        rows = []
        for height in heights:
            pieces = zip(segments.start, segments.end, segments.complete, strict=True)
            rows.append(
                [_rate_segment(station, height, step, settings, *piece) for piece in pieces]
            )
        parts = np.array(rows, dtype=float).reshape(len(names), -1, len(_RATED))
        for at, name in enumerate(_RATED):
            attrs = data[name].attrs
            data[f"segment_{name}"] = (("track", "segment"), parts[..., at], attrs)
        data["segment_road_class"] = (("track", "segment"), road_class(parts[..., 0]))
        data = data.assign_coords(segments.coordinates(np.arange(segments.start.size)))
    parameters = {"options": settings, "segment": segment}
    return add_step(data, "psd", parameters=parameters, after=profile)


@dataclass(frozen=True, kw_only=True)
class _TrackSpectrum:
    """Spectrum of a track, its bands and its fit."""

    spectrum: SpectralLines
    bands: FrequencyBands
    fitted: npt.NDArray[np.bool_]
    smoothed: Array
    degrees: Array
    interval: tuple[Array, Array]
    rated: tuple[float, ...]


def _analyse_track(height: Array, step: float, settings: PsdSettings) -> _TrackSpectrum:
    from scipy.stats import chi2

    spectrum = _spectrum.welch_lines(height, step, _spectrum.block_samples(settings.block, step))
    bands = smoothing_bands()
    bands = bands[_spectrum.resolved_bands(bands, spectrum)]
    fitted = (bands.centre >= settings.lowest) & (bands.centre <= settings.highest)
    if fitted.sum() < _MIN_BANDS:
        length = step * (height.size - 1)
        raise CoverageError(
            f"has {int(fitted.sum())} bands from {settings.lowest:g} to {settings.highest:g} "
            f"cycles/m, at least {_MIN_BANDS} are needed: {length:g} m in steps of {step:g} m",
            place="axis s",
            cure="Give a longer or finer profile, or fit other frequencies.",
        )
    smoothed = _spectrum.smooth_bands(spectrum.density, spectrum.width, bands)
    if not (smoothed[fitted] > 0).all():
        raise CoverageError(
            "is flat: its spectrum is 0", place="variable height", cure="Check the recording."
        )
    degrees = _spectrum.degrees_of_freedom(spectrum, bands)
    tail = 0.5 * (1 - settings.confidence)
    low = degrees / chi2.ppf(1 - tail, degrees) * smoothed
    high = degrees / chi2.ppf(tail, degrees) * smoothed
    rated = _fit_spectrum(spectrum, bands[fitted], smoothed[fitted], degrees[fitted], settings)
    return _TrackSpectrum(
        spectrum=spectrum,
        bands=bands,
        fitted=fitted,
        smoothed=smoothed,
        degrees=degrees,
        interval=(low, high),
        rated=rated,
    )


def _fit_spectrum(
    spectrum: SpectralLines,
    bands: FrequencyBands,
    smoothed: Array,
    degrees: Array,
    settings: PsdSettings,
) -> tuple[float, ...]:
    """Gd(n0) and waviness, each with its interval, in the order of _RATED."""
    from scipy.special import polygamma, psi
    from scipy.stats import chi2, norm

    # ln(chi2 / v) has the mean psi(v/2) - ln(v/2) and the variance psi'(v/2)
    half = 0.5 * degrees
    observed = np.log(smoothed) - psi(half) + np.log(half)
    weight = 1 / polygamma(1, half)
    fixed = settings.waviness is not None
    # ln Gd(n) = ln Gd(n0) - w ln(n / n0); these derivatives neglect how leakage and averaging over
    # the band change with w, while the residuals contain both
    design = np.column_stack([np.ones(observed.size), -np.log(bands.centre / N0)])
    design = design[:, : 1 if fixed else 2]
    waviness = 2.0 if settings.waviness is None else settings.waviness
    level = 0.0
    normal = design.T * weight @ design
    for _ in range(_MAX_ITERATIONS):
        shape = np.log(_spectrum.expected_bands(waviness, spectrum, bands) * N0**waviness)
        residual = observed - shape - level
        change = np.linalg.solve(normal, design.T * weight @ residual)
        level += float(change[0])
        waviness += 0.0 if fixed else float(change[1])
        if abs(change).max() < 1e-10:
            break
    degrees_of_freedom = observed.size - design.shape[1]
    scatter = float(weight @ residual**2)
    rejected = scatter > chi2.ppf(_SCATTER_TEST, degrees_of_freedom)
    variance_factor = scatter / degrees_of_freedom if rejected else 1.0
    sd = np.sqrt(np.diag(np.linalg.inv(normal)) * variance_factor)
    half_width = float(norm.ppf(0.5 + 0.5 * settings.confidence)) * np.append(sd, 0.0)
    gd = np.exp(level + np.array([0.0, -half_width[0], half_width[0]]))
    low, high = waviness - float(half_width[1]), waviness + float(half_width[1])
    return (*gd.tolist(), waviness, low, high)


def _rate_segment(
    station: Array,
    height: Array,
    step: float,
    settings: PsdSettings,
    start: float,
    end: float,
    complete: bool,
) -> tuple[float, ...]:
    inside = sample_range(station, start, end)
    try:
        return _analyse_track(height[inside], step, settings).rated
    except CoverageError as error:
        if complete:
            error.place = f"segment from {start:g} to {end:g} m"
            raise
        return (np.nan,) * len(_RATED)


def _psd_dataset(spectra: list[_TrackSpectrum], names: list[str]) -> xr.Dataset:
    first = spectra[0]
    over_bands = {
        "smoothed": [one.smoothed for one in spectra],
        "smoothed_low": [one.interval[0] for one in spectra],
        "smoothed_high": [one.interval[1] for one in spectra],
    }
    rated = np.array([one.rated for one in spectra])
    density = np.array([one.spectrum.density for one in spectra])
    data = xr.Dataset({"density": (("track", "n"), density, _DENSITY)}, {"track": names})
    for name, values in over_bands.items():
        data[name] = (("track", "band"), np.array(values), _DENSITY)
    for at, name in enumerate(_RATED):
        data[name] = ("track", rated[:, at], _DENSITY if name.startswith("gd") else {"units": "1"})
    data["road_class"] = ("track", road_class(rated[:, 0]))
    return data.assign_coords(
        n=("n", first.spectrum.n, _FREQUENCY),
        lower=("band", first.bands.lower, _FREQUENCY),
        centre=("band", first.bands.centre, _FREQUENCY),
        upper=("band", first.bands.upper, _FREQUENCY),
        fitted=("band", first.fitted),
        degrees=("band", first.degrees, {"units": "1"}),
    )
