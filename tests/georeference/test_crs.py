"""Systems of maps that points are moved into: they keep lengths, or are refused."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from trueterrain.core.schemas import make_points
from trueterrain.geometry.topocentric import check_crs, into_crs

MOST = 0.0035  # [1] change of lengths that is allowed
CHANGE = 1e-5  # [1] of the scale from the origin to the corners of a square
SIDE = 100.0  # [m]


def change_of_lengths(crs, longitude, latitude):
    """Of the sides and diagonals of a square on the ground, as a map in the system shows them."""
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * SIDE
    moved = into_crs(make_points(*corners.T, np.zeros(4)), (longitude, latitude, 0.0), crs)
    found = np.stack([moved.easting.values, moved.northing.values], axis=1)
    pairs = [(0, 1), (1, 2), (0, 2), (1, 3)]
    return max(
        abs(np.hypot(*(found[i] - found[j])) / np.hypot(*(corners[i] - corners[j])) - 1)
        for i, j in pairs
    )


@pytest.mark.parametrize(
    ("crs", "place"),
    [
        ("EPSG:32632", (11.0, 48.0)),
        ("EPSG:25832", (12.0, 54.0)),  # edge of a zone
        ("EPSG:32633", (11.5, 48.0)),  # a work that began in the next zone
        ("EPSG:2154", (-2.0, 48.5)),
        ("EPSG:2154", (9.2, 42.0)),
        ("EPSG:3006", (24.1, 65.8)),
        ("EPSG:27700", (-6.0, 57.5)),
        ("EPSG:5514", (14.4, 50.1)),  # axes that point west and south
        ("EPSG:2193", (174.8, -41.3)),
        ("EPSG:32733", (15.0, 0.0)),
    ],
)
def test_systems_for_surveying_are_taken(crs, place):
    assert change_of_lengths(crs, *place) < MOST


@pytest.mark.parametrize(
    ("crs", "place", "factor", "cure"),
    [
        ("EPSG:3857", (11.0, 48.0), "1.49", "EPSG:32632"),
        ("EPSG:32630", (11.0, 48.0), "1.013", "EPSG:32632"),
        ("EPSG:32631", (11.0, 48.0), "1.004", "EPSG:32632"),
        ("EPSG:32632", (-71.0, -33.0), "", "EPSG:32719"),
        ("EPSG:3395", (151.2, -33.9), "1.2", "EPSG:32756"),
        ("EPSG:3035", (-9.0, 38.7), "", "EPSG:32629"),  # areas are true, lengths are not
    ],
)
def test_systems_that_stretch_the_road_are_refused(crs, place, factor, cure):
    rule = f"crs must change lengths by at most 0.35%.* is .*{factor}.*{cure}"
    with pytest.raises(ValueError, match=rule):
        check_crs(crs, (*place, 0.0))
    with pytest.raises(ValueError, match=rule):
        change_of_lengths(crs, *place)


@settings(max_examples=60, deadline=None)
@given(
    st.sampled_from([3857, 3395, 3035, 2154, 5070, *range(32601, 32661), *range(32701, 32761)]),
    st.floats(-180, 179.9),
    st.floats(-80, 80),
)
def test_no_length_changes_in_silence(code, longitude, latitude):
    """Whatever system at whatever place: it is refused, or lengths are what they were."""
    try:
        found = change_of_lengths(f"EPSG:{code}", longitude, latitude)
    except ValueError as error:
        assert "at most 0.35%" in str(error)  # noqa: PT017
    else:
        assert found < MOST + CHANGE
