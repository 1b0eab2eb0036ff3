"""The command ``trueterrain verify``: accuracy tests of a profiler, and their certificate."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from trueterrain.cli._console import write_json, write_line, write_note
from trueterrain.cli._profiles import write_table

if TYPE_CHECKING:
    from trueterrain.verify.certificate import CertificateResult

_MILLI = 1e3
_RESULT, _NAMES = "verify", ("certificate.html", "certificate.pdf", "result.json")


def verify(
    test: Annotated[Literal["static", "dynamic", "drift", "table"], Parameter(show_choices=False)],
    config: Path | None = None,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    json: Annotated[bool, Parameter(negative="")] = False,
    force: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Measure the accuracy of a profiler, and write a certificate.

    static compares the mean of many scans of a calibration plate with its machined profile, dynamic
    a profile over the plate from a moving vehicle, drift repeated runs along one path. Offset, tilt
    and shift of the plate are estimated first and reported separately. Each figure has a confidence
    interval, and is compared with the limits in the file.

    Example: `trueterrain verify static static.toml -o certified`

    Parameters
    ----------
    test
        Test: "static", "dynamic" or "drift".
    config
        Settings of the test, a .toml file: runs, machined profile, limits, statements of the
        certificate; `trueterrain init static`, and so on, print one.
    output
        Folder for certificate.html, certificate.pdf, result.json, and the errors as CSV.
    json
        Print result.json instead of a table: {"version", "settings", "inputs": [{"name",
        "sha256"}], "rows": [{"test", "rms", "off_edges", "distance", "maximum", "bias", "noise",
        "registration", "count", "verdicts", "findings", "modes", "source", ...}], "recorded",
        "flags", "instruments": [{"name", "value", "sd", "unit", "detected", "meaning"}],
        "passed"}, lengths in m; rms, off_edges, distance and bias are {"value", "low", "high",
        "confidence", "independent", "trusted"}, findings have the keys of instruments. "passed" is
        null without limits.
    force
        Replace an earlier result of the same command in the folder; other files in it stay.
    """
    if test == "table":  # of earlier versions
        message = (
            "verify table is now the study `make study-table`; its page in the documentation is "
            "'Table 3-1 of the thesis, reproduced'."
        )
        raise ValueError(message)
    if config is None:
        message = f"name the settings of the {test} test: verify {test} CONFIG."
        raise ValueError(message)
    from trueterrain.core import whole_folder
    from trueterrain.report.certificate import write_certificate
    from trueterrain.verify.certificate import certify_profiler, input_files

    with whole_folder(
        output, result=_RESULT, force=force, inputs=input_files(test, config), names=_NAMES
    ) as folder:
        found = certify_profiler(test, config)
        write_certificate(found, folder)
    if json:
        write_json(found.to_dict())
        return
    for row in _result_rows(found):
        write_line(row)
    for flag in found.flags:
        write_note(f"trueterrain: warning: {flag}")
    write_note(f"{output / 'certificate.html'}: the certificate; certificate.pdf is for printing")


def _result_rows(found: "CertificateResult") -> Iterator[str]:
    """Print a table like Table 3-1; yield verdicts and findings."""
    from trueterrain.report.findings import finding_text
    from trueterrain.verify.statistics.uncertainty import TRUSTED_COUNT

    header = [
        "test",
        "RMS [mm]",
        "off edges",
        "distance",
        "maximum",
        "bias",
        "noise",
        "registration",
        "n",
    ]
    rows = [header]
    for name, result in found.results.items():
        row = result.row
        rows.append(
            [
                name,
                _with_interval(row.rms),
                _with_interval(row.off_edges),
                _with_interval(row.distance),
                _format_millimetres(row.maximum),
                _with_interval(row.bias),
                _format_millimetres(row.noise),
                _format_millimetres(row.registration),
                str(row.count),
            ]
        )
    write_table(rows)
    if any(cell.endswith("*") for row in rows for cell in row):
        few = f"fewer than {TRUSTED_COUNT:g} independent errors"
        yield f"* {few}: the interval is at least this wide."
    for name, verdicts in found.verdicts.items():
        for figure, kept in verdicts.items():
            limit = _MILLI * getattr(found.test.limits, figure)
            verdict = "passed" if kept else "FAILED"
            yield f"{name}: {figure} {verdict}, limit {limit:g} mm"
    for name, result in found.results.items():
        if source := getattr(result, "source", None):
            yield f"{name}: {source}"
        faults = getattr(result, "findings", ())
        yield from (f"{name}: {finding_text(one)}" for one in faults if one.detected)
    yield from (finding_text(one) for one in found.instruments if one.detected is not False)
    if found.passed is None:
        yield "No limits were given: no verdict."


def _format_millimetres(value: float | None) -> str:
    return "-" if value is None else f"{_MILLI * value:.3f}"


def _with_interval(figure: Any) -> str:
    if figure is None:
        return "-"
    mark = "" if figure.trusted else "*"
    value, low, high = map(_format_millimetres, (figure.value, figure.low, figure.high))
    return f"{value} ({low} to {high}){mark}"
