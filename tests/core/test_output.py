"""Outputs appear whole or not at all."""

import pytest

from trueterrain.core import require_writable, whole_folder, whole_output
from trueterrain.core.errors import OutputError
from trueterrain.core.manifest import missing_files


def test_an_output_appears_when_it_is_whole(tmp_path):
    with whole_output(tmp_path / "a.erd") as temporary:
        temporary.write_text("whole")
        assert not (tmp_path / "a.erd").exists()
        assert temporary.suffix == ".erd"
    assert [path.name for path in tmp_path.iterdir()] == ["a.erd"]


def test_a_failed_output_leaves_nothing(tmp_path):
    def fail():
        with whole_output(tmp_path / "a.erd") as temporary:
            temporary.write_text("half")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_overwritten_without_force(tmp_path):
    (tmp_path / "a.erd").write_text("old")
    with pytest.raises(OutputError, match=r"a.erd: exists already.*--force"):
        require_writable(tmp_path / "a.erd")
    with whole_output(tmp_path / "a.erd", force=True) as temporary:
        temporary.write_text("new")
    assert (tmp_path / "a.erd").read_text() == "new"


def test_a_failed_replacement_keeps_the_old_one(tmp_path):
    (tmp_path / "a.erd").write_text("old")

    def fail():
        with whole_output(tmp_path / "a.erd", force=True) as temporary:
            temporary.write_text("half")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert (tmp_path / "a.erd").read_text() == "old"


def test_an_input_is_never_replaced(tmp_path):
    (tmp_path / "a.csv").write_text("mine")
    (tmp_path / "same.csv").symlink_to(tmp_path / "a.csv")
    for name in ("a.csv", "same.csv"):
        with pytest.raises(OutputError, match=rf"{name}: is an input as well"):
            require_writable(tmp_path / name, force=True, inputs=[tmp_path / "a.csv"])
    require_writable(tmp_path / "b.csv", inputs=[tmp_path / "a.csv", tmp_path / "none.csv"])


def test_a_missing_folder_is_named(tmp_path):
    with pytest.raises(OutputError, match=r"folder .*missing does not exist"):
        require_writable(tmp_path / "missing" / "a.erd")


def test_a_folder_is_no_file(tmp_path):
    with pytest.raises(OutputError, match="is a folder"):
        require_writable(tmp_path, force=True)


def test_a_folder_of_outputs_appears_when_it_is_whole(tmp_path):
    with whole_folder(tmp_path / "out") as folder:
        (folder / "a.txt").write_text("a")
        assert not (tmp_path / "out").exists()
    assert (tmp_path / "out" / "a.txt").read_text() == "a"
    assert missing_files(tmp_path / "out") == []
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_a_failed_folder_leaves_nothing(tmp_path):
    def fail():
        with whole_folder(tmp_path / "out") as folder:
            (folder / "a.txt").write_text("a")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert list(tmp_path.iterdir()) == []


def test_a_full_folder_is_not_written_into_without_force(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine.txt").write_text("mine")
    with pytest.raises(OutputError, match="out: is not empty"), whole_folder(tmp_path / "out"):
        pass
    with whole_folder(tmp_path / "out", force=True) as folder:
        (folder / "a.txt").write_text("a")
    # force replaces the files of an earlier result and leaves all others alone
    names = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert names == ["a.txt", "manifest.json", "mine.txt"]
