"""Rows on disk: whole or not at all."""

import errno
import os

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rudc.errors import StorageError, SweepError
from rudc.evaluation.store import RowFile, format_row, read_header, read_table, table_blocks

HEADER = ["name", "text"]


@pytest.fixture
def file(tmp_path):
    rows = RowFile(tmp_path / "rows.csv", HEADER)
    rows.rewrite([])
    yield rows
    rows.close()


def test_rows_are_there_as_soon_as_they_are_appended(file):
    file.append(["a", 'with "quotes", commas'])
    assert list(RowFile(file.path, HEADER).rows()) == [("a", 'with "quotes", commas')]
    file.append(["b", ""])
    assert [row["name"] for row in read_table(file.path)] == ["a", "b"]


@given(st.lists(st.text(), min_size=2, max_size=5))
def test_a_row_is_one_line_whatever_is_in_it(cells):
    line = format_row(cells)
    assert line.endswith("\n")
    assert len(line.splitlines()) == 1


def test_blanks_in_a_cell_are_kept(file):
    file.append(["f.py:Slow(speed=3,  gain=2)", "two\nlines"])
    assert list(file.rows()) == [("f.py:Slow(speed=3,  gain=2)", "two lines")]


def test_what_utf_8_has_no_sign_for_is_spelt_out(file):
    file.append(["ä", "no \udcff file"])
    assert list(file.rows()) == [("ä", r"no \udcff file")]


@given(cut=st.integers(0, 60))
def test_a_torn_file_is_whole_up_to_its_last_line_break(tmp_path_factory, cut):
    path = tmp_path_factory.mktemp("torn") / "rows.csv"
    whole = b"name,text\na,1\nb,2\nc,three\n"
    path.write_bytes(whole[: max(len(whole) - cut, 10)])
    rows = RowFile(path, HEADER)
    found = list(rows.rows())
    assert found == [("a", "1"), ("b", "2"), ("c", "three")][: len(found)]
    rows.rewrite(map(format_row, found))
    rows.append(["d", "4"])
    rows.close()
    assert list(rows.rows()) == [*found, ("d", "4")]


def test_what_a_spreadsheet_saved_is_read_and_gone_on_with(tmp_path):
    """A byte order mark first, and other line breaks."""
    path = tmp_path / "rows.csv"
    path.write_bytes(b'\xef\xbb\xbfname,text\r\n\xc3\xa4,"1, 2"\r\n')
    assert read_header(path) == HEADER
    assert read_table(path) == [{"name": "ä", "text": "1, 2"}]
    rows = RowFile(path, HEADER)
    rows.append(["b", "3"])
    rows.close()
    assert list(rows.rows()) == [("ä", "1, 2"), ("b", "3")]


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


def test_lines_with_quotes_and_lines_without_say_the_same(tmp_path, monkeypatch):
    """A block of lines is read at once, by the comma alone where no line of it has a quote."""
    monkeypatch.setattr("rudc.evaluation.store._BLOCK", 1_000)
    rows = [[f"agent {k}", str(k)] for k in range(500)]
    (tmp_path / "plain.csv").write_text("".join(map(format_row, [HEADER, *rows])))
    rows[400][0] = 'a, "b"'
    (tmp_path / "quoted.csv").write_text("".join(map(format_row, [HEADER, *rows])))
    plain, quoted = (read_table(tmp_path / name) for name in ("plain.csv", "quoted.csv"))
    assert [list(row.values()) for row in quoted] == rows
    assert [k for k in range(500) if plain[k] != quoted[k]] == [400]


@pytest.mark.parametrize(
    ("line", "told"),
    [
        (b'"a,b\n', ":401: not a row"),
        (b"a\n", ":401: has 1 cells, not 2"),
        (b"\xff,b\n", ":401: not valid UTF-8"),
        (b"a,b\rc\n", ":401: not a row"),
    ],
)
@pytest.mark.parametrize("others", [b"a,b\n", b'"a",b\n'])
def test_a_line_that_is_no_row_is_named_wherever_it_stands(tmp_path, monkeypatch, line, told, others):
    monkeypatch.setattr("rudc.evaluation.store._BLOCK", 1_000)
    path = tmp_path / "rows.csv"
    path.write_bytes(b"name,text\n" + 399 * others + line + 400 * others)
    with pytest.raises(SweepError, match=told):
        read_table(path)


def test_a_line_that_is_being_written_is_left_out(tmp_path):
    """What follows it was written since: it is not taken for a line of its own."""
    path = tmp_path / "rows.csv"
    path.write_bytes(b"name,text\na,1\nb,")
    header, blocks = table_blocks(path)
    found = [next(blocks)]
    with path.open("ab") as file:
        file.write(b"2\nc,3\n")
    assert (header, [*found, *blocks]) == (HEADER, [[["a"], ["1"]]])


def test_rows_are_flushed_now_and_then_and_at_the_end(file, monkeypatch):
    flushed, now = [], [100.0]
    monkeypatch.setattr("rudc.evaluation.store.os.fsync", flushed.append)
    monkeypatch.setattr("rudc.evaluation.store.time.monotonic", lambda: now[0])
    for _ in range(50):
        file.append(["a", "1"])
        now[0] += 0.01
    assert 2 <= len(flushed) <= 4
    file.close()
    assert 3 <= len(flushed) <= 5


def test_what_is_no_folder_of_a_sweep_is_named(tmp_path):
    (tmp_path / "episodes.csv").write_text("a\n")
    with pytest.raises(SweepError, match="is a file; give the folder of a sweep"):
        read_table(tmp_path / "episodes.csv" / "episodes.csv")
    (tmp_path / "search").mkdir()
    (tmp_path / "search" / "evaluations.csv").write_text("a\n")
    with pytest.raises(SweepError, match="folder of a search, not of a sweep"):
        read_table(tmp_path / "search" / "episodes.csv")
    with pytest.raises(SweepError, match="is it the folder of a sweep"):
        read_table(tmp_path / "nowhere" / "episodes.csv")
