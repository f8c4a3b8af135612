"""`vehicle: {from: ARM, turn: TURN}`: whom it selects, and who is added for it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rudc.errors import ScenarioError
from rudc.evaluation.preflight import never_happening
from rudc.geometry import rectangle_gaps
from rudc.scenario import load_scenario
from rudc.scenario.selectors import ByArm
from rudc.world.casting import selected
from rudc.world.events.selection import pick, towards_junction
from rudc.world.fitting import misfits
from rudc.world.scene import Kind
from tests.plans import PlanSource, event

QUIET = PlanSource(density=0.0, origin="south", turn="straight", speed=(8.0, 8.0))
RNG = np.random.default_rng(0)


def brake(**arm):
    return event("hard_brake", vehicle=arm, when={"simulation_time": {"above": 100.0}})


def by(origin, turn=None):
    return ByArm(origin=origin, turn=turn)


def test_each_is_asked_for_once():
    near = event("density_surge", density=5, when={"time_headway": {"vehicle": {"from": "east"}, "below": 2}})
    events = brake(**{"from": "north", "turn": "left"}), near, brake(**{"from": "east"})
    assert selected(events) == [by("north", "left"), by("east")]


@pytest.mark.parametrize("turn", ["left", "straight", "right"])
@pytest.mark.parametrize("origin", ["north", "east", "west"])
def test_one_is_added_that_comes_so_about_when_the_ego_does(world, origin, turn):
    """Whether its way crosses the ego's or not."""
    for seed in range(2):
        source = replace(QUIET, events=(brake(**{"from": origin, "turn": turn}),))
        scene = world.reset(source.plan(seed))
        (row,) = pick(scene, by(origin, turn), RNG)
        driver = world.traffic.drivers[scene.ids[row]]
        movement = scene.network.movement(driver.origin, driver.destination)
        assert (movement.origin, movement.turn) == (origin, turn)
        due = towards_junction(scene, by(origin, turn))[row]
        assert -1.5 < due - (scene.route.stop_line_s - scene.ego_s) / scene.ego.v < 6.0


def test_nobody_is_added_where_one_comes_or_on_the_egos_own_arm(world):
    added = brake(**{"from": "south"})
    assert world.reset(replace(QUIET, events=(added,)).plan(0)).count == 0
    general = brake(**{"from": "east"}), brake(**{"from": "east", "turn": "left"})
    for seed in range(4):
        scene = world.reset(replace(QUIET, events=general).plan(seed))
        assert scene.count == 1, "who turns left comes from there, too"


def test_its_type_may_be_named_too(world):
    """A car that comes first is not chosen, and does not serve instead of a bus."""
    events = brake(**{"from": "west", "type": "bus"}), brake(**{"from": "west", "type": "car"})
    for seed in range(3):
        scene = world.reset(replace(QUIET, events=events).plan(seed))
        kinds = []
        for kind in ("bus", "car"):
            (row,) = pick(scene, ByArm(origin="west", type=kind), RNG)
            kinds.append(Kind(int(scene.kind[row])))
        assert kinds == [Kind.BUS, Kind.CAR]
        assert not pick(scene, ByArm(origin="west", type="truck"), RNG)
        assert len(pick(scene, by("west"), RNG)) == 1


def test_two_on_one_arm_keep_their_distance(world):
    """Of those that turn left and go straight, who start on neighbouring lanes or behind each other."""
    both = brake(**{"from": "east", "turn": "straight"}), brake(**{"from": "east", "turn": "left"})
    for seed in range(6):
        scene = world.reset(replace(QUIET, events=both).plan(seed))
        assert scene.count == 2
        gaps = rectangle_gaps(
            *scene.position[0], scene.heading[0], *scene.size[0],
            scene.position[1:], scene.heading[1:], scene.size[1:],
        )  # fmt: skip
        assert gaps[0] > 5.0


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ({"from": "east", "turn": "left"}, {"from": "east", "turn": "left", "type": "bus"}),
        ({"from": "east"}, {"from": "east", "type": "bus"}),
    ],
)
def test_one_that_is_asked_for_in_particular_serves_those_who_ask_for_less(world, first, second):
    for seed in range(4):
        scene = world.reset(replace(QUIET, events=(brake(**first), brake(**second))).plan(seed))
        assert [Kind(int(kind)) for kind in scene.kind] == [Kind.BUS]


def test_one_of_the_traffic_that_is_due_serves(world):
    """Where it comes so anyway, nobody is added."""
    served = 0
    for seed in range(12):
        busy = replace(QUIET, density=30.0)
        alone = world.reset(busy.plan(seed))
        due = towards_junction(alone, by("east")) - (alone.route.stop_line_s - alone.ego_s) / alone.ego.v
        asked = world.reset(replace(busy, events=(brake(**{"from": "east"}),)).plan(seed))
        soon = bool(((due > 0.0) & (due < 4.0)).any())
        served += soon
        if soon:
            assert asked.count == alone.count, seed
    assert served > 2


