"""Rigid shapes that touch the ground: discs, superellipses and tandems of elliptical cams."""

from dataclasses import dataclass

import numpy as np

from trueterrain.profile.area import require_positive
from trueterrain.profile.envelope import _kernels
from trueterrain.profile.envelope._strip import Float, GroundStrip
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


@dataclass(frozen=True, kw_only=True)
class Superellipse:
    """Lower half of a superellipse with a level and a vertical axis."""

    half_length: float
    "Half axis along the path [m]."

    half_height: float
    "Vertical half axis [m]."

    order: float
    "Exponent; 2 is an ellipse."

    def drop(self, x: Float) -> Float:
        """Height of the outline above its lowest point [m]; infinite beyond its ends."""
        fraction = np.abs(x) / self.half_length
        inside = np.minimum(fraction, 1.0) ** self.order
        above = self.half_height * (1 - (1 - inside) ** (1 / self.order))
        return np.where(fraction <= 1, above, np.inf)

    def slope(self, x: Float) -> Float:
        """Slope of the outline [m/m]; infinite at its ends and beyond."""
        fraction = np.abs(x) / self.half_length
        inside = np.minimum(fraction, 1.0) ** self.order
        with np.errstate(divide="ignore"):
            steepness = (inside / (1 - inside)) ** ((self.order - 1) / self.order)
        slope = steepness * self.half_height / self.half_length
        return np.sign(x) * np.where(fraction < 1, slope, np.inf)

    def stand_on(
        self,
        strip: GroundStrip,
        groups: list[tuple[int, int]],
        group: list[int],
        shift: list[float],
    ) -> tuple[Float, Float]:
        """Heights of cams on the ground, and the slope at the point of contact.

        Parameters
        ----------
        strip : GroundStrip
            Ground.
        groups : list of tuple of int
            First line, and one after the last, of each group of lines.
        group : list of int
            Group of lines under each cam.
        shift : list of float
            Longitudinal position of each cam relative to the path point [m].

        Returns
        -------
        height, slope : numpy.ndarray, shape (s, cam)
            Height of the lowest point of each cam [m] and slope of its tangent there [m/m]; NaN
            where there is no ground under it.
        """
        samples = int(2 * self.half_length / strip.step) + 1  # under a cam, at most
        position = np.array(shift)
        lead = np.ceil((position - self.half_length) / strip.step).astype(np.int64)
        x = (lead[:, None] + np.arange(-1, samples + 1)) * strip.step - position[:, None]
        top = np.stack([np.fmax.reduce(strip.height[begin:end]) for begin, end in groups])
        height = np.empty((strip.count, len(group)))
        slope = np.empty_like(height)
        _kernels.cam_heights(
            strip.height,
            top,
            np.array(group),
            np.array(groups),
            strip.first,
            strip.stride,
            strip.step,
            lead,
            self.drop(x[:, 1:-1]),
            self.slope(x),
            *self._bounds(x, strip.step),
            position,
            self.half_length,
            self.half_height,
            self.order,
            height,
            slope,
        )
        return height, slope

    def _bounds(self, x: Float, step: float) -> tuple[Float, Float]:
        """Lower bounds of the drop between samples, relative to either sample.

        A piece of ground can hold the cam no higher than its end heights less these bounds. The
        outline is convex: between two samples it lies below its chord by at most a quarter of the
        step times the change of its slope. Beyond its ends it counts as at least as high as within.
        """
        drop, slope = self.drop(x), self.slope(x)
        begin, end = drop[:, :-1], drop[:, 1:]
        with np.errstate(invalid="ignore"):
            bulge = step / 4 * np.diff(slope, axis=1)
            at_end = np.minimum(begin, end)  # at an end of the cam, or infinite beyond it
            inner = np.isfinite(bulge)
            return np.where(inner, begin - bulge, at_end), np.where(inner, end - bulge, at_end)


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
