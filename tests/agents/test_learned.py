"""A learnt policy at the wheel: what it proposes, how sure it is, what the filter makes of it."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rudc.agents.algorithms import DriverConfig, observation_layout
from rudc.agents.correction import CbfCorrection
from rudc.agents.learned import LearnedAgent, untrained
from rudc.env.observation import observe_flat
from rudc.learning.config import LearnerConfig
from rudc.learning.inference import Decider
from rudc.learning.parameters import critic_arrays, policy_arrays
from rudc.safety.slack import Slack
from tests.agents.conftest import Other


def _arrays(config: LearnerConfig) -> dict[str, Any]:
    groups = {"policy": policy_arrays(config), "critic": critic_arrays(config)}
    return {f"{group}/{name}": value for group, arrays in groups.items() for name, value in arrays.items()}


@pytest.fixture
def scene(scene_on):
    return scene_on("south", "left", 50.0, 8.0, (Other(0, 30.0, 8.0), Other(3, 40.0, 6.0)))


@pytest.mark.parametrize("observation", ["paper", "conflict"])
def test_drives_by_the_policys_mean_and_says_how_sure_it_is(scene, observation):
    learner = LearnerConfig.quick(observation_layout(observation))
    config = DriverConfig(observation=observation, learner=learner)
    agent = LearnedAgent("mine", config, _arrays(learner))
    agent.reset(scene, 0)
    choice, decision = agent.choose(scene), agent.act(scene)
    known = Decider(learner, _arrays(learner)).decide(observe_flat(scene, observation))
    np.testing.assert_array_equal(choice.nominal, known.action)
    np.testing.assert_array_equal(choice.action, choice.nominal)
    np.testing.assert_array_equal(decision.u, config.action_kind.physical(known.action, scene))
    np.testing.assert_array_equal(decision.u, decision.u_rl)
    assert decision.sigma == pytest.approx(float(known.uncertainty.total))
    assert decision.corrected is None
    assert set(decision.timing_ms) == {"observation", "policy", "critic", "correction"}


def test_explores_with_a_generator_only(scene):
    agent = untrained(DriverConfig())
    rng = np.random.default_rng(0)
    drawn = np.array([agent.choose(scene, rng).nominal for _ in range(300)])
    still = np.array([agent.choose(scene).nominal for _ in range(3)])
    assert (still == still[0]).all()
    assert drawn.mean(axis=0) == pytest.approx(still[0], abs=0.08)
    assert (drawn.std(axis=0) > 0.2).all()
    assert math.isnan(agent.act(scene).sigma)  # it has no critics yet


class Recorder:
    """A filter that brakes and steers as told, and remembers what slack it was given."""

    def __init__(self, u: tuple[float, float]) -> None:
        self._u = np.array(u)
        self.slacks: list[float] = []

    def reset(self) -> None:
        pass

    def filter(self, scene, u_rl, slack: float = 0.0, residual=None):
        self.slacks.append(slack)
        return SimpleNamespace(u=self._u)


def test_the_filter_gets_the_slack_and_its_action_is_the_one_executed(scene):
    config = DriverConfig(algorithm="rudc-t", slack_gain=2.0)
    agent = LearnedAgent("mine", config, _arrays(config.learner), (3.0, 5.0))
    recorder = Recorder((-6.0, 0.05))
    assert isinstance(agent.correction, CbfCorrection)
    agent.correction.filter = recorder  # pyright: ignore[reportAttributeAccessIssue] -- stands in for a filter
    choice = agent.choose(scene)
    assert recorder.slacks == [Slack(2.0 * 0.1, 3.0, 5.0)(choice.decision.sigma)]
    assert choice.action == pytest.approx(config.action_kind.normalised(np.array([-6.0, 0.05]), scene))
    assert choice.action[0] == -1.0
    assert choice.nominal[0] > -0.9
    agent.load(_arrays(config.learner))  # no percentiles known: the filter as it is
    agent.choose(scene)
    assert recorder.slacks[-1] == 0.0


@pytest.mark.parametrize(("algorithm", "kind"), [("rudc-t", "ttcbf"), ("rudc-e", "ecbf")])
def test_algorithms_bring_their_filter(scene, algorithm, kind):
    config = DriverConfig(algorithm=algorithm, filter_settings={"constrained": "all"})
    assert config.filter is not None
    assert (config.filter.rule, config.filter.constrained) == (kind, "all")
    agent = untrained(config)
    agent.reset(scene, 0)
    decision = agent.act(scene)
    assert decision.corrected is not None
    np.testing.assert_array_equal(decision.u, decision.corrected.u)
