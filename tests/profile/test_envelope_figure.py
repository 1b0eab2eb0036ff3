"""Figure of envelopes over the ground: curves and limits."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from trueterrain.core.errors import CoverageError
from trueterrain.core.schemas import make_profile
from trueterrain.figures import tyre_envelopes
from trueterrain.profile import RadialSpringTyre, TandemCams, effective_road, tyre_envelope

S = np.arange(-100, 101) * 0.01
CLEAT = make_profile(S, np.where(np.abs(S) < 0.025, 0.01, 0.0))


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


def test_ground_and_envelopes_are_drawn_as_they_are_within_the_limits():
    felt = {
        "cams": effective_road(CLEAT, tyre=TandemCams()),
        "springs": tyre_envelope(CLEAT, tyre=RadialSpringTyre()),
    }
    ax = tyre_envelopes(CLEAT, felt, between=(-0.3, 0.3))
    assert [line.get_label() for line in ax.lines] == ["ground", "cams", "springs"]
    inside = (S >= -0.3) & (S <= 0.3)
    for line, road in zip(ax.lines, (CLEAT, *felt.values()), strict=True):
        assert_array_equal(line.get_xdata(), S[inside])
        assert_array_equal(line.get_ydata(), road.height.values[inside])
    assert ax.get_ylabel() == "Height [mm]"
    low, high = ax.get_ylim()
    assert low < 0 < 0.01 < high
    ax.figure.canvas.draw()
    assert any("vertical exaggeration" in note.get_text() for note in ax.texts + ax.artists)


def test_several_tracks_and_empty_stretches_are_refused():
    pair = make_profile(S, np.zeros((2, S.size)), tracks=["left", "right"])
    with pytest.raises(CoverageError, match="ground has several tracks"):
        tyre_envelopes(pair, {})
    with pytest.raises(CoverageError, match="disc has several tracks"):
        tyre_envelopes(CLEAT, {"disc": tyre_envelope(pair)})
    with pytest.raises(CoverageError, match="no heights between 5 m and 6 m"):
        tyre_envelopes(CLEAT, {}, between=(5, 6))
