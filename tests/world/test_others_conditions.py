"""Conditions about other vehicles and about what events have put on the road."""

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from rudc.evaluation.preflight import never_happening
from rudc.scenario import register_event
from rudc.scenario.events import Event, registry
from rudc.scenario.events.event import Effect
from rudc.world.events import event_lines
from tests.plans import PlanSource, event
from tests.scenario.test_errors import check, problems
from tests.scenario.test_json_schema import SCHEMA, valid
from tests.scenario.test_plan import scenario

__all__ = ["problems"]

CALM = PlanSource(density=25.0, speed=(0.0, 0.0))
"""the ego stands on its arm and watches"""
STAND = np.array([-6.0, 0.0])
BED = {"kind": "vehicle_crossing", "name": "bed", "arm": "ego_in", "at": 10, "speed": 1.0, "size": [2.2, 1.0]}


def until(world, source, seconds, u=STAND):
    """The scenes of an episode up to that in which the density is 50, and that one."""
    scenes = [world.reset(source.plan(0))]
    while world.traffic.density < 50 and scenes[-1].time_s < seconds:
        world.advance(u)
        scenes.append(world.scene())
    return scenes


def surge(**when):
    return event("density_surge", density=50, when=when)


def test_another_vehicle_reaches_a_place(world):
    at = {"lane": "south_in_0", "at": 12, "tolerance": 3}
    source = replace(CALM, origin="south", turn="straight", density=0.0, distance=(60.0, 60.0))
    reached = until(world, replace(source, events=(surge(reach_position={"vehicle": "leader", **at}),)), 20.0)
    assert world.traffic.density == 50
    x, y, _ = world.network.place_on_lane("south_in_0", 12.0)
    gaps = [np.hypot(*(scene.position - (x, y)).T).min() for scene in reached[-3:-1]]
    assert gaps[1] < 3.0 < gaps[0]
    assert reached[-1].ego.v == 0.0, "the ego itself is far from there"
    until(world, replace(source, events=(surge(reach_position=at),)), 8.0)
    assert world.traffic.density != 50


def test_another_vehicle_is_slow(world):
    source = replace(CALM, origin="south", turn="straight", density=0.0, speed=(8.0, 8.0))
    source = replace(source, distance=(60.0, 60.0))
    brake = event("hard_brake", vehicle="leader", deceleration=6.0, when={"simulation_time": {"above": 1}})
    slow = surge(speed={"vehicle": "leader", "below": 2})
    *_, before, last = until(world, replace(source, events=(brake, slow)), 10.0, u=np.zeros(2))
    assert world.traffic.density == 50
    assert 1.0 < last.time_s < 6.0
    assert before.speed.min() < 2.0


def test_the_ego_is_near_to_what_an_event_has_put_on_the_road(world):
    source = replace(CALM, origin="south", turn="straight", density=0.0, speed=(8.0, 8.0))
    source = replace(source, distance=(45.0, 45.0))
    near = surge(relative_distance={"event": 0, "below": 20})
    stalled = event("stalled_vehicle", lane="north_in_0", at=30)
    scenes = until(world, replace(source, events=(event(**BED), stalled, near)), 8.0, u=np.zeros(2))
    assert world.traffic.density == 50
    ego, bed = scenes[-2].ego, scenes[-2].ids.index("vehicle_crossing0:0")
    assert np.hypot(*(scenes[-2].position[bed] - (ego.x, ego.y))) < 20.0
    ego = scenes[-3].ego
    assert np.hypot(*(scenes[-3].position[bed] - (ego.x, ego.y))) >= 20.0


def test_of_several_things_the_nearest_counts(world):
    """Two stand 15 and 45 m before the ego: it is not farther than 30 m from them."""
    source = replace(CALM, origin="south", turn="straight", density=0.0, distance=(60.0, 60.0))
    two = event("accident", vehicles=[{"lane": "south_in_1", "at": at, "type": "car"} for at in (45, 15)])
    for above, expected in ((10, True), (30, False)):
        far = surge(relative_distance={"event": 0, "above": above})
        until(world, replace(source, events=(two, far)), 2.0)
        assert (world.traffic.density == 50) == expected


class Kite2(Event, frozen=True):
    """A kite."""

    kind: Literal["kite2"]


class Kite2Effect(Effect[Kite2]):
    """It lies on the road."""

    def begin(self, stage):
        stage.stand(f"{self.name}:0", "obstacle", stage.pose_on_lane("south_in_1", 20.0), (1.0, 1.0))
        return True


