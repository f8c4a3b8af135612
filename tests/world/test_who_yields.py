"""Who yields to whom, in scenes made by hand."""

from dataclasses import replace

import numpy as np
import pytest

from rudc.network.conflicts import CONFLICT_WIDTH, meeting
from rudc.world.scene import Kind
from rudc.world.who_yields import who_yields

NOBODY = {"front": -30.0, "v": 0.0}
"""an ego that stands far off and concerns nobody"""


@pytest.fixture
def coming(four_way):
    """An SV on a way, its front `before` m short of the stop line."""

    def make(origin, turn, before, v=0.0, lane=0):
        row = four_way.movement(origin, turn).rows[lane]
        return {"row": row, "s": four_way.paths.stop_s[row] - before - 2.5, "v": v}

    return make


def test_who_waits_yields_to_the_first_with_priority(make_scene, coming):
    minor, far = coming("south", "straight", 1.0), coming("west", "straight", 25.0, 9.0)
    assert who_yields(make_scene(minor, far, **NOBODY)) == {"other0": "other1"}
    nearer = make_scene(minor, far, coming("east", "straight", 9.0, 9.0), **NOBODY)
    assert who_yields(nearer) == {"other0": "other2"}


@pytest.mark.parametrize(
    "other",
    [
        pytest.param(("west", "straight", -60.0, 9.0), id="has passed"),
        pytest.param(("west", "straight", 9.0), id="stands"),
        pytest.param(("west", "straight", 75.0, 9.0), id="is far"),
        pytest.param(("north", "left", 1.0, 5.0), id="owes it the way"),
        pytest.param(("south", "right", -9.0, 5.0), id="comes from its own arm"),
    ],
)
def test_nobody_waits_for_who(make_scene, coming, other):
    assert who_yields(make_scene(coming("south", "straight", 1.0), coming(*other), **NOBODY)) == {}


def test_who_drives_on_yields_to_nobody_and_who_brakes_does(make_scene, coming):
    scene = make_scene(coming("south", "straight", 5.0, 6.0), coming("west", "straight", 10.0, 9.0), **NOBODY)
    assert who_yields(scene) == {}
    assert who_yields(replace(scene, acceleration=np.array([-2.0, 0.0]))) == {"other0": "other1"}


def test_only_the_first_of_a_queue_yields(make_scene, coming):
    queue = [coming("south", "straight", 1.0), coming("south", "straight", 8.0)]
    scene = make_scene(*queue, coming("west", "straight", 9.0, 9.0), **NOBODY)
    assert who_yields(scene) == {"other0": "other2"}


def test_who_brakes_for_the_ego_yields_to_it(make_scene, coming):
    """It stands across the way of somebody with priority."""
    scene = make_scene(coming("west", "straight", -5.0, 9.0), front=11.0, v=0.0)
    assert who_yields(scene) == {"other0": "ego"}
    assert who_yields(scene, {"other0"}) == {}, "it disregards the right of way"


def test_who_brakes_for_an_obstacle_yields_to_that(make_scene, coming, four_way):
    car = coming("west", "straight", 30.0, 9.0)
    x, y, psi = (float(v) for v in four_way.paths.pose(np.array(car["row"]), np.array(car["s"] + 15.0)))
    there = {"at": (x, y, psi), "kind": Kind.OBSTACLE}
    beside = {"at": (x, y + 30.0, psi), "kind": Kind.OBSTACLE}
    assert who_yields(make_scene(beside, car, there, **NOBODY)) == {"other1": "other2"}


def test_ways_meet_where_their_lines_come_close(four_way):
    paths = four_way.paths
    row, other = (four_way.movement(*name).rows[0] for name in (("south", "straight"), ("west", "straight")))
    found = meeting(paths, row, other)
    assert found is not None
    assert meeting(paths, other, row) == (*found[2:], *found[:2])
    middle = [paths.pose(np.array(k), np.array(0.5 * (a + b)))[:2] for k, a, b in
              ((row, *found[:2]), (other, *found[2:]))]  # fmt: skip
    assert np.hypot(*np.subtract(*middle)) < CONFLICT_WIDTH
    assert meeting(paths, row, four_way.movement("north", "straight").rows[0]) is None
