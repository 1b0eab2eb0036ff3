"""Summary and problems of a LAS file, from one pass over its points."""

import datetime as dt
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import numpy.typing as npt

from trueterrain.core.schemas import COORDINATES
from trueterrain.formats.las import _copc
from trueterrain.formats.las._crs import CrsReference, reference_of
from trueterrain.formats.las._open import open_reader, read_chunks
from trueterrain.formats.las._read import ADJUSTED, BLOCK, SECONDS_OF_WEEK, time_kind, times_of

_SELECTION = laspy.DecompressionSelection
_FIELDS = (
    _SELECTION.XY_RETURNS_CHANNEL
    | _SELECTION.Z
    | _SELECTION.GPS_TIME
    | _SELECTION.POINT_SOURCE_ID
    | _SELECTION.CLASSIFICATION
)
_STRAY = 0.005  # fraction of the points below which an id is a remnant, not a pass
_COARSE = 0.001  # [m] scale above which coordinates are flagged as too coarse
_NEAR_ROLLOVER = 3600.0  # [s] from either end of the week
_LARGEST_EXTENT_ERROR = 1.5  # [steps] rounding of the header's extent
_GPS_EPOCH = dt.datetime(1980, 1, 6)  # GPS time has no zone and no leap seconds

_LIMIT = 1 << 22  # hashes that are kept: 32 MB

# odd constants of 64-bit mixing functions (splitmix64, xxhash)
_MIX = (0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB)


class LasStatistics:
    """Counts and ranges of the points of a file; memory does not grow with their number."""

    def __init__(self, header: Any) -> None:
        self._header = header
        self.count = 0
        self.low = np.full(3, np.inf)  # [m]
        self.high = np.full(3, -np.inf)
        self.time: list[float] = []  # first and last [s]
        self.time_kind = ""
        self.time_falls = 0
        self.time_zeros = 0
        self.time_not_finite = 0
        self.sources = np.zeros(1 << 16, dtype=np.int64)
        self.returns = np.zeros(16, dtype=np.int64)
        self.classes = np.zeros(256, dtype=np.int64)
        self.duplicates = DuplicateCounter()
        self._last_time = -np.inf

    def add(self, record: Any) -> None:
        """Add the points of a record."""
        whole = np.stack([np.asarray(record[name]) for name in "XYZ"])
        self.count += whole.shape[1]
        scales, offsets = self._header.scales, self._header.offsets
        self.low = np.minimum(self.low, whole.min(axis=1) * scales + offsets)
        self.high = np.maximum(self.high, whole.max(axis=1) * scales + offsets)
        self.duplicates.add(*whole)
        for counts, name in (
            (self.sources, "point_source_id"),
            (self.returns, "return_number"),
            (self.classes, "classification"),
        ):
            counts += np.bincount(np.asarray(record[name]), minlength=counts.size)
        time = times_of(record, self._header)
        if time is not None:
            self._add_times(time)

    def _add_times(self, time: Any) -> None:
        self.time_zeros += int(np.count_nonzero(time == 0))
        finite = time[np.isfinite(time)]
        self.time_not_finite += time.size - finite.size
        if not finite.size:
            return
        self.time_falls += int(np.count_nonzero(np.diff(finite, prepend=self._last_time) < 0))
        self._last_time = float(finite[-1])
        span = [*self.time, float(finite.min()), float(finite.max())]
        self.time = [min(span), max(span)]
        if self.time_kind != "adjusted standard":
            self.time_kind = time_kind(self._header, finite)


