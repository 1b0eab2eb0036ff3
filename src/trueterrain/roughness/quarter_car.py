"""Quarter car: sprung and unsprung mass over one wheel on a profile.

The state is x = [z's, z''s, z'u, z''u]: velocity and acceleration of the sprung and the unsprung
mass, divided by the speed, so that velocities are slopes; the input is the slope of the profile,
the output z'u - z's the rate of suspension travel, as a slope. Sayers, "On the Calculation of
International Roughness Index from Longitudinal Road Profile", Transportation Research Record 1501
(1995), pp. 1-12.
"""

from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

#: Speed at which the International Roughness Index is defined: 80 km/h [m/s].
IRI_SPEED = 80 / 3.6

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class QuarterCar:
    """Parameters of a quarter car, divided by its sprung mass; the defaults are the golden car.

    Examples
    --------
    >>> QuarterCar().mass_ratio
    0.15
    >>> QuarterCar(damping=4.0).damping
    4.0
    """

    tyre_stiffness: float = 653.0
    "K1: stiffness of the tyre over the sprung mass [1/s²]."

    spring_stiffness: float = 63.3
    "K2: stiffness of the suspension spring over the sprung mass [1/s²]."

    damping: float = 6.0
    "C: damping of the suspension over the sprung mass [1/s]."

    mass_ratio: float = 0.15
    "mu: unsprung over sprung mass [kg/kg]."

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not (np.isfinite(value) and value > 0):
                message = f"{field.name} must be finite and greater than 0, got {value}"
                raise ValueError(message)

    def matrices(self) -> tuple[Array, Array, Array]:
        """Matrices A, B, C of x' = A x + B slope, output = C x.

        Returns
        -------
        A : numpy.ndarray, shape (4, 4)
            Dynamics [1/s and 1/s²].
        B : numpy.ndarray, shape (4,)
            Effect of the slope through the tyre [1/s²].
        C : numpy.ndarray, shape (4,)
            Output: unsprung minus sprung velocity, as slope.

        Examples
        --------
        >>> A, B, C = QuarterCar().matrices()
        >>> print(A[1])
        [-63.3  -6.   63.3   6. ]
        """
        k1, k2, c, mu = self.tyre_stiffness, self.spring_stiffness, self.damping, self.mass_ratio
        A = np.array(
            [
                [0.0, 1.0, 0.0, 0.0],
                [-k2, -c, k2, c],
                [0.0, 0.0, 0.0, 1.0],
                [k2 / mu, c / mu, -(k1 + k2) / mu, -c / mu],
            ]
        )
        return A, np.array([0.0, 0.0, 0.0, k1 / mu]), np.array([-1.0, 0.0, 1.0, 0.0])

    def transition(self, step: float, *, speed: float = IRI_SPEED) -> tuple[Array, Array]:
        """Exact change of the state over a step of constant slope: x <- S x + p slope.

        Parameters
        ----------
        step : float
            Length of the step [m].
        speed : float
            Speed of the car [m/s].

        Returns
        -------
        S : numpy.ndarray, shape (4, 4)
            State transition matrix exp(A dt), dt = step / speed.
        p : numpy.ndarray, shape (4,)
            Partial response A^-1 (S - I) B.

        Raises
        ------
        ValueError
            If `step` or `speed` is not greater than 0.

        Notes
        -----
        Both come from one matrix exponential, of [[A, B], [0, 0]] dt (Van Loan 1978), so that A is
        not inverted.

        Examples
        --------
        >>> S, p = QuarterCar().transition(0.25)
        >>> print(f"{S[0, 0]:.6f} {p[3]:.4f}")
        0.996607 35.7926
        """
        from scipy.linalg import expm

        _require_positive("step", step, "m")
        _require_positive("speed", speed, "m/s")
        A, B, _ = self.matrices()
        augmented = np.zeros((5, 5))
        augmented[:4, :4] = A
        augmented[:4, 4] = B
        exponential = expm(augmented * (step / speed))
        return exponential[:4, :4].copy(), exponential[:4, 4].copy()

    def gain(self, wavelength: npt.ArrayLike, *, speed: float = IRI_SPEED) -> Array:
        """Magnitude of the response to a sine: amplitude of the output over that of the slope.

        Parameters
        ----------
        wavelength : array_like
            Wavelength of the profile [m].
        speed : float
            Speed of the car [m/s].

        Returns
        -------
        numpy.ndarray, shape of wavelength
            abs(C (i omega - A)^-1 B), omega = 2 pi speed / wavelength [1].

        Raises
        ------
        ValueError
            If a wavelength or `speed` is not greater than 0.

        Notes
        -----
        In the steady state a sine of height amplitude a has an IRI of
        (2/pi) gain (2 pi a / wavelength), which serves to test implementations of the index.

        Examples
        --------
        >>> print(QuarterCar().gain([15.0, 2.4]).round(4))
        [1.5273 1.664 ]
        """
        _require_positive("speed", speed, "m/s")
        length = np.asarray(wavelength, dtype=float)
        if not (np.isfinite(length) & (length > 0)).all():
            message = f"wavelength must be finite and greater than 0 m, got {wavelength!r}"
            raise ValueError(message)
        A, B, C = self.matrices()
        omega = 2 * np.pi * speed / length[..., None, None]
        state = np.linalg.solve(1j * omega * np.eye(4) - A, B[:, None])
        return np.abs(C @ state)[..., 0]


def _require_positive(name: str, value: float, unit: str) -> None:
    if not (np.isfinite(value) and value > 0):
        message = f"{name} must be finite and greater than 0 {unit}, got {value}"
        raise ValueError(message)
