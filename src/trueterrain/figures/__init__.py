"""Figures: ``f(data, ..., ax=None) -> Axes``, for paper, screen and documentation.

Each figure labels its quantities and units, prints its scale (equal, stretched, or the vertical
exaggeration), uses colours that colour-blind people can distinguish, and has its legend outside of
the data. Without ``ax`` a new figure is created; `save_figure` writes it, whole or not at all.
"""

import warnings
from typing import Any

from trueterrain.figures.accuracy.event import cleat_crossing, event_plan, event_side, event_waves
from trueterrain.figures.accuracy.event_curves import (
    cleat_ratios,
    hop_gain,
    mode_energies,
    passage_gains,
    vehicle_gain,
)
from trueterrain.figures.accuracy.plate import plate_plan, plate_section, plate_view
from trueterrain.figures.accuracy.results import (
    drift_errors,
    drift_growth,
    motion_rejection,
    plate_error,
    plate_errors,
    plate_profile,
    position_sensitivity,
)
from trueterrain.figures.alignment.correction import pass_correction
from trueterrain.figures.alignment.discontinuity import discontinuity_vectors, pass_histograms
from trueterrain.figures.alignment.map import discrepancy_map, overlap_map
from trueterrain.figures.alignment.model_choice import correction_spectrum, strength_choice
from trueterrain.figures.alignment.seam import seam_steps
from trueterrain.figures.names import draw_names, head_figure
from trueterrain.figures.output import require_picture, save_figure
from trueterrain.figures.profile.cpf import cpf
from trueterrain.figures.profile.difference import profile_difference
from trueterrain.figures.profile.envelope import tyre_envelopes
from trueterrain.figures.profile.parallel_lines import parallel_profiles
from trueterrain.figures.profile.profiles import profiles
from trueterrain.figures.profile.search_areas import search_area_map
from trueterrain.figures.roughness.agreement import agreement_matrix, agreement_overlay
from trueterrain.figures.roughness.continuous_iri import continuous_roughness
from trueterrain.figures.roughness.evenness import straightedge_deviation
from trueterrain.figures.roughness.histogram import roughness_histogram
from trueterrain.figures.roughness.psd import road_spectrum
from trueterrain.figures.roughness.segments import (
    iri_segments,
    ride_number_segments,
    waveband_segments,
)
from trueterrain.figures.run.drift import navigation_errors
from trueterrain.figures.run.motion import body_motion, laser_displacement
from trueterrain.figures.run.navigation import navigation_heights, navigation_plan
from trueterrain.figures.run.ranges import range_image
from trueterrain.figures.run.scan import scan_elevation, scan_plan
from trueterrain.figures.run.spectrum import spectrum
from trueterrain.figures.surface.difference import difference_map, structure_functions
from trueterrain.figures.surface.heights import surface_map
from trueterrain.figures.surface.points import points_map
from trueterrain.figures.surface.relief import surface_relief
from trueterrain.figures.surface.slope import measurable_slope

# Names of earlier versions, kept for one release, and those that replace them.
_RENAMED = {
    "lane_correction": "pass_correction",
    "lane_histograms": "pass_histograms",
    "lane_overlap": "overlap_map",
    "mode_shares": "mode_energies",
    "place_spread": "position_sensitivity",
}

__all__ = [
    "agreement_matrix",
    "agreement_overlay",
    "body_motion",
    "cleat_crossing",
    "cleat_ratios",
    "continuous_roughness",
    "correction_spectrum",
    "cpf",
    "difference_map",
    "discontinuity_vectors",
    "discrepancy_map",
    "draw_names",
    "drift_errors",
    "drift_growth",
    "event_plan",
    "event_side",
    "event_waves",
    "head_figure",
    "hop_gain",
    "iri_segments",
    "laser_displacement",
    "measurable_slope",
    "mode_energies",
    "motion_rejection",
    "navigation_errors",
    "navigation_heights",
    "navigation_plan",
    "overlap_map",
    "parallel_profiles",
    "pass_correction",
    "pass_histograms",
    "passage_gains",
    "plate_error",
    "plate_errors",
    "plate_plan",
    "plate_profile",
    "plate_section",
    "plate_view",
    "points_map",
    "position_sensitivity",
    "profile_difference",
    "profiles",
    "range_image",
    "require_picture",
    "ride_number_segments",
    "road_spectrum",
    "roughness_histogram",
    "save_figure",
    "scan_elevation",
    "scan_plan",
    "seam_steps",
    "search_area_map",
    "spectrum",
    "straightedge_deviation",
    "strength_choice",
    "structure_functions",
    "surface_map",
    "surface_relief",
    "tyre_envelopes",
    "vehicle_gain",
    "waveband_segments",
]


def __getattr__(name: str) -> Any:
    if name not in _RENAMED:
        message = f"module {__name__!r} has no attribute {name!r}"
        raise AttributeError(message)
    new = _RENAMED[name]
    text = f"tt.figures.{name} is tt.figures.{new} now; the old name goes with the next release."
    warnings.warn(text, DeprecationWarning, stacklevel=2)
    return globals()[new]
