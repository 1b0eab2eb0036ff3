"""Output of commands: results on stdout, everything else on stderr."""

import json
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from trueterrain.core.json_values import json_values, printable_text
from trueterrain.core.progress import Progress

if TYPE_CHECKING:
    import xarray as xr

_MAX_THREADS = 1024  # more than any machine has processors: a mistake
_MIN_COLUMNS = 20  # [characters] narrowest terminal for which help is formatted

# variables that a format can hold; formats that are not listed hold all
_HELD = {
    ".erd": ("height",),
    ".crg": ("height", "easting", "northing", "heading", "elevation", "banking", "filled"),
}


def write_line(text: str = "") -> None:
    """Write one line of the result to stdout."""
    sys.stdout.write(printable_text(text) + "\n")


def write_json(document: Any) -> None:
    """Write one JSON document to stdout; numbers that are not finite become null."""
    write_line(json.dumps(json_values(document), indent=2, allow_nan=False))


def error_text(error: Exception) -> str:
    """Message of an error in one line, with what to do about it."""
    if isinstance(error, MemoryError):
        cure = "Choose a coarser spacing, a smaller search area or a part of the data."
        return " ".join(f"there is not enough memory ({error}). {cure}".split())
    if isinstance(error, OSError) and error.strerror is not None:
        where = "" if error.filename is None else f"{error.filename}: "
        return f"{where}{error.strerror}."
    return " ".join(str(error).split())


def write_note(text: str) -> None:
    """Write one line that is not part of the result to stderr."""
    sys.stderr.write(printable_text(text) + "\n")


def note_omissions(data: "xr.Dataset", output: Path) -> None:
    """Note the variables and attributes that the format of the output cannot hold."""
    held = _HELD.get(output.suffix.lower())
    omitted = [str(name) for name in data.data_vars if held is not None and name not in held]
    if data.attrs.get("crs") and output.suffix.lower() in (".csv", ".erd"):
        omitted.append("CRS")
    if data.attrs.get("not_read"):
        write_note(f"{output}: not kept, since it is not read: {data.attrs['not_read']}")
    if omitted:
        write_note(f"{output}: not kept, since the format cannot hold it: {', '.join(omitted)}")


def prepare_streams() -> None:
    """Make stdout and stderr accept any text, and give help a valid width.

    A closed stream discards what is written; characters that the encoding lacks are escaped.
    """
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:  # closed by the calling program
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: PTH123, SIM115
        elif hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")
    columns = os.environ.get("COLUMNS")
    if columns is not None and (not columns.isdecimal() or int(columns) < _MIN_COLUMNS):
        del os.environ["COLUMNS"]


def abandon_streams() -> None:
    """Discard what stdout and stderr still hold if they cannot write it.

    Python would report the failed write at exit, and change the exit code.
    """
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


@contextmanager
def progress_bar() -> Iterator[Progress]:
    """Show progress on stderr, only on a terminal."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        ProgressColumn,
        Task,
        TaskID,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )
    from rich.progress import Progress as Bars
    from rich.text import Text

    class Rate(ProgressColumn):
        """Progress per second."""

        def render(self, task: Task) -> Text:
            return Text(f"{task.speed:,.0f}/s" if task.speed else "")

    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description}", markup=False),  # it may hold names of runs
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        Rate(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Bars(*columns, console=console, disable=not console.is_terminal, transient=True) as bars:
        tasks: dict[str, TaskID] = {}

        def show(task: str, done: float, total: float | None) -> None:
            if task not in tasks:
                tasks[task] = bars.add_task(printable_text(task), total=total)
            bars.update(tasks[task], completed=done, total=total)

        yield show


def worker_threads(requested: int | None) -> int:
    """Number of threads: as requested, by default one for each processor."""
    if requested is None:
        return available_processors()
    if not 1 <= requested <= _MAX_THREADS:
        message = f"threads must be from 1 to {_MAX_THREADS}, got {requested}."
        raise ValueError(message)
    return requested


def available_processors() -> int:
    """Number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextmanager
def note_compilation() -> Iterator[None]:
    """Note on a terminal that kernels are compiled, which delays the first call on a machine."""
    if not sys.stderr.isatty():
        yield
        return
    from numba.core import event

    class CompilationListener(event.Listener):  # type: ignore[misc]  # numba has no types
        noted = False

        def on_start(self, event: Any) -> None:  # noqa: ARG002 - numba passes it by name
            if not self.noted:
                write_note("compiling kernels, once on this machine ...")
            self.noted = True

        def on_end(self, event: Any) -> None:
            pass

    with event.install_listener("numba:compile", CompilationListener()):
        yield
