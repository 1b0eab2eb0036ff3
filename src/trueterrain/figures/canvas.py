"""What all figures share: axes, colours, length scales, notes and legends outside of the data."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from trueterrain.figures.names import draw_names

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Colours that colour-blind people can tell apart (Okabe and Ito 2008).
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")

#: Heights from low to high: even in lightness, and readable without colour vision.
HEIGHT_MAP = "viridis"

#: The path, on top of a map of heights.
PATH_COLOUR = "#D55E00"

#: Where a surface has no height.
HOLE_COLOUR = "0.85"

#: As typesetters set it.
MINUS = "−"

_QUIET = "0.35"  # grey of notes
_ROW = 17.0  # [points] height of the row of notes above the axes
_GAP = 4.0  # [points] between the axes and a legend without notes
_LOCAL = 10_000.0  # [m] coordinates beyond are shown from a round number on
_TALL = 0.8  # ratio of width to length from which a figure is as high as its height allows
_MILLIMETRES = 1.0  # [m] heights that range over less are shown in mm


@dataclass(frozen=True, kw_only=True)
class LengthScale:
    """How lengths are written beside an axis; the data stay in metres."""

    base: float = 0.0
    "What is taken off before writing [m]."

    factor: float = 1.0
    "How much of the unit a metre is."

    unit: str = "m"
    "Unit that is written."

    def label(self, name: str) -> str:
        """Label of an axis: name, base and unit."""
        above = "" if self.base == 0 else f" {MINUS} {self.base:.12g} m"
        return f"{name}{above} [{self.unit}]"

    def text(self, value: float, digits: int = 9) -> str:
        """A value in this scale."""
        number = f"{round((value - self.base) * self.factor, digits) + 0.0:g}"
        return number.replace("-", MINUS)


def axes_or_new(ax: "Axes | None", width: float = 8.0, height: float = 3.4) -> "Axes":
    """Return the axes, or new ones in a new figure of a size in inches."""
    if ax is not None:
        return ax
    import matplotlib.pyplot as plt

    new: Axes = plt.subplots(figsize=(width, height), layout="constrained")[1]
    return new


def map_height(length: float, width: float) -> float:
    """Height of a figure [inches] 8 inches wide whose axes have this shape.

    Either the width or the height is left with room to spare: where both fit at once, the layout
    engine does not settle and cuts labels off.
    """
    shape = width / length if length > 0 else 1.0
    return max(6.5 * shape + 1.4, 2.2) if shape < _TALL else 5.6


def height_scale(*heights: npt.ArrayLike) -> LengthScale:
    """Millimetres above a round height if the heights range over less than a metre, else metres."""
    finite = [np.asarray(values)[np.isfinite(values)].ravel() for values in heights]
    known = np.concatenate(finite) if finite else np.empty(0)
    if known.size == 0 or np.ptp(known) >= _MILLIMETRES:
        return LengthScale()
    low, high = float(known.min()), float(known.max())
    if low > -1.0 and high < 1.0:  # heights about zero need no base
        return LengthScale(factor=1000.0, unit="mm")
    # a base of this step or a multiple leaves round ticks round, whatever the locator chooses
    step = 10.0 ** np.ceil(np.log10(max(high - low, 1e-3)))
    base = round(float(np.floor(low / step) * step), 3)
    return LengthScale(base=base, factor=1000.0, unit="mm")


def coordinate_scale(values: npt.ArrayLike) -> LengthScale:
    """Metres from a round number on if coordinates are large."""
    low = float(np.nanmin(values))
    return LengthScale(base=float(np.floor(low / 1000) * 1000) if abs(low) > _LOCAL else 0.0)


def scale_axis(axis: Any, scale: LengthScale, name: str) -> None:
    """Write the ticks and the label of an axis in a scale."""
    from matplotlib.ticker import FuncFormatter

    axis.set_major_formatter(FuncFormatter(lambda value, _: scale.text(value)))
    axis.set_label_text(scale.label(name))


def colour_bar(image: Any, ax: "Axes", scale: LengthScale, name: str = "Height") -> None:
    """Colour bar as high as the axes, however these are shaped."""
    bar = ax.figure.colorbar(image, cax=ax.inset_axes((1.02, 0.0, 0.025, 1.0)))
    scale_axis(bar.ax.yaxis, scale, name)


def degree_axis(axis: Any, name: str) -> None:
    """Write an axis of angles in round degrees, while the data stay in radians."""
    from matplotlib.ticker import MaxNLocator

    class Degrees(MaxNLocator):
        def tick_values(self, vmin: float, vmax: float) -> list[float]:
            ticks = super().tick_values(float(np.rad2deg(vmin)), float(np.rad2deg(vmax)))
            return [float(np.deg2rad(tick)) for tick in ticks]

    axis.set_major_locator(Degrees(nbins=6, steps=[1, 2, 5, 10]))
    scale_axis(axis, LengthScale(factor=float(np.rad2deg(1.0)), unit="deg"), name)


def annotate_axes(ax: "Axes", text: str) -> None:
    """Short remark above the right end of the axes."""
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
    """Remark by how much heights are drawn larger than distances, true at every zoom."""
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
    """How much larger a metre is drawn on the y axis than on the x axis."""
    (x0, y0), (x1, y1) = ax.transData.transform([(0.0, 0.0), (1.0, 1.0)])
    return abs(float((y1 - y0) / (x1 - x0)))


def legend_above(ax: "Axes", columns: int = 4, *, notes: bool = True) -> None:
    """Legend above the axes (and the row of notes there), so that it never covers data."""
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
    """Path with a white casing, visible on every height, and a dot where it begins."""
    x, y = np.asarray(x), np.asarray(y)
    ax.plot(x, y, color="white", linewidth=3.5, solid_capstyle="butt")
    ax.plot(x, y, color=PATH_COLOUR, linewidth=1.8, label=label)
    if np.isfinite([x[0], y[0]]).all():  # else it begins outside of what is drawn
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
