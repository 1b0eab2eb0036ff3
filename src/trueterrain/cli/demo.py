"""The command ``trueterrain demo``: the whole way on a road made for the purpose."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from trueterrain.cli._console import compiling_noted, note, out, out_json, progress_bar

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

    from trueterrain.profile import WheelPath

_WIDTH = 2.0  # [m]
_SPACING = 0.005  # [m] of the grid: fine enough to show a stone of 25 mm
_OFFSET = 0.3  # [m] of the path from the middle of the road
_LINES = (-0.03, -0.015, 0.0, 0.015, 0.03)  # [m] bare lines beside the path, for the pictures
_SHOWN = (4.0, 6.0)  # [m] part of the road that is drawn
_SHORTEST, _LONGEST = 12.0, 500.0  # [m] of the road: all that is shown, and what memory holds


def demo(
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])] = Path("demo"),
    length: float = 30.0,
    seed: int = 2009,
    json: bool = False,
    force: bool = False,
) -> None:
    """Make a Belgian block road, extract the profile a tyre feels, and rate it.

    The road is Belgian block with loose stones on it, made from a seed. The profile that a tyre
    feels (the median of the heights within 25 mm) is compared with the bare line that a point laser
    would see. Needs no input; writes files and pictures.

    Example: `trueterrain demo -o demo`

    Parameters
    ----------
    output
        Folder for the results.
    length
        Length of the road [m].
    seed
        Seed of the road: the same seed gives the same road.
    json
        Print the numbers as one JSON document.
    force
        Write into a folder that holds files already.
    """
    from trueterrain import figures, formats
    from trueterrain.engine import whole_folder
    from trueterrain.profile import Disc, Median, offset_path, point_profile, tyre_profile
    from trueterrain.simulate.ground import BelgianBlock, Stones, sample_road

    if not _SHORTEST <= length <= _LONGEST:
        message = f"length must be from {_SHORTEST:g} m to {_LONGEST:g} m, got {length:g}."
        raise ValueError(message)
    ground = BelgianBlock(seed=seed) + Stones(seed=seed + 1)
    with (
        whole_folder(output, force=force) as folder,
        compiling_noted(),
        progress_bar() as progress,
    ):
        note("making the road ...")
        road = sample_road(
            ground, length=length, width=_WIDTH, spacing_u=_SPACING, spacing_v=_SPACING
        )
        note("extracting profiles ...")
        path = offset_path(road, _OFFSET, spacing=_SPACING)
        tyre = tyre_profile(road, path, area=Disc(), statistic=Median(), progress=progress)
        point = point_profile(road, path)
        numbers = _numbers(tyre, point)
        note("writing files and pictures ...")
        formats.write(road, folder / "road.crg")
        for name, profile in (("tyre", tyre), ("point", point)):
            formats.write(profile, folder / f"{name}.erd")
            formats.write(profile, folder / f"{name}.csv")
        for name, figure in _figures(road, path, tyre, point):
            figures.save(figure, folder / f"{name}.png")
        _write_json(numbers, folder / "result.json")
        written = sorted(file.name for file in folder.iterdir())
    if json:
        out_json({**numbers, "folder": str(output), "files": written})
        return
    _print(numbers, length, output, written)


def _numbers(tyre: "xr.Dataset", point: "xr.Dataset") -> dict[str, Any]:
    """What the comparison of the two profiles amounts to."""
    import numpy as np

    from trueterrain.roughness import iri

    difference = tyre.height.values - point.height.values
    return {
        "iri_point": float(iri(point).iri[0]),
        "iri_tyre": float(iri(tyre).iri[0]),
        "rms_difference": float(np.sqrt(np.mean(difference**2))),
        "largest_difference": float(np.abs(difference).max()),
        "rms_step_point": _rms_step(point),
        "rms_step_tyre": _rms_step(tyre),
        "median_sd": float(np.median(tyre.sd)),
    }


def _rms_step(profile: "xr.Dataset") -> float:
    """RMS height difference of neighbouring path points [m]: what joints and stones amount to."""
    import numpy as np

    return float(np.sqrt(np.mean(np.diff(profile.height) ** 2)))


def _figures(
    road: "xr.Dataset", path: "WheelPath", tyre: "xr.Dataset", point: "xr.Dataset"
) -> Iterator[tuple[str, Any]]:
    """Draw the pictures one after the other, each closed when the next is asked for."""
    from matplotlib import pyplot as plt

    from trueterrain import figures
    from trueterrain.profile import height_distributions, offset_path, point_profile

    shown = slice(*_SHOWN)
    roughest = int(abs(tyre.height.values - point.height.values).argmax())
    part = path.part(max(roughest - 1, 0), roughest + 1)
    distribution = height_distributions(road, part)[min(roughest, 1)]
    beside = {
        line: point_profile(road, offset_path(road, _OFFSET + line, spacing=_SPACING)).sel(s=shown)
        for line in _LINES
    }
    pictures: dict[str, Callable[[], Axes]] = {
        "road": lambda: figures.surface_map(road.sel(u=shown), path=path),
        "profiles": lambda: figures.parallel_profiles(beside, tyre.sel(s=shown)),
        "difference": lambda: figures.profile_difference(point.sel(s=shown), tyre.sel(s=shown)),
        "search-area": lambda: figures.search_area_map(road, path, station=path.s[roughest]),
        "distribution": lambda: figures.cpf(distribution),
    }
    for name, draw in pictures.items():
        figure = draw().figure
        yield name, figure
        plt.close(figure)


def _write_json(numbers: dict[str, Any], file: Path) -> None:
    import json

    file.write_text(json.dumps(numbers, indent=2) + "\n")


def _print(numbers: dict[str, Any], length: float, output: Path, written: list[str]) -> None:
    millimetres = {name: 1e3 * value for name, value in numbers.items()}
    rows = [
        (f"{length:g} m of Belgian block with stones", "point laser", "tyre"),
        ("IRI [m/km]", f"{numbers['iri_point']:.2f}", f"{numbers['iri_tyre']:.2f}"),
        (
            "RMS step from point to point [mm]",
            f"{millimetres['rms_step_point']:.2f}",
            f"{millimetres['rms_step_tyre']:.2f}",
        ),
    ]
    for what, of_point, of_tyre in rows:
        out(f"{what:40} {of_point:>12} {of_tyre:>12}")
    out(
        f"The tyre (median within 25 mm, sd {millimetres['median_sd']:.2f} mm) and the point laser "
        f"differ by {millimetres['rms_difference']:.2f} mm RMS, "
        f"{millimetres['largest_difference']:.1f} mm at most."
    )
    out(f"{output}/: {', '.join(written)}")
