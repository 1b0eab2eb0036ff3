"""Compiled kernels: loops that numba compiles, cached on disk.

Compilation takes seconds, so its result is kept on disk. That is a convenience only: where no
folder can be written, the disk is full or a kept file is damaged, kernels are compiled anew.
"""

import warnings
from collections.abc import Callable
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from typing import Any

from numba import njit
from numba.core.caching import (
    CompileResultCacheImpl,
    FunctionCache,
    InTreeCacheLocator,
    NullCache,
    UserProvidedCacheLocator,
    UserWideCacheLocator,
)

_warned = False  # whether the user was warned that kernels are not cached


def compile_kernel(function: Callable[..., Any] | None = None, /, **options: Any) -> Any:
    """Compile a loop at its first call, and cache it on disk.

    Every kernel of the package is compiled by this decorator: without the lock of the interpreter,
    so that threads run it at once. Compiled code is kept in the folder of ``NUMBA_CACHE_DIR``, else
    in the user's cache folder, else beside the source; if none can be written, a warning says so
    and each start compiles anew.

    Parameters
    ----------
    function : callable, optional
        The loop.
    **options
        Options of `numba.njit`, such as ``parallel=True``.

    Returns
    -------
    callable
        The kernel; with options alone, the decorator.

    Examples
    --------
    >>> @compile_kernel
    ... def square_sum(values):
    ...     total = 0.0
    ...     for value in values:
    ...         total += value * value
    ...     return total
    >>> square_sum.py_func([3.0, 4.0])
    25.0
    """
    if function is None:
        return lambda function: compile_kernel(function, **options)
    kernel = njit(nogil=True, **options)(function)
    # as numba's own enable_caching does, which has no option for another cache
    kernel._cache = KernelCache(function)
    return kernel


def cache_folder() -> Path | None:
    """Cache folder of compiled kernels; None if none can be written.

    Examples
    --------
    >>> cache_folder() is None or cache_folder().is_dir()
    True
    """
    path = KernelCache(cache_folder).cache_path
    return None if path is None else Path(path).parent


class KernelCache(NullCache):  # type: ignore[misc]  # numba has no types
    """Disk cache of one kernel, where a folder can be written.

    Nothing is read or written before the first call of the kernel.

    Parameters
    ----------
    function : callable
        The loop.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function

    @cached_property
    def _files(self) -> Any:
        """Reader and writer of the files; None if no folder can be written."""
        try:
            return _Files(self._function)
        except (RuntimeError, OSError):  # no folder, or no source file to detect changes
            return None

    @property
    def cache_path(self) -> str | None:
        """Folder of the files; None if no folder can be written."""
        return None if self._files is None else str(self._files.cache_path)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Compiled code for a signature; None if there is none, or if it is damaged."""
        if self._files is None:
            return None
        try:
            return self._files.load_overload(sig, target_context)
        except Exception:  # unpickling a damaged file can raise anything
            self.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Cache compiled code for a signature; warns if that fails."""
        reason = "no cache folder can be written"
        if self._files is not None:
            try:
                self._files.save_overload(sig, data)
            except OSError as error:
                reason = f"{self.cache_path}: {error.strerror}"
            else:
                return
        _warn_once(reason)

    def flush(self) -> None:
        """Empty the cache."""
        if self._files is not None:
            with suppress(OSError):
                self._files.flush()


def _warn_once(reason: str) -> None:
    """Warn that kernels are not cached, once in each process."""
    global _warned  # numba resets the registry of warnings at each kernel
    message = (
        f"compiled kernels are not kept ({reason}), so every start compiles them anew. "
        "Set NUMBA_CACHE_DIR to a folder that can be written."
    )
    with warnings.catch_warnings(record=True) as heard:
        warnings.warn(message, stacklevel=1)
    if heard and not _warned:  # otherwise a caller ignores warnings, and the next kernel warns
        _warned = True
        warnings.warn(message, stacklevel=1)


class _UserFolder(UserWideCacheLocator):  # type: ignore[misc]  # numba has no types
    """Cache folder of the user, if there is one."""

    def ensure_cache_path(self) -> None:
        if not Path(self.get_cache_path()).is_absolute():  # without a home: a folder named "~"
            raise FileNotFoundError(self.get_cache_path())
        super().ensure_cache_path()


class _Place(CompileResultCacheImpl):  # type: ignore[misc]  # numba has no types
    """Cache folder: the first one that can be written."""

    _locator_classes = (UserProvidedCacheLocator, _UserFolder, InTreeCacheLocator)


class _Files(FunctionCache):  # type: ignore[misc]  # numba has no types
    """Files of compiled code in the cache folder."""

    _impl_class = _Place
