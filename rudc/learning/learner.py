"""`Learner`: what learns from batches, whatever the algorithm; and what all soft actor-critics share.

One file an algorithm: its class takes (config, problem, device), keeps its parts in `parts`, so that they are
saved, and writes down its `update`. Its name, and what it is used with, stand in algorithms.py.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, NamedTuple, Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from rudc.arrays import Arrays
from rudc.learning.batch import Batch
from rudc.learning.config import LearnerConfig, Problem
from rudc.learning.descent import Descent
from rudc.learning.saving import Noise, Part, State, load_into, state_of
from rudc.learning.temperature import Temperature
from rudc.learning.tracked import Tracked


@dataclass(frozen=True)
class Statistics:
    """What an update says of itself. An algorithm with more to say adds fields: each is a column of
    progress.csv, and training stops where one of them is not finite or out of bounds.
    """

    critic_loss: float
    """mean over the critics"""
    policy_loss: float
    """reward units"""
    value: float
    """what the policy maximises, without the entropy, mean over the batch, reward units"""
    target: float
    """mean of the critics' targets, reward units"""
    entropy: float
    """entropy of the policy, nats"""
    temperature: float
    """alpha_tem, reward units a nat"""
    critic_gradient: float
    """largest norm among the critics, before it is clipped"""
    policy_gradient: float
    """norm, before it is clipped"""


class Learner(Protocol):
    """Learns from batches; the same problem, settings and batches give the same numbers."""

    @property
    def statistics(self) -> type[Statistics]:
        """What `update` gives."""
        ...

    masks: tuple[int, float]
    """critics with masks of their own, and the chance that each of them learns from a transition"""

    @property
    def updates(self) -> int:
        """Updates so far."""
        ...

    def start(self, batch: Batch) -> None:
        """Told once, before the first update, what transitions look like."""
        ...

    def update(self, batch: Batch) -> Statistics:
        """One step of learning."""
        ...

    def sigma(self, observation: NDArray, action: NDArray) -> NDArray | None:
        """Standard deviation (B,) of the return that follows from actions (B, actions) at observations
        (B, size), reward units; None from those that state none.
        """
        ...

    def weights(self) -> Arrays:
        """All that driving needs, named GROUP/NAME, copied: `policy/...`, `critic/...` and so on."""
        ...

    def state(self) -> State:
        """All that `load` needs to carry on to the same numbers, copied."""
        ...

    def load(self, state: Mapping[str, NDArray]) -> None:
        """Carry on from a saved state. AgentError if it is that of another configuration."""
        ...


class Tensors(NamedTuple):
    """A batch on the learner's device."""

    state: Tensor
    """s, (B, size)"""
    action: Tensor
    """a, (B, actions), the one that is learnt from"""
    reward: Tensor
    """r, (B,)"""
    cost: Tensor
    """c, (B,)"""
    discount: Tensor
    """gamma^k, and 0 where the episode ended, (B,)"""
    after: Tensor
    """s', (B, size)"""


class SoftActorCritic:
    """Base of our learners: temperature, noise, counters, saving. Subclasses add critics and policy to
    `parts`.
    """

    statistics: ClassVar[type[Statistics]] = Statistics

    def __init__(self, config: LearnerConfig, problem: Problem, device: str = "cpu") -> None:
        self.device = torch.device(device)
        self.masks: tuple[int, float] = (0, 1.0)
        self.updates = 0
        self.noise = Noise(problem.seed, self.device)
        self.temperature = Temperature(config, problem.actions, self.device)
        self.parts: dict[str, Part] = {"noise": self.noise, "temperature": self.temperature}
        self._config, self._problem = config, problem

    def learns(self, name: str, part: Tracked, rates: tuple[float, float]) -> Descent:
        """An optimiser of a part's weights, its learning rates first and last; both are among `parts`."""
        descent = Descent(part.trained, rates, self._config.max_gradient, self._problem.updates)
        self.parts |= {name: part, f"{name}_descent": descent}
        return descent

    def tensor(self, values: NDArray) -> Tensor:
        """An array on the learner's device."""
        return torch.from_numpy(values).to(self.device)

    def tensors(self, batch: Batch) -> Tensors:
        """A batch on the learner's device."""
        discount = np.where(batch.terminal, np.float32(0), batch.discount)
        action = batch.action(self._config.learns_from)
        columns = (batch.observation, action, batch.reward, batch.cost, discount, batch.next_observation)
        return Tensors._make(self.tensor(column) for column in columns)

    def start(self, batch: Batch) -> None:
        """See `Learner`; most have nothing to do."""

    def sigma(self, observation: NDArray, action: NDArray) -> NDArray | None:
        """See `Learner`; most state none."""
        return None

    def state(self) -> State:
        """See `Learner`."""
        return {"updates": np.array([self.updates]), **state_of(self.parts)}

    def load(self, state: Mapping[str, NDArray]) -> None:
        """See `Learner`."""
        load_into(self.parts, state)
        self.updates = int(state["updates"][0])
