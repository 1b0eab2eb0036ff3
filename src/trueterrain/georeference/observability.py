"""Observability: parameters of a mounting that passes determine, and those that they do not."""

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from trueterrain.core.errors import CoverageError
from trueterrain.georeference._differences import ParameterEstimate
from trueterrain.georeference._patches import CORRELATED_CELLS, NAMES

Floats = npt.NDArray[np.float64]

#: Absolute correlation above which two parameters are reported as correlated.
MIN_CORRELATION = 0.7

#: Tolerance of a held parameter, measured by drawing and tape [rad, m, s].
_TOLERANCES = {"angle": math.radians(0.5), "lever": 0.01, "clock": 0.001}

_CURES = {
    "roll": "Drive over the same lane in both directions.",
    "pitch": "Drive over a step in both directions, and hold lever_x, which has the same effect.",
    "yaw": "Add passes in an adjacent lane, over steps across the road.",
    "lever_x": "Measure lever_x with a tape: it has the same effect as pitch.",
    "lever_y": "Drive in both directions over steps oblique to the road, or measure lever_y.",
    "lever_z": "Measure lever_z with a tape: it shifts all passes equally.",
    "clock": "Add passes over a step at another speed.",
}


@dataclass(frozen=True, kw_only=True)
class UnobservableParameter:
    """A parameter that the passes do not determine."""

    index: int
    "Index in `NAMES`."

    sd: float
    "Standard deviation that an estimate would have [rad, m, s]."

    limit: float
    "Required standard deviation [rad, m, s]."

    together: tuple[str, ...]
    "Parameters that it is correlated with."

    passes: int | None
    "Number of passes that would determine it, if only errors of the motion prevent that."

    @property
    def name(self) -> str:
        """Name of the parameter."""
        return NAMES[self.index]

    @property
    def finding(self) -> str:
        """Standard deviation, required one, and correlated parameters."""
        sd, limit = format_parameter(self.name, self.sd), format_parameter(self.name, self.limit)
        words = f"sd {sd}, at most {limit} is required"
        return f"{words}; correlated with {', '.join(self.together)}" if self.together else words

    @property
    def cure(self) -> str:
        """Measurements that would determine it."""
        if self.passes is None:
            return _CURES[self.name]
        return (
            f"Errors of the motion hide {self.name}: about {self.passes:,} such passes, at "
            "different speeds, would determine it, or fewer with better navigation."
        )


def format_parameter(name: str, value: float) -> str:
    """Value of a parameter as text in deg, mm or ms.

    Parameters
    ----------
    name : str
        Name of the parameter.
    value : float
        Its value [rad, m, s].

    Returns
    -------
    str
        With two significant digits and the unit.
    """
    unit, scale = parameter_unit(name)
    value *= scale
    digits = 1 - math.floor(math.log10(abs(value))) if value else 0
    return f"{value:.{max(digits, 0)}f} {unit}"


def survey_tolerance(name: str) -> float:
    """Tolerance of a held parameter, measured by drawing and tape [rad, m, s]."""
    return _TOLERANCES.get(name.partition("_")[0], _TOLERANCES["angle"])


def parameter_unit(name: str) -> tuple[str, float]:
    """Unit in which a parameter is reported, and the factor from [rad, m, s] to it."""
    if name == "clock":
        return "ms", 1e3
    return ("mm", 1e3) if name.startswith("lever") else ("deg", math.degrees(1.0))


def find_unobservable(
    result: ParameterEstimate, chosen: list[int], limits: Floats, passes: int
) -> list[UnobservableParameter]:
    """Parameters to hold so that the others are observable; lever arms first (tape).

    Parameters
    ----------
    result : ParameterEstimate
        Estimate of the chosen parameters.
    chosen : list of int
        Estimated parameters, by index in `NAMES`.
    limits : numpy.ndarray, shape (7,)
        Standard deviations up to which each counts as observable.
    passes : int
        Number of passes.

    Returns
    -------
    list of UnobservableParameter
        Of the chosen ones, in the order of `NAMES`; each with its standard deviation when those
        determined even worse are held.
    """
    kept, held = list(range(len(chosen))), list[UnobservableParameter]()
    while kept:
        sd, correlation = _sd_and_correlation(_reduced_normal_matrix(result, len(chosen), kept))
        asked = limits[[chosen[k] for k in kept]]
        excess = sd[: len(kept)] / asked
        if (excess <= 1).all():
            break
        arms = np.array([NAMES[chosen[k]].startswith("lever") for k in kept])
        candidates = (excess > 1) & arms if (excess[arms] > 1).any() else excess > 1
        worst = int(np.argmax(np.where(candidates, excess, 0.0)))
        held.append(
            UnobservableParameter(
                index=chosen[kept[worst]],
                sd=float(sd[worst]),
                limit=float(asked[worst]),
                together=tuple(
                    NAMES[chosen[k]]
                    for j, k in enumerate(kept)
                    if j != worst and abs(correlation[worst, j]) > MIN_CORRELATION
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
    """Chosen parameters whose standard deviation exceeds the limit."""
    sd = np.sqrt(np.diag(result.covariance))[: len(chosen)]
    observable = [k for k, index in enumerate(chosen) if sd[k] <= limits[index]]
    return [
        UnobservableParameter(
            index=index,
            sd=float(sd[k]),
            limit=float(limits[index]),
            together=(),
            passes=_sufficient_passes(result, chosen, observable, index, limits, passes),
        )
        for k, index in enumerate(chosen)
        if sd[k] > limits[index]
    ]


def unobservable_error(unobservable: list[UnobservableParameter]) -> CoverageError:
    """Error that names unobservable parameters, correlated ones, and the cure."""
    words = [f"{one.name} ({one.finding})" for one in unobservable]
    return CoverageError(
        f"the passes do not determine {', '.join(words)}",
        cure=" ".join(one.cure for one in unobservable)
        + " Or hold it: leave it out of parameters.",
    )


def _reduced_normal_matrix(
    result: ParameterEstimate, count: int, kept: list[int], last: int | None = None
) -> Floats:
    """Normal matrix of the kept parameters and of all unknowns after the parameters, up to `last`.

    Divided by the correlated cells, so that its inverse is a covariance.
    """
    columns = [*kept, *range(count, len(result.normal) if last is None else last)]
    return np.asarray(result.normal[np.ix_(columns, columns)] / CORRELATED_CELLS)


def _sd_and_correlation(normal: Floats) -> tuple[Floats, Floats]:
    inverse = np.linalg.inv(normal)
    sd = np.sqrt(np.diag(inverse))
    return sd, inverse / np.outer(sd, sd)


def _sufficient_passes(
    result: ParameterEstimate,
    chosen: list[int],
    observable: list[int],
    index: int,
    limits: Floats,
    passes: int,
) -> int | None:
    """Number of passes that determine a parameter, if only errors of the motion prevent that.

    None if the passes would not determine it even with exact motion, or a tape measures it. The
    standard deviation falls with the square root of the number of passes.
    """
    if NAMES[index].startswith("lever"):
        return None
    count, kept = len(chosen), [chosen.index(index), *observable]
    with_errors, _ = _sd_and_correlation(_reduced_normal_matrix(result, count, kept))
    exact_motion, _ = _sd_and_correlation(
        _reduced_normal_matrix(result, count, kept, last=count + passes - 1)
    )
    excess = float(with_errors[0] / limits[index])
    return (
        math.ceil(passes * excess**2) if exact_motion[0] <= limits[index] and excess > 1 else None
    )
