"""Points, surfaces and profiles as Zarr 3 groups ``NAME.zarr``: lossless, block by block.

These stores hold results; recorded runs have a format of their own, `trueterrain.formats.run`.

================  =============================================================================
``NAME.zarr``     attributes of the dataset: ``kind`` (``"trueterrain/points"``, ``".../surface"``
                  or ``".../profile"``), ``schema``, ``crs``, ``provenance`` and all others
``height``, ...   an array for each variable and axis, with its name and precision, in chunks of
                  rows: points, cross-sections, samples
``summary``       list of the arrays, and their statistics for `describe`; for points also the
                  ``bounds`` of each chunk, so that a spatial query reads only chunks it touches
================  =============================================================================

Chunks are compressed (zstd of shuffled bytes) and carry a checksum. A store appears when it is
complete; arrays and chunks that are lost or damaged later are detected when it is read.
`xarray.open_zarr` opens the same data.
"""

from trueterrain.formats.signature import kind_of_store as kind
from trueterrain.formats.store._describe import describe
from trueterrain.formats.store._read import blocks, point_variables, read
from trueterrain.formats.store._surface import SurfaceStore, open_surface
from trueterrain.formats.store._write import write

__all__ = [
    "SurfaceStore",
    "blocks",
    "describe",
    "kind",
    "open_surface",
    "point_variables",
    "read",
    "write",
]
