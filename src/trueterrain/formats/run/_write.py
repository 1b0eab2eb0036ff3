"""Write runs block by block."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core import require_writable, whole_store
from trueterrain.core.errors import FormatError, SchemaError
from trueterrain.core.schemas.navigation import (
    NAVIGATION,
    EpochRules,
    TimeChecker,
    check_structure,
    navigation_of,
)
from trueterrain.core.schemas.run import (
    GROUPS,
    KIND,
    QUANTUM,
    ROW_CHUNK,
    SCAN_CHUNK,
    SCANS,
    SCHEMA,
    TIME_REFERENCES,
    Mounting,
)
from trueterrain.formats.run._handle import open_unchecked
from trueterrain.formats.run._store import AppendableStore
from trueterrain.formats.run._values import (
    fan_of,
    fill_of,
    positions_of,
    quantise_ranges,
    require_shape,
    whole_intensity,
)
from trueterrain.formats.run.rules import check_run
from trueterrain.geometry.navigation_frames import check_origin

Array = npt.NDArray[Any]
Floats = npt.NDArray[np.float64]


class RunWriter:
    """Writer of a run, block by block; the store appears when it is complete.

    Memory stays flat however long the run is. Blocks of any size give the same store, byte by byte.
    Ranges are rounded to 0.1 mm, all else is stored exactly. At the end the run is checked by
    `check_run`; if it breaks a rule, or the body of the ``with`` statement fails, nothing remains.

    Parameters
    ----------
    path : str or Path
        Path of the store to write: a folder ``NAME.zarr``.
    name : str
        Name of the run.
    origin : sequence of float
        Longitude [deg], latitude [deg], ellipsoidal height [m] of the local frame.
    time_reference : str
        ``"gps"`` (seconds of the GPS week) or ``"run"`` (seconds from an arbitrary epoch).
    mounting : Mounting
        Pose of the scanner in the body frame, and clock offsets.
    angle : array_like, shape (beam,)
        Angle of each beam from straight down, positive to the left [rad].
    delay : array_like, shape (beam,)
        Time of each beam after that of its scan [s].
    accelerometer_positions : array_like, shape (sensor, 3), optional
        Positions in the body frame [m], if there are accelerometers.
    truth : mapping of xarray.Dataset, optional
        Groups of ``truth`` that do not grow, such as the ground.
    max_range : float
        Largest range of the scanner [m]; beyond 6.5534 m ranges take four bytes instead of two.
    history : str
        Provenance of the inputs, in the form of `trueterrain.core.provenance`.
    force : bool
        Replace an existing run.

    Raises
    ------
    ValueError
        If an argument breaks its rule.
    OutputError
        If the store exists and `force` is false, or its folder does not exist.

    Examples
    --------
    >>> import tempfile
    >>> from trueterrain.formats.run import open_run
    >>> time = np.arange(5) * 0.001
    >>> still = {name: np.zeros(2) for name in ("east", "north", "up", "roll", "pitch", "yaw")}
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "still.zarr"
    ...     with RunWriter(
    ...         path, name="still", origin=(11.0, 48.0, 500.0), time_reference="run",
    ...         mounting=Mounting(), angle=[-0.1, 0.0, 0.1], delay=[0.0, 0.0, 0.0],
    ...     ) as run:
    ...         run.append_navigation({"time": [-1.0, 1.0], **still})
    ...         run.append_scans(time, np.full((5, 3), 2.00004))
    ...     open_run(path)["scans"].range.values[0]
    array([2., 2., 2.])
    """

    def __init__(
        self,
        path: str | Path,
        *,
        name: str,
        origin: Sequence[float],
        time_reference: str,
        mounting: Mounting,
        angle: npt.ArrayLike,
        delay: npt.ArrayLike,
        accelerometer_positions: npt.ArrayLike | None = None,
        truth: Mapping[str, xr.Dataset] | None = None,
        max_range: float = 6.5,
        history: str = "[]",
        force: bool = False,
    ) -> None:
        self._path, self._force = Path(path), force
        require_writable(self._path, force=force, replaces=("run",))
        if time_reference not in TIME_REFERENCES:
            message = f"time_reference must be one of {TIME_REFERENCES}, got {time_reference!r}."
            raise ValueError(message)
        self._fill = fill_of(max_range)
        self._fan = fan_of(angle, delay)
        self._attrs = {
            "kind": KIND,
            "schema": SCHEMA,
            "name": name,
            "origin": list(check_origin(origin)),
            "time_reference": time_reference,
            "mounting": mounting.to_attrs(),
            "provenance": history,
        }
        self._positions = positions_of(accelerometer_positions)
        self._truth_groups: set[str] = set()
        self._truth = dict(truth or {})
        self._rules = EpochRules(path=self._path, place="navigation")
        self._clocks = {
            group: TimeChecker(path=self._path, place=f"{group}, variable time")
            for group in ("scans", "accelerometers")
        }
        self._stack = ExitStack()
        self._temporary: Path | None = None
        self._opened: AppendableStore | None = None

    def __enter__(self) -> "RunWriter":
        with ExitStack() as stack:
            temporary = stack.enter_context(whole_store(self._path, ("run",), force=self._force))
            self._temporary, self._opened = temporary, AppendableStore(temporary, self._attrs)
            for group, data in self._truth.items():
                self._append_truth(group, data, dim=None)
            self._stack = stack.pop_all()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        store, self._opened = self._store, None
        if kind is not None:
            self._stack.__exit__(kind, error, trace)
            return
        with self._stack:
            store.close(self._path)
            self._check()

    @property
    def _store(self) -> AppendableStore:
        if self._opened is None:
            message = "a RunWriter must be used in a with statement, before its end."
            raise ValueError(message)
        return self._opened

    def append_scans(
        self,
        time: npt.ArrayLike,
        range: npt.ArrayLike,  # noqa: A002 - called as the variable is
        intensity: npt.ArrayLike | None = None,
    ) -> None:
        """Append scans.

        Parameters
        ----------
        time : array_like, shape (scan,)
            Time of the first beam of each scan, by the scanner's clock [s].
        range : array_like, shape (scan, beam)
            Ranges [m], NaN where there was no return.
        intensity : array_like, shape (scan, beam), optional
            Strength of the returns, whole numbers from 0 to 65535; either always or never.

        Raises
        ------
        ValueError
            If shapes do not fit, or intensity comes and goes.
        SchemaError
            If time does not run forward, a range is not greater than 0 m or larger than the
            largest, or an intensity is no whole number.
        """
        stamps, ranges = np.asarray(time, dtype=np.float64), np.asarray(range)
        beams = self._fan["angle"].size
        require_shape("time", stamps, (None,))
        require_shape("range", ranges, (stamps.size, beams))
        first = self._clocks["scans"].count
        columns: dict[str, Array] = {
            "time": stamps,
            "range": quantise_ranges(ranges, self._fill, first, self._path),
        }
        if intensity is not None:
            values = np.asarray(intensity)
            require_shape("intensity", values, (stamps.size, beams))
            columns["intensity"] = whole_intensity(values, first, self._path)
        self._clocks["scans"].check(stamps)
        self._require_same("scans", columns)
        if not self._store.names("scans"):
            self._start_scans(columns)
        for name, rows in columns.items():
            self._store.append(f"scans/{name}", rows)

    def append_navigation(self, block: Mapping[str, npt.ArrayLike] | xr.Dataset) -> None:
        """Append epochs of the navigation.

        Parameters
        ----------
        block : mapping of array_like, shape (epoch,), or xarray.Dataset
            ``time`` [s], ``east``, ``north``, ``up`` [m], ``roll``, ``pitch``, ``yaw`` [rad]; and
            any of ``sd_east`` ... ``sd_yaw``, the same in all blocks.

        Raises
        ------
        ValueError
            If names differ between blocks.
        SchemaError
            As by `trueterrain.formats.navigation.check_navigation`.
        """
        if isinstance(block, xr.Dataset):
            data = block
        else:
            unknown = [name for name in block if name not in NAVIGATION]
            if unknown:
                message = f"navigation must hold {', '.join(NAVIGATION)}, got {unknown[0]!r}."
                raise ValueError(message)
            data = navigation_of(block)
        check_structure(data, NAVIGATION, path=self._path, place="navigation")
        self._rules.check(data)
        columns = {str(name): data[name].values for name in data.data_vars}
        self._append_columns("navigation", columns)

    def append_accelerometers(self, time: npt.ArrayLike, acceleration: npt.ArrayLike) -> None:
        """Append samples of the accelerometers.

        Parameters
        ----------
        time : array_like, shape (sample,)
            Time by the accelerometers' clock [s].
        acceleration : array_like, shape (sample, sensor)
            Specific force along the z axis of the body [m/s²].

        Raises
        ------
        ValueError
            If shapes do not fit, or no positions were given.
        SchemaError
            If time does not ascend.
        """
        if self._positions is None:
            message = "accelerometer_positions must be given to the RunWriter, got none."
            raise ValueError(message)
        stamps = np.asarray(time, dtype=np.float64)
        values = np.asarray(acceleration, dtype=np.float64)
        require_shape("time", stamps, (None,))
        require_shape("acceleration", values, (stamps.size, len(self._positions)))
        self._clocks["accelerometers"].check(stamps)
        if not self._store.names("accelerometers"):
            self._write_fixed("accelerometers", "position", self._positions)
        self._append_columns("accelerometers", {"time": stamps, "acceleration": values})

    def append_truth(self, group: str, data: xr.Dataset, *, dim: str | None = None) -> None:
        """Append to a group of ``truth``.

        Parameters
        ----------
        group : str
            Name of the group, such as ``"pose"``.
        data : xarray.Dataset
            Variables that grow along `dim`; others are written with the first block only.
        dim : str, optional
            Dimension that grows; by default the only one.

        Raises
        ------
        ValueError
            If there is no such dimension, or variables come and go.
        """
        if dim is None:
            if len(data.sizes) != 1:
                message = f"dim must be one of {sorted(map(str, data.sizes))}, got None."
                raise ValueError(message)
            dim = str(next(iter(data.sizes)))
        if dim not in data.sizes:
            message = f"dim must be one of {sorted(map(str, data.sizes))}, got {dim!r}."
            raise ValueError(message)
        self._append_truth(group, data, dim=dim)

    def _append_truth(self, name: str, data: xr.Dataset, *, dim: str | None) -> None:
        group = f"truth/{name}"
        variables = {str(key): variable for key, variable in data.variables.items()}
        growing = {
            key: variable.transpose(dim, ...)
            for key, variable in variables.items()
            if dim in variable.dims
        }
        if group not in self._truth_groups:
            self._truth_groups.add(group)
            for key, variable in variables.items():
                if key in growing:
                    variable = growing[key]
                    self._store.grow(
                        f"{group}/{key}", variable.values, variable.dims, variable.attrs
                    )
                else:
                    self._store.write(
                        f"{group}/{key}", variable.values, variable.dims, variable.attrs
                    )
            self._store.set_attrs(group, data.attrs)
        self._require_same(group, growing)
        for key, variable in growing.items():
            self._store.append(f"{group}/{key}", variable.values)

    def _append_columns(self, group: str, columns: dict[str, Array]) -> None:
        self._require_same(group, columns)
        schema = GROUPS[group]
        if not self._store.names(group):
            for name, values in columns.items():
                attrs = {"units": schema[name].units}
                self._store.grow(f"{group}/{name}", values, schema[name].dims, attrs)
        for name, values in columns.items():
            self._store.append(f"{group}/{name}", values)

    def _start_scans(self, columns: dict[str, Array]) -> None:
        for name, values in self._fan.items():
            self._write_fixed("scans", name, values)
        for name, values in columns.items():
            attrs: dict[str, Any] = {"units": SCANS[name].units}
            if name == "range":
                attrs |= {"scale_factor": QUANTUM, "_FillValue": self._fill}
            self._store.grow(
                f"scans/{name}",
                values,
                SCANS[name].dims,
                attrs,
                chunk=ROW_CHUNK if name == "time" else SCAN_CHUNK,
                fill=attrs.get("_FillValue"),
            )

    def _write_fixed(self, group: str, name: str, values: Array) -> None:
        rule = GROUPS[group][name]
        self._store.write(f"{group}/{name}", values, rule.dims, {"units": rule.units})

    def _require_same(self, group: str, columns: Mapping[str, Any]) -> None:
        known = self._store.names(group)
        changed = known ^ set(columns) if known else set()
        if changed:
            message = (
                f"{group} must hold the same variables in every block, but "
                f"{', '.join(sorted(changed))} came or went."
            )
            raise ValueError(message)

    def _check(self) -> None:
        assert self._temporary is not None
        try:
            check_run(open_unchecked(self._temporary), self._temporary)
        except (SchemaError, FormatError) as error:
            # errors name the output, not the temporary name
            raise type(error)(
                error.problem, path=self._path, place=error.place, cure=error.cure
            ) from None
