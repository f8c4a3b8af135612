"""A policy stands no longer than rules would; on scenes made by hand."""

# ruff: noqa: F811 -- fixtures come by import
from dataclasses import replace

import numpy as np
import pytest

from rudc.agents.base import Decision, Urged, layers
from rudc.agents.config import AgentConfig
from rudc.agents.learned import LearnedAgent, untrained
from rudc.agents.outlook import OutlookSettings, with_outlook
from rudc.agents.patience import PACE, PATIENCE, Patience
from rudc.agents.registry import make_agent
from rudc.training.calibration import Noting
from tests.world.conftest import four_way, make_scene  # noqa: F401 -- fixtures

BRAKES = np.array([-5.0, 0.1])


@pytest.fixture
def patience():
    return Patience()


def at(make_scene, v, waited_s, *others):
    return replace(make_scene(*others, front=-30.0, v=v), waited_s=waited_s)


def test_it_sets_off_where_a_driver_by_rules_would_and_no_faster_than_at_walking_pace(make_scene, patience):
    assert patience.urge(at(make_scene, 0.0, PATIENCE - 0.1), BRAKES) is BRAKES
    a, delta = patience.urge(at(make_scene, 0.0, PATIENCE), BRAKES)
    assert a > 0.5
    assert delta == BRAKES[1], "steering is the policy's"
    assert patience.urge(at(make_scene, PACE - 0.5, 0.0), BRAKES)[0] > 0.0, "it goes on while it moves"
    assert -0.5 < patience.urge(at(make_scene, PACE, 0.0), BRAKES)[0] <= 0.0
    wants = np.array([2.5, 0.0])
    assert patience.urge(at(make_scene, PACE + 1.0, 0.0), wants) is wants
    assert patience.urge(at(make_scene, PACE + 1.0, 0.0), BRAKES) is BRAKES, "then the policy has it back"


def test_rules_that_stop_it_end_it(make_scene, patience, four_way):
    row = four_way.movement("south", "straight").rows[0]
    leader = {"row": row, "s": float(four_way.paths.stop_s[row]) - 30.0 + 2.5 + 1.0, "v": 0.0}
    assert patience.urge(at(make_scene, 0.0, PATIENCE, leader), BRAKES) is BRAKES
    assert patience.urge(at(make_scene, 0.0, PATIENCE), BRAKES)[0] > 0.0
    assert patience.urge(at(make_scene, 2.0, 0.0, leader), BRAKES) is BRAKES
    assert patience.urge(at(make_scene, 2.0, 0.0), BRAKES) is BRAKES, "until it has waited anew"


class Still(Urged):
    """Stands for good; keeps what it was shown."""

    name = "still"
    ego_driver = "agent"

    def reset(self, scene, seed):
        self.changed = 0

    def act(self, scene):
        u = np.array([-3.0, 0.0])
        changed = u if self.urge is None else self.urge(scene, u)
        self.changed += changed is not u
        return Decision(changed, changed)


@pytest.mark.parametrize("course", [True, False])
def test_with_courses_the_policy_is_urged_on_them_and_off(make_scene, course):
    """Who goes round nothing waits for as long as it wants."""
    scene, still = at(make_scene, 0.0, PATIENCE), Still()
    agent = with_outlook(still, "still", OutlookSettings(course=course, plant="estimated"))
    agent.reset(scene, 0)
    assert (agent.act(scene).u[0] > 0.0) == course
    if not course:
        assert still.urge is None
        return
    agent.outlook.courses.course = scene.route
    assert agent.act(scene).u[0] > 0.0
    assert still.changed == 2
    assert still.urge is None, "whoever drives it without an outlook has its own proposals"


def test_an_own_agent_may_call_something_of_its_own_urge(make_scene):
    class Own:
        name = "own"
        ego_driver = "agent"

        def reset(self, scene, seed):
            pass

        def urge(self):
            return np.array([1.0, 0.0])

        def act(self, scene):
            return Decision(self.urge(), self.urge())

    agent = with_outlook(Own(), "own", OutlookSettings(course=True))
    scene = make_scene(front=-30.0, v=3.0)
    agent.reset(scene, 0)
    for k in range(2):
        assert agent.act(replace(scene, time_s=0.1 * k)).u_rl.tolist() == [1.0, 0.0]


def test_learnt_agents_are_urged_before_they_are_corrected(make_scene):
    """The correction decides about what the policy did not propose, too."""
    agent = untrained(AgentConfig(algorithm="rudc-t", correction={"kind": "cbf", "rule": "ttcbf"}))
    scene = make_scene(front=-30.0, v=8.0)
    ahead = scene.ego.y + 9.0
    scene = make_scene({"at": (scene.ego.x, ahead, 0.5 * np.pi)}, front=-30.0, v=8.0)
    agent.reset(scene, 0)
    agent.urge = lambda scene, u: np.array([1.5, 0.0])
    decision = agent.act(scene)
    assert decision.u_rl.tolist() == [1.5, 0.0]
    assert decision.u[0] < -2.0


@pytest.mark.parametrize("name", ["rudc-t", "sac+ttcbf"])
def test_so_are_those_with_a_filter_behind_them(name):
    found = [layer for layer in layers(make_agent(name)) if isinstance(layer, Urged)]
    assert len(found) == 1
    assert isinstance(found[0], LearnedAgent)


def test_calibration_hears_a_policy_that_is_urged():
    """Sigma's limits are those of the agent as it drives."""
    agent = untrained(AgentConfig(algorithm="rudc-t"))
    assert [layer for layer in layers(Noting(agent)) if isinstance(layer, Urged)] == [agent]


def test_a_policy_is_not_taken_to_have_done_what_it_was_urged_to(make_scene):
    agent = untrained(AgentConfig(algorithm="sac", correction={"kind": "none"}))
    scene = make_scene(front=-30.0, v=8.0)
    agent.reset(scene, 0)
    assert np.array_equal(agent.choose(scene).executed, agent.choose(scene).proposed)
    agent.urge = lambda scene, u: np.array([1.5, 0.0])
    chosen = agent.choose(scene)
    assert agent.config.action.u_of(chosen.executed, scene) == pytest.approx([1.5, 0.0], abs=1e-5)
    assert not np.array_equal(chosen.executed, chosen.proposed)
