"""The world on networks that RUDC does not ship: other speeds, arms of several edges, traffic lights."""

import re
import shlex
import subprocess
from collections import Counter

import numpy as np
import pytest

from rudc.agents.registry import make_agent
from rudc.env.episode import Episode
from rudc.errors import NetworkError, ScenarioError, SimulationError
from rudc.evaluation.preflight import try_out
from rudc.evaluation.rollout import run_episode
from rudc.network.build import build_network, find_netconvert
from rudc.network.network import load_network, shipped_networks
from rudc.scenario import load_scenario
from rudc.world.fitting import misfits
from rudc.world.world import World
from tests.plans import ALL_KINDS, PlanSource, event
from tests.world.networks import in_pieces, with_limits
from tests.world.test_world import follow

MIXED = {"north_in": 5.0, "north_out": 27.8, "east_in": 8.33, "east_out": 5.0, "south_in": 13.9}


def scenario_on(network, **changes):
    mix = {"traffic.mix": ALL_KINDS, "traffic.density": 30}
    return load_scenario("random_destination", {"network": str(network), **mix, **changes})


@pytest.mark.parametrize("limit", [1.5, 8.33, 27.8, "mixed"])
def test_drawn_speeds_fit_the_road(tmp_path, limit):
    """The drawn speeds are 6 to 10 m/s, the drawn speed factors 0.8 to 1.2."""
    path = with_limits(tmp_path, lambda edge: MIXED.get(edge, 13.9) if limit == "mixed" else limit)
    network, scenario = load_network(str(path)), scenario_on(path)
    assert try_out(scenario) == []
    with World(network) as world:
        for seed in range(4):
            scene = world.reset(scenario.plan(seed), ego_driver="sumo" if seed % 2 else "agent")
            allowed = network.speed_limit(world.route.edges[0])
            assert scene.ego.v == pytest.approx(min(world.plan.ego.speed_mps, allowed), abs=1e-3)
            for _ in range(30):
                world.advance(follow(world.scene(), 3.0))


@pytest.mark.parametrize("kind", ["bicycle", "truck"])
def test_whoever_an_event_puts_before_a_fast_ego_departs_no_faster_than_it_can(tmp_path, kind):
    slow = {
        "kind": "slow_vehicle",
        "vehicle": "leader",
        "speed": 2,
        "when": {"simulation_time": {"above": 1}},
    }
    changes = {
        "ego.speed": 27, "traffic.density": 0, "traffic.mix": {kind: 1}, "traffic.speed_factor": 1.5,
        "events": [slow],
    }  # fmt: skip
    network = with_limits(tmp_path, lambda edge: 27.8)
    assert try_out(scenario_on(network, **changes)) == []


def test_the_ego_starts_where_it_should_on_an_arm_of_several_edges(tmp_path):
    network = load_network(str(in_pieces(tmp_path)))
    outcomes = Counter()
    with World(network) as world:
        for i, arm in enumerate(arm.name for arm in network.arms):
            scenario = scenario_on(network.path, **{"ego.route": {"from": arm}, "traffic.density": 15})
            for driver in ("sumo", "gap-acceptance"):
                agent = make_agent(driver)
                scene = world.reset(scenario.plan(i), ego_driver=agent.ego_driver)
                front = scene.ego_s + 0.5 * scene.vehicle.length
                assert scene.route.stop_line_s - front == pytest.approx(world.plan.ego.distance_m, abs=0.5)
                outcomes[run_episode(Episode(world), scenario.plan(i), agent).outcome] += 1
    assert outcomes["success"] >= 7, outcomes


def test_traffic_lights_are_refused_wherever_one_drives(tmp_path):
    path = with_limits(tmp_path, lambda edge: 10.0, node_type="traffic_light")
    network, scenario = load_network(str(path)), scenario_on(path)
    with pytest.raises(
        NetworkError, match=r"junction 'centre' has traffic lights.*netconvert -s limited.net.xml"
    ):
        World(network)
    assert len(try_out(scenario)) == 1
    with pytest.raises(ScenarioError, match="traffic lights"):
        load_scenario("random_destination", {"network": str(path)}, misfits)


def test_what_is_said_about_traffic_lights_takes_them_away(tmp_path):
    source = shipped_networks()["four_way"].parent
    for part in source.glob("*.xml"):
        if not part.name.endswith(".net.xml"):
            text = part.read_text(encoding="utf-8").replace(
                'type="priority" radius', 'type="traffic_light" radius'
            )
            (tmp_path / part.name).write_text(text, encoding="utf-8")
    network = load_network(str(build_network(tmp_path)))
    with pytest.raises(NetworkError) as caught:
        network.refuse_lights()
    command = shlex.split(re.search(r"netconvert (.*)", str(caught.value)).group(1))
    subprocess.run([find_netconvert(), *command], cwd=tmp_path, check=True, capture_output=True)
    load_network(str(tmp_path / command[-1])).refuse_lights()


def test_what_sumo_refuses_is_said_with_its_place(world):
    world.reset(PlanSource(density=5.0, events=(event("sensor_noise", position=1),)).plan(0))
    with pytest.raises(
        SimulationError, match=r"network four_way.net.xml: SUMO could not slow .* \(nobody, 1.0, 1.0\)"
    ):
        world._sumo.slow_down("nobody", 1.0, 1.0)
    with pytest.raises(
        SimulationError, match=r"SUMO could not add a vehicle \(x, ego, car, 0, 5.0, 99.0\): .*too high"
    ):
        world._sumo.add("x", "ego", "car", 0, 5.0, 99.0)
    world.advance(np.zeros(2))
