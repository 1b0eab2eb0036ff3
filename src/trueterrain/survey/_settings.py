"""Settings of a survey: runs, steps, outputs."""

from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Literal, get_args

from trueterrain.alignment.merge import MergeSettings
from trueterrain.core.errors import FormatError
from trueterrain.formats.run import Mounting
from trueterrain.formats.settings import check_name, read_settings, settings_template
from trueterrain.georeference import Screening
from trueterrain.motion import FusionSettings
from trueterrain.profile import EnvelopeSettings, TyreProfileSettings
from trueterrain.roughness import IriSettings
from trueterrain.surface.grid import GridSettings
from trueterrain.surface.holes import HoleSettings
from trueterrain.surface.placement import GridPlacement

SurfaceFormat = Literal["crg", "tif", "zarr", "laz"]
ProfileFormat = Literal["erd", "csv", "parquet"]


@dataclass(frozen=True, kw_only=True)
class MountingOverride:
    """Mounting parameters that replace those of a run, e.g. after a calibration."""

    scanner_position: tuple[float, float, float] | None = None
    "Measured position of the scanner in the body frame: forward, left, up [m]."

    scanner_rotation: tuple[float, float, float] | None = None
    "Roll, pitch, yaw of the scanner in the body [rad]."

    scanner_clock: float | None = None
    "Correction of the time stamps of the scanner: true time less stamp [s]."

    def over(self, mounting: Mounting) -> Mounting:
        """Mounting of a run, with the given parameters replaced.

        Parameters
        ----------
        mounting : Mounting
            Mounting that the run states.

        Returns
        -------
        Mounting
            Mounting to use.

        Examples
        --------
        >>> MountingOverride(scanner_clock=0.002).over(Mounting()).scanner_clock
        0.002
        """
        given = {entry.name: getattr(self, entry.name) for entry in fields(self)}
        return replace(mounting, **{name: v for name, v in given.items() if v is not None})


@dataclass(frozen=True, kw_only=True)
class RunSettings:
    """A recorded run of the survey."""

    path: str
    "Store of the run, NAME.zarr; relative to the folder of this file."

    name: str | None = None
    "Name in results; by default that of the store."

    begin: float | None = None
    "Time of the navigation at which the used part begins, e.g. of a lap [s]."

    end: float | None = None
    "Time at which the used part ends [s]; a surface cannot follow a path that repeats itself."

    mounting: MountingOverride = field(default_factory=MountingOverride)
    "Mounting parameters that replace those of the run, e.g. after a calibration."


@dataclass(frozen=True, kw_only=True)
class ProfilePathSettings:
    """Path along which a profile is taken, search area and statistic."""

    name: str
    "Name of the profile."

    offset: float | None = None
    "Offset of the path from the reference line of each surface, left positive [m]."

    line: tuple[float, float, float, float] | None = None
    "Straight path instead: easting and northing of its two ends [m]."

    path: str | None = None
    "CSV file of waypoints instead, with the columns easting and northing [m]."

    spacing: float = 0.01
    "Arc length between path points [m]."

    tyre: TyreProfileSettings = field(default_factory=TyreProfileSettings)
    "Search area around each path point, and the statistic of its heights."

    envelope: EnvelopeSettings | None = field(default=None, metadata={"table": EnvelopeSettings()})
    "Tyre model that rolls over the ground instead; none by default."

    def __post_init__(self) -> None:
        """Check that there is exactly one path."""
        check_name(self.name)
        if sum(given is not None for given in (self.offset, self.line, self.path)) != 1:
            message = "name the path with exactly one of offset, line and path."
            raise ValueError(message)


@dataclass(frozen=True, kw_only=True)
class RoughnessSettings:
    """Settings of the roughness of profiles."""

    segment: float = 100.0
    "Length of the fixed segments [m]; the last one may be shorter."

    iri: IriSettings = field(default_factory=IriSettings)
    "Conventions of the International Roughness Index."

    def __post_init__(self) -> None:
        """Check the length."""
        if not 0 < self.segment < float("inf"):
            message = f"segment must be greater than 0 m, got {self.segment}."
            raise ValueError(message)


@dataclass(frozen=True, kw_only=True)
class OutputSettings:
    """Files besides report.html and result.json."""

    surface: tuple[SurfaceFormat, ...] = ("crg",)
    "Formats of the surfaces: crg, tif (maps), zarr, laz."

    profile: tuple[ProfileFormat, ...] = ("erd", "csv")
    "Formats of the profiles: erd, csv, parquet."

    points: Literal["", "laz", "zarr"] = ""
    "Format of the points of all returns; none by default, since they are many."

    pictures: bool = True
    "Whether the pictures of the report are also written as PNG files."

    def __post_init__(self) -> None:
        """Check the formats."""
        for name, known in (("surface", SurfaceFormat), ("profile", ProfileFormat)):
            unknown = [one for one in getattr(self, name) if one not in get_args(known)]
            if unknown:
                message = f"{name} must be of {', '.join(get_args(known))}, got {unknown[0]!r}."
                raise ValueError(message)


