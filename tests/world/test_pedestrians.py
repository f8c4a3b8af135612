"""Pedestrians: for what they stop, and where they go when they are held up."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rudc.world.props import BACK_M, LONG_S, PATIENCE_S, Prop
from rudc.world.scene import Kind
from tests.world.test_props import drive_towards


def test_a_pedestrian_waits_for_what_is_before_its_feet_only(make_scene):
    def walker():
        return Prop("walker", Kind.PEDESTRIAN, (0.5, 0.5), np.array([[0.0, 95.0], [0.0, 105.0]]), wanted=1.4)

    passing = make_scene({"row": 0, "s": 10.0, "v": 8.0})
    passing = replace(passing, position=np.array([[0.0, 100.0]]), heading=np.zeros(1))
    prop = walker()
    _, y, _ = drive_towards(prop, lambda i: passing, steps=100)
    assert 97.5 < y < 99.0
    away = make_scene({"at": (30.0, 100.0, 0.0)})
    prop = walker()
    assert drive_towards(prop, lambda i: away)[1] > 105.0


def test_a_pedestrian_who_is_held_up_steps_back_and_goes_on_once_its_way_is_free(make_scene):
    prop = Prop("walker", Kind.PEDESTRIAN, (0.5, 0.5), np.array([[0.0, 90.0], [0.0, 110.0]]), wanted=1.4)
    before_it = {"at": (0.0, 100.0, 0.0)}
    seen = []
    for i in range(400):
        gone = i * 0.05 > 15.0
        prop.look_out(make_scene(*([] if gone else [before_it])))
        prop.step(0.05)
        seen.append((prop.pose()[1], prop.speed))
    y, speed = np.array(seen).T
    stopped = np.flatnonzero(speed == 0.0)[0]
    patient = int(PATIENCE_S / 0.05) - 6  # while it stops it waits already
    assert (y[stopped : stopped + patient] == y[stopped]).all(), "it waits first"
    assert y[stopped] - y[300] == pytest.approx(BACK_M, abs=0.05), "then it is back so far, and no farther"
    assert (speed[stopped + patient + 50 : 300] == 0.0).all(), "and stays there while the way is not free"
    assert y[-1] > y[stopped] + 2.0


def test_pedestrians_who_are_held_up_for_long_go_back_to_where_they_came_from(make_scene):
    way = np.array([[0.0, 90.0], [0.0, 110.0]])
    walkers = [Prop(f"walker{i}", Kind.PEDESTRIAN, (0.5, 0.5), way, wanted=1.4) for i in range(3)]
    for i, prop in enumerate(walkers):
        prop.travelled = prop.appeared_m = -1.5 * i
    crowd = [-1.5 * i for i in range(3)]

    def walk(seconds, *others):
        for _ in range(round(seconds / 0.05)):
            for prop in walkers:
                there = [{"at": (*p.pose()[:2], 1.57), "size": (0.5, 0.5)} for p in walkers if p is not prop]
                prop.look_out(make_scene(*others, *there))
            for prop in walkers:
                prop.step(0.05)
        return [prop.travelled for prop in walkers]

    stands = {"at": (0.0, 100.0, 0.0)}
    assert walk(LONG_S, stands)[0] > 6.0, "they wait right before it first"
    assert walk(30.0, stands) == pytest.approx(crowd, abs=0.1)
    assert min(walk(30.0)) > 14.0, "and cross once their way is free"


def test_a_pedestrian_does_not_step_back_into_somebody_nor_off_its_way(make_scene):
    way = np.array([[0.0, 98.2], [0.0, 110.0]])
    before_it, behind = {"at": (0.0, 100.0, 0.0)}, {"at": (0.0, 96.5, 0.0)}
    for others, travelled in (([before_it, behind], 0.1), ([before_it], 0.0)):
        prop = Prop("walker", Kind.PEDESTRIAN, (0.5, 0.5), way, wanted=1.4)
        prop.travelled, prop.speed = travelled, 0.0
        for _ in range(200):
            prop.look_out(make_scene(*others))
            prop.step(0.05)
        assert prop.travelled == travelled


@pytest.mark.parametrize("speed", [1.4, 0.3])
def test_pedestrians_who_meet_walk_past_each_other_but_not_through_who_stands(make_scene, speed):
    """Each waited for the other, and nobody else could pass for good."""
    way = np.array([[0.0, 97.0], [0.0, 103.0]])
    both = [Prop(f"other{i}", Kind.PEDESTRIAN, (0.5, 0.5), way[:: 1 - 2 * i], wanted=speed) for i in (0, 1)]

    def there():
        return [{"at": p.pose(), "v": p.speed, "size": (0.5, 0.5), "kind": Kind.PEDESTRIAN} for p in both]

    for _ in range(round(6.5 / speed / 0.05)):
        scene = make_scene(*there())
        for prop in both:
            prop.look_out(scene)
            prop.step(0.05)
    assert all(prop.finished for prop in both)
    walker = Prop("walker", Kind.PEDESTRIAN, (0.5, 0.5), way, wanted=speed)
    stands = {"at": (0.0, 100.0, -math.pi / 2), "size": (0.5, 0.5), "kind": Kind.PEDESTRIAN}
    drive_towards(walker, lambda i: make_scene(stands), steps=round(6.5 / speed / 0.05))
    assert walker.travelled < 2.0
