"""What the fuzzers' harness says of commands that do what none should: raise, die, hang, take too much."""

import sys
from multiprocessing.connection import wait
from pathlib import Path

import pytest

from tests.fuzz import trying
from tests.fuzz.fuzzer import Case, Fuzzer

DEEDS = {
    0: "raise SystemExit(0)",
    1: "import sys; print('error: wrong', file=sys.stderr); raise SystemExit(2)",
    2: "raise KeyError('x')",
    3: "import os; os.kill(os.getpid(), 9)",
    4: "import time; time.sleep(60)",
    5: "import time; began = time.process_time()\nwhile time.process_time() < began + 0.3: pass",
    6: "found = b'x' * 600_000_000",
    7: "raise SystemExit(2)",
    8: "raise SystemExit(1)",
    9: "raise SystemExit(0)",
}
HANGS = 4
FOUND = ["", "", "a traceback", "the process died (signal 9)", "hangs: nothing in 0.2 s", "took 0.", "took ",
         "exit status 2 without a message", "exit status 1", ""]  # fmt: skip


def prepare(_folder: Path):
    def make(rng, folder):
        return Case("deed", [(str(folder.name),)])

    return make


def do() -> None:
    """In the place of `rudc`."""
    exec(DEEDS[int(sys.argv[1])])


@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_each_sort_of_bug_is_found_and_named(tmp_path, monkeypatch):
    monkeypatch.setattr(trying, "main", do)
    monkeypatch.setattr(trying, "wait", lambda pipes, timeout: wait(pipes, 0.05))
    monkeypatch.setattr(trying, "MOST_S", 0.2)
    monkeypatch.setattr(trying, "MOST_MB", trying._peak_mb() + 500.0)  # children begin with what we hold
    found = {}
    for patience_s, numbers in ((60.0, [n for n in DEEDS if n != HANGS]), (0.2, [HANGS])):
        fuzzer = Fuzzer("planted", 10, prepare, patience_s)
        found |= {a.number: a.bug for a in trying.attempts(fuzzer, numbers, 0, tmp_path, workers=2)}
    for number, bug in enumerate(FOUND):
        assert found[number].startswith(bug) if bug else not found[number], (number, found[number])
