"""Localised roughness, stretches above a threshold, and histograms."""

import numpy as np
import pytest
import xarray as xr
from numpy.testing import assert_allclose

from trueterrain.core.errors import CoverageError, SchemaError
from trueterrain.core.provenance import provenance_steps
from trueterrain.core.schemas import make_profile
from trueterrain.roughness import (
    IN_PER_MI,
    LONG_CONTINUOUS,
    SHORT_CONTINUOUS,
    continuous_iri,
    find_stretches,
    iri,
    iri_histogram,
    localised_roughness,
)

EXACT = 1e-9  # [m, or m/km] rounding
S = 0.1 * np.arange(6000)


def bumps(*places):
    """Smooth road with bumps 20 mm high."""
    return sum(0.02 * np.exp(-((S - place) ** 2)) for place in places)


def values(*rows):
    s = np.arange(len(rows[0]), dtype=float)
    names = list("abc"[: len(rows)])
    return xr.DataArray(list(rows), {"track": names, "s": s}, ("track", "s"), attrs={"units": "x"})


def test_stretches_end_where_lines_cross_the_threshold():
    found = find_stretches(values([0, 4, 4, 0, 0, 2, 3, 1, 0], [0, 0, 0, 0, 0, 0, 0, 0, 0]), 1.0)
    assert list(found.track.values) == ["a", "a"]
    assert_allclose(found.start, [0.25, 4.5], rtol=0, atol=EXACT)
    assert_allclose(found.end, [2.75, 7.0], rtol=0, atol=EXACT)
    assert found.peak.values.tolist() == [4.0, 3.0]
    assert found.peak_at.values.tolist() == [1.0, 6.0]
    assert found.peak.attrs["units"] == "x"


def test_stretches_may_reach_both_ends_and_come_in_the_order_of_tracks():
    found = find_stretches(values([5, 5, 5], [0, 0, 3], [3, 0, 0]), 1.0)
    assert found.track.values.tolist() == ["a", "b", "c"]
    assert_allclose(found.start, [0, 1 + 1 / 3, 0], rtol=0, atol=EXACT)
    assert_allclose(found.end, [2, 2, 2 / 3], rtol=0, atol=EXACT)


def test_no_value_above_gives_no_stretch():
    found = find_stretches(values([1, 1, 1]), 1.0)
    assert found.sizes["stretch"] == 0
    assert found.track.size == 0


def test_bumps_are_found_where_they_are():
    profile = make_profile(S, [bumps(200.0, 420.0), bumps(300.0)], tracks=["left", "right"])
    rough = localised_roughness(profile, 4.0)
    assert rough.track.values.tolist() == ["left", "left", "right"]
    assert_allclose(rough.peak_at, [200, 420, 300], rtol=0, atol=0.5 * SHORT_CONTINUOUS[0])
    sliding = continuous_iri(profile, SHORT_CONTINUOUS[0])
    assert rough.peak[2] == sliding.iri.sel(track="right").max()
    for stretch in range(3):
        one = sliding.iri.sel(track=rough.track.values[stretch])
        inside = (one.s > rough.start[stretch]) & (one.s < rough.end[stretch])
        assert (one[inside] > 4.0).all()
    assert provenance_steps(rough)[-1]["parameters"]["threshold"] == 4.0


def test_the_windows_of_the_reports_are_25_and_528_feet():
    assert SHORT_CONTINUOUS[0] == pytest.approx(25 * 0.3048)
    assert LONG_CONTINUOUS[0] == pytest.approx(528 * 0.3048)
    assert pytest.approx([SHORT_CONTINUOUS[1], LONG_CONTINUOUS[1]]) == [1.4204545, 0.7891414]


def test_inches_per_mile():
    """1 m/km is 1e-3, and an inch per mile 0.0254 / 1609.344."""
    assert_allclose(IN_PER_MI, 1e-3 / (0.0254 / 1609.344), rtol=1e-12, atol=0)


def test_histogram_weights_segments_by_their_length():
    profile = make_profile(S, [bumps(110.0), bumps(10.0, 590.0)], tracks=["left", "right"])
    index = iri(profile, segment=250.0)  # the last segment has 99.9 m
    histogram = iri_histogram(index, [0.2, 5.0])
    for track in ("left", "right"):
        parts = index.segment_iri.sel(track=track).values
        truth = [
            sum(
                length
                for length, part in zip([250, 250, 99.9], parts, strict=True)
                if a <= part < b
            )
            for a, b in ((0, 0.2), (0.2, 5.0), (5.0, np.inf))
        ]
        assert_allclose(histogram.length.sel(track=track), truth, rtol=0, atol=1e-6)
    assert_allclose(histogram.fraction.sum("class"), 1.0, rtol=0, atol=EXACT)
    assert histogram.above.values.tolist() == [0.0, 0.2, 5.0]
    assert histogram.below.values.tolist() == [0.2, 5.0, np.inf]


def test_a_value_on_a_limit_is_in_the_rougher_class():
    index = iri(make_profile(S, bumps(300.0)), segment=300.0)
    edge = index.segment_iri.values[0, 1]
    assert iri_histogram(index, [edge]).fraction.values[0, 1] > 0.4


def test_bad_arguments_are_refused():
    profile = make_profile(S, bumps(300.0))
    with pytest.raises(ValueError, match="threshold must be finite and greater than 0 m/km"):
        localised_roughness(profile, 0.0)
    with pytest.raises(CoverageError, match="is shorter than the window"):
        localised_roughness(profile, 1.0, length=700.0)
    with pytest.raises(SchemaError, match=r"dimensions \(track, s\), got \(s\)"):
        find_stretches(values([1, 2, 3])[0], 1.0)
    with pytest.raises(ValueError, match="index must hold segments"):
        iri_histogram(iri(profile), [1.0])
    for edges in ([], [2.0, 1.0], [0.0, 1.0]):
        with pytest.raises(ValueError, match="edges must be numbers that ascend"):
            iri_histogram(iri(profile, segment=100.0), edges)
