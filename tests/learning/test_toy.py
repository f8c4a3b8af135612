"""Problems whose answer is known: a return distribution to recover, a risk to take or to leave."""

import numpy as np
import pytest
import torch

from rudc.learning.batch import Batch
from rudc.learning.rudc import RudcLearner
from tests.learning.helpers import Case, toy_case

FIRST, SECOND = np.array([1.0, 0.0], np.float32), np.array([0.0, 1.0], np.float32)


def transitions(case: Case, rng: np.random.Generator, count: int) -> dict[str, np.ndarray]:
    """What the toy problems share: random actions, all terminal, masks as configured."""
    action = rng.uniform(-1, 1, size=(count, 1)).astype(np.float32)
    return {
        "observation": np.tile(SECOND, (count, 1)),
        "executed": action,
        "proposed": action,
        "reward": np.zeros(count, np.float32),
        "cost": np.zeros(count, np.float32),
        "discount": np.full(count, 0.9, np.float32),
        "next_observation": np.tile(SECOND, (count, 1)),
        "terminal": np.ones(count, np.bool_),
        "mask": rng.random((count, case.config.members)) < case.config.mask_probability,
    }


def two_states(case: Case, rng: np.random.Generator) -> Batch:
    """First state: reward 20, on to the second. There -100 in a quarter of cases, else uniform on 60..140."""
    count = 96
    columns = transitions(case, rng, count)
    first = rng.random(count) < 0.5
    lost = rng.random(count) < 0.25
    columns["observation"][first] = FIRST
    columns["terminal"] = ~first
    end = np.where(lost, -100.0, rng.uniform(60, 140, count))
    columns["reward"] = np.where(first, 20.0, end).astype(np.float32)
    return Batch(**columns)


def test_return_distribution_of_two_states_is_recovered() -> None:
    """With priors of rho = 10 and returns of order 100, by every member."""
    case = toy_case(
        prior_factor=10.0,
        prior_scale=10.0,
        target_rate=0.05,
        critic_rate=(3e-3, 1e-4),
        updates=450,
        temperature=0.001,
        temperature_rate=0.0,
    )
    learner, rng = RudcLearner(*case), np.random.default_rng(0)
    for _ in range(450):
        learner.update(two_states(case, rng))

    tau = (np.arange(32) + 0.5) / 32
    second = np.where(tau < 0.25, -100.0, 60 + 80 * (tau - 0.25) / 0.75)
    action = torch.linspace(-1, 1, 9)[:, None]
    for state, expected in ((SECOND, second), (FIRST, 20 + 0.9 * second)):
        seen = torch.from_numpy(np.tile(state, (9, 1)))
        z = learner.critics.evaluate(seen, action).numpy()  # (N, 9, 32)
        jump = np.abs(tau - 0.25) < 2 / 32  # between them any value is as good
        error = np.abs(z - expected)[..., ~jump]
        assert error.mean() < 4.0
        assert error.mean(axis=(1, 2)) == pytest.approx(0.0, abs=6.0)
        assert z[..., :6].mean() == pytest.approx(expected[:6].mean(), abs=6.0)


def gamble(case: Case, rng: np.random.Generator) -> Batch:
    """What is put at stake, x = (1 + a) / 2, wins 20 x + 80 x or 20 x - 80 x, equally likely. The mean, 20 x,
    is best at x = 1; the worst quarter, -60 x, at x = 0.
    """
    columns = transitions(case, rng, 64)
    stake = (1 + columns["executed"][:, 0]) / 2
    luck = rng.choice([-1.0, 1.0], size=64)
    columns["reward"] = (20 * stake + 80 * stake * luck).astype(np.float32)
    return Batch(**columns)


@pytest.mark.parametrize(("beta", "stake"), [(1.0, 1.0), (0.25, 0.0)])
def test_who_minds_the_worst_quarter_leaves_the_gamble(beta: float, stake: float) -> None:
    case = toy_case(beta=beta, actor_rate=(3e-3, 1e-3), updates=350, temperature=0.5, temperature_floor=0.1)
    learner, rng = RudcLearner(*case), np.random.default_rng(1)
    for _ in range(350):
        learner.update(gamble(case, rng))
    mean, _ = learner.policy.distribution(learner.policy.trained, torch.from_numpy(SECOND[None]))
    assert (1 + float(mean.detach().tanh())) / 2 == pytest.approx(stake, abs=0.15)
