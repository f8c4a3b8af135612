"""Tries damaged inputs in forked children with limits: how each command ended, its time, its memory.

    parent                                 child (a fork: everything is imported already)
    forks it with the inputs' numbers  ->  of each: writes it, calls rudc's `main`, says what came of it
    hears nothing, or only of its end  ->  (hangs, or killed by a signal): so it was this input; forks again

Time is the processor's, children's included, so that a busy machine finds no bugs of its own; memory is the
largest resident size of the child, or of a child of its own.
"""

from __future__ import annotations

import multiprocessing
import os
import re
import resource
import shutil
import signal
import sys
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import NamedTuple

import typer.main

import rudc.agents.learned
import rudc.evaluation.runner
import rudc.evaluation.sweep
import rudc.reporting.replay.page
import rudc.reporting.report.page  # noqa: F401 - so that each fork has what commands import when they run
from rudc.cli.main import main
from rudc.kernels import load_kernels
from tests.fuzz.fuzzer import Case, Command, Fuzzer

TOOK = "took"
"""how bugs of time and memory begin"""
MOST_S, MOST_MB = 2.0, 500.0
"""of processor time and memory, for one input"""
BATCH = 50
"""inputs after which a child is replaced"""
ADDRESSES = 3 * 2**30
"""bytes of addresses that a child may take besides those it starts with"""
TOLD = 4000
"""characters kept of the end of what a command said, and of its beginning"""
WORK_S = 20.0
"""s of wall time after which a command that works is interrupted, as by Ctrl-C"""
Make = Callable[..., Case]
typer.main.get_command = cache(typer.main.get_command)  # half of the time of an input that is refused at once


class Attempt(NamedTuple):
    """What came of one input."""

    number: int
    kind: str
    """of mutation; empty if the child ended before it was known"""
    command: Command
    """the last one given"""
    status: int | None
    """its exit status; None if it never came to one"""
    cpu_s: float
    memory_mb: float
    bug: str
    """what is wrong with how it ended, in words; empty: nothing"""
    said: str
    """the end of what the command said"""

    @property
    def signature(self) -> str:
        """What is the same for all inputs that show one bug: where it was raised, or how it ended."""
        raised = re.findall(r'File "[^"]*/(\w+/\w+\.py)", line (\d+)', self.said)
        if "Traceback" in self.said and raised:
            return f"{self.said.strip().splitlines()[-1].partition(':')[0]} at {':'.join(raised[-1])}"
        return re.sub(r"[\d.]+", "#", self.bug)


def attempts(
    fuzzer: Fuzzer, numbers: Sequence[int], seed: int, folder: Path, workers: int = 1
) -> Iterator[Attempt]:
    """Try the inputs of these numbers, and yield what came of each as it is known. `folder` is for files."""
    load_kernels()
    make = fuzzer.prepare(folder)
    lanes = [_Lane(fuzzer, make, seed, folder / f"lane{k}", numbers[k::workers]) for k in range(workers)]
    lanes = [lane for lane in lanes if lane.waiting]
    try:
        while lanes:
            wait([lane.pipe for lane in lanes], timeout=1.0)
            for lane in lanes:
                yield from lane.heard()
            lanes = [lane for lane in lanes if lane.waiting]
    finally:
        for lane in lanes:
            lane.end()


