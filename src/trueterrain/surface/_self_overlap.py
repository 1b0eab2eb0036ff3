"""Self-overlap of a grid along a line that crosses or repeats itself.

The same ground would then be in two parts of the grid, and each return in one of them only.
"""

import numpy as np
import numpy.typing as npt

from trueterrain.surface.cells import Grid

Floats = npt.NDArray[np.float64]

_STEPS = 8  # per width at which the grid is checked
_TOUCH = 0.02  # fraction of the width by which parts may overlap: ends that meet, chords of bends


def find_self_overlap(grid: Grid) -> tuple[float, float] | None:
    """Stations of the first place where a grid along a line lies over an earlier part of itself.

    A bend does not overlap itself, since `grid_along` demands a radius greater than the half width;
    so only parts further apart than half a circle of that radius are compared.
    """
    from scipy.spatial import KDTree

    frame, width = grid.frame, float(grid.v[-1] - grid.v[0])
    every = max(1, int(width / (_STEPS * grid.spacing[0])))
    rows = np.unique(np.append(np.arange(1, frame.u.size - 2, every), frame.u.size - 2))
    # both ends of the cross-sections, and the quadrangles between them, shape (n, corner, axis)
    ends = np.stack(
        [
            frame.origin_easting[rows, None] + grid.v[[0, -1]] * frame.normal_easting[rows, None],
            frame.origin_northing[rows, None] + grid.v[[0, -1]] * frame.normal_northing[rows, None],
        ],
        axis=-1,
    )
    parts = np.concatenate([ends[:-1], ends[1:, ::-1]], axis=1)
    station = frame.u[rows]
    size = np.linalg.norm(parts[:, [0, 1]] - parts[:, [2, 3]], axis=-1).max(initial=0.0)
    pairs = KDTree(parts.mean(axis=1)).query_pairs(size, output_type="ndarray")
    pairs = pairs[station[pairs[:, 1]] - station[pairs[:, 0]] > 0.5 * np.pi * width]
    met = pairs[_overlap_depth(parts[pairs[:, 0]], parts[pairs[:, 1]]) > _TOUCH * width]
    if not met.size:
        return None
    first, second = met[np.lexsort(met.T)[0]]
    return float(station[first]), float(station[second])


def _overlap_depth(a: Floats, b: Floats) -> Floats:
    """Penetration depth of convex quadrangles, shape (n,) [m]; not positive if they are apart.

    Separating axis theorem: they are apart if their projections on the normal of a side are.
    """
    sides = np.concatenate([np.roll(one, -1, axis=1) - one for one in (a, b)], axis=1)
    across = np.stack([-sides[..., 1], sides[..., 0]], axis=-1)
    across /= np.linalg.norm(across, axis=-1, keepdims=True)
    on_a, on_b = (np.einsum("nsk,nck->nsc", across, one) for one in (a, b))
    reach = np.minimum(on_a.max(-1), on_b.max(-1)) - np.maximum(on_a.min(-1), on_b.min(-1))
    return np.asarray(reach.min(axis=1, initial=np.inf))
