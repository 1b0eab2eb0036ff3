"""Tyre models that roll along a path: envelope and effective road."""

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core import provenance
from trueterrain.core.errors import CoverageError
from trueterrain.core.progress import Progress, no_progress
from trueterrain.core.schemas import check_profile, check_surface, kind_of, make_profile
from trueterrain.geometry.curve import PlaneCurve
from trueterrain.profile.envelope._strip import (
    GroundStrip,
    Integer,
    Lines,
    ProfileLine,
    SurfaceLines,
    strip_under,
)
from trueterrain.profile.envelope.averages import LineLaser, PatchMean
from trueterrain.profile.envelope.rigid import RigidDisc, TandemCams
from trueterrain.profile.envelope.springs import RadialSpringTyre
from trueterrain.profile.extract import Ground, ThinPolicy

Float = npt.NDArray[np.float64]

#: Tyre models that roll along a path.
Envelope = RigidDisc | TandemCams | RadialSpringTyre | LineLaser | PatchMean

_SAMPLES = 1 << 19  # of the ground in one block; some 50 MB

_MEANING = {
    "height": ("m", "height of the effective road"),
    "sd": ("m", "standard deviation of the height"),
    "slope": ("m/m", "slope of the effective road, rising ahead"),
    "camber": ("m/m", "cross slope of the effective road, rising to the left"),
    "curvature": ("1/m", "derivative of the slope along the path"),
    "count": ("1", "number of samples of the ground that the tyre may touch"),
}


def tyre_envelope(
    ground: Ground,
    path: PlaneCurve | None = None,
    *,
    tyre: Envelope = RigidDisc(),
    step: float | None = None,
    min_cover: float = 1.0,
    thin: ThinPolicy = "error",
    progress: Progress = no_progress,
) -> xr.Dataset:
    """Height of the effective road of a tyre model along a path, or along a profile.

    Use it as input of vehicle models whose tyre is a point contact, or to see the height of the hub
    over short unevenness; `effective_road` gives slope, camber and curvature as well.

    Parameters
    ----------
    ground : xarray.Dataset
        Surface, along a reference line or a map, or a Profile, which is then level across.
    path : PlaneCurve, optional
        Path points on a surface, at equal spacing; none with a profile.
    tyre : RigidDisc, TandemCams, RadialSpringTyre, LineLaser or PatchMean
        Tyre model; by default a disc of the size of a passenger car's tyre.
    step : float, optional
        Maximum distance between samples of the ground along the path [m]; by default that of the
        nodes of the surface or of the profile, but from 1 mm to 10 mm. Ground is bilinear between
        nodes, and linear between samples.
    min_cover : float
        Minimum fraction of known ground within the reach and width of the tyre [1]. The tyre does
        not touch missing samples.
    thin : {"error", "nan"}
        Whether path points with less ground raise or give NaN. They are never interpolated.
    progress : callable, optional
        Called with the task and the amount done.

    Returns
    -------
    xarray.Dataset
        Profile with ``height``, ``count`` (samples of the ground within the reach of the tyre), on
        a surface ``easting`` and ``northing``, with a line laser ``sd``. In its attributes:
        ``thin``, number of path points that are NaN; ``held``, number of path points whose tyre
        reaches beyond the end of the ground before or after the path, where its last height is
        held.

    Raises
    ------
    CoverageError
        If path points have too little ground and `thin` is ``"error"``, or all of them have; if
        the points are not equally spaced; if the ground is scattered points, which define no height
        between them.
    ValueError
        If a parameter is out of its range, or a path is given with a profile.

    Notes
    -----
    The height is that of the wheel less its height on a level plane, so that a level plane is
    reproduced. On measured Belgian block, 10 mm between nodes, heights from samples 10 mm apart
    differ from those from samples 1 mm apart by 0.08 mm (springs), 0.12 mm (cams) and 0.20 mm
    (disc) RMS, of a road of 17 mm RMS. The wheel is straight, while lines follow the path: on a
    bend of radius r a point at the longitudinal distance x has a lateral error of x^2 / (2 r),
    0.5 mm at x = 0.1 m and r = 10 m. The result does not depend on blocks or threads, not even in
    the last bit.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_profile
    >>> step = make_profile(np.arange(200) * 0.01, np.repeat([0.0, 0.02], 100))
    >>> envelope = tyre_envelope(step, tyre=RigidDisc(radius=0.3))
    >>> envelope.height.values[[80, 90, 95, 100]]
    array([0.        , 0.00284271, 0.01580399, 0.02      ])
    """
    road = effective_road(
        ground,
        path,
        tyre=tyre,
        step=step,
        min_cover=min_cover,
        thin=thin,
        progress=progress,
    )
    names = [name for name in ("height", "sd", "count", "easting", "northing") if name in road]
    tracks = [str(name) for name in road.track.values] if "track" in road.dims else None
    profile = make_profile(
        road.s,
        **{name: road[name].values for name in names},
        tracks=tracks,
        crs=road.attrs["crs"],
    )
    kept = {name: road.attrs[name] for name in ("thin", "held", "provenance")}
    return profile.assign_attrs(kept)


