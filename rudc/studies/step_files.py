"""Numbers of every decision of a sweep: an array (steps, columns) for each episode, in a file of its own. The
file names its columns, and is written before the episode's row of `episodes.csv`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Protocol

import numpy as np

from rudc.agents.base import Agent, Decision
from rudc.arrays import Array
from rudc.env.episode import Episode, StepResult
from rudc.errors import InputError, StorageError
from rudc.evaluation.record import EpisodeRecord
from rudc.evaluation.rollout import Watcher
from rudc.evaluation.runner import EpisodeRunner
from rudc.evaluation.tasks import Task
from rudc.files import file_name, make_folder, replacing
from rudc.world.scene import Scene


class StepLog(Protocol):
    """Keeps the numbers of one episode."""

    columns: tuple[str, ...]
    """names of what `steps` holds of a decision"""

    def watch(self, scene: Scene, decision: Decision, result: StepResult) -> None:
        """Keep a decision, as `run_episode` shows it."""
        ...

    def steps(self) -> Array:
        """(steps, columns) of the episode."""
        ...


class StepRunner:
    """Runs episodes and writes the steps of each into a folder."""

    def __init__(self, folder: Path, begin: Callable[[Episode, Agent], StepLog]) -> None:
        """`begin`: an episode and its agent -> what keeps its numbers."""
        self._folder, self._begin = folder, begin
        self._log: StepLog | None = None
        self._run = EpisodeRunner(watch=self._watcher)

    def _watcher(self, episode: Episode, agent: Agent) -> Watcher:
        self._log = self._begin(episode, agent)
        return self._log.watch

    def __call__(self, task: Task) -> EpisodeRecord:
        """Run the task's episode."""
        record = self._run(task)
        if record.error or self._log is None:
            return record
        path = steps_file(self._folder, task.agent, task.scenario.name, task.seed)
        try:
            make_folder(path.parent)
            with replacing(path) as file:
                np.save(file, _named(self._log.steps(), self._log.columns))
        except (InputError, StorageError) as error:
            return EpisodeRecord.failed(record.scenario, record.agent, record.seed, str(error))
        return record

    def close(self) -> None:
        """Forget everything; the next task starts afresh."""
        self._run.close()


def steps_file(folder: Path, agent: str, scenario: str, seed: int) -> Path:
    """Where an episode's steps are."""
    return folder / file_name(agent) / scenario / f"{seed}.npy"


def _named(steps: Array, columns: Sequence[str]) -> np.ndarray:
    """(steps,) records of float32, of an array (steps, columns)."""
    kind = np.dtype([(name, np.float32) for name in columns])
    return np.ascontiguousarray(steps, dtype=np.float32).view(kind)[:, 0]


def read_steps(
    folder: Path, rows: Sequence[Mapping[str, str]], columns: Sequence[str]
) -> Iterator[tuple[Mapping[str, str], Array]]:
    """Each row of an episode that was run, and its steps (steps, columns). Raises StorageError when what the
    runner wrote is gone, or has other columns than these. Files from before columns had names are
    recognised by the number of their columns.
    """
    for row in rows:
        if row["error"]:
            continue
        path = steps_file(folder, row["agent"], row["scenario"], int(row["seed"]))
        try:
            found = np.load(path)
        except (OSError, EOFError, ValueError) as error:
            reason = getattr(error, "strerror", None) or error
            raise StorageError(
                f"{path} cannot be read ({reason}); its episode is finished, so give another --out"
            ) from None
        names = found.dtype.names
        steps = found if names is None else found.view(np.float32).reshape(-1, len(names))
        if steps.shape[1:] != (len(columns),) or names not in (None, tuple(columns)):
            raise StorageError(
                f"{path} has other columns than this version of RUDC writes; its episode is finished, so "
                "drive anew: give another --out"
            )
        yield row, steps.astype(float)
