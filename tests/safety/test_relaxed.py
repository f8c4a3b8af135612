"""What the filter does where not all rows can hold."""

import math

import numpy as np
import pytest

from rudc.safety.filter import FilterConfig, SafetyFilter
from tests.safety.scenes import Other, make_scene, straight_road


@pytest.mark.parametrize("y", [-0.75, -0.9])
def test_steering_stays_on_the_road_for_somebody_for_whom_the_ego_brakes(y: float) -> None:
    """Random destination, seed 50: it swerved off the road beside the junction, for a car on its far side."""
    road = straight_road(half_width=2.0)
    crossing = Other(18.0, 9.0, -math.pi / 2, 5.0)
    scene = make_scene([crossing], y=y, psi=-0.03, v=11.0, route=road)
    config = FilterConfig.preset("ttcbf", constrained="all", last_resort=False)
    answer = SafetyFilter(config).filter(scene, np.array([3.0, 0.0]))
    assert answer.status == "relaxed"
    assert answer.u[0] < 0.0
    assert answer.u[1] > 0.0, "away from the edge"
