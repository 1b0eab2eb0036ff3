"""A recorded run: the lazy tree of its groups, and the store that they are read from."""

from pathlib import Path
from typing import Any

import xarray as xr
from xarray.core import indexing

from trueterrain.core.errors import FormatError, SchemaError
from trueterrain.core.schemas.run import Mounting
from trueterrain.formats._zarr import (
    ARRAYS,
    StoredArray,
    damaged_error,
    find_groups,
    open_arrays,
    read_group_attrs,
    require_whole,
)


class Run(xr.DataTree):  # type: ignore[no-untyped-call] # xarray checks its subclasses
    """A recorded run, opened once and passed on from stage to stage.

    It is the tree of the groups, whose values are read on access, and it knows its store, from
    which gridding reads ranges as the integers that they are stored as. `open_run` makes it.

    Examples
    --------
    >>> run = Run(xr.Dataset(attrs={"origin": [11, 48, 500], "mounting": Mounting().to_attrs()}))
    >>> run.origin, run.mounting.scanner_clock, run.source
    ((11.0, 48.0, 500.0), 0.0, None)
    """

    __slots__ = ("_arrays", "source")

    source: Path | None
    "Store of the run; None if it is in memory. Changes of the tree do not reach it."

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.source = None
        self._arrays: dict[str, StoredArray] = {}

    @property
    def mounting(self) -> Mounting:
        """Mounting that the run states; a SchemaError if it states none or an invalid one."""
        if "mounting" not in self.attrs:
            raise SchemaError("is missing", path=self.source, place="attribute mounting")
        return Mounting.from_attrs(self.attrs["mounting"], path=self.source)

    @property
    def origin(self) -> tuple[float, ...]:
        """Longitude [deg], latitude [deg] and height [m] of the origin of the local frame."""
        return tuple(float(part) for part in self.attrs["origin"])

    @property
    def file_name(self) -> str:
        """Name of the store, NAME.zarr; of a run in memory its own name."""
        return self.source.name if self.source else str(self.attrs.get("name", ""))

    @property
    def stored(self) -> dict[str, StoredArray]:
        """Arrays of the store by their path in it, such as ``scans/range``; values as stored."""
        if self.source is None:
            message = "the run is in memory, but must be read from its store: write it first."
            raise ValueError(message)
        return self._arrays

    def require_chunks(self) -> None:
        """Raise a FormatError if an array or a chunk is missing: they would be read as zeros."""
        if self.source is not None:
            require_whole(self.source, self._arrays)


def open_unchecked(path: str | Path) -> Run:
    """Open a store; neither that it is a run nor that it is complete is checked."""
    path = Path(path)
    if not path.exists():
        message = f"there is no run {path}"
        raise FileNotFoundError(message)
    if not (path / "zarr.json").is_file():
        raise FormatError(
            "is not a Zarr 3 store: it holds no zarr.json",
            path=path,
            cure="Name the folder NAME.zarr of a run, or copy the whole folder again.",
        )
    arrays = open_arrays(path)
    attrs = {name: read_group_attrs(path, name) for name in ("", *find_groups(path))}
    attrs[""].pop(ARRAYS, None)
    variables: dict[str, dict[str, xr.Variable]] = {name: {} for name in attrs}
    for name, array in arrays.items():
        group, _, short = name.rpartition("/")
        lazy = indexing.LazilyIndexedArray(array)
        variables[group][short] = xr.Variable(array.dims, lazy, array.attrs)
    groups = {}
    for name in attrs:
        try:
            data = xr.Dataset(variables[name], attrs=attrs[name])
            groups[name or "/"] = xr.decode_cf(data, decode_times=False, decode_timedelta=False)
        except (ValueError, TypeError) as error:
            raise damaged_error(path, f"group {name}", error) from None
    run = make_run(xr.DataTree.from_dict(groups))
    run.source, run._arrays = path, arrays
    return run


def make_run(tree: xr.DataTree) -> Run:
    """A run in memory from a tree of its groups; its variables are shared, not copied."""
    return Run(tree.to_dataset(inherit=False), children=dict(tree.children), name=tree.name)
