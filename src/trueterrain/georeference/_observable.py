"""What passes tell of a mounting and what they do not."""

import numpy as np
import numpy.typing as npt

from trueterrain.errors import CoverageError
from trueterrain.georeference._differences import Fit
from trueterrain.georeference._patches import NAMES, SHARED

Floats = npt.NDArray[np.float64]

_TOGETHER = 0.7  # correlation from which on parameters are said to go together

_CURES = {
    "roll": "Drive over the same lane both ways.",
    "pitch": "Drive over a step both ways, and hold lever_x, which acts alike.",
    "yaw": "Add passes in a lane beside, over steps across the road.",
    "lever_x": "Measure lever_x with a tape: it acts as pitch does.",
    "lever_y": "Drive both ways over steps oblique to the road, or measure lever_y.",
    "lever_z": "Measure lever_z with a tape: all passes see it alike.",
    "clock": "Add passes over a step at another speed.",
}


def unobservable(result: Fit, chosen: list[int], limits: Floats) -> list[int]:
    """Parameters to hold so that the others are told; arms first, which a tape measures.

    Parameters
    ----------
    result : Fit
        Fit of the chosen parameters.
    chosen : list of int
        What was estimated, by place in `NAMES`.
    limits : numpy.ndarray, shape (7,)
        Standard deviations up to which each counts as observable.

    Returns
    -------
    list of int
        Of the chosen ones, in ascending order.
    """
    kept, held = list(range(len(chosen))), list[int]()
    offsets = list(range(len(chosen), len(result.normal)))
    while kept:
        part = np.ix_([*kept, *offsets], [*kept, *offsets])
        inverse = np.linalg.inv(result.normal[part] / SHARED)
        excess = np.sqrt(np.diag(inverse))[: len(kept)] / limits[[chosen[k] for k in kept]]
        if (excess <= 1).all():
            break
        arms = np.array([NAMES[chosen[k]].startswith("lever") for k in kept])
        weak = (excess > 1) & arms if (excess[arms] > 1).any() else excess > 1
        held.append(kept.pop(int(np.argmax(np.where(weak, excess, 0.0)))))
    return sorted(chosen[k] for k in held)


def uncertain(result: Fit, chosen: list[int], limits: Floats) -> list[int]:
    """Those of the chosen parameters whose scatter is beyond the limits."""
    sd = np.sqrt(np.diag(result.covariance))[: len(chosen)]
    return [index for index, value in zip(chosen, sd, strict=True) if value > limits[index]]


def refusal(result: Fit, chosen: list[int], held: list[int], limits: Floats) -> CoverageError:
    """Error that names what cannot be told, what it goes together with, and what helps."""
    inverse = np.linalg.inv(result.normal / SHARED)
    sd = result.sd
    correlation = inverse / np.sqrt(np.outer(np.diag(inverse), np.diag(inverse)))
    words = []
    for index in held:
        k = chosen.index(index)
        others = [
            NAMES[chosen[j]]
            for j in range(len(chosen))
            if j != k and abs(correlation[k, j]) > _TOGETHER
        ]
        told = f"{NAMES[index]} (sd {sd[k]:.2g}, at most {limits[index]:.2g} is asked for"
        words.append(told + (f"; goes with {', '.join(others)})" if others else ")"))
    return CoverageError(
        f"the passes do not tell {', '.join(words)}",
        cure=" ".join(_CURES[NAMES[index]] for index in held)
        + " Or hold it: leave it out of parameters.",
    )
