"""Linear equations of motion of vehicles on wheel heights: M q'' + C q' + K q = Ku u + Cu u'."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from trueterrain.vehicle.parameters import FullCarParameters, QuarterCarParameters

Array = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]


@dataclass(frozen=True, kw_only=True, eq=False)
class LinearModel:
    """Matrices of M q'' + C q' + K q = Ku u + Cu u' for n degrees of freedom q and w heights u.

    Examples
    --------
    >>> from trueterrain.vehicle import GOLDEN_QUARTER_CAR
    >>> model = linear_model(GOLDEN_QUARTER_CAR)
    >>> model.freedoms, model.wheels
    (('heave', 'wheel'), ('wheel',))
    >>> print(model.stiffness / model.mass[0, 0])
    [[ 63.3 -63.3]
     [-63.3 716.3]]
    """

    freedoms: tuple[str, ...]
    "Names of the n degrees of freedom."

    units: tuple[str, ...]
    "Units of the degrees of freedom, m or rad."

    wheels: tuple[str, ...]
    "Names of the w wheels."

    mass: Array
    "M, shape (n, n) [kg, kg m²]."

    damping: Array
    "C, shape (n, n) [N s/m, N s, N m s]."

    stiffness: Array
    "K, shape (n, n) [N/m, N, N m]."

    wheel_stiffness: Array
    "Ku: generalised force over wheel height, shape (n, w) [N/m]."

    wheel_damping: Array
    "Cu: generalised force over rate of wheel height, shape (n, w) [N s/m]."

    mode_names: tuple[str, ...]
    "Names of the n modes; `vehicle_modes` gives each to the mode that best fits its pattern."

    mode_patterns: Array
    "Pure motions, such as all heave or all pitch, shape (n, n), one per row."


class StateSpace(NamedTuple):
    """State space form x' = A x + B (u, u') and (q, q', q'') = C x + D (u, u') with x = (q, q')."""

    A: Array
    "Shape (2n, 2n)."

    B: Array
    "Shape (2n, 2w)."

    C: Array
    "Shape (3n, 2n)."

    D: Array
    "Shape (3n, 2w)."


def linear_model(parameters: QuarterCarParameters | FullCarParameters) -> LinearModel:
    """Linear model of a quarter car or a full car, with 2 or 7 degrees of freedom.

    Parameters
    ----------
    parameters : QuarterCarParameters or FullCarParameters
        The vehicle.

    Returns
    -------
    LinearModel
        Quarter car: heave of the body and height of the wheel. Full car: heave, pitch and roll of
        the body at its centre of gravity, and the heights of the four wheels.

    Notes
    -----
    Each spring and damper has an elongation e = J (q, u). With the stiffnesses on the diagonal of
    k, the potential energy eᵀ k e / 2 gives [K, -Ku] as the rows of Jᵀ k J that belong to q;
    damping follows likewise. The body at (x, y) has the height heave - x pitch + y roll. An
    anti-roll bar twists by roll - (left wheel - right wheel) / track. Weight and static deflection
    cancel.

    In Eq. 3-2 of Smith (2009), the damper acts on the wheel as if the body were at rest: the term
    with the velocity of the body is missing. Its Eq. 3-3 has this term, and so has this model.

    Examples
    --------
    >>> from trueterrain.vehicle import named_vehicle
    >>> linear_model(named_vehicle("van")).freedoms[:4]
    ('heave', 'pitch', 'roll', 'front-left')
    """
    if isinstance(parameters, QuarterCarParameters):
        return _quarter_car(parameters)
    return _full_car(parameters)


def _quarter_car(car: QuarterCarParameters) -> LinearModel:
    elongation = np.array([[1.0, -1.0, 0.0], [0.0, 1.0, -1.0]])  # of suspension and tyre
    damping, wheel_damping = _assemble_matrices(
        elongation, [car.suspension_damping, car.tyre_damping], 2
    )
    stiffness, wheel_stiffness = _assemble_matrices(
        elongation, [car.suspension_stiffness, car.tyre_stiffness], 2
    )
    return LinearModel(
        freedoms=("heave", "wheel"),
        units=("m", "m"),
        wheels=("wheel",),
        mass=np.diag([car.sprung_mass, car.unsprung_mass]),
        damping=damping,
        stiffness=stiffness,
        wheel_stiffness=wheel_stiffness,
        wheel_damping=wheel_damping,
        mode_names=("heave", "hop"),
        mode_patterns=np.eye(2),
    )


def _full_car(car: FullCarParameters) -> LinearModel:
    wheels = ("front-left", "front-right", "rear-left", "rear-right")
    x, y = car.wheel_positions.T
    elongation = np.zeros((10, 11))  # of 4 suspensions, 4 tyres, 2 bars; by 7 freedoms, 4 heights
    for wheel in range(4):
        elongation[wheel, [0, 1, 2, 3 + wheel]] = 1.0, -x[wheel], y[wheel], -1.0
        elongation[4 + wheel, [3 + wheel, 7 + wheel]] = 1.0, -1.0
    elongation[8, [2, 3, 4]] = 1.0, -1 / car.front_track, 1 / car.front_track
    elongation[9, [2, 5, 6]] = 1.0, -1 / car.rear_track, 1 / car.rear_track

    damping, wheel_damping = _assemble_matrices(
        elongation,
        [
            *_per_wheel(car.front_suspension_damping, car.rear_suspension_damping),
            *_per_wheel(car.front_tyre_damping, car.rear_tyre_damping),
            0.0,
            0.0,
        ],
        7,
    )
    stiffness, wheel_stiffness = _assemble_matrices(
        elongation,
        [
            *_per_wheel(car.front_suspension_stiffness, car.rear_suspension_stiffness),
            *_per_wheel(car.front_tyre_stiffness, car.rear_tyre_stiffness),
            car.front_anti_roll_stiffness,
            car.rear_anti_roll_stiffness,
        ],
        7,
    )
    unsprung = _per_wheel(car.front_unsprung_mass, car.rear_unsprung_mass)
    patterns = np.eye(7)
    patterns[3:, 3:] = [[1, 1, 0, 0], [0, 0, 1, 1], [1, -1, 0, 0], [0, 0, 1, -1]]
    return LinearModel(
        freedoms=("heave", "pitch", "roll", *wheels),
        units=("m", "rad", "rad", "m", "m", "m", "m"),
        wheels=wheels,
        mass=np.diag([car.sprung_mass, car.pitch_inertia, car.roll_inertia, *unsprung]),
        damping=damping,
        stiffness=stiffness,
        wheel_stiffness=wheel_stiffness,
        wheel_damping=wheel_damping,
        mode_names=(
            "heave",
            "pitch",
            "roll",
            "front hop",
            "rear hop",
            "front tramp",
            "rear tramp",
        ),
        mode_patterns=patterns,
    )


def _per_wheel(front: float, rear: float) -> list[float]:
    return [front, front, rear, rear]


def _assemble_matrices(
    elongation: Array, coefficients: list[float], freedoms: int
) -> tuple[Array, Array]:
    """Matrix of the degrees of freedom, and that of the wheel heights on the right-hand side."""
    whole = elongation[:, :freedoms].T @ (np.array(coefficients)[:, None] * elongation)
    return whole[:, :freedoms], -whole[:, freedoms:]


def state_space(model: LinearModel) -> StateSpace:
    """State space form of a model, with displacement, velocity and acceleration as output.

    Parameters
    ----------
    model : LinearModel
        With n degrees of freedom and w wheels.

    Returns
    -------
    StateSpace
        A (2n, 2n), B (2n, 2w), C (3n, 2n), D (3n, 2w) of x' = A x + B (u, u') and
        (q, q', q'') = C x + D (u, u'); u are the wheel heights [m], u' their rates [m/s], which
        enter through tyre damping only.

    Examples
    --------
    >>> from trueterrain.vehicle import GOLDEN_QUARTER_CAR
    >>> A, B, C, D = state_space(linear_model(GOLDEN_QUARTER_CAR))
    >>> print(A[2].round(6))
    [-63.3  63.3  -6.    6. ]
    >>> print(B[3].round(6))
    [4353.33  0. ]
    """
    size = len(model.freedoms)
    accelerations = np.linalg.solve(
        model.mass,
        np.hstack([-model.stiffness, -model.damping, model.wheel_stiffness, model.wheel_damping]),
    )
    of_state, of_wheels = accelerations[:, : 2 * size], accelerations[:, 2 * size :]
    A = np.vstack([np.eye(size, 2 * size, k=size), of_state])
    B = np.vstack([np.zeros((size, of_wheels.shape[1])), of_wheels])
    C = np.vstack([np.eye(2 * size), of_state])
    D = np.vstack([np.zeros((2 * size, of_wheels.shape[1])), of_wheels])
    return StateSpace(A, B, C, D)


def frequency_response(model: LinearModel, frequency: npt.ArrayLike) -> ComplexArray:
    """Frequency response function: amplitude and phase of all degrees of freedom per wheel height.

    Parameters
    ----------
    model : LinearModel
        With n degrees of freedom and w wheels.
    frequency : array_like
        At least 0 [Hz].

    Returns
    -------
    numpy.ndarray, shape (..., n, w)
        Displacement over wheel height, complex [m/m or rad/m]; multiply by 2 pi i f for velocities,
        twice for accelerations. The phase is positive where the displacement leads.

    Raises
    ------
    ValueError
        If a frequency is negative or not finite.

    Notes
    -----
    H = (K + i w C - w² M)^-1 (Ku + i w Cu), w = 2 pi f.

    Examples
    --------
    >>> from trueterrain.vehicle import GOLDEN_QUARTER_CAR
    >>> gain = abs(frequency_response(linear_model(GOLDEN_QUARTER_CAR), [0.0, 1.2, 11.0]))
    >>> print(gain[:, 0, 0].round(3))
    [1.    1.911 0.136]
    """
    f = np.asarray(frequency, dtype=float)
    if not (np.isfinite(f) & (f >= 0)).all():
        message = f"frequency must be finite and at least 0 Hz, got {frequency!r}"
        raise ValueError(message)
    s = 2j * np.pi * f[..., None, None]
    return np.linalg.solve(
        model.stiffness + s * model.damping + s**2 * model.mass,
        model.wheel_stiffness + s * model.wheel_damping,
    ).astype(np.complex128, copy=False)
