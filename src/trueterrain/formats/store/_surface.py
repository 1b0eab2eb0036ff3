"""Surfaces that do not fit into memory: written in parts, opened without reading their nodes."""

from collections.abc import Mapping
from pathlib import Path

import xarray as xr
from xarray.core import indexing

from trueterrain.core.errors import FormatError
from trueterrain.core.schemas import check_surface
from trueterrain.formats.store._layout import (
    Values,
    array_entry,
    create_array,
    create_store,
    open_store,
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


class SurfaceStore:
    """Store of a surface whose nodes are written some rows at a time, while it is computed.

    Memory stays flat however long the surface is. It is a work in progress in a folder of its own;
    `write` makes a store for users of it, complete or absent.

    Parameters
    ----------
    path : str or Path
        Folder to make.
    template : xarray.Dataset
        Surface with the axes, the reference line, the attributes and the variables to write; the
        values of its nodes do not matter. `numpy.broadcast_to` makes them without memory.

    Examples
    --------
    >>> import tempfile
    >>> from trueterrain.core.schemas import make_surface
    >>> road = make_surface([[0.0, 1.0], [2.0, 3.0]], u=[0, 1], v=[0, 1], easting=[0, 1],
    ...                     northing=[0, 0])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     store = SurfaceStore(Path(folder) / "road.zarr", road)
    ...     store.write(slice(1, 2), {"height": road.height.values[1:]})
    ...     store.write(slice(0, 1), {"height": road.height.values[:1]})
    ...     store.open().height.values
    array([[0., 1.],
           [2., 3.]])
    """

    def __init__(self, path: str | Path, template: xr.Dataset) -> None:
        self.path = Path(path)
        store = create_store(self.path, template.attrs)
        self._arrays = {}
        entries = []
        for name, variable in template.variables.items():
            array = create_array(
                store,
                str(name),
                dims=variable.dims,
                shape=variable.shape,
                dtype=variable.dtype,
                attrs=variable.attrs,
                rows=rows_of("surface", template.sizes),
            )
            if variable.dims == template["height"].dims:
                self._arrays[str(name)] = array
            else:
                array[...] = variable.values
            entries.append(
                array_entry(str(name), array, variable.dims, coordinate=name in template.coords)
            )
        write_summary(store, entries, SurfaceStatistics(template).to_dict())

    def write(self, rows: slice, values: Mapping[str, Values]) -> None:
        """Write nodes of some rows; whole chunks are fastest, and rows may be written again.

        Parameters
        ----------
        rows : slice
            Rows.
        values : mapping of str to numpy.ndarray, shape (row, column)
            Values of some or all variables.
        """
        for name, part in values.items():
            self._arrays[name][rows] = part

    def open(self) -> xr.Dataset:
        """Surface with all rows, whose nodes stay on disk.

        Returns
        -------
        xarray.Dataset
            As by `open_surface`.
        """
        return open_surface(self.path)
