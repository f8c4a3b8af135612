"""How those whom SUMO drives keep their distance."""

from dataclasses import replace

import numpy as np
import pytest

from rudc.network.network import load_network
from rudc.scenario.distributions import Uniform
from rudc.world.ego import GRAVITY
from rudc.world.traffic import RESERVE
from rudc.world.world import World
from tests.plans import PlanSource, event

STANDS = PlanSource(density=30.0, speed=(0.0, 0.0), distance=(20.0, 20.0), origin="south", turn="straight")
ROLLS_OUT = replace(STANDS, density=25.0, speed=(8.0, 8.0), distance=(45.0, 45.0))


@pytest.mark.parametrize("friction", [None, 0.15])
def test_followers_brake_as_idm_says_by_their_own_values(friction):
    """Treiber et al. (2000): a (1 - (v / v0)^4 - (s* / s)^2), s* = s0 + v T + v dv / (2 sqrt(a b)). SUMO
    takes a b from a vehicle's type, whatever was set later."""
    ice = (event("low_friction", friction=friction),) if friction else ()
    drawn = Uniform(uniform=(1.0, 3.0)), Uniform(uniform=(1.5, 4.5))
    grip = friction * GRAVITY if friction else np.inf
    off, by_type = [], []
    with World(load_network("four_way")) as world:
        limit = world.network.lanes["south_in_0"].speed
        for seed in range(12):
            if len(off) > 60:
                break
            plan = replace(STANDS, events=ice).plan(seed)
            before = world.reset(replace(plan, traffic=replace(plan.traffic, accel=drawn[0], decel=drawn[1])))
            for _ in range(120):
                world.advance(np.array([-6.0, 0.0]))
                scene, seen = world.scene(), follower(before)
                if seen and seen[0] in scene.ids:
                    name, v, gap = seen
                    after = float(np.hypot(*scene.velocity[scene.ids.index(name)]))
                    driver = world.traffic.drivers[name]
                    a, b = min(driver.accel, grip), min(driver.decel, RESERVE * grip)
                    off.append(idm(v, limit, gap, a, b, grip) - (after - v) / 0.1)
                    by_type.append(idm(v, limit, gap, a, 2.0 * 3.0 / a, grip) - (after - v) / 0.1)
                before = scene
    assert len(off) > 30
    assert np.median(np.abs(off)) < 0.05
    assert np.median(np.abs(by_type)) > 0.15


def follower(scene):
    """Name of who drives behind the ego in its lane, its speed (m/s), and the gap between them (m); None if
    there is nobody near."""
    for i in range(scene.count):
        gap = scene.ego_s - 0.5 * scene.vehicle.length - scene.path_s[i] - 0.5 * scene.size[i, 0]
        beside = abs(scene.route.path.project(*scene.position[i])[1])
        v = float(np.hypot(*scene.velocity[i]))
        if scene.path[i] >= 0 and 3.0 < gap < 40.0 and beside < 0.1 and v > 2.0:
            return scene.ids[i], v, gap
    return None


def idm(v, v0, gap, a, b, grip):
    """m/s2, behind somebody who stands"""
    wanted = 2.0 + v * 1.0 + v * v / (2.0 * np.sqrt(a * b))
    return max(a * (1.0 - (v / v0) ** 4 - (wanted / gap) ** 2), -min(9.0, grip))


def test_nobody_slides_into_an_ego_that_brakes_gently_on_ice():
    ice = event("low_friction", friction=0.15)
    with World(load_network("four_way")) as world:
        for seed in range(2, 6):
            world.reset(replace(ROLLS_OUT, events=(ice,)).plan(seed))
            for _ in range(90):
                assert world.advance(np.array([-1.0, 0.0])).collision is None, seed


def test_nobody_who_brakes_hard_stops_at_once():
    """Who was already made to brake hard stopped from 6 m/s within 0.1 s for what SUMO saw before it."""
    stop, speeds = np.array([-6.0, 0.0]), []
    with World(load_network("four_way")) as world:
        world.reset(PlanSource(density=30.0, origin="south", turn="right", distance=(60.0, 60.0)).plan(1))
        for _ in range(10):
            world.advance(stop)
        scene = world.scene()
        fastest = scene.ids[int(np.argmax(np.where(scene.path >= 0, np.hypot(*scene.velocity.T), 0.0)))]
        for k in range(13):
            scene = world.scene()
            i = scene.ids.index(fastest)
            speeds.append(float(np.hypot(*scene.velocity[i])))
            if k in (0, 6):  # across its way, then right before it
                (x, y), psi, away = scene.position[i], float(scene.heading[i]), 12.5 if k == 0 else 7.0
                turned = 0.5 * np.pi if k == 0 else 0.0
                world.put_ego(x + away * np.cos(psi), y + away * np.sin(psi), psi + turned)
            world.advance(stop)
    braking = -np.diff(speeds) / 0.1
    assert braking[:6].min() > 6.0
    assert braking.max() < 12.0
