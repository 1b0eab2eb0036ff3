"""Page of Table 3-1 of the thesis: its tables, figures and statements."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from thesis_table import (
    ORDER,
    ORDERS,
    RIM,
    TableRow,
    ThesisTable,
    pool_figures,
    scene_plate,
)
from trueterrain.figures import plate_errors, position_sensitivity, save_figure
from trueterrain.verify.thesis import ThesisResult

TEXT = Path(__file__).parent / "page.md"
HEAD = "<!-- Made by `make study-table` from studies/table/page.md: change that, not this. -->\n\n"

#: Placement of the plate in a comparison with the exact pose, by attribute of `TableRow`.
PLACEMENTS = {
    "ours": "registered: offset, tilt, shift and stretch removed",
    "on_exact_path": "not registered, with the exact east and north",
    "unregistered": "not registered, with east and north of navigation",
}

MAX_RATIO = 1.1  # of our RMS to that with the exact pose
_MILLI = 1e3


def page_text(table: ThesisTable) -> str:
    """Text of the page with its numbers and tables."""
    text = TEXT.read_text(encoding="utf-8")
    for name, value in {
        "{{thesis}}": _thesis_table(table),
        "{{ours}}": _own_table(table),
        "{{exact}}": _exact_table(table),
        "{{orders}}": _order_table(table),
        "{{recordings}}": _recording_table(table),
        "{{assumptions}}": _assumption_table(table),
        "{max_ratio}": f"{MAX_RATIO:g}",
        "{position_error}": _position_error(table.rows[-1]),
        "{order}": str(ORDER),
        **{f"{{reflectivity_{key}}}": _mm(value) for key, value in table.reflectivity.items()},
    }.items():
        text = text.replace(name, value)
    return HEAD + text


def require_statements(table: ThesisTable) -> None:
    """Raise SystemExit with every statement of the page that the results contradict."""
    excited = table.rows[-1]
    statements = {
        "the thesis's processing finds all published RMS": all(r.reproduced for r in table.rows),
        **{
            f"{row.test}, {PLACEMENTS[placement]}: about as good as with the exact pose": (
                row.ratio("rms", placement) <= MAX_RATIO
            )
            for row in table.rows
            if row.exact
            for placement in ("ours", "on_exact_path")
        },
        "with east and north of navigation it is not": (
            excited.ratio("rms", "unregistered") > MAX_RATIO
        ),
    }
    wrong = [sentence for sentence, holds in statements.items() if not holds]
    if wrong:
        raise SystemExit("The results contradict the page:\n- " + "\n- ".join(wrong))


def draw_errors(table: ThesisTable, path: Path) -> None:
    """Write the figure of errors over the plate."""
    import matplotlib.pyplot as plt

    every, screened, smooth, excited = table.rows
    panels = {
        "standing, thesis's processing": {
            "all returns": every.thesis[0],
            "screened": screened.thesis[0],
        },
        "standing, this package": {"all returns": every.ours[0], "screened": screened.ours[0]},
        "driven": {"thesis's processing": smooth.thesis[0], "this package": smooth.ours[0]},
        "driven, excited": {
            "thesis's processing": excited.thesis[0],
            "this package": excited.ours[0],
        },
    }
    figure, axes = plt.subplots(2, 2, figsize=(11, 6.4), layout="constrained")
    for ax, (title, found) in zip(axes.flat, panels.items(), strict=True):
        plate_errors({name: one.errors for name, one in found.items()}, ax=ax)
        ax.set_title(title, loc="right", fontsize="medium")  # the legend is at the left
    save_figure(figure, path, force=True)
    plt.close(figure)


def draw_sensitivity(table: ThesisTable, path: Path) -> None:
    """Write the figure of RMS over the position of the plate between samples."""
    import matplotlib.pyplot as plt

    rows = table.rows
    single = [np.sqrt(np.mean([one.single**2 for one in row.thesis], axis=0)) for row in rows]
    published = {
        name: ("row", [getattr(row.published, name) for row in rows]) for name in ("low", "high")
    }
    ax = position_sensitivity(
        xr.Dataset(
            {"rms": (("row", "beside"), single), **published},
            {"row": [row.test for row in rows], "beside": rows[0].thesis[0].beside},
        )
    )
    save_figure(ax, path, force=True)
    plt.close(ax.figure)


def _thesis_table(table: ThesisTable) -> str:
    def range_over(row: TableRow, figure: Callable[[ThesisResult], np.ndarray]) -> str:
        return _range(*row.find_range(figure))

    rows = [
        [
            row.test,
            _published(row),
            _mm(row.thesis_rms),
            range_over(row, lambda found: found.single),
            f"{_MILLI * row.published.maximum:g}",
            range_over(row, lambda found: found.largest),
        ]
        for row in table.rows
    ]
    return _lines(["row", "published", "RMS", "range", "published maximum", "maximum"], rows)


def _own_table(table: ThesisTable) -> str:
    rows = []
    for row in table.rows:
        rms, off_edges, distance = (
            pool_figures(row.ours, one) for one in ("rms", "off_edges", "distance")
        )
        largest = max(one.row.maximum for one in row.ours)
        others = (_mm(one) for one in (off_edges.value, distance.value, largest))
        rows.append([row.test, _mm(rms.value), _range(rms.low, rms.high), *others])
    return _lines(["row", "RMS", "range", "off edges", "distance", "maximum"], rows)


def _exact_table(table: ThesisTable) -> str:
    rows = []
    for row in table.rows:
        for placement, text in PLACEMENTS.items() if row.exact else ():
            exact = row.exact if placement == "ours" else row.unregistered_exact
            rms = (pool_figures(one, "rms").value for one in (getattr(row, placement), exact))
            ratios = (row.ratio(one, placement) for one in ("rms", "off_edges", "distance"))
            rows.append([f"{row.test}; {text}", *map(_mm, rms), *(f"{one:.2f}" for one in ratios)])
    heads = ["row", "RMS [mm]", "exact pose [mm]", "ratio of RMS", "off edges", "of distance"]
    return _lines(heads, rows)


def _order_table(table: ThesisTable) -> str:
    rows = [
        [row.test, *map(_mm, row.orders.values()), _published(row)]
        for row in table.rows
        if row.orders
    ]
    return _lines(["row", *(f"order {one}" for one in ORDERS), "published"], rows)


def _recording_table(table: ThesisTable) -> str:
    rows = [
        [f"{row.test}, {name}", *map(_mm, values)]
        for row in table.rows
        if row.exact
        for name, values in (
            ("thesis's processing", [one.rms for one in row.thesis]),
            ("this package", [one.row.rms.value for one in row.ours]),
            ("exact pose", [one.row.rms.value for one in row.exact]),
        )
    ]
    return _lines(["row, recording", *(str(n + 1) for n in range(len(rows[0]) - 1))], rows)


def _assumption_table(table: ThesisTable) -> str:
    return _lines(["parameter", "value", "source"], list(_assumptions(table)))


def _assumptions(table: ThesisTable) -> Iterator[list[str]]:
    standing, smooth, _ = table.scenes
    plate, scanner, paint = scene_plate(standing), standing.scanner, standing.reflectivity
    navigation = smooth.navigation
    beams = f"{scanner.beams}, {scanner.swath:g} m, {scanner.rate:g} Hz"
    yield ["beams, swath, scans", beams, "the thesis's"]
    speed = f"{smooth.passes[0].speed['speed']:g} m/s, as designed in the thesis"
    yield ["speed, events", speed, "the thesis's"]
    cleats = f"{_MILLI * plate.cleat:g} mm wide, {_MILLI * plate.rise:g} mm high"
    yield ["cleats", cleats, "the thesis's"]
    yield [
        "their shapes",
        " and ".join(plate.cleats),
        "chosen: without upright faces, which the published maximum excludes",
    ]
    yield ["length that is compared", f"{plate.length - 2 * RIM:g} m", "assumed"]
    yield [
        "lateral offset of the centre of the plate from that of the scan",
        f"{plate.east:g} m",
        "chosen: there the spacing of the beams is swath over beams",
    ]
    yield [
        "stripes",
        f"{_MILLI * paint.width:g} mm every {_MILLI * paint.period:g} mm, reflectivity "
        f"{paint.stripe:g} on {paint.ground:g}",
        "chosen: for the published effect",
    ]
    yield [
        "saturation, and error of ranges",
        f"{scanner.saturation:g} counts, {-_MILLI * scanner.saturation_bias:g} mm too short at "
        "twice",
        "chosen: for the published effect",
    ]
    yield ["noise of a range", f"{_MILLI * scanner.range_noise:g} mm", "assumed"]
    yield [
        "drift of navigation, east and north",
        f"{_MILLI * navigation.horizontal_sd:g} mm over {navigation.horizontal_time:g} s",
        "assumed: that of its class",
    ]
    yield ["vehicle", smooth.vehicle.model, "assumed"]
    yield ["order of the filters", str(ORDER), "chosen of 1, 2 and 4; one for both rows"]
    yield ["screening while driving", "none, and no stripes", "assumed"]


def _published(row: TableRow) -> str:
    low, high = _MILLI * row.published.low, _MILLI * row.published.high
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"


def _position_error(row: TableRow) -> str:
    """Range of the position error of navigation along the plate [mm]."""
    values = [_MILLI * abs(one) for one in row.position_errors]
    return f"{min(values):.0f} to {max(values):.0f}"


def _mm(value: float) -> str:
    return f"{_MILLI * value:.2f}"


def _range(low: float, high: float) -> str:
    return f"{_mm(low)} to {_mm(high)}"


def _lines(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    rule = ["---", *["--:"] * (len(heads) - 1)] if heads[0] != "parameter" else ["---"] * len(heads)
    return "\n".join("| " + " | ".join(row) + " |" for row in [heads, rule, *rows])
