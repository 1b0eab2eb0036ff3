"""Interactive view of a surface, and a map of it for paper."""

import json
import math
from dataclasses import dataclass
from itertools import cycle
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.schemas import check_profile, check_surface
from trueterrain.figures import draw_names
from trueterrain.report import _picture
from trueterrain.report._surface import Blocks, reduce_surface, round_below
from trueterrain.report.parts import SurfaceView
from trueterrain.surface import grid_frame, xy_to_uv

Floats = npt.NDArray[np.float64]

_NAMES = {
    "height": "Height",
    "sd": "Standard deviation",
    "sd_relative": "Relative standard deviation",
    "count": "Count per node",
}
_CHOICES = (1.0, 5.0, 20.0)  # vertical exaggerations that every page offers
_STEPS = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
_RELIEF = 0.08  # max height of the relief over the longer side
_ACROSS = 1.9  # diagonal of the ground in the scene; the camera then sees all of it
_TICKS = 6  # more ticks along a side of this size
_MIN_HEIGHT_RANGE = 1e-3  # [m] min range of the axis of heights
_LINE_POINTS = 2000  # of a line on the surface
_LINE_COLOURS = ("#D55E00", "#CC79A7", "#56B4E9", "#E69F00", "#000000")  # apart on viridis
_COLOUR_SCALE = "Viridis"
_LONG_ROAD = 8.0  # ratio of length to width above which a picture stretches the width


@dataclass(frozen=True, kw_only=True)
class _LengthUnit:
    """Unit and base of lengths on an axis."""

    base: float = 0.0
    "Subtracted from the values [m]."

    factor: float = 1.0
    "Units in a metre."

    name: str = "m"
    "The unit."

    digits: int = 3
    "Significant decimals."

    def label(self, quantity: str) -> str:
        above = f" − {self.base:.12g} m" if self.base else ""
        return f"{quantity}{above} [{self.name}]" if self.name else quantity

    def of(self, values: Any) -> npt.NDArray[np.float32]:
        return np.asarray((np.asarray(values) - self.base) * self.factor, dtype=np.float32)


def prepare_view(view: SurfaceView) -> dict[str, Any]:
    """Arguments of the template: the figure as JSON, the picture, and their scales."""
    blocks = _surface_blocks(view)
    exaggeration = view.vertical_exaggeration or suggested_exaggeration(blocks)
    source, width = _picture.embed_figure(_seen_from_above(view, blocks))
    return {
        "caption": view.caption,
        "figure": _figure_json(view, blocks, exaggeration),
        "exaggeration": exaggeration,
        "choices": sorted({*_CHOICES, exaggeration}),
        "drawn": _how_drawn(blocks),
        "stretch": _width_exaggeration(blocks),
        "picture": source,
        "width": width,
        "shows": _NAMES[view.colour].lower(),
    }


def still_picture(view: SurfaceView) -> tuple[Any, float, str]:
    """Map of the surface for paper, its stretch across, and its nodes."""
    blocks = _surface_blocks(view)
    return _seen_from_above(view, blocks), _width_exaggeration(blocks), _how_drawn(blocks)


def suggested_exaggeration(blocks: Blocks) -> float:
    """Round vertical exaggeration that limits the relief to a fraction of the length."""
    longer = max(float(np.ptp(blocks.first)), float(np.ptp(blocks.second)))
    most = _RELIEF * longer / max(_value_range(blocks.height), _MIN_HEIGHT_RANGE)
    return max((step for step in _STEPS if step <= most), default=_STEPS[0])


def _surface_blocks(view: SurfaceView) -> Blocks:
    blocks = reduce_surface(check_surface(view.surface), view.colour)
    if not np.isfinite(blocks.height).any():
        message = "the surface of a view has no height anywhere; leave the view out."
        raise ValueError(message)
    return blocks


