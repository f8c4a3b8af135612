"""A small share of what `make fuzz` tries: every fuzzer, its first inputs."""

import subprocess
import sys


def test_damaged_inputs_are_refused_in_words(tmp_path):
    command = [sys.executable, "-m", "tests.fuzz", "--share", "0.0006", "--out", str(tmp_path)]
    done = subprocess.run([*command, "--workers", "2"], capture_output=True, text=True)
    assert done.returncode == 0, f"{done.stdout}{done.stderr}"
    assert len((tmp_path / "fuzz.csv").read_text().splitlines()) == 6
