"""Figures of adjusted passes: drawn values equal the given ones."""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import numpy.testing as npt
import pytest
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_hex
from matplotlib.patches import Ellipse, Rectangle

from trueterrain import figures
from trueterrain.alignment import (
    AdjustedGround,
    RejectedCells,
    SplineCorrection,
    SplineKnots,
    adjust_passes,
    make_pass_cells,
)
from trueterrain.alignment.discontinuity.alignment import (
    DiscontinuitySettings,
    SeamSteps,
    align_along_paths,
)
from trueterrain.alignment.discontinuity.reference_path import (
    straight_reference,
    waypoint_reference,
)
from trueterrain.alignment.discontinuity.seams import SeamAgreement
from trueterrain.core.schemas import make_points
from trueterrain.profile import Rectangle as RectangleArea

EXACT = {"rtol": 0, "atol": 1e-12}  # [m], [s] round-off
POWER = {"rtol": 0.02, "atol": 0}  # [1] of a sine under a Hann window, where it ends within a step

SD, LEFT = 2e-3, 1e-3  # [m] of the coefficients, and what corrections leave


@pytest.fixture(autouse=True)
def _closed_figures():
    yield
    plt.close("all")


def correction(name="east", height=0.005, *, begin=0.0, intervals=20, supported=None, **changes):
    """Constant height and roll, all coefficients with a standard deviation of `SD`."""
    return SplineCorrection(
        name=name,
        knots=SplineKnots(begin=begin, spacing=0.5, intervals=intervals),
        components=("height", "roll"),
        offset=np.array([height, 1e-3]),
        residual_sd=LEFT,
        coefficients=np.outer([height, 1e-3], np.ones(intervals + 3)),
        covariance=np.tile(SD**2 * np.eye(8), (intervals, 1, 1)),
        supported=np.ones(intervals, bool) if supported is None else np.asarray(supported),
        **changes,
    )


def drawn(ax):
    """The figure laid out, as it is when it is written."""
    ax.figure.canvas.draw()
    return ax


def line(ax, label):
    return next(one for one in ax.lines if one.get_label() == label).get_data()


def legend_texts(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


def notes(ax):
    return " | ".join(text.get_text() for text in ax.texts)


def spans(ax, label_start):
    """Left and right ends of shaded stretches, those without a name among them."""
    shaded = [one for one in ax.patches if isinstance(one, Rectangle)]
    named = [one for one in shaded if str(one.get_label()).startswith(label_start)]
    assert len(named) == 1
    same = [one for one in shaded if one.get_facecolor() == named[0].get_facecolor()]
    return [(one.get_x(), one.get_x() + one.get_width()) for one in same]


# corrections


def test_a_correction_is_drawn_with_its_own_standard_deviation():
    ax = drawn(figures.pass_correction(correction()))
    label = legend_texts(ax)[0]
    time, height = line(ax, label)
    npt.assert_allclose(height, 0.005, **EXACT)
    npt.assert_allclose(time[[0, -1]], [0.0, 10.0], **EXACT)
    band = next(one for one in ax.collections if isinstance(one, PolyCollection))
    # at a knot three coefficients count by 1/6, 4/6 and 1/6
    sd = np.hypot(SD * np.sqrt(0.5), LEFT)
    corner = band.get_paths()[0].vertices
    npt.assert_allclose(
        np.unique(corner[corner[:, 0] == 2.0, 1]), 0.005 + sd * np.array([-1, 1]), **EXACT
    )
    npt.assert_allclose(correction().sd([2.0]), sd, **EXACT)
    assert ax.get_ylabel() == "Correction of height [mm]"


@pytest.mark.parametrize(("along", "first"), [("time", 0.0), ("station", 700.0)])
def test_times_count_from_the_begin_of_each_pass_and_stations_do_not(along, first):
    ax = figures.pass_correction(
        [correction(begin=700.0), correction("west", -0.005, begin=700.0)], along=along
    )
    assert line(ax, legend_texts(ax)[0])[0][0] == first
    assert "[s]" in ax.get_xlabel() if along == "time" else ax.get_xlabel() == "Station [m]"


def test_the_reported_sd_of_navigation_is_drawn_on_both_sides_of_zero():
    time = np.linspace(95.0, 115.0, 201)
    reported = {"east": (time, 0.02 + 0 * time)}
    ax = drawn(figures.pass_correction(correction(begin=100.0), navigation_sd=reported))
    low, high = (one for one in ax.lines if np.size(one.get_ydata()) == 101)
    assert (low.get_ydata()[0], high.get_ydata()[0]) == (-0.02, 0.02)
    npt.assert_allclose(low.get_xdata()[[0, -1]], [0.0, 10.0], **EXACT)  # not beyond the pass
    assert "± 1 sd reported by navigation" in legend_texts(ax)


def test_stretches_without_observations_are_hatched_and_labelled():
    supported = np.ones(20, bool)
    supported[4:6] = supported[18:] = False
    ax = drawn(figures.pass_correction(correction(begin=50.0, supported=supported)))
    npt.assert_allclose(spans(ax, "east: extrapolated"), [(2.0, 3.0), (9.0, 10.0)], **EXACT)
    assert sum("extrapolated" in text for text in legend_texts(ax)) == 1


def test_roll_is_written_in_milliradians():
    ax = drawn(figures.pass_correction(correction(), component="roll"))
    assert ax.get_ylabel() == "Correction of roll [mrad]"
    assert "µrad" in legend_texts(ax)[0]
    assert ax.yaxis.get_major_formatter()(2e-3, 0) == "2"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"component": "east"}, "component must be one of height, roll"),
        ({"navigation_sd": {"north": ([0.0], [1.0])}}, "of a pass that is drawn, got 'north'"),
        ({"navigation_sd": {"east": ([0.0, 1.0], [1.0])}}, "one standard deviation for each time"),
        ({"navigation_sd": {"east": ([77.0], [1.0])}}, "times from 0 to 10"),
    ],
)
def test_invalid_arguments_of_corrections_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        figures.pass_correction(correction(), **changes)
    with pytest.raises(ValueError, match="at least 1 correction"):
        figures.pass_correction([])


