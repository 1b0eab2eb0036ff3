"""Mean response of a quarter car, of a whole track and of its segments."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from trueterrain.errors import CoverageError
from trueterrain.roughness._track import CarOptions, drive, means
from trueterrain.roughness._tracks import Segments, samples

Array = npt.NDArray[np.float64]


def rate(
    station: Array, height: Array, options: CarOptions, segments: Segments, *, squared: bool = False
) -> tuple[float, Array]:
    """Mean of abs(output), or of its square, of a track and of its segments.

    It is in m/m, or its square, and NaN for a segment without a step.
    """
    way = drive(station, height, options)
    if not (options.restart and segments.start.size):
        return means(way, segments.edges, squared=squared)
    whole, _ = means(way, np.empty(0), squared=squared)
    once = replace(options, restart=False)
    parts = np.full(segments.start.size, np.nan)
    for at, (start, end) in enumerate(zip(segments.start, segments.end, strict=True)):
        inside = samples(station, start, end)
        try:
            part = drive(station[inside], height[inside], once)
        except CoverageError:
            if segments.complete[at]:
                raise
            continue
        parts[at], _ = means(part, np.empty(0), squared=squared)
    return whole, parts
