"""Progress of long computations: the library reports it, the command line shows it."""

from collections.abc import Callable

#: Called with the task, the amount done and the total amount (None when it is not known).
Progress = Callable[[str, float, float | None], None]


def no_progress(task: str, done: float, total: float | None) -> None:
    """Report nothing: the default everywhere in the library."""
