"""Numbers in tiles and tables: what is not known is never a number, what is known is not lost."""

import numpy as np
import pytest

from trueterrain.report import Column, Number, Table
from trueterrain.report._numbers import column_decimals, format_size, format_value

GAP = "\N{NARROW NO-BREAK SPACE}"


@pytest.mark.parametrize(
    ("value", "digits", "written"),
    [
        (None, None, "–"),
        (float("nan"), 3, "–"),
        (np.float32("nan"), None, "–"),
        ("", None, "–"),
        (float("inf"), 2, "∞"),
        (-np.inf, None, "−∞"),
        (0.62, None, "0.62"),
        (0.62, 3, "0.620"),
        (20.0, None, "20"),
        (8.41723, None, "8.417"),
        (0.0, None, "0"),
        (-0.0004, 2, "0.00"),
        (-0.0044, 3, "−0.004"),
        (1234, None, "1234"),
        (94_000_123, None, f"94{GAP}000{GAP}123"),
        (12345.678, 1, f"12{GAP}345.7"),
        (3, 2, "3.00"),
        (np.int64(12), None, "12"),
        (np.float64(0.125), None, "0.125"),
        (-2.5e-9, None, "−2.50 × 10⁻⁹"),
        (6.02e23, None, "6.02 × 10²³"),
        (True, None, "yes"),
        (np.False_, None, "no"),
        ("rts", 2, "rts"),
    ],
)
def test_values_are_written_as_typesetters_do(value, digits, written):
    assert format_value(value, digits) == written


def test_the_numbers_of_a_column_stand_below_each_other():
    assert column_decimals([0.31, 2.4, None]) == 2
    assert column_decimals([20.0, 19.96]) == 2
    assert column_decimals([1.0, 2.0]) == 0
    assert column_decimals([1, 2]) is None
    assert column_decimals(["left", None]) is None


def test_small_numbers_of_a_column_are_not_rounded_away():
    """A count of returns and an error of a third of a millimetre can be in one column."""
    assert column_decimals([940_000.0, 0.31e-3]) is None
    assert format_value(0.31e-3, None) == "0.00031"


@pytest.mark.parametrize(
    ("number", "written"),
    [(0, "0 B"), (999, "999 B"), (12_345, "12 kB"), (4_815_814, "4.8 MB"), (3 * 10**12, "3.0 TB")],
)
def test_sizes_of_files(number, written):
    assert format_size(number) == written


def test_tables_align_numbers_and_head_them_with_units(page_of):
    page = page_of(
        Table(
            columns=(
                Column(label="Track"),
                Column(label="IRI", unit="m/km"),
                Column(label="Segments"),
                Column(label="Bias", unit="mm", digits=2),
            ),
            rows=[
                ("left", 2.417, 40, np.nan),
                ("right", 12.38, 12_000, -0.125),
                ("middle", None, None, 1),
            ],
            caption="Each track",
        )
    )
    assert page.texts("th", scope="col") == ["Track", "IRI [m/km]", "Segments", "Bias [mm]"]
    assert page.texts("th", scope="row") == ["left", "right", "middle"]
    right = page.texts("td", class_="number")
    assert right[:3] == ["2.42", "40", "–"]
    assert right[3:6] == ["12.38", f"12{GAP}000", "−0.12"]
    assert right[6:] == ["–", "–", "1.00"]
    assert len(page.all("td")) == len(right)
    assert page.texts("caption") == ["Each track"]


def test_a_verdict_is_said_in_words(page_of):
    page = page_of(
        Table(
            columns=(Column(label="Requirement"), Column(label="Found", unit="mm")),
            rows=[("RMS", 0.31), ("largest", 2.4), ("drift", None), ("of no matter", 1.0)],
            verdicts=("good", "bad", "unknown", None),
        )
    )
    said = [row["text"].split()[-2:] for row in page.all("tr")[1:4]]
    assert said == [["as", "required"], ["as", "required"], ["not", "known"]]
    assert page.texts("span", class_="verdict good") == ["✓ as required"]
    assert page.texts("span", class_="verdict bad") == ["✗ not as required"]


def test_tiles_hold_the_numbers_to_see_first(page_of):
    page = page_of(
        headline=(
            Number(label="Error", value=0.62, unit="mm", verdict="bad", note="at most 0.5 mm"),
            Number(label="Bias", value=float("nan"), unit="mm", verdict="unknown"),
        )
    )
    assert page.texts("dt") == ["Error", "Bias"]
    assert page.texts("dd", class_="value") == ["0.62 mm", "–"]
    assert page.texts("dd", class_="note") == ["at most 0.5 mm"]
    assert "nan" not in page.texts("main")[0].lower()


def test_an_empty_table_has_its_head(page_of):
    page = page_of(Table(columns=(Column(label="Run"),), rows=()))
    assert page.texts("th") == ["Run"]


@pytest.mark.parametrize(
    ("make", "rule"),
    [
        (lambda: Number(label="a", value=1, verdict="fine"), "verdict must be one of good, bad"),
        (lambda: Number(label="a", value=1, digits=-1), "digits must be between 0 and 15, got -1"),
        (lambda: Column(label="a", digits=16), "digits must be between 0 and 15, got 16"),
        (lambda: Table(columns=(), rows=()), "at least one column"),
        (
            lambda: Table(columns=(Column(label="a"),), rows=[(1,), (1, 2)]),
            "must have 1 cells, one for each column, got 2 in row 1",
        ),
        (
            lambda: Table(columns=(Column(label="a"),), rows=[(1,)], verdicts=("good", "bad")),
            r"verdicts must be as many as rows \(1\), got 2",
        ),
        (
            lambda: Table(columns=(Column(label="a"),), rows=[(1,)], verdicts=("ok",)),
            "verdict must be one of",
        ),
    ],
)
def test_what_cannot_be_shown_is_refused_at_once(make, rule):
    with pytest.raises(ValueError, match=rule):
        make()
