"""What goes wrong in real LAS files."""

from typing import TYPE_CHECKING, Any

import numpy as np

from trueterrain.formats.las._crs import CrsReference
from trueterrain.formats.las._read import ADJUSTED, SECONDS_OF_WEEK

if TYPE_CHECKING:
    from trueterrain.formats.las._describe import LasStatistics

_STRAY = 0.005  # an id with a smaller fraction of the points is no pass, but a remnant
_COARSE = 0.001  # [m] millimetre work needs steps of a tenth of it
_NEAR_ROLLOVER = 3600.0  # [s] from either end of the week
_LARGEST_EXTENT_ERROR = 1.5  # [steps] rounding of the header's extent


def problems_of(header: Any, reference: CrsReference, tally: "LasStatistics") -> list[str]:
    """Everything that is wrong or flagged, in words."""
    if not tally.count:
        return ["there are no points", *reference.flags]
    return [
        *_about_crs(reference),
        *_about_waves(header),
        *_about_time(header, tally),
        *_about_sources(tally.sources, tally.count),
        *_about_places(header, reference, tally),
    ]


def _about_crs(reference: CrsReference) -> list[str]:
    problems = list(reference.flags)
    if reference.obstacle:
        problems.append(
            f"coordinates are {reference.obstacle}, not easting, northing, up: reading refuses them"
        )
    if reference.assumed:
        problems.append(reference.assumed)
    return problems


def _about_waves(header: Any) -> list[str]:
    if "wavepacket_index" in header.point_format.dimension_names:
        return ["wave packets are not read"]
    return []


def _about_time(header: Any, tally: "LasStatistics") -> list[str]:
    if "gps_time" not in header.point_format.dimension_names:
        return ["the point format has no time"]
    problems = []
    if tally.time_not_finite:
        problems.append(f"{tally.time_not_finite} points have a time that is not finite")
    if tally.time_zeros == tally.count:
        return [*problems, "all times are 0"]
    if tally.time_zeros:
        problems.append(f"{tally.time_zeros} points have time 0")
    problems += _about_kind(header, tally)
    lanes = int(np.count_nonzero(tally.sources))
    # passes one after the other are in order, though time falls where the next one begins
    if tally.time_falls >= max(1, lanes):
        times = f"{tally.time_falls} times along the file"
        problems.append(f"time falls {times}: the points are not in the order of measurement")
    return problems


def _about_kind(header: Any, tally: "LasStatistics") -> list[str]:
    if not tally.time:
        return []
    start, end = tally.time
    values = f"the values run from {start:.9g} to {end:.9g} s"
    standard = header.global_encoding.gps_time_type.value == 1
    if not standard and tally.time_kind == "adjusted standard":
        taken = "taken for adjusted standard time"
        return [f"the time flag says seconds of the week, but {values}: {taken}"]
    if standard and start >= 0 and end <= SECONDS_OF_WEEK:
        return [f"the time flag says adjusted standard time, but {values}: seconds of the week?"]
    if standard and end >= ADJUSTED:
        return [f"the time flag says adjusted standard time, but {values}: not adjusted?"]
    if not standard and start < _NEAR_ROLLOVER and end > SECONDS_OF_WEEK - _NEAR_ROLLOVER:
        return [f"{values}: the week may have rolled over during the measurement"]
    return []


def _about_sources(sources: Any, count: int) -> list[str]:
    if sources[0] == count:
        return ["point_source_id is 0 everywhere: passes cannot be told apart"]
    problems = []
    if sources[0]:
        problems.append(f"{int(sources[0])} points have point_source_id 0 (not set)")
    stray = [int(i) for i in np.flatnonzero(sources) if i and sources[i] < _STRAY * count]
    if stray:
        named = ", ".join(f"{i} ({int(sources[i])} points)" for i in stray[:5])
        more = f" and {len(stray) - 5} more" if len(stray) > 5 else ""
        problems.append(
            f"stray point_source_id with less than {_STRAY:.1%} of the points: {named}{more}"
        )
    return problems


def _about_places(header: Any, reference: CrsReference, tally: "LasStatistics") -> list[str]:
    problems = []
    repeated = tally.duplicates.count
    if repeated:
        about = "" if tally.duplicates.exact else "about "
        problems.append(f"{about}{repeated} of {tally.count} points lie exactly where another lies")
    scale = float(max(header.scales * np.array(reference.units.factors)))
    if scale > _COARSE:
        problems.append(f"coordinates are rounded to {scale:.6g} m: too coarse for millimetres")
    errors = np.abs(np.stack([header.mins - tally.low, header.maxs - tally.high]))
    if (errors > _LARGEST_EXTENT_ERROR * header.scales).any():
        most = f"by up to {errors.max():.6g} m"
        problems.append(f"the extent in the header differs from that of the points {most}")
    counted = tally.returns[1:]
    announced = np.zeros_like(counted)
    by_return = np.asarray(header.number_of_points_by_return)[: announced.size]
    announced[: by_return.size] = by_return
    # headers before LAS 1.4 count five returns only
    known = min(by_return.size, counted.size)
    if (announced[:known] != counted[:known]).any():
        problems.append("the counts by return in the header differ from those of the points")
    return problems
