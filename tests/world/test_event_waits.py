"""An event that has waited for room looks at the ego, too: its trigger may long have ceased to hold."""

from dataclasses import replace

import numpy as np
import pytest

from tests.plans import event
from tests.world.test_events import CALM, run


@pytest.mark.parametrize("somebody", [False, True])
def test_what_has_waited_does_not_appear_where_the_ego_could_not_stop(world, somebody):
    """A lorry that had waited for room appeared on the ego. Without a wait the trigger says where the ego
    is."""
    lorry = event(
        "accident", vehicles=[{"lane": "west_in_0", "at": 20}], when={"simulation_time": {"above": 0.05}}
    )
    run(world, replace(CALM, density=0.0, events=(lorry,)), 0.1)
    alone = world.scene()
    x, y, psi = world.network.place_on_lane("west_in_0", 20)
    near, far = (
        replace(alone, ego=replace(alone.ego, x=x - before, y=y, psi=psi, v=9.0)) for before in (8, 60)
    )
    there = replace(
        near, ids=("there",), position=np.array([[x, y]]), velocity=np.zeros((1, 2)), heading=np.array([psi]),
        acceleration=np.zeros(1), size=np.array([[5.0, 1.8]]), kind=np.zeros(1, int), path=np.zeros(1, int),
        path_s=np.zeros(1),
    )  # fmt: skip
    begun = []
    for time_s, scene in ((0.1, there if somebody else near), (0.2, near), (0.3, near), (0.4, far)):
        begun += [time_s for _ in world._script.step(replace(scene, time_s=time_s))]
    assert begun == [0.4 if somebody else 0.1]
