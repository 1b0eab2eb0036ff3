"""What a LAS file holds, and what is wrong with it, found in one pass over its points."""

import datetime as dt
from pathlib import Path
from typing import Any

import laspy
import numpy as np

from trueterrain.core.schemas import COORDINATES
from trueterrain.formats.las import _copc, _problems
from trueterrain.formats.las._crs import CrsReference, reference_of
from trueterrain.formats.las._duplicates import DuplicateCounter
from trueterrain.formats.las._open import open_reader, read_chunks
from trueterrain.formats.las._read import ADJUSTED, BLOCK, time_kind, times_of

_SELECTION = laspy.DecompressionSelection
_FIELDS = (
    _SELECTION.XY_RETURNS_CHANNEL
    | _SELECTION.Z
    | _SELECTION.GPS_TIME
    | _SELECTION.POINT_SOURCE_ID
    | _SELECTION.CLASSIFICATION
)
_GPS_EPOCH = dt.datetime(1980, 1, 6)  # GPS time has no zone and no leap seconds


class LasStatistics:
    """Everything that is counted while the points go by; memory does not grow with the file."""

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
        """Count the points of a record."""
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
        the extra bytes), ``software`` and ``problems``; everything can be written as JSON.

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
        tally = LasStatistics(header)
        for record in read_chunks(reader, path, BLOCK):
            tally.add(record)
    return {
        "format": name,
        "kind": "points",
        "version": str(header.version),
        "point_format": header.point_format.id,
        "count": tally.count,
        "extent": _point_extent(tally, reference),
        "scale": (header.scales * np.array(reference.units.factors)).tolist(),
        "offset": (header.offsets * np.array(reference.units.factors)).tolist(),
        "crs": reference.crs,
        "crs_name": reference.name,
        "units": reference.conversion,
        "time": _time_summary(tally, header),
        "density": _point_density(tally, reference),
        "point_source_ids": _nonzero_counts(tally.sources),
        "returns": _nonzero_counts(tally.returns),
        "classes": _nonzero_counts(tally.classes),
        "extra": [str(extra) for extra in header.point_format.extra_dimension_names],
        "software": str(header.generating_software).strip("\0 "),
        "problems": _problems.problems_of(header, reference, tally),
    }


def _point_extent(tally: LasStatistics, reference: CrsReference) -> dict[str, list[float]] | None:
    if not tally.count:
        return None
    ends = zip(COORDINATES, tally.low, tally.high, reference.units.factors, strict=True)
    return {name: [float(low * unit), float(high * unit)] for name, low, high, unit in ends}


def _time_summary(tally: LasStatistics, header: Any) -> dict[str, Any] | None:
    if not tally.time or tally.time_zeros == tally.count:
        return None
    flag = "adjusted standard" if header.global_encoding.gps_time_type.value else "week seconds"
    start, end = tally.time
    summary: dict[str, Any] = {"kind": tally.time_kind, "flag": flag, "start": start, "end": end}
    if tally.time_kind == "adjusted standard":
        summary |= {"first": _gps_date(start), "last": _gps_date(end)}
    return summary


def _gps_date(time: float) -> str | None:
    try:
        moment = _GPS_EPOCH + dt.timedelta(seconds=ADJUSTED + time)
    except OverflowError:
        return None
    return moment.isoformat(sep=" ", timespec="seconds") + " GPS"


def _point_density(tally: LasStatistics, reference: CrsReference) -> float | None:
    width, length = (tally.high - tally.low)[:2] * reference.units.horizontal
    if reference.obstacle or not tally.count or not width * length > 0:
        return None
    return float(tally.count / (width * length))


def _nonzero_counts(counts: Any) -> dict[str, int]:
    return {str(number): int(counts[number]) for number in np.flatnonzero(counts)}
