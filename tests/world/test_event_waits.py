"""Events that wait: for room, when they look at the ego, too, and until the ego has stood for some time."""

from dataclasses import replace

import numpy as np
import pytest

from rudc.world.scene import STANDING
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


def test_an_event_waits_until_the_ego_has_stood_for_some_time_without_a_break(world):
    late = event("density_surge", density=50, when={"stand_still": {"above": 0.55}})
    scene = world.reset(replace(CALM, speed=(3.0, 3.0), distance=(42.5, 42.5), events=(late,)).plan(0))
    since_s, fired = None, []
    for step in range(60):
        moves = scene.ego.v >= STANDING
        since_s = None if moves else scene.time_s if since_s is None else since_s
        stands_s = 0.0 if since_s is None else scene.time_s - since_s
        world.advance(np.array([2.0 if 10 <= step <= 20 else -3.0, 0.0]))
        fired += [step] if world.traffic.density == 50 else []
        assert bool(fired) == (stands_s > 0.55 or len(fired) > 1), step
        scene = world.scene()
    assert fired[0] > 30  # it stood once before, but drove on too soon
