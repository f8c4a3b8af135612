"""Traffic round an ego that stands in the junction in nobody's way."""

import math
from types import SimpleNamespace

import numpy as np

from rudc.world import unblocking
from rudc.world.backing_off import bars
from rudc.world.unblocking import Unblocking
from tests.world.standing import scenes_of_a_standing_ego

BEYOND = 3.0
"""m beyond its stop line where the ego's front stands: its ways ahead are free for all who cross"""


def longest_stand(world, turn="straight", front=BEYOND, **options):
    """s, how long somebody from another arm has been standing after a minute of the ego's standing with its
    front there."""
    since, paths = {}, world.network.paths
    for scene in scenes_of_a_standing_ego(world, turn, front - 0.5 * world.vehicle.length, 60.0, **options):
        own = paths.origin == paths.origin[world.route.row]
        stands = (np.hypot(*scene.velocity.T) < 0.1) & (scene.path >= 0) & ~own[scene.path]
        names = {name for name, there in zip(scene.ids, stands, strict=True) if there}
        since = {name: since.get(name, scene.time_s) for name in names}
    return max((scene.time_s - began for began in since.values()), default=0.0)


def test_nobody_stands_for_ever_for_an_ego_that_stands_in_nobodys_way(world, monkeypatch):
    assert longest_stand(world) < 20.0
    monkeypatch.setattr(unblocking, "STOOD_S", math.inf)
    assert longest_stand(world) > 45.0, "as SUMO has it"


def slowed_down(world):
    """How many of those who go straight on with priority slow down below 3 m/s before their stop line, in a
    minute of the ego's standing on the minor road with its front a little beyond its line."""
    paths, slow = world.network.paths, set()
    straight = [world.network.route(arm, "straight").row for arm in ("east", "west")]
    for scene in scenes_of_a_standing_ego(world, "straight", BEYOND - 0.5 * world.vehicle.length, 60.0):
        before = paths.stop_s[scene.path] - scene.path_s - 0.5 * scene.size[:, 0]
        found = np.isin(scene.path, straight) & (before > -1.0) & (before < 12.0) & (scene.speed < 3.0)
        if scene.waited_s > unblocking.STOOD_S + 5.0:
            slow |= {scene.ids[i] for i in found.nonzero()[0].tolist()}
    return len(slow)


def test_who_has_priority_does_not_slow_down_for_an_ego_that_stands_beside_its_way(world, monkeypatch):
    assert slowed_down(world) == 0
    monkeypatch.setattr(unblocking, "COMING_M", 0.0)
    assert slowed_down(world) > 0, "as SUMO has it"


def test_nor_behind_an_ego_that_only_sumo_takes_to_be_ahead(world_on, monkeypatch):
    """In its wide turn it counts as being on the lane of those who drive past it."""
    skewed = world_on("skewed_four_way")
    assert longest_stand(skewed, "left", 19.5, seed=2) < 20.0
    monkeypatch.setattr(unblocking, "_in_junction", lambda scene: set())
    assert longest_stand(skewed, "left", 19.5, seed=2) > 35.0, "as SUMO has it"


class Asked:
    """In SUMO's stead: notes whom it is asked to have overlook, and not follow, whom."""

    def __init__(self):
        self.overlooked, self.unfollowed = [], []

    def overlook(self, vehicle, other, *, ahead=False):
        (self.unfollowed if ahead else self.overlooked).append((vehicle, other))


def unblocking_of(asked):
    one = Unblocking(asked, SimpleNamespace(drivers={}))
    return lambda scene, held=(): one.step(scene, held, 0.1)


def test_who_comes_with_priority_overlooks_an_ego_that_it_can_pass(make_scene, four_way, monkeypatch):
    own = four_way.route("south", "straight").row
    row = int((~four_way.paths.yields[:, own]).argmax())
    stop_s = float(four_way.paths.stop_s[row])

    def asked_of(*steps):
        asked = Asked()
        step = unblocking_of(asked)
        for s, waited_s in steps:
            there = {"row": row, "s": s, "v": 9.0}
            step(make_scene(there, v=0.0 if waited_s else 1.0, front=1.0, waited_s=waited_s))
        return asked.overlooked

    stood, near = unblocking.STOOD_S, stop_s - 20.0
    assert asked_of((near, stood - 0.1)) == []
    assert asked_of((near - unblocking.COMING_M, stood)) == [], "it is far away"
    assert asked_of((near, stood), (near + 1.0, stood + 0.1)) == [("other0", "ego")]
    assert asked_of((near, stood), (near, 0.0)) == [("other0", "ego"), ("other0", "")]
    assert asked_of((near, stood), (stop_s + 1.0, 0.0)) == [("other0", "ego")], "in the junction it goes on"
    monkeypatch.setattr(unblocking, "bars", lambda *where: True)
    assert asked_of((near, stood)) == [], "it could not pass the ego"


