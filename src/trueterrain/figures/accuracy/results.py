"""Results of accuracy tests: profiles over a plate, errors, motion rejection, drift."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from trueterrain.figures import canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MILLI = 1e3
_MAX_GAP = 3.0  # of a step to the median step; a line is broken at larger ones
_RIM = 4.0  # ratio of the limits of the axes to the maximum error off edges


def plate_profile(errors: xr.Dataset, *, ax: "Axes | None" = None) -> "Axes":
    """Measured and machined profile of a calibration plate (Fig. 3-18 of Smith 2009).

    Parameters
    ----------
    errors : xarray.Dataset
        ``errors`` of a static or dynamic test: ``height`` and ``machined`` over s [m].
    ax : Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    Axes
        Position on the plate and height [m].

    Examples
    --------
    >>> found = xr.Dataset({"height": ("s", [0.0, 0.04]), "machined": ("s", [0.0, 0.05])},
    ...                    {"s": [0.0, 0.1]})
    >>> plate_profile(found).get_ylabel()
    'Height [mm]'
    """
    ax = canvas.axes_or_new(ax, height=3.0)
    s = errors["s"].values
    order = np.argsort(s)
    ax.plot(
        s[order], errors["machined"].values[order], color="0.55", linewidth=2.2, label="machined"
    )
    ax.plot(
        s[order],
        errors["height"].values[order],
        ".",
        color=canvas.COLOURS[0],
        markersize=3,
        label="measured, registered",
    )
    scale = canvas.height_scale(errors["machined"].values, errors["height"].values)
    canvas.scale_axis(ax.yaxis, scale, "Height")
    return _complete_axes(ax, "Position on the plate [m]", exaggerated=True)


def plate_error(errors: xr.Dataset, *, ax: "Axes | None" = None) -> "Axes":
    """Error over a calibration plate with its standard deviation (Figs 3-17, 3-19, 3-23).

    Parameters
    ----------
    errors : xarray.Dataset
        ``errors`` of a static or dynamic test: ``error``, ``sd`` [m], ``edge`` over s [m], and
        optionally ``flagged``.
    ax : Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    Axes
        Position on the plate [m] and error [m]; errors next to edges and of flagged intensity are
        marked. Errors at upright faces can be as large as the face; those beyond the limits of the
        axes are drawn as triangles at the rim.

    Examples
    --------
    >>> found = xr.Dataset({"error": ("s", [1e-4, 2e-4]), "sd": ("s", [1e-4, 1e-4]),
    ...                     "edge": ("s", [False, True])}, {"s": [0.0, 0.1]})
    >>> len(plate_error(found).get_legend().get_texts())
    3
    """
    ax = canvas.axes_or_new(ax, height=3.0)
    order = np.argsort(errors["s"].values)
    sorted_ = errors.isel(s=order)
    s, error, sd = (sorted_[name].values for name in ("s", "error", "sd"))
    edge = sorted_["edge"].values
    flagged = sorted_["flagged"].values if "flagged" in sorted_ else np.zeros_like(edge)
    ax.axhline(0.0, color="0.5", linewidth=0.8)
    ax.fill_between(s, -sd, sd, color="0.85", linewidth=0, label="standard deviation")
    for number, (name, where) in enumerate(
        (("error", ~edge & ~flagged), ("next to an edge", edge), ("flagged", flagged & ~edge))
    ):
        if where.any():
            colour = canvas.COLOURS[number]
            ax.plot(s[where], error[where], ".", color=colour, markersize=4, label=name)
    limit = _RIM * float(np.abs(error[~edge]).max(initial=0.0))
    beyond = edge & (np.abs(error) > limit)
    noted = limit > 0 and bool(beyond.any())
    if noted:
        ax.set_ylim(-limit, limit)
        for sign, marker in ((1, "^"), (-1, "v")):
            at = s[beyond & (np.sign(error) == sign)]
            ax.plot(
                at,
                np.full(at.size, 0.96 * sign * limit),
                marker,
                color=canvas.COLOURS[1],
                markersize=5,
            )
        canvas.annotate_axes(
            ax, f"{beyond.sum()} beyond, up to {_MILLI * np.abs(error).max():.1f} mm"
        )
        error = error[~beyond]
    canvas.scale_axis(ax.yaxis, canvas.height_scale(error, sd), "Error")
    return _complete_axes(ax, "Position on the plate [m]", noted=noted)


def plate_errors(errors: Mapping[str, xr.Dataset], *, ax: "Axes | None" = None) -> "Axes":
    """Errors over a calibration plate by several methods of processing.

    Parameters
    ----------
    errors : mapping of str to xarray.Dataset
        By name of the method, at most seven: ``error`` over s [m].
    ax : Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    Axes
        Position on the plate and error [m]; lines are broken at gaps.

    Examples
    --------
    >>> found = xr.Dataset({"error": ("s", [1e-4, 2e-4])}, {"s": [0.0, 0.1]})
    >>> len(plate_errors({"first": found, "second": found}).get_legend().get_texts())
    2
    """
    ax = canvas.axes_or_new(ax, height=3.0)
    ax.axhline(0.0, color="0.5", linewidth=0.8)
    for colour, (name, one) in zip(canvas.COLOURS, errors.items(), strict=False):
        order = np.argsort(one["s"].values)
        s, error = (one[key].values[order] for key in ("s", "error"))
        step = np.diff(s)
        after = np.flatnonzero(step > _MAX_GAP * np.median(step)) + 1
        ax.plot(
            np.insert(s, after, np.nan),
            np.insert(error, after, np.nan),
            ".-",
            color=colour,
            linewidth=0.9,
            markersize=2.5,
            label=name,
        )
    every = np.concatenate([one["error"].values for one in errors.values()])
    canvas.scale_axis(ax.yaxis, canvas.height_scale(every), "Error")
    return _complete_axes(ax, "Position on the plate [m]")


def position_sensitivity(errors: xr.Dataset, *, ax: "Axes | None" = None) -> "Axes":
    """Root mean square error over the position of a plate between samples.

    Parameters
    ----------
    errors : xarray.Dataset
        ``rms`` (row, beside), and the published ``low`` and ``high`` (row) [m]; ``beside`` is a
        fraction of the spacing of the samples.
    ax : Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    Axes
        Start of the plate behind a sample [spacings] and root mean square error [mm]; published
        values are a band or a dashed line of the same colour.

    Examples
    --------
    >>> found = xr.Dataset({"rms": (("row", "beside"), [[1e-3, 2e-3]]), "low": ("row", [1e-3]),
    ...                     "high": ("row", [2e-3])}, {"row": ["static"], "beside": [0.0, 0.4]})
    >>> position_sensitivity(found).get_ylabel()
    'RMS error [mm]'
    """
    ax = canvas.axes_or_new(ax, height=3.4)
    position = errors["beside"].values
    for number, row in enumerate(errors["row"].values):
        one, colour = errors.sel(row=row), canvas.COLOURS[number % len(canvas.COLOURS)]
        low, high = (_MILLI * float(one[name]) for name in ("low", "high"))
        ax.plot(
            position, _MILLI * one["rms"].values, ".-", color=colour, linewidth=1.3, label=str(row)
        )
        if high > low:
            ax.axhspan(low, high, color=colour, alpha=0.2, linewidth=0)
        else:
            ax.axhline(low, color=colour, linewidth=1.0, linestyle="--")
    ax.set_ylim(bottom=0.0)
    ax.set_ylabel("RMS error [mm]")
    return _complete_axes(ax, "Start of the plate behind a sample [spacings]")


def motion_rejection(rejection: xr.Dataset, *, ax: "Axes | None" = None) -> "Axes":
    """Body-motion rejection of a profile over frequency, with its confidence interval.

    Parameters
    ----------
    rejection : xarray.Dataset
        ``rejection`` of a dynamic test: ``rejection``, ``low``, ``high`` [dB] over ``frequency``.
    ax : Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    Axes
        Frequency [Hz] and rejection [dB].

    Examples
    --------
    >>> found = xr.Dataset({name: ("frequency", [20.0, 30.0]) for name in
    ...                     ("rejection", "low", "high")}, {"frequency": [1.0, 2.0]})
    >>> motion_rejection(found).get_ylabel()
    'Body-motion rejection [dB]'
    """
    ax = canvas.axes_or_new(ax, height=3.0)
    frequency = rejection["frequency"].values
    ax.axhline(0.0, color="0.5", linewidth=0.8)
    ax.fill_between(
        frequency,
        rejection["low"].values,
        rejection["high"].values,
        color=canvas.COLOURS[5],
        alpha=0.35,
        linewidth=0,
        label="interval",
    )
    ax.plot(
        frequency,
        rejection["rejection"].values,
        color=canvas.COLOURS[0],
        linewidth=1.4,
        label="rejection",
    )
    ax.set_xscale("log")
    canvas.plain_log_axis(ax.xaxis)
    ax.set_ylabel("Body-motion rejection [dB]")
    return _complete_axes(ax, "Frequency [Hz]")


def drift_errors(errors: xr.Dataset, *, ax: "Axes | None" = None) -> "Axes":
    """Errors of repeated runs over distance (Fig. 2-2 of Smith 2009).

    Parameters
    ----------
    errors : xarray.Dataset
        ``errors`` of a drift test: ``error`` (run, s) and ``mean`` [m].
    ax : Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    Axes
        Distance and error [m].

    Examples
    --------
    >>> found = xr.Dataset({"error": (("run", "s"), [[0.0, 1e-3], [0.0, 2e-3]]),
    ...                     "mean": ("s", [0.0, 1.5e-3])}, {"s": [0.0, 100.0], "run": [0, 1]})
    >>> drift_errors(found).get_xlabel()
    'Distance [m]'
    """
    ax = canvas.axes_or_new(ax, height=3.0)
    ax.axhline(0.0, color="0.5", linewidth=0.8)
    s = errors["s"].values
    for number, run in enumerate(errors["error"].values):
        label = "single runs" if number == 0 else None
        ax.plot(s, run, color=canvas.COLOURS[5], linewidth=0.8, label=label)
    ax.plot(s, errors["mean"].values, color=canvas.COLOURS[1], linewidth=1.6, label="mean")
    canvas.scale_axis(ax.yaxis, canvas.height_scale(errors["error"].values), "Error")
    return _complete_axes(ax, "Distance [m]")


def drift_growth(growth: xr.Dataset, *, ax: "Axes | None" = None) -> "Axes":
    """Growth of errors with distance: structure functions and Allan deviation.

    Parameters
    ----------
    growth : xarray.Dataset
        ``growth`` of a drift test: ``structure``, ``repeats``, ``allan`` [m] over ``distance``.
    ax : Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    Axes
        Distance [m] and root mean square change [mm], both logarithmic.

    Raises
    ------
    ValueError
        If the errors are the same everywhere.

    Examples
    --------
    >>> found = xr.Dataset({name: ("distance", [1e-3, 2e-3]) for name in
    ...                     ("structure", "repeats", "allan")}, {"distance": [1.0, 4.0]})
    >>> drift_growth(found).get_ylabel()
    'Change [mm]'
    """
    names = {
        "structure": "change over the distance",
        "repeats": "repeatability of the change",
        "allan": "Allan deviation of means over the distance",
    }
    if not any((growth[name].values > 0).any() for name in names):
        message = "growth must not be zero everywhere: the errors are the same at all stations."
        raise ValueError(message)
    ax = canvas.axes_or_new(ax, height=3.4)
    for number, (name, label) in enumerate(names.items()):
        positive = growth[name].values > 0
        ax.plot(
            growth["distance"].values[positive],
            _MILLI * growth[name].values[positive],
            color=canvas.COLOURS[number],
            linewidth=1.3,
            marker="o",
            markersize=3,
            label=label,
        )
    ax.set_xscale("log")
    ax.set_yscale("log")
    for axis in (ax.xaxis, ax.yaxis):
        canvas.plain_log_axis(axis)
    ax.set_ylabel("Change [mm]")
    return _complete_axes(ax, "Distance [m]")


def _complete_axes(
    ax: "Axes", label: str, *, exaggerated: bool = False, noted: bool = False
) -> "Axes":
    ax.set_xlabel(label)
    ax.margins(x=0)
    canvas.draw_grid(ax)
    if exaggerated:
        canvas.note_exaggeration(ax)
    canvas.legend_above(ax, notes=exaggerated or noted)
    return ax
