"""Ground from a measured surface."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from trueterrain.core import provenance
from trueterrain.core.schemas import check_surface
from trueterrain.simulate.ground._ground import Floats, Ground


@dataclass(frozen=True, kw_only=True, eq=False)
class Measured(Ground):
    """Measured surface as ground: bilinear between its nodes, NaN outside and in holes.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_surface
    >>> ramp = make_surface([[0.0, 1.0], [0.0, 1.0]], easting=[0, 1], northing=[0, 1])
    >>> Measured(surface=ramp).height([0.25, 2.0], 0.5)
    array([0.25,  nan])
    """

    surface: xr.Dataset
    "Surface along a reference line, or map."

    def __post_init__(self) -> None:
        check_surface(self.surface)

    @classmethod
    def from_file(cls, path: str | Path) -> "Measured":
        """Ground from an OpenCRG file.

        Parameters
        ----------
        path : str or Path
            The file.

        Raises
        ------
        FormatError
            If it is damaged or not an OpenCRG file.
        """
        from trueterrain.formats import opencrg

        return cls(surface=opencrg.read(path))

    def _height(self, x: Floats, y: Floats) -> Floats:
        from trueterrain.surface.evaluate import heights_at

        return np.asarray(heights_at(self.surface, x, y))

    def to_dict(self) -> dict[str, Any]:
        """Kind of the ground and the provenance of its surface."""
        return {"kind": "Measured", "steps": provenance.provenance_steps(self.surface)}
