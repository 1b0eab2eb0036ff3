"""Time response of a vehicle to wheel heights that are linear between samples.

The discretisation is exact: a matrix exponential of the model with its input, no numerical
integration. Only the linear interpolation of the ground limits the length of a step.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from trueterrain.vehicle.model import Array, LinearModel, state_space


@dataclass(frozen=True, kw_only=True, eq=False)
class DiscreteModel:
    """Discrete-time form of a model for one step length; made by `discretise_model`."""

    model: LinearModel
    "Model with n degrees of freedom and w wheels."

    step: float
    "Time between samples [s]."

    gains: Array
    "Effect of (q, q', u) before and u after a step, rows, on (q, q', q'') after it, columns."


@dataclass(frozen=True, kw_only=True, eq=False)
class VehicleState:
    """State of a vehicle at a sample, from which its motion continues."""

    displacement: Array
    "Generalised displacements, shape (n,) [m or rad]."

    velocity: Array
    "Generalised velocities, shape (n,) [m/s or rad/s]."

    acceleration: Array
    "Generalised accelerations, shape (n,) [m/s² or rad/s²]."

    wheel_heights: Array
    "Height of the ground under each wheel, shape (w,) [m]."


class Response(NamedTuple):
    """Motion of all degrees of freedom at each sample."""

    displacement: Array
    "Shape (samples, n) [m or rad]."

    velocity: Array
    "Shape (samples, n) [m/s or rad/s]."

    acceleration: Array
    "From the equations of motion, shape (samples, n) [m/s² or rad/s²]."


def discretise_model(model: LinearModel, step: float) -> DiscreteModel:
    """Discretise a model exactly, for wheel heights that are linear in time over a step.

    Parameters
    ----------
    model : LinearModel
        With n degrees of freedom and w wheels.
    step : float
        Time between samples [s].

    Returns
    -------
    DiscreteModel
        Argument of `advance_response`.

    Raises
    ------
    ValueError
        If `step` is not greater than 0.

    Notes
    -----
    The state is augmented by the wheel heights u and their change d over the step, with u' = d and
    d' = 0 in time counted in steps. One matrix exponential then holds the effect of x, u and d, and
    no matrix is inverted (Van Loan, IEEE Transactions on Automatic Control 23, 1978, pp. 395-404).

    Examples
    --------
    >>> from trueterrain.vehicle import GOLDEN_QUARTER_CAR, linear_model
    >>> discretise_model(linear_model(GOLDEN_QUARTER_CAR), 0.001).gains.shape
    (6, 6)
    """
    from scipy.linalg import expm

    if not (np.isfinite(step) and step > 0):
        message = f"step must be finite and greater than 0 s, got {step}"
        raise ValueError(message)
    A, B, C, D = state_space(model)
    states, wheels = len(A), len(model.wheels)
    of_heights, of_rates = B[:, :wheels], B[:, wheels:]
    augmented = np.zeros((states + 2 * wheels, states + 2 * wheels))
    augmented[:states] = np.hstack([A * step, of_heights * step, of_rates])
    augmented[states : states + wheels, states + wheels :] = np.eye(wheels)
    exponential = expm(augmented)[:states]
    of_before, of_change = exponential[:, states : states + wheels], exponential[:, -wheels:]

    # in terms of u before and after the step, d = u_after - u_before
    next_state = np.hstack([exponential[:, :states], of_before - of_change, of_change])
    outputs = C @ next_state
    outputs[:, states:] += np.hstack([-D[:, wheels:] / step, D[:, :wheels] + D[:, wheels:] / step])
    return DiscreteModel(model=model, step=float(step), gains=np.ascontiguousarray(outputs.T))


def start_state(
    model: LinearModel, wheel_heights: npt.ArrayLike, *, wheel_rates: npt.ArrayLike = 0.0
) -> VehicleState:
    """Equilibrium state on given wheel heights, at rest or with a constant rate.

    Parameters
    ----------
    model : LinearModel
        With n degrees of freedom and w wheels.
    wheel_heights : array_like, shape (w,)
        Height of the ground under each wheel [m].
    wheel_rates : array_like, shape (w,), optional
        Constant rate of these heights, as on a long slope [m/s].

    Returns
    -------
    VehicleState
        State without acceleration.

    Raises
    ------
    ValueError
        If there are not w wheel heights, or one is not finite.

    Examples
    --------
    A road that rises towards the front lifts the nose, and pitch is nose-down positive:

    >>> from trueterrain.vehicle import linear_model, named_vehicle
    >>> state = start_state(linear_model(named_vehicle("golden car")), [0.027, 0.027, 0.0, 0.0])
    >>> print(state.displacement[:2])
    [ 0.0135 -0.01  ]
    """
    heights = _wheel_row(model, "wheel_heights", wheel_heights, "m")
    rates = _wheel_row(model, "wheel_rates", np.broadcast_to(wheel_rates, heights.shape), "m/s")
    velocity = _at_rest(model, model.wheel_stiffness @ rates)
    force = model.wheel_stiffness @ heights + model.wheel_damping @ rates - model.damping @ velocity
    displacement = _at_rest(model, force)
    return VehicleState(
        displacement=displacement,
        velocity=velocity,
        acceleration=np.zeros_like(displacement),
        wheel_heights=heights,
    )


def advance_response(
    discrete: DiscreteModel, state: VehicleState, wheel_heights: npt.ArrayLike
) -> tuple[Response, VehicleState]:
    """Advance a state over further samples, as in processing block by block.

    Parameters
    ----------
    discrete : DiscreteModel
        Model and step.
    state : VehicleState
        At the sample before the first of `wheel_heights`.
    wheel_heights : array_like, shape (samples, w)
        Height of the ground under each wheel at the next samples [m]; of a quarter car also shape
        (samples,).

    Returns
    -------
    response : Response
        At these samples.
    state : VehicleState
        At the last of them, from which the next block continues. A run in blocks gives the same
        bits as the run in one piece.

    Raises
    ------
    ValueError
        If the shape is wrong, or a wheel height is not finite.

    Notes
    -----
    With tyre damping, the acceleration of the wheels depends on the rate of the wheel heights,
    which is discontinuous at a sample. The value just before the sample is returned; this part
    lags by half a step.

    Examples
    --------
    >>> from trueterrain.vehicle import GOLDEN_QUARTER_CAR, linear_model
    >>> model = linear_model(GOLDEN_QUARTER_CAR)
    >>> kerb = np.full(2000, 0.1)
    >>> discrete = discretise_model(model, 0.001)
    >>> response, state = advance_response(discrete, start_state(model, 0.0), kerb)
    >>> print(response.displacement[[99, 1999]].round(4))
    [[0.0592 0.0887]
     [0.1005 0.1001]]
    """
    from trueterrain.vehicle._kernels import advance_states

    model = discrete.model
    heights = _wheel_table(model, wheel_heights)
    size = len(model.freedoms)
    before = np.concatenate([state.displacement, state.velocity])
    out = np.empty((len(heights), 3 * size))
    advance_states(discrete.gains, before, np.ascontiguousarray(state.wheel_heights), heights, out)
    response = Response(out[:, :size], out[:, size : 2 * size], out[:, 2 * size :])
    if not len(heights):
        return response, state
    return response, VehicleState(
        displacement=response.displacement[-1].copy(),
        velocity=response.velocity[-1].copy(),
        acceleration=response.acceleration[-1].copy(),
        wheel_heights=heights[-1].copy(),
    )


def simulate_response(model: LinearModel, step: float, wheel_heights: npt.ArrayLike) -> Response:
    """Response to a whole record of wheel heights, from rest on the first of them.

    Parameters
    ----------
    model : LinearModel
        With n degrees of freedom and w wheels.
    step : float
        Time between samples [s].
    wheel_heights : array_like, shape (samples, w)
        Height of the ground under each wheel [m]; of a quarter car also shape (samples,).

    Returns
    -------
    Response
        At every sample, the first included.

    Raises
    ------
    ValueError
        If there is no sample, the shape is wrong, a wheel height is not finite, or `step` is not
        greater than 0.

    Examples
    --------
    >>> from trueterrain.vehicle import GOLDEN_QUARTER_CAR, linear_model
    >>> level = simulate_response(linear_model(GOLDEN_QUARTER_CAR), 0.001, np.full(500, 0.3))
    >>> print(level.displacement[-1])
    [0.3 0.3]
    """
    heights = _wheel_table(model, wheel_heights)
    if not len(heights):
        message = "wheel_heights must have at least 1 sample, got 0"
        raise ValueError(message)
    start = start_state(model, heights[0])
    rest, _ = advance_response(discretise_model(model, step), start, heights[1:])
    return Response(
        np.vstack([start.displacement, rest.displacement]),
        np.vstack([start.velocity, rest.velocity]),
        np.vstack([start.acceleration, rest.acceleration]),
    )


def _at_rest(model: LinearModel, force: Array) -> Array:
    """Static displacement under a generalised force: K q = f."""
    return np.asarray(np.linalg.solve(model.stiffness, force), dtype=float)


def _wheel_row(model: LinearModel, name: str, values: npt.ArrayLike, unit: str) -> Array:
    row = np.atleast_1d(np.asarray(values, dtype=float)).copy()
    if row.shape != (len(model.wheels),):
        message = f"{name} must have shape ({len(model.wheels)},), got {row.shape}"
        raise ValueError(message)
    for wheel, value in zip(model.wheels, row, strict=True):
        if not np.isfinite(value):
            message = f"{name} must be finite, got {value} {unit} at wheel {wheel}"
            raise ValueError(message)
    return row


def _wheel_table(model: LinearModel, values: npt.ArrayLike) -> Array:
    wheels = len(model.wheels)
    table = np.ascontiguousarray(values, dtype=float)
    if table.ndim == 1 and wheels == 1:
        table = table[:, None]
    if table.ndim != 2 or table.shape[1] != wheels:
        message = f"wheel_heights must have shape (samples, {wheels}), got {table.shape}"
        raise ValueError(message)
    if not np.isfinite(table).all():
        sample, wheel = np.argwhere(~np.isfinite(table))[0]
        message = (
            f"wheel_heights must be finite, got {table[sample, wheel]} m at sample {sample}, "
            f"wheel {model.wheels[wheel]}"
        )
        raise ValueError(message)
    return table
