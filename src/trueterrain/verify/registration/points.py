"""Points in which a plate was looked for, so that its registration can be recomputed."""

import numpy as np
import xarray as xr

from trueterrain.verify.registration.search import Registration
from trueterrain.verify.results import Floats


def registered_points(
    along: Floats, up: Floats, found: Registration, assumed: float | None
) -> xr.Dataset:
    """Measured points on the plate, where it was found and where it was assumed.

    Parameters
    ----------
    along, up : numpy.ndarray, shape (n,)
        Measured coordinates and heights [m].
    found : Registration
        Where the plate is.
    assumed : float, optional
        Where it was assumed to begin [m].

    Returns
    -------
    xarray.Dataset
        ``up`` over ``along``, in its order [m].
    """
    begins = [found.shift, found.shift if assumed is None else assumed]
    length = found.length * (1.0 + found.stretch)
    kept = np.flatnonzero((along >= min(begins)) & (along <= max(begins) + length))
    order = kept[np.argsort(along[kept], kind="stable")]
    return xr.Dataset({"up": ("along", up[order])}, {"along": along[order]})
