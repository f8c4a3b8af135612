"""Names of drivers, and the filter behind them."""

import json

import numpy as np
import pytest

from rudc.agents.base import layers
from rudc.agents.checkpoint import load_learnt, shipped_checkpoints
from rudc.agents.correction import RESIDUAL
from rudc.agents.filtered import FilteredAgent, filters
from rudc.agents.guarded import GuardedAgent
from rudc.agents.registry import agent_names, agent_settings, agent_summary, make_agent
from rudc.errors import AgentError
from rudc.network.network import load_network
from rudc.safety.rules import RULES, Ttcbf
from rudc.vehicle import EgoVehicle
from tests.agents.conftest import Other


def test_every_name_makes_an_agent_of_that_name():
    for name in agent_names():
        agent = make_agent(name)
        assert agent.name == name
        assert agent.ego_driver == ("sumo" if name == "sumo" else "agent")
        assert agent_summary(name).endswith(".")
        json.dumps(agent_settings(name))


def test_filters_stand_behind_all_but_sumo():
    names = agent_names()
    assert set(names) - set(shipped_checkpoints()) == {
        "sumo", "follower", "gap-acceptance", "planner",
        "follower+ttcbf", "follower+ecbf", "gap-acceptance+ttcbf", "gap-acceptance+ecbf",
        "planner+ttcbf", "planner+ecbf",
    }  # fmt: skip
    assert agent_settings("follower+ecbf")["correction"]["rule"] == "ecbf"
    assert "correction" not in agent_settings("follower")


def test_a_residual_predictor_is_recorded_if_it_is_used():
    off, on = (agent_settings(f"follower+ttcbf:correction.residual={word}") for word in ("off", "on"))
    assert (off["correction"]["residual"], off["predictor"]) == (False, None)
    assert on["correction"]["residual"]
    assert on["predictor"] is not None


@pytest.mark.parametrize(
    ("wrong", "meant"),
    [
        ("gap_acceptance", "'gap-acceptance'"),
        ("folower", "'follower'"),
        ("follower+ttcbff", "'follower+ttcbf'"),
        ("gap-acceptance+ecfb", "'gap-acceptance+ecbf'"),
    ],
)
def test_a_typo_is_answered_with_what_was_meant(wrong, meant):
    with pytest.raises(AgentError, match="no agent") as caught:
        make_agent(wrong)
    assert f"did you mean {meant}" in str(caught.value)
    assert "there are: sumo, follower" in str(caught.value)


def test_a_typo_in_the_filter_behind_a_learnt_agent():
    with pytest.raises(AgentError, match=r"no filter 'ttcb' \(did you mean 'ttcbf'\?\)"):
        make_agent("rudc-t+ttcb")


def test_no_filter_behind_sumo():
    with pytest.raises(AgentError, match="SUMO itself drives"):
        make_agent("sumo+ttcbf")


@pytest.mark.parametrize("kind", filters())
def test_a_filtered_agent_reports_proposal_and_correction(kind, scene_on):
    row = load_network("four_way").route("south", "straight").row
    scene = scene_on("south", "straight", 60.0, 8.0, (Other(row, 72.0, 0.0),))
    agent = make_agent(f"follower+{kind}")
    assert isinstance(agent, FilteredAgent)
    agent.reset(scene, 0)
    decision = agent.act(scene)
    assert decision.corrected is not None
    np.testing.assert_allclose(decision.u - decision.u_rl, decision.corrected.correction)
    assert decision.u[0] < decision.u_rl[0] - 1.0, "the filter must brake for who stands 7 m ahead"
    assert decision.timing_ms["correction"] > 0.0


def test_what_is_known_by_a_name_takes_no_arguments():
    with pytest.raises(AgentError, match=r"what is known by a name takes no arguments"):
        make_agent("follower(speed=4)")


def test_a_rule_of_ones_own_stands_behind_any_driver(monkeypatch):
    monkeypatch.setitem(RULES, "halving", Ttcbf)
    agent = make_agent("follower+halving")
    assert isinstance(agent, FilteredAgent)
    assert agent_settings("follower+halving")["correction"]["rule"] == "halving"
    assert agent_summary("follower+halving").endswith("Behind it a safety filter with the rule halving.")
    with pytest.raises(AgentError, match=r"did you mean 'follower\+halving'\?"):
        make_agent("follower+halvin")


def test_settings_have_the_correction_that_a_filter_stands_behind():
    own, behind = agent_settings("usl"), agent_settings("usl+ttcbf")
    assert behind["own_correction"] == own["correction"]
    assert (behind["correction"]["kind"], own["correction"]["kind"]) == ("cbf", "usl")
    for name in ("gap-acceptance+ttcbf", "rudc-wo-cbf+ttcbf"):
        assert "own_correction" not in agent_settings(name)


def test_a_filter_leaves_an_empty_road_alone(scene_on):
    scene = scene_on("south", "straight", 60.0, 5.0)
    agent, bare = make_agent("follower+ttcbf"), make_agent("follower")
    agent.reset(scene, 0)
    bare.reset(scene, 0)
    decision = agent.act(scene)
    assert decision.corrected is not None
    assert decision.corrected.status == "nominal"
    np.testing.assert_allclose(decision.u, bare.act(scene).u)


@pytest.mark.parametrize("name", shipped_checkpoints())
def test_shipped_agents_carry_the_residual_predictor_of_their_own_actions(name):
    learnt = load_learnt(shipped_checkpoints()[name])
    carried = {k: v for k, v in learnt.arrays.items() if k.startswith(RESIDUAL)}
    wanted = learnt.config.correction.arrays(learnt.config.action)
    assert carried.keys() == wanted.keys()
    for key, array in wanted.items():
        np.testing.assert_array_equal(carried[key], array)


@pytest.mark.parametrize(
    "name", [n for n in shipped_checkpoints() if n.startswith(("rudc-t", "rudc-e", "only"))]
)
def test_the_ellipse_of_shipped_agents_follows_the_vehicle(name):
    """Their files name the half axes of the car that they were trained with."""
    of_vehicles = load_learnt(shipped_checkpoints()[name]).config.correction.barriers["vehicle"]
    assert of_vehicles.axes(EgoVehicle()) == (2.5, 1.0)
    assert of_vehicles.axes(EgoVehicle(length=12.0, width=2.5)) == (6.0, 1.35)


@pytest.mark.parametrize(
    ("name", "there"),
    [
        ("gap-acceptance", ["GapAcceptance"]),
        ("planner+ttcbf:outlook.plant=known", ["OutlookAgent", "FilteredAgent", "Planner"]),
        ("rudc-t", ["OutlookAgent", "LearnedAgent"]),
        ("examples/own_agent.py:Patient", ["GuardedAgent", "Patient"]),
    ],
)
def test_whoever_is_put_round_another_says_round_whom(name, there):
    assert [type(layer).__name__ for layer in layers(make_agent(name))] == there


def test_what_an_agent_of_ones_own_asks_beyond_the_vehicle_is_no_correction(scene_on):
    """Cut before a filter stands behind it: only what the filter changes counts."""
    scene = scene_on("south", "straight", 60.0, 5.0)

    class Wild:
        def reset(self, scene, seed):
            pass

        def act(self, scene):
            return 1e300, -30.0

    decision = GuardedAgent(Wild(), "wild").act(scene)
    body = scene.vehicle
    assert decision.u.tolist() == decision.u_rl.tolist() == [body.a_max, -body.delta_max]