# spectra of corrections


def wave(frequency, amplitude, *, intervals=200):
    """Correction that follows a sine at its knots."""
    one = correction(intervals=intervals)
    omega = 2 * np.pi * frequency
    # of the coefficients, so that the spline goes through the sine at its knots
    factor = 3.0 / (2.0 + np.cos(omega * one.knots.spacing))
    height = amplitude * factor * np.sin(omega * one.knots.places)
    return replace(one, coefficients=np.stack([height, 0 * height]))


def test_the_spectrum_of_a_wave_holds_its_variance_at_its_frequency():
    ax = drawn(figures.correction_spectrum(wave(0.2, 0.004)))
    frequency, density = line(ax, "east")
    npt.assert_allclose(frequency[np.argmax(density)], 0.2, rtol=0, atol=0.5 * frequency[0])
    npt.assert_allclose(density.sum() * frequency[0], 0.004**2 / 2, **POWER)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("Frequency [Hz]", "Correction of height [m²/Hz]")


def test_what_remains_is_drawn_beyond_the_knots():
    """Knots of 0.5 s hold up to 1 Hz."""
    ax = figures.correction_spectrum(wave(0.2, 0.004))
    frequency, density = line(ax, "east: residual sd 1 mm")
    npt.assert_allclose(frequency, [1.0, 8.0], **EXACT)
    npt.assert_allclose(density[0] * np.ptp(frequency), LEFT**2, **EXACT)
    assert spans(ax, "finer than the knots") == [(1.0, 8.0)]


def test_with_the_speed_the_spectrum_is_over_wavelengths():
    ax = drawn(figures.correction_spectrum(wave(0.2, 0.004), speed=5.0))
    wavenumber, density = line(ax, "east")
    npt.assert_allclose(1 / wavenumber[np.argmax(density)], 25.0, rtol=0.05, atol=0)
    npt.assert_allclose(density.sum() * wavenumber[0], 0.004**2 / 2, **POWER)
    assert ax.get_xlabel() == "Wavelength [m]"
    assert ax.xaxis.get_major_formatter()(0.04, 0) == "25"


def test_a_constant_correction_has_no_spectrum_but_a_figure():
    ax = drawn(figures.correction_spectrum(replace(correction(), residual_sd=0.0)))
    assert ax.get_ylim()[1] > ax.get_ylim()[0] > 0


