"""Files come to the disk whole or not at all."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from rudc.errors import InputError, StorageError
from rudc.files import (
    aside_of,
    file_name,
    make_folder,
    make_folder_of,
    replace_folder,
    replacing,
    take_lock,
    try_place,
    write_atomically,
)

needs_full_device = pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "file.txt"
    write_atomically(path, "old\n")
    return path


def test_text_and_bytes_are_written_as_they_are(path):
    write_atomically(path, "ä\r\nb\n")
    assert path.read_bytes() == "ä\r\nb\n".encode()
    write_atomically(path, "\udcff")  # of a file name that is no text
    assert path.read_bytes() == rb"\udcff"
    write_atomically(path, b"\x00\r\n")
    assert path.read_bytes() == b"\x00\r\n"
    assert os.listdir(path.parent) == ["file.txt"]


@needs_full_device
@pytest.mark.parametrize("size", [3, 10_000_000])
def test_a_full_disk_leaves_the_old_file_and_is_said(path, size):
    (path.parent / ".file.txt.new").symlink_to("/dev/full")  # where the draft goes
    with pytest.raises(StorageError, match=r"cannot write .*file\.txt: the disk is full"):
        write_atomically(path, "x" * size)
    assert path.read_text() == "old\n"
    assert os.listdir(path.parent) == ["file.txt"]


@needs_full_device
def test_a_full_disk_while_arrays_are_written(path):
    (path.parent / ".file.txt.new").symlink_to("/dev/full")
    with pytest.raises(StorageError, match="the disk is full"), replacing(path) as file:
        np.savez(file, numbers=np.arange(100_000))
    assert path.read_text() == "old\n"


def test_what_is_killed_in_between_leaves_the_old_file_whole(path):
    code = f"""
import os, pathlib, signal
from rudc.files import replacing
with replacing(pathlib.Path({str(path)!r})) as file:
    file.write(b"half of the new")
    file.flush()
    os.kill(os.getpid(), signal.SIGKILL)
"""
    ended = subprocess.run([sys.executable, "-c", code], check=False, cwd=Path(__file__).parent.parent)
    assert ended.returncode == -signal.SIGKILL
    assert path.read_text() == "old\n"
    write_atomically(path, "new\n")
    assert path.read_text() == "new\n"
    assert os.listdir(path.parent) == ["file.txt"]


def test_whatever_else_goes_wrong_leaves_the_old_file_and_no_draft(path):
    with pytest.raises(ZeroDivisionError), replacing(path) as file:
        file.write(b"half" + bytes(1 // 0))
    assert path.read_text() == "old\n"
    assert os.listdir(path.parent) == ["file.txt"]


def test_a_device_or_pipe_is_written_to_and_stays_what_it_is(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    write_atomically(pipe, "text")
    assert os.read(reader, 10) == b"text"
    os.close(reader)
    assert pipe.is_fifo()


def test_a_link_is_kept_and_what_it_leads_to_replaced(tmp_path):
    (tmp_path / "link.txt").symlink_to(tmp_path / "file.txt")
    for text in ("first", "second"):
        write_atomically(tmp_path / "link.txt", text)
    assert (tmp_path / "file.txt").read_text() == "second"
    assert (tmp_path / "link.txt").is_symlink()


def test_where_nothing_can_be_written_is_said_plainly(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(StorageError, match=r"cannot write .*file/x: Not a directory"):
        write_atomically(tmp_path / "file" / "x", "text")
    with pytest.raises(StorageError, match="Is a directory"):
        write_atomically(tmp_path, "text")


def test_a_ring_of_links_leads_nowhere(tmp_path):
    ring, link = tmp_path / "ring", tmp_path / "link"
    ring.symlink_to(link)
    link.symlink_to(ring)
    with pytest.raises(InputError, match="ring cannot be made a folder"):
        try_place(ring / "file.html")
    with pytest.raises(StorageError, match=r"cannot write .*file\.html"):
        write_atomically(ring / "file.html", "text")
    try_place(ring)
    write_atomically(ring, "text")
    assert ring.read_text() == "text", "the file takes its place"


def test_folders_are_made_or_refused(path):
    make_folder_of(path.parent / "a" / "b" / "x.csv")
    make_folder_of(Path("/dev/null"))
    assert (path.parent / "a" / "b").is_dir()
    with pytest.raises(InputError, match=r"file\.txt is a file; give another folder"):
        make_folder(path)
    with pytest.raises(InputError, match="cannot be made a folder"):
        make_folder(path / "x")


def test_a_folder_takes_the_place_of_another(tmp_path):
    new, old = tmp_path / "new", tmp_path / "checkpoint"
    for text in ("first", "second"):
        make_folder(new)
        write_atomically(new / "x", text)
        replace_folder(new, old)
        assert (old / "x").read_text() == text
    assert not new.exists()
    assert not aside_of(old).exists()
    with pytest.raises(StorageError, match=r"cannot write .*checkpoint: No such file"):
        replace_folder(new, old)


@pytest.mark.parametrize("there", [True, False])
def test_a_folder_takes_the_place_of_a_link_and_is_replaced_in_turn(tmp_path, there):
    elsewhere, new, old = tmp_path / "elsewhere", tmp_path / "new", tmp_path / "checkpoint"
    if there:
        make_folder(elsewhere)
    old.symlink_to(elsewhere)
    for text in ("first", "second"):
        make_folder(new)
        write_atomically(new / "x", text)
        replace_folder(new, old)
        assert (old / "x").read_text() == text
        assert not os.path.lexists(aside_of(old))
    assert not there or list(elsewhere.iterdir()) == []


def test_a_folder_that_another_writes_to_is_refused(tmp_path):
    warnings = []
    lock = take_lock(tmp_path, warnings)
    with pytest.raises(InputError, match=r"another rudc is writing to .*: wait for its end, or give another"):
        take_lock(tmp_path, warnings)
    os.close(lock)
    os.close(take_lock(tmp_path, warnings))
    assert warnings == []


def test_where_there_are_no_locks_is_said(tmp_path, monkeypatch):
    warnings = []
    monkeypatch.setitem(sys.modules, "fcntl", None)  # as on Windows
    assert take_lock(tmp_path, warnings) is None
    assert warnings == [f"{tmp_path} cannot be locked; run nothing else into it meanwhile"]


@pytest.mark.parametrize("text", ["..", ".", ".hidden", "a/../b", "no \udcff text", "x" * 300])
def test_any_text_has_a_file_name_of_its_own(text, tmp_path):
    name = file_name(text)
    (tmp_path / name).write_text("")
    assert os.listdir(tmp_path) == [name]
    assert not name.startswith(".")
