"""What a policy's action means."""

from typing import Literal

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rudc.agents.algorithms import DriverConfig, observation_layout
from rudc.agents.tracking import steering
from rudc.env.observation import observation_size
from rudc.learning.config import LearnerConfig

unit = st.floats(-1, 1)


@pytest.mark.parametrize("kind", ["direct", "adjustment"])
@given(x=unit, y=unit, offset=st.floats(-1, 1))
@settings(max_examples=50, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
def test_actions_come_back_from_what_they_stand_for(
    scene_on,
    kind: Literal["direct", "adjustment"],
    x: float,
    y: float,
    offset: float,
):
    config = DriverConfig(action=kind)
    scene = scene_on("south", "left", 20.0, 8.0, offset=offset)
    u = config.physical(np.array([x, y]), scene)
    assert -6 <= u[0] <= 3
    assert abs(u[1]) <= 0.6
    back = config.normalised(u, scene)
    assert config.physical(back, scene) == pytest.approx(u, abs=1e-9)
    if abs(u[1]) < 0.6:
        assert back == pytest.approx([x, y], abs=1e-9)


def test_doing_nothing_coasts_along_the_path(scene_on):
    scene = scene_on("south", "left", 60.0, 8.0, offset=0.4)
    assert DriverConfig().physical(np.zeros(2), scene) == pytest.approx([0, steering(scene)])


def test_what_no_action_reaches_becomes_the_nearest(scene_on):
    scene = scene_on("south", "left", 20.0, 8.0)
    assert DriverConfig().normalised(np.array([-20.0, 0.6]), scene).tolist() == [-1, 1]


@pytest.mark.parametrize("kind", ["paper", "conflict"])
def test_layout_is_that_of_the_observation(kind: Literal["paper", "conflict"]):
    assert observation_layout(kind).size == observation_size(kind)


def test_a_layout_that_does_not_fit_is_refused():
    with pytest.raises(ValueError, match="layout does not fit"):
        DriverConfig(observation="paper", learner=LearnerConfig.quick())