@dataclass(frozen=True, kw_only=True)
class Survey:
    """Settings of a survey: recorded runs, steps and outputs."""

    name: str = "survey"
    "Name of the survey."

    title: str = ""
    "Title of the report."

    runs: tuple[RunSettings, ...]
    "The runs."

    motion: FusionSettings = field(default_factory=FusionSettings)
    "Fusion of navigation and accelerometers."

    lanes: MergeSettings | None = field(default=None, metadata={"table": MergeSettings()})
    "Alignment and merging of the passes; by default each run becomes a surface of its own."

    screening: Screening = field(default_factory=Screening)
    "Which returns are flagged."

    grid: GridPlacement = field(default_factory=GridPlacement)
    """Nodes of the surfaces; by default along the trajectory of each run, or of the first of those
    that are merged."""

    cells: GridSettings = field(default_factory=lambda: GridSettings(range_noise=0.0005))
    "Statistic of the heights in a cell."

    holes: HoleSettings = field(default_factory=HoleSettings)
    "Which holes are filled."

    down_sample: tuple[int, int] | None = None
    "Nodes that become one, along and across, for smooth terrain; the report states the loss."

    profiles: tuple[ProfilePathSettings, ...] = ()
    "The paths along which profiles are taken."

    roughness: RoughnessSettings = field(default_factory=RoughnessSettings)
    "Roughness of the profiles."

    outputs: OutputSettings = field(default_factory=OutputSettings)
    "Files that are written."

    def __post_init__(self) -> None:
        """Check names, and that outputs and profiles fit the grid."""
        check_name(self.name)
        if not self.runs:
            message = "runs are missing: there must be at least one."
            raise ValueError(message)
        _require_different("runs", [run_name(run) for run in self.runs])
        _require_different("profiles", [profile.name for profile in self.profiles])
        if self.lanes is not None and self.lanes.fixed:
            unknown = set(self.lanes.fixed) - {run_name(run) for run in self.runs}
            if unknown:
                message = f"lanes.fixed must name runs, got {sorted(unknown)[0]!r}."
                raise ValueError(message)
        for profile in self.profiles:
            if profile.offset is not None and self.is_map:
                message = (
                    f"profile {profile.name}: offset needs a reference line, but the grid is a "
                    "map; name line or path."
                )
                raise ValueError(message)
        if "tif" in self.outputs.surface and not self.is_map:
            message = "surfaces along a line cannot be GeoTIFF; grid over a map, or write crg."
            raise ValueError(message)

    @property
    def is_map(self) -> bool:
        """Whether surfaces are maps."""
        return self.grid.as_map or self.grid.bounds is not None


def run_name(run: "RunSettings | str | Path") -> str:
    """Name of a run in results.

    Parameters
    ----------
    run : RunSettings, str or Path
        The run, or its store.

    Returns
    -------
    str
        Its own name, or that of its store without the ending.

    Examples
    --------
    >>> run_name(RunSettings(path="runs/kerb-off.zarr"))
    'kerb-off'
    """
    if isinstance(run, RunSettings):
        return run.name or run_name(run.path)
    return Path(run).name.removesuffix(".zarr")


def read_survey(path: str | Path) -> Survey:
    """Survey from a TOML file, with the paths in it made absolute.

    Parameters
    ----------
    path : str or Path
        The file, e.g. ``survey.toml``.

    Returns
    -------
    Survey
        Ready to be run.

    Raises
    ------
    FormatError
        If the file is no survey, or a run or a file of waypoints does not exist.
    """
    path = Path(path)
    survey = read_settings(Survey, path)
    folder = path.absolute().parent

    def found(name: str, place: str) -> str:
        if not (folder / name).exists():
            raise FormatError(
                f"{name} does not exist",
                path=path,
                place=place,
                cure="Name it relative to the folder of this file, or with its absolute path.",
            )
        return str(folder / name)

    runs = tuple(
        replace(run, path=found(run.path, f"runs {number}"), name=run_name(run))
        for number, run in enumerate(survey.runs, start=1)
    )
    profiles = tuple(
        replace(one, path=one.path and found(one.path, f"profile {one.name}"))
        for one in survey.profiles
    )
    grid = replace(survey.grid, path=survey.grid.path and found(survey.grid.path, "grid"))
    lanes = survey.lanes and replace(
        survey.lanes,
        path=survey.lanes.path and found(survey.lanes.path, "lanes"),
        control=survey.lanes.control and found(survey.lanes.control, "lanes"),
    )
    return replace(survey, runs=runs, profiles=profiles, grid=grid, lanes=lanes)


def survey_template(survey: Survey | None = None) -> str:
    """Complete TOML text of a survey, with a comment for each setting.

    Parameters
    ----------
    survey : Survey, optional
        By default one run with the profiles of a left and a right wheel.

    Returns
    -------
    str
        TOML that `read_survey` reads.
    """
    if survey is None:
        survey = survey_of(["run.zarr"])
    return settings_template(survey, title="A survey: from recorded runs to the ground.")


def survey_of(runs: "list[str] | list[Path]", **settings: Any) -> Survey:
    """Survey of some runs, with the profiles of a left and a right wheel.

    Parameters
    ----------
    runs : list of str or Path
        Stores of the runs.
    **settings
        Other settings of `Survey`.

    Returns
    -------
    Survey
        With wheel paths 0.75 m to either side of the reference line.

    Examples
    --------
    >>> [profile.name for profile in survey_of(["kerb-off.zarr"]).profiles]
    ['left', 'right']
    """
    wheels = (
        ProfilePathSettings(name="left", offset=0.75),
        ProfilePathSettings(name="right", offset=-0.75),
    )
    given = {"profiles": wheels, **settings}
    return Survey(runs=tuple(RunSettings(path=str(run)) for run in runs), **given)


def _require_different(what: str, names: list[str]) -> None:
    for name in names:
        check_name(name)
        if names.count(name) > 1:
            message = f"{what} must have names that differ, got {name!r} {names.count(name)} times."
            raise ValueError(message)
