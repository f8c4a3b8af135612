"""`vehicle: same` is the vehicle of the event for which an event waits."""

from dataclasses import replace

import numpy as np
import pytest
import yaml

from rudc.errors import ScenarioError
from rudc.scenario import load_scenario
from tests.plans import PlanSource, event

CALM = PlanSource(density=25.0, speed=(0.0, 0.0))
"""the ego stands on its arm and watches"""
STAND = np.array([-6.0, 0.0])
FIRST = {"kind": "slow_vehicle", "vehicle": "random", "speed": 3.0, "duration": 1.0}
AFTER = {"event_state": {"event": 0, "state": "over"}}


def happened(world, events, seed, seconds=4.0):
    world.reset(replace(CALM, events=events).plan(seed))
    for _ in range(int(10 * seconds)):
        world.advance(STAND)
    return world.happenings()


@pytest.mark.parametrize("seed", range(3))
def test_a_later_event_takes_the_same_vehicle(world, seed):
    second = event("hard_brake", vehicle="same", deceleration=5.0, when=AFTER)
    first, same = happened(world, (event(**FIRST), second), seed)
    assert first.is_over
    assert same.bodies == first.bodies
    assert len(same.bodies) == 1


def test_its_conditions_look_at_that_vehicle(world):
    """It is farther from the ego than the nearest, for which another event waits in vain."""
    for seed in range(8):
        (first,) = happened(world, (event(**FIRST),), seed, 1.2)
        scene = world.scene()
        away = np.hypot(*(scene.position - (scene.ego.x, scene.ego.y)).T)
        (mine,) = (i for i, name in enumerate(scene.ids) if name in first.bodies)
        if away[mine] > away.min() + 30.0:
            break
    else:
        pytest.fail("the first event always took the nearest")
    far = {"above": float(away.min() + 15.0)}
    begun = {}
    for vehicle in ("same", "nearest"):
        when = {**AFTER, "relative_distance": {"vehicle": vehicle, **far}}
        second = event("hard_brake", vehicle="same", deceleration=5.0, when=when)
        begun[vehicle] = happened(world, (event(**FIRST), second), seed, 1.5)[1].begun_s
    assert begun["same"] == pytest.approx(1.1, abs=0.11)
    assert begun["nearest"] is None


def test_where_it_has_left_the_event_waits(world):
    second = event("hard_brake", vehicle="same", deceleration=5.0, when=AFTER)
    world.reset(replace(CALM, events=(event(**FIRST), second)).plan(0))
    world.advance(STAND)
    assert world.stage.held_by(0) == [*world.happenings()[0].bodies]
    world.stage.taken[0] = frozenset({"one that has left"})
    for _ in range(20):
        world.advance(STAND)
    first, waiting = world.happenings()
    assert first.is_over
    assert waiting.begun_s is None
    assert waiting.refused


@pytest.mark.parametrize(
    ("events", "told"),
    [
        (
            [FIRST, {"kind": "hard_brake", "vehicle": "same"}],
            r"events\.1\.vehicle: `same` is the vehicle of the",
        ),
        (
            [
                {"kind": "low_friction", "friction": 0.5},
                {"kind": "hard_brake", "vehicle": "same", "when": AFTER},
            ],
            r"events\.1\.vehicle: events\.0, for which this one waits, takes hold of no vehicle",
        ),
        (
            [FIRST, {"kind": "hard_brake", "when": {"time_headway": {"vehicle": "same", "below": 2}}}],
            r"events\.1\.when\.time_headway\.vehicle: `same` is the vehicle of the event that this",
        ),
    ],
)
def test_it_needs_an_event_with_a_vehicle(tmp_path, events, told):
    file = tmp_path / "mine.yaml"
    file.write_text(yaml.safe_dump({"name": "mine", "events": events}))
    with pytest.raises(ScenarioError, match=told):
        load_scenario(file)
