"""Lanes: many passes over one road, brought into agreement (thesis 4.3.1, 4.4).

==================  =============================================================================
`merge`             passes compared, brought into agreement by one of the methods, compared again
`runs`, `clouds`    the same for recorded runs and for point clouds
`apply`             corrections taken to the motion of a run, or to points
`cells`             what each pass saw of the cells of a common grid
`network`           one least-squares adjustment of all passes at once
`spline`            corrections that follow time or station, and how much they may wander
`discontinuity`     discontinuity vectors along reference paths (thesis 4.3.1)
`overlap`           what two lanes both cover
`reference_path`    paths through it
==================  =============================================================================
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from trueterrain.alignment.adjustment.network import (
        AdjustedGround,
        Adjustment,
        LoopClosure,
        ModelTrial,
        NetworkSettings,
        PairAgreement,
        PassDriftTest,
        RejectedCells,
        ScreenedDifferences,
        adjust_passes,
    )
    from trueterrain.alignment.adjustment.spline import (
        GaussMarkovProcess,
        SplineCorrection,
        SplineKnots,
    )
    from trueterrain.alignment.observations.cells import (
        PassCells,
        cells_of_points,
        cells_of_run,
        lane_cells,
    )
    from trueterrain.alignment.settings import CellSettings

# names whose modules need more, and are imported when they are used
_LATER = {
    "Adjustment": "network",
    "CellOptions": "_settings",
    "Correction": "spline",
    "Differences": "network",
    "DriftTest": "network",
    "Knots": "spline",
    "LaneCells": "cells",
    "LoopClosure": "network",
    "NetworkSettings": "network",
    "PairAgreement": "network",
    "RejectedCells": "network",
    "SharedGround": "network",
    "Trial": "network",
    "Wander": "spline",
    "adjust": "network",
    "cells_of_points": "cells",
    "cells_of_run": "cells",
    "lane_cells": "cells",
}

__all__ = [
    "AdjustedGround",
    "Adjustment",
    "CellSettings",
    "GaussMarkovProcess",
    "LoopClosure",
    "ModelTrial",
    "NetworkSettings",
    "PairAgreement",
    "PassCells",
    "PassDriftTest",
    "RejectedCells",
    "ScreenedDifferences",
    "SplineCorrection",
    "SplineKnots",
    "adjust_passes",
    "cells_of_points",
    "cells_of_run",
    "lane_cells",
]


def __getattr__(name: str) -> Any:
    """Name from the module that it lives in."""
    if name not in _LATER:
        message = f"module {__name__!r} has no attribute {name!r}"
        raise AttributeError(message)
    return getattr(import_module(f"{__name__}.{_LATER[name]}"), name)