def test_invalid_speeds_are_refused():
    with pytest.raises(ValueError, match=r"speed must be greater than 0 m/s, got 0\."):
        figures.correction_spectrum(correction(), speed=0.0)
    with pytest.raises(ValueError, match="along time"):
        figures.correction_spectrum(correction(), along="station", speed=5.0)


# how stiff corrections are chosen to be


@pytest.fixture(scope="module")
def adjusted():
    """Two passes over rough ground whose navigation drifts by millimetres."""
    rng = np.random.default_rng(2)
    x, y = (at.ravel() for at in np.meshgrid(np.arange(0.05, 60, 0.5), np.arange(0.05, 0.6, 0.1)))
    ground = rng.normal(0, 0.02, x.size)
    number = (np.floor(x / 0.1).astype(np.int64) << 32) + np.floor(y / 0.1).astype(np.int64)
    return adjust_passes(
        [
            make_pass_cells(
                name,
                number,
                x / 5,
                ground + sign * (0.01 + 0.003 * np.sin(x / 6)) + rng.normal(0, 1e-3, x.size),
                variance=1e-6,
                easting=x,
                northing=y,
            )
            for name, sign in (("east", 1), ("west", -1))
        ]
    )


def lines_of(ax):
    """Strengths and errors of each line, by its colour, symbol and dashes."""
    return {
        (one.get_color(), one.get_marker(), one.get_linestyle()): dict(
            zip(*one.get_data(), strict=True)
        )
        for one in ax.lines
        if np.size(one.get_xdata()) and one.get_marker() != "*"
    }


def test_every_strength_is_drawn_at_what_it_predicts_at_best(adjusted):
    ax = drawn(figures.strength_choice(adjusted))
    trials = [one for one in adjusted.trials if one.round == adjusted.chosen.round]
    looks = lines_of(ax)
    kinds = {(one.components, one.knot_spacing, one.order) for one in trials}
    assert len(looks) == len(kinds)
    for kind in kinds:
        best = {}
        for one in trials:
            if (one.components, one.knot_spacing, one.order) == kind and one.strength > 0:
                best[one.strength] = min(one.held_out, best.get(one.strength, np.inf))
        assert any(best.items() <= found.items() for found in looks.values())
    (star,) = (one for one in ax.lines if one.get_marker() == "*")
    assert (star.get_xdata()[0], star.get_ydata()[0]) == (
        adjusted.chosen.strength,
        adjusted.chosen.held_out,
    )
    assert ax.get_ylabel() == "RMSE in held-out cells [mm]"
    assert "too stiff" in ax.get_xlabel()
    assert "too flexible" in ax.get_xlabel()


def test_components_spacings_and_processes_are_distinguished(adjusted):
    trials = [
        replace(adjusted.chosen, components=held, knot_spacing=spacing, order=order, strength=size)
        for held in (("height",), ("height", "east", "north"))
        for spacing in (1.0, 0.5)
        for order in ("second", "first")
        for size in (1e-3, 1e-2)
    ]
    ax = figures.strength_choice(replace(adjusted, trials=tuple(trials), chosen=trials[3]))
    assert len(lines_of(ax)) == 8
    assert legend_texts(ax) == [
        "height",
        "height + shift",
        "knots 1 s",
        "knots 0.5 s",
        "second order (smooth)",
        "first order (rough)",
        "chosen: 10 mm",
    ]
    in_metres = figures.strength_choice(adjusted, along="station")
    assert any(text.startswith("knots") and text.endswith(" m") for text in legend_texts(in_metres))


def test_trials_of_different_iterations_do_not_compare(adjusted):
    other = replace(adjusted.chosen, round=adjusted.chosen.round + 1, held_out=0.5)
    ax = figures.strength_choice(replace(adjusted, trials=(*adjusted.trials, other)))
    assert 0.5 not in [y for found in lines_of(ax).values() for y in found.values()]
    count = sum(one.round != adjusted.chosen.round for one in adjusted.trials) + 1
    assert f"{count} trials of other iterations" in notes(ax)


def test_a_constant_has_a_place_left_of_all_strengths(adjusted):
    ax = drawn(figures.strength_choice(adjusted))
    ticks = dict(
        zip([text.get_text() for text in ax.get_xticklabels()], ax.get_xticks(), strict=True)
    )
    least = min(one.strength for one in adjusted.trials if one.strength > 0)
    assert ticks["0: constant"] < least
    constant = {one.held_out for one in adjusted.trials if one.strength == 0}
    at = {
        found[ticks["0: constant"]]
        for found in lines_of(ax).values()
        if ticks["0: constant"] in found
    }
    assert at
    assert at <= constant