class _Lane:
    """One child at a time, and the inputs it still has to try."""

    def __init__(self, fuzzer: Fuzzer, make: Make, seed: int, folder: Path, numbers: Sequence[int]) -> None:
        self._fuzzer, self._make, self._seed, self._folder = fuzzer, make, seed, folder
        self.waiting = deque(numbers)
        if numbers:
            self._start()

    def heard(self) -> Iterator[Attempt]:
        """What has come of inputs since the last call."""
        try:
            while self.waiting and self.pipe.poll():
                attempt: Attempt = self.pipe.recv()
                self._since = time.monotonic()
                if attempt.bug.startswith(TOOK) and not self._alone:
                    self.end()  # for want of room, or in a bad moment? Once more, in a fresh child
                    return self._start(alone=True)
                self.waiting.popleft()
                yield attempt
        except (EOFError, OSError):
            status = self._ended()
            if self.waiting and status != 0:
                yield self._lost(f"the process died ({_cause(status)})")
            if self.waiting:
                self._start()
            return None
        if self.waiting and time.monotonic() - self._since > self._fuzzer.patience_s:
            self.end()
            yield self._lost(f"hangs: nothing in {self._fuzzer.patience_s:g} s")
            if self.waiting:
                self._start()

    def end(self) -> None:
        """End the child at once."""
        self._process.kill()
        self._ended()

    def _ended(self) -> int | None:
        """Wait for the child's end; its exit code."""
        self._process.join()
        self.pipe.close()
        return self._process.exitcode

    def _lost(self, bug: str) -> Attempt:
        return Attempt(self.waiting.popleft(), "", (), None, 0.0, 0.0, bug, self._told())

    @property
    def _said(self) -> Path:
        return self._folder / "said"

    def _told(self) -> str:
        """Beginning and end of what the child's command has said."""
        data = self._said.read_bytes() if self._said.exists() else b""
        kept = data if len(data) <= 2 * TOLD else data[:TOLD] + b"\n...\n" + data[-TOLD:]
        return kept.decode(errors="replace")

    def _start(self, alone: bool = False) -> None:
        """Fork a child for the next inputs, or for the next alone."""
        shutil.rmtree(self._folder, ignore_errors=True)
        self._folder.mkdir(parents=True)
        context = multiprocessing.get_context("fork")
        self.pipe: Connection
        self.pipe, theirs = context.Pipe(duplex=False)
        self._alone = alone
        numbers = [self.waiting[k] for k in range(1 if alone else min(BATCH, len(self.waiting)))]
        self._process: BaseProcess = context.Process(target=self._serve, args=(theirs, numbers))
        self._process.start()
        theirs.close()
        self._since = time.monotonic()

    def _serve(self, pipe: Connection, numbers: Sequence[int]) -> None:
        """What a child does."""
        self.pipe.close()
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        _limit()
        said = os.open(self._said, os.O_RDWR | os.O_CREAT | os.O_APPEND)
        os.dup2(said, 1)
        os.dup2(said, 2)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        sys.stdout, sys.stderr = os.fdopen(1, "w", closefd=False), os.fdopen(2, "w", closefd=False)
        for number in numbers:
            os.ftruncate(said, 0)
            place = self._folder / str(number)
            place.mkdir()
            os.chdir(place)
            pipe.send(self._try(number, place))
            os.chdir(self._folder)
            shutil.rmtree(place, ignore_errors=True)
        pipe.close()
        sys.stdout.flush()
        os._exit(0)

    def _try(self, number: int, place: Path) -> Attempt:
        case = self._make(self._fuzzer.randomness(self._seed, number), place)
        status, command, slowest = 0, (), 0.0
        for command in case.commands:
            began = _cpu_s()
            status = _interrupted(command) if case.works else _call(command)
            slowest = max(slowest, _cpu_s() - began)
            if status != 0:
                break
        memory, said = _peak_mb(), self._told()
        bug = verdict(status, said, slowest, memory, case.works)
        return Attempt(number, case.kind, command, status, slowest, memory, bug, said)


def verdict(status: int | None, said: str, cpu_s: float, memory_mb: float, works: bool = False) -> str:
    """What is wrong with how a command ended, in words; empty: nothing."""
    if "Traceback (most recent call last)" in said:
        return "a traceback"
    if works and status in (0, 130):
        return ""
    if status == 1 and re.search("^error: cannot write|came out differently|episodes failed, in", said, re.M):
        return ""
    if status not in (0, 2):
        return f"exit status {status}"
    if status == 2 and not re.search(r"^error: |^ *Usage: |^╭─ Error", said, re.MULTILINE):
        return "exit status 2 without a message"
    if cpu_s > MOST_S:
        return f"{TOOK} {cpu_s:.1f} s"
    if memory_mb > MOST_MB:
        return f"{TOOK} {memory_mb:.0f} MB"
    return ""


def _call(command: Command) -> int | None:
    """Exit status of `rudc` given these arguments; None, with the traceback on stderr, for an exception."""
    sys.argv = ["rudc", *command]
    try:
        main()
        return 0
    except SystemExit as ended:
        code = ended.code
        return 0 if code is None else code if isinstance(code, int) else 1
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
    return None


def _interrupted(command: Command) -> int | None:
    """As `_call`, and interrupted after a while."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    timer = threading.Timer(WORK_S, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    try:
        return _call(command)
    finally:
        timer.cancel()
        signal.signal(signal.SIGINT, signal.SIG_IGN)


def _limit() -> None:
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + ADDRESSES, used + ADDRESSES))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _cpu_s() -> float:
    return sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))


def _peak_mb() -> float:
    """Largest resident size so far, of this process or of one that it started and waited for."""
    return (
        max(resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
        / 1e3
    )


def _cause(status: int | None) -> str:
    return f"signal {-status}" if status is not None and status < 0 else f"exit code {status}"
