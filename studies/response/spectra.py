"""Spectra of the response of the quarter car on each road, and their figure."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

from trueterrain.figures import save_figure
from trueterrain.figures.canvas import COLOURS
from trueterrain.verify.response import BANDS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Which = tuple[str, str]

REFERENCE = "", "reference"

#: Group and name of each reduction that is drawn, and its name in the legend.
DRAWN: dict[Which, str] = {
    ("line", "bare line"): "bare line",
    ("median", "r = 25 mm"): "median, 25 mm (thesis)",
    ("70th percentile", "r = 100 mm"): "70th percentile, 100 mm",
    ("envelope on a profile", "radial springs on the line laser"): "springs on the line laser",
    ("envelope on the surface", "tandem cams"): "cams on the surface",
}
ROWS = {
    "tyre_force": "Tyre force [N²/Hz]",
    "body_acceleration": "Body acceleration [(m/s²)²/Hz]",
}
LOWEST, HIGHEST = 1.0, 100.0  # [Hz] drawn: five lines of the shortest record to twice the bands
EDGES = LOWEST * 2.0 ** (np.arange(41) / 6)  # [Hz] of bands, a sixth of an octave each


class Road(Protocol):
    """Attributes of a road that the figure needs."""

    @property
    def course(self) -> str:
        """Name."""

    @property
    def spectra(self) -> Mapping[Which, xr.Dataset]:
        """Densities on the reference and on what is drawn, from `densities`."""


def densities(response: xr.Dataset) -> xr.Dataset:
    """Mean density of a response within each band, over all wheels [unit²/Hz].

    A periodogram with a Hann window over the whole record, as the bands of `compare_responses` are
    made. A line stands for the frequencies nearest to it, so a band narrower than the lines are
    apart has the density of the nearest.
    """
    from scipy.signal import periodogram

    rate = 1 / float(response.time[1] - response.time[0])
    found = {}
    for name in ROWS:
        frequency, density = periodogram(response[name].values, rate, window="hann", axis=-1)
        width = frequency[1]
        power = np.concatenate([[0.0], np.cumsum(width * density.mean(axis=0))])
        at_edges = np.interp(EDGES, width * (np.arange(power.size) - 0.5), power)
        found[name] = ("band", np.diff(at_edges) / np.diff(EDGES))
    return xr.Dataset(found, {"frequency": ("band", np.sqrt(EDGES[1:] * EDGES[:-1]))})


def draw_spectra(roads: Sequence[Road], path: Path) -> None:
    """Write the figure: a column for each road, tyre force above body acceleration."""
    import matplotlib.pyplot as plt

    size = 2.55 * len(roads), 5.9
    with mpl.rc_context({"font.size": 8.0, "axes.titlesize": 9.0, "lines.linewidth": 1.1}):
        figure, axes = plt.subplots(
            len(ROWS), len(roads), figsize=size, sharex=True, layout="constrained"
        )
        for column, road in enumerate(roads):
            axes[0, column].set_title(road.course)
            axes[-1, column].set_xlabel("Frequency [Hz]")
            for ax, quantity in zip(axes[:, column], ROWS, strict=True):
                _panel(ax, road, quantity)
        for ax, label in zip(axes[:, 0], ROWS.values(), strict=True):
            ax.set_ylabel(label)
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=6, frameon=False)
        path.parent.mkdir(exist_ok=True)
        save_figure(figure, path, force=True)
        plt.close(figure)


def _panel(ax: "Axes", road: Road, quantity: str) -> None:
    """Draw one panel; the reference is a wide grey line below the others."""
    for _, high in BANDS:
        ax.axvline(high, color="0.85", linewidth=0.6, zorder=0.5)
    truth = road.spectra[REFERENCE]
    ax.plot(truth.frequency, truth[quantity], color="0.72", linewidth=3.6, label=REFERENCE[1])
    for colour, (which, label) in zip(COLOURS, DRAWN.items(), strict=False):
        found = road.spectra[which]
        ax.plot(found.frequency, found[quantity], color=colour, label=label)
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_xlim(LOWEST, HIGHEST)
    top = max(float(found[quantity].max()) for found in road.spectra.values())
    ax.set_ylim(0.4 * float(truth[quantity].min()), 2 * top)
    ax.yaxis.set_minor_locator(NullLocator())
    ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 3.0)))
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.tick_params(which="both", direction="in")
