"""Learnt agents for tests: small networks that have learnt nothing."""

from typing import Any

from rudc.agents.config import AgentConfig
from rudc.arrays import Arrays
from rudc.learning.config import EnsembleConfig
from rudc.learning.parameters import critic_arrays, frozen_arrays, grouped, policy_arrays

NETWORK = {"encoder": "mlp", "hidden": 16}


def small(algorithm: str = "rudc-wo-cbf", **changes: Any) -> AgentConfig:
    """RUDC with two critics of 16 x 2."""
    learner = {"policy": NETWORK, "critic": NETWORK, "members": 2, "quantiles": 8}
    return AgentConfig.model_validate({"algorithm": algorithm, "learner": learner, **changes})


def arrays_of(config: AgentConfig, seed: int = 0) -> Arrays:
    """Initial weights of such an agent, with its priors."""
    learner, problem = config.learner, config.problem(seed)
    assert isinstance(learner, EnsembleConfig)
    arrays = grouped(policy=policy_arrays(learner, problem), critic=critic_arrays(learner, problem))
    return arrays | frozen_arrays(learner, problem, {})
