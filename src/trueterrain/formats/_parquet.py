"""Opening Parquet files with pyarrow (extra ``parquet``), and one-line errors for damaged ones."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from trueterrain.core.errors import FormatError, TrueTerrainError

_CURE = "Install it with `pip install trueterrain[parquet]`, or use CSV."


def import_pyarrow(path: Path) -> tuple[Any, Any]:
    """Return pyarrow and pyarrow.parquet, or raise an error that names the extra to install."""
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError:
        raise TrueTerrainError("Parquet needs the package pyarrow", path=path, cure=_CURE) from None
    return pa, pq


@contextmanager
def parquet_damage_named(path: Path) -> Iterator[None]:
    """Turn exceptions of pyarrow over damaged files into a FormatError."""
    try:
        yield
    except (TrueTerrainError, FileNotFoundError, PermissionError):
        raise
    except Exception as error:  # pyarrow raises exceptions of many types
        words = " ".join(str(error).split()).rstrip(".")[:160] or type(error).__name__
        raise FormatError(
            f"is damaged or cut off ({words})", path=path, cure="Copy or export it again."
        ) from None


def require_numbers(pa: Any, kind: Any, label: str, path: Path) -> None:
    """Raise a FormatError if the type of a column is neither integer nor floating-point."""
    if not (pa.types.is_integer(kind) or pa.types.is_floating(kind)):
        raise FormatError(
            f"must hold numbers, got {kind}",
            path=path,
            place=f"column {label!r}",
            cure="Convert the column to float64.",
        )