def test_whom_the_yielding_layer_holds_heeds_the_ego_and_who_stands_when_it_drives(make_scene, four_way):
    def scene(waited_s, *speeds):
        near = [{"row": row, "s": 10.0 * (i + 1), "v": v} for i, v in enumerate(speeds)]
        return make_scene(*near, v=0.0 if waited_s else 1.0, waited_s=waited_s)

    asked = Asked()
    yields, own = four_way.paths.yields, four_way.route("south", "straight").row
    step, row = unblocking_of(asked), int(yields[:, own].argmax())
    step(scene(unblocking.LONG_S - 0.1, 0.0))
    assert asked.overlooked == [], "it must give way to the ego"
    step(scene(unblocking.LONG_S, 0.0))
    assert asked.overlooked == [("other0", "ego")], "the ego has let it go first"
    asked.overlooked.clear()
    step, row = unblocking_of(asked), int((~yields[:, own]).argmax())
    step(scene(unblocking.STOOD_S - 0.1, 0.0, 0.0, 0.0))
    assert asked.overlooked == []
    for _ in range(2):
        step(scene(unblocking.STOOD_S, 0.0, 0.0, 0.0), {"other1"})
    assert asked.overlooked == [("other0", "ego"), ("other2", "ego")]
    step(scene(0.0, 0.0, 0.0, 2.0))
    assert asked.overlooked[2:] == [("other0", "")], "who drives goes on"
    step(scene(0.0, 0.0, 0.0))
    step(scene(0.0, 0.0, 0.0, 0.0))
    assert len(asked.overlooked) == 3, "who has left is asked nothing"


def test_who_is_set_free_in_the_junction_does_not_follow_the_ego_until_it_is_out(
    make_scene, four_way, monkeypatch
):
    """Once the ego drives, who is past it goes on as before, and who is not past it follows it again."""
    own, paths = four_way.route("south", "straight"), four_way.paths
    row = int((~paths.yields[:, own.row]).argmax())
    entry, exit_s = float(paths.stop_s[row]), float(paths.exit_s[row])

    def asked_of(*steps):
        asked = Asked()
        step = unblocking_of(asked)
        for s, waited_s in steps:
            step(make_scene({"row": row, "s": s, "v": 0.0}, v=0.0, front=3.0, waited_s=waited_s))
        return asked.unfollowed

    stands = unblocking.STOOD_S
    before, inside, past, out = entry - 5.0, entry + 1.0, exit_s - 1.0, exit_s + 5.0
    follows_not, follows = ("other0", "ego"), ("other0", "")
    assert asked_of((before, stands)) == []
    assert asked_of((inside, stands), (inside, stands + 1.0)) == [follows_not]
    assert asked_of((inside, stands), (inside, 0.0)) == [follows_not, follows]
    assert asked_of((inside, stands), (past, 0.0)) == [follows_not]
    assert asked_of((inside, stands), (past, 0.0), (out, 0.0)) == [follows_not, follows]
    monkeypatch.setattr(unblocking, "bars", lambda *where: True)
    assert asked_of((inside, stands)) == [], "it stands behind the ego, and could not pass"


def test_who_should_give_way_and_cannot_pass_the_ego_waits_for_it(make_scene, four_way):
    """Let go first, it stood before the nose of the ego, and neither could drive on."""
    left = four_way.route("east", "left")
    rows = np.flatnonzero(four_way.paths.yields[:, left.row])
    at_line = [{"row": int(row), "s": float(four_way.paths.stop_s[row]) - 3.5, "v": 0.0} for row in rows]
    asked = Asked()
    waiting = {"origin": "east", "turn": "left", "v": 0.0, "waited_s": unblocking.LONG_S}
    scene = make_scene(*at_line, front=left.waiting_s - left.stop_line_s, **waiting)
    unblocking_of(asked)(scene)
    barred = {scene.ids[i] for i in range(scene.count) if bars(scene, i, math.inf)}
    free = {name for name, _ in asked.overlooked}
    assert barred, "the ego at its waiting point stands in the way of some"
    assert free == set(scene.ids) - barred
    assert free