def _figure_json(view: SurfaceView, blocks: Blocks, exaggeration: float) -> str:
    """Figure of plotly, and coordinates of the nodes of its surface."""
    import plotly.graph_objects as go

    east = _LengthUnit(base=round_below(blocks.easting))
    north = _LengthUnit(base=round_below(blocks.northing))
    up = _height_unit(blocks.height)
    colour = _colour_unit(blocks, view.colour)
    hover = (
        "Easting %{x:.2f} m<br>Northing %{y:.2f} m<br>"
        f"Height %{{z:.{up.digits}f}} {up.name}<extra></extra>"
    )
    # plotly colours by height by default
    shown = None if view.colour == "height" else colour.of(blocks.colour)
    surface = go.Surface(
        z=up.of(blocks.height),
        surfacecolor=shown,
        connectgaps=False,
        colorscale=_COLOUR_SCALE,
        showlegend=False,
        hovertemplate=hover,
        colorbar={
            "title": {"text": colour.label(_NAMES[view.colour]), "side": "right"},
            "thickness": 14,
            "len": 0.75,
            "outlinewidth": 0,
        },
        lighting={"ambient": 0.7, "diffuse": 0.6, "specular": 0.05, "roughness": 0.9},
    )
    scene = _view_scene(view, blocks, exaggeration, (east, north, up))
    if view.colour == "height":  # the colour scale labels the heights
        scene["zaxis"]["title"] = {"text": ""}
    layout = {
        "template": {},
        "scene": scene | {"camera": _view_camera(blocks)},
        "margin": {"l": 0, "r": 0, "t": 0, "b": 0},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "showlegend": bool(view.lines),
        "legend": {"x": 0, "y": 1, "bgcolor": "rgba(0,0,0,0)"},
    }
    figure = go.Figure([surface, *_profile_lines(view, east, north, up)], layout).to_json()
    return f'{{"figure": {figure}, "places": {json.dumps(_node_places(blocks, east, north))}}}'


def _view_scene(
    view: SurfaceView,
    blocks: Blocks,
    exaggeration: float,
    units: tuple[_LengthUnit, _LengthUnit, _LengthUnit],
) -> dict[str, Any]:
    """Axes as long as the data; that of heights longer by the exaggeration."""
    lines = [profile for _, profile in _profile_tracks(view)]
    held = [
        (float(np.nanmin(values)), float(np.nanmax(values)))
        for values in (
            np.concatenate([shown.ravel(), *(line[name].values for line in lines)])
            for name, shown in (
                ("easting", blocks.easting),
                ("northing", blocks.northing),
                ("height", blocks.height),
            )
        )
    ]
    low, high = held[2]
    if high - low < _MIN_HEIGHT_RANGE:  # an axis of zero length cannot be drawn
        held[2] = (low + high - _MIN_HEIGHT_RANGE) / 2, (low + high + _MIN_HEIGHT_RANGE) / 2
    # exact ends of the axes, so that the exaggeration is the stated one
    sizes = [high - low for low, high in held]
    scale = _ACROSS / math.hypot(*sizes[:2])
    sides = [size * scale * by for size, by in zip(sizes, (1.0, 1.0, exaggeration), strict=True)]
    axes = {
        f"{axis}axis": {
            "title": {"text": unit.label(name)},
            "showbackground": False,
            "range": [float(unit.of(end)) for end in ends],
            "nticks": 3 + round(_TICKS * min(side / _ACROSS, 1.0)),
        }
        for axis, name, unit, ends, side in zip(
            "xyz", ("Easting", "Northing", "Height"), units, held, sides, strict=True
        )
    }
    ratio = dict(zip("xyz", sides, strict=True))
    return {**axes, "aspectmode": "manual", "aspectratio": ratio}


def _node_places(blocks: Blocks, east: _LengthUnit, north: _LengthUnit) -> dict[str, list[float]]:
    """Coordinates of the nodes: rows are straight, so their ends and fractions are enough."""
    ends = {
        f"{name}_{side}": unit.of(values[:, column])
        for name, unit, values in (("x", east, blocks.easting), ("y", north, blocks.northing))
        for side, column in (("first", 0), ("last", -1))
    }
    fraction = (blocks.second - blocks.second[0]) / np.ptp(blocks.second)
    return {
        name: [round(float(value), 4) for value in values]
        for name, values in {**ends, "fraction": fraction}.items()
    }


