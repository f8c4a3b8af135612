"""Props that have been run into get out of the other, so that nobody stands for good."""

import math

import numpy as np
import pytest

from rudc.world.props import LONG_S, PATIENCE_S, Prop
from rudc.world.scene import Kind


@pytest.mark.parametrize(("ahead", "leaves"), [(0.4, -1.0), (-0.4, 1.0)])
def test_a_pedestrian_goes_away_from_the_middle_of_who_has_run_into_them(make_scene, ahead, leaves):
    """A car has come to stand over a corner of them; its middle is `ahead` m before them on their way."""
    prop = Prop("walker", Kind.PEDESTRIAN, (0.5, 0.5), np.array([[0.0, 90.0], [0.0, 110.0]]), wanted=1.4)
    prop.travelled = 10.0
    prop.speed = 0.0
    car = make_scene({"at": (-2.3, 100.0 + ahead, 0.0), "size": (5.0, 1.8)})
    for _ in range(round((PATIENCE_S + LONG_S) / 0.05)):
        prop.look_out(car)
        prop.step(0.05)
    assert (prop.travelled - 10.0) * leaves > 0.9


def test_a_pedestrian_who_touches_nobody_does_not_go_back_into_somebody(make_scene):
    prop = Prop("walker", Kind.PEDESTRIAN, (0.5, 0.5), np.array([[0.0, 90.0], [0.0, 110.0]]), wanted=1.4)
    prop.travelled, prop.speed = 10.0, 0.0
    both = make_scene({"at": (0.0, 101.5, 0.0)}, {"at": (0.0, 98.6, 0.0)})
    for _ in range(round((PATIENCE_S + LONG_S) / 0.05)):
        prop.look_out(both)
        prop.step(0.05)
    assert prop.travelled == pytest.approx(10.0, abs=0.3)
    assert math.isclose(prop.speed, 0.0, abs_tol=1e-9)
