"""The paper's baselines: values of its Tab. "Hyper-parameters of different Safe RL algorithms", and that all
algorithms are given the same.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from rudc.learning.algorithms import ALGORITHMS
from rudc.learning.parameters import group, policy_arrays
from rudc.training.config import TrainConfig

LIMIT, COST_LIMIT = "learner.cost_limit", "correction.cost_limit"
EACH: Mapping[str, Mapping[str, float]] = {
    "qpsl": {COST_LIMIT: 0.2},
    "recovery-rl": {COST_LIMIT: 0.2},
    "sac-lagrangian": {LIMIT: 0.2, "learner.multiplier_rate": 1e-5, "learner.multiplier": 0.0},
    "fac": {LIMIT: 0.2, "learner.multiplier_rate": 1e-6, "learner.multiplier_delay": 6},
    "usl": {LIMIT: 0.2, "learner.penalty": 5.0, "correction.steps": 20},
}
"""the table's columns: what an algorithm has alone"""
ALL = {"discount": 0.99, "batch_size": 256, "n_step": 1}
"""the table's lines for all, and costs by the step"""
RATES = {"critic_rate": 3e-3, "actor_rate": 3e-4}
"""at first, of cost critics and of Recovery RL's second policy, too"""


def at(tree: Mapping[str, Any], key: str) -> Any:
    for part in key.split("."):
        tree = tree[part]
    return tree


@pytest.mark.parametrize("algorithm", EACH)
def test_the_papers_configuration_is_that_of_its_table(algorithm: str):
    config = TrainConfig.of(algorithm, preset="paper").model_dump()
    assert {key: at(config, key) for key in EACH[algorithm]} == EACH[algorithm]
    assert {key: config["learner"][key] for key in ALL} == ALL
    assert {key: config["learner"][key][0] for key in RATES} == RATES


@pytest.mark.parametrize("algorithm", EACH)
def test_ours_differs_from_the_table_in_nothing_that_an_algorithm_has_alone(algorithm: str):
    config = TrainConfig.of(algorithm).model_dump()
    assert {key: at(config, key) for key in EACH[algorithm]} == EACH[algorithm]


@pytest.mark.parametrize("preset", ["default", "paper"])
@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_all_are_given_the_same(algorithm: str, preset: str):
    """Observation, action, courses, networks, decisions and updates, episodes; and the same first policy.
    Corrections that belong to a method are at work in every episode, the filter in half of them.
    """
    other, sac = TrainConfig.of(algorithm, preset=preset), TrainConfig.of("sac", preset=preset)
    assert (other.observation, other.action, other.outlook) == (sac.observation, sac.action, sac.outlook)
    own = {"filtered_share", "calibration_episodes"}
    assert other.training.model_dump(exclude=own) == sac.training.model_dump(exclude=own)
    assert other.given == sac.given
    theirs, plain = other.learner.model_dump(), sac.learner.model_dump()
    assert {key: theirs[key] for key in plain if key != "learns_from"} == {
        key: value for key, value in plain.items() if key != "learns_from"
    }
    filtered = preset == "paper" and other.correction.kind == "cbf"
    assert (theirs["learns_from"] == "proposed") == (algorithm == "recovery-rl" or filtered)
    if other.correction.kind in ("usl", "qpsl", "recovery"):
        assert other.training.filtered_share == 1.0


@pytest.mark.parametrize("algorithm", ["sac", "dsac", *EACH, "rudc-t"])
def test_all_start_from_the_same_policy(algorithm: str):
    """And, of those with two critics of the return, from the same critics, whatever else they have."""
    small = {"learner.policy.hidden": 8, "learner.critic.hidden": 8, "training.seed": 3}
    config, sac = TrainConfig.of(algorithm, small), TrainConfig.of("sac", small)
    weights, plain = (c.entry.kind(c.algorithm)(c.learner, c.given, "cpu").weights() for c in (config, sac))
    first = policy_arrays(sac.learner, sac.given)
    for name, array in group(weights, "policy").items():
        np.testing.assert_array_equal(array, first[name], err_msg=name)
    if algorithm in EACH:
        for name, array in group(plain, "critic").items():
            np.testing.assert_array_equal(weights[f"critic/{name}"], array, err_msg=name)
