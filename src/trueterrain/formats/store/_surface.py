"""Surfaces that do not fit into memory: written in parts, opened without reading their nodes."""

from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import xarray as xr
from xarray.core import indexing

from trueterrain.core import whole_store
from trueterrain.core.errors import FormatError
from trueterrain.core.schemas import check_surface
from trueterrain.formats.store._layout import (
    Values,
    array_entry,
    create_array,
    create_group,
    open_store,
    plain_attrs,
    rows_of,
    write_summary,
)
from trueterrain.formats.store._statistics import SurfaceStatistics


def open_surface(path: str | Path) -> xr.Dataset:
    """Open a surface whose nodes stay on disk.

    Functions that go through all nodes read them block by block; see
    `trueterrain.core.row_blocks`. Use `read` for a surface that fits into memory.

    Parameters
    ----------
    path : str or Path
        Folder ``NAME.zarr``.

    Returns
    -------
    xarray.Dataset
        Surface; axes and reference line are in memory.

    Raises
    ------
    FormatError
        If it is no store of a surface, or damaged; damage of a chunk is found when it is read.

    Examples
    --------
    >>> import tempfile
    >>> from trueterrain.core.schemas import make_surface
    >>> from trueterrain.formats.store import write
    >>> ramp = make_surface([[0.0, 1.0], [2.0, 3.0]], easting=[0, 1], northing=[0, 1])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write(ramp, Path(folder) / "ramp.zarr")
    ...     open_surface(Path(folder) / "ramp.zarr").height[1].values
    array([2., 3.])
    """
    stored = open_store(path)
    if stored.kind != "surface":
        raise FormatError(f"holds a {stored.kind}, not a surface", path=path)
    variables: dict[str, xr.Variable] = {}
    coordinates: dict[str, xr.Variable] = {}
    for entry in stored.entries:
        if len(entry.dims) < 2:
            variable = stored.variable(entry)
        else:
            array = stored.arrays[entry.name]
            variable = xr.Variable(
                entry.dims,
                indexing.LazilyIndexedArray(array),
                array.attrs,
                {"preferred_chunks": dict(zip(entry.dims, array.chunks, strict=True))},
            )
        (coordinates if entry.coordinate else variables)[entry.name] = variable
    return check_surface(xr.Dataset(variables, coordinates, stored.attrs), path=path)


class SurfaceWriter:
    """Writer of a surface along a reference line, some rows at a time.

    Memory stays flat however long the surface is. The store appears when it is complete; if the
    body of the ``with`` statement fails, nothing remains.

    Parameters
    ----------
    path : str or Path
        Path of the store to write: a folder ``NAME.zarr``.
    template : xarray.Dataset
        Surface with the axes, the reference line, the attributes and the variables to write; the
        values of its nodes do not matter. `numpy.broadcast_to` makes them without memory.
    force : bool
        Replace an existing store of a surface.

    Examples
    --------
    >>> import tempfile
    >>> from trueterrain.core.schemas import make_surface
    >>> road = make_surface([[0.0, 1.0], [2.0, 3.0]], u=[0, 1], v=[0, 1], easting=[0, 1],
    ...                     northing=[0, 0])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "road.zarr"
    ...     with SurfaceWriter(path, road) as writer:
    ...         writer.write(slice(1, 2), {"height": road.height.values[1:]})
    ...         writer.write(slice(0, 1), {"height": road.height.values[:1]})
    ...     open_surface(path).height.values
    array([[0., 1.],
           [2., 3.]])
    """

    def __init__(self, path: str | Path, template: xr.Dataset, *, force: bool = False) -> None:
        self._template = template
        self._output = whole_store(path, ("surface",), force=force)

    def __enter__(self) -> "SurfaceWriter":
        data = self._template
        self._root = create_group(self._output.__enter__(), data.attrs)
        self._arrays = {}
        self._entries = []
        for name, variable in data.variables.items():
            array = create_array(
                self._root,
                str(name),
                dims=variable.dims,
                shape=variable.shape,
                dtype=variable.dtype,
                attrs=variable.attrs,
                rows=rows_of("surface", data.sizes),
            )
            if variable.dims == data["height"].dims:
                self._arrays[str(name)] = array
            else:
                array[...] = variable.values
            self._entries.append(
                array_entry(str(name), array, variable.dims, coordinate=name in data.coords)
            )
        self.chunk = int(self._arrays["height"].chunks[0])
        return self

    def write(self, rows: slice, values: Mapping[str, Values]) -> None:
        """Write the nodes of some rows; whole chunks are fastest, and rows may be written again.

        Parameters
        ----------
        rows : slice
            Rows.
        values : mapping of str to numpy.ndarray, shape (row, column)
            Values of all variables.
        """
        for name, array in self._arrays.items():
            array[rows] = values[name]

    def set_attrs(self, attrs: Mapping[Any, Any]) -> None:
        """Set the attributes of the surface, such as its provenance.

        Parameters
        ----------
        attrs : mapping
            Attributes.
        """
        self._root.attrs.put(plain_attrs(attrs, "the dataset"))

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if error is None:
            statistics = SurfaceStatistics(self._template)
            height = self._arrays["height"]
            for start in range(0, height.shape[0], self.chunk):
                statistics.add(np.asarray(height[start : start + self.chunk]))
            write_summary(self._root, self._entries, statistics.to_dict())
        self._output.__exit__(kind, error, trace)
