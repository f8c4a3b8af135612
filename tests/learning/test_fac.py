"""The feasible actor-critic: two states of which one is unsafe, an update from its equations, its delay."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
import torch

from rudc.learning.algorithms import FacConfig
from rudc.learning.batch import Batch
from rudc.learning.fac import FacLearner
from rudc.learning.inference import Decider
from tests.learning.constrained import SETTINGS, updated
from tests.learning.helpers import TOY
from tests.learning.test_sac import CONFIG as SAC_CONFIG
from tests.learning.test_sac import PROBLEM, batch

CONFIG = FacConfig(
    **SAC_CONFIG.model_dump(), cost_limit=0.5, cost_scale=1.0, multiplier_rate=1e-2, multiplier_delay=2
)
SAFE, UNSAFE = np.array([1.0, 0.0], np.float32), np.array([0.0, 1.0], np.float32)


def stakes(rng: np.random.Generator, count: int = 48) -> Batch:
    """Two states, one step. The stake x = (1 + a) / 2 earns 20 x - 10 x^2 in both and costs 2 x in the unsafe
    one. Where the cost may be 1: x = 1 and lambda = 0 in the safe state; x = 1/2 in the unsafe one, and there
    d reward / d cost = (20 - 20 x) / 2 = 5.
    """
    action = rng.uniform(-1, 1, size=(count, 1)).astype(np.float32)
    x, unsafe = (1 + action[:, 0]) / 2, rng.random(count) < 0.5
    observation = np.where(unsafe[:, None], UNSAFE, SAFE)
    return Batch(
        observation=observation,
        executed=action,
        proposed=action,
        reward=(20 * x - 10 * x**2).astype(np.float32),
        cost=np.where(unsafe, 2 * x, 0).astype(np.float32),
        discount=np.full(count, 0.9, np.float32),
        next_observation=observation,
        terminal=np.ones(count, np.bool_),
        mask=np.zeros((count, 0), np.bool_),
    )


def test_the_multiplier_is_that_of_each_state() -> None:
    config = FacConfig(**SETTINGS, cost_limit=1.0, multiplier_rate=1e-3, multiplier_delay=2)
    problem = replace(TOY, updates=450)
    learner, rng = FacLearner(config, problem), np.random.default_rng(0)
    states = torch.from_numpy(np.stack([SAFE, UNSAFE]))
    seen = []
    for k in range(450):
        learner.update(stakes(rng))
        if k >= 320:
            seen.append(learner.lagrange(states).detach().numpy())
    safe, unsafe = np.mean(seen, axis=0)
    assert safe < 0.2
    assert unsafe == pytest.approx(5.0, abs=0.6)
    decider = Decider(config, problem.layout, learner.weights())
    assert (1 + decider.action(SAFE)[0]) / 2 > 0.9
    assert (1 + decider.action(UNSAFE)[0]) / 2 == pytest.approx(0.5, abs=0.06)


def test_an_update_against_its_equations() -> None:
    learner, before = (FacLearner(CONFIG, PROBLEM) for _ in range(2))
    said, seen, drawn, q, q_c = updated(learner, before, batch(0))
    lagrange = before.lagrange(seen.state)
    loss = (0.3 * drawn.log_probability - q + lagrange * (q_c - 0.5)).mean()
    assert said.policy_loss == pytest.approx(float(loss.detach()), abs=1e-5)
    assert said.cost_value == pytest.approx(float(q_c.detach().mean()), abs=1e-5)
    assert said.multiplier == pytest.approx(float(lagrange.detach().mean()), abs=1e-6)
    assert said.largest_multiplier == pytest.approx(float(lagrange.detach().max()), abs=1e-6)


def test_the_multiplier_learns_in_every_second_update() -> None:
    learner = FacLearner(CONFIG, PROBLEM)
    seen = [learner.multiplier.arrays()["out.weight"]]
    for seed in range(4):
        learner.update(batch(seed))
        seen.append(learner.multiplier.arrays()["out.weight"])
    changed = [not np.array_equal(a, b) for a, b in itertools.pairwise(seen)]
    assert changed == [False, True, False, True]


def test_stopped_and_resumed_same_numbers() -> None:
    through, first, second = (FacLearner(CONFIG, replace(PROBLEM, updates=5)) for _ in range(3))
    expected = [through.update(batch(seed)) for seed in range(6)]
    for seed in range(3):
        first.update(batch(seed))
    second.load(first.state())
    assert [second.update(batch(seed)) for seed in range(3, 6)] == expected[3:]
