"""Traffic round an ego that stands in the junction in nobody's way."""

import math

import numpy as np

from rudc.scenario import load_scenario
from rudc.world import unblocking
from rudc.world.unblocking import Unblocking

BEYOND = 3.0
"""m beyond its stop line where the ego's front stands: its ways ahead are free for all who cross"""


def longest_stand(world):
    """s, how long somebody from another arm has been standing after a minute of the ego's standing there."""
    changes = {
        "traffic.density": 25,
        "ego.route": {"from": "south", "turn": "straight"},
        "episode.timeout": 90,
    }
    world.reset(load_scenario("random_destination", changes).plan(1))
    route = world.route
    world.put_ego(*map(float, route.path.pose(route.stop_line_s + BEYOND - 0.5 * world.vehicle.length)))
    since = {}
    for _ in range(600):
        assert world.advance(np.array([-1.0, 0.0])).collision is None
        scene = world.scene()
        own = world.network.paths.origin == world.network.paths.origin[route.row]
        stands = (np.hypot(*scene.velocity.T) < 0.1) & (scene.path >= 0) & ~own[scene.path]
        names = {name for name, there in zip(scene.ids, stands, strict=True) if there}
        since = {name: since.get(name, scene.time_s) for name in names}
    return max((scene.time_s - began for began in since.values()), default=0.0)


def test_nobody_stands_for_ever_for_an_ego_that_stands_in_nobodys_way(world, monkeypatch):
    assert longest_stand(world) < 20.0
    monkeypatch.setattr(unblocking, "STOOD_S", math.inf)
    assert longest_stand(world) > 45.0, "as SUMO has it"


def test_whom_the_yielding_layer_holds_heeds_the_ego_and_who_stands_when_it_drives(make_scene, four_way):
    asked = []

    class Asked:
        overlook = staticmethod(lambda vehicle, other: asked.append((vehicle, other)))

    def scene(waited_s, *speeds):
        near = [{"row": row, "s": 10.0 * (i + 1), "v": v} for i, v in enumerate(speeds)]
        return make_scene(*near, v=0.0 if waited_s else 1.0, waited_s=waited_s)

    yields, own = four_way.paths.yields, four_way.route("south", "straight").row
    one, row = Unblocking(Asked()), int(yields[:, own].argmax())
    one.step(scene(unblocking.LONG_S - 0.1, 0.0), ())
    assert asked == [], "it must give way to the ego"
    one.step(scene(unblocking.LONG_S, 0.0), ())
    assert asked == [("other0", "ego")], "the ego has let it go first"
    asked.clear()
    one, row = Unblocking(Asked()), int((~yields[:, own]).argmax())
    one.step(scene(unblocking.STOOD_S - 0.1, 0.0, 0.0, 0.0), ())
    assert asked == []
    for _ in range(2):
        one.step(scene(unblocking.STOOD_S, 0.0, 0.0, 0.0), {"other1"})
    assert asked == [("other0", "ego"), ("other2", "ego")]
    one.step(scene(0.0, 0.0, 0.0, 2.0), ())
    assert asked[2:] == [("other0", "")], "who drives goes on"
    one.step(scene(0.0, 0.0, 0.0), ())
    one.step(scene(0.0, 0.0, 0.0, 0.0), ())
    assert len(asked) == 3, "who has left is asked nothing"
