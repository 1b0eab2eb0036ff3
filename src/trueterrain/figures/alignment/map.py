"""Maps of passes: their overlaps, and their differences."""

from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from trueterrain.alignment.observations.overlap import cell_centres
from trueterrain.figures import canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from trueterrain.alignment import AdjustedGround, RejectedCells
    from trueterrain.alignment.discontinuity.alignment import SearchArea
    from trueterrain.alignment.discontinuity.reference_path import ReferencePath
    from trueterrain.alignment.observations.overlap import Overlap

Floats = npt.NDArray[np.float64]

_MAX_PIXELS = 1500  # along an axis
_ROTATED = 1.5  # side of pixels in cells, so that a rotated grid leaves no empty pixels
_LONGEST = 5.0  # maximum ratio of length to width of a map at equal scale
_STRETCHES = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)
_SHOWN = 99.0  # [%] quantile at the end of the colours
_MIN_RANGE = 1e-6  # [m] minimum span of the colours
_RANGES = "YlOrRd"  # perceptually uniform
_REJECTED = "#0072B2"
_PASS_COLOURS = ("#A9CCE3", "#F5CBA7")  # light, so that lines over them are visible
_BOTH = "0.62"
_WHOLE = 30.0  # [m] length of path up to which all of it is shown
_PART = 15.0  # [m] length shown of a longer path
_MARGIN = 15.0  # [m] lateral distance within which cells are drawn
_AREAS = 6  # number of search areas drawn


class _RasterImage(NamedTuple):
    """Raster whose pixels hold the maximum of their values."""

    image: Floats
    extent: tuple[float, float, float, float]
    pixel: tuple[float, float]


def discrepancy_map(
    ground: "AdjustedGround",
    *,
    when: Literal["before", "after"] = "before",
    rejected: "RejectedCells | None" = None,
    largest: float | None = None,
    cell: float = 0.1,
    path: "ReferencePath | None" = None,
    ax: "Axes | None" = None,
) -> "Axes":
    """Range of the heights of passes in each common cell.

    Parameters
    ----------
    ground : AdjustedGround
        Cells, as in ``Adjustment.ground``.
    when : {"before", "after"}
        Before the adjustment or after it.
    rejected : RejectedCells, optional
        Rejected cells, to be marked.
    largest : float, optional
        Range at the end of the colours [m], to use one scale before and after; by default the
        99 % quantile.
    cell : float
        Size of the cells [m].
    path : ReferencePath, optional
        Path whose station and offset are the axes, which straightens a road; by default easting and
        northing.
    ax : Axes, optional
        Where to draw; by default a new figure.

    Returns
    -------
    Axes
        Two axes in metres; a long strip is stretched by the printed factor. The colour is the range
        of the heights of the passes, in the manner of Fig. 4-2 of Smith, "Improving
        the Quality of Terrain Measurement", Virginia Tech, 2009. In large maps a
        pixel is several cells and shows their maximum.

    Raises
    ------
    ValueError
        If `when` is unknown, or `largest` or `cell` are not greater than 0.

    Examples
    --------
    >>> from trueterrain.alignment import adjust_passes, make_pass_cells
    >>> cell, time = np.arange(400), np.arange(400) * 0.1
    >>> found = adjust_passes([
    ...     make_pass_cells(name, cell, time, up + np.sin(cell), variance=1e-6, easting=0.5 * cell)
    ...     for name, up in (("east", 0.005), ("west", -0.005))])
    >>> ax = discrepancy_map(found.ground, cell=0.5)
    >>> float(ax.images[0].get_array().max().round(3))
    0.01
    """
    if when not in ("before", "after"):
        message = f"when must be before or after, got {when!r}."
        raise ValueError(message)
    for name, given in (("largest", largest), ("cell", cell)):
        if given is not None and not given > 0:
            message = f"{name} must be greater than 0 m, got {given}."
            raise ValueError(message)
    value = ground.before if when == "before" else ground.after
    if largest is None:
        largest = max(float(np.percentile(value, _SHOWN)), _MIN_RANGE)
    x, y = _cell_places(ground.easting, ground.northing, path)
    raster = _raster_image(x, y, value, cell if path is None else _ROTATED * cell)
    axes = ("easting", "northing") if path is None else ("station", "offset")
    ax, image, stretch = _draw_raster(raster, ax, axes)
    image.set_cmap(_with_holes(_RANGES))
    image.set_clim(0.0, largest)
    _range_bar(image, ax, beyond=bool(value.max() > largest))
    if rejected is not None and len(rejected):
        _mark_rejected(ax, rejected, path)
    _name_axes(ax, x, y, path)
    canvas.annotate_axes(ax, f"range of the passes {when}; {_pixel_note(raster, cell)}{stretch}")
    canvas.legend_above(ax)
    return ax