def test_one_strength_that_was_given_is_drawn_alone(adjusted):
    trial = replace(adjusted.chosen, strength=0.0)
    ax = drawn(figures.strength_choice(replace(adjusted, trials=(trial,), chosen=trial)))
    assert legend_texts(ax)[-1] == "chosen: constant"
    assert [text.get_text() for text in ax.get_xticklabels()] == ["0: constant"]


# discontinuity vectors


def lane(shift, lateral, *, hole=None):
    """A lane 2 m wide and 20 m long over level ground, higher by a constant and a wave."""
    x, y = (at.ravel() for at in np.meshgrid(np.arange(0, 20, 0.05), np.arange(0, 2, 0.05)))
    kept = np.ones(x.size, bool) if hole is None else ~((x > hole[0]) & (x < hole[1]))
    return make_points(x[kept], y[kept] + lateral, 100.0 + shift + 0 * x[kept])


@pytest.fixture(scope="module")
def aligned():
    """Two lanes that differ by 12 mm, of which the left one has a hole from 8 m to 10 m."""
    lanes = {"left": lane(0.012, 1.0, hole=(8.0, 10.0)), "right": lane(0.0, 0.0)}
    path = straight_reference((0.0, 1.5), (19.95, 1.5))
    return align_along_paths(lanes, paths={("left", "right"): path}).pairs[0]


def test_vectors_are_drawn_as_they_are(aligned):
    found = aligned.discontinuity
    ax = drawn(figures.discontinuity_vectors(aligned, cut_off=2.5))
    for number, name in enumerate(("left", "right")):
        npt.assert_array_equal(line(ax, f"{name}, raw")[1], found.raw[number])
        label = next(text for text in legend_texts(ax) if text.startswith(f"{name}, filtered"))
        npt.assert_array_equal(line(ax, label), [found.station, found.filtered[number]])
    assert "left, filtered: median 6.0 mm" in legend_texts(ax)
    assert "right, filtered: median −6.0 mm" in legend_texts(ax)
    assert "2.5 m" in notes(ax)
    assert (ax.get_xlabel(), ax.get_ylabel()) == (
        "Station of the reference path [m]",
        "Pass less reference height [mm]",
    )


def test_gaps_are_shaded_over_the_reference_points_that_they_hold(aligned):
    found = aligned.discontinuity
    ax = figures.discontinuity_vectors(found)
    ends = [end for span in spans(ax, "gap: overlap too thin") for end in span]
    inside = found.station[found.gap]
    assert any(8.0 <= station <= 10.0 for station in inside)
    covered = [
        any(a <= s <= b for a, b in zip(ends[::2], ends[1::2], strict=True)) for s in found.station
    ]
    npt.assert_array_equal(covered, found.gap)
    few = replace(found, thin=np.zeros_like(found.thin))
    assert "gap: few heights" in legend_texts(figures.discontinuity_vectors(few))


def test_a_cut_off_is_a_length(aligned):
    with pytest.raises(ValueError, match="cut_off must be greater than 0 m"):
        figures.discontinuity_vectors(aligned, cut_off=0.0)


def test_histograms_hold_all_heights_and_the_means_are_correct(aligned):
    found = aligned.discontinuity
    ax = drawn(figures.pass_histograms(found, station=4.05))
    k = 16  # at 4 m, the nearest one
    for number, name in enumerate(("left", "right")):
        bars = next(one for one in ax.patches if str(one.get_label()).startswith(name))
        values, edges, _ = bars.get_data()
        assert values.sum() == found.count[number, k]
        assert edges[0] <= found.height[number, k] <= edges[-1] + 1e-9
        mean = next(text for text in legend_texts(ax) if text.startswith(f"mean of {name}"))
        npt.assert_allclose(line(ax, mean)[0], found.height[number, k], **EXACT)
    reference = next(text for text in legend_texts(ax) if text.startswith("reference height"))
    npt.assert_allclose(line(ax, reference)[0], found.reference_height[k], **EXACT)
    assert ax.get_xlabel().startswith("Height")
    assert "[mm]" in ax.get_xlabel()
    assert "station 4.00 m" in notes(ax)


