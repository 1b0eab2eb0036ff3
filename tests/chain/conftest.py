"""The command line in this process."""

from collections.abc import Callable
from typing import NamedTuple

import pytest

from trueterrain.cli import main


class Finished(NamedTuple):
    """What a command left behind."""

    code: int
    out: str
    err: str


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Callable[..., Finished]:
    """Run the command line in this process; returns exit code, stdout and stderr."""

    def call(*arguments: object) -> Finished:
        capsys.readouterr()
        try:
            main([str(argument) for argument in arguments])
            code = 0
        except SystemExit as stopped:
            code = int(stopped.code or 0)
        return Finished(code, *capsys.readouterr())

    return call
