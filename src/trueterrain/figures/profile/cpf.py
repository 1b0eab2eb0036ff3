"""CPF of the heights inside one search area (as thesis Fig. 5-7)."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from trueterrain.figures import canvas
from trueterrain.profile import (
    HeightDistribution,
    HeightDistributions,
    InverseDistance,
    Mean,
    Median,
    Percentile,
    Statistic,
    SteepestCpf,
    Window,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_CURVE_POINTS = 600  # enough that a curve over the width of a page looks smooth
_MARGIN = 0.06  # [1] of the range of heights, on both sides


def cpf(
    distribution: HeightDistribution,
    *,
    resolution: float | None = None,
    statistics: Sequence[Statistic] | None = None,
    ax: "Axes | None" = None,
) -> "Axes":
    """Cumulative probability function (CPF) of the heights inside one search area.

    Parameters
    ----------
    distribution : HeightDistribution
        Heights around one path point.
    resolution : float, optional
        Step of quantised heights [m]: the CPF is continued between the steps by PCHIP.
    statistics : sequence of Statistic
        Statistics to mark, each with its standard deviation; by default the median and the height
        where the CPF is steepest.
    ax : Axes, optional
        Where to draw; by default a new figure.

    Returns
    -------
    Axes
        Height in metres and cumulative probability.

    Raises
    ------
    ValueError
        If there are no heights, or the resolution is not greater than 0.

    Examples
    --------
    >>> import numpy as np
    >>> heights = np.array([0.001, 0.002, 0.002, 0.003])
    >>> one = HeightDistribution(heights=heights, distances=np.zeros(4))
    >>> ax = cpf(one, resolution=0.001, statistics=[Mean()])
    >>> ax.get_legend().get_texts()[-1].get_text()
    'mean 2.0 ± 0.4 mm'
    """
    heights = distribution.heights
    if heights.size == 0:
        message = "distribution must hold at least one height, got an empty search area."
        raise ValueError(message)
    ax = canvas.axes_or_new(ax, height=4.0)
    scale = canvas.height_scale(heights)
    margin = _MARGIN * max(float(np.ptp(heights)), 1e-4) + (resolution or 0.0) / 2
    low, high = heights[0] - margin, heights[-1] + margin
    values = np.unique(heights)
    ax.step(
        np.concatenate([[low], values, [high]]),
        np.concatenate([[0.0], distribution.cpf(values), [1.0]]),
        where="post",
        color="0.45",
        linewidth=1.2,
        label=f"{heights.size} heights",
    )
    if resolution is not None:
        _draw_continuation(ax, distribution, resolution, low, high)
    if statistics is None:
        statistics = (Median(resolution=resolution), SteepestCpf())
    for number, statistic in enumerate(statistics):
        _mark_statistic(ax, distribution, statistic, scale, canvas.COLOURS[(number + 1) % 7])
    ax.set_xlim(low, high)
    ax.set_ylim(-0.02, 1.02)
    canvas.scale_axis(ax.xaxis, scale, "Height")
    ax.set_ylabel("Cumulative probability [1]")
    canvas.draw_grid(ax)
    canvas.legend_above(ax, columns=2, notes=False)
    return ax


def _draw_continuation(
    ax: "Axes", distribution: HeightDistribution, resolution: float, low: float, high: float
) -> None:
    edges, probabilities = distribution.steps(resolution)
    colour = canvas.COLOURS[0]
    fine = np.linspace(low, high, _CURVE_POINTS)
    step = f"{1000 * resolution:g} mm"
    ax.plot(
        fine,
        distribution.continued_cpf(fine, resolution),
        color=colour,
        linewidth=1.8,
        label="continued by PCHIP",
    )
    ax.plot(
        edges,
        probabilities,
        "o",
        color=colour,
        markersize=4,
        linestyle="none",
        label=f"edges of the {step} steps",
    )


def _mark_statistic(
    ax: "Axes",
    distribution: HeightDistribution,
    statistic: Statistic,
    scale: canvas.LengthScale,
    colour: str,
) -> None:
    """Vertical line at the statistic, a band of its standard deviation, both in the legend."""
    alone = HeightDistributions(
        start=np.array([0, distribution.heights.size]),
        heights=distribution.heights,
        distances=distribution.distances,
    )
    height, sd = (float(values[0]) for values in statistic.estimate(alone))
    known = np.isfinite(sd)
    value = f"{(height - scale.base) * scale.factor:.1f}".replace("-", canvas.MINUS)
    sd_text = f" ± {sd * scale.factor:.1f}" if known else ""
    label = f"{statistic_name(statistic)} {value}{sd_text} {scale.unit}"
    if isinstance(statistic, SteepestCpf):
        width = float(statistic.bandwidths(alone)[0])
        label += f", smoothed over ± {1000 * width:.2g} mm"
    if known:
        ax.axvspan(height - sd, height + sd, color=colour, alpha=0.18, linewidth=0)
    ax.axvline(height, color=colour, linewidth=1.6, label=label)


def statistic_name(statistic: Statistic) -> str:
    """Name of a statistic in a legend.

    Parameters
    ----------
    statistic : Statistic
        The statistic.

    Returns
    -------
    str
        Its name, with its parameter.

    Examples
    --------
    >>> statistic_name(Percentile(percent=90))
    '90 % percentile'
    """
    match statistic:
        case Percentile(percent=percent):
            return f"{percent:g} % percentile"
        case Window(skip=skip, size=size):
            return f"window {skip:g} to {skip + size:g} %"
        case InverseDistance(of=of, power=power):
            return f"{of} by distance^-{power:g}"
        case Mean():
            return "mean"
        case SteepestCpf():
            return "steepest CPF"
        case Median():
            return "median"
