"""Surfaces as blocks: the front edge agrees with the axes, distant facets are drawn first."""

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import numpy.testing as npt
import pytest

from trueterrain import figures
from trueterrain.core.errors import CoverageError
from trueterrain.core.schemas import make_surface
from trueterrain.figures.surface import relief

EXACT = {"rtol": 0, "atol": 1e-9}  # [m] round-off


@pytest.fixture(autouse=True)
def _closed_figures():
    yield
    plt.close("all")


def road(height):
    """Of 0.1 m spacing, straight to the north."""
    u, v = 0.1 * np.arange(height.shape[0]), 0.1 * np.arange(height.shape[1]) - 0.2
    return make_surface(height, u=u, v=v, easting=0 * u, northing=u)


def step():
    height = np.zeros((41, 5))
    height[20:] = -0.05
    return height


def facets(ax):
    """Corners of the facets in the order in which they are drawn, shape (facet, corner, 2)."""
    (top,) = [each for each in ax.collections if each.get_rasterized()]
    return np.array([path.vertices[:4] for path in top.get_paths()])


def test_facets_agree_with_the_projection():
    height = step() + 0.001 * np.arange(5)
    ax = figures.surface_relief(road(height), exaggeration=5)
    ax.figure.canvas.draw()
    corners = facets(ax)
    assert corners.shape == (160, 4, 2)
    front = corners[-40:]  # drawn last
    npt.assert_allclose(front[:, 0, 0], 0.1 * np.arange(40), **EXACT)
    npt.assert_allclose(front[:, 0, 1], height[:-1, 0], **EXACT)
    behind = corners[:40]  # drawn first; its far edge is 0.4 m away
    npt.assert_allclose(behind[:, 3, 0], 0.1 * np.arange(40) + 0.4 * relief._RIGHT, **EXACT)
    npt.assert_allclose(behind[:, 3, 1], height[:-1, 4] + 0.4 * relief._UP / 5, **EXACT)


def test_the_exaggeration_is_drawn_and_printed():
    ax = figures.surface_relief(road(step()), exaggeration=8)
    assert ax.get_aspect() == 8
    (note,) = [text.get_text() for text in ax.texts]
    assert note == "vertical exaggeration 8 ×, 0.4 m wide"
    assert figures.surface_relief(road(step())).get_aspect() == 5  # 8 at most: 0.1 of the length
    flat = figures.surface_relief(road(0 * step()))
    assert np.isfinite(flat.get_ylim()).all()
    assert flat.get_ylim()[0] < flat.get_ylim()[1]


def test_holes_are_holes():
    height = step()
    height[10, 2] = np.nan
    height[0, 0] = np.nan
    assert len(facets(figures.surface_relief(road(height)))) == 160 - 4 - 1


def test_heights_can_be_given_so_that_surfaces_compare():
    ax, other = (figures.surface_relief(road(h * step()), heights=(-0.1, 0.0)) for h in (0.5, 2.0))
    assert ax.get_ylim() == other.get_ylim()
    assert ax.get_aspect() == other.get_aspect()
    ticks = ax.yaxis.get_major_locator()()
    assert min(ticks) >= -0.1
    assert max(ticks) <= 1e-9


def test_maps_and_long_surfaces():
    axis = 0.1 * np.arange(1001)
    cloud = make_surface(np.zeros((5, 1001)), easting=20_000 + axis, northing=axis[:5])
    ax = figures.surface_relief(cloud)
    assert ax.get_xlabel() == "Easting − 20000 m [m]"
    assert len(facets(ax)) <= 4 * relief._MAX_FACETS


def test_walls_towards_the_eye_are_darker_than_the_floor():
    """The light comes from the left."""
    ax = figures.surface_relief(road(step()), exaggeration=5)
    (top,) = [each for each in ax.collections if each.get_rasterized()]
    light = mpl.colors.rgb_to_hsv(top.get_facecolors()[:, :3])[:, 2]
    wall = light[-40:][19]
    assert wall < 0.8 * light[-40:][10]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"exaggeration": 0.0}, "exaggeration must be greater than 0"),
        ({"heights": (1.0, 0.0)}, "heights must ascend"),
    ],
)
def test_numbers_without_sense_are_refused(options, words):
    with pytest.raises(ValueError, match=words):
        figures.surface_relief(road(step()), **options)


def test_a_surface_without_any_height_is_refused():
    with pytest.raises(CoverageError, match="no node has a height"):
        figures.surface_relief(road(np.nan * step()))
