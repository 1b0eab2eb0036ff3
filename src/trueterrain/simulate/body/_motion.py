"""Base classes of motions, which yield knots block by block."""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator
from itertools import count, pairwise
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from trueterrain.simulate.pose import PoseKnots

Float = npt.NDArray[np.float64]

#: Time over which a motion is computed at once, independent of the requested blocks [s].
CHUNK = 5.0

_MIN_RATE = 1000.0  # [Hz]
_TOLERANCE = 1e-6  # [1] of the time between knots, for times at a knot
_MAX_KNOTS = 2**62  # [1] knots


class MotionChunk(NamedTuple):
    """Consecutive knots; knot k is at time k / rate."""

    first: int
    "Number of the first knot."
    values: Float
    "Pose, rate and acceleration, shape (3, n, 6) [m], [rad], [s]."


class Motion(ABC):
    """Exact motion of the body of a vehicle, evaluated by the virtual instruments.

    Components are easting, northing and height of the origin of the body [m], roll, pitch (nose
    down positive) and yaw (counter-clockwise from east, not wrapped) [rad]: ISO 8855. Knot k is at
    time k / rate and is the same to the last bit for any division of the motion into blocks.
    """

    rate: float

    @property
    @abstractmethod
    def duration(self) -> float:
        """Time at which the motion ends [s]; it starts at 0."""

    @property
    def span(self) -> tuple[float, float]:
        """First and last time at which the motion is known, run-in and run-out included [s]."""
        return -math.inf, math.inf

    @abstractmethod
    def _chunks(self, first: int) -> Iterator[MotionChunk]:
        """Consecutive chunks; the first one starts at knot `first` or before."""

    def blocks(
        self,
        begin: float = 0.0,
        end: float | None = None,
        block: float = CHUNK,
        *,
        margin: float = 0.1,
    ) -> Iterator[tuple[float, float, PoseKnots]]:
        """Knots of the motion, block by block.

        Parameters
        ----------
        begin : float
            Start of the first block [s].
        end : float, optional
            End of the last block [s]; by default the duration of the motion.
        block : float
            Length of the blocks [s]; the last one may be shorter.
        margin : float
            Time by which the knots extend beyond a block on either side [s].

        Yields
        ------
        begin, end : float
            Times of the block [s].
        knots : PoseKnots
            Motion from ``begin - margin`` to ``end + margin`` at least.

        Raises
        ------
        ValueError
            If the block or the interval is empty, or the motion is not known over all of it.

        Examples
        --------
        >>> from trueterrain.simulate.body import Parked
        >>> [(a, b) for a, b, knots in Parked(duration=12.0).blocks(block=5.0)]
        [(0.0, 5.0), (5.0, 10.0), (10.0, 12.0)]
        """
        end = self.duration if end is None else end
        if not begin < end:
            raise ValueError(f"end must be later than begin {begin} s, got {end} s.")
        if not (block > 0 and margin >= 0):
            raise ValueError(
                f"block must be greater than 0 s and margin at least 0 s, got {block} and {margin}."
            )
        earliest, latest = self.span
        if begin - margin < earliest or end + margin > latest:
            raise ValueError(
                f"begin, end and margin must lie within the motion, which is known from "
                f"{earliest:.6g} s to {latest:.6g} s, got {begin - margin:.6g} s to "
                f"{end + margin:.6g} s."
            )
        return self._iterate_blocks(begin, end, block, margin)

    def _iterate_blocks(
        self, begin: float, end: float, block: float, margin: float
    ) -> Iterator[tuple[float, float, PoseKnots]]:
        number = max(math.ceil((end - begin) / block - _TOLERANCE), 1)
        edges = [*(begin + n * block for n in range(number)), end]
        first = math.floor((begin - margin) * self.rate + _TOLERANCE)
        source = self._chunks(first)
        buffered: list[MotionChunk] = []
        for early, late in pairwise(edges):
            first = math.floor((early - margin) * self.rate + _TOLERANCE)
            last = math.ceil((late + margin) * self.rate - _TOLERANCE)
            while not buffered or buffered[-1].first + buffered[-1].values.shape[1] <= last:
                buffered.append(next(source))
            buffered = [chunk for chunk in buffered if chunk.first + chunk.values.shape[1] > first]
            values = np.concatenate([chunk.values for chunk in buffered], axis=1)
            part = slice(first - buffered[0].first, last + 1 - buffered[0].first)
            pose, rate, acceleration = np.ascontiguousarray(values[:, part])
            time = np.arange(first, last + 1) / self.rate
            yield early, late, PoseKnots(time=time, pose=pose, rate=rate, acceleration=acceleration)

    def knots(self, begin: float, end: float, *, margin: float = 0.1) -> PoseKnots:
        """Knots of one interval of time.

        Parameters
        ----------
        begin, end : float
            The interval [s].
        margin : float
            Time by which the knots extend beyond it on either side [s].

        Returns
        -------
        PoseKnots
            As from `blocks`.
        """
        return next(iter(self.blocks(begin, end, end - begin, margin=margin)))[2]

    def to_dict(self) -> dict[str, Any]:
        """Kind and parameters of the motion, for provenance."""
        names = getattr(self, "__dataclass_fields__", {})
        fields = {name: getattr(self, name) for name in names}
        return {
            "kind": type(self).__name__,
            **{
                name: value.to_dict() if hasattr(value, "to_dict") else value
                for name, value in fields.items()
            },
        }


class FormulaMotion(Motion):
    """Motion that can be computed at any time, independent of the time before."""

    @abstractmethod
    def _values(self, time: Float) -> Float:
        """Pose, rate and acceleration at times, shape (3, n, 6)."""

    def _chunks(self, first: int) -> Iterator[MotionChunk]:
        size = round(CHUNK * self.rate)
        first_known, last_known = self._known_range()
        for number in count(first // size):
            begin = max(number * size, first_known)
            end = min((number + 1) * size, last_known + 1)
            if begin >= end:
                return
            yield MotionChunk(begin, self._values(np.arange(begin, end) / self.rate))

    def _known_range(self) -> tuple[int, int]:
        """Numbers of the first and the last knot at which the motion is known."""
        earliest, latest = self.span
        return (
            -_MAX_KNOTS if math.isinf(earliest) else math.ceil(earliest * self.rate - _TOLERANCE),
            _MAX_KNOTS if math.isinf(latest) else math.floor(latest * self.rate + _TOLERANCE),
        )


def check_rate(rate: float) -> None:
    """Raise ValueError unless the rate of the knots is high enough."""
    if not (np.isfinite(rate) and rate >= _MIN_RATE):
        raise ValueError(f"rate must be at least {_MIN_RATE:g} Hz, got {rate}.")


def check_at_least_0(unit: str, **values: float) -> None:
    """Raise ValueError unless the values are finite and at least 0."""
    for name, value in values.items():
        if not (np.isfinite(value) and value >= 0):
            raise ValueError(f"{name} must be finite and at least 0 {unit}, got {value}.")
