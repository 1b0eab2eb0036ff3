"""Figures of excitation events and calibration plates: drawn values equal the given ones."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from numpy.testing import assert_allclose

from trueterrain import figures

EVENT = {"number": 5, "spacing": 0.488, "width": 0.17, "rise": 0.038}
EXACT = 1e-12  # rounding alone


@pytest.fixture(autouse=True)
def _closed_figures():
    yield
    plt.close("all")


def boxes(ax, **sizes):
    """Rectangles of an axes with these sizes, as (x, y, width, height)."""
    found = [(*box.get_xy(), box.get_width(), box.get_height()) for box in ax.patches]
    at = {"width": 2, "height": 3}
    return [
        box
        for box in found
        if all(abs(box[at[name]] - value) < EXACT for name, value in sizes.items())
    ]


def texts(ax):
    return [text.get_text() for text in ax.texts]


def test_plan_is_to_scale():
    ax = figures.event_plan(EVENT, across=2.5, track=1.6)
    cleats = boxes(ax, width=0.17, height=2.5)
    assert_allclose([x + 0.085 for x, *_ in cleats], (np.arange(5) + 0.5) * 0.488, atol=EXACT)
    assert ax.get_aspect() == 1.0
    assert {"a = 0.488 m", "w = 0.170 m", "5 a = 2.44 m", "2.50 m"} <= set(texts(ax))


def test_plan_of_a_staggered_event():
    ax = figures.event_plan(EVENT | {"placement": "staggered", "stagger": 1.2, "base": 0.019})
    left = [box for box in boxes(ax, width=0.17) if box[1] == 0.0]
    right = [box for box in boxes(ax, width=0.17) if box[1] < 0.0]
    assert_allclose(np.array(right)[:, 0] - np.array(left)[:, 0], 1.2, rtol=0, atol=EXACT)
    assert len(boxes(ax, width=5 * 0.488)) == 2
    ax = figures.event_plan(EVENT | {"placement": "one side"})
    assert all(y == 0.0 for _, y, *_ in boxes(ax, width=0.17))


def test_side_and_waves():
    ax = figures.event_side(EVENT | {"base": 0.019})
    assert all(abs(y - 0.019) < EXACT for _, y, *_ in boxes(ax, width=0.17, height=0.038))
    assert {"h = 38 mm", "19 mm"} <= set(texts(ax))
    ax = figures.event_waves(EVENT)
    body, hop = (line.get_xydata() for line in ax.lines[1:3])
    assert_allclose(body[[0, -1], 1], 0.0, rtol=0, atol=EXACT)
    assert_allclose(np.ptp(hop[:, 1]), 0.038, rtol=0, atol=1e-5)


def test_crossing_touches_both_edges():
    gain = 1.7471
    width = np.arccos(1 / gain) / np.pi
    ax = figures.cleat_crossing(width, gain, lag=0.25)
    step, late = (line.get_xydata() for line in ax.lines[1:3])
    for edge in (0.5 - width / 2, 0.5 + width / 2):
        assert_allclose(np.interp(edge, *step.T), 1.0, rtol=0, atol=1e-4)
        assert_allclose(np.interp(edge + 0.25, *late.T), 1.0, rtol=0, atol=1e-4)


def test_curves_are_those_given():
    x, y = np.linspace(0.3, 20, 50), np.linspace(1, 2, 50)
    for draw, extra in (
        (figures.vehicle_gain, {"modes": {"hop": 11.0}}),
        (figures.hop_gain, {"peaks": {"peak": (0.9, 1.5)}}),
        (figures.cleat_ratios, {"used": {"thesis": (0.3, 0.348)}}),
        (figures.passage_gains, {"speed": 5.0, "event": (x, y)}),
    ):
        ax = draw({"one": (x, y), "other": (x, 2 * y)}, **extra)
        assert_allclose(ax.lines[0].get_xydata(), np.column_stack([x, y]), rtol=0, atol=0)
        assert_allclose(ax.lines[1].get_ydata(), 2 * y, rtol=0, atol=0)
        with pytest.raises(ValueError, match="at least one curve"):
            draw({}, **extra)
        with pytest.raises(ValueError, match="'one' must be two arrays of one length"):
            draw({"one": (x, y[1:])}, **extra)


def test_energy_fractions_fill_the_bars():
    ax = figures.mode_energies({"a": {"heave": 0.2, "hop": 0.8}, "b": {"heave": 0.5, "hop": 0.5}})
    assert_allclose([bar.get_width() for bar in ax.patches], [20, 50, 80, 50], rtol=0, atol=1e-9)
    with pytest.raises(ValueError, match="at least one event"):
        figures.mode_energies({})


def test_plate():
    cleats = {"rectangle": (0.1, 0.176), "edge": (0.4, 0.476)}
    rows = np.array([-0.152, 0.0, 0.152])
    ax = figures.plate_plan(
        cleats, length=1.2, width=0.6, holes=(rows, rows[:1]), bands=[("white", 0.8)]
    )
    assert_allclose(ax.collections[-1].get_offsets()[:, 0], rows + 0.6, rtol=0, atol=EXACT)
    assert {"rectangle", "edge", "152 mm", "1200 mm", "600 mm", "white, 80 %"} <= set(texts(ax))
    s, z = np.array([0.0, 0.1, 0.1001, 0.176, 0.1761, 1.2]), np.array([1, 1, 5, 5, 1, 1]) * 0.01
    ax = figures.plate_section(s, z, thickness=0.01, cleats={"rectangle": (0.1, 0.1761)})
    assert "rectangle\n76 x 40 mm" in texts(ax)
    ax = figures.plate_view(s, z, returns=([0.1, 0.5], [0.01, 0.01]), shadows=[(0.2, 0.3)])
    assert_allclose(ax.lines[1].get_xdata(), [0.1, 0.5], rtol=0, atol=0)
    assert_allclose(ax.patches[0].get_extents().width > 0, True)


@pytest.mark.parametrize(
    ("draw", "message"),
    [
        (lambda: figures.event_plan(EVENT | {"width": 0.0}), "width is 0.0"),
        (lambda: figures.event_side({}), "number is None"),
        (lambda: figures.cleat_crossing(1.2, 1.5), "width_ratio must be between 0 and 1"),
        (lambda: figures.plate_plan({}, length=0.0, width=1.0, holes=([], [])), "length and width"),
        (lambda: figures.plate_view([0], [0, 1], returns=([], [])), "two arrays of one length"),
        (lambda: figures.plate_section([], [], thickness=0.01, cleats={}), "two arrays of one"),
    ],
)
def test_refused(draw, message):
    with pytest.raises(ValueError, match=message):
        draw()