def test_medians_are_labelled_as_medians():
    lanes = {"left": lane(0.012, 1.0), "right": lane(0.0, 0.0)}
    found = (
        align_along_paths(lanes, DiscontinuitySettings(statistic="median")).pairs[0].discontinuity
    )
    texts = legend_texts(figures.pass_histograms(found, station=10.0))
    assert sum(text.startswith("median of") for text in texts) == 2


def test_a_gap_is_noted_and_the_rest_is_drawn(aligned):
    ax = figures.pass_histograms(aligned.discontinuity, station=9.0)
    assert "a gap" in notes(ax)
    assert not any(text.startswith(("left", "reference")) for text in legend_texts(ax))


def test_stations_off_the_path_have_no_histogram(aligned):
    with pytest.raises(ValueError, match=r"station must be from 0 to 19\.75 m, got 25"):
        figures.pass_histograms(aligned.discontinuity, station=25.0)
    none = np.zeros_like(aligned.discontinuity.count)
    with pytest.raises(ValueError, match="at which a pass has heights"):
        figures.pass_histograms(replace(aligned.discontinuity, count=none), station=9.0)


# seams


def seam(before, after):
    at = np.arange(len(before[0])) + 0.5
    return SeamAgreement(
        names=("left", "right"),
        before=SeamSteps(station=at, step=np.array(before)),
        after=SeamSteps(station=at, step=np.array(after)),
    )


def test_steps_before_and_after_can_both_be_read():
    steps = seam([[0.05, 0.04], [-0.05, -0.04]], [[1e-4, -2e-4], [1e-4, np.nan]])
    ax = drawn(figures.seam_steps(steps))
    npt.assert_allclose(line(ax, "before, edge of right"), [[0.5, 1.5], [0.05, 0.04]], **EXACT)
    npt.assert_allclose(line(ax, "after, edge of left"), [[0.5, 1.5], [1e-4, 2e-4]], **EXACT)
    npt.assert_allclose(line(ax, "median after 0.1 mm")[1], 1e-4, **EXACT)
    assert "median before 45 mm" in legend_texts(ax)
    low, high = ax.get_ylim()
    assert (low < 1e-4, high > 0.05, ax.get_yscale()) == (True, True, "log")
    assert ax.yaxis.get_major_formatter()(1e-4, 0) == "0.1"
    assert ax.get_ylabel().endswith("[mm]")
    assert "mean over 1 m" in notes(ax)


def test_steps_too_small_to_draw_are_counted():
    steps = seam([[0.05, 0.04], [0.05, 0.04]], [[0.0, 1e-9], [1e-4, 1e-4]])
    ax = drawn(figures.seam_steps(steps))
    npt.assert_allclose(line(ax, "after, edge of left")[1], 1e-6, **EXACT)
    assert "2 below 0.001 mm drawn there" in notes(ax)


def test_an_edge_that_is_not_there_is_not_drawn():
    none = [np.nan, np.nan]
    ax = figures.seam_steps(seam([[0.05, 0.04], none], [[1e-4, 2e-4], none]))
    assert "before, edge of right" not in legend_texts(ax)
    with pytest.raises(ValueError, match="left and right must hold at least 1 step"):
        figures.seam_steps(seam([none, none], [none, none]))


# maps


def ground(columns=40, rows=10, *, heading=0.0, origin=(0.0, 0.0)):
    """Cells of 0.1 m whose range is their number in micrometres; half of it afterwards."""
    c, r = (at.ravel() for at in np.meshgrid(np.arange(columns), np.arange(rows)))
    x, y = 0.1 * c + 0.05, 0.1 * r + 0.05
    value = 1e-6 * np.arange(x.size)
    cos, sin = np.cos(heading), np.sin(heading)
    return AdjustedGround(
        cell=(c.astype(np.int64) << 32) + r,
        easting=origin[0] + cos * x - sin * y,
        northing=origin[1] + sin * x + cos * y,
        height=0 * x,
        sd=0 * x,
        before=value,
        after=value / 2,
    )


