"""The command ``trueterrain doctor``: versions and environment for a bug report."""

import os
import platform
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from trueterrain._version import __version__
from trueterrain.cli._console import write_json, write_line

_PACKAGES = (
    "numpy",
    "scipy",
    "numba",
    "xarray",
    "pandas",
    "laspy",
    "lazrs",
    "pycrg",
    "pyproj",
    "matplotlib",
    "cyclopts",
    "rich",
    "rasterio",
    "pyarrow",
)


def doctor(*, json: bool = False) -> None:
    """Show versions, backends and cores for a bug report.

    Parameters
    ----------
    json
        Print one JSON document.
    """
    import laspy
    import numba

    from trueterrain.core.kernels import cache_folder

    found: dict[str, Any] = {
        "trueterrain": __version__,
        "python": platform.python_version(),
        "platform": platform.platform(),
        "cores": os.cpu_count(),
        "threads": numba.config.NUMBA_NUM_THREADS,
        "LAZ backends": [backend.name for backend in laspy.LazBackend.detect_available()],
        "kernel cache": str(cache_folder() or "none: no folder can be written"),
        "packages": {name: _package_version(name) for name in _PACKAGES},
    }
    if json:
        write_json(found)
        return
    packages = found.pop("packages")
    for name, value in {**found, **packages}.items():
        write_line(f"{name:14} {', '.join(value) if isinstance(value, list) else value}")


def _package_version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
