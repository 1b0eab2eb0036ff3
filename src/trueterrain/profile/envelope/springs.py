"""Quasi-static tyre of radial springs under a tread band, at constant load."""

from dataclasses import dataclass

import numpy as np

from trueterrain.profile.area import require_positive
from trueterrain.profile.envelope import _kernels
from trueterrain.profile.envelope._strip import Float, GroundStrip
from trueterrain.profile.envelope.disc import lines_amid_strips, require_width
from trueterrain.profile.envelope.tyres import PASSENGER_TYRE, TyreData

#: Difference of spring force and load at convergence, as a fraction of the load.
LOAD_BALANCE = 1e-11

_MAX_ITERATIONS = 100  # far more than needed; each at least halves the bracket


@dataclass(frozen=True, kw_only=True)
class RadialSpringTyre:
    """Deformable tyre, quasi-static: the height of the hub at which it carries a constant load.

    Equal sections lie across the width. In each, radial springs act between hub and tread; a band
    of constant tension joins their ends and bridges short unevenness. There is no friction between
    ground and band, so that the tyre stores energy and dissipates none.

    Raises
    ------
    ValueError
        If a size is not greater than 0, the tyre would be pressed flat, or the contact patch is
        longer than the chord that level ground cuts out of the tyre, 2 sqrt(2 radius deflection):
        springs without a band have that chord for a patch.

    Notes
    -----
    Each section takes the shape w(theta) >= ground of least energy, the integral of
    (k w^2 + T (dw/ds)^2) / 2 over its tread, where w is the radial deflection and s the length of
    the tread. A band pressed down in one place rises from there as exp(-s / l), l = sqrt(T / k).
    The derivative of the energy with respect to the height of the hub is the load, that with
    respect to its longitudinal position the resistance: their ratio is the slope of the effective
    road, and its integral along the path the height gained.

    Two measured numbers determine k and l: on level ground the tyre deflects by d = rated_load /
    stiffness, and its patch has the half length c, where the band leaves the ground without a kink:
    l = (radius d - c^2 / 2) / c. Over a cleat shorter than the patch the hub rises twice, as the
    cleat enters and leaves, with a dip between, since a cleat at the centre of the patch lifts the
    tread off the ground on both sides.

    The height is that of the hub less its height over level ground under the same load. On ground
    that rises by m it is about (radius - d) (sqrt(1 + m^2) - 1) higher.

    Source: radial springs that envelop the ground, Davis (1975), "A radial-spring terrain-
    enveloping tire model", Vehicle System Dynamics 4 (abstract read); the band and the solution
    are ours. Parameters: see `TyreData`.

    Examples
    --------
    >>> tyre = RadialSpringTyre.of(PASSENGER_TYRE)
    >>> print(f"{tyre.band_length:.3f}")
    0.058
    """

    radius: float = PASSENGER_TYRE.radius
    "Free radius [m]."

    width: float = round(PASSENGER_TYRE.contact_width, 3)
    "Width of the tread that touches the ground [m]; 0 is a single section."

    load: float = PASSENGER_TYRE.load
    "Vertical load [N]."

    rated_load: float = PASSENGER_TYRE.load
    "Vertical load at which stiffness and contact length hold [N]."

    stiffness: float = PASSENGER_TYRE.stiffness
    "Rated load over deflection, on level ground [N/m]."

    contact_length: float = round(PASSENGER_TYRE.contact_length, 3)
    "Length of the contact patch on level ground under the rated load [m]."

    sections: int = 7
    "Number of sections across the width."

    def __post_init__(self) -> None:
        """Check the parameters."""
        for name in ("radius", "contact_length"):
            require_positive(name, getattr(self, name))
        for name, unit in {"load": "N", "rated_load": "N", "stiffness": "N/m"}.items():
            if not 0 < getattr(self, name) < float("inf"):
                message = f"{name} must be greater than 0 {unit}, got {getattr(self, name)}."
                raise ValueError(message)
        require_width(self.width, self.sections, "sections")
        deflection = self.rated_load / self.stiffness
        if deflection > self.radius / 2:
            message = (
                "stiffness must be such that the rated load deflects the tyre by less than half of "
                f"its radius, got {deflection:g} m of {self.radius:g} m."
            )
            raise ValueError(message)
        chord = 2 * (2 * self.radius * deflection) ** 0.5
        if self.contact_length >= chord:
            message = (
                f"contact_length must be less than {chord:.3g} m, the chord that level ground cuts "
                f"out of this tyre, got {self.contact_length:g}."
            )
            raise ValueError(message)

    @classmethod
    def of(cls, tyre: TyreData, *, load: float | None = None) -> "RadialSpringTyre":
        """Springs of a typical tyre.

        Parameters
        ----------
        tyre : TyreData
            Tyre.
        load : float, optional
            Vertical load [N]; by default its rated load.

        Returns
        -------
        RadialSpringTyre
            With its stiffness and contact patch.
        """
        return cls(
            radius=tyre.radius,
            width=tyre.contact_width,
            load=tyre.load if load is None else load,
            rated_load=tyre.load,
            stiffness=tyre.stiffness,
            contact_length=tyre.contact_length,
        )

    @property
    def band_length(self) -> float:
        """Decay length of the tread band, sqrt(tension / stiffness of the springs) [m]."""
        half = self.contact_length / 2
        return (self.radius * self.rated_load / self.stiffness - half**2 / 2) / half

    @property
    def reach(self) -> float:
        """Longitudinal distance from the hub within which it may touch the ground [m]."""
        return self.radius

    @property
    def offsets(self) -> Float:
        """Offsets of the centres of its sections, left positive [m]."""
        return lines_amid_strips(self.width, self.sections)

    def roll(self, strip: GroundStrip) -> dict[str, Float]:
        """Roll the tyre over the ground.

        Parameters
        ----------
        strip : GroundStrip
            Ground under it.

        Returns
        -------
        dict
            ``height`` [m], and ``slope`` of the effective road, resistance over load [m/m].
        """
        tension = self.tension(strip.step, len(strip.height))
        level = np.zeros((len(strip.height), 2 * int(self.radius / strip.step) + 3))
        over_level, _ = self._hubs(level, level.shape[1] // 2, 1, strip.step, tension, 1)
        hub, slope = self._hubs(
            strip.height, strip.first, strip.stride, strip.step, tension, strip.count
        )
        return {"height": hub - over_level, "slope": slope}

    def tension(self, step: float, sections: int) -> float:
        """Tension of the band of one section, from its deflection on level ground.

        Parameters
        ----------
        step : float
            Distance between samples of the ground [m].
        sections : int
            Number of sections that carry the load.

        Returns
        -------
        float
            Tension [N].
        """
        # the force is proportional to the tension: solve on level ground at unit tension
        reach = int(self.radius / step)
        level = np.zeros(2 * reach + 1)
        hub = self.radius - self.rated_load / self.stiffness
        unit, _, _ = _kernels.section_forces(
            level,
            0,
            level.size,
            -reach * step,
            step,
            hub,
            self.radius,
            self.decay,
            1.0,
            np.empty((4, level.size)),
        )
        return float(self.rated_load / (sections * unit))

    @property
    def decay(self) -> float:
        """Decay length of the tread band as an angle [rad]."""
        return self.band_length / self.radius

    def _hubs(
        self, ground: Float, first: int, stride: int, step: float, tension: float, count: int
    ) -> tuple[Float, Float]:
        """Heights of the hub [m] and slopes of the force on it."""
        height, slope = np.empty(count), np.empty(count)
        _kernels.hub_heights(
            ground,
            first,
            stride,
            step,
            self.radius,
            self.decay,
            tension,
            self.load,
            self.rated_load / self.stiffness,
            LOAD_BALANCE,
            _MAX_ITERATIONS,
            height,
            slope,
        )
        return height, slope