def test_an_event_of_ones_own_may_be_called_as_it_likes(world, monkeypatch):
    assert registry.EVENT_KINDS, "found once a process: before their table is copied"
    monkeypatch.setattr(registry, "_REGISTERED", dict(registry._REGISTERED))
    register_event(Kite2, Kite2Effect)
    source = replace(CALM, origin="south", turn="straight", density=0.0, distance=(60.0, 60.0))
    near = surge(relative_distance={"event": 0, "below": 60})
    until(world, replace(source, events=(Kite2(kind="kite2"), near)), 2.0)
    assert world.traffic.density == 50


def test_an_event_that_puts_nothing_on_the_road_is_never_near():
    for kind in ({"kind": "low_friction", "friction": 0.5}, {"kind": "density_surge", "density": 50}):
        near = {"kind": "hard_brake", "when": {"relative_distance": {"event": 0, "below": 9}}}
        (told,) = never_happening(scenario(events=[kind, near]))
        assert told.endswith(f"distance to event 1 (events.0) {kind['kind']}, which puts nothing on the road")
    assert never_happening(scenario(events=[BED, near])) == []


def test_names_become_numbers_in_all_places():
    when = {
        "relative_distance": {"event": "bed", "below": 20},
        "any": [{"relative_distance": {"event": "bed", "above": 3}}, {"speed": {"above": 1}}],
    }
    read = scenario(events=[BED, {"kind": "hard_brake", "when": when}])
    assert float(read.events[1].when.relative_distance.event) == 0.0
    assert float(read.events[1].when.any[0].relative_distance.event) == 0.0
    assert scenario(**read.data()) == read
    assert valid({"name": "a", "events": [BED, {"kind": "hard_brake", "when": when}]}, SCHEMA)
    plain = scenario(events=[{"kind": "hard_brake", "when": {"speed": {"above": 1}}}])
    assert "vehicle" not in plain.data()["events"][0]["when"]["speed"]


def test_only_the_egos_speed_is_known_to_have_a_limit():
    fast = {"speed": {"above": 20}}
    (told,) = never_happening(scenario(events=[{"kind": "low_friction", "friction": 0.5, "when": fast}]))
    assert "it waits for speed above 20 m/s, and the ego drives at most 15 m/s" in told
    fast = {"speed": {"vehicle": "nearest", "above": 20}}
    assert never_happening(scenario(events=[{"kind": "low_friction", "friction": 0.5, "when": fast}])) == []


def test_what_is_wrong_is_said_at_its_place(problems):
    found = problems("""
        name: wrong
        events:
          - {kind: hard_brake, when: {relative_distance: {event: bed, below: 3}}}
          - {kind: hard_brake, when: {relative_distance: {event: 1, vehicle: leader, below: 3}}}
          - {kind: hard_brake, when: {relative_distance: {event: 2, below: 3}}, name: bed}
          - {kind: hard_brake, when: {speed: {vehicle: ledaer, below: 3}}}
        """)
    check(
        found,
        "3:58: events.0.when.relative_distance.event: no event before this one is called 'bed': events.2 is, "
        "and it must stand before this one",
        "4:51: events.1.when.relative_distance.event: takes the place of `vehicle`; give one of them",
        "5:58: events.2.when.relative_distance.event: expected the number of ... (0 to 1); got 2",
        "6:48: events.3.when.speed.vehicle: expected one of ... (did you mean 'leader'?)",
    )


def test_an_event_names_only_those_before_it(problems):
    found = problems("""
        name: wrong
        events:
          - {kind: hard_brake, when: {speed: {above: 1}}}
          - {kind: hard_brake, when: {relative_distance: {event: 1, below: 3}}}
        """)
    check(
        found,
        "4:58: events.1.when.relative_distance.event: expected the number of an event before this one in the "
        "file (only 0); got 1",
    )


@pytest.mark.parametrize(
    ("when", "words"),
    [
        ({"relative_distance": {"event": 0, "below": 20}}, "relative_distance event 0 below 20"),
        ({"speed": {"vehicle": "leader", "above": 50}}, "speed above 50 vehicle leader"),
    ],
)
def test_the_account_says_what_an_event_waits_for(world, when, words):
    far = replace(CALM, density=0.0, origin="south", turn="straight", distance=(60.0, 60.0))
    plan = replace(far, events=(event(**BED), surge(**when))).plan(0)
    world.reset(plan)
    world.advance(STAND)
    assert f"not there, it waits for {words}" in "\n".join(event_lines(plan, world.happenings()))
