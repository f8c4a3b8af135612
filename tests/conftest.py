"""For all tests: SIGINT interrupts, and hypothesis draws the same examples every time and times nothing.

A shell that starts them in the background has them ignore it, and every process that they start would too.
Tables are as wide as they want to be: xdist tells its workers how wide its own terminal is. Linear algebra
has one thread, as there is a process of tests for each core. Workers find more in their server than users' do
(tests/preloaded.py). Typer makes the command line once a process, and not for each command.
What is loaded when the tests begin stays to the end, so it is not searched for garbage again and again.
"""

import gc
import os
import signal
from functools import cache

import typer.main
from hypothesis import HealthCheck, settings

from rudc.evaluation import starting

gc.disable()  # until all tests are found: imports make no garbage

os.environ.pop("COLUMNS", None)
os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")
signal.signal(signal.SIGINT, signal.default_int_handler)
settings.register_profile(
    "reproducible", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("reproducible")
starting.PRELOADED = "tests.preloaded"
typer.main.get_command = cache(typer.main.get_command)


def pytest_collection_finish() -> None:
    gc.freeze()
    gc.enable()
