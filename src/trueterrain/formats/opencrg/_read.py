"""Read surfaces from OpenCRG files, and describe such files."""

import json
import logging
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pycrg
import xarray as xr
from xarray.backends import BackendArray
from xarray.core import indexing

from trueterrain.core import provenance
from trueterrain.core.errors import FormatError
from trueterrain.core.row_blocks import height_blocks, row_blocks
from trueterrain.core.schemas import check_surface, make_surface
from trueterrain.formats._bounds import value_range
from trueterrain.formats.opencrg import _rules
from trueterrain.formats.opencrg._header import CrgHeader, read_header
from trueterrain.formats.opencrg._offsets import section_offsets
from trueterrain.formats.opencrg._payload import CrgPayload
from trueterrain.formats.opencrg._stream import copy_sections

Floats = npt.NDArray[np.float64]

#: Prefix of the line of free text that holds the CRS, for which OpenCRG has no field.
CRS_MARK = "crs: "
#: Prefix of the lines of free text that hold the provenance, as JSON.
HISTORY_MARK = "history: "

_SINGLE = 1.2e-7  # [1] pycrg holds heights as float32
_SAME_PLACE = 1e-6  # [m]
#: Size of the numbers from which on the heights of a binary file stay on disk [bytes].
LARGE = 64_000_000

# pycrg raises errors and logs them, too; without a handler, warnings of the C code are printed
logging.getLogger("pycrg").addHandler(logging.NullHandler())


def read(path: str | Path) -> xr.Dataset:
    """Read a surface from an OpenCRG file, in the coordinates in which it is stored.

    Modifiers of the file are not applied; they are kept, like its options, as JSON in
    ``attrs["opencrg_modifiers"]`` and ``attrs["opencrg_options"]``. The heights of binary files
    above 64 MB stay on disk, so that memory does not grow with the road; ``.load()`` reads them.
    All numbers are checked once.

    Parameters
    ----------
    path : str or Path
        The file, in any of the formats KRBI, KDBI, LRFI and LDFI.

    Returns
    -------
    xarray.Dataset
        Surface with dims (u, v). ``height`` [m] is the sum of grid, elevation of the reference line
        and banking. ``banking`` [m/m] is present if the file has it.

    Raises
    ------
    FormatError
        If the file is damaged, cut off, refers to another file, or is not an OpenCRG file.

    Examples
    --------
    >>> import tempfile
    >>> from trueterrain.formats.opencrg import write
    >>> road = make_surface([[5, 6], [5, 6]], u=[0, 1], v=[0, 1], easting=[7, 8], northing=[9, 9])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = write(road, Path(folder) / "road.crg")
    ...     again = read(Path(folder) / "road.crg")
    >>> again.height.values[0], again.easting.values
    (array([5., 6.]), array([7., 8.]))
    """
    path = Path(path)
    surface = _assemble_surface(_load_file(path))
    return provenance.add_step(surface, "read", parameters={"format": "OpenCRG"}, inputs=[path])


def describe(path: str | Path) -> dict[str, Any]:
    """Summary of an OpenCRG file for ``trueterrain info``.

    Parameters
    ----------
    path : str or Path
        The file.

    Returns
    -------
    dict
        ``format``, ``kind``, ``number_format``, ``size`` (cross-sections, long sections),
        ``spacing``, ``range`` and ``extent`` [m], ``missing`` (fraction of nodes without height),
        ``curvature`` of the reference line (minimum, maximum) [1/m], ``crs``, ``modifiers``,
        ``options``, ``comment`` and ``problems``.

    Raises
    ------
    FormatError
        If the file cannot be read.

    Examples
    --------
    >>> import tempfile
    >>> from trueterrain.formats.opencrg import write
    >>> road = make_surface([[5, 6], [5, 6]], u=[0, 1], v=[0, 1], easting=[7, 8], northing=[9, 9])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = write(road, Path(folder) / "road.crg")
    ...     found = describe(Path(folder) / "road.crg")
    >>> found["size"], found["extent"]["height"], found["problems"]
    ([2, 2], [5.0, 6.0], [])
    """
    stored = _load_file(Path(path))
    surface = _assemble_surface(stored)
    header = stored.header
    u, v = (np.asarray(surface[name]) for name in ("u", "v"))
    ranges: list[float] = []
    missing = 0
    for _, block in height_blocks(surface):
        missing += int(np.isnan(block).sum())
        ranges += value_range(block) or []
    easting, northing = (np.asarray(surface[name]) for name in ("easting", "northing"))
    curvature = _rules.line_curvature(easting, northing, header.increment)
    steps = np.diff(v)
    even = bool(np.ptp(steps) < _SAME_PLACE)
    corners = _section_ends(easting, northing, v)
    return {
        "format": "OpenCRG",
        "kind": "surface",
        "number_format": header.number_format,
        "size": [u.size, v.size],
        "spacing": {"u": header.increment, "v": round(float(steps.mean()), 9) if even else None},
        "range": {"u": value_range(u), "v": value_range(v)},
        "extent": {
            "easting": value_range(corners[..., 0]),
            "northing": value_range(corners[..., 1]),
            "height": value_range(np.array(ranges)),
        },
        "missing": missing / (u.size * v.size),
        "curvature": value_range(curvature) if curvature.size else [0.0, 0.0],
        "crs": surface.attrs["crs"],
        "modifiers": header.modifiers,
        "options": header.options,
        "comment": "\n".join(header.comment).strip(),
        "problems": [*header.problems, *_rules.check_rules(header, surface, curvature)],
    }


