"""How commands speak: results on stdout, everything else on stderr."""

import json
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from trueterrain.core.json_values import json_values, printable_text
from trueterrain.core.progress import Progress

_MOST_THREADS = 1024  # no machine works with more at once
_NARROWEST = 20  # [characters] of a terminal that help is set for


def write_line(text: str = "") -> None:
    """Write one line of the result to stdout."""
    sys.stdout.write(printable_text(text) + "\n")


def out_json(document: Any) -> None:
    """Write one JSON document to stdout; numbers that are not finite become null."""
    write_line(json.dumps(json_values(document), indent=2, allow_nan=False))


def in_words(error: Exception) -> str:
    """Say in one line what is wrong."""
    if isinstance(error, MemoryError):
        cure = "Choose a coarser spacing, a smaller search area or a part of the data."
        return " ".join(f"there is not enough memory ({error}). {cure}".split())
    if isinstance(error, OSError) and error.strerror is not None:
        where = "" if error.filename is None else f"{error.filename}: "
        return f"{where}{error.strerror}."
    return " ".join(str(error).split())


def write_note(text: str) -> None:
    """Tell the user something that is not the result, on stderr."""
    sys.stderr.write(printable_text(text) + "\n")


def prepare_streams() -> None:
    """Make stdout and stderr take any text, whatever they are, and give help a width.

    What is closed swallows what is written; what the encoding lacks is written as an escape.
    """
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:  # closed by whoever started the program
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: PTH123, SIM115
        elif hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")
    columns = os.environ.get("COLUMNS")
    if columns is not None and (not columns.isdecimal() or int(columns) < _NARROWEST):
        del os.environ["COLUMNS"]


def abandon_streams() -> None:
    """Let stdout and stderr go nowhere: python would complain at exit of what they do not take."""
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
        """How much is done in a second."""

        def render(self, task: Task) -> Text:
            return Text(f"{task.speed:,.0f}/s" if task.speed else "")

    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description}", markup=False),  # names of runs stand in it
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


def worker_threads(asked: int | None) -> int:
    """How many threads work at once: as asked for, else one for each processor."""
    if asked is None:
        return available_processors()
    if not 1 <= asked <= _MOST_THREADS:
        message = f"threads must be from 1 to {_MOST_THREADS}, got {asked}."
        raise ValueError(message)
    return asked


def available_processors() -> int:
    """Processors that this process may use."""
    import os

    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextmanager
def compiling_noted() -> Iterator[None]:
    """Say on a terminal that kernels are compiled: the first call on a machine looks stuck else."""
    if not sys.stderr.isatty():
        yield
        return
    from numba.core import event

    class Tell(event.Listener):  # type: ignore[misc]  # numba has no types
        told = False

        def on_start(self, event: Any) -> None:  # noqa: ARG002 - as numba calls it
            if not self.told:
                write_note("compiling kernels, once on this machine ...")
            self.told = True

        def on_end(self, event: Any) -> None:
            pass

    with event.install_listener("numba:compile", Tell()):
        yield