def describe(path: str | Path) -> dict[str, Any]:
    """Summary of a LAS, LAZ or COPC file for ``trueterrain info``; reads it once, in blocks.

    Parameters
    ----------
    path : str or Path
        The file.

    Returns
    -------
    dict
        ``format``, ``kind``, ``version``, ``point_format``, ``count``, ``extent`` [m], ``scale``
        [m], ``offset`` [m], ``crs`` (in metres), ``crs_name``, ``units`` (how reading converts
        those of the file; empty if they are metres), ``time`` [s], ``density`` [1/m²],
        ``point_source_ids``, ``returns`` and ``classes`` with their counts, ``extra`` (names of
        the extra bytes), ``software`` and ``problems``; all values are plain types that JSON can
        hold.

    Raises
    ------
    FormatError
        If the file is damaged.
    """
    path = Path(path)
    with open_reader(path, _FIELDS) as reader:
        header = reader.header
        name = "COPC" if _copc.is_copc(header) else "LAZ" if header.are_points_compressed else "LAS"
        reference = reference_of(header)
        statistics = LasStatistics(header)
        for record in read_chunks(reader, path, BLOCK):
            statistics.add(record)
    return {
        "format": name,
        "kind": "points",
        "version": str(header.version),
        "point_format": header.point_format.id,
        "count": statistics.count,
        "extent": _point_extent(statistics, reference),
        "scale": (header.scales * np.array(reference.units.factors)).tolist(),
        "offset": (header.offsets * np.array(reference.units.factors)).tolist(),
        "crs": reference.crs,
        "crs_name": reference.name,
        "units": reference.conversion,
        "time": _time_summary(statistics, header),
        "density": _point_density(statistics, reference),
        "point_source_ids": _nonzero_counts(statistics.sources),
        "returns": _nonzero_counts(statistics.returns),
        "classes": _nonzero_counts(statistics.classes),
        "extra": [str(extra) for extra in header.point_format.extra_dimension_names],
        "software": str(header.generating_software).strip("\0 "),
        "problems": _list_problems(header, reference, statistics),
    }


def _point_extent(
    statistics: LasStatistics, reference: CrsReference
) -> dict[str, list[float]] | None:
    if not statistics.count:
        return None
    ends = zip(COORDINATES, statistics.low, statistics.high, reference.units.factors, strict=True)
    return {name: [float(low * unit), float(high * unit)] for name, low, high, unit in ends}


def _time_summary(statistics: LasStatistics, header: Any) -> dict[str, Any] | None:
    if not statistics.time or statistics.time_zeros == statistics.count:
        return None
    flag = "adjusted standard" if header.global_encoding.gps_time_type.value else "week seconds"
    start, end = statistics.time
    summary: dict[str, Any] = {
        "kind": statistics.time_kind,
        "flag": flag,
        "start": start,
        "end": end,
    }
    if statistics.time_kind == "adjusted standard":
        summary |= {"first": _gps_date(start), "last": _gps_date(end)}
    return summary


def _gps_date(time: float) -> str | None:
    try:
        moment = _GPS_EPOCH + dt.timedelta(seconds=ADJUSTED + time)
    except OverflowError:
        return None
    return moment.isoformat(sep=" ", timespec="seconds") + " GPS"


def _point_density(statistics: LasStatistics, reference: CrsReference) -> float | None:
    width, length = (statistics.high - statistics.low)[:2] * reference.units.horizontal
    if reference.obstacle or not statistics.count or not width * length > 0:
        return None
    return float(statistics.count / (width * length))


def _nonzero_counts(counts: Any) -> dict[str, int]:
    return {str(number): int(counts[number]) for number in np.flatnonzero(counts)}


