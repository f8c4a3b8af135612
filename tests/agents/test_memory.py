"""Who is not seen for a moment is still there: on recorded traffic, and at a box."""

# ruff: noqa: F811 -- fixtures come by import
import math
from dataclasses import replace

import numpy as np
import pytest

from rudc.agents.memory import HOLD_S, KEPT_S, LONGEST_S, SURE_S, Memory
from rudc.agents.registry import make_agent
from rudc.env.episode import Episode
from rudc.world.perception import Sensors
from tests.plans import PlanSource
from tests.world.conftest import four_way, make_scene, world, world_on  # noqa: F401 -- fixtures

CLEAN = Sensors()


@pytest.fixture
def traffic(world):
    episode, agent = Episode(world), make_agent("gap-acceptance")
    scenes = [episode.reset(PlanSource(origin="south", turn="left", density=25.0).plan(4))]
    agent.reset(scenes[0], 4)
    while episode.outcome is None:
        scenes.append(episode.step(agent.act(scenes[-1]).u).scene)
    return scenes


def test_to_sensors_that_miss_nobody_who_vanishes_has_gone(traffic):
    watch = Memory()
    assert len({name for scene in traffic for name in scene.ids}) > traffic[-1].count, "some have gone"
    assert all(watch.see(scene) is scene for scene in traffic)


def test_who_is_missed_is_shown_where_it_is(traffic):
    rng, watch, away, missed = np.random.default_rng(0), Memory(), [], 0
    for scene in traffic:
        seen = replace(CLEAN, miss=0.4).perceive(scene, rng)
        shown = watch.see(seen)
        assert len(set(shown.ids)) == shown.count
        there = {name: i for i, name in enumerate(scene.ids)}
        missed += scene.count - seen.count
        for i in (k for k, name in enumerate(shown.ids) if name in there and name not in seen.ids):
            k = there[shown.ids[i]]
            away.append(float(np.hypot(*(shown.position[i] - scene.position[k]))))
            assert shown.path[i] == scene.path[k] or abs(away[-1]) < 1.0
    assert len(away) > 0.9 * missed > 300
    assert np.mean(away) < 0.15
    assert np.max(away) < 3.0


def test_it_is_forgotten_after_a_while(make_scene):
    parked, drives = {"at": (5.0, -20.0, 0.0)}, {"at": (20.0, 3.0, 0.0), "v": 4.0}
    there, watch = replace(make_scene(drives, parked), ids=("drives", "parked")), Memory()
    gone = replace(make_scene(parked), ids=("parked",))
    for k, scene in enumerate([there, gone, there]):
        watch.see(replace(scene, time_s=0.1 * k))
    for k in range(3, 20):
        shown = watch.see(replace(gone, time_s=0.1 * k))
        since = 0.1 * (k - 2)
        if k == 12:  # as long as it is kept, to the last bit
            continue
        assert ("drives" in shown.ids) == (since < KEPT_S), since
        if "drives" in shown.ids:
            row = shown.ids.index("drives")
            assert shown.position[row] == pytest.approx([20.0 + 4.0 * since, 3.0])
            assert math.isclose(np.hypot(*shown.velocity[row]), 4.0)
    assert watch.see(replace(there, time_s=9.0)).count == 2


@pytest.mark.parametrize(("gap", "kept_s"), [(3, KEPT_S), (8, 1.6), (20, LONGEST_S)])
def test_who_is_missed_for_long_is_kept_for_long(make_scene, gap, kept_s):
    there, watch = make_scene({"row": 0, "s": 20.0, "v": 0.5}, {"at": (20.0, 3.0, 0.0)}), Memory()
    away, shown = there.only(np.array([1])), []
    for k in range(gap + 41):
        seen = there if k in (0, gap) else away
        shown.append(watch.see(replace(seen, time_s=0.1 * k)).count)
    after = [0.1 * k for k, count in enumerate(shown[gap:]) if count == 2]
    assert after[-1] == pytest.approx(kept_s, abs=0.11)


@pytest.mark.parametrize("boxes", [True, False])
def test_who_drives_behind_a_box_and_stays_there_is_not_missed(make_scene, boxes):
    """Nor does it make the ego blind, though it should have come out on the other side."""
    drives = make_scene({"row": 0, "s": 20.0, "v": 8.0}, front=-30.0)
    x, y = drives.position[0]
    wall = np.array([[x, y, 0.0, 4.0, 4.0]]) if boxes else None
    empty, watch = replace(make_scene(front=-30.0), hidden_by=wall), Memory()
    watch.see(replace(drives, time_s=0.0, hidden_by=wall))
    blind = []
    for k in range(1, 60):
        watch.see(replace(empty, time_s=0.1 * k))
        blind.append(watch.blind)
    assert any(blind) is not boxes


@pytest.mark.parametrize(
    ("s", "sight_m", "missed"), [(20.0, math.inf, True), (20.0, 120.0, False), (-6.0, math.inf, False)]
)
def test_a_vehicle_that_vanishes_in_plain_sight_is_missed_and_an_ego_that_sees_nobody_is_blind(
    make_scene, s, sight_m, missed
):
    """Not one that has left its road, nor one that is about to leave the sensors' reach."""
    watch, empty = Memory(), replace(make_scene(), sight_m=sight_m)
    end = float(empty.network.paths.length[0])
    drives = make_scene({"row": 0, "s": s % end, "v": 0.5})
    watch.see(replace(drives, time_s=0.0))
    for k in range(1, 120):
        shown = watch.see(replace(empty, time_s=0.1 * k))
        known, holds = missed and 0.1 * k < LONGEST_S + 0.05, SURE_S < 0.1 * k < SURE_S + 0.1 + HOLD_S
        assert (shown.count, watch.blind) == (int(known), missed and holds), k
    watch.see(replace(drives, time_s=13.0))
    assert not watch.blind
    watch.see(replace(empty, time_s=13.1))
    watch.see(replace(empty, time_s=13.5))
    assert watch.blind == missed, "again"


def test_an_ego_is_blind_a_moment_after_the_last_was_seen_not_the_first(make_scene):
    watch, empty = Memory(), make_scene()
    two = make_scene({"row": 0, "s": 20.0, "v": 0.5}, {"row": 0, "s": 40.0, "v": 0.5})
    one = two.only(np.array([1]))
    seen = [two, two, one, one, one, one, empty, empty, empty, empty]
    blind = []
    for k, scene in enumerate(seen):
        watch.see(replace(scene, time_s=0.1 * k))
        blind.append(watch.blind)
    assert blind == [False] * 8 + [True] * 2
