"""Findings: what a test looked for besides the size of the error, and what it found.

A profiler that is wrong is wrong for a reason: a clock, an angle, a lever arm, a bright stripe.
Each reason leaves a mark of its own on the errors. A finding says what was looked for, how large it
seems to be and how surely, and whether it is there; or why this test cannot tell.
"""

from dataclasses import dataclass
from typing import Any

from trueterrain.core.json_values import json_values

#: Standard deviations from nothing beyond which a finding is one: by chance alone one in 16,000.
CERTAIN = 4.0


@dataclass(frozen=True, kw_only=True)
class Finding:
    """A fault that was looked for."""

    name: str
    "What was looked for, as `clock of the scanner`."

    value: float | None
    "How large it is, in its unit; None if the test cannot tell."

    sd: float | None
    "Standard deviation of the value; None if it is counted, not estimated, or cannot be told."

    unit: str
    "Unit of the value: s, rad, m, Hz, or 1."

    detected: bool | None
    "Whether it is there; None if the test cannot tell."

    meaning: str
    "One sentence: what it does and what to do, or why it cannot be told and what would tell."

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


def is_significant(value: float, sd: float, *, least: float = 0.0) -> bool:
    """Whether a value is surely there, and large enough to matter.

    Parameters
    ----------
    value, sd : float
        Estimate and its standard deviation.
    least : float
        Smallest magnitude that matters, in the same unit.

    Returns
    -------
    bool
        True if it is more than four standard deviations from nothing, and beyond `least`.

    Examples
    --------
    >>> certain(0.001, 0.0001), certain(0.0002, 0.0001), certain(0.001, 0.0001, least=0.002)
    (True, False, False)
    """
    return abs(value) > max(CERTAIN * sd, least)
