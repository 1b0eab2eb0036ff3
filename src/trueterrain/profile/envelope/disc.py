"""Rigid disc, or cylinder of the width of the tyre, that rolls over the ground."""

from dataclasses import dataclass

import numpy as np

from trueterrain.profile.area import require_positive
from trueterrain.profile.envelope._strip import Float, GroundStrip
from trueterrain.profile.envelope._superellipse import Superellipse
from trueterrain.profile.envelope.tyres import PASSENGER_TYRE, TyreData


@dataclass(frozen=True, kw_only=True)
class RigidDisc:
    """Rigid wheel, which touches the ground in one point.

    Notes
    -----
    z(s) = max of h(s + x, y) + sqrt(R^2 - x^2) - R over all x within the radius and all y within
    the width: a dilation of the ground by a cylinder with a level axis, exact for ground that is
    linear between samples along the path. The disc sinks R - sqrt(R^2 - g^2 / 4) into a gap of
    width g.

    On a longitudinal slope m the disc touches in front of its centre and is R (sqrt(1 + m^2) - 1)
    higher, on a cross slope m it is on one edge, ``|m| width / 2`` higher: constant on a constant
    slope.

    Examples
    --------
    >>> RigidDisc.of(PASSENGER_TYRE).radius
    0.3135
    """

    radius: float = PASSENGER_TYRE.radius
    "Free radius of the tyre [m]."

    width: float = round(PASSENGER_TYRE.contact_width, 3)
    "Width that touches the ground [m]; 0 is a disc."

    lines: int = 15
    "Number of lines across the width, edges included."

    def __post_init__(self) -> None:
        """Check the sizes."""
        require_positive("radius", self.radius)
        require_width(self.width, self.lines, "lines")

    @classmethod
    def of(cls, tyre: TyreData) -> "RigidDisc":
        """Disc of a typical tyre.

        Parameters
        ----------
        tyre : TyreData
            Tyre.

        Returns
        -------
        RigidDisc
            With its free radius and the width of its contact patch.
        """
        return cls(radius=tyre.radius, width=tyre.contact_width)

    @property
    def reach(self) -> float:
        """Longitudinal distance from the centre within which it may touch the ground [m]."""
        return self.radius

    @property
    def offsets(self) -> Float:
        """Offsets of the lines it rolls on, left positive [m]."""
        return lines_to_the_edges(self.width, self.lines)

    def roll(self, strip: GroundStrip) -> dict[str, Float]:
        """Roll the disc over the ground.

        Parameters
        ----------
        strip : GroundStrip
            Ground under it.

        Returns
        -------
        dict
            ``height`` [m], and ``slope`` of the ground or edge where it touches [m/m].
        """
        circle = Superellipse(half_length=self.radius, half_height=self.radius, order=2.0)
        height, slope = circle.stand_on(strip, [(0, len(strip.height))], [0], [0.0])
        return {"height": height[:, 0], "slope": slope[:, 0]}


def require_width(width: float, lines: int, name: str) -> None:
    """Check a width, which may be 0, and the number of lines across it."""
    if not 0 <= width < float("inf"):
        message = f"width must be at least 0 m, got {width}."
        raise ValueError(message)
    if lines != int(lines) or lines < 1:
        message = f"{name} must be a whole number of at least 1, got {lines}."
        raise ValueError(message)


def lines_to_the_edges(width: float, lines: int) -> Float:
    """Offsets of lines whose outer ones are the edges [m]; 0 if there is only one."""
    return np.linspace(-width / 2, width / 2, lines) if width > 0 and lines > 1 else np.zeros(1)


def lines_amid_strips(width: float, lines: int) -> Float:
    """Offsets of lines at the centres of equal strips [m]."""
    if width == 0:
        return np.zeros(1)
    return np.asarray(((np.arange(lines) + 0.5) / lines - 0.5) * width)
