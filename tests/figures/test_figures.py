"""Figures: drawn values equal the given ones, with their units."""

import dataclasses
import subprocess
import sys

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import numpy.testing as npt
import pytest

from trueterrain import figures
from trueterrain.core.errors import CoverageError, OutputError, SchemaError
from trueterrain.core.schemas import make_points, make_profile, make_surface
from trueterrain.figures import canvas
from trueterrain.figures.profile.cpf import statistic_name
from trueterrain.profile import (
    Disc,
    Ellipse,
    HeightDistribution,
    InverseDistance,
    Mean,
    Median,
    Percentile,
    PlaneCurve,
    Rectangle,
    SteepestCpf,
    Window,
    height_distributions,
    offset_path,
    straight_path,
    tyre_profile,
)
from trueterrain.roughness.iri import iri
from trueterrain.surface import grid_frame, surface_to_points, uv_to_xy

EXACT = {"rtol": 0, "atol": 1e-12}  # [m] round-off of coordinates of some 10 m
PIXEL = {"rtol": 1e-9, "atol": 0}  # ratio of two transforms of the same axes


@pytest.fixture(autouse=True)
def _closed_figures():
    yield
    plt.close("all")


def bend(easting=0.0, northing=0.0):
    """Road of 2 m by 0.8 m on a curve, every height another one, one node without."""
    heading = np.linspace(0.3, 0.8, 200)
    u, v = 50 + 0.01 * np.arange(201), 0.02 * np.arange(-20, 21)
    height = 3.0 + 0.05 * (u[:, None] - 50) + 0.03 * v + 0.002 * np.sin(60 * u[:, None] + 90 * v)
    height[0, 0] = np.nan
    return make_surface(
        height,
        u=u,
        v=v,
        easting=easting + np.concatenate([[0.0], np.cumsum(0.01 * np.cos(heading))]),
        northing=northing + np.concatenate([[0.0], np.cumsum(0.01 * np.sin(heading))]),
    )


