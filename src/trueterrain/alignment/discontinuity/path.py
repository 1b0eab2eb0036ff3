"""Reference paths with equally spaced reference points, and coordinates along them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from trueterrain.alignment.observations.sparse_sums import Floats
from trueterrain.core.errors import SchemaError
from trueterrain.geometry.curve import CurveCoordinates, PlaneCurve
from trueterrain.geometry.grid_frame import GridFrame


@dataclass(frozen=True, kw_only=True, eq=False)
class ReferencePath:
    """Curve along which passes are compared at equally spaced points (thesis 4.3.1).

    More than its curve, since the places of comparison follow the overlap while the curve stays
    smooth, and since the stations of a circle are exact where those of its chords are not.
    """

    curve: PlaneCurve
    "Reference points, equally spaced; stations begin at 0."

    centre: tuple[float, float] | None = None
    "Easting and northing of the centre, if stations are polar angles times the radius [m]."

    lateral: Floats | None = None
    """Lateral distance from the path at which heights are compared, to the left positive, shape
    (s,) [m]. It follows the centre of the overlap, so that the path stays smooth. By default 0."""

    def __post_init__(self) -> None:
        """Check that the path is smooth and its points are equally spaced."""
        _ = self.curve.spacing
        if self.curve.closed and len(self.curve) < 3:
            message = f"a closed reference path needs at least 3 points, got {len(self.curve)}."
            raise ValueError(message)
        if self.lateral is not None and not (
            self.lateral.shape == self.curve.s.shape and np.isfinite(self.lateral).all()
        ):
            message = "lateral must hold a finite offset for each reference point."
            raise ValueError(message)
        if self.centre is None:
            try:
                _ = self.curve.sections
            except SchemaError as error:
                message = f"a reference path must be smooth: {error.place}, {error.problem}."
                raise ValueError(message) from None

    @cached_property
    def places(self) -> tuple[Floats, Floats]:
        """Eastings and northings where heights are compared, shape (s,) each [m]."""
        curve = self.curve
        if self.lateral is None:
            return curve.easting, curve.northing
        cos, sin = np.cos(curve.heading), np.sin(curve.heading)
        return curve.easting - self.lateral * sin, curve.northing + self.lateral * cos

    def locate(self, easting: npt.ArrayLike, northing: npt.ArrayLike) -> CurveCoordinates:
        """Stations and offsets of positions.

        Parameters
        ----------
        easting, northing : array_like, shape (n,)
            Positions [m].

        Returns
        -------
        CurveCoordinates
            NaN where a position is not finite.
        """
        if self.centre is None:
            return self.curve.project(easting, northing)
        x, y = (np.ravel(np.asarray(at, dtype=float)) for at in (easting, northing))
        (cx, cy), curve = self.centre, self.curve
        radius = float(np.hypot(curve.easting[0] - cx, curve.northing[0] - cy))
        begin = np.arctan2(curve.northing[0] - cy, curve.easting[0] - cx)
        sense = 1.0 if np.sin(curve.heading[0] - begin) > 0 else -1.0  # counter-clockwise or not
        angle = sense * (np.arctan2(y - cy, x - cx) - begin) % (2 * np.pi)
        return CurveCoordinates(
            radius * angle % curve.length,
            sense * (radius - np.hypot(x - cx, y - cy)),
            np.zeros(x.size, np.bool_),
        )

    def frame(self, half_width: float, beyond: float = 0.0) -> GridFrame:
        """Grid frame of the strip along the path.

        Parameters
        ----------
        half_width : float
            Half of its width [m].
        beyond : float
            Straight extension beyond both ends [m]; a closed path continues around.

        Returns
        -------
        GridFrame
            Its u is the station; beyond 0 and the length for a closed path.
        """
        count = int(np.ceil(beyond / self.curve.spacing - 1e-9))
        curve = self.curve.extend(max(count, int(self.curve.closed)))
        return GridFrame(curve=curve, v=np.array([-half_width, half_width]))
