"""Names in figures: text that matplotlib would typeset as mathematics is drawn literally."""

import matplotlib.figure
import numpy as np
import pytest

from trueterrain import figures
from trueterrain.core.schemas import make_profile
from trueterrain.roughness import (
    continuous_iri,
    iri,
    iri_histogram,
    psd,
    ride_number,
    rolling_straightedge,
    waveband_rms,
)
from trueterrain.roughness.agreement import filtered_profiles, profile_agreement

NAMES = ("$^$", "a$_{b$^", r"$\frac$", "costs 5$", "\x1b[31m$x$")


def profile():
    heights = 0.002 * np.cumsum(np.random.default_rng(3).normal(size=(len(NAMES), 600)), axis=1)
    return make_profile(0.1 * np.arange(600.0), heights, tracks=list(NAMES))


def several(data):
    """Five profiles of the same road."""
    return dict.fromkeys(NAMES, data.isel(track=0, drop=True))


DRAWN = {
    "profiles": lambda data: figures.profiles(data),
    "profiles of files": lambda data: figures.profiles(
        {name: data.isel(track=0, drop=True) for name in NAMES}
    ),
    "iri": lambda data: figures.iri_segments(iri(data, segment=20.0)),
    "continuous": lambda data: figures.continuous_roughness(continuous_iri(data, length=25.0)),
    "histogram": lambda data: figures.roughness_histogram(
        iri_histogram(iri(data, segment=10.0), [1.0, 2.0])
    ),
    "ride number": lambda data: figures.ride_number_segments(ride_number(data, segment=20.0)),
    "psd": lambda data: figures.road_spectrum(psd(data)),
    "straightedge": lambda data: figures.straightedge_deviation(rolling_straightedge(data)),
    "wavebands": lambda data: figures.waveband_segments(waveband_rms(data, segment=20.0)),
    "agreement": lambda data: figures.agreement_matrix(profile_agreement(several(data))),
    "overlay": lambda data: figures.agreement_overlay(filtered_profiles(several(data))),
    "spectrum": lambda data: figures.spectrum(
        {name: data.height.sel(track=name).values for name in NAMES}, 10.0, segment=10.0
    ),
}


@pytest.mark.parametrize("name", DRAWN)
def test_names_are_drawn_as_they_are_written(name):
    figure = DRAWN[name](profile()).get_figure(root=True)
    figure.canvas.draw()  # fails for what is no formula
    texts = [text for text in figure.findobj(matplotlib.text.Text) if text.get_visible()]
    # labels of logarithmic axes are formulas of matplotlib's own
    ours = [
        text for text in texts if "$" in text.get_text() and "mathdefault" not in text.get_text()
    ]
    assert ours
    assert not [text.get_text() for text in ours if text.get_parse_math()]
    assert not [text for text in texts if "\x1b" in text.get_text()]


def test_a_heading_is_drawn_as_it_is_written():
    figure = matplotlib.figure.Figure()
    figures.head_figure(figure, "$^$")
    figure.canvas.draw()
    assert figure.get_suptitle() == "$^$"
