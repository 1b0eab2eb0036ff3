"""What passes tell of a mounting and what they do not."""

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from trueterrain.core.errors import CoverageError
from trueterrain.georeference._differences import ParameterEstimate
from trueterrain.georeference._patches import NAMES, SHARED

Floats = npt.NDArray[np.float64]

#: Correlation from which on parameters are said to go together.
TOGETHER = 0.7

#: What a parameter that is held may be off by, by drawing and tape [rad, m, s].
_MEASURED = {"angle": math.radians(0.5), "lever": 0.01, "clock": 0.001}

_CURES = {
    "roll": "Drive over the same lane both ways.",
    "pitch": "Drive over a step both ways, and hold lever_x, which acts alike.",
    "yaw": "Add passes in a lane beside, over steps across the road.",
    "lever_x": "Measure lever_x with a tape: it acts as pitch does.",
    "lever_y": "Drive both ways over steps oblique to the road, or measure lever_y.",
    "lever_z": "Measure lever_z with a tape: all passes see it alike.",
    "clock": "Add passes over a step at another speed.",
}


@dataclass(frozen=True, kw_only=True)
class UnobservableParameter:
    """A parameter that the passes do not tell."""

    index: int
    "Its place in `NAMES`."

    sd: float
    "Standard deviation that it would have [rad, m, s]."

    limit: float
    "What is asked for [rad, m, s]."

    together: tuple[str, ...]
    "Parameters that act alike."

    passes: int | None
    "Passes that would tell it, if errors of the motion alone hide it from those there are."

    @property
    def name(self) -> str:
        """Its name."""
        return NAMES[self.index]

    @property
    def finding(self) -> str:
        """How uncertain it is, and what it goes together with."""
        sd, limit = in_units(self.name, self.sd), in_units(self.name, self.limit)
        words = f"sd {sd}, at most {limit} is asked for"
        return f"{words}; goes with {', '.join(self.together)}" if self.together else words

    @property
    def cure(self) -> str:
        """What would tell it."""
        if self.passes is None:
            return _CURES[self.name]
        return (
            f"Errors of the motion hide {self.name}: about {self.passes:,} such passes, at "
            "different speeds, would tell it, or fewer with better navigation."
        )


def in_units(name: str, value: float) -> str:
    """Value of a parameter in the unit that people use: deg, mm or ms.

    Parameters
    ----------
    name : str
        Name of the parameter.
    value : float
        Its value [rad, m, s].

    Returns
    -------
    str
        With two digits that count.
    """
    unit, scale = unit_of(name)
    value *= scale
    digits = 1 - math.floor(math.log10(abs(value))) if value else 0
    return f"{value:.{max(digits, 0)}f} {unit}"


def measured_within(name: str) -> float:
    """What a parameter that is held may be off by, by drawing and tape [rad, m, s]."""
    return _MEASURED.get(name.partition("_")[0], _MEASURED["angle"])


def unit_of(name: str) -> tuple[str, float]:
    """Unit in which people read a parameter, and its number in one [rad, m, s]."""
    if name == "clock":
        return "ms", 1e3
    return ("mm", 1e3) if name.startswith("lever") else ("deg", math.degrees(1.0))


def find_unobservable(
    result: ParameterEstimate, chosen: list[int], limits: Floats, passes: int
) -> list[UnobservableParameter]:
    """Parameters to hold so that the others are told; arms first, which a tape measures.

    Parameters
    ----------
    result : Fit
        Fit of the chosen parameters.
    chosen : list of int
        What was estimated, by place in `NAMES`.
    limits : numpy.ndarray, shape (7,)
        Standard deviations up to which each counts as observable.
    passes : int
        How many there are.

    Returns
    -------
    list of Untold
        Of the chosen ones, in the order of `NAMES`; each as the passes tell it when those that
        are told even less are held.
    """
    kept, held = list(range(len(chosen))), list[UnobservableParameter]()
    while kept:
        sd, alike = _sd_and_correlation(_reduced_normal_matrix(result, len(chosen), kept))
        asked = limits[[chosen[k] for k in kept]]
        excess = sd[: len(kept)] / asked
        if (excess <= 1).all():
            break
        arms = np.array([NAMES[chosen[k]].startswith("lever") for k in kept])
        weak = (excess > 1) & arms if (excess[arms] > 1).any() else excess > 1
        worst = int(np.argmax(np.where(weak, excess, 0.0)))
        held.append(
            UnobservableParameter(
                index=chosen[kept[worst]],
                sd=float(sd[worst]),
                limit=float(asked[worst]),
                together=tuple(
                    NAMES[chosen[k]]
                    for j, k in enumerate(kept)
                    if j != worst and abs(alike[worst, j]) > TOGETHER
                ),
                passes=None,
            )
        )
        kept.pop(worst)
    held = [
        replace(one, passes=_sufficient_passes(result, chosen, kept, one.index, limits, passes))
        for one in held
    ]
    return sorted(held, key=lambda one: one.index)


def find_uncertain(
    result: ParameterEstimate, chosen: list[int], limits: Floats, passes: int
) -> list[UnobservableParameter]:
    """Those of the chosen parameters whose scatter is beyond the limits."""
    sd = np.sqrt(np.diag(result.covariance))[: len(chosen)]
    told = [k for k, index in enumerate(chosen) if sd[k] <= limits[index]]
    return [
        UnobservableParameter(
            index=index,
            sd=float(sd[k]),
            limit=float(limits[index]),
            together=(),
            passes=_sufficient_passes(result, chosen, told, index, limits, passes),
        )
        for k, index in enumerate(chosen)
        if sd[k] > limits[index]
    ]


def unobservable_error(untold: list[UnobservableParameter]) -> CoverageError:
    """Error that names what cannot be told, what it goes together with, and what helps."""
    words = [f"{one.name} ({one.finding})" for one in untold]
    return CoverageError(
        f"the passes do not tell {', '.join(words)}",
        cure=" ".join(one.cure for one in untold) + " Or hold it: leave it out of parameters.",
    )


def _reduced_normal_matrix(
    result: ParameterEstimate, count: int, kept: list[int], last: int | None = None
) -> Floats:
    """Normal matrix of what is kept, and of all else behind the parameters up to the last."""
    columns = [*kept, *range(count, len(result.normal) if last is None else last)]
    return np.asarray(result.normal[np.ix_(columns, columns)] / SHARED)


def _sd_and_correlation(normal: Floats) -> tuple[Floats, Floats]:
    inverse = np.linalg.inv(normal)
    sd = np.sqrt(np.diag(inverse))
    return sd, inverse / np.outer(sd, sd)


def _sufficient_passes(
    result: ParameterEstimate,
    chosen: list[int],
    told: list[int],
    index: int,
    limits: Floats,
    passes: int,
) -> int | None:
    """Passes that tell a parameter beside those told, if errors of the motion alone hide it.

    None if the passes would not tell it even if their motion were known, or a tape tells it.
    """
    if NAMES[index].startswith("lever"):
        return None
    count, kept = len(chosen), [chosen.index(index), *told]
    hidden, _ = _sd_and_correlation(_reduced_normal_matrix(result, count, kept))
    if_known, _ = _sd_and_correlation(
        _reduced_normal_matrix(result, count, kept, last=count + passes - 1)
    )
    excess = float(hidden[0] / limits[index])
    return math.ceil(passes * excess**2) if if_known[0] <= limits[index] and excess > 1 else None
