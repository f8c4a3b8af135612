"""What the soak calls flat, and what not."""

import os
import time

from rudc.evaluation.starting import start
from tests.benchmarks.soak import Look, look, not_flat


def looks(**last):
    """A first, a middle and a last look at a driver and a worker; `last`: what is another at the last."""
    first = Look(100, 1000, {1: 150.0, 2: 400.0}, {1: 9, 2: 7}, 10.0)
    middle = Look(500, 5000, {1: 150.0, 2: 405.0}, {1: 9, 2: 7}, 50.0)
    end = Look(1000, 10_000, {1: 151.0, 2: 410.0}, {1: 9, 2: 7}, 100.0)
    return [first, middle, end._replace(**last)]


def test_flat_is_flat():
    assert list(not_flat(looks())) == []


def test_what_is_not_flat_is_named():
    assert list(not_flat(looks(memory_mb={1: 150.0, 2: 440.0}))) == ["worker 1 grew by 40 MB"]
    assert list(not_flat(looks(files={1: 10, 2: 7}))) == ["driver has 10 files open, 9 before"]
    assert list(not_flat(looks(memory_mb={1: 150.0, 3: 400.0}))) == ["a worker was replaced"]
    slower = ["77 decisions a second of processor time, 100 before"]
    assert list(not_flat(looks(workers_s=115.0))) == slower
    assert list(not_flat(looks(workers_s=150.0))) == ["50 decisions a second of processor time, 100 before"]


def test_workers_are_found():
    workers = [start(time.sleep, 60.0) for _ in range(2)]
    try:
        seen = look(0, 0)
    finally:
        for worker in workers:
            worker.kill()
    assert list(seen.memory_mb) == [os.getpid(), *sorted(worker.pid for worker in workers)]
    assert min(seen.memory_mb.values()) > 10.0
    assert list(not_flat([seen._replace(memory_mb={os.getpid(): 100.0})])) == ["no worker was found"]
