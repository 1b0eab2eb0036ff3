"""Views of surfaces: what is drawn are the means of what was given, as high as is stated."""

import re

import numpy as np
import numpy.testing as npt
import pytest

from trueterrain.core.errors import SchemaError
from trueterrain.core.schemas import make_profile, make_surface
from trueterrain.report import SurfaceView
from trueterrain.report._surface import reduce_surface
from trueterrain.report._view import suggested_exaggeration
from trueterrain.surface import node_coordinates

EXACT = {"rtol": 0, "atol": 1e-12}  # [m] round-off of sums of a few heights
DRAWN = {"rtol": 0, "atol": 2e-4}  # [m] coordinates are written in tenths of a millimetre
SINGLE = {"rtol": 0, "atol": 1e-5}  # [mm] heights within 100 mm, in single precision
RATIO = {"rtol": 1e-6, "atol": 0}  # single precision of the ends of the axes


def plain(shape, spacing=(0.01, 0.01), height=None):
    """Map of some height."""
    rows, columns = shape
    return make_surface(
        np.zeros(shape) if height is None else height,
        easting=spacing[1] * np.arange(columns),
        northing=spacing[0] * np.arange(rows),
    )


def base_of(axis, name, unit="m"):
    """What the label of an axis says was taken off [m]."""
    return float(re.fullmatch(rf"{name} − (.*) m \[{unit}\]", axis["title"]["text"])[1])


def drawn_at(places):
    """Coordinates of nodes, as the page makes them of the ends of the rows."""
    fraction = np.asarray(places["fraction"])
    return tuple(
        np.asarray(places[f"{axis}_first"])[:, None]
        + fraction * (np.asarray(places[f"{axis}_last"]) - places[f"{axis}_first"])[:, None]
        for axis in "xy"
    )


def test_a_small_surface_is_drawn_node_by_node(page_of, bend):
    page = page_of(SurfaceView(surface=bend, colour="sd"))
    found = page.figures()[0]
    surface = found["figure"]["data"][0]
    axes = found["figure"]["layout"]["scene"]
    above = base_of(axes["zaxis"], "Height", "mm")
    npt.assert_allclose(page.unpacked(surface["z"]), 1000 * (bend.height.values - above), **SINGLE)
    npt.assert_allclose(page.unpacked(surface["surfacecolor"]), 1000 * bend.sd.values, **SINGLE)
    assert surface["colorbar"]["title"]["text"] == "Standard deviation [mm]"
    assert surface["connectgaps"] is False
    easting, northing = node_coordinates(bend)
    x, y = drawn_at(found["places"])
    npt.assert_allclose(x + base_of(axes["xaxis"], "Easting"), easting, **DRAWN)
    npt.assert_allclose(y + base_of(axes["yaxis"], "Northing"), northing, **DRAWN)
    assert "121 × 21 nodes are drawn: all there are." in page.texts("figcaption")[0]


def test_a_large_surface_is_drawn_in_means_of_blocks():
    generator = np.random.default_rng(5)
    height = generator.random((1201, 400))
    height[generator.random(height.shape) < 0.2] = np.nan
    height[:50, :50] = np.nan
    surface = plain(height.shape, height=height)
    blocks = reduce_surface(surface, "height")
    assert blocks.factors == (2, 2)
    for row, column in ((0, 0), (24, 24), (100, 7), (600, 199), (25, 25)):
        part = height[2 * row : 2 * row + 2, 2 * column : 2 * column + 2]
        known = part[np.isfinite(part)]
        expected = known.mean() if 2 * known.size >= part.size else np.nan
        npt.assert_allclose(blocks.height[row, column], expected, **EXACT)
    assert blocks.height.shape == (601, 200)
    npt.assert_allclose(blocks.northing[[0, -1], 0], [0.005, 12.0], **EXACT)
    npt.assert_allclose(blocks.easting[0, [0, -1]], [0.005, 3.985], **EXACT)


