"""Recovery RL's learner: what each critic learns about, two policies that go opposite ways, saving."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from rudc.learning.algorithms import RecoveryConfig
from rudc.learning.inference import Decider
from rudc.learning.recovery import RecoveryLearner
from tests.learning.constrained import SETTINGS, bandit, bandit_problem
from tests.learning.test_sac import CONFIG as SAC_CONFIG
from tests.learning.test_sac import PROBLEM, batch

CONFIG = RecoveryConfig.model_validate(
    SAC_CONFIG.model_dump() | {"learns_from": "proposed", "cost_scale": 1.0}
)


def test_an_update_against_its_equations() -> None:
    """Returns are learnt of what was proposed, the risk of what was executed; both policies' losses."""
    learner, before = (RecoveryLearner(CONFIG, PROBLEM) for _ in range(2))
    b = batch(0)
    seen, executed = before.tensors(b), torch.from_numpy(b.executed)
    after = before.draw_after(seen)
    future = before.critics.target_value(seen.after, after.action) - 0.3 * after.log_probability
    y = seen.reward + seen.discount * future
    y_c = seen.cost + seen.discount * before.costs.target_value(seen.after, after.action)
    proposed = torch.from_numpy(b.proposed)
    q = before.critics.both(before.critics.trained, seen.state, proposed)
    q_c = before.costs.both(before.costs.trained, seen.state, executed)
    escape = before.recovery.likely(seen.state)
    said = learner.update(b)
    assert said.critic_loss == pytest.approx(float((q - y).square().mean().detach() / 2), rel=1e-5)
    assert said.cost_loss == pytest.approx(float((q_c - y_c).square().mean().detach() / 2), rel=1e-5)
    drawn = before.draw(seen.state)  # the policies had not stepped yet, the critics had
    value = learner.critics.both(learner.critics.trained, seen.state, drawn.action).min(dim=0).values
    loss = (0.3 * drawn.log_probability - value).mean()
    assert said.policy_loss == pytest.approx(float(loss.detach()), abs=1e-5)
    risk = learner.costs.both(learner.costs.trained, seen.state, escape).max(dim=0).values
    assert said.recovery_cost == pytest.approx(float(risk.mean().detach()), abs=1e-5)


def test_one_policy_goes_for_the_return_the_other_for_no_risk() -> None:
    """All of the bandit's stake, and nothing of it."""
    config = RecoveryConfig(**SETTINGS)
    problem = bandit_problem(updates=300)
    learner, rng = RecoveryLearner(config, problem), np.random.default_rng(0)
    for _ in range(300):
        learner.update(bandit(rng))
    decider, state = Decider(config, problem.layout, learner.weights()), np.ones(1, np.float32)
    assert (1 + decider.action(state)[0]) / 2 > 0.9
    escape = np.tanh(decider.seen("recovery", state)[:1])
    assert (1 + escape[0]) / 2 < 0.05
    assert decider.cost(state, decider.action(state)) == pytest.approx(2.0, abs=0.3)
    assert decider.cost(state, escape) == pytest.approx(0.0, abs=0.2)


def test_stopped_and_resumed_same_numbers() -> None:
    through, first, second = (RecoveryLearner(CONFIG, replace(PROBLEM, updates=5)) for _ in range(3))
    expected = [through.update(batch(seed)) for seed in range(6)]
    for seed in range(3):
        first.update(batch(seed))
    second.load(first.state())
    assert [second.update(batch(seed)) for seed in range(3, 6)] == expected[3:]
