"""A learnt policy at the wheel: what it proposes, how sure it is, what the filter makes of it."""

import math

import numpy as np
import pytest

from rudc.agents.config import AgentConfig
from rudc.agents.correction import CbfCorrection
from rudc.agents.learned import LearnedAgent, untrained
from rudc.env.observation import observe_flat
from rudc.learning.inference import Decider
from rudc.learning.parameters import grouped, policy_arrays, twin_arrays
from rudc.safety.corrected import Corrected
from rudc.safety.slack import Slack
from tests.agents.conftest import Other
from tests.agents.learners import NETWORK, arrays_of, small


@pytest.fixture
def scene(scene_on):
    return scene_on("south", "left", 50.0, 8.0, (Other(0, 30.0, 8.0), Other(3, 40.0, 6.0)))


@pytest.mark.parametrize("observation", ["paper", "conflict"])
def test_drives_by_the_policys_mean_and_says_how_sure_it_is(scene, observation):
    config = small(observation=observation)
    arrays = arrays_of(config)
    agent = LearnedAgent("mine", config, arrays)
    agent.reset(scene, 0)
    choice, decision = agent.choose(scene), agent.act(scene)
    decider, seen = Decider(config.learner, config.problem().layout, arrays), observe_flat(scene, observation)
    action = decider.action(seen)
    unsure = decider.uncertainty(seen, action)
    assert unsure is not None
    np.testing.assert_array_equal(choice.proposed, action)
    np.testing.assert_array_equal(choice.executed, choice.proposed)
    np.testing.assert_array_equal(decision.u, config.action.physical(action, scene))
    np.testing.assert_array_equal(decision.u, decision.u_rl)
    assert decision.sigma == pytest.approx(float(unsure.total))
    assert decision.corrected is None
    assert set(decision.timing_ms) == {"observation", "policy", "critic", "correction"}


def test_explores_with_a_generator_only(scene):
    agent = untrained(small())
    rng = np.random.default_rng(0)
    drawn = np.array([agent.choose(scene, rng).proposed for _ in range(300)])
    still = np.array([agent.choose(scene).proposed for _ in range(3)])
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

    def filter(self, scene, u_rl, slack: float = 0.0, residual=None, rate: float = 0.0):
        self.slacks.append(slack)
        return Corrected(self._u, self._u - u_rl, "solved")


def test_the_filter_gets_the_slack_and_its_action_is_the_one_executed(scene):
    config = small("rudc-t", correction={"kind": "cbf", "slack": {"gain": 2.0}})
    agent = LearnedAgent("mine", config, arrays_of(config), (3.0, 5.0))
    recorder = Recorder((-6.0, 0.05))
    assert isinstance(agent.correction, CbfCorrection)
    agent.correction.filter = recorder  # pyright: ignore[reportAttributeAccessIssue] -- stands in for a filter
    choice = agent.choose(scene)
    assert recorder.slacks == [Slack(2.0 * 0.1, 3.0, 5.0)(choice.decision.sigma)]
    assert choice.decision.corrected is not None
    assert choice.decision.corrected.slack == recorder.slacks[0]
    assert choice.executed == pytest.approx(config.action.normalised(np.array([-6.0, 0.05]), scene))
    assert choice.executed[0] == -1.0
    assert choice.proposed[0] > -0.9
    agent.load(arrays_of(config))  # no percentiles known: the filter as it is
    agent.choose(scene)
    assert recorder.slacks[-1] == 0.0


@pytest.mark.parametrize("rule", ["ttcbf", "ecbf"])
def test_what_corrects_its_actions_is_a_setting(scene, rule):
    config = small(correction={"kind": "cbf", "rule": rule, "constrained": "all"})
    agent = untrained(config)
    assert isinstance(agent.correction, CbfCorrection)
    assert agent.correction.filter.config.rule == rule
    agent.reset(scene, 0)
    decision = agent.act(scene)
    assert decision.corrected is not None
    np.testing.assert_array_equal(decision.u, decision.corrected.u)


def test_drives_where_critics_state_no_sigma(scene):
    config = AgentConfig.model_validate(
        {"algorithm": "sac", "learner": {"policy": NETWORK, "critic": NETWORK}}
    )
    problem = config.problem()
    arrays = grouped(
        policy=policy_arrays(config.learner, problem), critic=twin_arrays(config.learner, problem)
    )
    agent = LearnedAgent("mine", config, arrays)
    assert math.isnan(agent.act(scene).sigma)
