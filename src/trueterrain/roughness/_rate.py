"""Mean response of a quarter car, of a whole track and of its segments."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from trueterrain.core.errors import CoverageError
from trueterrain.roughness._track import QuarterCarSettings, drive_profile, mean_outputs
from trueterrain.roughness._tracks import FixedSegments, sample_range

Array = npt.NDArray[np.float64]


def rate_track(
    station: Array,
    height: Array,
    options: QuarterCarSettings,
    segments: FixedSegments,
    *,
    squared: bool = False,
) -> tuple[float, Array]:
    """Mean of abs(output), or of its square, of a track and of its segments.

    It is in m/m, or its square, and NaN for a segment without a step.
    """
    way = drive_profile(station, height, options)
    if not (options.restart and segments.start.size):
        return mean_outputs(way, segments.edges, squared=squared)
    whole, _ = mean_outputs(way, np.empty(0), squared=squared)
    once = replace(options, restart=False)
    parts = np.full(segments.start.size, np.nan)
    for at, (start, end) in enumerate(zip(segments.start, segments.end, strict=True)):
        inside = sample_range(station, start, end)
        try:
            part = drive_profile(station[inside], height[inside], once)
        except CoverageError:
            if segments.complete[at]:
                raise
            continue
        parts[at], _ = mean_outputs(part, np.empty(0), squared=squared)
    return whole, parts