def legend_texts(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


def notes(ax):
    ax.figure.canvas.draw()
    return [text.get_text() for text in ax.texts] + [
        child.get_text() for child in ax.artists if hasattr(child, "get_text")
    ]


def boxes_apart(ax):
    """No legend or note lies on the axes, and nothing is cut by the edge of the figure."""
    ax.figure.canvas.draw()
    renderer = ax.figure.canvas.get_renderer()
    frame, page = ax.get_window_extent(renderer), ax.figure.bbox
    outside = [ax.get_legend(), *ax.texts, *(a for a in ax.artists if hasattr(a, "get_text"))]
    for artist in filter(None, outside):
        assert artist.get_window_extent(renderer).y0 >= frame.y1
    whole = ax.get_tightbbox(renderer)
    assert whole.x0 >= page.x0 - 1
    assert whole.y0 >= page.y0 - 1
    assert whole.x1 <= page.x1 + 1
    assert whole.y1 <= page.y1 + 1


# maps


def test_a_surface_over_its_grid_has_its_heights_at_the_nodes():
    road = bend()
    ax = figures.surface_map(road, path=offset_path(road, 0.1))
    image = ax.images[0]
    npt.assert_array_equal(image.get_array().filled(np.nan), road.height.values.T)
    npt.assert_allclose(image.get_extent(), [49.995, 52.005, -0.41, 0.41], **EXACT)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("Station u [m]", "Offset v, left + [m]")
    assert legend_texts(ax) == ["path", "its start", "no height"]
    assert notes(ax) == ["equal scale"]
    boxes_apart(ax)


def test_a_path_at_an_offset_is_straight_over_the_grid():
    road = bend()
    u, v = figures.surface_map(road, path=offset_path(road, 0.1)).lines[1].get_data()
    npt.assert_allclose(v, 0.1, rtol=0, atol=1e-9)  # [m] what `xy_to_uv` promises at an edge
    assert u[0] == pytest.approx(50, abs=1e-9)


def test_a_loop_over_the_ground():
    """Coordinates that turn back, at which matplotlib would flag the cells; corners are exact."""
    angle = np.linspace(0, 2 * np.pi, 73)
    v = [-1.0, 0.0, 2.0]
    loop = make_surface(
        np.zeros((73, 3)),
        u=10 * angle,
        v=v,
        easting=10 * np.cos(angle),
        northing=10 * np.sin(angle),
    )
    (mesh,) = figures.surface_map(loop, frame="ground").collections[:1]
    corners = mesh.get_coordinates()
    radius = np.hypot(corners[..., 0], corners[..., 1])
    # v is positive to the left, towards the centre; chords of 5 degrees cut 1 - cos of half of that
    outer, inner = 10 + 1.5, 10 - 3.0
    npt.assert_allclose(radius[1:-1, 0], outer, rtol=0, atol=0.02)
    npt.assert_allclose(radius[1:-1, -1], inner, rtol=0, atol=0.02)
    assert corners.shape == (74, 4, 2)


def test_a_surface_over_the_ground():
    road = bend()
    path = offset_path(road, 0.1)
    ax = figures.surface_map(road, path=path, frame="ground")
    (mesh,) = ax.collections[:1]
    npt.assert_array_equal(mesh.get_array().filled(np.nan).ravel(), road.height.values.ravel())
    npt.assert_array_equal(ax.lines[1].get_xydata(), np.stack([path.easting, path.northing], 1))
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("Easting [m]", "Northing [m]")
    assert ax.get_aspect() == 1
    boxes_apart(ax)


def test_a_map_of_large_coordinates_writes_them_from_a_round_number_on():
    axis = np.arange(0.0, 5.0, 0.5)
    height = axis + 0.1 * axis[:, None]
    surface = make_surface(height, easting=651_230 + axis, northing=5_790_400 + axis)
    ax = figures.surface_map(surface)
    npt.assert_array_equal(ax.images[0].get_array(), height)
    assert ax.get_xlabel() == "Easting − 651000 m [m]"
    assert ax.get_ylabel() == "Northing − 5790000 m [m]"
    ax.set_xticks([651_231.5])
    ax.figure.canvas.draw()
    assert ax.get_xticklabels()[0].get_text() == "231.5"
    boxes_apart(ax)


def test_unequal_offsets_are_drawn_at_their_positions():
    u, v = np.arange(3.0), np.array([-1.0, 0.0, 0.5])
    road = make_surface(np.arange(9.0).reshape(3, 3), u=u, v=v, easting=u, northing=0 * u)
    ax = figures.surface_map(road)
    edges = ax.collections[0].get_coordinates()[:, 0, 1]
    npt.assert_allclose(edges, [-1.5, -0.5, 0.25, 0.75], **EXACT)


@pytest.mark.parametrize(("length", "stretch"), [(4.0, 1), (40.0, 5), (4000.0, 500)])
def test_a_long_road_is_stretched_laterally_with_a_note(length, stretch):
    u, v = np.linspace(0, length, 11), np.array([-0.5, 0.0, 0.5])
    road = make_surface(np.zeros((11, 3)), u=u, v=v, easting=u, northing=0 * u)
    ax = figures.surface_map(road)
    expected = "equal scale" if stretch == 1 else f"v stretched {stretch} times"
    assert notes(ax) == [expected]
    assert canvas.vertical_exaggeration(ax) == pytest.approx(stretch, rel=1e-9)
    boxes_apart(ax)


@pytest.mark.parametrize(
    "width", [0.3, 0.5, 0.8, 1.2, 1.6, 1.7, 1.9, 2.0, 2.1, 2.4, 3.0, 6.0, 40.0]
)
@pytest.mark.parametrize("frame", ["grid", "ground"])
def test_a_surface_of_any_shape_fits_on_its_page(width, frame):
    u, v = np.linspace(0, 2, 9), np.linspace(-width / 2, width / 2, 9)
    height = -0.08 + 0.1 * u[:, None] * np.cos(v)
    road = make_surface(height, u=u, v=v, easting=u, northing=0 * u)
    boxes_apart(figures.surface_map(road, path=offset_path(road, 0.1), frame=frame))


@pytest.mark.parametrize("width", [0.0, 0.5, 1.6, 2.0, 2.4, 40.0])
def test_points_over_any_shape_fit_on_their_page(width):
    x, y = np.linspace(0, 2, 50), np.linspace(0, width, 50)
    boxes_apart(figures.points_map(make_points(x, y, 0.1 * x)))


def test_one_point_is_a_map():
    boxes_apart(figures.points_map(make_points([1.0], [2.0], [3.0])))


def test_a_fine_surface_is_thinned_with_a_note():
    u, v = 0.01 * np.arange(3001), np.array([-1.0, 0.0, 1.0])
    height = np.sin(u[:, None] + v)
    ax = figures.surface_map(make_surface(height, u=u, v=v, easting=u, northing=0 * u))
    npt.assert_array_equal(ax.images[0].get_array(), height[::3].T)
    assert notes(ax) == ["v stretched 2 times, 1 of 3 nodes shown"]


def test_points_are_drawn_at_their_positions():
    points = surface_to_points(bend())
    ax = figures.points_map(points, path=offset_path(bend(), 0.0))
    (dots,) = ax.collections
    npt.assert_array_equal(dots.get_offsets(), np.stack([points.easting, points.northing], 1))
    npt.assert_array_equal(dots.get_array(), points.up)
    assert notes(ax) == ["equal scale"]
    boxes_apart(ax)


def test_many_points_are_thinned_with_a_note():
    points = surface_to_points(bend())
    ax = figures.points_map(points, max_points=1000)
    every = -(-points.sizes["point"] // 1000)
    npt.assert_array_equal(ax.collections[0].get_array(), points.up[::every])
    assert notes(ax) == [f"equal scale, 1 of {every} points shown"]


# search areas


@pytest.mark.parametrize(
    "area", [Disc(), Ellipse(length=0.2, width=0.08), Rectangle(length=0.2, width=0.08)]
)
@pytest.mark.parametrize("as_points", [False, True])
def test_the_ringed_heights_are_those_that_count(area, as_points):
    road = bend()
    ground = surface_to_points(road) if as_points else road
    path = offset_path(road, 0.1, spacing=0.05)
    ax = figures.search_area_map(ground, path, area, station=1.02)
    (dots,) = ax.collections
    ringed = np.asarray(dots.get_linewidths()) > 0
    (truth,) = height_distributions(ground, path.part(20, 21), area=area)
    npt.assert_array_equal(np.sort(dots.get_array()[ringed]), truth.heights)
    assert f"{truth.heights.size} heights in the" in notes(ax)[0]
    assert notes(ax)[0].endswith("at s = 1 m")
    boxes_apart(ax)


def test_path_points_are_drawn_from_the_one_that_is_shown():
    road = bend()
    path = offset_path(road, 0.1, spacing=0.05)
    (line, _) = figures.search_area_map(road, path, station=1.0).lines[::-1]
    at = np.stack([path.easting - path.easting[20], path.northing - path.northing[20]], 1)
    npt.assert_array_equal(line.get_xydata(), at)


@pytest.mark.parametrize("area", [Disc(radius=0.04), Rectangle(length=0.2, width=0.08)])
def test_the_bold_outline_is_the_search_area(area):
    """Points just inside of the area's own edge are inside the outline, just outside are not."""
    road = bend()
    path = offset_path(road, 0.1, spacing=0.05)
    patch = figures.search_area_map(road, path, area, station=1.0).patches[-1]
    ahead = np.array([np.cos(path.heading[20]), np.sin(path.heading[20])])
    left = np.array([-ahead[1], ahead[0]])
    outline = patch.get_patch_transform().transform_path(patch.get_path())
    for direction, half in zip((ahead, left), area.half_axes, strict=True):
        for sign in (-1, 1):
            assert outline.contains_point(sign * 0.999 * half * direction)
            assert not outline.contains_point(sign * 1.001 * half * direction)


def test_a_path_of_one_point_has_a_search_area():
    road = bend()
    ax = figures.search_area_map(road, offset_path(road, 0.1).part(50, 51), station=0.5)
    npt.assert_array_equal(ax.lines[-1].get_xydata(), [[0.0, 0.0]])
    assert "every 0 mm" not in " ".join(legend_texts(ax))


def test_a_search_area_off_the_ground_is_an_error():
    with pytest.raises(CoverageError, match="no height within"):
        figures.search_area_map(bend(), straight_path((100, 100), (101, 100)), station=0.0)


# profiles


def test_profiles_are_drawn_as_given_with_one_standard_deviation():
    s = np.linspace(0, 2, 30)
    line = make_profile(s, np.sin(s) / 50, sd=0.001 + 0.001 * s)
    ax = figures.profiles({"a": line, "b": make_profile(s, np.cos(s) / 50)})
    npt.assert_array_equal(ax.lines[0].get_xydata(), np.stack([s, line.height], 1))
    npt.assert_array_equal(ax.lines[1].get_ydata(), np.cos(s) / 50)
    band = ax.collections[0].get_paths()[0].vertices
    assert band[:, 1].max() == (line.height + line.sd).max()
    assert band[:, 1].min() == (line.height - line.sd).min()
    assert legend_texts(ax) == ["a ± 1 sd", "a", "b"]
    assert ax.get_xlabel() == "Distance along the path s [m]"
    assert ax.get_ylabel() == "Height [mm]"
    boxes_apart(ax)


def test_tracks_are_named_and_one_line_alone_is_not():
    s = np.arange(3.0)
    both = make_profile(s, [s, 2 * s], tracks=["left", "right"])
    assert legend_texts(figures.profiles(both)) == ["left", "right"]
    assert legend_texts(figures.profiles({"run 1": both})) == ["run 1 left", "run 1 right"]
    assert figures.profiles(make_profile(s, s)).get_legend() is None


def test_the_printed_exaggeration_is_that_of_the_drawing_also_after_a_zoom():
    s = np.linspace(0, 10, 50)
    ax = figures.profiles(make_profile(s, np.sin(s) / 100))
    for limits in [(0, 10), (2, 3)]:
        ax.set_xlim(limits)
        ax.figure.canvas.draw()
        box = ax.get_window_extent()
        drawn = (box.height / np.ptp(ax.get_ylim())) / (box.width / np.ptp(limits))
        npt.assert_allclose(canvas.vertical_exaggeration(ax), drawn, **PIXEL)
        assert notes(ax) == [f"vertical exaggeration {float(f'{drawn:.3g}'):g} ×"]


def test_parallel_profiles_stand_in_the_order_of_their_offsets_and_the_tyre_above():
    s = np.linspace(0, 1, 20)
    lines = {0.01: make_profile(s, s / 10), 0.0: make_profile(s, s / 20), -0.01: make_profile(s, s)}
    tyre = make_profile(s, s / 15, sd=0 * s)
    ax = figures.parallel_profiles(lines, tyre)
    for drawn, given in zip(ax.lines, [lines[-0.01], lines[0.0], lines[0.01], tyre], strict=True):
        npt.assert_array_equal(drawn.get_xydata(), np.stack([s, given.height], 1))
    assert legend_texts(ax) == ["offset −10 mm", "on the path", "offset +10 mm", "tyre"]
    boxes_apart(ax)


def test_a_difference_adds_independent_standard_deviations():
    s = np.arange(4.0)
    high = make_profile(s, [0.003, 0.003, 0.003, 0.003], sd=[0.003, 0.003, np.nan, 0.003])
    low = make_profile(s, [0.0, 0.001, 0.002, 0.003], sd=[0.004, 0.004, 0.004, 0.004])
    ax = figures.profile_difference(high, low)
    npt.assert_allclose(ax.lines[-1].get_ydata(), [0.003, 0.002, 0.001, 0.0], **EXACT)
    band = ax.collections[0].get_paths()[0].vertices[:, 1]
    npt.assert_allclose([band.max(), band.min()], [0.003 + 0.005, 0.0 - 0.005], **EXACT)
    assert legend_texts(ax) == [f"difference, RMS {np.sqrt(14 / 4):.2f} mm", "± 1 sd"]
    assert ax.get_ylabel() == "Height difference [mm]"
    boxes_apart(ax)


def test_differences_of_several_profiles_are_named():
    s = np.arange(4.0)
    level = make_profile(s, 0 * s)
    ax = figures.profile_difference({"a": make_profile(s, s), "b": level}, level)
    npt.assert_array_equal(ax.lines[1].get_ydata(), s)
    npt.assert_array_equal(ax.lines[2].get_ydata(), 0 * s)
    assert legend_texts(ax) == [f"a, RMS {1000 * np.sqrt(14 / 4):.2f} mm", "b, RMS 0.00 mm"]
    assert ax.lines[1].get_color() != ax.lines[2].get_color()


def test_an_unlimited_standard_deviation_leaves_the_limits_alone():
    s = np.arange(3.0)
    vague = make_profile(s, [0.0, 0.001, 0.0], sd=[0.001, np.inf, 0.001])
    assert np.ptp(figures.profiles(vague).get_ylim()) < 0.01
    assert np.ptp(figures.profile_difference(vague, vague).get_ylim()) < 0.01


# distribution and index


def quantised():
    rng = np.random.default_rng(7)
    heights = np.sort(np.round(2.1 + rng.normal(0, 0.003, 81), 3))
    return HeightDistribution(heights=heights, distances=np.zeros(81))


def test_the_staircase_and_its_continuation_are_those_of_the_distribution():
    one = quantised()
    ax = figures.cpf(one, resolution=1e-3)
    steps, curve, edges = ax.lines[:3]
    inner = slice(1, -1)
    npt.assert_array_equal(steps.get_xdata()[inner], np.unique(one.heights))
    npt.assert_array_equal(steps.get_ydata()[inner], one.cpf(np.unique(one.heights)))
    npt.assert_array_equal(edges.get_xydata(), np.stack(one.steps(1e-3), 1))
    npt.assert_array_equal(curve.get_ydata(), one.continued_cpf(curve.get_xdata(), 1e-3))
    assert ax.get_xlabel() == "Height − 2 m [mm]"
    boxes_apart(ax)


def test_the_marked_median_is_where_the_continued_cpf_is_one_half():
    one = quantised()
    median = figures.cpf(one, resolution=1e-3).lines[3].get_xdata()[0]
    # 1e-9 of the CPF is 1e-11 m here: the continued median is found by bisection
    npt.assert_allclose(one.continued_cpf(median, 1e-3), 0.5, rtol=0, atol=1e-9)


def test_every_statistic_can_be_marked_and_has_a_name():
    marks = [
        Median(),
        Mean(),
        Percentile(percent=90),
        Window(),
        InverseDistance(),
        SteepestCpf(),
    ]
    ax = figures.cpf(quantised(), statistics=marks)
    names = ["median", "mean", "90 % percentile", "window 15 to 85 %", "mean by distance^-2"]
    assert [statistic_name(mark) for mark in marks] == [*names, "steepest CPF"]
    for text, name in zip(legend_texts(ax)[1:], [*names, "steepest CPF"], strict=True):
        assert text.startswith(name)
        assert "mm" in text
    boxes_apart(ax)


def test_a_single_height_has_no_standard_deviation_to_show():
    one = HeightDistribution(heights=np.array([0.5]), distances=np.zeros(1))
    assert legend_texts(figures.cpf(one, statistics=[Median()])) == ["1 heights", "median 500.0 mm"]


def test_segments_are_drawn_from_their_start_to_their_end():
    s = np.arange(0.0, 90.0, 0.1)
    wave = 0.005 * np.sin(2 * np.pi * s / 7)
    index = iri(make_profile(s, [wave, 2 * wave], tracks=["left", "right"]), segment=40.0)
    ax = figures.iri_segments(index)
    for drawn, track in zip(ax.patches, ["left", "right"], strict=False):
        values, edges, _ = drawn.get_data()
        npt.assert_array_equal(values, index.segment_iri.sel(track=track))
        npt.assert_array_equal(edges, [*index.start.values, index.end.values[-1]])
    assert "right" in legend_texts(ax)
    assert "shorter segment" in legend_texts(ax)
    assert ax.get_ylabel() == "IRI [m/km]"
    assert ax.get_ylim()[0] == 0
    assert ax.get_ylim()[1] > index.segment_iri.max()
    boxes_apart(ax)


def test_one_track_alone_is_filled_and_only_the_whole_is_named():
    s = np.arange(0.0, 80.0, 0.1)
    index = iri(make_profile(s, 0.005 * np.sin(s)), segment=20.0)
    ax = figures.iri_segments(index)
    assert legend_texts(ax)[0] == f"whole {index.iri.item():.2f} m/km"
    assert notes(ax) == ["segments of 20 m"]


# all of them


def test_each_draws_on_given_axes():
    road = bend()
    path = offset_path(road, 0.1)
    tyre = tyre_profile(road, path)
    index = iri(tyre.drop_vars("sd"), segment=0.5)
    calls = [
        lambda ax: figures.surface_map(road, ax=ax),
        lambda ax: figures.surface_map(road, frame="ground", ax=ax),
        lambda ax: figures.points_map(surface_to_points(road), ax=ax),
        lambda ax: figures.search_area_map(road, path, station=1.0, ax=ax),
        lambda ax: figures.profiles(tyre, ax=ax),
        lambda ax: figures.parallel_profiles({0.0: tyre}, tyre, ax=ax),
        lambda ax: figures.profile_difference(tyre, tyre, ax=ax),
        lambda ax: figures.cpf(quantised(), ax=ax),
        lambda ax: figures.iri_segments(index, ax=ax),
    ]
    for call in calls:
        _, given = plt.subplots()
        count = len(plt.get_fignums())
        assert call(given) is given
        assert len(plt.get_fignums()) == count
        plt.close("all")


def test_invalid_arguments_state_the_rule():
    s = np.arange(3.0)
    line, both = make_profile(s, s), make_profile(s, [s, s], tracks=["l", "r"])
    with pytest.raises(ValueError, match="frame must be 'grid' or 'ground', got 'map'"):
        figures.surface_map(bend(), frame="map")
    with pytest.raises(ValueError, match="max_points must be at least 1 point, got 0"):
        figures.points_map(make_points([0.0], [0.0], [0.0]), max_points=0)
    with pytest.raises(ValueError, match="lines must hold at least one"):
        figures.parallel_profiles({}, line)
    with pytest.raises(ValueError, match="index must hold segments"):
        figures.iri_segments(iri(make_profile(np.arange(0, 30, 0.1), np.zeros(300))))
    with pytest.raises(ValueError, match="an empty search area"):
        figures.cpf(HeightDistribution(heights=np.empty(0), distances=np.empty(0)))
    with pytest.raises(SchemaError, match="several tracks"):
        figures.profile_difference(both, line)
    with pytest.raises(SchemaError, match=r"3 stations from 0 to 2 m, the reference has 3 from 1"):
        figures.profile_difference(line, line.assign_coords(s=s + 1))


# scales


@pytest.mark.parametrize(
    ("heights", "base", "unit"),
    [
        ([2.035, 2.183], 2.0, "mm"),
        ([2.035, 2.080], 2.0, "mm"),
        ([-0.02, 0.4], 0.0, "mm"),
        ([100.2, 102.0], 0.0, "m"),
        ([5.0, 5.0], 5.0, "mm"),
        ([np.nan, np.nan], 0.0, "m"),
        ([-7.95, -7.90], -8.0, "mm"),
    ],
)
def test_heights_are_written_in_a_scale_that_can_be_read(heights, base, unit):
    scale = canvas.height_scale(heights)
    assert scale.base == pytest.approx(base, abs=1e-12)
    assert scale.unit == unit


def test_numbers_are_typeset():
    scale = canvas.LengthScale(base=2.0, factor=1000.0, unit="mm")
    assert scale.text(1.9985) == "−1.5"
    assert scale.text(2.1 - 1e-16) == "100"
    assert scale.text(2.0 - 1e-15) == "0"
    assert scale.label("Height") == "Height − 2 m [mm]"


# files


@pytest.mark.slow
@pytest.mark.parametrize("ending", ["svg", "pdf", "png"])
def test_the_same_figure_gives_the_same_file(tmp_path, ending):
    starts = {"svg": b"<?xml", "pdf": b"%PDF", "png": b"\x89PNG"}
    for name in ("a", "b"):
        ax = figures.profiles(make_profile([0.0, 1.0, 2.0], [0.0, 0.01, 0.0]))
        figures.save_figure(ax if name == "a" else ax.figure, tmp_path / f"{name}.{ending}")
    content = (tmp_path / f"a.{ending}").read_bytes()
    assert content.startswith(starts[ending])
    assert content == (tmp_path / f"b.{ending}").read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"a.{ending}", f"b.{ending}"]


def test_nothing_is_left_of_a_figure_that_fails(tmp_path, monkeypatch):
    ax = figures.profiles(make_profile([0.0, 1.0], [0.0, 0.01]))

    def half(path, **_):
        path.write_bytes(b"half")
        raise RuntimeError("disk full")

    monkeypatch.setattr(ax.figure, "savefig", half)
    with pytest.raises(RuntimeError, match="disk full"):
        figures.save_figure(ax, tmp_path / "a.png")
    assert list(tmp_path.iterdir()) == []


def test_a_file_is_replaced_only_by_force(tmp_path):
    ax = figures.profiles(make_profile([0.0, 1.0], [0.0, 0.01]))
    target = tmp_path / "a.png"
    target.write_text("mine")
    with pytest.raises(OutputError, match="exists already"):
        figures.save_figure(ax, target)
    assert target.read_text() == "mine"
    figures.save_figure(ax, target, force=True)
    assert target.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("name", ["a.jpg", "a", "a.svg.gz"])
def test_other_endings_are_refused(tmp_path, name):
    ax = figures.profiles(make_profile([0.0, 1.0], [0.0, 0.01]))
    with pytest.raises(ValueError, match=r"a figure ends in \.png, \.svg, \.pdf"):
        figures.save_figure(ax, tmp_path / name)
    with pytest.raises(
        ValueError, match=r"resolution must be .* at most 2400 dots per inch, got 1e"
    ):
        figures.save_figure(ax, tmp_path / "huge.png", resolution=1e9)
    with pytest.raises(ValueError, match="resolution must be greater than 0"):
        figures.save_figure(ax, tmp_path / "a.png", resolution=0.0)
    assert list(tmp_path.iterdir()) == []


def test_figures_leave_the_settings_of_matplotlib_alone():
    before = dict(mpl.rcParams)
    ax = figures.surface_map(bend())
    ax.figure.canvas.draw()
    assert dict(mpl.rcParams) == before


def test_a_path_of_another_place_leaves_the_grid_alone():
    """A path outside of the surface has no place over its grid: nothing is drawn, nothing fails."""
    road = bend()
    path = straight_path((500, 500), (501, 500))
    ax = figures.surface_map(road, path=path)
    assert np.isnan(ax.lines[1].get_xdata()).all()
    assert legend_texts(ax) == ["path", "no height"]


def test_a_path_that_begins_outside_of_the_grid_shows_no_begin():
    road = bend()
    ax = figures.surface_map(road.isel(u=slice(100, None)), path=offset_path(road, 0.1))
    assert legend_texts(ax) == ["path"]


def test_a_curved_path_over_the_grid_is_where_the_ground_says():
    road = bend(easting=1000.0, northing=-2000.0)
    u, v = np.linspace(50.2, 51.8, 40), np.linspace(-0.3, 0.3, 40)
    easting, northing = uv_to_xy(grid_frame(road), u, v)
    s = np.arange(40.0)
    path = PlaneCurve(s=s, easting=easting, northing=northing, heading=0 * s, length=39.0)
    drawn = figures.surface_map(road, path=dataclasses.replace(path)).lines[1].get_xydata()
    # [m] `xy_to_uv` solves for u within its own edge tolerance at coordinates of some km
    npt.assert_allclose(drawn, np.stack([u, v], 1), rtol=0, atol=1e-9)


@pytest.mark.slow
def test_figures_are_imported_without_matplotlib():
    code = "import sys, trueterrain.figures; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
