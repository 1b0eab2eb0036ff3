"""Write surfaces as OpenCRG files, which are read back before they appear."""

import json
import textwrap
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain._version import __version__
from trueterrain.core import provenance, require_writable, whole_output
from trueterrain.core.errors import FormatError, OutputError
from trueterrain.core.schemas import SCHEMA, check_surface
from trueterrain.formats.opencrg import _fit, _verify
from trueterrain.formats.opencrg._blocks import block_heights, height_blocks
from trueterrain.formats.opencrg._header import NUMBER_FORMATS
from trueterrain.formats.opencrg._read import CRS_MARK, HISTORY_MARK
from trueterrain.formats.opencrg._stream import FlatRoad, flat_road, write_blocks, write_whole

Floats = npt.NDArray[np.float64]

_SHIFTED_ABOVE = 1.0  # [m] median above the line from which on float32 would lose digits
_SAMPLE = 1 << 16  # [nodes] sample that brackets the median of the heights
_STRAIGHT = 1e-6  # [m] deviation up to which a line is written as straight, with one exact heading
_LINE = 72  # [characters] longest line of the header
# options for heights beyond the grid; other options concern programs, not the surface
_KEPT_OPTIONS = ("border_", "refline_continuation")


def write(
    surface: xr.Dataset,
    path: str | Path,
    *,
    force: bool = False,
    fmt: str = "KRBI",
    comment: str | Iterable[str] = (),
) -> xr.Dataset:
    """Write a surface as OpenCRG, in absolute coordinates, and return what was written.

    The file holds an empty section of modifiers, so that programs do not move the road. Positions
    within 0.1 mm of a multiple of 1 mm are rounded to it. Holes between the heights of a
    cross-section are filled (see `fill_interior`), since OpenCRG allows them only at the edges.
    Before the file appears, this package reads every number back and compares it with the surface,
    and the ASAM C-API evaluates every node of the reference line, and the centre of every cell or,
    if there are more, of 200,000 cells spaced over the file. Beyond 64 MB the C-API gets all
    cross-sections but only some of the long sections.

    A surface is written in blocks of cross-sections; one in a store is never loaded as a whole,
    except for maps and the text formats.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface along a reference line whose chords are as long as the spacing of u, or a map, which
        becomes a road along its easting axis.
    path : str or Path
        Path of the file to write.
    force : bool
        Replace an existing file.
    fmt : str
        Format of the numbers: ``"KRBI"`` (float32, the usual one), ``"KDBI"`` (float64), ``"LRFI"``
        or ``"LDFI"`` (text).
    comment : str or iterable of str
        Lines for the free text of the file.

    Returns
    -------
    xarray.Dataset
        Surface with dims (u, v): positions and reference line as in the file, heights before
        rounding to its format. ``filled`` [1] marks filled nodes and ``attrs["filled"]`` counts
        them; ``count`` and ``sd`` are kept although the file cannot hold them. Arrays are those of
        `surface` if nothing was filled; else they are computed on access, like arrays that xarray
        opens from disk.

    Raises
    ------
    ValueError
        If `fmt` is unknown.
    OutputError
        If the surface breaks a rule of OpenCRG, if the file exists and `force` is false, or if the
        file differs when it is read back. No file is left then.

    Examples
    --------
    >>> import tempfile
    >>> from trueterrain.core.schemas import make_surface
    >>> height = [[225.1, np.nan, 225.3], [225.1, 225.2, np.nan]]
    >>> road = make_surface(height, u=[0, 0.5], v=[-1, 0, 1], easting=[0, 0.5], northing=[0, 0])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     written = write(road, Path(folder) / "road.crg")
    >>> written.attrs["filled"], written.height.values[0].round(6)
    (1, array([225.1, 225.2, 225.3]))
    """
    fmt = fmt.upper()
    if fmt not in NUMBER_FORMATS:
        message = f"fmt must be one of {', '.join(NUMBER_FORMATS)}, got {fmt!r}."
        raise ValueError(message)
    path = Path(path)
    require_writable(path, force=force)
    road = _fit.fit_to_rules(surface, path)
    keywords = _header_keywords(road, fmt, comment)
    with whole_output(path, force=force) as temporary:
        try:
            flat = flat_road(temporary, road, keywords)
            if fmt in ("KRBI", "KDBI"):
                write_blocks(road, flat, temporary, fmt)
            else:
                write_whole(road, flat, temporary, keywords)
            _verify.require_same(road, temporary, fmt, flat)
        except FormatError as error:
            raise OutputError(
                f"cannot be written as OpenCRG: {error.problem}", path=path, place=error.place
            ) from error
        except ValueError as error:
            raise OutputError(f"cannot be written as OpenCRG: {error}", path=path) from error
        except OutputError as error:
            error.path = path
            raise
    return _with_record(road, flat, surface, fmt)


