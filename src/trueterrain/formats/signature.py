"""Recognise the format of a file by its first bytes; the ending of its name is not trusted."""

import json
import re
import stat
import string
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from trueterrain.core.errors import FormatError
from trueterrain.formats._text_head import Head, find_head, number_of, split_line
from trueterrain.formats.navigation_signature import (
    is_boreas,
    is_navigation,
    is_sbet,
    is_sbet_text,
    is_smrmsg,
)

_SAMPLE = 1 << 16  # [bytes] enough to see the first section of any header


@dataclass(frozen=True, kw_only=True)
class Format:
    """A file format that this package reads."""

    name: str
    "Name in messages and reports, such as OpenCRG, GeoTIFF, LAZ or CSV."

    module: str
    "Module of `trueterrain.formats` that reads it."

    endings: tuple[str, ...]
    "Endings of the names of such files, with the dot."

    compressed: bool = False
    "Whether the content is compressed."


CRG = Format(name="OpenCRG", module="opencrg", endings=(".crg",))
GEOTIFF = Format(name="GeoTIFF", module="geotiff", endings=(".tif", ".tiff"))
LAS = Format(name="LAS", module="las", endings=(".las",))
LAZ = Format(name="LAZ", module="las", endings=(".laz",), compressed=True)
COPC = Format(name="COPC", module="las", endings=(".copc.laz", ".laz"), compressed=True)
ERD = Format(name="ERD", module="erd", endings=(".erd",))
CSV = Format(name="CSV", module="table", endings=(".csv", ".txt", ".tsv", ".dat", ".xyz", ".asc"))
PARQUET = Format(name="Parquet", module="table", endings=(".parquet", ".pq"), compressed=True)
STORE = Format(name="Zarr", module="store", endings=(".zarr",), compressed=True)
RUN = Format(name="Run", module="run", endings=(".zarr",), compressed=True)
SBET = Format(name="SBET", module="navigation.sbet", endings=(".out", ".sbet"))
SMRMSG = Format(name="SMRMSG", module="navigation.smrmsg", endings=(".out", ".smrmsg"))
SBET_TEXT = Format(name="SBET as text", module="navigation.sbet", endings=CSV.endings)
BOREAS = Format(name="Boreas poses", module="navigation.boreas", endings=CSV.endings)
NAVIGATION = Format(name="Navigation table", module="navigation.columns", endings=CSV.endings)

FORMATS = (
    CRG,
    GEOTIFF,
    LAS,
    LAZ,
    COPC,
    ERD,
    CSV,
    PARQUET,
    STORE,
    RUN,
    SBET,
    SMRMSG,
    SBET_TEXT,
    BOREAS,
    NAVIGATION,
)

# names of the columns of tables that this package writes, perhaps followed by a unit or a track
_COLUMN = re.compile(r"(s|height|easting|northing|up|x|y|z)(\W.*|_.*)?$")

# prefix of the attribute "kind" of Zarr groups of this package, and the kinds that may follow
_OURS = "trueterrain/"
_STORED = ("points", "surface", "profile", "run")

# kinds of entries of a file system that are not regular files
_NO_FILES = {
    stat.S_ISDIR: "a folder",
    stat.S_ISFIFO: "a pipe",
    stat.S_ISSOCK: "a socket",
    stat.S_ISCHR: "a device",
    stat.S_ISBLK: "a device",
}

# first bytes of formats that are not read, so that the message can name them
_FOREIGN = {
    b"\x89HDF\r\n\x1a\n": "an HDF5 or NetCDF-4 file",
    b"CDF": "a NetCDF-3 file",
    b"PK\x03\x04": "a zip archive",
    b"\x1f\x8b": "a gzip archive",
    b"7z\xbc\xaf\x27\x1c": "a 7z archive",
    b"\x28\xb5\x2f\xfd": "a zstd archive",
    b"ASTM-E57": "an E57 point cloud",
    b"ply": "a PLY point cloud",
    b"# .PCD": "a PCD point cloud",
    b"%PDF": "a PDF document",
    b"\x89PNG": "a PNG image",
    b"\xff\xd8\xff": "a JPEG image",
    b"HEAD3": "a TxDOT .PRO profile",
    b"<?xml": "an XML document",
    b"<!DOCTYPE": "a web page",
    b"<html": "a web page",
    b"{": "a JSON document",
    b"version https://git-lfs": "a Git LFS pointer, not the file itself",
}


