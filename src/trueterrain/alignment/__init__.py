"""Alignment: passes over the same ground brought into agreement (thesis 4.3.1, 4.4).

==================  ==============================================================================
`merge`             compares passes, aligns them by one of the methods, compares them again
`run_passes`        the same for recorded runs: corrects their trajectories
`clouds`            the same for point clouds: corrects their points
`apply`             applies corrections to a trajectory or to points
`observations`      cells of a common grid as each pass saw them, and overlaps
`adjustment`        least-squares adjustment of all passes; corrections are splines of time
`discontinuity`     discontinuity vectors along reference paths (thesis 4.3.1); steps at the edges
                    of overlaps
==================  ==============================================================================
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from trueterrain.alignment.adjustment.agreement import (
        LoopClosure,
        PairAgreement,
        PassDriftTest,
        ScreenedDifferences,
    )
    from trueterrain.alignment.adjustment.network import (
        AdjustedGround,
        Adjustment,
        RejectedCells,
        adjust_passes,
    )
    from trueterrain.alignment.adjustment.spline import (
        GaussMarkovProcess,
        SplineCorrection,
        SplineKnots,
    )
    from trueterrain.alignment.observations.cells import PassCells, make_pass_cells
    from trueterrain.alignment.observations.collection import cells_of_points, cells_of_run
    from trueterrain.alignment.settings import CellSettings, ModelTrial, NetworkSettings

# modules compile kernels and load scipy, so each is imported when one of its names is used
_MODULES = {
    "trueterrain.alignment.adjustment.agreement": (
        "LoopClosure",
        "PairAgreement",
        "PassDriftTest",
        "ScreenedDifferences",
    ),
    "trueterrain.alignment.adjustment.network": (
        "AdjustedGround",
        "Adjustment",
        "RejectedCells",
        "adjust_passes",
    ),
    "trueterrain.alignment.adjustment.spline": (
        "GaussMarkovProcess",
        "SplineCorrection",
        "SplineKnots",
    ),
    "trueterrain.alignment.observations.cells": ("PassCells", "make_pass_cells"),
    "trueterrain.alignment.observations.collection": ("cells_of_points", "cells_of_run"),
    "trueterrain.alignment.settings": ("CellSettings", "ModelTrial", "NetworkSettings"),
}
_LAZY = {name: module for module, names in _MODULES.items() for name in names}

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
    "make_pass_cells",
]


def __getattr__(name: str) -> Any:
    """Import the module of a public name."""
    if name not in _LAZY:
        message = f"module {__name__!r} has no attribute {name!r}"
        raise AttributeError(message)
    return getattr(import_module(_LAZY[name]), name)
