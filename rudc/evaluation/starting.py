"""Worker processes: forks of one clean process that has imported what workers need.

    this process                              the server                    a worker
    `prepare`, or the first start         ->  a new interpreter: imports
    `start`                               ->  forks                     ->  takes over working folder and
                                                                            environment, does its work
    ends                                  ->  ends

So the imports are paid once, however many workers there are and whenever they start, and while this process
looks at what it was asked for. The server has no world, no torch, one thread, and ignores Ctrl-C; so workers
start as clean as from an interpreter of their own. That is what they get where there is no forking (Windows),
where the server's socket has no place (a path of TMPDIR that is too long for one), or where RUDC's code was
changed since the server loaded it.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from multiprocessing.process import BaseProcess
from typing import Any

from rudc.evaluation.code import code_digest

SINGLE_THREADED = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""set to 1 for workers: their arrays are small, and they share the cores already"""
PRELOADED = "rudc.evaluation.preloaded"
"""what the server imports"""

_served: tuple[int, str] | None = None
"""id of the process that started the server, and digest of the code that the server has loaded, empty where
there can be no server; None before it was started"""


def prepare() -> None:
    """Have the server import what workers need, while this process goes on."""
    global _served
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return
    if _served is not None and (_served[0] != os.getpid() or not _served[1]):  # a fork of whose server it is
        return
    from multiprocessing import forkserver

    if _served is None:
        _served = os.getpid(), code_digest()
        forkserver.set_forkserver_preload([PRELOADED])
    with quiet_start(PYTHONSAFEPATH="1", PYTHONPATH=os.pathsep.join(filter(None, sys.path))):
        try:
            forkserver.ensure_running()  # imports from where this process does, whatever the folder holds
        except OSError:
            _served = os.getpid(), ""


def start(target: Callable[..., None], *args: Any, name: str | None = None) -> BaseProcess:
    """A new worker that runs target(*args), which it must be able to import; it ends with this process."""
    prepare()
    method = "forkserver" if _served == (os.getpid(), code_digest()) else "spawn"
    if method == "spawn":
        from rudc.evaluation.compiled import compile_kernels

        compile_kernels()  # here, and not in each worker
    with quiet_start():
        process = multiprocessing.get_context(method).Process(  # pyright: ignore[reportAttributeAccessIssue] - both have it
            target=_begin, args=(dict(os.environ), target, args), name=name, daemon=True
        )
        process.start()
    return process


def _begin(environment: dict[str, str], target: Callable[..., None], args: tuple[Any, ...]) -> None:
    os.environ.clear()
    os.environ.update(environment)
    target(*args)


@contextlib.contextmanager
def quiet_start(**more: str) -> Iterator[None]:
    """What a child inherits: Ctrl-C ignored from its first instruction, one thread in its linear algebra, and
    `more` of the environment."""
    more = {**dict.fromkeys(SINGLE_THREADED, "1"), **more}
    before = {name: os.environ.get(name) for name in more}
    os.environ.update(more)
    in_main = threading.current_thread() is threading.main_thread()
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN) if in_main else None
    try:
        yield
    finally:
        if in_main:
            signal.signal(signal.SIGINT, handler)
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
