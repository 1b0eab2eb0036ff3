"""Table 3-1 of the thesis reproduced with the virtual profiler: ``trueterrain verify table``."""

import math
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr

    from trueterrain.core.progress import Progress
    from trueterrain.simulate.scene import CalibrationPlate, Scene
    from trueterrain.verify.thesis.table import TableRow

_MILLI = 1e3

#: Length at each end of the plate that is not compared: the plate ends in an upright face [m].
RIM = 0.05

#: Scenes and the rows for which they are recorded; the first gives two rows.
_SCENES = {
    "thesis-static": "static",
    "thesis-smooth": "dynamic",
    "thesis-excited": "dynamic, excited",
}

#: Position of the plate in a comparison with the exact pose, by attribute of `TableRow`.
PLACEMENTS = {
    "ours": "registered: offset, tilt, shift and stretch removed",
    "on_exact_path": "not registered, with the exact east and north",
    "lying": "not registered, with east and north of navigation",
}


@dataclass(frozen=True, kw_only=True, eq=False)
class ThesisTable:
    """Rows of the table, and the scenes from which they are computed."""

    rows: list["TableRow"]
    "The four rows."

    scenes: list["Scene"]
    "Scenes that were recorded."

    @property
    def reflectivity(self) -> dict[str, float]:
        """Error that screening removes from row one: published, thesis's processing and ours [m].

        The root of the difference of the mean squares of rows one and two.
        """
        from trueterrain.verify.thesis.table import pool_figures

        first, second = self.rows[:2]
        pairs = {
            "published": (first.published.low, second.published.low),
            "thesis": (first.thesis_rms, second.thesis_rms),
            "ours": (pool_figures(first.ours, "rms").value, pool_figures(second.ours, "rms").value),
        }
        return {name: math.sqrt(max(a**2 - b**2, 0.0)) for name, (a, b) in pairs.items()}

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers and text, as for JSON; lengths in m."""
        from trueterrain._version import __version__
        from trueterrain.verify.thesis.table import ORDER, WITHIN

        return {
            "version": __version__,
            "within": WITHIN,
            "order": ORDER,
            "scenes": [
                {
                    "name": one.name,
                    "title": one.title,
                    "seed": one.seed,
                    "passes": [drive.name for drive in one.passes],
                }
                for one in self.scenes
            ],
            "rows": [row.to_dict() for row in self.rows],
            "reflectivity": self.reflectivity,
            "reproduced": all(row.reproduced for row in self.rows),
        }


def make_table(progress: "Progress") -> ThesisTable:
    """Record the scenes in a temporary folder, and evaluate them.

    Parameters
    ----------
    progress : callable
        Shows progress.

    Returns
    -------
    ThesisTable
        The table.
    """
    from trueterrain.georeference import Screening
    from trueterrain.simulate.scene import read_scene, record_scene
    from trueterrain.verify.thesis.table import dynamic_row, static_rows

    rows: list[TableRow] = []
    scenes = []
    with tempfile.TemporaryDirectory() as folder:
        for done, (name, test) in enumerate(_SCENES.items()):
            progress("rows of the table", done, len(_SCENES))
            scene, path = read_scene(name)
            runs = record_scene(scene, folder, path=path, progress=progress)
            plate = scene_plate(scene)
            if scene.passes[0].standing is not None:
                # the intensity of a saturated receiver is its saturation
                screening = Screening(saturation=scene.scanner.saturation - 1.0)
                rows += static_rows(runs[0], _machined_profile(plate), screening)
            else:
                begin = (plate.east - 0.5 * plate.length + RIM, plate.north)
                rows.append(dynamic_row(test, runs, _machined_profile(plate), begin))
            scenes.append(scene)
        progress("rows of the table", len(_SCENES), len(_SCENES))
    return ThesisTable(rows=rows, scenes=scenes)


def scene_plate(scene: "Scene") -> "CalibrationPlate":
    """Calibration plate in the ground of a scene."""
    from trueterrain.simulate.scene import CalibrationPlate

    (layer,) = (one for one in scene.ground if one["kind"] == "plate")
    return CalibrationPlate(**{key: value for key, value in layer.items() if key != "kind"})


def _machined_profile(plate: "CalibrationPlate") -> "xr.Dataset":
    from trueterrain.verify.plate.design import design_plate, machined_profile

    design = design_plate(
        plate.cleats,
        length=plate.length - 2 * RIM,
        cleat_width=plate.cleat,
        rise=plate.rise,
        thickness=plate.thickness,
    )
    return machined_profile(design)


def table_lines(made: ThesisTable) -> list[list[str]]:
    """Cells of the table by row."""
    header = [
        "row",
        "published [mm]",
        "thesis's RMS",
        "maximum",
        "our RMS",
        "off edges",
        "distance",
        "maximum",
        "exact pose",
        "ratio",
    ]
    return [header, *(_row_cells(row) for row in made.rows)]


def table_remarks(made: ThesisTable) -> Iterator[str]:
    """Remarks below the table: verdict, effect of reflectivity, ratios to the exact pose."""
    kept = all(row.reproduced for row in made.rows)
    yield (
        "The thesis's processing finds "
        f"{'all' if kept else 'NOT all'} published RMS figures within 20 %."
    )
    found = made.reflectivity
    yield "Reflectivity: " + ", ".join(
        f"{name} {_MILLI * found[key]:.2f} mm"
        for key, name in (("published", "published"), ("thesis", "thesis's"), ("ours", "ours"))
    )
    for row in made.rows:
        if row.exact:
            yield f"{row.test}, our RMS over that with the exact pose (off edges):"
            for placement, text in PLACEMENTS.items():
                rms, off_edges = (
                    _format_ratio(row.ratio(figure, placement)) for figure in ("rms", "off_edges")
                )
                yield f"  {rms} ({off_edges}) {text}"
            yield f"  navigation is off by {longitudinal_error_text(row)} mm along the plate"


def _row_cells(row: "TableRow") -> list[str]:
    from trueterrain.verify.thesis.table import pool_figures

    rms, off_edges, distance = (
        pool_figures(row.ours, one) for one in ("rms", "off_edges", "distance")
    )
    low, high = map(_format_millimetres, row.ends(lambda found: found.single))
    own_low, own_high = map(_format_millimetres, (rms.low, rms.high))
    min_largest, max_largest = map(_format_millimetres, row.ends(lambda found: found.largest))
    return [
        row.test,
        published_text(row),
        f"{_format_millimetres(row.thesis_rms)} ({low} to {high})",
        f"{min_largest} to {max_largest}",
        f"{_format_millimetres(rms.value)} ({own_low} to {own_high})",
        _format_millimetres(off_edges.value),
        _format_millimetres(distance.value),
        _format_millimetres(max_error(row)),
        _format_millimetres(pool_figures(row.exact, "rms").value) if row.exact else "-",
        _format_ratio(row.ratio("rms")),
    ]


def published_text(row: "TableRow") -> str:
    """RMS that the thesis published [mm]: a number or a range."""
    low, high = _MILLI * row.published.low, _MILLI * row.published.high
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"


def max_error(row: "TableRow") -> float:
    """Maximum error of our processing over all recordings [m]."""
    return max(one.row.maximum for one in row.ours)


def longitudinal_error_text(row: "TableRow") -> str:
    """Range of the position error of navigation along the plate [mm]."""
    values = [_MILLI * abs(one) for one in row.beside]
    return f"{min(values):.0f} to {max(values):.0f}"


def _format_millimetres(value: float) -> str:
    return f"{_MILLI * value:.2f}"


def _format_ratio(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"
