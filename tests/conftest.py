"""Fixtures and settings shared by all tests."""

import os
from pathlib import Path

import matplotlib as mpl
import pytest
from hypothesis import settings

mpl.use("Agg")

# No deadline: the first call of a kernel includes its compilation. Derandomized: each run
# tests the same examples.
settings.register_profile("trueterrain", deadline=None, derandomize=True)
settings.load_profile("trueterrain")


def _data_folder() -> Path:
    named = os.environ.get("TRUETERRAIN_DATA")
    return Path(named) if named else Path(__file__).parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def data() -> Path:
    """Folder of the measured data. If it is absent, tests fail in CI and are skipped elsewhere."""
    folder = _data_folder()
    if not folder.is_dir():
        reason = f"no measured data in {folder}; set TRUETERRAIN_DATA to their folder"
        if os.environ.get("CI"):
            pytest.fail(reason)
        pytest.skip(reason)
    return folder
