"""A surface to turn and zoom, and the same surface seen from above for paper."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.kinds import check_profile, check_surface
from trueterrain.report import _picture
from trueterrain.report._surface import Blocks, reduce_surface, round_below
from trueterrain.report.parts import SurfaceView

Floats = npt.NDArray[np.float64]

_NAMES = {"height": "Height", "sd": "Standard deviation", "count": "Count per node"}
_CHOICES = (1.0, 5.0, 20.0)  # vertical exaggerations that every page offers
_STEPS = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
_RELIEF = 0.15  # share of the size on the ground that heights are drawn as high as, at most
_ACROSS = 2.2  # size of the longer side of the scene; a camera at a distance of 2 sees all of it
_TICKS = 6  # more ticks along a side of this size
_FLATTEST = 1e-3  # least height of the scene, so that a plane has a place to be drawn in
_LINE_POINTS = 2000  # of a line on the surface
_LINE_COLOURS = ("#D55E00", "#CC79A7", "#56B4E9", "#E69F00", "#000000")  # apart on viridis
_COLOUR_SCALE = "Viridis"
_LONG_ROAD = 8.0  # ratio of length to width from which a picture stretches the width


@dataclass(frozen=True, kw_only=True)
class _Unit:
    """How lengths are written."""

    base: float = 0.0
    "What is taken off [m]."

    factor: float = 1.0
    "How much of the unit a metre is."

    name: str = "m"
    "The unit."

    def label(self, quantity: str) -> str:
        above = f" − {self.base:g} m" if self.base else ""
        return f"{quantity}{above} [{self.name}]" if self.name else quantity

    def of(self, values: Any) -> npt.NDArray[np.float32]:
        return np.asarray((np.asarray(values) - self.base) * self.factor, dtype=np.float32)


def prepare(view: SurfaceView) -> dict[str, Any]:
    """What the template needs: the figure as JSON, the picture, and how both are drawn."""
    surface = check_surface(view.surface)
    blocks = reduce_surface(surface, view.colour)
    if not np.isfinite(blocks.height).any():
        message = "the surface of a view has no height anywhere; leave the view out."
        raise ValueError(message)
    exaggeration = view.vertical_exaggeration or suggested_exaggeration(blocks)
    source, width = _picture_from_above(blocks, view.colour)
    return {
        "caption": view.caption,
        "figure": _figure_json(view, blocks, exaggeration),
        "exaggeration": exaggeration,
        "choices": sorted({*_CHOICES, exaggeration}),
        "drawn": _how_drawn(blocks),
        "stretch": _stretch(blocks),
        "picture": source,
        "width": width,
        "shows": _NAMES[view.colour].lower(),
    }


def suggested_exaggeration(blocks: Blocks) -> float:
    """Round factor at which heights can be seen without towering over the ground."""
    ground = math.sqrt(np.ptp(blocks.easting) * np.ptp(blocks.northing))
    most = _RELIEF * ground / max(_range(blocks.height), 1e-9)
    return max((step for step in _STEPS if step <= most), default=_STEPS[0])


def _figure_json(view: SurfaceView, blocks: Blocks, exaggeration: float) -> str:
    import plotly.graph_objects as go

    east = _Unit(base=round_below(blocks.easting))
    north = _Unit(base=round_below(blocks.northing))
    up, colour = _height_unit(blocks.height), _colour_unit(blocks, view.colour)
    surface = go.Surface(
        x=east.of(blocks.easting), y=north.of(blocks.northing), z=up.of(blocks.height),
        surfacecolor=colour.of(blocks.colour), colorscale=_COLOUR_SCALE, connectgaps=False,
        colorbar={
            "title": {"text": colour.label(_NAMES[view.colour]), "side": "right"},
            "thickness": 14, "len": 0.75, "outlinewidth": 0,
        },
        lighting={"ambient": 0.7, "diffuse": 0.6, "specular": 0.05, "roughness": 0.9},
        showlegend=False,
        hovertemplate=(
            f"Easting %{{x:.2f}} m<br>Northing %{{y:.2f}} m<br>Height %{{z:.4~f}} {up.name}"
            f"<br>{_NAMES[view.colour]} %{{surfacecolor:.4~f}} {colour.name}<extra></extra>"
        ),
    )  # fmt: skip
    extent = [np.ptp(blocks.easting), np.ptp(blocks.northing), _range(blocks.height)]
    across = _ACROSS / max(extent[:2])
    sides = [max(float(size) * across, _FLATTEST) for size in extent]
    drawn = sides[0], sides[1], sides[2] * exaggeration
    axes = zip(
        ("xaxis", "yaxis", "zaxis"), ("Easting", "Northing", "Height"), (east, north, up),
        strict=True,
    )  # fmt: skip
    scene = {
        name: {
            "title": {"text": unit.label(label)}, "showbackground": False,
            "nticks": 3 + round(_TICKS * min(side / _ACROSS, 1.0)),
        }
        for (name, label, unit), side in zip(axes, drawn, strict=True)
    }  # fmt: skip
    layout = {
        "template": "none",
        "scene": scene | {
            "aspectmode": "manual",
            "aspectratio": dict(zip("xyz", drawn, strict=True)),
            "camera": {"eye": _eye(blocks), "center": {"x": 0, "y": 0, "z": 0}},
        },
        "margin": {"l": 0, "r": 0, "t": 0, "b": 0},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "showlegend": bool(view.lines),
        "legend": {"x": 0, "y": 1, "bgcolor": "rgba(0,0,0,0)"},
    }  # fmt: skip
    return str(go.Figure([surface, *_lines(view, east, north, up)], layout).to_json())


def _lines(view: SurfaceView, east: _Unit, north: _Unit, up: _Unit) -> list[Any]:
    import plotly.graph_objects as go

    drawn: list[Any] = []
    for name, profile in _tracks(view):
        every = slice(None, None, -(-profile.sizes["s"] // _LINE_POINTS))
        colour = _LINE_COLOURS[len(drawn) % len(_LINE_COLOURS)]
        drawn.append(
            go.Scatter3d(
                x=east.of(profile.easting.values[every]),
                y=north.of(profile.northing.values[every]),
                z=up.of(profile.height.values[every]),
                mode="lines", line={"width": 5, "color": colour}, name=name, hoverinfo="name",
            )
        )  # fmt: skip
    return drawn


def _tracks(view: SurfaceView) -> list[tuple[str, xr.Dataset]]:
    tracks = []
    for name, profile in view.lines.items():
        check_profile(profile)
        if "easting" not in profile or "northing" not in profile:
            message = f"a line on a surface needs easting and northing, which {name!r} lacks."
            raise ValueError(message)
        if "track" not in profile.dims:
            tracks.append((name, profile))
            continue
        tracks += [(f"{name}, {track}", profile.sel(track=track)) for track in profile.track.values]
    # plotly reads tags in names, and people do not write them
    return [(name.replace("<", "‹").replace(">", "›"), profile) for name, profile in tracks]


def _eye(blocks: Blocks) -> dict[str, float]:
    """Camera from the right of the way ahead, a little behind and above."""
    rows, columns = blocks.easting.shape
    ahead = (slice(None), columns // 2) if blocks.along_line else (rows // 2, slice(None))
    x, y = blocks.easting[ahead], blocks.northing[ahead]
    angle = math.atan2(y[-1] - y[0], x[-1] - x[0]) - math.radians(115)
    return {"x": 1.7 * math.cos(angle), "y": 1.7 * math.sin(angle), "z": 1.1}


def _picture_from_above(blocks: Blocks, colour: str) -> tuple[str, int]:
    """The same means as an image: over u and v along a line, else over the map."""
    from matplotlib import colormaps
    from matplotlib.figure import Figure

    unit = _colour_unit(blocks, colour)
    if blocks.along_line:
        x, y, shown = blocks.first, blocks.second, blocks.colour.T
        names = "Station u", "Offset v, left +"
    else:
        x, y, shown = blocks.second, blocks.first, blocks.colour
        names = "Easting", "Northing"
    bases = _Unit(base=round_below(x)), _Unit(base=round_below(y))
    stretch = _stretch(blocks)
    shape = stretch * np.ptp(y) / np.ptp(x)
    figure = Figure(figsize=(8.0, min(max(6.4 * shape, 1.2), 6.0) + 0.9))
    figure.set_layout_engine("constrained")
    ax = figure.add_subplot()
    ax.set_facecolor("0.85")
    image = ax.pcolormesh(
        bases[0].of(x), bases[1].of(y), np.ma.masked_invalid(unit.of(shown)),
        shading="nearest", cmap=colormaps["viridis"], rasterized=True,
    )  # fmt: skip
    ax.set_aspect(stretch)
    ax.set_xlabel(bases[0].label(names[0]))
    ax.set_ylabel(bases[1].label(names[1]))
    figure.colorbar(image, ax=ax, label=unit.label(_NAMES[colour]), pad=0.02)
    return _picture.embed(figure)


def _stretch(blocks: Blocks) -> float:
    """By how much the picture from above draws the width larger than the length."""
    if not blocks.along_line:
        return 1.0
    needed = np.ptp(blocks.first) / (_LONG_ROAD * np.ptp(blocks.second))
    return float(next((step for step in _STEPS if step >= needed), _STEPS[-1]))


def _how_drawn(blocks: Blocks) -> str:
    rows, columns = blocks.height.shape
    nodes = f"{rows} × {columns} nodes are drawn"
    if blocks.factors == (1, 1):
        return f"{nodes}: all there are. Where there is no height, the surface is open."
    return (
        f"{nodes}, each the mean of {blocks.factors[0]} × {blocks.factors[1]} nodes of the "
        "surface. Where less than half of them have a height, the surface is open."
    )


def _height_unit(height: Floats) -> _Unit:
    low = float(np.nanmin(height))
    base = 0.0 if abs(low) < 1.0 else float(math.floor(low))
    return _Unit(base=base, factor=1000.0, name="mm") if _range(height) < 1.0 else _Unit(base=base)


def _colour_unit(blocks: Blocks, colour: str) -> _Unit:
    if colour == "height":
        return _height_unit(blocks.height)
    return _Unit(name="") if colour == "count" else _Unit(factor=1000.0, name="mm")


def _range(values: Floats) -> float:
    return float(np.nanmax(values) - np.nanmin(values))