def test_ranges_are_drawn_where_the_cells_are():
    ax = drawn(figures.discrepancy_map(ground()))
    image = ax.images[0]
    npt.assert_allclose(image.get_array(), 1e-6 * np.arange(400).reshape(10, 40), **EXACT)
    npt.assert_allclose(image.get_extent(), (0.0, 4.0, 0.0, 1.0), **EXACT)
    after = figures.discrepancy_map(ground(), when="after").images[0].get_array()
    npt.assert_allclose(after, 0.5 * image.get_array(), **EXACT)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("Easting [m]", "Northing [m]")
    assert "before; equal scale" in notes(ax)
    assert ax.child_axes[0].get_ylabel() == "Range [mm]"


def test_maps_before_and_after_can_have_the_same_colours():
    for when in ("before", "after"):
        ax = figures.discrepancy_map(ground(), when=when, largest=3e-4)
        assert ax.images[0].get_clim() == (0.0, 3e-4)
    least = figures.discrepancy_map(replace(ground(), before=np.zeros(400)))
    assert least.images[0].get_clim()[1] > 0


def test_of_a_large_ground_the_greatest_range_is_kept():
    """5000 cells on 1250 pixels of 4."""
    ax = drawn(figures.discrepancy_map(ground(5000, 2)))
    shown = ax.images[0].get_array()
    assert shown.shape == (2, 1250)
    npt.assert_allclose(shown[0], 1e-6 * (4 * np.arange(1250) + 3), **EXACT)
    assert "greatest in 400 mm × 100 mm" in notes(ax)


def test_holes_stay_holes():
    some = np.arange(400) != 45
    holed = replace(
        ground(),
        **{
            name: getattr(ground(), name)[some]
            for name in ("cell", "easting", "northing", "height", "sd", "before", "after")
        },
    )
    shown = figures.discrepancy_map(holed).images[0].get_array()
    npt.assert_array_equal(np.argwhere(np.ma.getmaskarray(np.ma.masked_invalid(shown))), [[1, 5]])


@pytest.mark.parametrize(("shape", "stretched"), [((300, 5), "northing"), ((5, 300), "easting")])
def test_a_strip_is_stretched_laterally_with_a_note(shape, stretched):
    ax = drawn(figures.discrepancy_map(ground(*shape)))
    assert f"{stretched} stretched 20 times" in notes(ax)
    assert ax.get_aspect() == (20.0 if stretched == "northing" else 1 / 20)


def test_along_a_path_a_road_is_straight_whatever_its_heading():
    heading = np.deg2rad(35.0)
    road = ground(heading=heading, origin=(500.0, 7000.0))
    far = 4.0 * np.array([np.cos(heading), np.sin(heading)])
    path = straight_reference((500.0, 7000.0), (500.0 + far[0], 7000.0 + far[1]), spacing=0.5)
    ax = drawn(figures.discrepancy_map(road, path=path))
    left, right, bottom, top = ax.images[0].get_extent()
    npt.assert_allclose([left, right, bottom, top], [0, 4.0, 0, 1.0], rtol=0, atol=0.15)
    assert not np.isnan(np.ma.filled(ax.images[0].get_array(), np.nan)).any()  # nothing between
    assert ax.get_ylabel() == "Offset, left + [m]"
    assert "greatest in 150 mm × 150 mm" in notes(ax)


def test_rejected_cells_are_marked_once_each():
    rejected = RejectedCells(
        name=np.array(["east", "west", "east"]),
        cell=np.array([7, 7, 9]),
        easting=np.array([0.75, 0.75, 0.95]),
        northing=np.array([0.05, 0.05, 0.15]),
        misfit=np.zeros(3),
    )
    ax = drawn(figures.discrepancy_map(ground(), rejected=rejected))
    (label,) = legend_texts(ax)
    assert label == "rejected in a pass: 2 cells"
    npt.assert_allclose(line(ax, label), [[0.75, 0.95], [0.05, 0.15]], **EXACT)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"when": "later"}, "when must be before or after, got 'later'"),
        ({"largest": 0.0}, "largest must be greater than 0 m"),
        ({"cell": -1.0}, "cell must be greater than 0 m"),
    ],
)
def test_maps_that_cannot_be_drawn(changes, message):
    with pytest.raises(ValueError, match=message):
        figures.discrepancy_map(ground(), **changes)


