"""USL's learner: an update from its equations, a bandit whose penalty is exact, saving."""

from dataclasses import replace

import numpy as np
import pytest

from rudc.learning.algorithms import UslConfig
from rudc.learning.inference import Decider
from rudc.learning.usl import UslLearner
from tests.learning.constrained import SETTINGS, bandit, bandit_problem, updated
from tests.learning.test_sac import CONFIG as SAC_CONFIG
from tests.learning.test_sac import PROBLEM, batch

CONFIG = UslConfig(**SAC_CONFIG.model_dump(), cost_limit=0.5, cost_scale=1.0, penalty=3.0)


def test_an_update_against_its_equations() -> None:
    learner, before = (UslLearner(CONFIG, PROBLEM) for _ in range(2))
    said, _, drawn, q, q_c = updated(learner, before, batch(0))
    loss = (0.3 * drawn.log_probability - q + 3.0 * (q_c - 0.5).relu()).mean()
    assert said.policy_loss == pytest.approx(float(loss.detach()), abs=1e-5)
    assert said.cost_value == pytest.approx(float(q_c.detach().mean()), abs=1e-5)


def test_a_penalty_larger_than_the_multiplier_keeps_the_limit() -> None:
    """The bandit's multiplier is 5, so with a penalty of 8 the policy stops at the limit, x = 1/2."""
    settings = {**SETTINGS, "actor_rate": (3e-3, 1e-4)}
    config = UslConfig(**settings, cost_limit=1.0, penalty=8.0, initial_log_std=-2.0)
    problem = bandit_problem(updates=500)
    learner, rng = UslLearner(config, problem), np.random.default_rng(0)
    for _ in range(500):
        learner.update(bandit(rng))
    decider = Decider(config, problem.layout, learner.weights())
    assert (1 + decider.action(np.ones(1, np.float32))[0]) / 2 == pytest.approx(0.5, abs=0.06)


def test_stopped_and_resumed_same_numbers() -> None:
    through, first, second = (UslLearner(CONFIG, replace(PROBLEM, updates=5)) for _ in range(3))
    expected = [through.update(batch(seed)) for seed in range(6)]
    for seed in range(3):
        first.update(batch(seed))
    second.load(first.state())
    assert [second.update(batch(seed)) for seed in range(3, 6)] == expected[3:]
