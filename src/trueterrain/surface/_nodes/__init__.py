"""Heights, standard deviations and counts of nodes from the sums of their cells."""

from trueterrain.surface._nodes._disc import halo_of
from trueterrain.surface._nodes._rows import ROWS, NodeValues, compute_nodes

__all__ = ["ROWS", "NodeValues", "compute_nodes", "halo_of"]
