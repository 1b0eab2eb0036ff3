"""Settings of the network adjustment and of the cells in which passes are compared."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

Order = Literal["first", "second"]

#: Components of a correction, in the order of its coefficients, and their units.
COMPONENTS = {"height": "m", "roll": "rad", "pitch": "rad", "east": "m", "north": "m"}

_LARGEST_CELL = 100.0  # [m] larger cells are not level enough for one plane


@dataclass(frozen=True, kw_only=True)
class ModelTrial:
    """One candidate for the stochastic model of the corrections, and its cross-validation."""

    components: tuple[str, ...]
    "Components of the corrections."

    knot_spacing: float
    "Spacing of the knots [s] or [m]."

    strength: float
    "Standard deviation of the drift of the heights about their constant part [m]."

    order: Order
    "Order of the Gauss-Markov process: first is rough, second smooth."

    extra_strength: float = 0.0
    "Drift of the other components, as a fraction of their constant errors [1]."

    round: int = 0
    "Stage of the search. Weights differ between stages, so only trials of one stage compare."

    held_out: float = float("nan")
    "Root mean square of the differences of passes in held-out cells, corrected [m]."

    log_likelihood: float = float("nan")
    "Logarithm of the marginal likelihood of the observations, up to a constant."


@dataclass(frozen=True, kw_only=True)
class NetworkSettings:
    """How the network adjustment aligns passes."""

    knot_spacing: float | tuple[float, ...] = (1.0, 0.5, 0.25, 0.1)
    """Spacing of the knots [s], or [m] where corrections follow the station. Of several, finer ones
    are taken as long as they predict held-out cells better."""

    strength: float | None = None
    """Standard deviation of the drift of the height of a pass about its constant part [m]; by
    default the value that predicts held-out cells best."""

    correlation_time: float | None = None
    """Time or distance after which the autocorrelation of the drift is 1/e [s] or [m]; by default
    the value that fusion estimated from the runs, else 25."""

    orders: tuple[Order, ...] = ("second", "first")
    "Orders of the Gauss-Markov process to try: first is rough, second smooth."

    components: tuple[str, ...] = ("height", "roll", "shift")
    """Components to estimate besides the height: roll, pitch, shift. One is kept only if it
    improves the prediction of held-out cells."""

    roll_sd: float = 2e-3
    "Standard deviation of the constant roll error of a pass [rad]."

    pitch_sd: float = 2e-3
    "Standard deviation of the constant pitch error of a pass [rad]."

    shift_sd: float = 0.02
    "Standard deviation of the constant horizontal error of a pass [m]."

    extra_strengths: tuple[float, ...] = (0.03, 0.3)
    "Drift of roll, pitch and shift, as a fraction of their constant errors, to try besides 0 [1]."

    pass_correlation: float = 0.0
    """Correlation of the navigation errors of different passes [1], e.g. by a common base station.
    With 0 they are independent, so the mean of many passes is more accurate than one; with 1 they
    are identical."""

    datum_sd: float | None = None
    """Standard deviation of the datum [m]: of the height error that all passes have in common. By
    default it follows from the reported standard deviations of navigation, from fixed passes or
    from control points. It is unknown if none of these is given."""

    huber: float = 2.0
    "Bound of Huber's weights, in standard deviations: cells beyond it get a lower weight."

    tukey: float = 5.0
    "Bound of Tukey's weights, in standard deviations: cells beyond it are rejected."

    block: float = 5.0
    "Side of the squares of ground that are held out together [m]; halved if there are few."

    cluster: float = 1.0
    "Side of the squares of ground within which errors of cells may be correlated [m]."

    sample: int = 30_000
    "Number of cells used to choose strength, spacing and components; longer roads are sampled."

    folds: int = 5
    "Number of folds of the cross-validation."

    min_cells: float = 20.0
    "Mean number of cells in a knot interval below which a spacing is not tried."

    relative_tolerance: float = 0.01
    "Change of the corrections below which they have converged, in standard deviations [1]."

    tolerance: float = 1e-5
    "Change of the corrections below which they have converged in any case [m]."

    max_iterations: int = 300
    "Iterations in which the adjustment must converge."

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
        """Components besides the height, in groups that are added together."""
        parts = {"roll": ("roll",), "pitch": ("pitch",), "shift": ("east", "north")}
        return [parts[name] for name in parts if name in self.components]

    def scale(self, component: str) -> float:
        """Standard deviation of the constant error of a component.

        Parameters
        ----------
        component : str
            Roll, pitch, east or north.

        Returns
        -------
        float
            In the unit of the component [rad] or [m].
        """
        if component not in COMPONENTS:
            message = f"component must be one of {', '.join(COMPONENTS)}, got {component!r}."
            raise ValueError(message)
        return {"roll": self.roll_sd, "pitch": self.pitch_sd}.get(component, self.shift_sd)


@dataclass(frozen=True, kw_only=True)
class CellSettings:
    """Cells of the ground in which passes are compared."""

    size: float = 0.25
    "Side of a cell [m]."

    min_count: int = 5
    "Minimum number of returns of a pass in a cell."

    scans: int = 5
    """Number of scans of a run in a cell, along the path; others are skipped, since they add little
    information on drift. 0 takes all."""

    max_sd: float = 0.05
    "Maximum standard deviation of the returns about the plane of a cell [m]."

    visit_gap: float = 10.0
    "Gap in time or distance after which returns count as another visit of the pass [s] or [m]."

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
