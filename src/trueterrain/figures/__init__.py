"""Figures: ``f(data, ..., ax=None) -> Axes``, for paper, screen and documentation alike.

Every figure names its quantities and units, prints its scale (equal, stretched, or the vertical
exaggeration), uses colours that colour-blind people can tell apart, and keeps its legend off the
data. Without ``ax`` a new figure is made; ``save`` writes it, whole or not at all.
"""

from trueterrain.figures.agreement import agreement_matrix, agreement_overlay
from trueterrain.figures.continuous import continuous_roughness
from trueterrain.figures.cpf import cpf
from trueterrain.figures.difference import profile_difference
from trueterrain.figures.drift import navigation_errors
from trueterrain.figures.envelope import tyre_envelopes
from trueterrain.figures.evenness import straightedge_deviation, waveband_segments
from trueterrain.figures.event import cleat_crossing, event_plan, event_side, event_waves
from trueterrain.figures.event_curves import (
    cleat_ratios,
    hop_gain,
    mode_shares,
    passage_gains,
    vehicle_gain,
)
from trueterrain.figures.iri import iri_segments
from trueterrain.figures.lanes_choice import correction_spectrum, strength_choice
from trueterrain.figures.lanes_correction import lane_correction
from trueterrain.figures.lanes_discontinuity import discontinuity_vectors, lane_histograms
from trueterrain.figures.lanes_map import discrepancy_map, lane_overlap
from trueterrain.figures.lanes_seam import seam_steps
from trueterrain.figures.motion import body_motion, laser_displacement
from trueterrain.figures.names import draw_names, head_figure
from trueterrain.figures.navigation import navigation_heights, navigation_plan
from trueterrain.figures.output import require_picture, save
from trueterrain.figures.parallel import parallel_profiles
from trueterrain.figures.plate import plate_plan, plate_section, plate_view
from trueterrain.figures.points import points_map
from trueterrain.figures.profiles import profiles
from trueterrain.figures.psd import road_spectrum
from trueterrain.figures.ranges import range_image
from trueterrain.figures.relief import surface_relief
from trueterrain.figures.ride_number import ride_number_segments
from trueterrain.figures.roughness_histogram import roughness_histogram
from trueterrain.figures.scan import scan_elevation, scan_plan
from trueterrain.figures.search import search_area_map
from trueterrain.figures.slope import measurable_slope
from trueterrain.figures.spectrum import spectrum
from trueterrain.figures.surface import surface_map
from trueterrain.figures.surface_difference import difference_map, structure_functions
from trueterrain.figures.verify import (
    drift_errors,
    drift_growth,
    motion_rejection,
    place_spread,
    plate_error,
    plate_errors,
    plate_profile,
)

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
    "lane_correction",
    "lane_histograms",
    "lane_overlap",
    "laser_displacement",
    "measurable_slope",
    "mode_shares",
    "motion_rejection",
    "navigation_errors",
    "navigation_heights",
    "navigation_plan",
    "parallel_profiles",
    "passage_gains",
    "place_spread",
    "plate_error",
    "plate_errors",
    "plate_plan",
    "plate_profile",
    "plate_section",
    "plate_view",
    "points_map",
    "profile_difference",
    "profiles",
    "range_image",
    "require_picture",
    "ride_number_segments",
    "road_spectrum",
    "roughness_histogram",
    "save",
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
