"""Events in the frequency domain: excitation of the axles, response of the modes, speed sweeps."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from trueterrain.vehicle import FullCarParameters, frequency_response, linear_model

Floats = npt.NDArray[np.float64]

_MAX_SPEEDS = 1000


class PassageGain(NamedTuple):
    """Gain of body and axles over ground that is equal on the left and the right."""

    heave: Floats
    "Heave of the body at its centre of gravity over the amplitude of the ground [m/m]."

    pitch: Floats
    "Pitch of the body times half the wheelbase, the motion above the axles [m/m]."

    front_hop: Floats
    "Displacement of the front axle [m/m]."

    rear_hop: Floats
    "Displacement of the rear axle [m/m]."


def wheelbase_filter(
    frequency: npt.ArrayLike, speed: float, wheelbase: float
) -> tuple[Floats, Floats]:
    """Wheelbase filter: fractions of the ground that lift both axles in phase and in antiphase.

    Parameters
    ----------
    frequency : array_like
        Frequencies [Hz].
    speed : float
        Speed [m/s].
    wheelbase : float
        Distance between the axles [m].

    Returns
    -------
    heave, pitch : numpy.ndarray
        Half the sum and half the difference of the heights under the axles, over the amplitude of
        the ground: ``|cos(pi f B / V)|`` and ``|sin(pi f B / V)|`` [m/m].

    Raises
    ------
    ValueError
        If speed or wheelbase is not greater than 0.

    Examples
    --------
    A wave as long as the wheelbase causes heave only, one twice as long pitch only:

    >>> heave, pitch = wheelbase_filter([2.0, 1.0], 5.0, 2.5)
    >>> print(heave.round(9), pitch.round(9))
    [1. 0.] [0. 1.]
    """
    _check_positive("m/s", speed=speed)
    _check_positive("m", wheelbase=wheelbase)
    phase = np.pi * np.asarray(frequency, dtype=float) * wheelbase / speed
    return np.abs(np.cos(phase)), np.abs(np.sin(phase))


def event_spectrum(
    frequency: npt.ArrayLike,
    speed: float,
    *,
    number: int,
    spacing: float,
    width: float,
    rise: float,
    base: float = 0.0,
    patch_length: float = 0.15,
) -> Floats:
    """Amplitude spectrum of the height that a wheel crosses, as a function of time.

    Parameters
    ----------
    frequency : array_like
        Frequencies [Hz].
    speed : float
        Speed [m/s].
    number : int
        Number of cleats.
    spacing, width, rise, base : float
        Spacing, width and height of the cleats, thickness of the board below them [m].
    patch_length : float
        Length of the tyre's contact patch, which averages heights [m].

    Returns
    -------
    numpy.ndarray
        Modulus of the Fourier transform [m s].

    Raises
    ------
    ValueError
        If speed, number, spacing or width is not greater than 0.

    Notes
    -----
    Spectrum of n rectangles: rise w/V sinc(f w/V) sin(pi n f a/V) / sin(pi f a/V), plus
    base n a/V sinc(f n a/V) of the board, both times sinc(f b/V) of the patch, with
    sinc(x) = sin(pi x)/(pi x).

    Examples
    --------
    At low frequencies it is the area under the event, over the speed:

    >>> float(event_spectrum(0.0, 5.0, number=5, spacing=0.5, width=0.2, rise=0.04).round(6))
    0.008
    """
    _check_positive("m/s", speed=speed)
    _check_positive("m", number=number, spacing=spacing, width=width)
    waves = np.asarray(frequency, dtype=float) / speed  # [1/m]
    centres = (np.arange(number) - 0.5 * (number - 1)) * spacing
    comb = np.cos(2 * np.pi * waves[..., None] * centres).sum(axis=-1)
    cleats = rise * width * np.sinc(waves * width) * comb
    board = base * number * spacing * np.sinc(waves * number * spacing)
    out: Floats = np.abs((cleats + board) * np.sinc(waves * patch_length)) / speed
    return out


def passage_gain(car: FullCarParameters, frequency: npt.ArrayLike, speed: float) -> PassageGain:
    """Frequency response of a vehicle at a speed to ground equal on the left and the right.

    Parameters
    ----------
    car : FullCarParameters
        The vehicle.
    frequency : array_like, shape (n,)
        Frequencies [Hz].
    speed : float
        Speed [m/s].

    Returns
    -------
    PassageGain
        Amplitudes over that of the ground.

    Raises
    ------
    ValueError
        If the speed is not greater than 0, or a frequency is negative.

    Notes
    -----
    The rear wheels follow after the time B / V, a phase of -2 pi f B / V. The result includes the
    wheelbase filter and the coupling of heave and pitch.

    Examples
    --------
    >>> from trueterrain.vehicle import named_vehicle
    >>> car = named_vehicle("golden car")
    >>> gain = passage_gain(car, [1.2], 2.4)  # the wave is 2 m long, the wheelbase 2.7 m
    >>> print(gain.heave, gain.pitch)
    [0.867] [1.663]
    """
    _check_positive("m/s", speed=speed)
    f = np.asarray(frequency, dtype=float)
    model = linear_model(car)
    lag = np.exp(-2j * np.pi * f * car.wheelbase / speed)
    one = np.ones_like(lag)
    wheels = np.stack([one, one, lag, lag], axis=-1)
    moved = np.abs(np.einsum("...ij,...j->...i", frequency_response(model, f), wheels))
    index = model.freedoms.index
    return PassageGain(
        heave=moved[..., index("heave")],
        pitch=moved[..., index("pitch")] * car.wheelbase / 2,
        front_hop=moved[..., index("front-left")],
        rear_hop=moved[..., index("rear-left")],
    )


def covering_speeds(low: float, high: float, *, number: int, spacing: float) -> Floats:
    """Speeds at which an event excites a band of frequencies without a gap.

    Parameters
    ----------
    low, high : float
        The band, such as 9 to 14 Hz around wheel hop [Hz].
    number : int
        Number of cleats of the event.
    spacing : float
        Distance between neighbouring cleats [m].

    Returns
    -------
    numpy.ndarray
        Ascending [m/s].

    Raises
    ------
    ValueError
        If the band is empty, or there are fewer than two cleats.

    Notes
    -----
    At the speed V, the n cleats excite the frequency V / a, and with at least half of that power
    the frequencies within about 0.45 / n of it. The bands of neighbouring speeds touch. Each speed
    also moves the notches of the wheelbase filter.

    Examples
    --------
    >>> print(covering_speeds(9.0, 14.0, number=5, spacing=0.488).round(2))
    [4.83 5.78 6.93]
    """
    if not 0 < low < high < math.inf:
        message = f"low and high must be frequencies above 0 Hz in order, got {low} and {high}."
        raise ValueError(message)
    if number < 2:
        message = f"number must be at least 2 cleats, got {number}."
        raise ValueError(message)
    _check_positive("m", spacing=spacing)
    half = half_power(number)
    speeds = [low * spacing / (1 - half)]
    while speeds[-1] * (1 + half) < high * spacing:
        speeds.append(speeds[-1] * (1 + half) / (1 - half))
        if len(speeds) > _MAX_SPEEDS:
            message = f"low to high must be covered by at most {_MAX_SPEEDS} speeds."
            raise ValueError(message)
    return np.array(speeds)


def half_power(number: int) -> float:
    """Half width at half power of the spectral line of n cleats, relative to its frequency."""
    from scipy.optimize import brentq

    def above_half(x: float) -> float:
        return float(np.sin(np.pi * number * x) / (number * np.sin(np.pi * x))) - math.sqrt(0.5)

    return float(brentq(above_half, 1e-9, 1 / number))


def _check_positive(unit: str, **values: float) -> None:
    for name, value in values.items():
        if not 0 < value < math.inf:
            message = f"{name} must be finite and greater than 0 {unit}, got {value}."
            raise ValueError(message)
