"""Tests as files describe them: what a certificate states, and all that it is recomputed from."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import xarray as xr

from trueterrain._version import __version__
from trueterrain.errors import SchemaError, concerning
from trueterrain.formats.settings import read_settings
from trueterrain.motion import FusionSettings
from trueterrain.provenance import describe_input
from trueterrain.verify._errors import Limits
from trueterrain.verify.drift import DriftResult, DriftSettings, drift_test
from trueterrain.verify.dynamic import DynamicResult, DynamicSettings, dynamic_test
from trueterrain.verify.registration import check_machined
from trueterrain.verify.static import StaticResult, StaticSettings, static_test

Result = StaticResult | DynamicResult | DriftResult


@dataclass(frozen=True, kw_only=True)
class Stated:
    """What a certificate states of a test."""

    title: str = ""
    "Title of the certificate."

    system: str = ""
    "What was tested: vehicle, scanner, navigation, their numbers."

    conditions: str = ""
    "Under which conditions: place, weather, speed, crew."

    date: str = ""
    "When it was recorded."

    cautious: bool = False
    "Ask the upper ends of intervals to keep the limits, not the figures themselves."

    limits: Limits = field(default_factory=Limits)
    "What figures may be at most; without limits nothing is passed or failed."


@dataclass(frozen=True, kw_only=True)
class StaticTest(Stated):
    """A static test: a scanner that stands above a calibration plate."""

    kind: ClassVar[str] = "static"

    run: str
    "Run of the standing scanner, NAME.zarr; from the folder of this file."

    machined: str
    "Machined profile of the plate: CSV, ERD or Parquet."

    test: StaticSettings = field(default_factory=StaticSettings)
    "How it is evaluated."


@dataclass(frozen=True, kw_only=True)
class DynamicTest(Stated):
    """A dynamic test: runs over a calibration plate."""

    kind: ClassVar[str] = "dynamic"

    runs: dict[str, str]
    "Runs over the plate by name, NAME.zarr each; from the folder of this file."

    machined: str
    "Machined profile of the plate: CSV, ERD or Parquet."

    methods: tuple[str, ...] = ("rts",)
    "How motion is found, one after the other: navigation, thesis, zero-phase, wiener, rts."

    test: DynamicSettings = field(default_factory=DynamicSettings)
    "How it is evaluated."

    def __post_init__(self) -> None:
        """Check that there is something to test, and the methods."""
        if not self.runs or not self.methods:
            message = "runs and methods must each hold at least one."
            raise ValueError(message)
        for method in self.methods:
            fusion_of(method)


@dataclass(frozen=True, kw_only=True)
class DriftTest(Stated):
    """A drift test: repeated runs along one path."""

    kind: ClassVar[str] = "drift"

    profiles: tuple[str, ...]
    "Profiles of repeated runs, a file each; from the folder of this file."

    reference: str | None = None
    "Profile of the true heights; by default runs are compared with each other."

    track: str | None = None
    "Track to take from profiles of several."

    test: DriftSettings = field(default_factory=DriftSettings)
    "How it is evaluated."


#: Descriptions by the name of the test.
KINDS: dict[str, type[Stated]] = {
    "static": StaticTest, "dynamic": DynamicTest, "drift": DriftTest,
}  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class Certified:
    """What tests found, and from which files."""

    test: Stated
    "Their description."

    results: dict[str, Result]
    "Results by name of the row."

    inputs: tuple[dict[str, str], ...]
    "Name and SHA-256 of every file."

    @property
    def verdicts(self) -> dict[str, dict[str, bool]]:
        """Whether figures keep their limits, by row and name of the figure."""
        limits, cautious = self.test.limits, self.test.cautious
        return {
            name: found.row.verdicts(limits, cautious=cautious)
            for name, found in self.results.items()
        }

    @property
    def passed(self) -> bool | None:
        """Whether all limits are kept; None if there are none."""
        kept = [one for row in self.verdicts.values() for one in row.values()]
        return all(kept) if kept else None

    def describe(self) -> dict[str, Any]:
        """The same as plain numbers and words, as for JSON; lengths in m, None where unlimited."""
        found = {
            "version": __version__,
            "settings": asdict(self.test),
            "inputs": list(self.inputs),
            "rows": [
                {**found.describe(), "test": name, "verdicts": self.verdicts[name]}
                for name, found in self.results.items()
            ],
            "passed": self.passed,
        }
        return {name: _plain(value) for name, value in found.items()}


def certify(kind: str, config: str | Path) -> Certified:
    """Carry out the test that a file describes.

    Parameters
    ----------
    kind : str
        static, dynamic or drift.
    config : str or Path
        Its description, a TOML file.

    Returns
    -------
    Certified
        Results, and the hashes of description and inputs.

    Raises
    ------
    ValueError
        If the kind is unknown.
    FormatError
        If the description is damaged or breaks a rule.
    SchemaError
        If an input is of the wrong kind, or the machined profile in another unit.
    CoverageError
        As by the tests.
    """
    if kind not in KINDS:
        message = f"kind must be one of {', '.join(KINDS)}, got {kind!r}."
        raise ValueError(message)
    config = Path(config)
    test = read_settings(KINDS[kind], config)
    folder = config.parent
    if isinstance(test, StaticTest):
        files = [folder / test.run, folder / test.machined]
        results = _static(test, files[0], _machined(files[1]))
    elif isinstance(test, DynamicTest):
        runs = {name: folder / path for name, path in test.runs.items()}
        machined = folder / test.machined
        files = [*runs.values(), machined]
        results = _dynamic(test, runs, _machined(machined))
    else:
        assert isinstance(test, DriftTest)
        files = [folder / path for path in test.profiles]
        reference = None if test.reference is None else folder / test.reference
        results = _drift(test, files, reference)
        files += [] if reference is None else [reference]
    inputs = tuple(describe_input(path) for path in (config, *files))
    return Certified(test=test, results=results, inputs=inputs)


def write_errors(found: Certified, folder: Path) -> list[tuple[str, str]]:
    """Write the single errors, from which every figure can be recomputed, as CSV.

    Parameters
    ----------
    found : Certified
        The results.
    folder : Path
        Where the files shall be.

    Returns
    -------
    list of tuple of str
        Names of the files and what they hold.
    """
    files = []
    for name, result in found.results.items():
        slug = "-".join(name.replace(",", " ").split())
        files.append((f"errors-{slug}.csv", f"errors of {name}, place by place"))
        _write_table(result.errors, "s", folder / files[-1][0])
        if isinstance(result, DynamicResult):
            files.append((f"rejection-{slug}.csv", f"body-motion rejection of {name}"))
            _write_table(result.rejection, "frequency", folder / files[-1][0])
        elif isinstance(result, DriftResult):
            files.append((f"growth-{slug}.csv", f"growth of the errors of {name}"))
            _write_table(result.growth, "distance", folder / files[-1][0])
    return files


def fusion_of(method: str) -> FusionSettings:
    """Settings of a method of finding motion.

    Parameters
    ----------
    method : str
        Its name.

    Returns
    -------
    FusionSettings
        Of that method.

    Raises
    ------
    ValueError
        If it is unknown.
    """
    from typing import get_args

    from trueterrain.motion.fuse import Method

    for known in get_args(Method):
        if method == known:
            return FusionSettings(method=known)
    message = f"methods must be some of {', '.join(get_args(Method))}, got {method!r}."
    raise ValueError(message)


def _plain(value: Any) -> Any:
    """Nested values for JSON, which knows neither infinity nor what is no number."""
    if isinstance(value, Mapping):
        return {str(name): _plain(one) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _static(test: StaticTest, run: Path, machined: xr.Dataset) -> dict[str, Result]:
    return {found.row.test: found for found in static_test(run, machined, test.test)}


def _dynamic(
    test: DynamicTest, runs: Mapping[str, Path], machined: xr.Dataset
) -> dict[str, Result]:
    import warnings

    from trueterrain.formats.run import open_run
    from trueterrain.motion import fuse

    found: dict[str, Result] = {}
    for name, path in runs.items():
        tree = open_run(path)
        for method in test.methods:
            with concerning(path), warnings.catch_warnings():
                warnings.simplefilter("ignore")  # `trueterrain info` tells them
                trajectory = fuse(tree, settings=fusion_of(method)).trajectory
            row = f"{name}, {method}"
            found[row] = dynamic_test(path, machined, trajectory, test.test, name=row)
    return found


def _drift(
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
                f"holds the tracks {', '.join(names)}", path=path,
                cure="Name one of them: track.",
            )  # fmt: skip
        return profile.sel(track=test.track, drop=True)

    true = None if reference is None else track(reference)
    return {"drift": drift_test([track(path) for path in files], true, test.test)}


def _machined(path: Path) -> xr.Dataset:
    profile = _open_profile(path)
    if profile.sizes.get("track") == 1:
        profile = profile.isel(track=0, drop=True)
    check_machined(profile, path=path)
    return profile


def _open_profile(path: Path) -> xr.Dataset:
    from trueterrain import formats
    from trueterrain.kinds import kind_of

    found = formats.open(path)
    if kind_of(found) != "profile":
        raise SchemaError(f"must be a profile, but holds {kind_of(found)}", path=path)
    return found


def _write_table(data: xr.Dataset, along: str, path: Path) -> None:
    """Columns of a dataset; what has several rows becomes as many columns."""
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
