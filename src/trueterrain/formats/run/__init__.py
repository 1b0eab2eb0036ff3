"""Runs: what a mobile profiler recorded, as a Zarr 3 group ``NAME.zarr``.

An `xarray.DataTree` with attributes ``kind``, ``schema``, ``name``, ``origin`` (longitude deg,
latitude deg, ellipsoidal height m of the local east-north-up frame), ``time_reference`` (``"gps"``
or ``"run"``) and ``mounting``, and these groups:

==================  =============================================================================
``scans``           ``time`` (scan) [s] of the first beam of each scan; ``range`` (scan, beam) [m],
                    NaN where there was no return; optional ``intensity``; ``angle`` (beam) [rad]
                    from straight down, positive to the left; ``delay`` (beam) [s] after ``time``
``navigation``      see `trueterrain.formats.navigation`
``accelerometers``  ``time`` (sample) [s]; ``acceleration`` (sample, sensor) [m/s²], the specific
                    force along body z; ``position`` (sensor, axis) [m] in the body; optional
``truth``           what a simulation knows; optional
==================  =============================================================================

Beam by beam, a return was measured at ``time + delay + mounting["scanner_clock"]``, true time.
Everything is chunked along time. Ranges are kept in steps of 0.1 mm, two bytes each; all times and
the navigation are kept exactly. Chunks carry a checksum, and the attribute ``arrays`` lists what
must be there: a run that lacks an array or a chunk is not opened, and a chunk that is damaged is an
error when it is read. Runs of earlier versions have neither checksums nor list, and are opened if
no chunk is missing.

`RunWriter` writes a run block by block, `open_run` opens it lazily, `scan_blocks` reads its scans,
`check_run` says what is wrong with it, `import_run` makes one from flat files.
"""

from trueterrain.formats._zarr import StoredArray
from trueterrain.formats.run._copy import write
from trueterrain.formats.run._describe import describe
from trueterrain.formats.run._import import (
    AccelerometerTable,
    NavigationFiles,
    RunFiles,
    ScanTable,
    import_run,
)
from trueterrain.formats.run._open import open_run, scan_blocks
from trueterrain.formats.run._rules import check_run
from trueterrain.formats.run._schema import Mounting
from trueterrain.formats.run._write import RunWriter

__all__ = [
    "AccelerometerTable",
    "Mounting",
    "NavigationFiles",
    "RunFiles",
    "RunWriter",
    "ScanTable",
    "StoredArray",
    "check_run",
    "describe",
    "import_run",
    "open_run",
    "read",
    "scan_blocks",
    "write",
]

#: As every format calls it.
read = open_run
