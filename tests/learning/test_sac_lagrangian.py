"""The Lagrangian: costs against a plain loop, and a bandit whose multiplier is known."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from rudc.learning.algorithms import LagrangianConfig
from rudc.learning.inference import Decider
from rudc.learning.multiplier import Multiplier
from rudc.learning.sac import SacLearner
from rudc.learning.sac_lagrangian import SacLagrangianLearner
from tests.learning.constrained import SETTINGS, bandit, bandit_problem, toll
from tests.learning.helpers import TOY
from tests.learning.test_sac import CONFIG as SAC_CONFIG
from tests.learning.test_sac import PROBLEM, batch

CONFIG = LagrangianConfig(
    **SAC_CONFIG.model_dump(), cost_limit=0.5, cost_scale=1.0, multiplier=2.0, multiplier_rate=0.01
)


def plain_network(weights: dict[str, torch.Tensor], n: int, *inputs: torch.Tensor) -> torch.Tensor:
    """Output of network n, written out."""
    gelu = torch.nn.functional.gelu
    x = inputs[0] @ weights["fuse.weight"][n] + weights["fuse.bias"][n]
    if len(inputs) > 1:
        x = x + inputs[1] @ weights["action.weight"][n]
    x = gelu(gelu(x) @ weights["hidden.weight"][n] + weights["hidden.bias"][n])
    return x @ weights["out.weight"][n] + weights["out.bias"][n]


def test_an_update_against_its_equations() -> None:
    """Cost targets, cost loss, policy loss and multiplier of one update, each from the equations alone."""
    learner = SacLagrangianLearner(CONFIG, PROBLEM)
    b = batch(0)
    noise = torch.Generator().manual_seed(PROBLEM.seed)
    groups = {"policy": learner.policy, "critic": learner.critics, "cost": learner.costs}
    before = {name: {k: v.detach().clone() for k, v in g.trained.items()} for name, g in groups.items()}
    after, cost = torch.from_numpy(b.next_observation), torch.from_numpy(b.cost)
    state, action = torch.from_numpy(b.observation), torch.from_numpy(b.executed)

    def drawn(seen: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        mean, log_std = plain_network(before["policy"], 0, seen).chunk(2, dim=1)
        distribution = torch.distributions.Normal(mean, log_std.exp())
        u = mean + log_std.exp() * torch.randn(mean.shape, generator=noise)
        log_p = distribution.log_prob(u).sum(1) - torch.log(1 - u.tanh() ** 2 + 1e-9).sum(1)
        return u.tanh(), log_p

    next_action, _ = drawn(after)
    next_costs = [plain_network(before["cost"], n, after, next_action)[:, 0] for n in range(2)]
    target = cost + 0.99 * torch.from_numpy(~b.terminal).float() * torch.maximum(*next_costs)
    losses = [
        0.5 * (plain_network(before["cost"], n, state, action)[:, 0] - target).square().mean()
        for n in range(2)
    ]
    said = learner.update(b)
    assert said.cost_target == pytest.approx(float(target.mean()), abs=1e-5)
    assert said.cost_loss == pytest.approx(float(sum(losses) / 2), rel=1e-4)

    now, log_p = drawn(state)  # the policy had not stepped yet, the critics had
    q = torch.minimum(*(plain_network(learner.critics.trained, n, state, now)[:, 0] for n in range(2)))
    q_c = torch.maximum(*(plain_network(learner.costs.trained, n, state, now)[:, 0] for n in range(2)))
    loss = (0.3 * log_p - q + 2.0 * (q_c - 0.5)).mean()
    assert said.policy_loss == pytest.approx(float(loss.detach()), abs=1e-4)
    assert said.multiplier == 2.0
    assert learner.multiplier.value == pytest.approx(
        2.0 + 0.01 * (float(q_c.detach().mean()) - 0.5), abs=1e-6
    )


def test_without_multiplier_it_is_sac() -> None:
    free = SacLagrangianLearner(
        CONFIG.model_copy(update={"multiplier": 0.0, "multiplier_rate": 0.0}), PROBLEM
    )
    sac = SacLearner(SAC_CONFIG, PROBLEM)
    for seed in range(3):
        ours, theirs = free.update(batch(seed)), sac.update(batch(seed))
        assert ours.policy_loss == theirs.policy_loss
    for name, value in sac.weights().items():
        assert np.array_equal(value, free.weights()[name]), name


def test_the_multiplier_of_a_constrained_bandit_is_found() -> None:
    config = LagrangianConfig(**SETTINGS, cost_limit=1.0, multiplier_rate=0.2)
    problem = bandit_problem(updates=500)
    learner, rng = SacLagrangianLearner(config, problem), np.random.default_rng(0)
    seen = [learner.update(bandit(rng)) for _ in range(500)]
    assert np.mean([s.multiplier for s in seen[-150:]]) == pytest.approx(5.0, abs=0.4)
    assert np.mean([s.cost_value for s in seen[-150:]]) == pytest.approx(1.0, abs=0.05)
    decider = Decider(config, problem.layout, learner.weights())
    stake = (1 + decider.action(np.ones(1, np.float32))[0]) / 2
    assert stake == pytest.approx(0.5, abs=0.05)
    assert decider.cost(np.ones(1, np.float32), np.float32([2 * stake - 1])) == pytest.approx(1.0, abs=0.1)
    assert decider.uncertainty(np.ones(1, np.float32), np.zeros(1, np.float32)) is None


def test_costs_to_come_count_discounted() -> None:
    config = LagrangianConfig(**SETTINGS, cost_limit=1.45, multiplier_rate=0.2, target_rate=0.05)
    problem = replace(TOY, updates=500)
    learner, rng = SacLagrangianLearner(config, problem), np.random.default_rng(0)
    seen = [learner.update(toll(rng)) for _ in range(500)]
    assert np.mean([s.multiplier for s in seen[-150:]]) == pytest.approx(5.0, abs=0.5)
    decider, (first, second) = Decider(config, problem.layout, learner.weights()), np.eye(2, dtype=np.float32)
    stake = (1 + decider.action(second)[0]) / 2
    assert stake == pytest.approx(0.5, abs=0.06)
    for action in (-1.0, 0.0, 1.0):  # at first nothing that is done makes a difference
        assert decider.cost(first, np.float32([action])) == pytest.approx(1 + 0.9 * 2 * stake, abs=0.15)
    assert decider.cost(second, np.float32([2 * stake - 1])) == pytest.approx(2 * stake, abs=0.15)


def test_the_multiplier_never_falls_below_zero() -> None:
    multiplier = Multiplier(0.1, 0.5, limit=1.0)
    multiplier.step(0.0)
    assert multiplier.value == 0.0
    multiplier.step(3.0)
    assert multiplier.value == 1.0
    other = Multiplier(0.0, 0.5, limit=1.0)
    other.load(multiplier.state())
    assert other.value == 1.0


def test_stopped_and_resumed_same_numbers() -> None:
    through, first, second = (SacLagrangianLearner(CONFIG, replace(PROBLEM, updates=5)) for _ in range(3))
    expected = [through.update(batch(seed)) for seed in range(6)]
    for seed in range(3):
        first.update(batch(seed))
    second.load(first.state())
    assert [second.update(batch(seed)) for seed in range(3, 6)] == expected[3:]
    assert through.weights().keys() == second.weights().keys()
