"""The small share of the comparison: rows depend on nothing but their inputs."""

import subprocess
import sys


def test_a_few_rows_come_out_the_same_with_everything_else_changed():
    command = [sys.executable, "-m", "tests.benchmarks.determinism", "--rows", "10", "--timeout", "3"]
    agents = ("--agent", "rudc-t", "--agent", "gap-acceptance+ttcbf")
    done = subprocess.run([*command, *agents], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "everything else: 0 of 10 rows differ" in done.stdout
