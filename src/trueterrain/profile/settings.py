"""Settings of tyre profiles and envelopes by name, for settings files and the command line."""

from dataclasses import dataclass
from typing import Literal, get_args

import xarray as xr

from trueterrain.core.progress import Progress, no_progress
from trueterrain.geometry.curve import PlaneCurve
from trueterrain.profile.area import Disc, Ellipse, Rectangle, SearchArea
from trueterrain.profile.envelope import (
    Envelope,
    LineLaser,
    PatchMean,
    RadialSpringTyre,
    RigidDisc,
    TandemCams,
    TyreName,
    named_tyre,
    tyre_envelope,
)
from trueterrain.profile.extract import Ground, ThinPolicy, point_profile, tyre_profile
from trueterrain.profile.statistic import (
    InverseDistance,
    Mean,
    Median,
    Percentile,
    Statistic,
    SteepestCpf,
    Window,
)

StatisticName = Literal[
    "median",
    "mean",
    "percentile",
    "trimmed",
    "bridge",
    "idw-mean",
    "idw-median",
    "steepest",
    "point",
]

EnvelopeName = Literal["disc", "cams", "springs", "laser", "patch"]

# parameters of each statistic
_PARAMETERS: dict[str, tuple[str, ...]] = {
    "median": ("resolution",),
    "mean": (),
    "percentile": ("percent", "resolution"),
    "trimmed": ("skip",),
    "bridge": ("skip", "average"),
    "idw-mean": ("power",),
    "idw-median": ("power",),
    "steepest": ("bandwidth",),
    "point": (),
}


@dataclass(frozen=True, kw_only=True)
class TyreProfileSettings:
    """Search area, and the statistic of the heights in it.

    Examples
    --------
    >>> settings = TyreProfileSettings(statistic="percentile", percent=85.0, radius=0.05)
    >>> settings.search_area(), settings.estimator()
    (Disc(radius=0.05), Percentile(percent=85.0, resolution=None))
    """

    statistic: StatisticName = "median"
    """Statistic of the heights. "trimmed" omits skip at either end; "bridge" omits the highest skip
    and averages the next average; "steepest" is the most frequent height; "point" interpolates
    along the line, without a search area."""

    radius: float | None = None
    "Radius of a disc as search area [m]; by default 0.025, at most 1."

    patch: tuple[float, float] | None = None
    "Rectangle aligned with the path as search area: length and width [m]."

    ellipse: tuple[float, float] | None = None
    "Ellipse aligned with the path as search area: length and width [m]."

    percent: float | None = None
    "Percentile of the statistic percentile [%]."

    skip: float | None = None
    "Fraction of the heights that trimmed and bridge omit [%]; by default 10 and 15."

    average: float | None = None
    "Fraction of the heights that bridge averages [%]; by default 70."

    power: float | None = None
    "Power of the inverse distance of idw-mean and idw-median; by default 2."

    resolution: float | None = None
    """Quantisation step of the heights [m], for median and percentile: the distribution is
    interpolated between the steps."""

    bandwidth: float | None = None
    "Half width of the kernel of steepest [m]; by default from the scatter of the heights."

    level: bool = False
    "Remove the slope of the ground inside each search area first."

    min_count: int = 3
    "Minimum number of heights in a search area; one with fewer is thin."

    thin: ThinPolicy = "error"
    """Treatment of thin search areas, or of path points without ground under the whole tyre: error,
    or NaN in the profile (CSV only)."""

    def __post_init__(self) -> None:
        """Check that parameters belong to the statistic."""
        if self.statistic not in _PARAMETERS:
            known = ", ".join(get_args(StatisticName))
            message = f"statistic must be one of {known}, got {self.statistic!r}."
            raise ValueError(message)
        belongs = _PARAMETERS[self.statistic]
        for name in ("percent", "skip", "average", "power", "resolution", "bandwidth"):
            if getattr(self, name) is not None and name not in belongs:
                owners = " or ".join(key for key, names in _PARAMETERS.items() if name in names)
                message = f"{name} belongs to the statistic {owners}, not to {self.statistic}."
                raise ValueError(message)
        if self.statistic == "percentile" and self.percent is None:
            message = "the statistic percentile needs percent, e.g. 85."
            raise ValueError(message)
        if sum(shape is not None for shape in (self.radius, self.patch, self.ellipse)) > 1:
            message = "only one of radius, patch and ellipse may be given."
            raise ValueError(message)
        searched = self.radius or self.patch or self.ellipse or self.level or self.thin == "nan"
        if self.statistic == "point" and searched:
            message = "the statistic point has no search area, so none of its options can be given."
            raise ValueError(message)
        self.search_area()
        self.estimator()

    def search_area(self) -> SearchArea:
        """Area in which heights are searched.

        Returns
        -------
        SearchArea
            Around each path point.
        """
        if self.patch is not None:
            return Rectangle(length=self.patch[0], width=self.patch[1])
        if self.ellipse is not None:
            return Ellipse(length=self.ellipse[0], width=self.ellipse[1])
        return Disc() if self.radius is None else Disc(radius=self.radius)

    def estimator(self) -> Statistic | None:
        """Statistic of the heights, with its parameters.

        Returns
        -------
        Statistic or None
            For `tyre_profile`; None for the bare line.
        """
        given = {
            name: value
            for name in _PARAMETERS[self.statistic]
            if (value := getattr(self, name)) is not None
        }
        match self.statistic:
            case "median":
                return Median(**given)
            case "mean":
                return Mean()
            case "percentile":
                return Percentile(**given)
            case "trimmed":
                skip = given.get("skip", 10.0)
                return Window(skip=skip, size=100 - 2 * skip)
            case "bridge":
                return Window(skip=given.get("skip", 15.0), size=given.get("average", 70.0))
            case "idw-mean":
                return InverseDistance(of="mean", **given)
            case "idw-median":
                return InverseDistance(of="median", **given)
            case "steepest":
                return SteepestCpf(**given)
        return None


