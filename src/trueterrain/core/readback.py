"""Verification of outputs: they are read back before they get their name."""

import errno
import os
import zlib
from pathlib import Path
from typing import Any

from trueterrain.core.errors import OutputError

_FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
_CURE = "Free some space there, or choose another folder."
_BYTES = 1 << 24  # that are read back at a time


class Checksums:
    """Checksums of arrays by name, independent of the size of blocks.

    Not every library reports a full or failing disk. So a writer adds the checksums of what it
    writes, reads the file back before it gets its name, and compares.

    Examples
    --------
    >>> import numpy as np
    >>> written, found = Checksums(), Checksums()
    >>> written.add("up", np.array([1.0, 2.0, 3.0]))
    >>> found.add("up", np.array([1.0, 2.0]))
    >>> found.require_same(written, "p.las")
    Traceback (most recent call last):
    trueterrain.core.errors.OutputError: p.las: was not written whole: up reads back as 16 ...
    >>> found.add("up", np.array([3.0]))
    >>> found.require_same(written, "p.las")
    """

    def __init__(self) -> None:
        self._sums: dict[str, tuple[int, int]] = {}

    def add(self, name: str, values: Any) -> None:
        """Add the next values of an array, or bytes.

        Parameters
        ----------
        name : str
            Name of the data, such as that of a column.
        values : array_like or bytes
            The values, which count by their bytes in memory, in the order of the machine.
        """
        if not isinstance(values, bytes):
            import numpy as np  # commands that write nothing start without it

            array = np.asarray(values)
            array = np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("="))
            values = array.reshape(-1).view(np.uint8)
        size, checksum = self._sums.get(name, (0, 0))
        self._sums[name] = (size + len(values), zlib.crc32(values, checksum))

    def add_file(self, name: str, path: Path) -> None:
        """Add the bytes of a file.

        Parameters
        ----------
        name : str
            Name of the data.
        path : Path
            The file.
        """
        with path.open("rb") as stream:
            while block := stream.read(_BYTES):
                self.add(name, block)

    def require_same(self, written: "Checksums", path: str | Path) -> None:
        """Raise if the data read back differ from those written.

        Parameters
        ----------
        written : Checksums
            Those of what was written.
        path : str or Path
            The output.

        Raises
        ------
        OutputError
            Naming the first array that differs.
        """
        nothing = (0, 0)
        for name in [*written._sums, *self._sums]:
            found, wanted = (sums._sums.get(name, nothing) for sums in (self, written))
            if found != wanted:
                size = f"{found[0]} of {wanted[0]}" if found[0] != wanted[0] else "other"
                raise not_whole(path, f"{name} reads back as {size} bytes")


def not_whole(path: str | Path, reason: str) -> OutputError:
    """Error of an incomplete output.

    Parameters
    ----------
    path : str or Path
        The output.
    reason : str
        Reason, or the message of the library that wrote it.

    Returns
    -------
    OutputError
        To be raised.

    Examples
    --------
    >>> print(not_whole("p.laz", "no end"))
    p.laz: was not written whole: no end. See whether the disk is full or damaged; nothing is ...
    """
    return OutputError(
        f"was not written whole: {reason}",
        path=path,
        cure="See whether the disk is full or damaged; nothing is left of the output.",
    )


def refuse_full_disk(error: OSError, path: str | Path) -> None:
    """Raise an error that names the output if a disk or quota is full; others are left alone.

    Parameters
    ----------
    error : OSError
        Error of the writer.
    path : str or Path
        The output.

    Raises
    ------
    OutputError
        If the disk or quota is full.

    Examples
    --------
    >>> refuse_full_disk(OSError(errno.ENOSPC, "No space left on device"), "p.csv")
    Traceback (most recent call last):
    trueterrain.core.errors.OutputError: p.csv: cannot be written: no space left ...
    """
    if error.errno is not None and error.errno in _FULL:
        reason = os.strerror(error.errno)
        raise OutputError(
            f"cannot be written: {reason[:1].lower()}{reason[1:]}", path=path, cure=_CURE
        ) from error
