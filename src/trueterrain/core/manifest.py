"""Files of a result: a folder is one only if its manifest names them."""

import hashlib
import json
import os
from pathlib import Path
from typing import Any

from trueterrain._version import __version__

#: File that names all others of a result; it is written last.
MANIFEST = "manifest.json"

_KIND = "trueterrain/result"


def write_manifest(folder: Path, result: str) -> None:
    """Write the manifest of a result, with name, size and hash of each file.

    Parameters
    ----------
    folder : Path
        Folder of the result.
    result : str
        Kind of the result; only one of the same kind replaces it.
    """
    files = []
    for path in files_below(folder):
        with path.open("rb") as stream:
            digest = hashlib.file_digest(stream, "sha256").hexdigest()
            # so that a power cut cannot leave a manifest of empty files
            os.fsync(stream.fileno())
        name = path.relative_to(folder).as_posix()
        files.append({"name": name, "size": path.stat().st_size, "sha256": digest})
    about = {"kind": _KIND, "version": __version__, "result": result, "files": files}
    with (folder / MANIFEST).open("w", encoding="utf-8", newline="\n") as target:
        target.write(json.dumps(about, indent=1) + "\n")
        target.flush()
        os.fsync(target.fileno())


def read_manifest(folder: Path) -> dict[str, Any] | None:
    """Manifest of a folder.

    Parameters
    ----------
    folder : Path
        Any folder.

    Returns
    -------
    dict or None
        ``result`` and ``files``; None if the folder is no result, or none that is whole.
    """
    try:
        about = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
        if about["kind"] != _KIND:
            return None
        files = {str(one["name"]): dict(one) for one in about["files"]}
        if any(Path(name).is_absolute() or ".." in Path(name).parts for name in files):
            return None  # names files outside the folder
        return {"result": str(about["result"]), "files": files}
    except (OSError, ValueError, TypeError, KeyError):
        return None


def missing_files(folder: Path) -> list[str]:
    """Files of a result that are missing or changed.

    Parameters
    ----------
    folder : Path
        Folder of the result.

    Returns
    -------
    list of str
        Their names, from the folder on; that of the manifest if there is none.
    """
    about = read_manifest(folder)
    if about is None:
        return [MANIFEST]
    return [name for name, one in about["files"].items() if not is_as_written(folder / name, one)]


def is_as_written(path: Path, about: dict[str, Any]) -> bool:
    """Whether a file has the size and the hash of the manifest.

    Parameters
    ----------
    path : Path
        The file.
    about : dict
        Its entry in the manifest.

    Returns
    -------
    bool
        False also if it is not there.
    """
    try:
        if path.stat().st_size != about["size"]:
            return False
        with path.open("rb") as stream:
            return bool(hashlib.file_digest(stream, "sha256").hexdigest() == about["sha256"])
    except (OSError, KeyError):
        return False


def files_below(folder: Path) -> list[Path]:
    """All files in a folder and the folders in it, in the order of their names.

    Parameters
    ----------
    folder : Path
        The folder.

    Returns
    -------
    list of Path
        Files and links.
    """
    return sorted(
        Path(above) / name
        for above, folders, names in os.walk(folder)
        for name in [*names, *(one for one in folders if (Path(above) / one).is_symlink())]
    )
