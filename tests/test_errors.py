"""Every error is one line: file, place, problem, cure."""

import pytest

from trueterrain.core.errors import (
    CoverageError,
    FormatError,
    OutputError,
    SchemaError,
    TrueTerrainError,
)


def test_all_parts_stand_in_one_line():
    error = FormatError("ends after\n3 records", path="a.crg", place="record 3", cure="Copy it.")
    assert str(error) == "a.crg: record 3: ends after 3 records. Copy it."


def test_missing_parts_leave_no_trace():
    assert str(TrueTerrainError("is empty")) == "is empty."


def test_a_full_stop_is_not_doubled():
    assert str(TrueTerrainError("is empty.")) == "is empty."


@pytest.mark.parametrize("kind", [CoverageError, FormatError, OutputError, SchemaError])
def test_one_base_catches_all(kind):
    with pytest.raises(TrueTerrainError):
        raise kind("wrong")
