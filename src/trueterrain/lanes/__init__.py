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
    from trueterrain.lanes._settings import CellOptions
    from trueterrain.lanes.cells import LaneCells, cells_of_points, cells_of_run, lane_cells
    from trueterrain.lanes.network import (
        Adjustment,
        Differences,
        DriftTest,
        LoopClosure,
        NetworkSettings,
        PairAgreement,
        RejectedCells,
        SharedGround,
        Trial,
        adjust,
    )
    from trueterrain.lanes.spline import Correction, Knots, Wander

# names whose modules need more, and are imported when they are used
_LATER = {
    "Adjustment": "network", "CellOptions": "_settings", "Correction": "spline",
    "Differences": "network", "DriftTest": "network", "Knots": "spline", "LaneCells": "cells",
    "LoopClosure": "network", "NetworkSettings": "network", "PairAgreement": "network",
    "RejectedCells": "network", "SharedGround": "network", "Trial": "network",
    "Wander": "spline", "adjust": "network", "cells_of_points": "cells", "cells_of_run": "cells",
    "lane_cells": "cells",
}  # fmt: skip

__all__ = [
    "Adjustment",
    "CellOptions",
    "Correction",
    "Differences",
    "DriftTest",
    "Knots",
    "LaneCells",
    "LoopClosure",
    "NetworkSettings",
    "PairAgreement",
    "RejectedCells",
    "SharedGround",
    "Trial",
    "Wander",
    "adjust",
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