def overlap_map(
    overlap: "Overlap",
    path: "ReferencePath",
    *,
    area: "SearchArea | None" = None,
    part: tuple[float, float] | None = None,
    ax: "Axes | None" = None,
) -> "Axes":
    """Map of the overlap of two passes, with the reference path and some search areas.

    Parameters
    ----------
    overlap : Overlap
        Cells of both passes.
    path : ReferencePath
        Reference path.
    area : SearchArea, optional
        Search area around each reference point; by default a disc of radius 0.2 m.
    part : tuple of float, optional
        Stations between which ground is shown [m]; by default all of a path up to 30 m long, or
        the central 15 m of a longer one.
    ax : Axes, optional
        Where to draw; by default a new figure.

    Returns
    -------
    Axes
        Easting and northing in metres, at equal scale, in the manner of Fig. 4-3 of Smith,
        "Improving the Quality of Terrain Measurement", Virginia Tech, 2009.

    Raises
    ------
    ValueError
        If `part` does not ascend, or no reference point lies in it.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_points
    >>> from trueterrain.alignment.observations.overlap import occupied_cells, find_overlap
    >>> from trueterrain.alignment.discontinuity.centre_line import centre_reference
    >>> x, y = (at.ravel() for at in np.meshgrid(np.arange(0, 20, 0.1), np.arange(0, 4, 0.1)))
    >>> left, right = (occupied_cells(make_points(x, y + by, 0 * x), 0.2) for by in (0.05, 3.05))
    >>> overlap = find_overlap(left, right, names=("left", "right"))
    >>> ax = overlap_map(overlap, centre_reference(overlap))
    >>> [text.get_text() for text in ax.get_legend().get_texts()][:3]
    ['left', 'right', 'both']
    """
    begin, end = _station_part(path, part)
    shown = np.flatnonzero((path.curve.s >= begin) & (path.curve.s <= end))
    if not shown.size:
        message = f"part must hold a reference point, got {begin:g} to {end:g} m."
        raise ValueError(message)
    codes, places = [], []
    for code, key in (
        (1, overlap.cells[0].covered),
        (2, overlap.cells[1].covered),
        (3, overlap.key),
    ):
        at = _cells_near(key, overlap.cell, path, shown, (begin, end))
        places.append(at)
        codes.append(np.full(at.shape[1], float(code)))
    x, y = np.concatenate(places, axis=1)
    ax, image, _ = _draw_raster(_raster_image(x, y, np.concatenate(codes), overlap.cell), ax)
    from matplotlib.colors import ListedColormap

    image.set_cmap(ListedColormap([*_PASS_COLOURS, _BOTH]).with_extremes(bad="white"))
    image.set_clim(0.5, 3.5)
    for colour, name in zip((*_PASS_COLOURS, _BOTH), (*overlap.names, "both"), strict=True):
        ax.fill_between([], [], [], color=colour, label=name)
    limits = ax.axis()
    _draw_areas(ax, path, shown, area)
    ax.axis(limits)
    _name_axes(ax, x, y, None)
    whole = begin <= 0 and end >= path.curve.length
    place = "" if whole else f", station {begin:g} m to {end:g} m of {path.curve.length:.5g} m"
    canvas.annotate_axes(ax, f"equal scale{place}")
    canvas.legend_above(ax, columns=5)
    return ax


def _cell_places(easting: Floats, northing: Floats, path: "ReferencePath | None") -> list[Floats]:
    """Easting and northing, or station and offset."""
    if path is None:
        return [easting, northing]
    found = path.locate(easting, northing)
    return [found.station, found.offset]


def _raster_image(x: Floats, y: Floats, value: Floats, cell: float) -> _RasterImage:
    """Raster of cells, whose pixels are one cell or several."""
    numbers, low, size, pixel = [], [], [], []
    for at in (x, y):
        cells_per_pixel = max(1, int(np.ceil(np.ptp(at) / cell / _MAX_PIXELS)))
        number = np.floor(at / (cells_per_pixel * cell)).astype(np.int64)
        numbers.append(number - number.min())
        low.append(float(number.min() * cells_per_pixel * cell))
        size.append(int(np.ptp(number)) + 1)
        pixel.append(cells_per_pixel * cell)
    image = np.full((size[1], size[0]), np.nan)
    np.fmax.at(image, (numbers[1], numbers[0]), value)
    high = [begin + n * step for begin, n, step in zip(low, size, pixel, strict=True)]
    return _RasterImage(image, (low[0], high[0], low[1], high[1]), (pixel[0], pixel[1]))


def _draw_raster(
    raster: _RasterImage, ax: "Axes | None", stretchable: tuple[str, str] | None = None
) -> "tuple[Axes, Any, str]":
    """Draw a raster; one of the named axes may be stretched. Returns axes, image and note."""
    left, right, bottom, top = raster.extent
    length, width = right - left, top - bottom
    needed = max(length, width) / (_LONGEST * min(length, width))
    factor = next((one for one in _STRETCHES if one >= needed), _STRETCHES[-1])
    aspect, stretch = 1.0, "equal scale"
    if factor > 1 and stretchable:
        aspect = float(factor) if length > width else 1.0 / factor
        stretch = f"{stretchable[int(length > width)]} stretched {factor} times"
    ax = canvas.axes_or_new(ax, height=canvas.map_height(length, aspect * width))
    image = ax.imshow(raster.image, origin="lower", extent=raster.extent, interpolation="nearest")
    ax.set_aspect(aspect)
    return ax, image, stretch