@pytest.mark.parametrize(
    ("shape", "spacing"),
    [
        ((400, 400), (0.01, 0.01)),
        ((401, 400), (0.01, 0.01)),
        ((30_000, 350), (0.01, 0.01)),
        ((3000, 1000), (0.05, 0.01)),
        ((100_000, 2), (0.01, 1.0)),
        ((2, 100_000), (1.0, 0.01)),
    ],
)
def test_blocks_are_few_enough_and_as_square_as_can_be(shape, spacing):
    blocks = reduce_surface(plain(shape, spacing), "height")
    assert blocks.height.size <= 160_000
    assert min(blocks.height.shape) >= 2
    assert max(blocks.height.shape) <= 4000
    if shape == (400, 400):
        assert blocks.factors == (1, 1)
    if shape in ((30_000, 350), (3000, 1000)):
        size = np.asarray(blocks.factors) * spacing
        assert size.max() / size.min() < 2


def test_rows_of_blocks_along_a_bend_are_straight(page_of):
    """So that the ends of a row tell where all its nodes lie."""
    u, v = 0.01 * np.arange(2000), 0.01 * np.arange(-150, 151)
    heading = 0.3 + 0.02 * u[1:]
    bent = make_surface(
        0.001 * np.add.outer(u, v),
        u=u,
        v=v,
        easting=np.concatenate([[0.0], np.cumsum(0.01 * np.cos(heading))]),
        northing=np.concatenate([[0.0], np.cumsum(0.01 * np.sin(heading))]),
    )
    blocks = reduce_surface(bent, "height")
    assert blocks.factors != (1, 1)
    page = page_of(SurfaceView(surface=bent))
    x, y = drawn_at(page.figures()[0]["places"])
    npt.assert_allclose(x, blocks.easting, **DRAWN)
    npt.assert_allclose(y, blocks.northing, **DRAWN)
    assert f"each the mean of {blocks.factors[0]} × {blocks.factors[1]}" in page.source


def exaggeration_drawn(figure, millimetres=1000.0):
    """How many times as large as distances heights come out, by the settings that plotly gets."""
    scene = figure["layout"]["scene"]
    assert scene["aspectmode"] == "manual"
    per_metre = {}
    for axis, factor in (("x", 1.0), ("y", 1.0), ("z", millimetres)):
        low, high = scene[f"{axis}axis"]["range"]
        per_metre[axis] = scene["aspectratio"][axis] / ((high - low) / factor)
    npt.assert_allclose(per_metre["x"], per_metre["y"], **RATIO)
    return per_metre["z"] / per_metre["x"]


@pytest.mark.parametrize("stated", [1.0, 7.5, 20.0])
def test_the_exaggeration_that_is_stated_is_drawn(page_of, bend, stated):
    page = page_of(SurfaceView(surface=bend, vertical_exaggeration=stated))
    drawn = exaggeration_drawn(page.figures()[0]["figure"])
    npt.assert_allclose(drawn, stated, rtol=1e-3)  # axes of heights end at a single's precision
    assert page.texts("output") == [f"Vertical exaggeration {stated:g} ×"]
    pressed = page.texts("button", **{"aria-pressed": "true"})
    assert pressed == [f"{stated:g}×"]
    assert set(page.texts("button")) >= {"1×", "5×", "20×", f"{stated:g}×"}


def test_a_plane_is_drawn_as_one(page_of):
    page = page_of(SurfaceView(surface=plain((50, 50)), vertical_exaggeration=5.0))
    npt.assert_allclose(exaggeration_drawn(page.figures()[0]["figure"]), 5.0, **RATIO)


