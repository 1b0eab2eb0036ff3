"""Modes of a vehicle: natural frequencies, damping ratios and mode shapes."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trueterrain.vehicle.model import Array, ComplexArray, LinearModel, state_space


@dataclass(frozen=True, kw_only=True, eq=False)
class Modes:
    """The n modes of a model in order of their undamped frequencies; see `vehicle_modes`."""

    names: tuple[str, ...]
    "Name of each mode: that of the pattern with which its undamped shape agrees best."

    undamped_frequency: Array
    "Frequency of the model without dampers, shape (n,) [Hz]."

    undamped_shape: Array
    "Mode shapes of the model without dampers, shape (n, n), one mode per row."

    eigenvalue: ComplexArray
    "s in exp(s t); of two real eigenvalues the slower one, shape (n,) [1/s]."

    natural_frequency: Array
    "Modulus of the eigenvalue over 2 pi, shape (n,) [Hz]."

    damped_frequency: Array
    "Imaginary part of the eigenvalue over 2 pi; 0 if the mode does not oscillate, shape (n,) [Hz]."

    damping_ratio: Array
    "Fraction of critical damping; 1 or more if the mode does not oscillate, shape (n,) [1]."

    shape: ComplexArray
    "Complex mode shapes with their phases, shape (n, n), one mode per row."


def vehicle_modes(model: LinearModel) -> Modes:
    """Modal analysis: natural frequencies, damping ratios and shapes, undamped and damped.

    Parameters
    ----------
    model : LinearModel
        With n degrees of freedom.

    Returns
    -------
    Modes
        In order of the undamped frequencies. Shapes have a modal mass of 1 kg, and the component
        with most kinetic energy is real and positive.

    Notes
    -----
    The eigenvalues of M^-1 K, which Smith (2009) uses after Eq. 3-3, are the squares of the
    *undamped* angular frequencies and hold no information on damping. Damping follows from the
    complex eigenvalues s of [[0, I], [-M^-1 K, -M^-1 C]]: frequency ``|s| / 2 pi``, ratio
    ``-Re(s) / |s|``. These need not equal the undamped frequencies, as dampers couple the modes;
    each damped mode is paired with the undamped one of greatest modal assurance criterion. If an
    overdamped mode has two real eigenvalues, these are the pair whose shapes agree best, with
    frequency sqrt(s1 s2) / 2 pi and ratio -(s1 + s2) / 2 sqrt(s1 s2).

    Where frequencies coincide, any linear combination of the shapes is a mode, and names are
    arbitrary.

    Examples
    --------
    >>> from trueterrain.vehicle import GOLDEN_QUARTER_CAR, linear_model
    >>> found = vehicle_modes(linear_model(GOLDEN_QUARTER_CAR))
    >>> found.names
    ('heave', 'hop')
    >>> print(found.undamped_frequency.round(3), found.damping_ratio.round(3))
    [ 1.208 11.005] [0.333 0.302]
    """
    from scipy.linalg import eigh

    squares, columns = eigh(model.stiffness, model.mass)
    undamped = _normalise_shapes(columns.T, model.mass).real
    first, second, shapes = _damped_modes(model)
    order = _match_modes(_modal_assurance(undamped, shapes, model.mass))
    first, second, shapes = first[order], second[order], shapes[order]
    patterns = _match_modes(_modal_assurance(undamped, model.mode_patterns, model.mass))
    modulus = np.sqrt((first * second).real)
    return Modes(
        names=tuple(model.mode_names[index] for index in patterns),
        undamped_frequency=np.sqrt(squares) / (2 * np.pi),
        undamped_shape=undamped,
        eigenvalue=first,
        natural_frequency=modulus / (2 * np.pi),
        damped_frequency=np.abs(first.imag) / (2 * np.pi),
        damping_ratio=-(first + second).real / (2 * modulus),
        shape=_normalise_shapes(shapes, model.mass),
    )


def _damped_modes(model: LinearModel) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Both eigenvalues of each mode, shape (n,), and its shape, shape (n, n), in any order."""
    values, vectors = np.linalg.eig(state_space(model).A)
    values, shapes = values.astype(complex), vectors[: len(model.freedoms)].T.astype(complex)

    # An oscillation has a conjugate pair. A mode that does not oscillate has two real eigenvalues:
    # from the slowest on, each is paired with the remaining one whose shape agrees best with it.
    pairs = [(index, index) for index in np.flatnonzero(values.imag > 0)]
    second = values.conj()
    real = sorted(np.flatnonzero(values.imag == 0), key=lambda index: abs(values[index]))
    while real:
        slow = real.pop(0)
        fast = real.pop(int(_modal_assurance(shapes[[slow]], shapes[real], model.mass)[0].argmax()))
        pairs.append((slow, fast))
    chosen, partners = np.array(pairs).T
    return values[chosen], second[partners], shapes[chosen]


def _modal_assurance(
    first: npt.NDArray[np.number], second: npt.NDArray[np.number], mass: Array
) -> Array:
    """Modal assurance criterion of two sets of shapes, weighted by mass: 1 for equal shapes.

    MAC = |aᴴ M b|² / (aᴴ M a · bᴴ M b), shape (first, second) (Allemang 2003).
    """
    product = np.abs(first.conj() @ mass @ second.T) ** 2
    norm_first = np.einsum("ij,jk,ik->i", first.conj(), mass, first).real
    norm_second = np.einsum("ij,jk,ik->i", second.conj(), mass, second).real
    assurance: Array = product / np.outer(norm_first, norm_second)
    return assurance


def _match_modes(assurance: Array) -> list[int]:
    """Column of each row, every column once, in descending order of modal assurance."""
    remaining = assurance.copy()
    columns = [0] * len(remaining)
    for _ in columns:
        row, column = np.unravel_index(np.argmax(remaining), remaining.shape)
        columns[int(row)] = int(column)
        remaining[row, :] = remaining[:, column] = -1.0
    return columns


def _normalise_shapes(shapes: ComplexArray, mass: Array) -> ComplexArray:
    """Shapes of modal mass 1, with a phase that makes the component of most energy positive."""
    energy = np.abs(shapes) ** 2 * np.diag(mass)
    main = np.take_along_axis(shapes, energy.argmax(axis=1)[:, None], axis=1)
    modal_mass = np.einsum("ij,jk,ik->i", shapes.conj(), mass, shapes).real
    normalised: ComplexArray = shapes * (np.abs(main) / main) / np.sqrt(modal_mass)[:, None]
    return normalised