@dataclass(frozen=True, kw_only=True)
class EnvelopeSettings:
    """Tyre model that rolls along the path, instead of a statistic of search areas.

    Examples
    --------
    >>> EnvelopeSettings(envelope="springs", tyre="truck", load=20_000.0).model().load
    20000.0
    """

    envelope: EnvelopeName = "disc"
    """Tyre model: "disc", a rigid wheel; "cams", tandem elliptical cams; "springs", a deformable
    tyre at constant load; "laser", the bridge value of a line laser; "patch", the mean under the
    contact patch."""

    tyre: TyreName | None = None
    "Tyre that gives size and stiffness; by default passenger."

    load: float | None = None
    "Vertical load on springs [N]; by default the rated load of the tyre."

    def __post_init__(self) -> None:
        """Check that parameters belong to the envelope."""
        if self.envelope not in get_args(EnvelopeName):
            known = ", ".join(get_args(EnvelopeName))
            message = f"envelope must be one of {known}, got {self.envelope!r}."
            raise ValueError(message)
        if self.load is not None and self.envelope != "springs":
            message = f"load belongs to the envelope springs, not to {self.envelope}."
            raise ValueError(message)
        if self.tyre is not None and self.envelope == "laser":
            message = "tyre does not belong to the envelope laser, which has a size of its own."
            raise ValueError(message)
        self.model()

    def model(self) -> Envelope:
        """Tyre model.

        Returns
        -------
        RigidDisc, TandemCams, RadialSpringTyre, LineLaser or PatchMean
            For `tyre_envelope`.
        """
        tyre = named_tyre(self.tyre or "passenger")
        match self.envelope:
            case "disc":
                return RigidDisc.of(tyre)
            case "cams":
                return TandemCams.of(tyre)
            case "springs":
                return RadialSpringTyre.of(tyre, load=self.load)
            case "laser":
                return LineLaser()
            case "patch":
                return PatchMean.of(tyre)


def take_profile(
    ground: Ground,
    path: PlaneCurve | None,
    settings: TyreProfileSettings = TyreProfileSettings(),
    *,
    envelope: EnvelopeSettings | None = None,
    progress: Progress = no_progress,
) -> xr.Dataset:
    """Profile by the named statistic of search areas, or by the named tyre model.

    Parameters
    ----------
    ground : xarray.Dataset or iterable of xarray.Dataset
        Surface or points; with `envelope` a surface or a profile.
    path : PlaneCurve or None
        Path; None along a profile.
    settings : TyreProfileSettings
        Search area, statistic and treatment of thin places.
    envelope : EnvelopeSettings, optional
        Tyre model that rolls along the path, instead of the statistic.
    progress : callable
        Reports path points done.

    Returns
    -------
    xarray.Dataset
        As by `tyre_envelope`, `point_profile` or `tyre_profile`.
    """
    if envelope is not None:
        tyre = envelope.model()
        return tyre_envelope(ground, path, tyre=tyre, thin=settings.thin, progress=progress)
    if path is None:
        message = "a path must be given, unless a tyre rolls along a profile."
        raise ValueError(message)
    statistic = settings.estimator()
    if statistic is None:
        return point_profile(ground, path)
    return tyre_profile(
        ground,
        path,
        area=settings.search_area(),
        statistic=statistic,
        level=settings.level,
        min_count=settings.min_count,
        thin=settings.thin,
        progress=progress,
    )
