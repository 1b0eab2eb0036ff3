"""Checks of a profile that flag suspicious heights, for all formats of profiles."""

from typing import Any

import numpy as np
import numpy.typing as npt

_STEEP = 0.3  # [m/m] no road has a larger median slope: the unit of height is probably wrong


def profile_flags(
    name: str, s: npt.NDArray[np.floating[Any]], height: npt.NDArray[np.floating[Any]]
) -> list[str]:
    """Flags of one track: missing heights, slopes that suggest a wrong unit, no variation."""
    flags = []
    missing = int(np.count_nonzero(~np.isfinite(height)))
    if missing:
        flags.append(f"track {name}: {missing} of {height.size} heights are missing")
    slopes = np.abs(np.diff(height) / np.diff(s))
    slopes = slopes[np.isfinite(slopes)]
    if slopes.size and np.median(slopes) > _STEEP:
        median = float(np.median(slopes))
        flags.append(f"track {name}: the median slope is {median:.2g} m/m, is the unit right?")
    if slopes.size and not slopes.any():
        flags.append(f"track {name}: all heights are equal")
    return flags
