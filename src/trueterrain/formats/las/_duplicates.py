"""Count duplicate points in bounded memory."""

import numpy as np
import numpy.typing as npt

_LIMIT = 1 << 22  # hashes that are kept: 32 MB

# odd constants of 64-bit mixing functions (splitmix64, xxhash)
_MIX = (0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB)


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
