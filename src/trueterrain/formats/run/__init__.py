"""Runs: recordings of a mobile profiler, as Zarr 3 groups ``NAME.zarr``.

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
``truth``           true values of a simulated run; optional
==================  =============================================================================

A return is measured at the true time ``time + delay + mounting["scanner_clock"]`` of its beam. All
arrays are chunked along time. Ranges are stored in steps of 0.1 mm, two bytes each; times and
navigation are stored exactly. Chunks carry a checksum, and the attribute ``arrays`` lists the
required arrays: a run that lacks an array or a chunk is not opened, and a damaged chunk is an error
when it is read. Runs of earlier versions have neither checksums nor list; they are opened if no
chunk is missing.

`RunWriter` writes a run block by block. `open_run` opens it lazily, once: all stages take the `Run`
that it returns. `scan_blocks` reads its scans, `check_run` checks it, `import_run` converts flat
files to a run.
"""

from trueterrain.core.schemas.run import Mounting
from trueterrain.formats._zarr import StoredArray
from trueterrain.formats.run._copy import write
from trueterrain.formats.run._describe import describe
from trueterrain.formats.run._handle import Run
from trueterrain.formats.run._import import (
    AccelerometerTable,
    NavigationFiles,
    RunFiles,
    ScanTable,
    import_run,
)
from trueterrain.formats.run._open import open_run, scan_blocks
from trueterrain.formats.run._write import RunWriter
from trueterrain.formats.run.rules import check_run

__all__ = [
    "AccelerometerTable",
    "Mounting",
    "NavigationFiles",
    "Run",
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

#: The name that all formats have.
read = open_run
