"""Root mean squares in bands of wavelength: sines, generated roads, and bad profiles."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from trueterrain.core.errors import CoverageError, SchemaError
from trueterrain.core.provenance import provenance_steps
from trueterrain.core.schemas import make_profile
from trueterrain.roughness import WAVEBANDS, Butterworth, MovingAverage, waveband_rms

EXACT = 1e-12  # [m] rounding
S = 0.1 * np.arange(12_000)


@pytest.mark.parametrize("wavelength", [1.0, 4.0, 20.0])
def test_a_sine_has_its_rms_times_the_gain_of_each_band(wavelength):
    rated = waveband_rms(make_profile(S, 0.01 * np.sin(2 * np.pi * S / wavelength)), segment=400.0)
    for name, band in WAVEBANDS.items():
        truth = 0.01 / np.sqrt(2) * band.gain(wavelength, spacing=0.1)
        # [m] the reflected ends are 400 m away
        assert_allclose(rated.segment_rms.sel(band=name)[0, 1], truth, rtol=0, atol=1e-8)


def test_bands_are_two_octaves_each_and_adjacent():
    edges = [(band.shortest, band.longest) for band in WAVEBANDS.values()]
    assert [longest / shortest for shortest, longest in edges] == pytest.approx([4.0] * 3)
    assert edges[0][1] == edges[1][0]
    assert edges[1][1] == edges[2][0]


def test_the_mean_square_of_segments_is_that_of_the_whole():
    height = np.cumsum(np.random.default_rng(1).standard_normal(S.size)) * 1e-3
    rated = waveband_rms(make_profile(S, height), segment=100.0)
    assert rated.sizes == {"track": 1, "band": 3, "segment": 12}
    assert list(rated.complete.values) == [True] * 11 + [False]
    together = np.sqrt((rated.segment_rms**2).mean("segment"))  # 1000 samples each
    assert_allclose(together, rated.rms, rtol=0, atol=EXACT)


def test_bands_can_be_replaced_and_are_recorded():
    bands = {"mine": MovingAverage(shortest=1.0, longest=10.0)}
    height = np.cumsum(np.random.default_rng(2).standard_normal(S.size)) * 1e-3
    s = np.cumsum(np.random.default_rng(3).uniform(0.05, 0.15, S.size))
    rated = waveband_rms(make_profile(s, height), bands=bands)  # unequal spacing
    truth = np.sqrt(np.mean(bands["mine"].filtered(s, height) ** 2))
    assert_allclose(rated.rms.item(), truth, rtol=0, atol=EXACT)
    assert provenance_steps(rated)[-1]["parameters"]["bands"]["mine"]["longest"] == 10.0


def test_bad_profiles_are_refused():
    with pytest.raises(CoverageError, match=r"shorter than the filter: 9\.9 m, .* 11\.312 m"):
        waveband_rms(make_profile(S[:100], 0 * S[:100]))
    with pytest.raises(SchemaError, match="must be equally spaced"):
        waveband_rms(make_profile(S**1.1, S))
    with pytest.raises(CoverageError, match="s = 2 m: has no finite height"):
        waveband_rms(make_profile(S, np.where(np.arange(S.size) == 20, np.nan, 0.0)))
    with pytest.raises(ValueError, match="shortest must be more than two spacings"):
        waveband_rms(make_profile(10 * S, S), bands={"b": Butterworth(shortest=1.5, longest=9)})
    with pytest.raises(ValueError, match="at least one band"):
        waveband_rms(make_profile(S, S), bands={})
