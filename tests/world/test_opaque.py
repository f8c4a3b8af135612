"""Things of an `accident` that hide what is behind them."""

from dataclasses import replace

import numpy as np

from rudc.drawing.caption import describe
from rudc.scenario import Scenario
from tests.plans import event
from tests.scenario.test_json_schema import SCHEMA, valid
from tests.world.test_events import CALM

BUS = {"lane": "south_in_0", "at": 20, "lateral": -0.8, "type": "bus"}
WALKER = event("pedestrian_crossing", arm="south", at=8, speed=0.1)
"""so slow that they stay beside the lane, hidden by BUS from an EV that comes from the south"""


def in_sight(world, **accident):
    """After each of 15 decisions of an EV that stands 40 m before its stop line, names of what it sees."""
    source = replace(CALM, density=0.0, origin="south", turn="straight", speed=(0.0, 0.0), events=())
    events = (event("accident", vehicles=[BUS], **accident), WALKER)
    world.reset(replace(source, events=events).plan(0))
    seen = []
    for _ in range(15):
        world.advance(np.zeros(2))
        seen.append({*world.perceived().ids})
    return seen


def test_an_opaque_bus_is_seen_and_hides_who_walks_behind_it(world):
    both = {"accident0:0", "pedestrian_crossing1:0"}
    assert in_sight(world) == [both] * 15
    assert in_sight(world, opaque=True) == [{"accident0:0"}] * 15


def test_once_it_is_taken_away_nothing_is_hidden(world):
    seen = in_sight(world, opaque=True, duration=0.5)
    assert seen == [{"accident0:0"}] * 5 + [{"pedestrian_crossing1:0"}] * 10


def test_its_own_corners_do_not_hide_it_wherever_the_ego_is(world):
    """Seen from all around, also along its sides."""
    in_sight(world, opaque=True)
    scene, (box,) = world.scene(), world.sensors().occluders
    others = scene.ids.index("accident0:0")
    for angle in np.linspace(0.0, 2.0 * np.pi, 73):
        eye = replace(scene.ego, x=box[0] + 30.0 * np.cos(angle), y=box[1] + 30.0 * np.sin(angle))
        seen = world.sensors().perceive(replace(scene, ego=eye), np.random.default_rng(0))
        assert scene.ids[others] in seen.ids


def test_a_file_that_does_not_ask_for_it_says_what_it_said_before():
    plain = {"kind": "accident", "vehicles": [BUS]}
    told = [
        Scenario.model_validate({"name": "s", "events": [event]}).data()["events"][0]
        for event in (plain, {**plain, "opaque": False}, {**plain, "opaque": True})
    ]
    assert told[0] == told[1]
    assert "opaque" not in told[0]
    assert told[2] == {**told[0], "opaque": True}
    assert valid({"name": "s", "events": [{**plain, "opaque": True}]}, SCHEMA)
    assert not valid({"name": "s", "events": [{**plain, "opaque": "yes"}]}, SCHEMA)


def test_pictures_say_so():
    assert describe(event("accident", vehicles=[BUS], opaque=True)) == "accident, 1 vehicle, opaque"
