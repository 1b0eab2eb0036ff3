"""How work is carried out: whole outputs or none, progress, blocks."""

from trueterrain.engine.output import require_writable, whole_folder, whole_output
from trueterrain.engine.progress import Progress, no_progress
from trueterrain.engine.readback import Checksums, not_whole, refuse_full_disk

__all__ = [
    "Checksums",
    "Progress",
    "no_progress",
    "not_whole",
    "refuse_full_disk",
    "require_writable",
    "whole_folder",
    "whole_output",
]
