"""Figure of the steps of the merged ground where one pass ends within another."""

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from trueterrain.figures import canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from trueterrain.alignment.discontinuity.seams import SeamAgreement

_MIN_STEP = 1e-6  # [m] smaller steps are drawn at this size
_MARGIN = 1.6  # factor of the axis limits above and below


def seam_steps(seam: "SeamAgreement", *, ax: "Axes | None" = None) -> "Axes":
    """Steps at both edges of an overlap, before and after the alignment of two passes.

    Parameters
    ----------
    seam : SeamAgreement
        Steps of two passes.
    ax : Axes, optional
        Where to draw; by default a new figure.

    Returns
    -------
    Axes
        Station [m] and size of the step [m], logarithmic, so that both states can be
        read; lines are the medians, given in the legend. Compare Figs. 4-7 and 4-9 of
        Smith, "Improving the Quality of Terrain Measurement", Virginia Tech, 2009.

    Raises
    ------
    ValueError
        If there is no step at either edge.

    Examples
    --------
    >>> from trueterrain.alignment.discontinuity.seams import SeamAgreement
    >>> from trueterrain.alignment.discontinuity.alignment import SeamSteps
    >>> at, steps = np.array([0.5, 1.5]), np.array([[0.05, 0.04], [-0.05, -0.04]])
    >>> made = SeamAgreement(names=("left", "right"), before=SeamSteps(station=at, step=steps),
    ...                      after=SeamSteps(station=at, step=steps / 500))
    >>> seam_steps(made).get_ylabel()
    'Size of the step at the edge [mm]'
    """
    states = {"before": seam.before, "after": seam.after}
    sizes = np.concatenate([np.abs(state.step).ravel() for state in states.values()])
    sizes = sizes[np.isfinite(sizes)]
    if not sizes.size:
        message = f"seam of {' and '.join(seam.names)} must hold at least 1 step, got none."
        raise ValueError(message)
    ax = canvas.axes_or_new(ax, height=3.4)
    for edge, name in enumerate(seam.names):
        for when, state in states.items():
            colour = canvas.COLOURS[edge]
            face = "white" if when == "before" else colour
            if np.isfinite(state.step[edge]).any():
                ax.plot(
                    state.station,
                    np.maximum(np.abs(state.step[edge]), _MIN_STEP),
                    "o",
                    markersize=4,
                    color=colour,
                    markerfacecolor=face,
                    label=f"{when}, edge of {name}",
                )
    for when, state in states.items():
        if np.isfinite(state.median):
            style = "--" if when == "before" else "-"
            ax.axhline(
                max(state.median, _MIN_STEP),
                color="0.25",
                linewidth=1.1,
                linestyle=style,
                label=f"median {when} {1e3 * state.median:.3g} mm",
            )
    ax.set_yscale("log")
    ax.set_ylim(max(sizes.min(), _MIN_STEP) / _MARGIN, max(sizes.max(), _MIN_STEP) * _MARGIN)
    _log_millimetres(ax)
    ax.set_xlabel("Station along the overlap [m]")
    canvas.draw_grid(ax)
    small = int((sizes < _MIN_STEP).sum())
    below = f"; {small} below {1e3 * _MIN_STEP:g} mm drawn there" if small else ""
    canvas.annotate_axes(ax, f"without sign{_station_note(seam.before.station)}{below}")
    canvas.legend_above(ax, columns=3)
    return ax


def _station_note(station: npt.NDArray[np.float64]) -> str:
    if station.size < 2:
        return ""
    return f", each the mean over {float(station[1] - station[0]):.3g} m"


def _log_millimetres(ax: "Axes") -> None:
    from matplotlib.ticker import LogLocator, NullFormatter

    ax.yaxis.set_major_locator(LogLocator())
    canvas.scale_axis(
        ax.yaxis, canvas.LengthScale(factor=1000.0, unit="mm"), "Size of the step at the edge"
    )
    ax.yaxis.set_minor_formatter(NullFormatter())
