"""The numbers of a surface from the sums of its cells."""

from trueterrain.surface._finish._disc import halo_of
from trueterrain.surface._finish._rows import ROWS, Nodes, finish

__all__ = ["ROWS", "Nodes", "finish", "halo_of"]
