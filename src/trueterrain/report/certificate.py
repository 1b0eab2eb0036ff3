"""Certificate of an accuracy test: system, method, results and inputs."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from trueterrain import figures
from trueterrain._version import __version__
from trueterrain.report.findings import findings_blocks, modes_table
from trueterrain.report.parts import (
    Block,
    Column,
    File,
    Files,
    Number,
    Picture,
    Report,
    Section,
    Table,
    Text,
    Warnings,
)
from trueterrain.report.pdf import write_report_pdf
from trueterrain.report.write import write_json_file, write_report
from trueterrain.verify.certificate import CertificateResult, Result, write_error_tables
from trueterrain.verify.drift import DriftResult
from trueterrain.verify.dynamic import DynamicResult
from trueterrain.verify.statistics.uncertainty import AccuracyFigure

_MILLI = 1e3
_DIGITS = 3  # of millimetres

_METHODS = {
    "static": "Each beam of a scanner at rest meets the same place in every scan. The mean of its "
    "ranges gives a height, their standard deviation the noise. The machined profile is registered "
    "to these heights by a robust fit of offset, tilt and lateral shift, which are reported "
    "separately; the residual at each place is the error.",
    "dynamic": "Returns of a strip along the path of the vehicle are averaged in cells. Each mean "
    "is compared with the mean machined height at the places of the same returns, after a robust "
    "fit of offset, tilt and shift along the path. Body-motion rejection is the spectral density "
    "of the height of the laser over that of the error.",
    "drift": "Heights of repeated runs along one path are compared at equal distances with a "
    "reference or, without one, with their mean. Differences between runs are repeatability; the "
    "error common to all runs is bias, which only a reference determines.",
}
_FOUND = (
    "Faults that this test looks for; values of clocks, lever arms and angles are to be added to "
    "those of the run. A fault is found if it exceeds four times its sd and is large enough to "
    "matter."
)
_CAUSES = {
    "noise": "noise of the mean",
    "bias": "bias",
    "shape": "neither noise nor bias",
    "edge": "at edges",
    "reflectivity": "flagged intensity",
}


def write_certificate(found: CertificateResult, folder: str | Path) -> list[str]:
    """Write the certificate of a test, its numbers and its errors into a folder.

    Parameters
    ----------
    found : CertificateResult
        Results and inputs, from `certify_profiler`.
    folder : str or Path
        Existing folder.

    Returns
    -------
    list of str
        Names of the files: certificate.html, certificate.pdf, result.json, and the tables of
        errors as CSV.

    Raises
    ------
    OutputError
        If a file exists, or the folder does not.

    Examples
    --------
    >>> from trueterrain.verify.certificate import certify_profiler
    >>> found = certify_profiler("static", "static.toml")  # doctest: +SKIP
    >>> write_certificate(found, "certified")  # doctest: +SKIP
    ['certificate.html', 'certificate.pdf', 'result.json', 'errors-static.csv']
    """
    folder = Path(folder)
    files = write_error_tables(found, folder)
    write_json_file(found.to_dict(), folder / "result.json")
    files.append(("result.json", "all figures, settings and hashes of the inputs"))
    certificate = build_certificate(found, files)
    write_report(certificate, folder / "certificate.html")
    write_report_pdf(certificate, folder / "certificate.pdf")
    return ["certificate.html", "certificate.pdf", "result.json", *(name for name, _ in files[:-1])]


def build_certificate(found: CertificateResult, files: list[tuple[str, str]]) -> Report:
    """Build the certificate of a test, as HTML and PDF show it.

    Parameters
    ----------
    found : CertificateResult
        Results and inputs.
    files : list of tuple of str
        Names and contents of the files next to the certificate.

    Returns
    -------
    Report
        Argument of `write_report` and `write_report_pdf`.
    """
    import matplotlib.pyplot as plt

    test = found.test
    kind = test.kind
    sections = [_stated_section(found, kind), _figure_section(found)]
    sections += [_result_section(name, result) for name, result in found.results.items()]
    if found.instruments:
        sections.append(_instrument_section(found))
    sections.append(_input_section(found, files))
    report = Report(
        title=test.title or f"Accuracy of a profiler: {kind} test",
        subtitle=", ".join(text for text in (test.system, test.date) if text),
        headline=tuple(_headline_numbers(found)),
        sections=tuple(sections),
    )
    plt.close("all")  # the report keeps the figures; pyplot need not
    return report


def _headline_numbers(found: CertificateResult) -> Iterator[Number]:
    for name, result in found.results.items():
        kept = found.verdicts[name].get("rms")
        limit = found.test.limits.rms
        figure = result.row.rms
        least = "" if figure.trusted else "at least "
        interval = f"{least}{_MILLI * figure.low:.3f} to {_MILLI * figure.high:.3f} mm"
        yield Number(
            label=f"RMS, {name}",
            value=_MILLI * figure.value,
            unit="mm",
            digits=_DIGITS,
            verdict=None if kept is None else ("good" if kept else "bad"),
            note=interval if limit is None else f"{interval}; limit {_MILLI * limit:g} mm",
        )
    if found.passed is not None:
        yield Number(
            label="All limits",
            value="kept" if found.passed else "not kept",
            verdict="good" if found.passed else "bad",
        )


def _stated_section(found: CertificateResult, kind: str) -> Section:
    test = found.test
    rows: list[list[str | None]] = [
        ["System", test.system or None],
        ["Conditions", test.conditions or None],
        ["Date", test.date or None],
        ["Test", kind],
    ]
    table = Table(columns=(Column(label="Stated"), Column(label="As given")), rows=rows)
    times = Table(
        columns=(
            Column(label="Recorded"),
            Column(label="From"),
            Column(label="To"),
            Column(label="Time scale"),
        ),
        rows=[[one.name, one.begin, one.end, one.scale] for one in found.recorded],
        caption="Recording times, from the data.",
    )
    blocks: list[Block] = [table, times]
    if found.flags:
        blocks.append(Warnings(items=found.flags))
    return Section(title="What was tested", blocks=[*blocks, Text(paragraph=_METHODS[kind])])


def _instrument_section(found: CertificateResult) -> Section:
    """Section on errors of clocks and mounting."""
    text = (
        "Corrections to the clocks and the mounting of the scanner that the runs state. They are "
        "not applied: the figures are those of the runs as recorded."
    )
    blocks = findings_blocks(
        found.instruments,
        caption="Estimated less stated values; a value above four times its sd is significant.",
    )
    return Section(title="Clocks and mounting", text=text, blocks=blocks)


def _figure_section(found: CertificateResult) -> Section:
    columns = ("RMS", "Off edges", "Distance", "Maximum", "Bias", "Noise", "Registration")
    rows: list[list[str | float | None]] = []
    for name, result in found.results.items():
        row, known = result.row, _with_intervals(result)
        lengths = {key: one.value for key, one in known.items()}
        order = (
            lengths["RMS"],
            lengths.get("off edges"),
            lengths.get("distance"),
            row.maximum,
            lengths["bias"],
            row.noise,
            row.registration,
        )
        rows.append([name, *(_to_millimetres(value) for value in order), row.count])
    table = Table(
        columns=(
            Column(label="Test"),
            *(Column(label=label, unit="mm", digits=_DIGITS) for label in columns),
            Column(label="n", digits=0),
        ),
        rows=rows,
        caption="Off edges: RMS without errors at steep faces. "
        "Distance: RMS of the shortest distance from the machined line.",
    )
    return Section(title="Figures", blocks=[table, *_interval_notes(found), *_limit_blocks(found)])


def _with_intervals(result: Result) -> dict[str, AccuracyFigure]:
    """Figures of a test that have an interval."""
    row = result.row
    row_figures = {
        "RMS": row.rms,
        "off edges": row.off_edges,
        "distance": row.distance,
        "bias": row.bias,
    }
    return {key: one for key, one in row_figures.items() if one is not None}


def _interval_notes(found: CertificateResult) -> Iterator[Block]:
    known = {name: _with_intervals(result) for name, result in found.results.items()}
    confidence = next(iter(found.results.values())).row.rms.confidence
    yield Table(
        columns=(
            Column(label="Test"),
            Column(label="Figure"),
            *(Column(label=one, unit="mm", digits=_DIGITS) for one in ("Value", "From", "To")),
            Column(label="Independent errors", digits=0),
        ),
        rows=[
            [
                name,
                key,
                _to_millimetres(one.value),
                _to_millimetres(one.low),
                _to_millimetres(one.high),
                one.independent,
            ]
            for name, by_key in known.items()
            for key, one in by_key.items()
        ],
        caption=f"Intervals that hold the true value in {100 * confidence:g} % of repeats "
        "(the widest of block bootstrap, correlation, and power by wavelength).",
    )
    few = {
        name: {key: one for key, one in by_key.items() if not one.trusted}
        for name, by_key in known.items()
    }
    flags = [
        f"{name}, {', '.join(by_key)}: of no more than "
        f"{max(one.independent for one in by_key.values()):.0f} independent errors: the interval "
        "is a lower bound. Repeat or lengthen the test; at edges, where single returns dominate, "
        "judge by the other figures."
        for name, by_key in few.items()
        if by_key
    ]
    if flags:
        yield Warnings(items=flags)


def _limit_blocks(found: CertificateResult) -> Iterator[Block]:
    kept = [
        (name, figure, one) for name, row in found.verdicts.items() for figure, one in row.items()
    ]
    if not kept:
        return
    cautious = "upper ends of the intervals; intervals of few independent errors fail"
    yield Table(
        columns=(
            Column(label="Test"),
            Column(label="Figure"),
            Column(label="Limit", unit="mm"),
        ),
        rows=[
            [name, figure.replace("_", " "), _to_millimetres(getattr(found.test.limits, figure))]
            for name, figure, _ in kept
        ],
        verdicts=["good" if one else "bad" for *_, one in kept],
        caption=f"Limits, compared with the {cautious if found.test.cautious else 'figures'}.",
    )


def _result_section(name: str, result: Result) -> Section:
    if isinstance(result, DriftResult):
        blocks: list[Block] = [
            _axes_picture(
                figures.drift_errors(result.errors), "Errors of the runs against distance."
            ),
            _axes_picture(figures.drift_growth(result.growth), "Change of errors over a distance."),
            _drift_table(result),
        ]
        return Section(title=name[:1].upper() + name[1:], blocks=blocks)
    caption = f"Greatest error {_MILLI * result.row.maximum:.3f} mm."
    blocks = [
        _axes_picture(figures.plate_profile(result.errors), "Measured and machined profile."),
        _axes_picture(figures.plate_error(result.errors), caption),
        _registration_table(result.registration),
        _error_parts_table(result.parts),
    ]
    if isinstance(result, DynamicResult):
        rejection = figures.motion_rejection(result.rejection)
        blocks.append(_axes_picture(rejection, f"Body-motion rejection at {result.speed:.2f} m/s."))
        blocks.append(modes_table(result))
    blocks += findings_blocks(result.findings, caption=_FOUND)
    return Section(title=name[:1].upper() + name[1:], blocks=blocks)


def _axes_picture(ax: Any, caption: str) -> Picture:
    return Picture(figure=ax, alt=f"{ax.get_ylabel()} over {ax.get_xlabel()}", caption=caption)


def _registration_table(found: Any) -> Table:
    rows = [
        ["Start of the plate in the measured profile", _to_millimetres(found.shift), "mm"],
        ["Offset", _to_millimetres(found.offset), "mm"],
        ["Tilt", _MILLI * found.tilt, "mrad"],
        ["Residual without outliers", _to_millimetres(found.residual), "mm"],
        [
            "Residual at the assumed place, before the shift",
            _to_millimetres(found.unregistered),
            "mm",
        ],
    ]
    if found.stretch:
        rows.append(["Excess of the measured length", _MILLI * found.stretch, "mm/m"])
    return Table(
        columns=(
            Column(label="Registration"),
            Column(label="Found", digits=_DIGITS),
            Column(label="Unit"),
        ),
        rows=rows,
        caption="Place of the plate, which registration removes from the heights. "
        f"{found.outliers} of {found.points} points are outliers of this fit.",
    )


def _error_parts_table(parts: dict[str, float]) -> Table:
    total = sum(parts.values())
    return Table(
        columns=(
            Column(label="Part of the error"),
            Column(label="Root", unit="mm", digits=_DIGITS),
            Column(label="Fraction of the mean square", unit="%", digits=1),
        ),
        rows=[
            [_CAUSES[name], _MILLI * value**0.5, 100 * value / total if total else None]
            for name, value in parts.items()
        ],
        caption="Error by cause; mean squares add up to that of all errors.",
    )


def _drift_table(result: Any) -> Table:
    def cells(name: str, figure: AccuracyFigure | None) -> list[str | float | None]:
        if figure is None:
            return [name, None, None, None]
        return [
            name,
            *(_to_millimetres(value) for value in (figure.value, figure.low, figure.high)),
        ]

    return Table(
        columns=(
            Column(label="Part of the error"),
            *(Column(label=one, unit="mm", digits=_DIGITS) for one in ("Figure", "from", "to")),
        ),
        rows=[
            cells("Repeatability of a single run", result.repeatability),
            cells("Bias common to all runs", result.shared),
        ],
        caption=f"{result.runs} runs; bias is known against a reference only.",
    )


def _input_section(found: CertificateResult, files: list[tuple[str, str]]) -> Section:
    table = Table(
        columns=(Column(label="Input"), Column(label="SHA-256")),
        rows=[[one["name"], one["sha256"]] for one in found.inputs],
        caption="The hash of a folder is that of the names and contents of its files, in order.",
    )
    text = (
        f"Made with trueterrain {__version__}. Every figure follows from the files below; "
        "trueterrain verify reproduces them from the inputs with these hashes."
    )
    listed = Files(files=[File(path=name, note=note) for name, note in files])
    return Section(title="Inputs and files", text=text, blocks=[table, listed])


def _to_millimetres(value: float | None) -> float | None:
    return None if value is None else _MILLI * value