class _ReferenceLine(NamedTuple):
    """Reference line of a road: positions, elevation [m] and banking [m/m], without heights."""

    x: Floats
    y: Floats
    ref_z: Floats
    bank: Floats


class _StoredSurface(NamedTuple):
    """Contents of a file: header, offsets of the long sections, reference line and numbers."""

    header: CrgHeader
    offsets: Floats
    line: _ReferenceLine
    numbers: CrgPayload


def _load_file(path: Path) -> _StoredSurface:
    if not path.is_file():
        raise FormatError("does not exist or is no file", path=path, cure="Check the name.")
    header = read_header(path)
    offsets = section_offsets(header)
    numbers = CrgPayload(header, offsets)
    numbers.require_possible()
    v = np.sort(offsets)
    grid, kept = None, np.arange(v.size)
    if _is_large(header):
        # the library holds a file twice in memory, so it gets both edges of the road alone
        grid = _grid_of_copy(header, kept[[0, -1]], v)
        kept = kept if grid is None else kept[[0, -1]]
    if grid is None:
        grid = _library_grid(header, header.path)
    _require_agreement(header, numbers, grid, kept)
    line = _ReferenceLine(grid.x, grid.y, grid.ref_z, grid.bank)
    return _StoredSurface(header, v, line, numbers)


def _grid_of_copy(
    header: CrgHeader, kept: npt.NDArray[np.int64], v: Floats
) -> pycrg.CrgGrid | None:
    """What the library reads from a copy with some long sections; None if it refuses the copy.

    Headers of other programs may be laid out so that their long sections cannot be exchanged.
    """
    with tempfile.TemporaryDirectory() as folder:
        part = Path(folder) / "part.crg"
        copy_sections(header, part, kept, v)
        try:
            grid = _library_grid(header, part)
        except FormatError:
            return None
    return grid if grid.z.shape[1] == kept.size else None


def _is_large(header: CrgHeader) -> bool:
    """Whether the heights of a file stay on disk."""
    return header.is_binary and header.path.stat().st_size - header.data_offset > LARGE


def _library_grid(header: CrgHeader, path: Path) -> pycrg.CrgGrid:
    try:
        with pycrg.DataSet.open(path, apply_modifiers=False) as data:
            return data.grid()
    except pycrg.OpenCRGError as error:
        reason = error.messages[-1][1].strip() if error.messages else str(error)
        raise FormatError(
            f"the OpenCRG library refuses it: {reason}",
            path=header.path,
            cure="Export the file again.",
        ) from error


def _require_agreement(
    header: CrgHeader, numbers: CrgPayload, line: pycrg.CrgGrid, sections: npt.NDArray[np.int64]
) -> None:
    """Raise unless this package and the ASAM C-API read the same numbers from some long sections.

    Heights of the C-API are float32.
    """
    shape = numbers.rows, sections.size
    same = shape == line.z.shape and abs(line.u[0] - header.start) < _SAME_PLACE
    for rows in row_blocks(numbers.shape) if same else ():
        grid = numbers[rows][1][:, sections]
        near = np.abs(grid - line.z[rows]) <= _SINGLE * np.abs(grid) + 1e-30
        same &= bool((near | (np.isnan(grid) & np.isnan(line.z[rows]))).all())
    if not same:
        raise FormatError(
            f"the OpenCRG library reads other numbers from it: {line.z.shape[0]} x "
            f"{line.z.shape[1]} heights, where header and data hold {shape[0]} x {shape[1]}",
            path=header.path,
            cure="Export the file again.",
        )
    for name in ("x", "y", "ref_z", "bank"):
        wrong = np.flatnonzero(~np.isfinite(getattr(line, name)))
        if wrong.size:
            raise FormatError(
                "the reference line must be finite",
                path=header.path,
                place=f"cross-section {wrong[0] + 1}",
                cure="The numbers are damaged: copy or export the file again.",
            )


