"""Points, surfaces and profiles as Zarr 3 groups ``NAME.zarr``: without any loss, block by block.

Beside recorded runs, `trueterrain.formats.run`, these stores hold what is made of them:

================  =============================================================================
``NAME.zarr``     attributes of the dataset: ``kind`` (``"trueterrain/points"``, ``".../surface"``
                  or ``".../profile"``), ``schema``, ``crs``, ``provenance`` and all others
``height``, ...   an array for each variable and axis, as it is called and in the precision that it
                  has, in chunks of rows: points, cross-sections, samples
``summary``       which arrays there must be, and what `describe` says of them; of points also the
                  ``bounds`` of each chunk, so that only those are read that touch a place
================  =============================================================================

Chunks are compressed (zstd of shuffled bytes) and carry a checksum. A store appears when it is
whole; arrays and chunks that are lost or damaged later are found when it is read.
`xarray.open_zarr` opens the same data.
"""

from trueterrain.formats.signature import kind_of_store as kind
from trueterrain.formats.store._describe import describe
from trueterrain.formats.store._read import blocks, point_variables, read
from trueterrain.formats.store._write import write

__all__ = ["blocks", "describe", "kind", "point_variables", "read", "write"]
