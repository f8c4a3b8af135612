"""A small share of what `make fuzz` tries: every fuzzer, its first inputs.

What takes more than 2 s of processor time is a bug to `make fuzz`. A test runs on machines that are slow or
busy, so only what takes five times as long is a bug to it.
"""

import subprocess
import sys


def test_damaged_inputs_are_refused_in_words(tmp_path):
    command = [sys.executable, "-m", "tests.fuzz", "--share", "0.0003", "--out", str(tmp_path)]
    command += ["--workers", "2", "--most-s", "10"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, f"{done.stdout}{done.stderr}"
    assert len((tmp_path / "fuzz.csv").read_text().splitlines()) == 6
