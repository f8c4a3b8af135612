"""The replay: a ring of transitions, kept as arrays.

Both actions are stored: what the policy proposed, and what was executed after the correction. Which one
critics learn from is the learner's choice (`learns_from`): reward and next state followed from the executed
action, and a critic that is given the proposed one counts the effect of the correction for the proposal.

Masks m_n ~ Bernoulli(p), one for each critic, are drawn when a transition is stored and stay with it
(bootstrap, paper Eq. (ensemble_huber_loss)): a critic that does not learn from it never does. Learners
without masks have none.
"""

from __future__ import annotations

import json
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rudc.errors import InputError
from rudc.files import replacing
from rudc.learning.batch import Batch
from rudc.learning.config import Problem
from rudc.learning.nstep import Transition

DAMAGED = (OSError, ValueError, KeyError, EOFError, RuntimeError, zipfile.BadZipFile, zlib.error)
"""what numpy and zipfile raise at a file that is no whole .npz"""


class Replay:
    """The last `capacity` transitions; drawing and masks have one generator, so that a seed fixes both."""

    def __init__(
        self, problem: Problem, capacity: int = 100_000, masks: int = 0, probability: float = 1.0
    ) -> None:
        """`masks`: critics that each learn from a transition with this probability; 0 for no masks."""
        size, actions = problem.layout.size, problem.actions
        self.capacity = capacity
        self._probability = probability
        self._rng = np.random.default_rng([problem.seed, problem.seed])
        self._columns = Batch(
            observation=np.zeros((capacity, size), np.float32),
            executed=np.zeros((capacity, actions), np.float32),
            proposed=np.zeros((capacity, actions), np.float32),
            reward=np.zeros(capacity, np.float32),
            cost=np.zeros(capacity, np.float32),
            discount=np.zeros(capacity, np.float32),
            next_observation=np.zeros((capacity, size), np.float32),
            terminal=np.zeros(capacity, np.bool_),
            mask=np.zeros((capacity, masks), np.bool_),
            cost_change=np.zeros(capacity, np.float32),
        )
        self._stored = 0  # in all, those included that are overwritten by now

    def __len__(self) -> int:
        return min(self._stored, self.capacity)

    def add(self, transition: Transition) -> None:
        """Store one transition and draw its masks."""
        row, columns = self._stored % self.capacity, self._columns
        for name, value in transition._asdict().items():
            getattr(columns, name)[row] = value
        columns.mask[row] = self._rng.random(columns.mask.shape[1]) < self._probability
        self._stored += 1

    def first(self, count: int) -> Batch:
        """The `count` oldest transitions that are still kept, or as many as there are."""
        start = self._stored % self.capacity if self._stored > self.capacity else 0
        rows = (start + np.arange(min(count, len(self)))) % self.capacity
        return Batch._make(column[rows] for column in self._columns)

    def sample(self, count: int) -> Batch:
        """`count` transitions drawn with replacement."""
        if not self._stored:
            raise InputError("nothing can be drawn from an empty replay")
        rows = self._rng.integers(len(self), size=count)
        return Batch._make(column[rows] for column in self._columns)

    def save(self, path: Path) -> None:
        """Write all that is needed to carry on exactly to a .npz file, whole or not at all. Raises
        StorageError.
        """
        state = {
            "stored": self._stored,
            "capacity": self.capacity,
            "generator": self._rng.bit_generator.state,
        }
        columns = {name: column[: len(self)] for name, column in self._columns._asdict().items()}
        with replacing(path) as file:
            np.savez(file, state=np.array(json.dumps(state)), **columns)

    def load(self, path: Path) -> None:
        """Carry on from a saved replay of the same capacity and layout. InputError if it does not fit."""
        try:
            with path.open("rb") as file, np.load(file, allow_pickle=False) as saved:
                state = json.loads(str(saved["state"]))
                columns = {name: saved[name] for name in Batch._fields}
            capacity, stored = int(state["capacity"]), int(state["stored"])
            generator = np.random.default_rng()
            generator.bit_generator.state = state["generator"]
        except (*DAMAGED, TypeError) as error:
            raise InputError(f"{path}: is not a saved replay: {error}") from error
        self._check(path, capacity, stored, columns)
        for name, column in columns.items():
            getattr(self._columns, name)[: len(column)] = column
        self._stored, self._rng = stored, generator

    def _check(self, path: Path, capacity: int, stored: int, columns: Mapping[str, NDArray]) -> None:
        if capacity != self.capacity:
            raise InputError(f"{path}: holds {capacity} transitions, not {self.capacity}")
        for name, column in columns.items():
            expected = (min(stored, capacity), *getattr(self._columns, name).shape[1:])
            if column.shape[1:] != expected[1:]:
                raise InputError(f"{path}: each {name} has shape {column.shape[1:]}, not {expected[1:]}")
            if column.shape != expected:
                raise InputError(f"{path}: holds {len(column)} of {name}, not {expected[0]}")