def _assemble_surface(stored: _StoredSurface) -> xr.Dataset:
    header, v, line = stored.header, stored.offsets, stored.line
    banked = bool(line.bank.any())
    heights = _CrgHeights(stored)
    large = _is_large(header)
    surface = make_surface(
        np.broadcast_to(np.nan, heights.shape) if large else heights.read((slice(None),) * 2),
        u=header.start + header.increment * np.arange(line.x.size),
        v=v,
        easting=line.x,
        northing=line.y,
        elevation=line.ref_z,
        banking=line.bank if banked else None,
        crs=_marked_text(header, CRS_MARK),
    )
    if large:
        # these classes of xarray have no type annotations
        lazy = indexing.LazilyIndexedArray(heights)
        chunks = {"u": next(row_blocks(heights.shape)).stop, "v": v.size}
        surface["height"] = xr.Variable(
            ("u", "v"), lazy, surface["height"].attrs, {"preferred_chunks": chunks}
        )
    _restore_history(surface, header)
    for name in ("modifiers", "options"):
        if entries := getattr(header, name):
            surface.attrs[f"opencrg_{name}"] = json.dumps(entries)
    return check_surface(surface, path=header.path)


class _CrgHeights(BackendArray):
    """Heights of a file, sum of grid, reference line and banking, read on demand."""

    def __init__(self, stored: _StoredSurface) -> None:
        self._stored = stored
        self._banked = bool(stored.line.bank.any())
        self.shape = stored.numbers.shape
        self.dtype = np.dtype(np.float64)

    def __getitem__(self, key: indexing.ExplicitIndexer) -> Any:
        support = indexing.IndexingSupport.BASIC
        return indexing.explicit_indexing_adapter(key, self.shape, support, self.read)

    def read(self, key: tuple[int | slice, ...]) -> Floats:
        """Heights of some rows and columns [m]."""
        line, v = self._stored.line, self._stored.offsets
        wanted = np.arange(self.shape[0])[key[0]]
        rows = np.atleast_1d(wanted)
        found = np.empty((rows.size, self.shape[1]))
        for block in row_blocks(found.shape):
            some = rows[block]
            first = int(some.min())
            _, grid = self._stored.numbers[slice(first, int(some.max()) + 1)]
            np.add(grid[some - first], line.ref_z[some, None], out=found[block])
            if self._banked:
                found[block] += line.bank[some, None] * v
        return np.asarray(found.reshape(*wanted.shape, self.shape[1])[..., key[1]])


def _marked_text(header: CrgHeader, mark: str) -> str:
    """Text of all lines of the comment that begin with a mark, joined."""
    return "".join(line.removeprefix(mark) for line in header.comment if line.startswith(mark))


def _restore_history(surface: xr.Dataset, header: CrgHeader) -> None:
    text = _marked_text(header, HISTORY_MARK)
    try:
        history = json.loads(text) if text else None
    except json.JSONDecodeError:
        header.problems.append("the provenance in the free text is damaged and not read")
        return
    if isinstance(history, list):
        surface.attrs["provenance"] = json.dumps(history)


def _section_ends(easting: Floats, northing: Floats, v: Floats) -> Floats:
    """Both ends of each cross-section [m], on the bisector of its two chords of equal length."""
    # half the sum of both chords has the direction of the bisected line and the length L cos(a/2),
    # a the angle between them; times L / |along|² it is the unit vector over cos(a/2), so that the
    # ends keep their distance v from both chords
    along = np.stack([np.gradient(easting), np.gradient(northing)], axis=-1)
    chord = np.hypot(easting[1] - easting[0], northing[1] - northing[0])
    along *= chord / (along**2).sum(axis=1, keepdims=True)
    normal = np.stack([-along[:, 1], along[:, 0]], axis=-1)
    line = np.stack([easting, northing], axis=-1)
    return np.stack([line + v[0] * normal, line + v[-1] * normal], axis=1)
