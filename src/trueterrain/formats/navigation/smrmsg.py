"""SMRMSG: the accuracy that Applanix POSPac reports for its smoothed trajectory.

80 bytes per record, 10 little-endian doubles: seconds of the GPS week; root mean square errors of
the position north, east and down [m], of the velocity north, east and down [m/s], and of roll,
pitch and heading [arc minutes]. The file does not say the unit of the angles, and it was not
checked against the manufacturer's documents: minutes of arc are the unit in which measured files
are plausible (a heading of 1 to 3 minutes, roll and pitch of 0.1 to 0.2).
"""

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from trueterrain.core import provenance
from trueterrain.core.errors import CoverageError
from trueterrain.core.schemas.navigation import ACCURACY, NAVIGATION
from trueterrain.formats.navigation.records import (
    IntervalStatistics,
    WeekUnwrapper,
    file_records,
    refuse_value,
)

FIELDS = 10

#: One minute of arc [rad].
ARC_MINUTE = float(np.deg2rad(1 / 60))

#: Time beyond the ends of the file for which its last value is used [s]: one interval.
REACH = 1.0

# variable of navigation: index of its field, factor to SI units
_SD = {
    "sd_east": (2, 1.0),
    "sd_north": (1, 1.0),
    "sd_up": (3, 1.0),
    "sd_roll": (7, ARC_MINUTE),
    "sd_pitch": (8, ARC_MINUTE),
    "sd_yaw": (9, ARC_MINUTE),
}


def read(path: str | Path) -> xr.Dataset:
    """Reported standard deviations from an SMRMSG file.

    Parameters
    ----------
    path : str or Path
        The file.

    Returns
    -------
    xarray.Dataset
        Dimension ``epoch``: ``time`` [s], ``sd_east``, ``sd_north``, ``sd_up`` [m], ``sd_roll``,
        ``sd_pitch``, ``sd_yaw`` [rad]. The standard deviation of a yaw is that of the heading.

    Raises
    ------
    FormatError
        If the file is cut off, or a value is negative or not finite, naming record and field.
    SchemaError
        If time does not ascend.
    """
    path = Path(path)
    clock = WeekUnwrapper(path)
    times: list[Any] = []
    columns: dict[str, list[Any]] = {name: [] for name in _SD}
    for first, fields in file_records(path, FIELDS, "SMRMSG"):
        times.append(clock.continued(fields[0]))
        for name, (index, factor) in _SD.items():
            values = fields[index]
            bad = ~(np.isfinite(values) & (values >= 0))
            rule = "must be finite and not negative"
            refuse_value(path, name, rule, values, bad, first, "It may not be an SMRMSG file.")
            columns[name].append(values * factor)
    variables: dict[str, Any] = {"time": ("epoch", np.concatenate(times), {"units": "s"})}
    for name, parts in columns.items():
        variables[name] = ("epoch", np.concatenate(parts), {"units": NAVIGATION[name].units})
    data = xr.Dataset(variables, attrs={"time_reference": "gps"})
    return provenance.add_step(data, "read", parameters={"format": "SMRMSG"}, inputs=[path])


def add_accuracy(
    navigation: xr.Dataset, accuracy: xr.Dataset, *, path: str | Path | None = None
) -> xr.Dataset:
    """Add reported standard deviations to navigation, interpolated to its epochs.

    Parameters
    ----------
    navigation : xarray.Dataset
        Navigation, dimension ``epoch``.
    accuracy : xarray.Dataset
        ``time`` and any of ``sd_east`` ... ``sd_yaw``, dimension ``epoch``, in the same time.
    path : str or Path, optional
        File of the accuracies, for the message.

    Returns
    -------
    xarray.Dataset
        The navigation with the standard deviations of `accuracy`, linear in time.

    Raises
    ------
    CoverageError
        If an epoch lies more than 1 s before the first or after the last accuracy.
    """
    time, known = navigation.time.values, accuracy.time.values
    beyond = np.maximum(known[0] - time, time - known[-1])
    outside = int(np.count_nonzero(beyond > REACH))
    if outside:
        raise CoverageError(
            f"accuracies from {known[0]:.3f} s to {known[-1]:.3f} s do not cover {outside} of "
            f"{time.size} epochs from {time[0]:.3f} s to {time[-1]:.3f} s; the farthest is "
            f"{beyond.max():.3f} s outside",
            path=path,
            cure="Use the accuracy file of the same solution.",
        )
    sd = {
        name: ("epoch", np.interp(time, known, accuracy[name].values), accuracy[name].attrs)
        for name in ACCURACY
        if name in accuracy
    }
    return navigation.assign(sd)


def describe(path: str | Path) -> dict[str, Any]:
    """Summary of an SMRMSG file for ``trueterrain info``.

    Parameters
    ----------
    path : str or Path
        The file.

    Returns
    -------
    dict
        ``format``, ``kind``, ``count``, ``time`` [s], ``rate`` [1/s], ``jitter`` [s], ``gaps``,
        ``median`` and ``largest`` standard deviation of each axis [m, rad] and ``problems``;
        all values are plain types that JSON can hold.

    Raises
    ------
    FormatError, SchemaError
        As by `read`.
    """
    data = read(path)
    intervals = IntervalStatistics()
    intervals.add(data.time.values)
    return {
        "format": "SMRMSG",
        "kind": "accuracy",
        **intervals.to_dict(),
        "median": {name: float(data[name].median()) for name in _SD},
        "largest": {name: float(data[name].max()) for name in _SD},
        "problems": intervals.problems("accuracy"),
    }
