"""Newton's law for the full car, part by part: the independent truth of its matrices."""

from collections.abc import Callable

import numpy as np
import pytest


def newton_accelerations(car, displacement, velocity, heights, rates) -> np.ndarray:
    """Acceleration of the seven freedoms from the force of every part, without a matrix."""
    heave, pitch, roll, *wheels = displacement
    heave_rate, pitch_rate, roll_rate, *wheel_rates = velocity
    body_force = pitch_moment = roll_moment = 0.0
    wheel_accelerations = []
    for wheel, place in enumerate(("front left", "front right", "rear left", "rear right")):
        axle, side = place.split()
        x = car.front_axle if axle == "front" else -car.rear_axle
        track = getattr(car, f"{axle}_track")
        y = track / 2 if side == "left" else -track / 2

        # forces upwards on the body (suspension) and on the wheel (tyre less suspension)
        above = heave - x * pitch + y * roll
        above_rate = heave_rate - x * pitch_rate + y * roll_rate
        suspension = getattr(car, f"{axle}_suspension_stiffness") * (wheels[wheel] - above)
        suspension += getattr(car, f"{axle}_suspension_damping") * (wheel_rates[wheel] - above_rate)
        tyre = getattr(car, f"{axle}_tyre_stiffness") * (heights[wheel] - wheels[wheel])
        tyre += getattr(car, f"{axle}_tyre_damping") * (rates[wheel] - wheel_rates[wheel])

        # the bar turns the body towards the axle, and presses on the wheels at its ends
        first = 0 if axle == "front" else 2
        axle_roll = (wheels[first] - wheels[first + 1]) / track
        bar_moment = getattr(car, f"{axle}_anti_roll_stiffness") * (axle_roll - roll)
        bar_force = -bar_moment / track if side == "left" else bar_moment / track

        body_force += suspension
        pitch_moment += -x * suspension  # about the axis to the left, by a force upwards at x
        roll_moment += y * suspension
        if side == "left":
            roll_moment += bar_moment
        mass = getattr(car, f"{axle}_unsprung_mass")
        wheel_accelerations.append((tyre - suspension + bar_force) / mass)
    return np.array(
        [
            body_force / car.sprung_mass,
            pitch_moment / car.pitch_inertia,
            roll_moment / car.roll_inertia,
            *wheel_accelerations,
        ]
    )


@pytest.fixture(scope="session")
def newton() -> Callable[..., np.ndarray]:
    """Acceleration of (car, displacement, velocity, heights, rates)."""
    return newton_accelerations