def effective_road(
    ground: Ground,
    path: PlaneCurve | None = None,
    *,
    tyre: Envelope = TandemCams(),
    step: float | None = None,
    min_cover: float = 1.0,
    thin: ThinPolicy = "error",
    progress: Progress = no_progress,
) -> xr.Dataset:
    """Effective road plane of a tyre model at each path point: height, slope, camber, curvature.

    Input of tyre models such as MF-Swift.

    Parameters
    ----------
    ground, path, tyre, step, min_cover, thin, progress
        As in `tyre_envelope`; by default the tandem cams of a passenger car's tyre.

    Returns
    -------
    xarray.Dataset
        Dimension s: ``height`` [m], ``count``; ``slope`` [m/m] of disc, cams and springs;
        ``curvature`` [1/m] of cams, and on a surface their ``camber`` [m/m]; ``sd`` [m] of a line
        laser; ``easting``, ``northing`` [m] on a surface. Attributes as in `tyre_envelope`.

    Raises
    ------
    CoverageError, ValueError
        As `tyre_envelope`.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_profile
    >>> ramp = make_profile(np.arange(200) * 0.01, 0.02 * np.arange(200) * 0.01)
    >>> print(f"{effective_road(ramp).slope.values[100]:.3f}")
    0.020
    """
    if not 0 < min_cover <= 1:
        message = f"min_cover must be greater than 0 and at most 1, got {min_cover}."
        raise ValueError(message)
    if thin not in ("error", "nan"):
        message = f"thin must be 'error' or 'nan', got {thin!r}."
        raise ValueError(message)
    if not isinstance(ground, xr.Dataset) or kind_of(ground) == "points":
        raise CoverageError(
            "scattered points have no height between them",
            cure="Grid them first (`trueterrain grid`); a tyre rolls on a surface or a profile.",
        )
    kind = kind_of(ground)
    if kind == "profile" and path is not None:
        message = "path must not be given with a profile, which defines its own path."
        raise ValueError(message)
    if kind == "surface" and not isinstance(path, PlaneCurve):
        message = f"path must be a PlaneCurve, after the ground, got {type(path).__name__}."
        raise TypeError(message)
    policy = min_cover, thin
    if path is not None:
        lines = SurfaceLines(check_surface(ground), path, tyre.offsets, step)
        road = _roll_tyre(lines, path.s, tyre, policy, progress)
        road["easting"] = ("s", path.easting, {"units": "m"})
        road["northing"] = ("s", path.northing, {"units": "m"})
    else:
        road = _on_tracks(check_profile(ground), tyre, step, policy, progress)
    parameters = {
        "tyre": tyre,
        "step": step,
        "min_cover": min_cover,
        "thin": thin,
    }
    road.attrs["crs"] = ground.attrs.get("crs", "")
    return provenance.add_step(road, "tyre_envelope", parameters=parameters, after=ground)


