"""Tandem of elliptical cams: effective road plane of the MF-Swift tyre model."""

from dataclasses import dataclass

import numpy as np

from trueterrain.profile.area import require_positive
from trueterrain.profile.envelope._strip import Float, GroundStrip
from trueterrain.profile.envelope._superellipse import Superellipse
from trueterrain.profile.envelope.disc import lines_to_the_edges, require_width
from trueterrain.profile.envelope.tyres import PASSENGER_TYRE, TyreData


@dataclass(frozen=True, kw_only=True)
class TandemCams:
    """Rows of rigid cams at the edges of the contact patch, each of which follows the ground.

    Front and rear row have `across` cams each, both sides `along` of them, corners included. The
    mean of front and rear row is the effective height, their difference over their distance the
    effective slope, the difference of the sides over the width the camber; the derivative of the
    slope along the path is the effective curvature.

    Notes
    -----
    A cam is a superellipse ``|x / half_length|^order + |z / half_height|^order = 1``, axes level,
    exact for ground that is linear between samples along the path. On ground that rises by m it
    is higher, as a disc is.

    Source: Schmeitz (2004), "A semi-empirical three-dimensional model of the pneumatic tyre rolling
    over arbitrarily uneven road surfaces", Delft; Pacejka (2012), "Tire and Vehicle Dynamics",
    section 10.1. Both were read in excerpts only: the rows, their mean and differences are as
    described there and in manuals of programs, the equations were not checked. Parameters: see
    `TyreData`.

    Examples
    --------
    >>> cams = TandemCams.of(PASSENGER_TYRE)
    >>> print(f"{cams.spacing:.3f} {cams.half_length:.3f} {cams.half_height:.3f} {cams.order}")
    0.110 0.461 0.302 1.5174
    """

    spacing: float = round(PASSENGER_TYRE.contact_length * PASSENGER_TYRE.cam_factors[0], 3)
    "Distance between front and rear row [m]."

    half_length: float = round(PASSENGER_TYRE.radius * PASSENGER_TYRE.cam_factors[1], 3)
    "Half axis of a cam along the path [m]."

    half_height: float = round(PASSENGER_TYRE.radius * PASSENGER_TYRE.cam_factors[2], 3)
    "Vertical half axis of a cam [m]."

    order: float = PASSENGER_TYRE.cam_order
    "Exponent of the superellipse, greater than 1; 2 is an ellipse."

    width: float = round(PASSENGER_TYRE.contact_width, 3)
    "Distance between the two sides [m]; 0 is a tandem of two cams."

    across: int = 10
    "Number of cams in the front row, and in the rear row."

    along: int = 10
    "Number of cams on either side, from the rear row to the front row."

    def __post_init__(self) -> None:
        """Check the sizes."""
        for name in ("spacing", "half_length", "half_height"):
            require_positive(name, getattr(self, name))
        if not 1 < self.order < float("inf"):
            message = f"order must be greater than 1, got {self.order}."
            raise ValueError(message)
        require_width(self.width, self.across, "across")
        require_width(self.width, self.along, "along")
        if self.width > 0 and min(self.across, self.along) < 2:
            message = (
                "across and along must be at least 2 if the cams have a width, got "
                f"{self.across} and {self.along}."
            )
            raise ValueError(message)

    @classmethod
    def of(cls, tyre: TyreData) -> "TandemCams":
        """Cams of a typical tyre.

        Parameters
        ----------
        tyre : TyreData
            Tyre.

        Returns
        -------
        TandemCams
            Under its rated load.
        """
        spacing, length, height = tyre.cam_factors
        return cls(
            spacing=tyre.contact_length * spacing,
            half_length=tyre.radius * length,
            half_height=tyre.radius * height,
            order=tyre.cam_order,
            width=tyre.contact_width,
        )

    @property
    def reach(self) -> float:
        """Longitudinal distance from the path point within which a cam may touch the ground [m]."""
        return self.half_length + self.spacing / 2

    @property
    def offsets(self) -> Float:
        """Offsets of the lines the cams follow, left positive [m]."""
        return lines_to_the_edges(self.width, self.across)

    def roll(self, strip: GroundStrip) -> dict[str, Float]:
        """Roll the cams over the ground.

        Parameters
        ----------
        strip : GroundStrip
            Ground under them.

        Returns
        -------
        dict
            ``height`` [m], ``slope`` [m/m], and with a width ``camber`` [m/m], positive if the
            left side is higher.
        """
        cam = Superellipse(
            half_length=self.half_length, half_height=self.half_height, order=self.order
        )
        lines = len(strip.height)
        front = self.spacing / 2
        row = list(range(lines))
        # front row, rear row, then the cams between them on the right and on the left side
        between = [float(x) for x in np.linspace(-front, front, self.along)[1:-1]]
        line, shift = row + row, [front] * lines + [-front] * lines
        if lines > 1:
            line += [0] * len(between) + [lines - 1] * len(between)
            shift += between + between
        height, _ = cam.stand_on(strip, [(i, i + 1) for i in range(lines)], line, shift)
        fore, aft = height[:, :lines].mean(axis=1), height[:, lines : 2 * lines].mean(axis=1)
        rolled = {"height": (fore + aft) / 2, "slope": (fore - aft) / self.spacing}
        if lines > 1:
            right, left = np.split(height[:, 2 * lines :], 2, axis=1)
            right = np.column_stack([height[:, 0], height[:, lines], right])
            left = np.column_stack([height[:, lines - 1], height[:, 2 * lines - 1], left])
            rolled["camber"] = (left.mean(axis=1) - right.mean(axis=1)) / self.width
        return rolled
