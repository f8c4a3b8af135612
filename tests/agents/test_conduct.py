"""Who behaves unlike ordinary traffic: scenes made by hand, and SUMO's own drivers."""

# ruff: noqa: F811 -- fixtures come by import
import math
from dataclasses import replace

import numpy as np
import pytest

from rudc.agents.conduct import BRAKES, LASTS_S, SPARE, TOLERATED, Conduct
from rudc.agents.registry import make_agent
from rudc.env.episode import Episode
from rudc.evaluation.rollout import run_episode
from rudc.network.network import load_network
from rudc.scenario import load_scenario
from rudc.world.bends import SHARE, curvatures
from rudc.world.ego import GRAVITY
from rudc.world.scene import Kind
from rudc.world.world import World
from tests.world.conftest import four_way, make_scene  # noqa: F401 -- fixtures
from tests.world.networks import bent, in_pieces, with_limits


@pytest.fixture(scope="module")
def oncoming(four_way):
    """A row of theirs."""
    return four_way.movement("north", "straight").rows[0]


def looks(scene, seconds=0.0, **changes):
    """What is found at the last of looks 0.1 s apart."""
    conduct = Conduct()
    for k in range(round(10 * seconds) + 1):
        found = conduct.look(replace(scene, time_s=0.1 * k, **changes))
    return found.tolist()


def test_who_is_off_the_lanes(make_scene, oncoming):
    walks = {"at": (0.0, -20.0, 0.0), "v": 1.2, "kind": Kind.PEDESTRIAN}
    scene = make_scene({"row": oncoming, "s": 60.0, "v": 9.0}, walks)
    assert looks(scene) == [False, True]


def test_who_is_fast(make_scene, four_way, oncoming):
    limit = float(four_way.paths.speed_limit[oncoming])
    speeds = limit, TOLERATED * limit + 0.9 * SPARE, TOLERATED * limit + 1.1 * SPARE
    scene = make_scene(*({"row": oncoming, "s": 20.0 + 30.0 * k, "v": v} for k, v in enumerate(speeds)))
    assert looks(scene) == [False, False, True]


def test_the_limit_is_that_of_the_road_that_somebody_is_on(make_scene, tmp_path):
    """Beyond the junction the limit before it was looked at: who left a slow road was fast for good."""
    network = load_network(with_limits(tmp_path, lambda edge: 13.9 if edge.startswith("south") else 5.0))
    (row, *_), paths = network.movement("north", "straight").rows, network.paths
    assert [limit for _, limit in paths.limits[row]] == [5.0, 13.9]
    places = float(paths.stop_s[row]) - 20.0, float(paths.exit_s[row]) + 20.0
    scene = make_scene(*({"row": row, "s": s, "v": 12.0} for s in places), network=network)
    assert looks(scene) == [True, False]


def test_each_edge_has_its_own_limit(make_scene, tmp_path):
    """The limit next to the junction was looked at all along an arm, here 13.9 m/s for 5."""
    network = load_network(in_pieces(tmp_path))
    (row, *_) = network.movement("north", "straight").rows
    assert [network.paths.limits[row][k][1] for k in (0, 2)] == [5.0, 13.9]
    scene = make_scene({"row": row, "s": 30.0, "v": 4.9}, {"row": row, "s": 60.0, "v": 10.0}, network=network)
    assert looks(scene, LASTS_S + 0.1) == [False, True]


def test_who_is_slow_for_a_bend_is_ordinary(make_scene, tmp_path):
    """On ice SUMO's drivers take the lane with the bend slowly: they were unusual for good."""
    network, odd = load_network(bent(tmp_path)), []
    curvature = curvatures(network)["north_out_0"]
    v = math.sqrt(SHARE * 0.1 * GRAVITY / curvature)
    for origin in ("south", "north"):
        (row, *_) = network.movement(origin, "straight").rows
        scene = make_scene({"row": row, "s": network.paths.exit_s[row] + 5.0, "v": v}, network=network)
        odd += looks(scene, LASTS_S + 0.1)
    assert odd == [False, True]


def test_who_brakes_hard_is_not_trusted_again_while_it_is_seen(make_scene, oncoming):
    conduct, scene = Conduct(), make_scene({"row": oncoming, "s": 60.0, "v": 9.0})
    hard = np.array([-BRAKES - 0.5])
    assert not conduct.look(replace(scene, acceleration=hard)).any()  # may be noise
    assert conduct.look(replace(scene, acceleration=hard)).all()
    assert conduct.look(scene).all()
    assert not conduct.look(make_scene()).any()
    assert not conduct.look(scene).any()


@pytest.mark.parametrize(
    ("s", "v", "ahead", "kind", "odd"),
    [
        (40.0, 3.0, None, Kind.CAR, True),
        (40.0, 3.0, None, Kind.BICYCLE, False),
        (40.0, 3.0, 60.0, Kind.CAR, False),  # behind somebody
        (110.0, 3.0, None, Kind.CAR, False),  # about to stop at its line
        (100.0, 0.0, None, Kind.CAR, True),  # stands before its line, for nobody
        (116.0, 0.0, None, Kind.CAR, False),  # at its line
        (125.0, 0.0, None, Kind.CAR, False),  # in the junction
        (100.0, 0.0, 107.0, Kind.CAR, False),
    ],
)
def test_who_is_slow_without_cause(make_scene, oncoming, s, v, ahead, kind, odd):
    others = [{"row": oncoming, "s": s, "v": v, "kind": kind}]
    if ahead is not None:
        others.append({"row": oncoming, "s": ahead, "v": 9.0})
    scene = make_scene(*others)
    assert looks(scene, LASTS_S - 0.3)[0] is False
    assert looks(scene, LASTS_S + 0.1)[0] is odd
    assert looks(scene, LASTS_S + 0.1, acceleration=np.full(len(others), 1.0))[0] is False


def drive(name, seed=0):
    """Names of those found in an episode of `planner`, and of those of whom its events took hold."""
    scenario, conduct, found, bodies = load_scenario(name), Conduct(), set(), set()
    with World(load_network(scenario.network, scenario.junction)) as world:

        def watch(scene, _decision, _result):
            found.update(scene.ids[i] for i in np.flatnonzero(conduct.look(scene)))
            bodies.update(*(event.bodies for event in world.happenings()))

        run_episode(Episode(world), scenario.plan(seed), make_agent("planner"), watch=watch)
    return found, bodies


@pytest.mark.parametrize("name", ["dense_left_turn", "random_destination", "roundabout_crossing"])
def test_ordinary_traffic_is_ordinary(name):
    """Now and then one of SUMO's sets off, and brakes at once in an emergency."""
    assert sum(len(drive(name, seed)[0]) for seed in range(6)) <= 1


@pytest.mark.parametrize(
    "name",
    [
        "sudden_brake",
        "crawling_leader",
        "wrong_way_driver",
        "crossing_cyclists",
        "stalled_truck",
        "jaywalkers",
    ],
)
def test_whom_events_take_hold_of_is_found(name):
    found, bodies = drive(name)
    assert bodies
    assert bodies <= found
