"""What the format of an output cannot hold."""

from pathlib import Path
from typing import TYPE_CHECKING

from trueterrain.cli._console import write_note

if TYPE_CHECKING:
    import xarray as xr


def note_lost(data: "xr.Dataset", output: Path) -> None:
    """Say what the format of the output cannot hold."""
    kept = {
        ".erd": ("height",),
        ".crg": ("height", "easting", "northing", "heading", "elevation", "banking", "filled"),
    }.get(output.suffix.lower())
    lost = [str(name) for name in data.data_vars if kept is not None and name not in kept]
    if data.attrs.get("crs") and output.suffix.lower() in (".csv", ".erd"):
        lost.append("CRS")
    if data.attrs.get("not_read"):
        write_note(f"{output}: not kept, since it is not read: {data.attrs['not_read']}")
    if lost:
        write_note(f"{output}: not kept, since the format cannot hold it: {', '.join(lost)}")