def _list_problems(header: Any, reference: CrsReference, statistics: LasStatistics) -> list[str]:
    """Problems and flags of a file, in words."""
    if not statistics.count:
        return ["there are no points", *reference.flags]
    return [
        *_about_crs(reference),
        *_about_waves(header),
        *_about_time(header, statistics),
        *_about_sources(statistics.sources, statistics.count),
        *_about_places(header, reference, statistics),
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


def _about_time(header: Any, statistics: LasStatistics) -> list[str]:
    if "gps_time" not in header.point_format.dimension_names:
        return ["the point format has no time"]
    problems = []
    if statistics.time_not_finite:
        problems.append(f"{statistics.time_not_finite} points have a time that is not finite")
    if statistics.time_zeros == statistics.count:
        return [*problems, "all times are 0"]
    if statistics.time_zeros:
        problems.append(f"{statistics.time_zeros} points have time 0")
    problems += _about_kind(header, statistics)
    passes = int(np.count_nonzero(statistics.sources))
    # passes stored one after another may overlap in time: each may begin with a step back
    if statistics.time_falls >= max(1, passes):
        times = f"{statistics.time_falls} times along the file"
        problems.append(f"time falls {times}: the points are not in the order of measurement")
    return problems


def _about_kind(header: Any, statistics: LasStatistics) -> list[str]:
    if not statistics.time:
        return []
    start, end = statistics.time
    values = f"the values run from {start:.9g} to {end:.9g} s"
    standard = header.global_encoding.gps_time_type.value == 1
    if not standard and statistics.time_kind == "adjusted standard":
        taken = "taken as adjusted standard time"
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
        return ["point_source_id is 0 everywhere: passes cannot be separated"]
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


def _about_places(header: Any, reference: CrsReference, statistics: LasStatistics) -> list[str]:
    problems = []
    repeated = statistics.duplicates.count
    if repeated:
        about = "" if statistics.duplicates.exact else "about "
        problems.append(
            f"{about}{repeated} of {statistics.count} points lie exactly where another lies"
        )
    scale = float(max(header.scales * np.array(reference.units.factors)))
    if scale > _COARSE:
        problems.append(f"coordinates are rounded to {scale:.6g} m: too coarse for millimetres")
    errors = np.abs(np.stack([header.mins - statistics.low, header.maxs - statistics.high]))
    if (errors > _LARGEST_EXTENT_ERROR * header.scales).any():
        most = f"by up to {errors.max():.6g} m"
        problems.append(f"the extent in the header differs from that of the points {most}")
    counted = statistics.returns[1:]
    announced = np.zeros_like(counted)
    by_return = np.asarray(header.number_of_points_by_return)[: announced.size]
    announced[: by_return.size] = by_return
    # headers before LAS 1.4 count five returns only
    known = min(by_return.size, counted.size)
    if (announced[:known] != counted[:known]).any():
        problems.append("the counts by return in the header differ from those of the points")
    return problems


class DuplicateCounter:
    """Count of points with exactly the same coordinates as another point.

    Each position becomes a 64-bit hash. Up to `limit` points all hashes are kept and the count is
    exact, except for collisions (a chance below 1 in a million). Beyond that only hashes that end
    in a zero bit are kept, then in two zero bits, and so on. Duplicates are kept or dropped
    together, so the count in this sample times 2 per bit estimates the count in the file.

    Parameters
    ----------
    limit : int
        Largest number of hashes that are kept, 8 bytes each.
    """

    def __init__(self, limit: int = _LIMIT) -> None:
        self._limit = limit
        self._bits = 0
        self._held: list[npt.NDArray[np.uint64]] = []

    def add(self, x: npt.ArrayLike, y: npt.ArrayLike, z: npt.ArrayLike) -> None:
        """Add points by their integer coordinates."""
        self._held.append(self._sampled(_hash_coordinates(x, y, z)))
        while sum(held.size for held in self._held) > self._limit:
            self._bits += 1
            self._held = [self._sampled(np.concatenate(self._held))]

    @property
    def exact(self) -> bool:
        """Whether the count is exact, not an estimate."""
        return self._bits == 0

    @property
    def count(self) -> int:
        """Number of points at a position where another point lies."""
        if not self._held:
            return 0
        held = np.concatenate(self._held)
        return int(held.size - np.unique(held).size) << self._bits

    def _sampled(self, hashes: npt.NDArray[np.uint64]) -> npt.NDArray[np.uint64]:
        mask = np.uint64((1 << self._bits) - 1)
        return hashes[(hashes & mask) == 0] if self._bits else hashes


def _hash_coordinates(
    x: npt.ArrayLike, y: npt.ArrayLike, z: npt.ArrayLike
) -> npt.NDArray[np.uint64]:
    factors = [np.uint64(number) for number in _MIX]
    mixed = np.zeros(np.size(x), dtype=np.uint64)
    for values, factor in zip((x, y, z), factors[:3], strict=True):
        mixed ^= np.asarray(values).astype(np.int64).view(np.uint64)
        mixed *= factor
        mixed ^= mixed >> np.uint64(32)
    mixed *= factors[3]
    mixed ^= mixed >> np.uint64(29)
    return mixed
