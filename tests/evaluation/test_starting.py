"""Workers have the code of the process that starts them, wherever it was started."""

import multiprocessing
import os
import subprocess
import sys
from pathlib import Path

import pytest

import rudc
from rudc.evaluation.starting import start

CODE = """
import sys
sys.path.insert(0, {root!r})
from rudc.evaluation.starting import start
from multiprocessing import Pipe
import tests.evaluation.test_starting as here

ours, theirs = Pipe()
start(here.say_whence, theirs).join()
print(ours.recv())
"""


def say_whence(pipe):
    """Where a worker has its code from, and whether that was imported before it started."""
    pipe.send((rudc.__file__, "rudc.evaluation.runner" in sys.modules, os.environ["OMP_NUM_THREADS"]))


def test_a_worker_has_the_code_of_who_starts_it_whatever_the_folder_holds(tmp_path):
    (tmp_path / "rudc").mkdir()
    (tmp_path / "rudc" / "__init__.py").write_text("")
    root = str(Path(rudc.__file__).parents[1])
    done = subprocess.run(
        [sys.executable, "-c", CODE.format(root=root)], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.stdout.strip() == repr((rudc.__file__, True, "1")), done.stderr


def test_a_temporary_folder_with_a_long_path_is_no_hindrance(tmp_path):
    """The server's socket would lie there, whose path has a hundred characters at most."""
    far = tmp_path / ("x" * 120)
    far.mkdir()
    done = subprocess.run(
        [sys.executable, "-c", CODE.format(root=str(Path(rudc.__file__).parents[1]))],
        env={**os.environ, "TMPDIR": str(far)}, capture_output=True, text=True,
    )  # fmt: skip
    assert done.stdout.strip() == repr((rudc.__file__, False, "1")), done.stderr


def _one_more(pipe):
    start(say_whence, pipe).join()


@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")  # said of any fork beside threads
def test_a_fork_of_who_has_workers_can_have_its_own():
    ours, theirs = multiprocessing.Pipe()
    start(say_whence, theirs).join()
    child = multiprocessing.get_context("fork").Process(target=_one_more, args=(theirs,))
    child.start()
    child.join()
    assert child.exitcode == 0
    assert [ours.recv()[0], ours.recv()[0]] == [rudc.__file__] * 2
