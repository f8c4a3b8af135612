"""Deciding in numpy: the same numbers as the networks that were trained."""

import subprocess
import sys

import numpy as np
import pytest
import torch
from scipy.special import erf

from rudc.learning.config import EnsembleConfig, NetworkConfig, ObservationLayout, Problem
from rudc.learning.inference import Decider, gelu
from rudc.learning.rudc import RudcLearner
from rudc.learning.uncertainty import uncertainty
from tests.learning.helpers import SMALL, Case, observations, quick_case, random_batch, small_case

CASES = {
    "small": small_case(),
    "paper": Case(EnsembleConfig(), Problem()),
    "conflict": Case(
        EnsembleConfig(critic=NetworkConfig(vehicle_layers=2)), Problem(ObservationLayout(conflict=41))
    ),
    "quick": quick_case(),
    "no prior": small_case(prior_factor=0.0, policy=SMALL.model_copy(update={"hops": 3, "heads": 1})),
}


@pytest.mark.parametrize("name", CASES)
def test_same_numbers_as_the_trained_networks(name: str) -> None:
    case = CASES[name]
    learner = RudcLearner(*case)
    for seed in range(2):
        learner.update(random_batch(case, 16, seed))
    if name == "small":
        learner.start(random_batch(case, 50))
    decider = Decider(case.config, case.problem.layout, learner.weights())
    seen = observations(case.problem.layout, 6, np.random.default_rng(1))
    seen[0, case.problem.layout.vehicles_at] = 0.0  # nobody there
    flat = torch.from_numpy(seen)
    with torch.no_grad():
        mean = learner.policy.distribution(learner.policy.trained, flat)[0].tanh().numpy()
        quantiles = learner.critics.evaluate(flat, torch.from_numpy(mean)).numpy()
    for i, observation in enumerate(seen):
        action = decider.action(observation)
        sigma = decider.uncertainty(observation, action)
        assert sigma is not None
        assert action == pytest.approx(mean[i], abs=1e-5)
        assert decider.quantiles(observation, mean[i]) == pytest.approx(quantiles[:, i], abs=2e-3, rel=1e-4)
        assert sigma.total == pytest.approx(uncertainty(quantiles[:, i], case.config.beta).total, rel=1e-3)


def test_drawn_actions_are_the_policys() -> None:
    case = small_case()
    learner = RudcLearner(*case)
    decider = Decider(case.config, case.problem.layout, learner.weights())
    observation = observations(case.problem.layout, 1, np.random.default_rng(0))[0]
    rng = np.random.default_rng(1)
    drawn = np.arctanh(np.array([decider.action(observation, rng) for _ in range(3000)]))
    mean, log_std = learner.policy.distribution(learner.policy.trained, torch.from_numpy(observation[None]))
    spread = log_std[0].exp().detach().numpy()
    assert drawn.mean(axis=0) == pytest.approx(mean[0].detach().numpy(), abs=5 * spread.max() / np.sqrt(3000))
    assert drawn.std(axis=0) == pytest.approx(spread, rel=0.06)
    first, second = (decider.action(observation, np.random.default_rng(2)) for _ in range(2))
    assert np.array_equal(first, second)


def test_new_weights_are_taken_over_and_critics_may_be_left_out() -> None:
    case = small_case()
    learner = RudcLearner(*case)
    decider = Decider(case.config, case.problem.layout, learner.weights())
    observation = observations(case.problem.layout, 1, np.random.default_rng(0))[0]
    before = decider.action(observation)
    learner.update(random_batch(case, 16))
    decider.refresh({name: value for name, value in learner.weights().items() if name.startswith("policy/")})
    assert not np.array_equal(decider.action(observation), before)
    with pytest.raises(ValueError, match="without critic"):
        decider.quantiles(observation, before)


def test_gelu() -> None:
    x = np.concatenate([np.linspace(-12, 12, 20_001), [0.0, 1e-8, -1e-8, 60.0, -60.0]]).astype(np.float32)
    exact = 0.5 * x.astype(float) * (1 + erf(x.astype(float) / np.sqrt(2)))
    assert gelu(x) == pytest.approx(exact, abs=1e-6)


def test_deciding_needs_no_torch() -> None:
    modules = "rudc.learning.inference, rudc.learning.checkpoint, sys"
    code = f"import {modules}; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
