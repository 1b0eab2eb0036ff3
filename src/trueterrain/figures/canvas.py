"""Common parts of figures: axes, colours, length scales, notes, and legends outside the data."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from trueterrain.figures.names import draw_names

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Colours that colour-blind people can distinguish (Okabe and Ito 2008).
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")

#: Colour map of heights: perceptually uniform, and readable without colour vision.
HEIGHT_MAP = "viridis"

#: Colour of a path on a map of heights.
PATH_COLOUR = "#D55E00"

#: Colour of nodes without a height.
HOLE_COLOUR = "0.85"

#: Typographic minus sign.
MINUS = "−"

_QUIET = "0.35"  # grey of notes
_ROW = 17.0  # [points] height of the row of notes above the axes
_GAP = 4.0  # [points] between the axes and a legend without notes
_MAX_LOCAL = 10_000.0  # [m] larger coordinates are shown relative to a round number
_TALL = 0.8  # ratio of width to length above which the height of the figure is fixed
_MAX_RATIO = 1e4  # of the ends of an axis; above it only powers of ten are labelled
_MAX_MILLIMETRES = 1.0  # [m] heights with a smaller range are shown in mm


@dataclass(frozen=True, kw_only=True)
class LengthScale:
    """Scale in which lengths are written at an axis; the data stay in metres."""

    base: float = 0.0
    "Length that is subtracted before writing [m]."

    factor: float = 1.0
    "Number of units in a metre."

    unit: str = "m"
    "Name of the unit."

    def label(self, name: str) -> str:
        """Label of an axis: name, base and unit."""
        base = "" if self.base == 0 else f" {MINUS} {self.base:.12g} m"
        return f"{name}{base} [{self.unit}]"

    def text(self, value: float, digits: int = 9) -> str:
        """Value in this scale."""
        number = f"{round((value - self.base) * self.factor, digits) + 0.0:g}"
        return number.replace("-", MINUS)


def axes_or_new(ax: "Axes | None", width: float = 8.0, height: float = 3.4) -> "Axes":
    """Axes as given, or of a new figure whose size is in inches."""
    if ax is not None:
        return ax
    import matplotlib.pyplot as plt

    new: Axes = plt.subplots(figsize=(width, height), layout="constrained")[1]
    return new


def map_height(length: float, width: float) -> float:
    """Height [inches] of a figure that is 8 inches wide and whose axes have this shape.

    Either the width or the height has spare space: if both fit exactly, the layout engine does not
    converge and cuts labels off.
    """
    shape = width / length if length > 0 else 1.0
    return max(6.5 * shape + 1.4, 2.2) if shape < _TALL else 5.6


def height_scale(*heights: npt.ArrayLike) -> LengthScale:
    """Millimetres above a round height if the range of heights is below a metre, else metres."""
    finite = [np.asarray(values)[np.isfinite(values)].ravel() for values in heights]
    known = np.concatenate(finite) if finite else np.empty(0)
    if known.size == 0 or np.ptp(known) >= _MAX_MILLIMETRES:
        return LengthScale()
    low, high = float(known.min()), float(known.max())
    if low > -1.0 and high < 1.0:  # heights around zero need no base
        return LengthScale(factor=1000.0, unit="mm")
    # with a base that is a multiple of this step, round ticks stay round
    step = 10.0 ** np.ceil(np.log10(max(high - low, 1e-3)))
    base = round(float(np.floor(low / step) * step), 3)
    return LengthScale(base=base, factor=1000.0, unit="mm")


def coordinate_scale(values: npt.ArrayLike) -> LengthScale:
    """Metres relative to a round number if coordinates are large."""
    low = float(np.nanmin(values))
    return LengthScale(base=float(np.floor(low / 1000) * 1000) if abs(low) > _MAX_LOCAL else 0.0)


def scale_axis(axis: Any, scale: LengthScale, name: str) -> None:
    """Write the ticks and the label of an axis in a scale."""
    from matplotlib.ticker import FuncFormatter

    axis.set_major_formatter(FuncFormatter(lambda value, _: scale.text(value)))
    axis.set_label_text(scale.label(name))


def colour_bar(image: Any, ax: "Axes", scale: LengthScale, name: str = "Height") -> None:
    """Add a colour bar as high as the axes, whatever their aspect."""
    bar = ax.figure.colorbar(image, cax=ax.inset_axes((1.02, 0.0, 0.025, 1.0)))
    scale_axis(bar.ax.yaxis, scale, name)


def plain_log_axis(axis: Any) -> None:
    """Write plain numbers at 1, 2 and 5 of each decade; over many decades at 1 alone."""
    from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

    low, high = axis.get_view_interval()
    steps = (1.0, 2.0, 5.0) if high / low < _MAX_RATIO else (1.0,)
    ticks = LogLocator(subs=steps, numticks=20)
    few = sum(low <= tick <= high for tick in ticks.tick_values(low, high)) < 2
    axis.set_major_locator(MaxNLocator(4) if few else ticks)
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def degree_axis(axis: Any, name: str) -> None:
    """Write an axis of angles in round degrees, while the data stay in radians."""
    from matplotlib.ticker import MaxNLocator

    class Degrees(MaxNLocator):
        def tick_values(self, vmin: float, vmax: float) -> list[float]:
            ticks = super().tick_values(float(np.rad2deg(vmin)), float(np.rad2deg(vmax)))
            return [float(np.deg2rad(tick)) for tick in ticks]

    axis.set_major_locator(Degrees(nbins=6, steps=[1, 2, 5, 10]))
    scale_axis(axis, LengthScale(factor=float(np.rad2deg(1.0)), unit="deg"), name)


def draw_grid(ax: "Axes", axis: Literal["x", "y", "both"] = "both") -> None:
    """Draw a faint grid behind the data: lines across one axis, "x" or "y", or both."""
    ax.grid(axis=axis, color="0.9", linewidth=0.6)
    ax.set_axisbelow(True)


def annotate_axes(ax: "Axes", text: str) -> None:
    """Write a short note above the right end of the axes."""
    remark = ax.annotate(
        text,
        (1, 1),
        (0, 4),
        xycoords="axes fraction",
        textcoords="offset points",
        ha="right",
        va="bottom",
        fontsize="small",
        color=_QUIET,
    )
    draw_names([remark])


def note_exaggeration(ax: "Axes") -> None:
    """Write the vertical exaggeration above the axes; it follows the zoom."""
    from matplotlib.text import Annotation

    class Exaggeration(Annotation):
        def draw(self, renderer: Any) -> None:
            self.set_text(f"vertical exaggeration {_three_digits(vertical_exaggeration(ax))} ×")
            super().draw(renderer)

    remark = Exaggeration(
        "vertical exaggeration",
        (1, 1),
        (0, 4),
        xycoords="axes fraction",
        textcoords="offset points",
        ha="right",
        va="bottom",
        fontsize="small",
        color=_QUIET,
    )
    ax.add_artist(remark).set_clip_on(False)


def vertical_exaggeration(ax: "Axes") -> float:
    """Ratio of the scales of the y axis and the x axis."""
    (x0, y0), (x1, y1) = ax.transData.transform([(0.0, 0.0), (1.0, 1.0)])
    return abs(float((y1 - y0) / (x1 - x0)))


def legend_above(ax: "Axes", columns: int = 4, *, notes: bool = True) -> None:
    """Draw the legend above the axes (and above the notes there), so that it never covers data."""
    from matplotlib.transforms import ScaledTranslation

    handles, labels = ax.get_legend_handles_labels()
    if not handles:
        return
    raised = ScaledTranslation(0, (_ROW if notes else _GAP) / 72, ax.figure.dpi_scale_trans)
    legend = ax.legend(
        handles,
        labels,
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        borderaxespad=0.0,
        bbox_transform=ax.transAxes + raised,
        frameon=False,
        ncols=min(columns, len(handles)),
        fontsize="small",
        handlelength=1.5,
        columnspacing=1.3,
    )
    draw_names(legend.get_texts())


def draw_path(ax: "Axes", x: npt.ArrayLike, y: npt.ArrayLike, label: str = "path") -> None:
    """Draw a path with a white casing, visible on any height, and a dot at its start."""
    x, y = np.asarray(x), np.asarray(y)
    ax.plot(x, y, color="white", linewidth=3.5, solid_capstyle="butt")
    ax.plot(x, y, color=PATH_COLOUR, linewidth=1.8, label=label)
    if np.isfinite([x[0], y[0]]).all():  # otherwise the start is outside of the axes
        ax.plot(
            x[:1],
            y[:1],
            "o",
            color=PATH_COLOUR,
            markeredgecolor="white",
            label="its start",
            linestyle="none",
        )


def _three_digits(value: float) -> str:
    return f"{float(f'{value:.3g}'):g}"
