"""Rows on disk: whole or not at all."""

import errno
import os

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rudc.errors import StorageError, SweepError
from rudc.evaluation.store import RowFile, format_row, read_table

HEADER = ["name", "text"]


@pytest.fixture
def file(tmp_path):
    rows = RowFile(tmp_path / "rows.csv", HEADER)
    rows.rewrite([])
    yield rows
    rows.close()


def test_rows_are_there_as_soon_as_they_are_appended(file):
    file.append(["a", 'with "quotes", commas'])
    assert list(RowFile(file.path, HEADER).rows()) == [["a", 'with "quotes", commas']]
    file.append(["b", ""])
    assert [row["name"] for row in read_table(file.path)] == ["a", "b"]


@given(st.lists(st.text(), min_size=2, max_size=5))
def test_a_row_is_one_line_whatever_is_in_it(cells):
    line = format_row(cells)
    assert line.endswith("\n")
    assert len(line.splitlines()) == 1


@given(cut=st.integers(0, 60))
def test_a_torn_file_is_whole_up_to_its_last_line_break(tmp_path_factory, cut):
    path = tmp_path_factory.mktemp("torn") / "rows.csv"
    whole = b"name,text\na,1\nb,2\nc,three\n"
    path.write_bytes(whole[: max(len(whole) - cut, 10)])
    rows = RowFile(path, HEADER)
    found = list(rows.rows())
    assert found == [["a", "1"], ["b", "2"], ["c", "three"]][: len(found)]
    rows.rewrite(map(format_row, found))
    rows.append(["d", "4"])
    rows.close()
    assert list(rows.rows()) == [*found, ["d", "4"]]


def test_other_columns_are_refused(tmp_path):
    path = tmp_path / "rows.csv"
    path.write_text("something,else\n1,2\n")
    with pytest.raises(SweepError, match="other columns"):
        list(RowFile(path, HEADER).rows())


@pytest.mark.parametrize("taken", [0, 3])
def test_a_full_disk_leaves_the_file_as_it_was(file, monkeypatch, taken):
    file.append(["a", "1"])
    before = file.path.read_bytes()
    real = os.write

    def full(descriptor, data):
        real(descriptor, data[:taken])
        if taken:
            return taken
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("rudc.evaluation.store.os.write", full)
    with pytest.raises(StorageError, match="the disk is full"):
        file.append(["b", "2"])
    assert file.path.read_bytes() == before


def test_a_folder_that_is_no_sweep(tmp_path):
    with pytest.raises(SweepError, match="is it the folder of a sweep"):
        read_table(tmp_path / "episodes.csv")
