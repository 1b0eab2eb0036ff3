"""Certification of a profiler: carry out a described test, with all that reproduces its results."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from trueterrain import formats
from trueterrain._version import __version__
from trueterrain.core.errors import SchemaError, name_file_in_errors
from trueterrain.core.json_values import json_values
from trueterrain.core.provenance import describe_input
from trueterrain.core.schemas import kind_of
from trueterrain.formats.run import open_run
from trueterrain.formats.settings import read_settings
from trueterrain.motion import FusionSettings, Trajectory, fuse_motion
from trueterrain.verify.descriptions import (
    KINDS,
    AccuracyTest,
    DriftTest,
    DynamicTest,
    StaticTest,
    description_template,
    method_settings,
)
from trueterrain.verify.drift import DriftResult, drift_test
from trueterrain.verify.dynamic import DynamicResult, dynamic_test
from trueterrain.verify.findings.finding import Finding
from trueterrain.verify.instruments import boresight_findings, clock_findings
from trueterrain.verify.recorded import (
    RecordingTime,
    date_contradictions,
    recorded_run,
    recording_time,
)
from trueterrain.verify.registration.search import check_machined_profile
from trueterrain.verify.static import StaticResult, static_test

__all__ = [
    "AccuracyTest",
    "CertificateResult",
    "DriftTest",
    "DynamicTest",
    "Result",
    "StaticTest",
    "certify_profiler",
    "description_template",
    "input_files",
    "method_settings",
    "write_error_tables",
]

Result = StaticResult | DynamicResult | DriftResult


@dataclass(frozen=True, kw_only=True, eq=False)
class CertificateResult:
    """Results of a described test, with its inputs."""

    test: AccuracyTest
    "Description of the test."

    results: dict[str, Result]
    "Results by name of the row."

    inputs: tuple[dict[str, str], ...]
    "Name and SHA-256 of every input file."

    instruments: tuple[Finding, ...] = ()
    "Findings on clocks and mounting, if runs for them are given."

    recorded: tuple[RecordingTime, ...] = ()
    "Recording time of each file, as far as it is in the data."

    @property
    def flags(self) -> list[str]:
        """Contradictions between the description and the data."""
        return date_contradictions(self.test.date, self.recorded)

    @property
    def verdicts(self) -> dict[str, dict[str, bool]]:
        """Whether figures are within their limits, by row and name of the figure."""
        limits, cautious = self.test.limits, self.test.cautious
        return {
            name: found.row.verdicts(limits, cautious=cautious)
            for name, found in self.results.items()
        }

    @property
    def passed(self) -> bool | None:
        """Whether all figures are within their limits; None without limits."""
        kept = [one for row in self.verdicts.values() for one in row.values()]
        return all(kept) if kept else None

    def to_dict(self) -> dict[str, Any]:
        """Numbers and strings, ready for JSON; lengths in m, None where unlimited."""
        document: dict[str, Any] = {
            "version": __version__,
            "settings": asdict(self.test),
            "inputs": list(self.inputs),
            "recorded": [one.to_dict() for one in self.recorded],
            "flags": self.flags,
            "rows": [
                {**result.to_dict(), "test": name, "verdicts": self.verdicts[name]}
                for name, result in self.results.items()
            ],
            "instruments": [one.to_dict() for one in self.instruments],
            "passed": self.passed,
        }
        described: dict[str, Any] = json_values(document)
        return described


def certify_profiler(kind: str, config: str | Path) -> CertificateResult:
    """Carry out the test that a TOML file describes.

    Parameters
    ----------
    kind : str
        static, dynamic or drift.
    config : str or Path
        Description of the test, a TOML file.

    Returns
    -------
    CertificateResult
        Results, and hashes of the description and the inputs.

    Raises
    ------
    ValueError
        If the kind is unknown.
    FormatError
        If the description is damaged or breaks a rule.
    SchemaError
        If an input is of the wrong kind, or the machined profile in another unit.
    CoverageError
        If the data do not suffice for the test.
    """
    config = Path(config)
    test = _read_description(kind, config)
    folder = config.parent
    clock = None if test.clock is None else folder / test.clock
    boresight = [folder / path for path in test.boresight]
    runs: dict[str, Path] = {}
    profiles: list[Path] = []
    if isinstance(test, StaticTest):
        runs, others = {"static": folder / test.run}, [folder / test.machined]
    elif isinstance(test, DynamicTest):
        runs = {name: folder / path for name, path in test.runs.items()}
        others = [folder / test.machined]
    else:
        assert isinstance(test, DriftTest)
        profiles = [folder / path for path in test.profiles]
        others = [*profiles, *([] if test.reference is None else [folder / test.reference])]
    driven = dict.fromkeys([*runs.values(), *([] if clock is None else [clock]), *boresight])
    times = [recording_time(path.name, {}) for path in profiles] + [
        recorded_run(run) for run in driven
    ]
    if isinstance(test, StaticTest):
        results = _static_results(test, runs["static"], _machined_profile(others[0]))
    elif isinstance(test, DynamicTest):
        results = _dynamic_results(test, runs, _machined_profile(others[0]))
    else:
        results = _drift_results(test, profiles, next(iter(others[len(profiles) :]), None))
    files = dict.fromkeys([config, *runs.values(), *others, *driven])
    return CertificateResult(
        test=test,
        results=results,
        inputs=tuple(describe_input(path) for path in files),
        instruments=tuple(_instrument_findings(test, clock, boresight)),
        recorded=tuple(times),
    )


def input_files(kind: str, config: str | Path) -> list[Path]:
    """Files and runs that a test reads, including its description.

    Parameters
    ----------
    kind : str
        static, dynamic or drift.
    config : str or Path
        Description of the test, a TOML file.

    Returns
    -------
    list of Path
        Paths, whether they exist or not.

    Raises
    ------
    ValueError
        If the kind is unknown.
    FormatError
        If the description is damaged or breaks a rule.
    """
    config = Path(config)
    test = _read_description(kind, config)
    names = [test.clock, *test.boresight]
    if isinstance(test, StaticTest):
        names += [test.run, test.machined]
    elif isinstance(test, DynamicTest):
        names += [*test.runs.values(), test.machined]
    elif isinstance(test, DriftTest):
        names += [*test.profiles, test.reference]
    return [config, *(config.parent / name for name in names if name is not None)]


def write_error_tables(found: CertificateResult, folder: Path) -> list[tuple[str, str]]:
    """Write the single errors as CSV, so that every figure can be recomputed.

    Parameters
    ----------
    found : CertificateResult
        Results of the test.
    folder : Path
        Folder of the files.

    Returns
    -------
    list of tuple of str
        Names and contents of the files.
    """
    files = []
    for name, result in found.results.items():
        slug = "-".join(name.replace(",", " ").split())
        files.append((f"errors-{slug}.csv", f"errors of {name} at each place"))
        _write_table(result.errors, "s", folder / files[-1][0])
        if not isinstance(result, DriftResult):
            files.append((f"registration-{slug}.csv", f"registration of the plate in {name}"))
            _write_table(result.registered, "along", folder / files[-1][0])
        if isinstance(result, DynamicResult):
            files.append((f"rejection-{slug}.csv", f"body-motion rejection of {name}"))
            _write_table(result.rejection, "frequency", folder / files[-1][0])
        elif isinstance(result, DriftResult):
            files.append((f"growth-{slug}.csv", f"growth of the errors of {name}"))
            _write_table(result.growth, "distance", folder / files[-1][0])
    return files


def _read_description(kind: str, config: Path) -> AccuracyTest:
    if kind not in KINDS:
        message = f"kind must be one of {', '.join(KINDS)}, got {kind!r}."
        raise ValueError(message)
    return read_settings(KINDS[kind], config)


def _static_results(test: StaticTest, run: Path, machined: xr.Dataset) -> dict[str, Result]:
    return {found.row.test: found for found in static_test(run, machined, test.test)}


def _instrument_findings(
    test: AccuracyTest, clock: Path | None, boresight: list[Path]
) -> list[Finding]:
    """Findings on clocks and mounting from calibration runs."""
    fusion = test.fusion if isinstance(test, DynamicTest) else FusionSettings()
    found: list[Finding] = []
    if clock is not None:
        with name_file_in_errors(clock):
            delay = fusion.accelerometer_delay
            found += clock_findings(open_run(clock), accelerometer_delay=delay)
    if boresight:
        motion = [_fused_trajectory(path, fusion) for path in boresight]
        found += boresight_findings(boresight, motion)
    return found


def _fused_trajectory(path: Path, fusion: FusionSettings) -> Trajectory:
    with name_file_in_errors(path), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # `trueterrain info` reports them
        return fuse_motion(open_run(path), settings=fusion).trajectory


def _dynamic_results(
    test: DynamicTest, runs: Mapping[str, Path], machined: xr.Dataset
) -> dict[str, Result]:
    found: dict[str, Result] = {}
    for name, path in runs.items():
        for method in test.methods:
            trajectory = _fused_trajectory(path, method_settings(method, test.fusion))
            row = f"{name}, {method}"
            found[row] = dynamic_test(path, machined, trajectory, test.test, name=row)
    return found


def _drift_results(
    test: DriftTest,
    files: Sequence[Path],
    reference: Path | None,
) -> dict[str, Result]:
    def track(path: Path) -> xr.Dataset:
        profile = _open_profile(path)
        if "track" not in profile.dims:
            return profile
        names = [str(name) for name in profile["track"].values]
        if test.track is None and len(names) == 1:
            return profile.isel(track=0, drop=True)
        if test.track not in names:
            raise SchemaError(
                f"holds the tracks {', '.join(names)}",
                path=path,
                cure="Name one of them: track.",
            )
        return profile.sel(track=test.track, drop=True)

    true = None if reference is None else track(reference)
    return {"drift": drift_test([track(path) for path in files], true, test.test)}


def _machined_profile(path: Path) -> xr.Dataset:
    profile = _open_profile(path)
    if profile.sizes.get("track") == 1:
        profile = profile.isel(track=0, drop=True)
    check_machined_profile(profile, path=path)
    return profile


def _open_profile(path: Path) -> xr.Dataset:
    found = formats.open(path)
    if kind_of(found) != "profile":
        raise SchemaError(f"must be a profile, but holds {kind_of(found)}", path=path)
    return found


def _write_table(data: xr.Dataset, along: str, path: Path) -> None:
    """Write the columns of a dataset as CSV; a variable of several rows gives as many columns."""
    columns = {along: data[along].values}
    for name in data.data_vars:
        values = data[name].values
        rows = values if values.ndim == 2 else [values]
        for number, row in enumerate(rows):
            label = f"{name}_{number}" if values.ndim == 2 else str(name)
            columns[label] = row.astype(int) if row.dtype == bool else row
    lines = [",".join(columns)]
    lines += [
        ",".join(repr(value) for value in row)
        for row in zip(*(np.asarray(values).tolist() for values in columns.values()), strict=True)
    ]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")
