"""The command ``trueterrain plot``: a picture of a surface, a point cloud or a profile."""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from trueterrain.cli._console import note


def plot(
    file: Path,
    /,
    *more: Path,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    frame: Literal["grid", "ground"] = "grid",
    resolution: float = 160.0,
    force: bool = False,
) -> None:
    """Draw a surface, a point cloud, or one or several profiles.

    Example: `trueterrain plot tyre.erd point.erd -o both.svg`

    Parameters
    ----------
    file
        Surface, point cloud or profile, in any format that is read.
    more
        More profiles, drawn into the same picture.
    output
        Picture to write: .svg, .pdf or .png.
    frame
        Whether a surface with a reference line is drawn over station and offset, which straightens
        it, or over the ground.
    resolution
        Resolution of a PNG picture [dots per inch].
    force
        Replace the output if it exists.
    """
    from trueterrain import figures, formats
    from trueterrain.engine import require_writable
    from trueterrain.kinds import kind_of

    require_writable(output, force=force)
    data = {str(path): formats.open(path) for path in (file, *more)}
    kinds = {name: kind_of(item) for name, item in data.items()}
    if more and set(kinds.values()) != {"profile"}:
        other = next(name for name, kind in kinds.items() if kind != "profile")
        message = f"{other}: only profiles are drawn together. Plot it alone."
        raise ValueError(message)
    first = data[str(file)]
    match kinds[str(file)]:
        case "surface":
            axes = figures.surface_map(first, frame=frame)
        case "points":
            axes = figures.points_map(first)
        case _:
            axes = figures.profiles({Path(name).name: item for name, item in data.items()})
    figures.save(axes, output, force=force, resolution=resolution)
    note(f"{output}: written")
