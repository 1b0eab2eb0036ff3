"""Spectrum of one track: Welch's averaged periodogram, means in bands, degrees of freedom."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

_MIN_BLOCK = 16  # samples
_WINDOW = 1024  # samples of the window whose covariance is computed, which hardly depends on them
_MIN_LINES = 3.0  # of a band: narrower bands are correlated, and their variance is underestimated
_LAGS = 8  # lines that a Hann window correlates; beyond, the covariance is below 1e-4
_SPARE = 0.05  # of half a block, too little for another block at the end

# Leakage of a Hann window: the expected density of a line is this mean of three neighbours, the
# squared Fourier coefficients (1/4, 1/2, 1/4) of the window over their sum
_HANN_LINES = np.array([1.0, 4.0, 1.0]) / 6.0


@dataclass(frozen=True, kw_only=True)
class SpectralLines:
    """Spectral lines: densities at the multiples of the resolution, without the mean."""

    width: float
    "Distance of the lines, the resolution [1/m]."

    density: Array
    "One-sided spectral density at width, 2 width, ... [m³]."

    blocks: int
    "Number of averaged blocks."

    covariance: Array
    "Covariance of lines 0, 1, ... apart over the square of the expected density [1]."

    @property
    def n(self) -> Array:
        """Spatial frequency of the lines [1/m]."""
        return self.width * np.arange(1.0, self.density.size + 1)


@dataclass(frozen=True, kw_only=True)
class FrequencyBands:
    """Bands over which lines are averaged."""

    lower: Array
    "Lower edges [1/m]."

    centre: Array
    "Geometric centres [1/m]."

    upper: Array
    "Upper edges [1/m]."

    def __getitem__(self, which: npt.NDArray[np.bool_]) -> "FrequencyBands":
        return FrequencyBands(
            lower=self.lower[which], centre=self.centre[which], upper=self.upper[which]
        )


def welch_lines(height: Array, step: float, block: int) -> SpectralLines:
    """Welch's method: Hann windows of `block` samples, evenly spaced, each without its trend."""
    from scipy.fft import prev_fast_len, rfft

    size = prev_fast_len(min(block, height.size), real=True)
    starts = _block_starts(height.size, size)
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(size) / size)
    position = np.arange(size) - 0.5 * (size - 1)
    leverage = position / np.sum(position**2)
    total = np.zeros(size // 2 + 1)
    # allocated once, since new memory costs as much as the sums
    level, trend = np.empty(size), np.empty(size)
    for start in starts:
        part = height[start : start + size]
        np.subtract(part, part.mean(), out=level)
        np.multiply(position, np.einsum("i,i", leverage, level), out=trend)
        level -= trend
        level *= window
        pairs = rfft(level).view(np.float64).reshape(-1, 2)
        total += np.einsum("ij,ij->i", pairs, pairs)
    density = 2 * step / np.sum(window**2) / starts.size * total
    if size % 2 == 0:
        density[-1] *= 0.5  # Nyquist's line has no negative counterpart
    shift = (starts[1] - starts[0]) / size if starts.size > 1 else 1.0
    return SpectralLines(
        width=1 / (size * step),
        density=density[1:],
        blocks=starts.size,
        covariance=_line_covariance(starts.size, shift),
    )


def block_samples(length: float, step: float) -> int:
    """Samples of a block of a length [m]."""
    return max(round(length / step), _MIN_BLOCK)


def resolved_bands(bands: FrequencyBands, spectrum: SpectralLines) -> npt.NDArray[np.bool_]:
    """Bands that the lines resolve: at least three lines wide, above the two that detrending bias.

    Removing the trend of each block takes variance from the first two lines.
    """
    highest = spectrum.width * (spectrum.density.size + 0.5)
    wide = bands.upper - bands.lower >= _MIN_LINES * spectrum.width
    return wide & (bands.lower >= 2.5 * spectrum.width) & (bands.upper <= highest)


def smooth_bands(density: Array, width: float, bands: FrequencyBands) -> Array:
    """Mean density in each band; a line stands for the frequencies nearest to it."""
    parts = (_line_fractions(lower, upper) for lower, upper in _band_edges(bands, width))
    return np.array(
        [
            fraction @ density[first - 1 : first - 1 + fraction.size] / fraction.sum()
            for first, fraction in parts
        ]
    )


def degrees_of_freedom(spectrum: SpectralLines, bands: FrequencyBands) -> Array:
    """Equivalent degrees of freedom of the mean density in each band, of constant density there.

    A mean m of variance var(m) has the degrees of freedom 2 m^2 / var(m) of the chi-squared
    distribution with the same mean and variance; var(m) includes the covariance between lines.
    """
    degrees = []
    for lower, upper in _band_edges(bands, spectrum.width):
        _, weight = _line_fractions(lower, upper)
        variance = spectrum.covariance[0] * np.sum(weight**2)
        for apart in range(1, min(_LAGS, weight.size)):
            variance += 2 * spectrum.covariance[apart] * np.sum(weight[:-apart] * weight[apart:])
        degrees.append(2 * weight.sum() ** 2 / variance)
    return np.array(degrees)


def expected_bands(waviness: float, spectrum: SpectralLines, bands: FrequencyBands) -> Array:
    """Expected mean density in each band of a spectrum n ** -waviness, with leakage."""
    power_law = spectrum.n**-waviness
    padded = np.concatenate([[0.0], power_law, power_law[-1:]])
    return smooth_bands(np.convolve(padded, _HANN_LINES, mode="valid"), spectrum.width, bands)


def _band_edges(bands: FrequencyBands, width: float) -> list[tuple[float, float]]:
    """Edges of bands in lines."""
    return list(zip((bands.lower / width).tolist(), (bands.upper / width).tolist(), strict=True))


def _line_fractions(lower: float, upper: float) -> tuple[int, Array]:
    """First line of a band, and the fraction of each line, one spacing wide, inside the band."""
    first, last = int(lower + 0.5), int(upper + 0.5)
    line = np.arange(first, last + 1.0)
    fraction = np.minimum(line + 0.5, upper) - np.maximum(line - 0.5, lower)
    return (first, fraction) if fraction[-1] > 0 else (first, fraction[:-1])


def _block_starts(count: int, size: int) -> npt.NDArray[np.intp]:
    """First samples of blocks that overlap by half or a little more, over the whole profile."""
    more = int(np.ceil(max(count - size, 0) / (0.5 * size) - _SPARE))
    if more <= 0:
        return np.array([(count - size) // 2])
    return np.rint(np.linspace(0, count - size, more + 1)).astype(np.intp)


def _line_covariance(blocks: int, shift: float) -> Array:
    """Covariance of lines 0, 1, ... apart, of averaged blocks that are `shift` of a block apart.

    Of white noise: the squared spectrum of the product of both windows over the square of their
    energy, summed over all pairs of blocks; of one line this is the variance of Welch (1967).
    """
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(_WINDOW) / _WINDOW)
    total = np.zeros(_LAGS)
    for apart in range(blocks):
        moved = round(apart * shift * _WINDOW)
        if moved >= _WINDOW:
            break
        overlap = np.zeros(_WINDOW)
        overlap[: _WINDOW - moved] = window[: _WINDOW - moved] * window[moved:]
        covariance = np.abs(np.fft.rfft(overlap)[:_LAGS]) ** 2 / np.sum(window**2) ** 2
        total += (1 if apart == 0 else 2) * (1 - apart / blocks) * covariance
    return total / blocks
