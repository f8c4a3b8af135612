"""A vehicle that a scenario's events select is on the road when the ego starts, and keeps its role."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rudc.geometry import rectangle_gaps
from rudc.scenario import load_scenario
from rudc.world.casting import selected
from rudc.world.events.selection import comes_from, pick
from rudc.world.scene import Kind
from rudc.world.spawn import safe_to_start
from tests.plans import PlanSource, constant, event
from tests.world.networks import bent
from tests.world.test_world import follow

LATER = {"simulation_time": {"above": 100.0}}
QUIET = PlanSource(density=0.0, turn="left", speed=(8.0, 8.0))
ICE = event("low_friction", friction=0.15)
RNG = np.random.default_rng(0)


def brake(selector):
    return event("hard_brake", vehicle=selector, when=LATER)


def test_what_events_and_their_triggers_select():
    near = event("density_surge", density=5, when={"time_headway": {"vehicle": "follower", "below": 2}})
    stands = event("stalled_vehicle", lane="east_out_0", at=20)
    assert selected((brake("oncoming"), near, stands, brake("oncoming"))) == ["oncoming", "follower"]


def test_a_leader_leads_through_the_junction_whether_it_was_there_or_was_added(world):
    for density in (0.0, 15.0):
        for seed in range(6):
            scene = world.reset(replace(QUIET, density=density, events=(brake("leader"),)).plan(seed))
            leader = scene.ids[pick(scene, "leader", RNG)[0]]
            driver = world.traffic.drivers[leader]
            assert (driver.origin, driver.destination) == (world.route.origin, world.route.destination)
            while scene.time_s < 6.0:
                here = pick(scene, "leader", RNG)
                assert [scene.ids[i] for i in here] == [leader], (density, seed, scene.time_s)
                assert world.advance(follow(scene, 4.0)).collision is None
                scene = world.scene()


def test_who_is_before_an_ego_that_creeps_is_its_leader_too(world):
    """10 m before one at 1 m/s it was not, and left no room for another."""
    source = replace(QUIET, density=25.0, origin="south", speed=(1.0, 1.0), distance=(60.0, 60.0))
    for seed in range(6):
        scene = world.reset(replace(source, events=(brake("leader"),)).plan(seed))
        leader = world.traffic.drivers[scene.ids[pick(scene, "leader", RNG)[0]]]
        assert leader.keeps_lane, seed
        assert (leader.origin, leader.destination) == (world.route.origin, world.route.destination)


@pytest.mark.parametrize("seed", [14, 53])
def test_who_has_begun_to_turn_elsewhere_is_not_made_the_leader(world, seed):
    """Long vehicles whose front is in the junction already, and whose middle is not."""
    changes = {
        "events": [{"kind": "slow_vehicle", "vehicle": "leader", "speed": 2}],
        "traffic": {"density": 40, "mix": {"truck": 1, "bus": 1}},
        "ego": {"route": {"from": "east", "turn": "left"}, "distance": 20, "speed": 4},
    }
    world.reset(load_scenario("random_destination", changes).plan(seed))


def test_a_leader_that_is_slower_is_added_where_the_ego_can_stop_behind_it(world):
    """On ice: it was as near as one that drives as fast as the ego."""
    for factor in (0.8, 1.0):
        source = replace(
            QUIET,
            speed=(10.0, 10.0),
            speed_factor=constant(factor),
            distance=(60.0, 60.0),
            events=(brake("leader"), ICE),
        )
        for seed in range(3):
            scene = world.reset(source.plan(seed))
            assert world.plan.attempt == 0
            assert safe_to_start(scene), (factor, seed)


def test_a_follower_is_added_behind_at_a_safe_distance(world):
    for seed in range(4):
        scene = world.reset(replace(QUIET, events=(brake("follower"),)).plan(seed))
        (row,) = pick(scene, "follower", RNG)
        gap = math.hypot(*(scene.position[row] - scene.ego_position)) - 5.0
        assert 2.0 + 0.5 * scene.ego.v < gap < 2.0 + 3.0 * scene.ego.v


def test_one_is_not_late_for_an_ego_that_starts_from_rest(world):
    """An ego that speeds up with 2 m/s2 to 10 m/s is at its stop line, 40 m ahead, after 6.5 s."""
    source = replace(QUIET, speed=(0.0, 0.0), distance=(40.0, 40.0), events=(brake("crossing"),))
    for seed in range(4):
        scene = world.reset(source.plan(seed))
        (row,) = pick(scene, "crossing", RNG)
        way = scene.network.paths.stop_s[scene.path[row]] - scene.path_s[row]
        assert 5.0 < way / math.hypot(*scene.velocity[row]) < 12.0


@pytest.mark.parametrize("selector", ["oncoming", "crossing"])
def test_one_from_another_arm_reaches_its_stop_line_about_when_the_ego_does(world, selector):
    for seed in range(4):
        scene = world.reset(replace(QUIET, events=(brake(selector),)).plan(seed))
        (row,) = pick(scene, selector, RNG)
        path = scene.path[row]
        assert not math.isnan(scene.network.conflict(scene.route)[path, 0]), "it crosses the ego's path"
        due = (scene.network.paths.stop_s[path] - scene.path_s[row]) / math.hypot(*scene.velocity[row])
        ego_due = (scene.route.stop_line_s - scene.ego_s) / scene.ego.v
        assert -1.5 < due - ego_due < 6.0


@pytest.mark.parametrize(("selector", "turn"), [("oncoming", "left"), ("crossing", "right")])
def test_traffic_that_does_not_cross_the_egos_path_is_no_reason_to_add_nobody(world, selector, turn):
    source = replace(QUIET, density=12.0, origin="south", turn=turn, events=(brake(selector),))
    for seed in range(8):
        scene = world.reset(source.plan(seed))
        (row,) = pick(scene, selector, RNG)
        assert not math.isnan(scene.network.conflict(scene.route)[scene.path[row], 0]), seed


def test_several_from_one_arm_are_added_one_behind_the_other(world):
    """Where the first stood in the only places that were tried, the next was left out."""
    events = tuple(brake({"from": "north", "type": kind}) for kind in ("bus", "truck"))
    for seed in range(8):
        scene = world.reset(replace(QUIET, origin="west", turn="straight", events=events).plan(seed))
        assert {Kind.BUS, Kind.TRUCK} == {*scene.kind.tolist()}, seed


@pytest.mark.parametrize("turn", ["left", "straight", "right"])
def test_who_is_added_turns_as_the_traffic_does(world, turn):
    source = replace(QUIET, origin="south", turn="left", turns={turn: 1.0})
    source = replace(source, events=(brake({"from": "north"}),))
    for seed in range(4):
        scene = world.reset(source.plan(seed))
        (row,) = np.flatnonzero(scene.path >= 0)
        assert scene.path[row] in world.network.movement("north", turn).rows, seed


@pytest.mark.parametrize(("selector", "origin"), [("oncoming", "north"), ("crossing", "east")])
def test_where_an_arm_bends_its_heading_at_the_stop_line_counts(world_on, tmp_path, selector, origin):
    network = str(bent(tmp_path))
    source = replace(QUIET, network=network, origin="south", turn="left", events=(brake(selector),))
    found = set()
    for seed in range(6):
        scene = world_on(network).reset(source.plan(seed))
        (row,) = pick(scene, selector, RNG)
        found.add(scene.network.arms[scene.network.paths.origin[scene.path[row]]].name)
    assert origin in found
    assert found <= ({"north"} if selector == "oncoming" else {"east", "west"})


def test_without_such_events_nothing_is_added(world):
    assert world.reset(replace(QUIET, events=(brake("nearest"),)).plan(0)).count == 0


def test_where_the_network_has_no_such_arm_the_episode_begins_all_the_same(world_on):
    world = world_on("t_junction")
    source = replace(QUIET, network="t_junction", origin="south", events=(brake("oncoming"),))
    assert world.reset(source.plan(0)).count == 0


@pytest.mark.parametrize(
    ("distance", "at", "led"), [(40.0, 18.0, False), (60.0, 25.0, False), (80.0, 15.0, True)]
)
def test_a_leader_is_added_only_where_it_can_stop_before_what_stands_in_its_lane(world, distance, at, led):
    """It was put 2.4 m behind a stalled car, at 10 m/s; where it overlapped it, the start was drawn again."""
    stalled = event("stalled_vehicle", lane="ego_in", at=at)
    source = replace(
        QUIET, turn="straight", origin="south", speed=(10.0, 10.0), distance=(distance, distance)
    )
    for seed in range(4):
        scene = world.reset(replace(source, events=(stalled, brake("leader"))).plan(seed))
        assert world.plan.attempt == 0
        driven = np.flatnonzero(scene.path >= 0)
        assert len(driven) == led
        for row in driven:
            assert gap_to_things(scene, row) > 2.0 + 10.0**2 / 8.0


def test_nobody_is_added_inside_a_long_closure(world):
    """Only the distance to its middle counted."""
    closed = [event("lane_closure", lane=f"north_in_{k}", at=12.0, length=80.0) for k in (0, 1)]
    for seed in range(4):
        source = replace(QUIET, origin="south", events=(*closed, brake("oncoming")))
        scene = world.reset(source.plan(seed))
        assert world.plan.attempt == 0
        assert all(gap_to_things(scene, row) > 2.0 for row in np.flatnonzero(scene.path >= 0))


def gap_to_things(scene, row):
    """m from a vehicle to the nearest thing that stands on the road."""
    things = scene.path < 0
    others = scene.position[things], scene.heading[things], scene.size[things]
    (x, y), (length, width) = scene.position[row], scene.size[row]
    return rectangle_gaps(x, y, scene.heading[row], length, width, *others).min()


@pytest.mark.parametrize(
    ("degrees", "crossing", "oncoming"),
    [
        ([0, 90, 180, 270], [1, 3], [2]),
        ([0, 40, 180, 220], [1, 3], [2, 3]),
        ([0, 30, 180], [1], [2]),
        ([0, 150], [], [1]),
        ([0, 35], [1], []),
    ],
)
def test_who_crosses_comes_from_the_sides_or_from_acute_arms_where_none_lies_to_a_side(
    degrees, crossing, oncoming
):
    paths = SimpleNamespace(stop_heading=np.radians(degrees), origin=np.arange(len(degrees)))
    scene = SimpleNamespace(network=SimpleNamespace(paths=paths), route=SimpleNamespace(row=0))
    assert np.flatnonzero(comes_from(scene, "crossing")).tolist() == crossing
    assert np.flatnonzero(comes_from(scene, "oncoming")).tolist() == oncoming