def _profile_lines(
    view: SurfaceView, east: _LengthUnit, north: _LengthUnit, up: _LengthUnit
) -> list[Any]:
    import plotly.graph_objects as go

    drawn = []
    for colour, (name, profile) in zip(cycle(_LINE_COLOURS), _profile_tracks(view)):
        every = slice(None, None, -(-profile.sizes["s"] // _LINE_POINTS))
        drawn.append(
            go.Scatter3d(
                x=east.of(profile.easting.values[every]),
                y=north.of(profile.northing.values[every]),
                z=up.of(profile.height.values[every]),
                mode="lines",
                line={"width": 5, "color": colour},
                name=name,
                hoverinfo="name",
            )
        )
    return drawn


def _profile_tracks(view: SurfaceView) -> list[tuple[str, xr.Dataset]]:
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
    # plotly interprets tags in names
    return [(name.replace("<", "‹").replace(">", "›"), profile) for name, profile in tracks]


def _view_camera(blocks: Blocks) -> dict[str, Any]:
    """Camera to the right of the direction of travel, a little behind and above."""
    rows, columns = blocks.easting.shape
    central = (slice(None), columns // 2) if blocks.along_line else (rows // 2, slice(None))
    x, y = blocks.easting[central], blocks.northing[central]
    angle = math.atan2(y[-1] - y[0], x[-1] - x[0]) - math.radians(115)
    return {
        "eye": {"x": 1.85 * math.cos(angle), "y": 1.85 * math.sin(angle), "z": 1.2},
        "center": {"x": 0, "y": 0, "z": 0},
        "up": {"x": 0, "y": 0, "z": 1},
    }


def _seen_from_above(view: SurfaceView, blocks: Blocks) -> Any:
    """Map of the same means: over u and v along a line, else over easting and northing."""
    from matplotlib import colormaps
    from matplotlib.figure import Figure

    unit = _colour_unit(blocks, view.colour)
    if blocks.along_line:
        x, y, shown = blocks.first, blocks.second, blocks.colour.T
        names = "Station u", "Offset v, left +"
    else:
        x, y, shown = blocks.second, blocks.first, blocks.colour
        names = "Easting", "Northing"
    bases = _LengthUnit(base=round_below(x)), _LengthUnit(base=round_below(y))
    stretch = _width_exaggeration(blocks)
    shape = stretch * np.ptp(y) / np.ptp(x)
    size = (8.0, max(6.4 * shape, 0.8) + 1.2) if shape < 1.0 else (6.0 / shape + 2.0, 6.8)
    figure = Figure(figsize=size)
    figure.set_layout_engine("constrained")
    ax = figure.add_subplot()
    ax.set_facecolor("0.85")
    image = ax.pcolormesh(
        bases[0].of(x),
        bases[1].of(y),
        np.ma.masked_invalid(unit.of(shown)),
        shading="nearest",
        cmap=colormaps["viridis"],
        rasterized=True,
    )
    for colour, (name, profile) in zip(cycle(_LINE_COLOURS), _profile_tracks(view)):
        east, north = profile.easting.values, profile.northing.values
        if blocks.along_line:
            east, north = xy_to_uv(grid_frame(view.surface), east, north)
        ax.plot(bases[0].of(east), bases[1].of(north), color=colour, linewidth=1.5, label=name)
    if view.lines:
        draw_names(
            figure.legend(
                loc="outside upper left", frameon=False, ncols=4, fontsize="small"
            ).get_texts()
        )
    ax.set_aspect(stretch)
    ax.set_xlabel(bases[0].label(names[0]))
    ax.set_ylabel(bases[1].label(names[1]))
    beside = ax.inset_axes((1.02, 0.0, 0.025, 1.0))
    figure.colorbar(image, cax=beside, label=unit.label(_NAMES[view.colour]))
    return figure


def _width_exaggeration(blocks: Blocks) -> float:
    """Stretch of the width over the length in the map."""
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


def _height_unit(height: Floats) -> _LengthUnit:
    """Metres, or millimetres above a round height if the heights range over less than a metre."""
    if _value_range(height) >= 1.0:
        return _LengthUnit()
    low, high = float(np.nanmin(height)), float(np.nanmax(height))
    if low > -1.0 and high < 1.0:  # heights near zero need no base
        return _LengthUnit(factor=1000.0, name="mm", digits=1)
    step = 10.0 ** math.ceil(math.log10(max(high - low, _MIN_HEIGHT_RANGE)))
    base = round(math.floor(low / step) * step, 3)
    return _LengthUnit(base=base, factor=1000.0, name="mm", digits=1)


def _colour_unit(blocks: Blocks, colour: str) -> _LengthUnit:
    if colour == "height":
        return _height_unit(blocks.height)
    return _LengthUnit(name="") if colour == "count" else _LengthUnit(factor=1000.0, name="mm")


def _value_range(values: Floats) -> float:
    return float(np.nanmax(values) - np.nanmin(values))
