"""Navigation: position and attitude of the body at each epoch.

All readers return the same dataset with the dimension ``epoch``: ``time`` [s]; ``east``, ``north``,
``up`` [m] in the local frame of ``attrs["origin"]``; ``roll``, ``pitch``, ``yaw`` [rad]; where
known ``sd_east``, ``sd_north``, ``sd_up`` [m] and ``sd_roll``, ``sd_pitch``, ``sd_yaw`` [rad].

Angles follow ISO 8855: body x forward, y left, z up; ground east, north, up; body to ground is
Rz(yaw) Ry(pitch) Rx(roll), so that pitch is nose-down positive and yaw counter-clockwise from east.
Every other convention is converted here, once.

=================  ==============================================================================
`read_sbet`        Applanix smoothed best estimate of trajectory (17 doubles per record)
`read_smrmsg`      Applanix accuracy of it (10 doubles per record)
`read_boreas`      poses of the Boreas data set (CSV)
`read_columns`     CSV or Parquet; `NavigationColumns` names the columns and conventions
=================  ==============================================================================
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from trueterrain.core.schemas.navigation import check_navigation, make_navigation
    from trueterrain.formats.navigation.boreas import read as read_boreas
    from trueterrain.formats.navigation.columns import NavigationColumns
    from trueterrain.formats.navigation.columns import read as read_columns
    from trueterrain.formats.navigation.sbet import read as read_sbet
    from trueterrain.formats.navigation.smrmsg import add_accuracy
    from trueterrain.formats.navigation.smrmsg import read as read_smrmsg

__all__ = [
    "NavigationColumns",
    "add_accuracy",
    "check_navigation",
    "make_navigation",
    "read_boreas",
    "read_columns",
    "read_sbet",
    "read_smrmsg",
]

# module and name of each public object; modules are imported on first use, to keep imports fast
_SOURCES = {
    "NavigationColumns": ("formats.navigation.columns", "NavigationColumns"),
    "add_accuracy": ("formats.navigation.smrmsg", "add_accuracy"),
    "check_navigation": ("core.schemas.navigation", "check_navigation"),
    "make_navigation": ("core.schemas.navigation", "make_navigation"),
    "read_boreas": ("formats.navigation.boreas", "read"),
    "read_columns": ("formats.navigation.columns", "read"),
    "read_sbet": ("formats.navigation.sbet", "read"),
    "read_smrmsg": ("formats.navigation.smrmsg", "read"),
}


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used."""
    if name not in _SOURCES:
        message = f"module {__name__!r} has no attribute {name!r}"
        raise AttributeError(message)
    module, attribute = _SOURCES[name]
    return getattr(importlib.import_module(f"trueterrain.{module}"), attribute)
