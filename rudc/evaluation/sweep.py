"""A sweep: scenarios x swept values x agents x seeds, run by an engine into a folder, resumable."""

from __future__ import annotations

import pickle
import re
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, closing, contextmanager, nullcontext
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

from rudc.agents.drivers import register_agent, registered_agents
from rudc.errors import InputError, PartFailedError, RudcError, StorageError, SweepError
from rudc.evaluation.code import code_digest
from rudc.evaluation.engine import Result, Runner, RunnerFactory, run_local
from rudc.evaluation.folder import SweepFolder, read_sweep, sweep_rows
from rudc.evaluation.limits import EPISODE_LIMIT_S, LONGEST_LIMIT_S
from rudc.evaluation.ray_engine import connected, run_ray
from rudc.evaluation.record import EpisodeRecord
from rudc.evaluation.rows import by_row
from rudc.evaluation.tasks import SweepPlan, Task
from rudc.hints import there_are
from rudc.imports import import_first, imported_first, in_words, is_own, own_file


@dataclass(frozen=True, slots=True)
class Engine:
    """Who runs the episodes of a sweep."""

    run: Callable[[Sequence[Task], int, float, RunnerFactory], Iterator[Result]]
    """takes tasks, workers, a time limit (s) and a factory of runners; yields results in any order"""
    connected: Callable[[], AbstractContextManager[object]] = nullcontext
    """what it needs, held for the whole sweep; raises InputError where that is not there, before the folder
    is touched"""


ENGINES = {"local": Engine(run_local), "ray": Engine(run_ray, connected)}
"""by name: `local` worker processes on this machine, `ray` actors of a cluster"""


class Progress(Protocol):
    """Is told how a sweep goes."""

    def begin(self, total: int, finished: int, warnings: Sequence[str]) -> None:
        """Before the first episode; `finished` of `total` are there already."""
        ...

    def advance(self, task: Task, record: EpisodeRecord) -> None:
        """An episode has ended and its row is on the disk."""
        ...


class Silent:
    """Shows nothing."""

    def begin(self, total: int, finished: int, warnings: Sequence[str]) -> None:
        """Nothing."""

    def advance(self, task: Task, record: EpisodeRecord) -> None:
        """Nothing."""


@dataclass(frozen=True)
class SweepResult:
    """What a finished sweep left."""

    folder: Path

    @cached_property
    def rows(self) -> list[dict[str, str]]:
        """Of `episodes.csv`, in canonical order."""
        return read_sweep(self.folder)[0]

    @cached_property
    def errors(self) -> list[dict[str, str]]:
        """Rows of the episodes that could not be run."""
        failed = (block for block in sweep_rows(self.folder).blocks() if any(block["error"]))
        return [row for row in by_row(failed) if row["error"]]


def run_sweep(
    plan: SweepPlan,
    out: str | Path,
    make_runner: RunnerFactory,
    *,
    workers: int = 1,
    engine: str = "local",
    resume: bool = False,
    limit_s: float = EPISODE_LIMIT_S,
    progress: Progress | None = None,
) -> SweepResult:
    """Run what is not finished yet, and write episodes, metrics and manifest to `out`.

    make_runner is called once in each worker (`EpisodeRunner`); it must be importable there, and so must the
    registered agents of the plan. Raises InputError where one is not, SweepError when the folder holds
    something else, StorageError when it cannot be written. Whatever ends a sweep early (Ctrl-C included), all
    rows of finished episodes are kept.
    """
    if workers < 1:
        raise SweepError(f"a sweep needs at least one worker, not {workers}")
    check_limit(limit_s)
    if engine not in ENGINES:
        raise InputError(f"no engine {engine!r}{there_are(engine, ENGINES)}")
    chosen = ENGINES[engine]
    make_runner = prepared(make_runner, plan.agents)
    with chosen.connected(), SweepFolder(Path(out), plan) as folder:
        folder.open(resume)
        with kept_rows():
            return _finish(folder, workers, chosen, limit_s, make_runner, progress or Silent())


def check_limit(limit_s: float) -> None:
    """Raise SweepError for a wall time (s) that no episode can be given, nan and inf among them."""
    if not 0.0 < limit_s <= LONGEST_LIMIT_S:
        raise SweepError(
            f"--episode-limit is more than 0 and at most {LONGEST_LIMIT_S:g} s, three years; not {limit_s:g}"
        )


