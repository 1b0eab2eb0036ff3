"""Vertical vehicle dynamics: parameters, modes, frequency response, time response, tyre contact.

Axes follow ISO 8855: x forward, y left, z up. Heave is positive upward, roll right-handed about x,
pitch right-handed about y, that is nose-down positive. The order of the wheels is front left, front
right, rear left, rear right. Displacements count from the static equilibrium on level ground of
height 0; angles are small. Quarter car and full car follow chapter 3 of Smith, "Improving the
Quality of Terrain Measurement" (Virginia Tech, 2009), with its Eq. 3-2 corrected.
"""

from trueterrain.vehicle.contact import Tyre, contact_heights, contact_margin
from trueterrain.vehicle.model import (
    LinearModel,
    StateSpace,
    frequency_response,
    linear_model,
    state_space,
)
from trueterrain.vehicle.modes import Modes, vehicle_modes
from trueterrain.vehicle.parameters import (
    GOLDEN_QUARTER_CAR,
    FullCarParameters,
    QuarterCarParameters,
    named_vehicle,
    vehicle_names,
)
from trueterrain.vehicle.response import (
    DiscreteModel,
    Response,
    VehicleState,
    advance_response,
    discretise_model,
    simulate_response,
    start_state,
)

__all__ = [
    "GOLDEN_QUARTER_CAR",
    "DiscreteModel",
    "FullCarParameters",
    "LinearModel",
    "Modes",
    "QuarterCarParameters",
    "Response",
    "StateSpace",
    "Tyre",
    "VehicleState",
    "advance_response",
    "contact_heights",
    "contact_margin",
    "discretise_model",
    "frequency_response",
    "linear_model",
    "named_vehicle",
    "simulate_response",
    "start_state",
    "state_space",
    "vehicle_modes",
    "vehicle_names",
]