def _on_tracks(
    profile: xr.Dataset,
    tyre: Envelope,
    step: float | None,
    policy: tuple[float, ThinPolicy],
    progress: Progress,
) -> xr.Dataset:
    """Effective road of a profile, track by track."""
    s = np.asarray(profile.s, float)

    def of(track: xr.Dataset) -> xr.Dataset:
        line = ProfileLine(s, np.asarray(track.height, float), step)
        road = _roll_tyre(line, s, tyre, policy, progress)
        positions = {name: track[name] for name in ("easting", "northing") if name in track}
        return road.assign({name: ("s", at.values, at.attrs) for name, at in positions.items()})

    if "track" not in profile.dims:
        return of(profile)
    roads = [of(profile.sel(track=name)) for name in profile.track.values]
    together = xr.concat(roads, dim=profile.track, combine_attrs="drop")
    return together.assign_attrs(
        {name: sum(road.attrs[name] for road in roads) for name in ("thin", "held")}
    )


def _roll_tyre(
    lines: Lines,
    s: Float,
    tyre: Envelope,
    policy: tuple[float, ThinPolicy],
    progress: Progress,
) -> xr.Dataset:
    """Effective road along lines, block by block."""
    parts: list[dict[str, Float | Integer]] = []
    held = np.zeros(s.size, bool)
    block = max(_SAMPLES // (lines.stride * len(lines.offsets)), 1)
    for begin in range(0, s.size, block):
        end = min(begin + block, s.size)
        strip, known = strip_under(lines, begin, end, tyre.reach)
        counts, within = _count_heights(strip, tyre.reach)
        rolled: dict[str, Float | Integer] = {**tyre.roll(strip), "count": counts}
        sample = np.arange(begin, end) * lines.stride
        held[begin:end] = (sample - within < known[0]) | (sample + within > known[1])
        parts.append(rolled)
        progress("envelope", end, s.size)
    found = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    cover = found["count"] / (len(lines.offsets) * (2 * within + 1))
    is_thin = (cover < policy[0]) | np.isnan(found["height"])
    _report_thin(s, is_thin, cover, policy)
    for name in set(found) - {"count"}:
        found[name][is_thin] = np.nan
    if isinstance(tyre, TandemCams):
        found["curvature"] = np.gradient(found["slope"], s)
    variables = {
        name: ("s", values, dict(zip(("units", "long_name"), _MEANING[name], strict=True)))
        for name, values in found.items()
    }
    return xr.Dataset(
        variables,
        {"s": ("s", s, {"units": "m"})},
        {"thin": int(is_thin.sum()), "held": int(held.sum())},
    )


def _count_heights(strip: GroundStrip, reach: float) -> tuple[Integer, int]:
    """Number of samples with a height in the reach of each path point, and the reach [samples]."""
    within = int(np.ceil(reach / strip.step - 1e-6))
    known = np.isfinite(strip.height).sum(axis=0)
    total = np.append(0, np.cumsum(known))
    at = strip.first + strip.stride * np.arange(strip.count)
    return np.asarray(total[at + within + 1] - total[at - within]), within


def _report_thin(
    s: Float, is_thin: npt.NDArray[np.bool_], cover: Float, policy: tuple[float, ThinPolicy]
) -> None:
    """Raise if path points are thin and the policy (min_cover, thin) does not permit it."""
    thin = np.flatnonzero(is_thin)
    if thin.size == 0 or (policy[1] == "nan" and thin.size < s.size):
        return
    if not cover.any():
        raise CoverageError(
            "the path lies outside of the ground",
            cure="Check the coordinates and the CRS of the path with `trueterrain info`.",
        )
    overloaded = np.flatnonzero(is_thin & (cover >= policy[0]))
    if overloaded.size:
        raise CoverageError(
            f"the tyre cannot carry its load at {overloaded.size} of {s.size} path points, the "
            f"first at s = {s[overloaded[0]]:.3f} m: the ground would reach its hub",
            cure="Check the heights for outliers, or reduce the load.",
        )
    cure = "Fill the holes, keep the path farther inside, or lower min_cover"
    if policy[1] == "error":
        cure += ', or let these become NaN (--thin nan, thin="nan")'
    raise CoverageError(
        f"{thin.size} of {s.size} path points have too little ground under the tyre, the first at "
        f"s = {s[thin[0]]:.3f} m with {100 * cover[thin[0]]:.0f} % of it",
        cure=cure + ".",
    )