def _with_holes(name: str) -> Any:
    import matplotlib as mpl

    return mpl.colormaps[name].with_extremes(bad=canvas.HOLE_COLOUR, over="black")


def _range_bar(image: Any, ax: "Axes", *, beyond: bool) -> None:
    bar = ax.figure.colorbar(
        image, cax=ax.inset_axes((1.02, 0.0, 0.025, 1.0)), extend="max" if beyond else "neither"
    )
    canvas.scale_axis(bar.ax.yaxis, canvas.LengthScale(factor=1000.0, unit="mm"), "Range")


def _mark_rejected(ax: "Axes", rejected: "RejectedCells", path: "ReferencePath | None") -> None:
    from matplotlib.patheffects import withStroke

    _, first = np.unique(rejected.cell, return_index=True)
    x, y = _cell_places(rejected.easting[first], rejected.northing[first], path)
    ax.plot(
        x,
        y,
        "o",
        markersize=5,
        markerfacecolor="none",
        markeredgecolor=_REJECTED,
        markeredgewidth=1.1,
        path_effects=[withStroke(linewidth=2.8, foreground="white")],
        label=f"rejected in a pass: {first.size} cells",
    )


def _name_axes(ax: "Axes", x: Floats, y: Floats, path: "ReferencePath | None") -> None:
    if path is None:
        canvas.scale_axis(ax.xaxis, canvas.coordinate_scale(x), "Easting")
        canvas.scale_axis(ax.yaxis, canvas.coordinate_scale(y), "Northing")
    else:
        canvas.scale_axis(ax.xaxis, canvas.LengthScale(), "Station of the reference path")
        canvas.scale_axis(ax.yaxis, canvas.LengthScale(), "Offset, left +")


def _pixel_note(raster: _RasterImage, cell: float) -> str:
    """Note on pixels larger than a cell."""
    long, wide = raster.pixel
    if max(long, wide) < 1.01 * cell:
        return ""
    return f"greatest in {1e3 * long:.4g} mm × {1e3 * wide:.4g} mm; "


def _station_part(path: "ReferencePath", part: tuple[float, float] | None) -> tuple[float, float]:
    length = path.curve.length
    if part is None:
        centre, half = 0.5 * length, 0.5 * _PART
        return (0.0, length) if length <= _WHOLE else (centre - half, centre + half)
    begin, end = part
    if not begin < end:
        message = f"part must be two stations that ascend [m], got {begin} and {end}."
        raise ValueError(message)
    return max(begin, 0.0), min(end, length)


def _cells_near(
    key: npt.NDArray[np.int64],
    cell: float,
    path: "ReferencePath",
    shown: npt.NDArray[np.int64],
    part: tuple[float, float],
) -> Floats:
    """Centres of the cells near a part of the path, shape (2, n)."""
    at = np.stack(cell_centres(key, cell))
    whole = part[0] <= 0 and part[1] >= path.curve.length
    near = path.curve[shown]
    for axis, nodes in zip((0, 1), (near.easting, near.northing), strict=True):
        margin = np.inf if whole else _MARGIN
        at = at[:, (at[axis] >= nodes.min() - margin) & (at[axis] <= nodes.max() + margin)]
    if whole:
        return at
    station = path.locate(*at).station
    return np.asarray(at[:, (station > part[0]) & (station < part[1])])


def _draw_areas(
    ax: "Axes",
    path: "ReferencePath",
    shown: npt.NDArray[np.int64],
    area: "SearchArea | None",
) -> None:
    from matplotlib import patches

    from trueterrain.alignment.discontinuity.alignment import SearchDisc

    area = area or SearchDisc()
    line = path.curve.easting, path.curve.northing
    ax.plot(*line, color="black", linewidth=1.3, label="reference path")
    long, wide = (2.0 * half for half in area.half_axes)
    easting, northing = path.places
    picked = shown[
        np.linspace(0, shown.size - 1, 2 * min(_AREAS, shown.size) + 1).astype(int)[1::2]
    ]
    for k in picked:
        style: Any = {
            "angle": float(np.rad2deg(path.curve.heading[k])),
            "fill": False,
            "linewidth": 1.4,
            "edgecolor": _REJECTED,
            "zorder": 4,
        }
        at = float(easting[k]), float(northing[k])
        if int(area.shape):
            corner = (at[0] - long / 2, at[1] - wide / 2)
            ax.add_patch(patches.Rectangle(corner, long, wide, rotation_point="center", **style))
        else:
            ax.add_patch(patches.Ellipse(at, long, wide, **style))
    marker = "s" if int(area.shape) else "o"
    ax.plot(
        [],
        [],
        marker,
        markersize=8,
        markerfacecolor="none",
        markeredgecolor=_REJECTED,
        markeredgewidth=1.4,
        label=f"{picked.size} of {path.curve.s.size} search areas",
    )