def recognise_format(path: str | Path) -> Format:
    r"""Format of a file by its content.

    Parameters
    ----------
    path : str or Path
        The file.

    Returns
    -------
    Format
        The format; whether the file is complete is not checked.

    Raises
    ------
    FormatError
        If it is none of the known formats; the message names what was found.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "profile.dat"
    ...     _ = path.write_text("s,height\n0.0,0.1\n")
    ...     recognise_format(path).name
    'CSV'
    """
    path = Path(path)
    if path.is_dir():
        return RUN if kind_of_store(path) == "run" else STORE
    with open_regular(path) as stream:
        start = stream.read(_SAMPLE)
    found = (
        _recognise_binary(start)
        or _recognise_records(start, path.stat().st_size)
        or _recognise_text(start)
    )
    if found is None:
        known = ", ".join(known.name for known in FORMATS)
        raise FormatError(
            f"is not a file that can be read: it is {_what_was_found(start)}; known are {known}",
            path=path,
            place="start of the file",
            cure=_cure_text(start),
        )
    return found


def open_regular(path: str | Path) -> BinaryIO:
    """Open a file to read its bytes; pipes, sockets, devices and folders are refused.

    Reading needs to seek, and opening a pipe without a writer would block for ever.

    Parameters
    ----------
    path : str or Path
        The file, or a link to it.

    Returns
    -------
    file object
        Open, at the first byte.

    Raises
    ------
    FormatError
        If it is not a regular file.
    FileNotFoundError
        If the path does not exist.
    """
    path = Path(path)
    mode = path.stat().st_mode
    if not stat.S_ISREG(mode):
        kind = next((name for test, name in _NO_FILES.items() if test(mode)), "no file")
        raise FormatError(
            f"is {kind}, not a file",
            path=path,
            cure="Name the files in it." if stat.S_ISDIR(mode) else "Write it to a file first.",
        )
    return path.open("rb")


