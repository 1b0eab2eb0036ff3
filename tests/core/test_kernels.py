"""Compiled kernels: kept from one start to the next where that is possible, and never needed."""

import importlib.util
import resource
import warnings
from contextlib import contextmanager
from pathlib import Path

import numba
import pytest

import trueterrain
from trueterrain.core.kernels import KernelCache, cache_folder

SOURCE = """
from trueterrain.core.kernels import compile_kernel


@compile_kernel
def _square(value):
    return value * value


@compile_kernel
def sum_squares(values):
    total = 0.0
    for value in values:
        total += _square(value)
    return total
"""
VALUES, SUM = (3.0, 4.0), 25.0


@pytest.fixture
def caches(tmp_path, monkeypatch):
    """Folder of a user's caches."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    monkeypatch.setattr("trueterrain.core.kernels._warned", False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "caches"))
    return tmp_path / "caches"


@pytest.fixture
def start(tmp_path, caches):
    """Import kernels as a new start of the program does; also beside a folder not to be written."""
    source = tmp_path / "source" / "loops.py"
    source.parent.mkdir()
    source.write_text(SOURCE)
    (source.parent / "__pycache__").write_text("a file, so that no folder can be made here")

    def import_anew():
        spec = importlib.util.spec_from_file_location("loops", source)
        loops = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(loops)
        return loops.sum_squares

    return import_anew


def hits(kernel) -> int:
    """How often compiled code of a kernel came from the disk."""
    return sum(kernel.stats.cache_hits.values())


def test_every_kernel_is_compiled_by_the_one_decorator():
    folder = Path(trueterrain.__file__).parent
    named = {path.name for path in folder.rglob("*.py") if "njit" in path.read_text()}
    assert named == {"kernels.py"}


def test_compiled_code_is_kept_in_the_users_folder(start, caches):
    first = start()
    assert not caches.exists(), "importing kernels touches no file"
    assert first(VALUES) == SUM
    assert hits(first) == 0
    again = start()
    assert again(VALUES) == SUM
    assert hits(again) == 1
    assert Path(again.stats.cache_path).is_relative_to(caches)
    assert cache_folder() == Path(again.stats.cache_path).parent


def test_the_folder_of_numba_itself_comes_first(start, monkeypatch, tmp_path):
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "named"))
    assert start()(VALUES) == SUM
    assert list((tmp_path / "named").rglob("*.nbc"))


@pytest.mark.parametrize("home", ["/dev/null", "~"])
def test_without_a_folder_that_can_be_written(start, monkeypatch, tmp_path, home):
    """A service has no home, or one of which the system knows nothing (`~` stays as it is)."""
    monkeypatch.setenv("XDG_CACHE_HOME", f"{home}/.cache")
    monkeypatch.chdir(tmp_path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert start()(VALUES) == SUM
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("default")
        kernel = start()
        assert not said, "nothing is compiled yet"
        assert kernel(VALUES) == SUM
    assert len(said) == 1, "one word for all kernels, of the first whose warnings are not ignored"
    assert "NUMBA_CACHE_DIR" in str(said[0].message)
    assert kernel.stats.cache_path is None
    assert not Path("~").exists()


@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
@pytest.mark.parametrize("kept", [0.0, 0.01, 0.5, 0.99])
def test_a_truncated_file_is_compiled_anew_and_mended(start, caches, suffix, kept):
    start()(VALUES)
    files = list(caches.rglob(f"*{suffix}"))
    assert len(files) == 2
    for file in files:
        whole = file.read_bytes()
        file.write_bytes(whole[: int(kept * len(whole))])
    damaged = start()
    assert damaged(VALUES) == SUM
    assert hits(damaged) == 0
    mended = start()
    assert mended(VALUES) == SUM
    assert hits(mended) == 1


def test_files_of_other_content_are_compiled_anew(start, caches):
    start()(VALUES)
    for file in caches.rglob("*.nb?"):
        file.write_bytes(b"\x80\x04]\x94.")  # an empty list, pickled
    assert start()(VALUES) == SUM


@contextmanager
def full_disk():
    """No file grows beyond 100 bytes: it is made, and writing it fails."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_full_disk_ends_nothing(start):
    kernel = start()
    with full_disk(), pytest.warns(UserWarning, match="File too large"):
        assert kernel(VALUES) == SUM
    again = start()
    assert again(VALUES) == SUM
    assert hits(again) == 0


def test_without_a_source_nothing_is_kept():
    exec("def double(value):\n    return 2 * value\n", found := {})
    assert KernelCache(found["double"]).cache_path is None
