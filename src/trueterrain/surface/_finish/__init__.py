"""The numbers of a surface from the sums of its cells."""

from trueterrain.surface._finish._disc import halo_of
from trueterrain.surface._finish._rows import ROWS, NodeValues, finish_sums

__all__ = ["ROWS", "NodeValues", "finish_sums", "halo_of"]
