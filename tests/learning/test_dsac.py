"""Distributional SAC: a return distribution to recover, a gamble that a mean takes, saving."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from rudc.learning.algorithms import DistributionalConfig
from rudc.learning.batch import Batch
from rudc.learning.config import NetworkConfig
from rudc.learning.dsac import DsacLearner
from rudc.learning.inference import Decider
from rudc.learning.quantiles import quantile_huber
from tests.learning.helpers import TOY, Case, toy_case
from tests.learning.test_sac import CONFIG as SAC_CONFIG
from tests.learning.test_sac import PROBLEM, batch
from tests.learning.test_toy import FIRST, SECOND, gamble, two_states

CONFIG = DistributionalConfig(**SAC_CONFIG.model_dump(), quantiles=8)
NETWORK = NetworkConfig(encoder="mlp", hidden=32)


def unmasked(b: Batch) -> Batch:
    """Without an ensemble's masks."""
    return b._replace(mask=np.zeros((len(b.reward), 0), np.bool_))


def toy(updates: int, **changes: object) -> tuple[DsacLearner, Case]:
    values: dict[str, object] = {"policy": NETWORK, "critic": NETWORK, "target_rate": 0.05}
    config = DistributionalConfig.model_validate(values | changes)
    problem = replace(TOY, updates=updates)
    return DsacLearner(config, problem), toy_case(members=1)


def test_the_distribution_of_two_states_is_recovered() -> None:
    """Of either critic: -100 in a quarter of cases, else uniform on 60..140, and 20 before."""
    learner, case = toy(600, temperature=0.001, temperature_rate=0.0)
    rng = np.random.default_rng(0)
    for _ in range(600):
        learner.update(unmasked(two_states(case, rng)))
    tau = (np.arange(32) + 0.5) / 32
    second = np.where(tau < 0.25, -100.0, 60 + 80 * (tau - 0.25) / 0.75)
    decider = Decider(learner.config, TOY.layout, learner.weights())
    for state, expected, most in ((SECOND, second, 5.0), (FIRST, 20 + 0.9 * second, 9.0)):
        z = np.stack([decider.quantiles(state, np.float32([a])) for a in np.linspace(-1, 1, 9)])
        assert z.shape == (9, 2, 32)
        jump = np.abs(tau - 0.25) < 2 / 32  # between them any value is as good
        assert np.abs(z - expected)[..., ~jump].mean() < most
        assert decider.uncertainty(state, np.zeros(1, np.float32)) is None


def test_the_mean_counts_not_the_worst_quarter() -> None:
    """It gambles, as who looks at the mean does (tests/learning/test_toy.py)."""
    learner, case = toy(350, actor_rate=(3e-3, 1e-3), temperature=0.5, temperature_floor=0.1)
    rng = np.random.default_rng(1)
    for _ in range(350):
        learner.update(unmasked(gamble(case, rng)))
    mean, _ = learner.policy.distribution(learner.policy.trained, torch.from_numpy(SECOND[None]))
    assert (1 + float(mean.detach().tanh())) / 2 == pytest.approx(1.0, abs=0.15)


def test_an_update_against_its_equations() -> None:
    """Targets and losses of one update, from the smaller quantile of the two and the smaller mean."""
    learner, other = DsacLearner(CONFIG, PROBLEM), DsacLearner(CONFIG, PROBLEM)
    b = batch(0)
    seen = other.tensors(b)
    after = other.draw_after(seen)
    z = other.twins.quantiles(
        other.twins.trained, seen.after, after.action
    ).detach()  # targets start as these
    future = torch.minimum(z[0], z[1]) - (0.3 * after.log_probability)[:, None]
    target = seen.reward[:, None] + seen.discount[:, None] * future
    before = other.twins.quantiles(other.twins.trained, seen.state, seen.action).detach()
    said = learner.update(b)
    assert said.target == pytest.approx(float(target.mean()), abs=1e-5)
    assert said.critic_loss == pytest.approx(float(quantile_huber(before, target).mean()), rel=1e-4)
    drawn = other.draw(seen.state)  # the policy had not stepped yet, the critics had
    means = learner.twins.quantiles(learner.twins.trained, seen.state, drawn.action).detach().mean(dim=2)
    assert said.value == pytest.approx(float(torch.minimum(means[0], means[1]).mean()), abs=1e-5)


def test_stopped_and_resumed_same_numbers() -> None:
    through, first, second = (DsacLearner(CONFIG, replace(PROBLEM, updates=5)) for _ in range(3))
    expected = [through.update(batch(seed)) for seed in range(6)]
    for seed in range(3):
        first.update(batch(seed))
    second.load(first.state())
    assert [second.update(batch(seed)) for seed in range(3, 6)] == expected[3:]
