"""What noisy sensors show of the others, smoothed: on recorded traffic, and on single bodies."""

# ruff: noqa: F811 -- fixtures come by import
import copy
import math
from dataclasses import replace

import numpy as np
import pytest

from rudc.agents.registry import make_agent
from rudc.agents.smoothing import LOST_S, Smoothing
from rudc.env.episode import Episode
from rudc.world.perception import Sensors
from rudc.world.scene import Scene
from tests.plans import PlanSource, event
from tests.safety.scenes import Other
from tests.safety.scenes import make_scene as scene_of
from tests.world.conftest import four_way, world, world_on  # noqa: F401 -- fixtures

NOISY = Sensors(position_std=0.4, speed_std=0.5, heading_std=0.06)
CLEAN = Sensors()


@pytest.fixture
def traffic(world) -> list[Scene]:
    """A left turn in dense traffic, a truck that breaks down in it."""
    plan = PlanSource(
        origin="south",
        turn="left",
        density=25.0,
        events=[event("hard_brake", vehicle="leader", deceleration=6)],
    ).plan(4)
    episode, agent = Episode(world), make_agent("gap-acceptance")
    scenes = [episode.reset(plan)]
    agent.reset(scenes[0], 4)
    while episode.outcome is None:
        scenes.append(episode.step(agent.act(scenes[-1]).u).scene)
    return scenes


def watched(scenes, sensors, watch, seed=0):
    """What is seen, and what a watch makes of it, of each scene."""
    rng = np.random.default_rng(seed)
    seen = [sensors.perceive(scene, rng) for scene in scenes]
    return seen, [watch.see(scene) for scene in seen]


def by_name(scene):
    return scene.only(np.argsort(scene.ids))


def errors(shown, truth):
    """rms of the errors of places (m), speeds (m/s), headings (rad) and arc lengths (m)."""
    place, speed, heading, s = [], [], [], []
    for a, b in zip(shown, truth, strict=True):
        a, b = by_name(a), by_name(b)
        assert a.ids == b.ids
        place += [*(a.position - b.position).ravel()]
        speed += [*np.hypot(*a.velocity.T) - np.hypot(*b.velocity.T)]
        heading += [math.remainder(turn, 2 * math.pi) for turn in a.heading - b.heading]
        s += [*(a.path_s - b.path_s)[b.path >= 0]]
    return [float(np.sqrt(np.mean(np.square(x)))) for x in (place, speed, heading, s)]


def test_sensors_without_noise_are_shown_as_they_are(traffic):
    watch = Smoothing()
    seen, shown = watched(traffic, CLEAN, watch)
    assert all(a is b for a, b in zip(seen, shown, strict=True))
    assert watch.noise == (0.0, 0.0, 0.0)


def test_gaps_in_what_is_seen_are_no_noise(traffic):
    watch = Smoothing()
    seen, shown = watched(traffic, replace(CLEAN, miss=0.3), watch)
    assert all(a is b for a, b in zip(seen, shown, strict=True))


def test_noise_is_measured_and_errors_shrink(traffic):
    watch = Smoothing()
    seen, shown = watched(traffic, NOISY, watch)
    assert watch.noise == pytest.approx((0.4, 0.5, 0.06), rel=0.35)
    before, after = errors(seen[20:], traffic[20:]), errors(shown[20:], traffic[20:])
    assert before[:3] == pytest.approx([0.4, 0.5, 0.06], rel=0.2)
    assert all(b < share * a for a, b, share in zip(before, after, (0.45, 0.45, 0.45, 0.45), strict=True))


def test_one_kind_of_noise_leaves_the_rest_nearly_as_it_is(traffic):
    _, shown = watched(traffic, replace(CLEAN, position_std=0.5), Smoothing())
    place, speed, heading, _ = errors(shown[20:], traffic[20:])
    assert place < 0.3
    assert speed < 0.02
    assert heading < 0.02


def test_noise_that_ends_is_forgotten(traffic):
    rng, watch = np.random.default_rng(1), Smoothing()
    half = len(traffic) // 2
    for scene in traffic[:half]:
        watch.see(NOISY.perceive(scene, rng))
    assert all(watch.noise)
    last = [watch.see(scene) is scene for scene in traffic[half:]]
    assert all(last[20:])


def moving(time_s, x, noise, others=6):
    """Others that drive east at 8 m/s in lanes of their own, the first of them at x m."""
    found = scene_of([Other(x, 4.0 * k, 0.0, 8.0) for k in range(others)], x=-1000.0, v=0.0, time_s=time_s)
    order = np.argsort(found.position[:, 1])
    found = replace(found.only(order), ids=tuple(f"sv{k}" for k in range(others)))
    return replace(found, position=found.position + noise)


def test_who_jumps_is_shown_where_it_is_seen():
    rng, watch = np.random.default_rng(2), Smoothing()
    for k in range(30):
        watch.see(moving(0.1 * k, 0.8 * k, 0.3 * rng.standard_normal((6, 2))))
    jump = np.zeros((6, 2))
    jump[2] = 9.0
    there = moving(3.0, 24.0, 0.3 * rng.standard_normal((6, 2)) + jump)
    shown = by_name(watch.see(there))
    assert shown.position[2] == pytest.approx(there.position[2])
    assert shown.position[0] != pytest.approx(there.position[0], abs=1e-6)


def test_who_comes_back_soon_is_known_and_later_is_new():
    rng, watch = np.random.default_rng(3), Smoothing()
    for k in range(40):
        watch.see(moving(0.1 * k, 0.8 * k, 0.3 * rng.standard_normal((6, 2))))
    for gap_s, known in ((0.5 * LOST_S, True), (1.5 * LOST_S, False)):
        time_s = 3.9 + gap_s
        back = moving(time_s, 8.0 * time_s, 0.3 * rng.standard_normal((6, 2)))
        shown = by_name(copy.deepcopy(watch).see(back))
        assert (shown.position[0] == pytest.approx(back.position[0], abs=1e-9)) is not known


def test_an_empty_road_and_a_scene_seen_twice_change_nothing():
    watch = Smoothing()
    rng = np.random.default_rng(4)
    for k in range(30):
        scene = moving(0.1 * k, 0.8 * k, 0.3 * rng.standard_normal((6, 2)))
        watch.see(scene)
    nobody = scene_of([], time_s=3.0)
    assert watch.see(nobody).count == 0
    assert watch.see(scene) is scene
