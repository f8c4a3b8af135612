"""The replay: the last transitions, as arrays, from which batches are drawn.

Kept are executed and proposed action both. Masks m_n ~ Bernoulli(p) are drawn once, when a transition comes
in, so that a member never learns from what it was not meant to see.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from rudc.agents.learning.batch import Batch
from rudc.agents.learning.config import LearnerConfig
from rudc.errors import InputError
from rudc.training.collect import Transitions


class Replay:
    """A ring of at most `size` transitions."""

    def __init__(self, size: int, learner: LearnerConfig) -> None:
        width, actions = learner.layout.size, learner.actions
        self._probability = learner.mask_probability
        self._columns: dict[str, NDArray] = {
            "observation": np.zeros((size, width), np.float32),
            "action": np.zeros((size, actions), np.float32),
            "nominal": np.zeros((size, actions), np.float32),
            "reward": np.zeros(size, np.float32),
            "discount": np.zeros(size, np.float32),
            "next_observation": np.zeros((size, width), np.float32),
            "terminal": np.zeros(size, np.bool_),
            "mask": np.zeros((size, learner.members), np.bool_),
        }
        self._size = size
        self._added = 0

    def __len__(self) -> int:
        return min(self._added, self._size)

    def add(self, new: Transitions, rng: np.random.Generator) -> None:
        """Take in transitions; the oldest make room."""
        count = len(new.reward)
        rows = (self._added + np.arange(count)) % self._size
        for name, values in new._asdict().items():
            self._columns[name][rows] = values
        mask = self._columns["mask"]
        mask[rows] = rng.random((count, mask.shape[1])) < self._probability
        self._added += count

    def sample(self, count: int, rng: np.random.Generator) -> Batch:
        """`count` transitions, drawn uniformly, with repetition."""
        rows = rng.integers(len(self), size=count)
        return Batch(**{name: column[rows] for name, column in self._columns.items()})

    def state(self) -> dict[str, NDArray]:
        """All that `load` needs."""
        held = len(self)
        return {f"replay/{name}": column[:held] for name, column in self._columns.items()} | {
            "replay/added": np.array([self._added])
        }

    def load(self, state: Mapping[str, NDArray]) -> None:
        """Carry on from a saved state of a replay of the same size."""
        for name, column in self._columns.items():
            saved = state[f"replay/{name}"]
            if saved.shape[1:] != column.shape[1:] or len(saved) > self._size:
                raise InputError(f"the saved replay does not fit this configuration ({name})")
            column[: len(saved)] = saved
        self._added = int(state["replay/added"][0])