def kind_of_store(path: str | Path) -> str:
    """Kind of data in a Zarr store of this package, by the attributes of its group.

    Parameters
    ----------
    path : str or Path
        Folder ``NAME.zarr``.

    Returns
    -------
    str
        ``"points"``, ``"surface"``, ``"profile"`` or ``"run"``; completeness is not checked.

    Raises
    ------
    FormatError
        If it is another folder, another store, or its group is damaged.
    FileNotFoundError
        If the path does not exist.
    """
    path = Path(path)
    if not path.exists():
        message = f"there is no store {path}"
        raise FileNotFoundError(message)
    if not (path / "zarr.json").is_file():
        raise _no_store(path)
    try:
        about = json.loads((path / "zarr.json").read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:  # no JSON, or no UTF-8
        raise FormatError(
            f"is damaged ({error})",
            path=path,
            place="zarr.json",
            cure="Copy the whole folder again.",
        ) from None
    attrs = about.get("attributes") if isinstance(about, dict) else None
    found = str(attrs.get("kind", "none")) if isinstance(attrs, dict) else "none"
    kind = found.removeprefix(_OURS)
    if kind in _STORED and found.startswith(_OURS):
        return kind
    raise FormatError(
        f"is a Zarr store, but of no kind that is known: {_kind_names()}; its attribute kind is "
        f"{found[:40]!r}",
        path=path,
        place="zarr.json",
        cure="If trueterrain wrote it, update trueterrain; else open it with xarray, make points, "
        "a surface or a profile of it, and write that.",
    )


def ending_matches(path: str | Path, found: Format) -> bool:
    """Whether the name of a file has one of the endings of a format."""
    return Path(path).name.lower().endswith(found.endings)


def _recognise_binary(start: bytes) -> Format | None:
    if start.startswith(b"LASF"):
        # bit 7 of the point format marks LAZ; the info record of COPC must come first
        if len(start) > 104 and start[104] & 0x80:
            return COPC if start[377:381] == b"copc" else LAZ
        return LAS
    if start.startswith((b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")):
        return GEOTIFF
    if start.startswith(b"PAR1"):
        return PARQUET
    return None


def _kind_names() -> str:
    return ", ".join(repr(_OURS + kind) for kind in _STORED)


def _no_store(path: Path) -> FormatError:
    """Error for a folder without the metadata of a Zarr 3 group."""
    if any((path / name).is_file() for name in (".zgroup", ".zarray", ".zattrs")):
        return FormatError(
            "is a Zarr 2 store, and only Zarr 3 is read",
            path=path,
            cure="Open it with xarray, make points, a surface or a profile of it, and write that.",
        )
    if path.suffix == ".zarr":
        return FormatError(
            "is not a complete Zarr 3 store: it holds no zarr.json",
            path=path,
            cure="Copy the whole folder again.",
        )
    return FormatError("is a folder, not a file", path=path, cure="Name the files in it.")


def _recognise_records(start: bytes, size: int) -> Format | None:
    if is_sbet(start, size):
        return SBET
    return SMRMSG if is_smrmsg(start, size) else None


def _recognise_text(start: bytes) -> Format | None:
    if start.startswith(b"ERDFILEV"):
        return ERD
    if _foreign_format(start):
        return None
    lines = start.decode("latin-1").replace("\r", "\n").split("\n")
    if any(line.startswith(("$CT", "$ROAD_CRG", "$KD_DEFINITION")) for line in lines):
        return CRG
    return _recognise_table(start)


def _recognise_table(start: bytes) -> Format | None:
    text = _as_text(start)
    try:
        head = None if text is None else find_head(text.splitlines(), _are_columns)
    except FormatError:  # a field too long for a number or a name
        return CSV
    if text is None or head is None or len(head.labels) < 2:
        return None
    names, row = list(head.labels), _first_row(text, head)
    if not head.named:
        return SBET_TEXT if is_sbet_text(row) else CSV
    if is_boreas(names):
        return BOREAS
    if is_navigation(names):
        return NAVIGATION
    # unknown names of columns: a row of numbers must follow, else the text is prose
    numbered = len(row) == len(names) and number_of(row[0], head.decimal) is not None
    return CSV if numbered or _are_columns(names) else None


def _are_columns(names: list[str]) -> bool:
    return any(_COLUMN.match(name.strip().lower()) for name in names) or is_navigation(names)


def _first_row(text: str, head: Head) -> list[str]:
    lines = text.splitlines()[head.first - 1 :]
    line = next((one for one in lines if one.strip() and not one.startswith("#")), "")
    return split_line(line, head.separator)


def _as_text(start: bytes) -> str | None:
    if not start or b"\0" in start:
        return None
    try:
        # the sample may end within a character
        text = start[:-4].decode("utf-8-sig") + start[-4:].decode("utf-8", errors="ignore")
    except UnicodeDecodeError:
        text = start.decode("latin-1")
    strange = sum(not (sign.isprintable() or sign in string.whitespace) for sign in text)
    return text if strange * 100 < len(text) else None


def _foreign_format(start: bytes) -> str | None:
    return next((name for magic, name in _FOREIGN.items() if start.startswith(magic)), None)


def _what_was_found(start: bytes) -> str:
    if not start:
        return "empty"
    text = _as_text(start)
    if foreign := _foreign_format(start):
        return foreign
    if text is not None:
        words = " ".join(text.split())[:40]
        return f"text that begins with {words!r}" if words else "blank text"
    return f"binary and begins with the bytes {start[:8].hex(' ')}"


def _cure_text(start: bytes) -> str:
    foreign = _foreign_format(start) or ""
    if not start:
        return "Copy or export it again."
    if "archive" in foreign:
        return "Unpack it first."
    if "LFS" in foreign:
        return "Fetch the content with `git lfs pull`."
    return "Export it to one of these formats."