@contextmanager
def kept_rows() -> Iterator[None]:
    """A StorageError in the block says that the rows written before are kept."""
    try:
        yield
    except StorageError as error:
        raise StorageError(
            f"{error}. All rows written before are kept; "
            "once that is mended, run the same command with --resume"
        ) from error


def _finish(
    folder: SweepFolder,
    workers: int,
    engine: Engine,
    limit_s: float,
    make_runner: RunnerFactory,
    progress: Progress,
) -> SweepResult:
    """Run what is not finished yet in an open folder."""
    todo = [task for task in folder.tasks if task.key(folder.parameters) not in folder.finished]
    progress.begin(len(folder.tasks), len(folder.finished), folder.warnings)
    if todo:
        with closing(_results(engine, todo, workers, limit_s, make_runner)) as results:
            for task, record in results:
                progress.advance(task, folder.add(task, record))
    folder.complete()
    return SweepResult(folder.path)


def _results(
    engine: Engine, tasks: Sequence[Task], workers: int, limit_s: float, make_runner: RunnerFactory
) -> Generator[Result, None, None]:
    """What the engine yields. Raises PartFailedError where one that is not RUDC's fails."""
    try:
        with closing(engine.run(tasks, workers, limit_s, make_runner)) as results:  # pyright: ignore
            yield from results
    except Exception as error:
        if isinstance(error, RudcError) or not is_own(engine.run):
            raise
        name = next((name for name, one in ENGINES.items() if one is engine), "?")
        raise PartFailedError(
            f"engine {name} raised {in_words(error)}; all rows written before are kept, and --resume goes on"
        ) from error


def prepared(make_runner: RunnerFactory, agents: Iterable[str]) -> RunnerFactory:
    """As `make_runner`, for processes with the code of this one; they learn which agents are registered, as
    far as they can import them. Raises InputError for a registered one of `agents`, the names of those that
    will drive, that no other process can import.
    """
    used = frozenset(re.split("[+:]", name)[0] for name in agents)
    known, imports = dict[str, bytes](), list(imported_first())
    for name, make in registered_agents().items():
        if file := own_file(make):
            imports += [file] if name in used else []  # it registers the agent there, too
            continue
        try:
            known[name] = pickle.dumps(make)
        except Exception as error:
            if name in used:
                raise _not_importable(name, error) from error
    return _Prepared(code_digest(), tuple(dict.fromkeys(imports)), known, used, make_runner)


def _not_importable(name: str, error: Exception) -> InputError:
    return InputError(
        f"agent {name!r} is registered here, and worker processes cannot import it ({in_words(error)}); "
        "register a class or function that stands at the top of a module or of the script's file"
    )


@dataclass(frozen=True)
class _Prepared:
    """Makes a runner in a process that has the same code and knows the same agents by name as this one."""

    code: str
    """its digest"""
    imports: tuple[str, ...]
    agents: Mapping[str, bytes]
    """name -> pickled class or function of each registered agent"""
    used: frozenset[str]
    """names of agents that must be there"""
    make_runner: RunnerFactory

    def __call__(self) -> Runner:
        """Raises SweepError where this process has other code than the one that asks, InputError where it
        cannot import an agent that is used.
        """
        if code_digest() != self.code:
            raise SweepError(
                "RUDC's code was changed since the sweep began, and its rows would mix with others; "
                "what is finished is kept: --resume goes on with the code as it is now"
            )
        for name, make in self.agents.items():
            try:
                register_agent(name, pickle.loads(make))
            except Exception as error:
                if name in self.used:
                    raise _not_importable(name, error) from error
        return self.make_runner()

    def __reduce__(self) -> tuple[Callable[..., _Prepared], tuple[Any, ...]]:
        """Pickled with the files that its reader must import first."""
        return _prepare, (self.code, self.imports, self.agents, self.used, pickle.dumps(self.make_runner))


def _prepare(
    code: str, imports: tuple[str, ...], agents: Mapping[str, bytes], used: frozenset[str], rest: bytes
) -> _Prepared:
    for source in imports:
        import_first(source)
    return _Prepared(code, imports, agents, used, pickle.loads(rest))
