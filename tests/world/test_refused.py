"""What a world and its configuration refuse."""

import math

import numpy as np
import pytest

from rudc.errors import InputError, SimulationError
from rudc.world.config import WorldConfig
from tests.plans import PlanSource


@pytest.mark.parametrize("ask", ["perceived", "happenings", "sensors", "put_ego", "advance"])
def test_before_the_first_episode_nothing_can_be_asked(world_on, ask):
    """Most of it was an AttributeError."""
    world_on.close()
    given = {"put_ego": (0.0, 0.0, 0.0), "advance": (np.zeros(2),)}.get(ask, ())
    with pytest.raises(SimulationError, match=r"no episode yet; call reset"):
        getattr(world_on(), ask)(*given)


def test_an_action_that_is_no_number_is_refused_and_changes_nothing(world):
    """It drove the ego to nowhere, and everything after it ended in a ValueError."""
    world.reset(PlanSource().plan(1))
    for u in ([np.nan, 0.0], [0.0, np.nan]):
        with pytest.raises(InputError, match="is not acceleration"):
            world.advance(np.array(u))
    assert math.isfinite(world.advance(np.zeros(2)).min_dtc_m)


@pytest.mark.parametrize(
    ("decision", "substep"), [(1 / 15, 1 / 15), (0.05, 0.0125), (0.1, 0.0), (0.1, -0.05), (0.1, np.nan)]
)
def test_a_sub_step_is_a_whole_number_of_milliseconds(decision, substep):
    """SUMO rounded 12.5 ms up to 13, the ego's plant did not; a sub-step of 0 was a ZeroDivisionError."""
    with pytest.raises(ValueError, match="milliseconds"):
        WorldConfig(decision_s=decision, substep_s=substep)