def test_both_passes_and_their_overlap_are_distinguished():
    lanes = {"left": lane(0.012, 1.0), "right": lane(0.0, 0.0)}
    pair = align_along_paths(lanes).pairs[0]
    ax = drawn(figures.overlap_map(pair.overlap, pair.path))
    image = ax.images[0]
    left, _, bottom, _ = image.get_extent()

    def code(x, y):
        return image.get_array()[int((y - bottom) / 0.1), int((x - left) / 0.1)]

    assert [code(10.0, y) for y in (0.5, 1.5, 2.5)] == [2, 3, 1]
    assert legend_texts(ax)[:4] == ["left", "right", "both", "reference path"]
    colours = [to_hex(image.cmap(image.norm(value))) for value in (1, 2, 3)]
    assert len(set(colours)) == 3
    npt.assert_array_equal(
        line(ax, "reference path"), [pair.path.curve.easting, pair.path.curve.northing]
    )
    assert "equal scale" in notes(ax)


def test_some_search_areas_are_drawn_at_their_reference_points():
    lanes = {"left": lane(0.012, 1.0), "right": lane(0.0, 0.0)}
    pair = align_along_paths(lanes).pairs[0]
    ax = figures.overlap_map(pair.overlap, pair.path, part=(5.0, 8.0))
    places = np.stack(pair.path.places, axis=1)
    rings = [one for one in ax.patches if isinstance(one, Ellipse)]
    assert len(rings) == 6
    for ring in rings:
        nearest = np.argmin(np.hypot(*(places - ring.get_center()).T))
        npt.assert_allclose(places[nearest], ring.get_center(), **EXACT)
        assert 5.0 <= pair.path.curve.s[nearest] <= 8.0
        npt.assert_allclose([ring.get_width(), ring.get_height()], 0.4, **EXACT)
    assert np.ptp(ax.images[0].get_extent()[:2]) < 3.5
    assert "station 5 m to 8 m of" in notes(ax)
    area = RectangleArea(length=0.3, width=0.1)
    ax = figures.overlap_map(pair.overlap, pair.path, part=(5.0, 8.0), area=area)
    boxes = [one for one in ax.patches if type(one) is Rectangle and one.get_width() > 0]
    npt.assert_allclose(
        [(one.get_width(), one.get_height()) for one in boxes], 6 * [(0.3, 0.1)], **EXACT
    )


def test_the_centre_of_a_long_path_is_shown():
    x = np.arange(0.0, 80.1, 0.1)
    lanes = {
        name: make_points(
            *(at.ravel() for at in np.meshgrid(x, np.arange(0, 2, 0.1) + lateral)),
            np.full(20 * x.size, height),
        )
        for name, lateral, height in (("left", 1.0, 0.012), ("right", 0.0, 0.0))
    }
    options = DiscontinuitySettings(cell=0.2, least=5)
    path = waypoint_reference([0.2, 79.8], [1.5, 1.5])
    pair = align_along_paths(lanes, options, paths={("left", "right"): path}).pairs[0]
    ax = drawn(figures.overlap_map(pair.overlap, pair.path))
    npt.assert_allclose(ax.images[0].get_extent()[:2], (32.4, 47.6), rtol=0, atol=0.4)
    with pytest.raises(ValueError, match="two stations that ascend"):
        figures.overlap_map(pair.overlap, pair.path, part=(8.0, 5.0))
    with pytest.raises(ValueError, match="must hold a reference point"):
        figures.overlap_map(pair.overlap, pair.path, part=(5.05, 5.1))


# all of them


def test_figures_are_drawn_into_given_axes(adjusted, aligned):
    for draw in (
        lambda ax: figures.pass_correction(adjusted.corrections, ax=ax),
        lambda ax: figures.correction_spectrum(adjusted.corrections, ax=ax),
        lambda ax: figures.strength_choice(adjusted, ax=ax),
        lambda ax: figures.discontinuity_vectors(aligned, ax=ax),
        lambda ax: figures.pass_histograms(aligned.discontinuity, station=4.0, ax=ax),
        lambda ax: figures.seam_steps(seam([[0.05], [0.05]], [[1e-4], [1e-4]]), ax=ax),
        lambda ax: figures.discrepancy_map(adjusted.ground, ax=ax),
        lambda ax: figures.overlap_map(aligned.overlap, aligned.path, ax=ax),
    ):
        ax = plt.subplots()[1]
        assert draw(ax) is ax