def _header_keywords(road: xr.Dataset, fmt: str, comment: str | Iterable[str]) -> dict[str, Any]:
    """Contents of the file besides the heights, as keyword arguments of pycrg."""
    u, easting, northing, elevation = (
        np.asarray(road[name], float) for name in ("u", "easting", "northing", "elevation")
    )
    above = _median_offset(road, elevation)
    start = float(elevation[0]) + (round(above, 3) if abs(above) > _SHIFTED_ABOVE else 0.0)
    return {
        "du": round(float(u[1] - u[0]), 3),
        "u0": round(float(u[0]), 3),
        "x0": float(easting[0]),
        "y0": float(northing[0]),
        "z0": start,
        "end_xy": (float(easting[-1]), float(northing[-1])),
        "phi": _chord_headings(easting, northing),
        "slope": _constant_or_each(np.diff(elevation) / np.diff(u)),
        "banking": _constant_or_each(np.asarray(road["banking"])) if "banking" in road else None,
        "fmt": fmt,
        "comment": _comment_lines(road, comment),
        "opts": _stored_options(road) or None,
        "mods": {},
    }


def _median_offset(road: xr.Dataset, elevation: Floats) -> float:
    """Median of the heights above the reference line [m]."""
    v = np.asarray(road["v"], float)

    def above(height: Floats, rows: slice) -> Floats:
        rest = height - elevation[rows, None]
        return rest - np.asarray(road["banking"])[rows, None] * v if "banking" in road else rest

    sample = slice(0, road.sizes["u"], max(1, road["height"].size // _SAMPLE))
    return blockwise_median(
        lambda: (above(block, rows) for rows, block in height_blocks(road)),
        above(block_heights(road, sample), sample),
    )


def _chord_headings(easting: Floats, northing: Floats) -> float | Floats:
    """Heading of each chord [rad], or of the whole line if it is straight."""
    along = np.array([easting[-1] - easting[0], northing[-1] - northing[0]])
    across = (easting - easting[0]) * along[1] - (northing - northing[0]) * along[0]
    length = np.hypot(*along)
    if length > 0 and np.abs(across).max() <= _STRAIGHT * length:
        return float(np.arctan2(along[1], along[0]))
    return np.asarray(np.arctan2(np.diff(northing), np.diff(easting)))


def _constant_or_each(values: Floats) -> float | Floats | None:
    if np.ptp(values) > 1e-12:
        return values
    return float(values.mean()) or None


def _comment_lines(road: xr.Dataset, comment: str | Iterable[str]) -> list[str]:
    lines = comment.splitlines() if isinstance(comment, str) else [str(line) for line in comment]
    found = [f"road surface written by trueterrain {__version__}"]
    for line in lines:
        plain = line.encode("ascii", "replace").decode()
        found += textwrap.wrap(plain, _LINE - 1) or [""]
    # in free text, a $ at the start of a line would end the section
    found = [f" {line}" if line.startswith("$") else line for line in found]
    history = json.dumps(provenance.provenance_steps(road), separators=(",", ":"))
    for mark, text in ((CRS_MARK, str(road.attrs.get("crs", ""))), (HISTORY_MARK, history)):
        if text.isascii() and text != "[]":
            size = _LINE - len(mark)
            flat = " ".join(text.split())
            found += [mark + flat[at : at + size] for at in range(0, len(flat), size)]
    return found


def _stored_options(road: xr.Dataset) -> dict[str, float]:
    stored = json.loads(road.attrs.get("opencrg_options", "{}"))
    return {
        name: value
        for name, value in stored.items()
        if name.startswith(_KEPT_OPTIONS) and isinstance(value, int | float)
    }


def _with_record(road: xr.Dataset, flat: FlatRoad, surface: xr.Dataset, fmt: str) -> xr.Dataset:
    """The surface that was written, on the reference line of the file."""
    line = {"easting": flat.grid.x, "northing": flat.grid.y, "elevation": flat.grid.ref_z}
    along = np.unwrap(np.arctan2(np.diff(flat.grid.y), np.diff(flat.grid.x)))
    line["heading"] = np.concatenate([along[:1], along])
    if "banking" in road:
        line["banking"] = flat.grid.bank
    result = road.assign({name: road[name].copy(data=values) for name, values in line.items()})
    if not flat.grid.bank.any():
        result = result.drop_vars("banking", errors="ignore")
    result.attrs = {
        "kind": "trueterrain/surface",
        "schema": SCHEMA,
        "crs": road.attrs.get("crs", ""),
        "filled": road.attrs["filled"],
    }
    if options := _stored_options(road):
        result.attrs["opencrg_options"] = json.dumps(options)
    check_surface(result)
    parameters = {"format": "OpenCRG", "fmt": fmt, "filled": road.attrs["filled"]}
    return provenance.add_step(result, "write", parameters=parameters, after=surface)


def blockwise_median(blocks: Callable[[], Iterable[Floats]], sample: Floats) -> float:
    """Median of the finite values of all blocks.

    A sample gives a bracket in which the median probably lies. All values are counted, but only
    those in the bracket are kept and sorted; if the median lies outside, the bracket is widened.
    The result depends neither on the sample nor on the blocks.

    Parameters
    ----------
    blocks : callable
        Returns an iterator of all values, block by block, at each call.
    sample : ndarray
        Some of the values, spaced over all blocks; at least one is finite.

    Returns
    -------
    float
        The median.

    Examples
    --------
    >>> values = np.array([7.0, 1.0, np.nan, 3.0, 2.0])
    >>> blockwise_median(lambda: [values[:3], values[3:]], values[:2])
    2.5
    """
    sample = np.sort(sample[np.isfinite(sample)])
    fraction = 0.02  # of the values in the bracket, on either side of the median
    while True:
        bracket = (-np.inf, np.inf)
        if sample.size and fraction < 0.5:
            places = (
                (0.5 - fraction) * (sample.size - 1),
                (0.5 + fraction) * (sample.size - 1),
            )
            bracket = (float(sample[int(places[0])]), float(sample[int(np.ceil(places[1]))]))
        found = _median_between(blocks(), *bracket)
        if found is not None:
            return found
        fraction *= 2


def _median_between(blocks: Iterable[Floats], low: float, high: float) -> float | None:
    """The median, if it lies between two values."""
    below = lows = highs = above = 0
    between = []
    for values in blocks:
        below += int(np.count_nonzero(values < low))
        above += int(np.count_nonzero(values > high))
        near = values[(values >= low) & (values <= high)]
        # values equal to a bound are counted, not kept: all heights of a flat road may be equal
        lows += int(np.count_nonzero(near == low))
        highs += int(np.count_nonzero((near == high) & (high > low)))
        between.append(near[(near > low) & (near < high)])
    inner = np.concatenate(between)
    count = below + lows + inner.size + highs + above
    if count == 0:
        message = "at least one value must be finite"
        raise ValueError(message)

    def ranked(rank: int) -> float | None:
        rank -= below
        if not 0 <= rank < count - below - above:
            return None
        if rank < lows:
            return low
        rank -= lows
        return float(np.partition(inner, rank)[rank]) if rank < inner.size else high

    lower, upper = ranked((count - 1) // 2), ranked(count // 2)
    return None if lower is None or upper is None else (lower + upper) / 2