def test_the_first_at_its_stop_line_is_chosen_of_those_that_cross_the_egos_way_if_any_does(world):
    crossed = 0
    for seed in range(6):
        scene = world.reset(replace(QUIET, density=40.0).plan(seed))
        paths, conflicts = scene.network.paths, scene.network.conflict(scene.route)
        svs = np.flatnonzero(scene.path >= 0)
        for arm in ("north", "east", "west"):
            index = [known.name for known in scene.network.arms].index(arm)
            before = paths.stop_s[scene.path[svs]] - scene.path_s[svs]
            comes = svs[(paths.origin[scene.path[svs]] == index) & (before > 0.0)].tolist()
            across = [i for i in comes if not math.isnan(conflicts[scene.path[i], 0])]
            found = pick(scene, by(arm), RNG)
            if not comes:
                assert not found
                continue
            due = {
                i: (paths.stop_s[scene.path[i]] - scene.path_s[i]) / max(math.hypot(*scene.velocity[i]), 0.5)
                for i in across or comes
            }
            assert found == [min(due, key=due.__getitem__)], (seed, arm)
            crossed += bool(across)
    assert crossed > 5


def test_arms_and_turns_that_the_network_lacks_are_said_each_once():
    events = [
        {"kind": "hard_brake", "vehicle": {"from": "nroth", "turn": "left"}},
        {
            "kind": "hard_brake",
            "vehicle": {"from": {"choice": ["east", "south"]}, "turn": {"choice": ["right", "straight"]}},
        },
        {"kind": "hard_brake", "when": {"time_headway": {"vehicle": {"from": "north"}, "below": 2}}},
    ]
    groups = [
        {"reach_position": {"lane": "north_in_0", "at": 5}},
        {"time_headway": {"vehicle": {"from": "nrth"}, "below": 2}},
    ]
    events.append({"kind": "hard_brake", "when": {"any": groups}})
    with pytest.raises(ScenarioError) as error:
        load_scenario("random_destination", {"network": "t_junction", "events": events}, misfits)
    said = str(error.value)
    assert "events.0.vehicle.from: no arm 'nroth'" in said
    assert "events.1.vehicle.turn: network t_junction: no way leads straight from south" in said
    assert "events.1.vehicle.turn: network t_junction: no way leads right from east" in said
    assert "events.2.when.time_headway.vehicle.from: no arm 'north'" in said
    assert "events.3.when.any.0.reach_position.lane: no lane 'north_in_0'" in said
    assert "events.3.when.any.1.time_headway.vehicle.from: no arm" in said
    assert len(said.splitlines()) == 6


def test_one_whose_turn_is_named_takes_no_other_where_its_way_is_blocked(world):
    """It was sent another way, and the event found nobody to act on."""
    wreck = event("accident", vehicles=[{"lane": f"north_out_{k}", "at": 15} for k in (0, 1)])
    asked = brake(**{"from": "west", "turn": "left"})
    standing = replace(QUIET, turn="left", speed=(0.0, 0.0), events=(wreck, asked))
    for keeps in (True, False):
        scene = world.reset(standing.plan(0))
        (row,) = pick(scene, by("west", "left"), RNG)
        driver = world.traffic.drivers[scene.ids[row]]
        assert (driver.destination, driver.keeps_turn) == ("north", True)
        driver.keeps_turn = keeps
        for _ in range(80):
            world.advance(np.array([-6.0, 0.0]))
        assert (driver.destination == "north") is keeps


@pytest.mark.parametrize(
    ("origin", "kind", "warned"),
    [
        ("south", "truck", True),
        ("south", {"choice": ["truck", "bus"]}, True),
        ("south", {"choice": ["truck", "car"]}, False),
        ("south", None, False),
        ("east", "truck", False),
    ],
)
def test_a_kind_that_never_comes_by_the_egos_own_arm_is_warned_of(origin, kind, warned):
    vehicle = {"from": origin, **({} if kind is None else {"type": kind})}
    route = {"from": "south", "turn": "left"}

    def said(event):
        return never_happening(load_scenario("random_destination", {"ego.route": route, "events": [event]}))

    found = said({"kind": "hard_brake", "vehicle": vehicle})
    assert [("on the ego's own arm none is added" in text) for text in found] == [True] * warned
    group = {"any": [{"time_headway": {"vehicle": vehicle, "below": 2}}, {"speed": {"above": 1}}]}
    assert said({"kind": "density_surge", "density": 5, "when": group}) == [], "the other group may hold"
