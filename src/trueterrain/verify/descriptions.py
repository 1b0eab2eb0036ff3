"""Descriptions of accuracy tests, as TOML files hold them."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import ClassVar, get_args

from trueterrain.formats.settings import settings_template
from trueterrain.motion import FusionSettings
from trueterrain.motion.settings import Method
from trueterrain.verify.drift import DriftSettings
from trueterrain.verify.dynamic import DynamicSettings
from trueterrain.verify.results import AccuracyLimits
from trueterrain.verify.static import StaticSettings

_PLATE = "plate.csv"


@dataclass(frozen=True, kw_only=True)
class AccuracyTest:
    """Description of a test: statements for the certificate, limits, calibration runs."""

    kind: ClassVar[str]
    "Name of the test."

    title: str = ""
    "Title of the certificate."

    system: str = ""
    "System under test: vehicle, scanner, navigation, their serial numbers."

    conditions: str = ""
    "Conditions of the test: place, weather, speed, crew."

    date: str = ""
    "Date of the recording; written as 2026-03-12 it is compared with the times of the runs."

    cautious: bool = False
    """Compare the upper ends of intervals with the limits, not the figures themselves. An
    interval of too few independent errors fails every limit: over a plate, limit off_edges."""

    limits: AccuracyLimits = field(default_factory=AccuracyLimits)
    "Upper limits of the figures; without limits there is no verdict."

    clock: str | None = None
    "Run of a bounce, parked on a flat floor and rocked by hand, to check the clocks."

    boresight: tuple[str, ...] = ()
    "Runs in both directions over the same ground, to check the mounting of the scanner."

    def __post_init__(self) -> None:
        """Check the runs of the instruments."""
        if len(self.boresight) == 1:
            message = f"boresight must name two runs or more, got {self.boresight[0]!r} alone."
            raise ValueError(message)


@dataclass(frozen=True, kw_only=True)
class StaticTest(AccuracyTest):
    """A static test: a scanner at rest above a calibration plate."""

    kind: ClassVar[str] = "static"

    run: str
    "Run of the scanner at rest, NAME.zarr; relative to the folder of this file."

    machined: str
    "Machined profile of the plate: CSV, ERD or Parquet."

    test: StaticSettings = field(default_factory=StaticSettings)
    "Settings of the evaluation."


@dataclass(frozen=True, kw_only=True)
class DynamicTest(AccuracyTest):
    """A dynamic test: runs over a calibration plate."""

    kind: ClassVar[str] = "dynamic"

    runs: dict[str, str]
    "Runs over the plate by name, NAME.zarr each; relative to the folder of this file."

    machined: str
    "Machined profile of the plate: CSV, ERD or Parquet."

    methods: tuple[str, ...] = ("rts",)
    "Methods of fusion, each evaluated: navigation, thesis, zero-phase, wiener, rts."

    fusion: FusionSettings = field(default_factory=FusionSettings)
    "Settings of the fusion; its method is taken from methods."

    test: DynamicSettings = field(default_factory=DynamicSettings)
    "Settings of the evaluation."

    def __post_init__(self) -> None:
        """Check that there is something to test, and the methods."""
        super().__post_init__()
        if not self.runs or not self.methods:
            message = "runs and methods must each hold at least one."
            raise ValueError(message)
        for method in self.methods:
            method_settings(method)


@dataclass(frozen=True, kw_only=True)
class DriftTest(AccuracyTest):
    """A drift test: repeated runs along one path."""

    kind: ClassVar[str] = "drift"

    profiles: tuple[str, ...]
    "Profiles of repeated runs, one file each; relative to the folder of this file."

    reference: str | None = None
    "Profile of the true heights; by default runs are compared with each other."

    track: str | None = None
    "Track, if the profiles have several."

    test: DriftSettings = field(default_factory=DriftSettings)
    "Settings of the evaluation."


#: Descriptions by the name of the test.
KINDS: dict[str, type[AccuracyTest]] = {
    "static": StaticTest,
    "dynamic": DynamicTest,
    "drift": DriftTest,
}


def method_settings(method: str, fusion: FusionSettings = FusionSettings()) -> FusionSettings:
    """Fusion settings with another method.

    Parameters
    ----------
    method : str
        Name of the method.
    fusion : FusionSettings
        All other settings.

    Returns
    -------
    FusionSettings
        Settings with that method.

    Raises
    ------
    ValueError
        If the method is unknown.

    Examples
    --------
    >>> method_settings("thesis", FusionSettings(crossover=8.0)).crossover
    8.0
    """
    for known in get_args(Method):
        if method == known:
            return replace(fusion, method=known)
    message = f"methods must be some of {', '.join(get_args(Method))}, got {method!r}."
    raise ValueError(message)


def description_template(kind: str, files: Sequence[str | Path] = ()) -> str:
    """Complete TOML text that describes a test, with a comment for each setting.

    Parameters
    ----------
    kind : str
        static, dynamic or drift.
    files : sequence of str or Path
        The run of a static test, the runs of a dynamic one, the profiles of a drift test; by
        default names to be replaced.

    Returns
    -------
    str
        TOML for `certify_profiler`.

    Raises
    ------
    ValueError
        If the kind is unknown, or there are too many or too few files, or two of one name.
    FileNotFoundError
        If there is no such file.

    Examples
    --------
    >>> print(description_template("static").partition("[limits]")[0])
    # A static test: a scanner at rest above a calibration plate.
    ...
    run = "run.zarr"
    ...
    machined = "plate.csv"
    ...
    """
    if kind not in KINDS:
        message = f"kind must be one of {', '.join(KINDS)}, got {kind!r}."
        raise ValueError(message)
    for file in files:
        if not Path(file).exists():
            message = f"there is no {'profile' if kind == 'drift' else 'run'} {file}"
            raise FileNotFoundError(message)
    names = [str(file) for file in files]
    test: AccuracyTest
    if kind == "static":
        if len(names) > 1:
            message = f"a static test is of one run, got {', '.join(names)}."
            raise ValueError(message)
        test = StaticTest(run=(names or ["run.zarr"])[0], machined=_PLATE)
    elif kind == "dynamic":
        runs = {Path(name).stem: name for name in names or ["run.zarr"]}
        if len(runs) < len(names):
            message = f"runs must have names that differ, got {', '.join(names)}."
            raise ValueError(message)
        test = DynamicTest(runs=runs, machined=_PLATE)
    else:
        if len(names) == 1:
            message = f"a drift test is of two profiles or more, got {names[0]} alone."
            raise ValueError(message)
        test = DriftTest(profiles=tuple(names or ["run1.csv", "run2.csv"]))
    return settings_template(test)
