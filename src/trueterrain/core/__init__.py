"""Shared foundations: errors, schemas, provenance, atomic outputs, progress, statistics."""

from trueterrain.core.output import (
    require_writable,
    whole_folder,
    whole_output,
    whole_store,
    whole_stores,
)
from trueterrain.core.progress import Progress, no_progress
from trueterrain.core.readback import Checksums, not_whole

__all__ = [
    "Checksums",
    "Progress",
    "no_progress",
    "not_whole",
    "require_writable",
    "whole_folder",
    "whole_output",
    "whole_store",
    "whole_stores",
]
