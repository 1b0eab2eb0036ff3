"""Findings: the result of the search for one fault, such as a wrong clock.

Errors of a profiler have causes: a clock, an angle, a lever arm, a bright stripe. Each cause leaves
a signature of its own in the errors. A finding states the estimate of one fault with its standard
deviation and whether it is significant, or why the test cannot observe it.
"""

from dataclasses import dataclass
from typing import Any

from trueterrain.core.json_values import json_values
from trueterrain.verify.statistics.regression import CERTAIN


@dataclass(frozen=True, kw_only=True)
class Finding:
    """Result of the search for one fault."""

    name: str
    "Name of the fault, such as `clock of the scanner`."

    value: float | None
    "Estimate, in its unit; None if it is not observable in this test."

    sd: float | None
    "Standard deviation of the value; None if it is counted, or not observable."

    unit: str
    "Unit of the value: s, rad, m, Hz, or 1."

    detected: bool | None
    "Whether the fault is significant; None if it is not observable in this test."

    meaning: str
    "A sentence: effect and remedy, or why it is not observable and which test observes it."

    def to_dict(self) -> dict[str, Any]:
        """The same as plain numbers and words, as for JSON."""
        return {
            "name": self.name,
            "value": None if self.value is None else json_values(self.value),
            "sd": None if self.sd is None else json_values(self.sd),
            "unit": self.unit,
            "detected": self.detected,
            "meaning": self.meaning,
        }


def is_significant(value: float, sd: float, *, min_size: float = 0.0) -> bool:
    """Whether an estimate is significant, and large enough to matter.

    Parameters
    ----------
    value, sd : float
        Estimate and its standard deviation.
    min_size : float
        Smallest magnitude that matters, in the same unit.

    Returns
    -------
    bool
        True if the magnitude exceeds four standard deviations and `min_size`.

    Examples
    --------
    >>> is_significant(0.001, 0.0001), is_significant(0.0002, 0.0001)
    (True, False)
    >>> is_significant(0.001, 0.0001, min_size=0.002)
    False
    """
    return abs(value) > max(CERTAIN * sd, min_size)
