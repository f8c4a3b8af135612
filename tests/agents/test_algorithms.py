"""How a learnt policy's settings fit together."""

from typing import Literal

import pytest

from rudc.agents.algorithms import DriverConfig, observation_layout
from rudc.env.observation import observation_size
from rudc.learning.config import LearnerConfig


@pytest.mark.parametrize("kind", ["paper", "conflict"])
def test_layout_is_that_of_the_observation(kind: Literal["paper", "conflict"]):
    assert observation_layout(kind).size == observation_size(kind)


def test_a_layout_that_does_not_fit_is_refused():
    with pytest.raises(ValueError, match="layout does not fit"):
        DriverConfig(observation="paper", learner=LearnerConfig.quick())
