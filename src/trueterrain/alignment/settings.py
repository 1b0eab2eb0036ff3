"""Settings of the network adjustment."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from trueterrain.alignment.adjustment.spline import COMPONENTS, Order

_LARGEST_CELL = 100.0  # [m] a plane fits no ground beyond


@dataclass(frozen=True, kw_only=True)
class ModelTrial:
    """One choice of how stiff corrections are, and how well it predicts cells held back."""

    components: tuple[str, ...]
    "Components of the corrections."

    knot_spacing: float
    "Spacing of the knots [s] or [m]."

    strength: float
    "Standard deviation by which heights may wander about their constant part [m]."

    order: Order
    "Order of the Gauss-Markov process: first is rough, second smooth."

    extra_strength: float = 0.0
    "The same of the other components, in units of what their constant parts may be [1]."

    round: int = 0
    "Round of the search; weights are others in each, so only trials of one round compare."

    held_out: float = float("nan")
    "Root mean square of what is left of differences of passes in cells held back [m]."

    log_likelihood: float = float("nan")
    "Logarithm of the marginal likelihood of the data, up to a constant."


@dataclass(frozen=True, kw_only=True)
class NetworkSettings:
    """How passes are brought into agreement."""

    knot_spacing: float | tuple[float, ...] = (1.0, 0.5, 0.25, 0.1)
    """Spacing of the knots [s], or [m] where stations stand for time; of several, finer ones are
    taken while they predict cells held back better."""

    strength: float | None = None
    """Standard deviation by which the height of a pass may wander about its constant part [m]; by
    default what predicts cells held back best."""

    correlation_time: float | None = None
    """Time, or way, after which the autocorrelation of the wandering is 1/e [s] or [m]; by default
    as fusion measured it in the drift of runs, else 25."""

    orders: tuple[Order, ...] = ("second", "first")
    "Orders of the Gauss-Markov process that are tried: first is rough, second smooth."

    components: tuple[str, ...] = ("height", "roll", "shift")
    """What corrections may hold beside the height, each where cells held back tell it: roll, pitch,
    shift."""

    roll_sd: float = 2e-3
    "What the roll of a pass may be wrong by as a whole, as a standard deviation [rad]."

    pitch_sd: float = 2e-3
    "What its pitch may be wrong by as a whole, as a standard deviation [rad]."

    shift_sd: float = 0.02
    "What its horizontal place may be wrong by as a whole, as a standard deviation [m]."

    extra_strengths: tuple[float, ...] = (0.03, 0.3)
    "Shares of these by which roll, pitch and shift may wander, tried beside constant ones [1]."

    pass_correlation: float = 0.0
    """Correlation of the navigation errors of different passes [1], e.g. by one base station: 0
    where they are independent, so that the mean of many passes is surer, 1 where they are the
    same."""

    datum_sd: float | None = None
    """Standard deviation of the datum of the adjustment [m]: of the height error that all passes
    have in common. By default it follows from what the navigation reports, from fixed passes or
    from control points; where navigation reports nothing it is not known."""

    huber: float = 2.0
    "Standard deviations beyond which a cell weighs less."

    tukey: float = 5.0
    "Standard deviations beyond which a cell is rejected."

    block: float = 5.0
    "Side of the squares of ground that are held back together [m]; halved where there are few."

    cluster: float = 1.0
    "Side of the squares of ground within which errors of cells may be alike [m]."

    sample: int = 30_000
    "Cells from which strength, spacing and components are chosen; of longer roads a part is taken."

    folds: int = 5
    "Parts of the ground that are held back in turn."

    min_cells: float = 20.0
    "Cells that a knot interval must have in the mean, or its spacing is not tried."

    relative_tolerance: float = 0.01
    "Change of the corrections from which on they have converged, in their standard deviations [1]."

    tolerance: float = 1e-5
    "Change of the corrections from which on they have converged, however sure they are [m]."

    max_iterations: int = 300
    "Iterations in which they must converge."

    def __post_init__(self) -> None:
        """Check the values."""
        given, spacings = self.knot_spacing, self.knot_spacings
        if not spacings or not all(np.isfinite(one) and one > 0 for one in spacings):
            message = f"knot_spacing must be greater than 0, got {given}."
            raise ValueError(message)
        if any(one <= other for one, other in pairwise(spacings)):
            message = f"knot_spacing must go from coarse to fine, got {given}."
            raise ValueError(message)
        if self.strength is not None and not (np.isfinite(self.strength) and self.strength >= 0):
            message = f"strength must be at least 0 m, got {self.strength}."
            raise ValueError(message)
        if self.correlation_time is not None and not 0 < self.correlation_time < np.inf:
            message = f"correlation_time must be greater than 0, got {self.correlation_time}."
            raise ValueError(message)
        for name in (
            "roll_sd",
            "pitch_sd",
            "shift_sd",
            "huber",
            "tukey",
            "block",
            "cluster",
            "min_cells",
            "relative_tolerance",
            "tolerance",
        ):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                message = f"{name} must be greater than 0, got {getattr(self, name)}."
                raise ValueError(message)
        if not 0 <= self.pass_correlation <= 1:
            message = f"pass_correlation must be from 0 to 1, got {self.pass_correlation}."
            raise ValueError(message)
        if self.datum_sd is not None and not 0 <= self.datum_sd < np.inf:
            message = f"datum_sd must be at least 0 m, got {self.datum_sd}."
            raise ValueError(message)
        known = ("height", "roll", "pitch", "shift")
        if "height" not in self.components or not set(self.components) <= set(known):
            message = (
                f"components must be height and some of {', '.join(known[1:])}, got "
                f"{', '.join(self.components)}."
            )
            raise ValueError(message)
        if not self.orders or not set(self.orders) <= {"first", "second"}:
            message = f"orders must be first, second or both, got {self.orders}."
            raise ValueError(message)
        if self.folds < 2 or self.max_iterations < 1 or self.sample < 1:
            message = "folds must be at least 2, max_iterations and sample at least 1."
            raise ValueError(message)

    @property
    def knot_spacings(self) -> tuple[float, ...]:
        """Spacings of the knots that are tried, from coarse to fine [s] or [m]."""
        given = self.knot_spacing
        return given if isinstance(given, tuple) else (given,)

    @property
    def extra_components(self) -> list[tuple[str, ...]]:
        """Components beside the height, those that come together in one."""
        parts = {"roll": ("roll",), "pitch": ("pitch",), "shift": ("east", "north")}
        return [parts[name] for name in parts if name in self.components]

    def scale(self, component: str) -> float:
        """What a component may be wrong by as a whole [its unit].

        Parameters
        ----------
        component : str
            Roll, pitch, east or north.

        Returns
        -------
        float
            As a standard deviation.
        """
        if component not in COMPONENTS:
            message = f"component must be one of {', '.join(COMPONENTS)}, got {component!r}."
            raise ValueError(message)
        return {"roll": self.roll_sd, "pitch": self.pitch_sd}.get(component, self.shift_sd)


@dataclass(frozen=True, kw_only=True)
class CellSettings:
    """Cells of the ground by which passes are compared."""

    size: float = 0.25
    "Side of a cell [m]."

    min_count: int = 5
    "Returns that a cell must have of a pass."

    scans: int = 5
    """Scans of a run that a cell has along its way; more are left out, since they tell no more of
    the pass. 0 for all."""

    max_sd: float = 0.05
    "Standard deviation of the returns about their plane up to which a cell is used [m]."

    visit_gap: float = 10.0
    "Time, or way, after which a pass comes to a cell for another time [s] or [m]."

    def __post_init__(self) -> None:
        """Check the values."""
        for name in ("size", "max_sd", "visit_gap"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                message = f"{name} must be greater than 0, got {getattr(self, name)}."
                raise ValueError(message)
        if self.size > _LARGEST_CELL:
            message = f"size must be at most {_LARGEST_CELL:g} m, got {self.size}."
            raise ValueError(message)
        if self.scans < 0:
            message = f"scans must be at least 0, got {self.scans}."
            raise ValueError(message)
        if self.min_count < 1:
            message = f"min_count must be at least 1 return, got {self.min_count}."
            raise ValueError(message)
