"""Training's configuration refuses what cannot work; the curriculum draws what it says."""

import math
from collections import Counter

import numpy as np
import pytest

from rudc.agents.algorithms import ALGORITHMS
from rudc.errors import InputError
from rudc.network.network import load_network
from rudc.training.config import Curriculum, TrainConfig
from rudc.training.curriculum import FIRST_SEED, HELD_OUT_SEED, make_mixture


@pytest.mark.parametrize("algorithm", list(ALGORITHMS))
def test_every_algorithm_has_a_default(algorithm: str):
    config = TrainConfig.default(algorithm, seed=3, steps=20_000)
    assert config.driver.algorithm == algorithm
    assert config.driver.learner.seed == 3
    assert config.driver.learner.schedule_updates == 5_000
    assert TrainConfig.model_validate_json(config.model_dump_json()) == config


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"algorithm": "sac2"}, "no algorithm 'sac2'"),
        ({"envs": 0}, "envs: .*greater than or equal to 1"),
        ({"slack_gain": 1.0}, "needs a filter"),
        ({"learner": {"seed": 1}}, "seed"),
        ({"learner": {"n_step": 101}}, "n_step"),
        ({"speed": 3}, "speed"),
        ({"observation": "all"}, "observation"),
    ],
)
def test_wrong_settings_are_refused_in_words(wrong: dict, said: str):
    with pytest.raises(InputError, match=said):
        TrainConfig.default(**wrong)


def test_decisions_are_rounded_up_to_rounds():
    config = TrainConfig.default(envs=3, steps=1000, seed_steps=301)
    assert (config.round_steps, config.seed_rounds, config.rounds) == (300, 2, 6)
    config = TrainConfig.default(steps=200, seed_steps=0)
    assert (config.seed_rounds, config.rounds) == (0, 1)


def test_observation_decides_what_the_networks_see():
    assert TrainConfig.default(observation="paper").driver.learner.layout.size == 105
    assert TrainConfig.default().driver.learner.layout.size == 146


def test_curriculum_draws_arms_turns_traffic_and_starts_as_it_says():
    mixture = make_mixture("random_destination", Curriculum())
    rng = np.random.default_rng(1)
    plans = [mixture.draw(rng) for _ in range(2000)]
    arms = {arm.name: arm.major for arm in load_network("four_way").arms}
    minor = np.mean([not arms[plan.ego.origin or ""] for plan in plans])
    assert minor == pytest.approx(0.65, abs=0.04)
    turns = Counter(plan.ego.turn for plan in plans)
    assert turns["left"] / 2000 == pytest.approx(0.35, abs=0.04)
    assert turns["right"] / 2000 == pytest.approx(0.325, abs=0.04)
    density = [plan.traffic.density for plan in plans]
    distance = [plan.ego.distance_m for plan in plans]
    assert 10 <= min(density) < 11 < 34 < max(density) <= 35
    assert 25 <= min(distance) < 26 < 44 < max(distance) <= 45
    assert min(plan.seed for plan in plans) >= FIRST_SEED > HELD_OUT_SEED + 10_000


def test_without_curriculum_the_scenario_is_kept():
    mixture = make_mixture("dense_left_turn", None)
    plan = mixture.draw(np.random.default_rng(0))
    assert (plan.traffic.density, plan.ego.turn, len(mixture.scenarios)) == (30.0, "left", 1)
    swept = make_mixture("density_sweep", None)
    assert len(swept.scenarios) == 5
    assert sum(swept.chances) == pytest.approx(1)


def test_the_papers_configuration_is_as_written():
    config = TrainConfig.paper("rudc-e", steps=4000)
    driver, learner = config.driver, config.driver.learner
    assert (driver.observation, driver.action) == ("paper", "direct")
    assert driver.filter is not None
    assert (driver.filter.rule, driver.filter.constrained) == ("ecbf", "all")
    assert driver.filter.max_added_acceleration == math.inf
    assert not driver.filter.last_resort
    assert TrainConfig.model_validate_json(config.model_dump_json()) == config
    assert (learner.members, learner.n_step, learner.critic.encoder, learner.critic.hidden) == (
        5,
        1,
        "attention",
        256,
    )
    assert (config.curriculum, config.seed_steps, config.collision_reward) == (None, 0, -50.0)
    assert learner.schedule_updates == 1000


def test_single_values_can_be_changed_by_their_keys():
    config = TrainConfig.default("rudc-t").changed(
        {
            "driver.observation": "paper",
            "driver.learner.n_step": 1,
            "driver.filter_settings.constrained": "all",
            "curriculum.left_share": 0.5,
        }
    )
    assert config.driver.learner.layout.size == 105
    assert config.driver.learner.n_step == 1
    assert config.driver.filter_settings == {"constrained": "all"}
    assert config.curriculum is not None
    assert config.curriculum.left_share == 0.5
    assert TrainConfig.default("rudc-t").changed({"curriculum": None}).curriculum is None


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"driver.learner.nstep": 1}, "driver.learner.nstep: Extra inputs"),
        ({"driver.observation": "all"}, "observation"),
        ({"steps.more": 1}, "steps.more"),
        ({"": 1}, "dotted key"),
        ({"driver.filter_settings.d_saf": 1}, "d_saf: there is no such setting"),
    ],
)
def test_changes_that_cannot_be_are_refused(settings: dict, said: str):
    with pytest.raises(InputError, match=said):
        TrainConfig.default("rudc-t").changed(settings)
