"""Freed blocks go back to the system, or are kept."""

import platform
import subprocess
import sys

import pytest

HOLES = """
import sys
from pathlib import Path
import numpy as np
from rudc.evaluation.memory import return_large_blocks

def resident():
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6

if sys.argv[1] == "on":
    return_large_blocks()
for _ in range(3):
    np.ones(3_000_000)  # 24 MB, freed at once: from here on smaller blocks come from the heap
before = resident()
large, small = [], []
for _ in range(200):
    large.append(np.ones(25_000))
    small.append(np.ones(500))
del large  # 40 MB
print(resident() - before)
"""


pytestmark = pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="about glibc's allocator")


def printed(script: str, state: str) -> float:
    return float(
        subprocess.run([sys.executable, "-c", script, state], capture_output=True, check=True).stdout
    )


def test_holes_between_blocks_that_live_on_are_given_back():
    assert printed(HOLES, "on") < 10 < printed(HOLES, "off")


UPDATES = """
import resource, sys
import numpy as np
from rudc.evaluation.memory import keep_freed_blocks

if sys.argv[1] == "on":
    keep_freed_blocks()

def work():
    parts = [np.ones(500_000) for _ in range(8)]  # 32 MB

work()
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(20):
    work()
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


def test_kept_blocks_are_not_cleared_again():
    assert printed(UPDATES, "on") < 20 < printed(UPDATES, "off")