def test_the_axes_hold_the_lines_too(page_of, bend):
    s = np.linspace(0.0, 12.0, 5000)
    beyond = make_profile(
        s, np.full(5000, 103.5), easting=412_299.0 + s, northing=np.full(5000, 5_318_201.0)
    )
    tracks = make_profile(
        [0.0, 1.0], [[103.0, 103.0], [103.1, 103.1]], tracks=["left", "right"],
        easting=[[412_300.0, 412_301.0]] * 2, northing=[[5_318_200.5, 5_318_200.5]] * 2,
    )  # fmt: skip
    page = page_of(
        SurfaceView(
            surface=bend, vertical_exaggeration=2.0, lines={"beyond": beyond, "wheel": tracks}
        )
    )
    figure = page.figures()[0]["figure"]
    assert [line.get("name") for line in figure["data"]] == [
        None,
        "beyond",
        "wheel, left",
        "wheel, right",
    ]
    x = page.unpacked(figure["data"][1]["x"])
    assert x.size <= 2000
    axis = figure["layout"]["scene"]["xaxis"]
    ends = np.asarray(axis["range"]) + base_of(axis, "Easting")
    npt.assert_allclose(ends, [412_299.0, 412_311.0], **DRAWN)
    npt.assert_allclose(exaggeration_drawn(figure), 2.0, rtol=1e-3)


def test_the_suggested_exaggeration_is_round_and_shows_relief():
    plane = plain((100, 100), (0.1, 0.1))
    metre = plain((100, 100), (0.1, 0.1), height=np.linspace(0, 1, 10_000).reshape(100, 100))
    assert suggested_exaggeration(reduce_surface(metre, "height")) == 1.0
    millimetres = metre.assign(height=metre.height.copy(data=0.02 * metre.height.values))
    assert suggested_exaggeration(reduce_surface(millimetres, "height")) == 20.0
    assert suggested_exaggeration(reduce_surface(plane, "height")) == 100.0


def test_a_picture_from_above_stands_in_on_paper(page_of, bend):
    page = page_of(SurfaceView(surface=bend, caption="Bend."))
    picture = page.all("img")[0]
    assert picture["src"].startswith("data:image/")
    assert picture["alt"] == "Surface seen from above, coloured by height. Bend."
    assert "hidden" in page.all("div", class_="live")[0]  # until the page finds that it can draw
    style = page.texts("style")[0]
    assert ".view .live { display: none; }" in style
    assert ".view.turning .still { display: block; }" in style


def test_a_long_road_is_stretched_in_the_picture_and_says_so(page_of):
    long = make_surface(
        np.zeros((500, 5)),
        u=np.arange(500.0),
        v=np.arange(-2.0, 3.0),
        easting=np.arange(500.0),
        northing=np.zeros(500),
    )
    page = page_of(SurfaceView(surface=long))
    assert "the width drawn 20 times as large as the length" in page.texts("p", class_="note")[0]
    assert "the width drawn" not in page_of(SurfaceView(surface=plain((9, 9)))).source


def test_maps_and_counts_can_be_seen(page_of):
    counted = make_surface(
        np.zeros((4, 3)), easting=[0, 1, 2], northing=[0, 1, 2, 3], count=np.full((4, 3), 7)
    )
    page = page_of(SurfaceView(surface=counted, colour="count"))
    surface = page.figures()[0]["figure"]["data"][0]
    assert surface["colorbar"]["title"]["text"] == "Count per node"
    npt.assert_array_equal(page.unpacked(surface["surfacecolor"]), np.full((4, 3), 7.0))


def test_what_cannot_be_drawn_is_refused(page_of, bend):
    with pytest.raises(
        ValueError, match="colour must be one of height, sd, sd_relative, count, got 'up'"
    ):
        SurfaceView(surface=bend, colour="up")
    with pytest.raises(ValueError, match="a variable of the surface, which has no 'sd'"):
        SurfaceView(surface=bend.drop_vars("sd"), colour="sd")
    with pytest.raises(ValueError, match="vertical_exaggeration must be greater than 0, got 0"):
        SurfaceView(surface=bend, vertical_exaggeration=0)
    with pytest.raises(ValueError, match="no height anywhere; leave the view out"):
        page_of(SurfaceView(surface=plain((3, 3), height=np.full((3, 3), np.nan))))
    placeless = make_profile([0.0, 1.0], [0.0, 0.0])
    with pytest.raises(ValueError, match="needs easting and northing, which 'path' lacks"):
        page_of(SurfaceView(surface=bend, lines={"path": placeless}))
    with pytest.raises(SchemaError, match="variable heading"):
        page_of(SurfaceView(surface=bend.drop_vars("heading")))
