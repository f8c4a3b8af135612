"""The last resort of a car whose brakes lag: it stops before what stands across the road."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from rudc.agents.adaptation import Adaptation, Knowledge
from rudc.env.tracking import steering
from rudc.geometry import gaps_between
from rudc.safety.config import FilterConfig
from rudc.safety.last_resort import LastResort
from rudc.safety.last_resort_kernels import lagging_step, step_onwards, way_of_stopping
from rudc.vehicle import Actuation
from rudc.world.ego import EgoPlant
from rudc.world.scene import Scene
from tests.safety.scenes import Other, make_scene

ACROSS = Other(40.0, 0.0, math.pi / 2)


def gap(scene: Scene) -> float:
    """m, between the ego and the other."""
    own, body = np.array([[scene.ego.x, scene.ego.y]]), scene.vehicle
    size = np.array([body.length, body.width])
    its = scene.position, scene.heading, scene.size
    return float(gaps_between(own, np.array([scene.ego.psi]), size, *its)[0])


def drive(lag_s: float, v: float, delay_s: float = 0.0) -> tuple[float, float]:
    """m of gap and m/s in the end, of a driver who knows the car and would go on at v m/s."""
    scene = make_scene([ACROSS], v=v, actuation=Actuation(delay_s, lag_s))
    plant, adaptation, judge = (
        EgoPlant(scene.vehicle),
        Adaptation("known", probe=False),
        LastResort(FilterConfig()),
    )
    assert scene.actuation is not None
    plant.resume(scene.ego, scene.actuation)
    adaptation.reset(scene)
    for _ in range(200):
        shown = adaptation.see(scene)
        u = np.array([min(2.0, max(-6.0, (v - shown.ego.v) / 0.4)), steering(shown)])
        instead = judge.instead_of(shown, u)
        u = u if instead is None else instead.u
        plant.step(float(u[0]), float(u[1]), 0.05)
        ego = plant.step(float(u[0]), float(u[1]), 0.05)
        s, offset = scene.route.path.project(ego.x, ego.y, scene.ego_s)
        scene = replace(scene, time_s=scene.time_s + 0.1, ego=ego, ego_s=s, ego_offset=offset, last_u=u)
        if gap(scene) <= 0.0:
            break
    return gap(scene), scene.ego.v


@pytest.mark.parametrize("v", [3.0, 6.0, 8.5, 12.0])
@pytest.mark.parametrize("lag_s", [0.1, 0.3, 0.6])
def test_what_stands_across_the_road_is_not_hit(lag_s: float, v: float) -> None:
    """Brakes that were taken to act at once hit it at 1.2 to 7.4 m/s, or left 3 cm."""
    left, speed = drive(lag_s, v)
    assert 0.1 < left < 0.5, "and the ego drives up to it"
    assert speed < 0.1


def test_nor_where_there_is_a_dead_time_too() -> None:
    left, speed = drive(0.3, 8.5, 0.3)
    assert left > 0.1
    assert speed < 0.1


@pytest.mark.parametrize("lag_s", [0.05, 0.3, 1.0])
@pytest.mark.parametrize(("v", "a"), [(8.0, 3.0), (8.0, -6.0), (0.5, 2.0), (0.0, -6.0), (20.0, 0.0)])
def test_a_lagging_stop_is_the_plants(lag_s: float, v: float, a: float) -> None:
    """Also from a stand, and from where the horizon ends before the stop."""
    scene = make_scene([], v=v)
    plant = EgoPlant(replace(scene.vehicle, v_max=30.0))
    plant.resume(replace(scene.ego, acceleration=a), Actuation(0.0, lag_s))
    first, now, rate = lagging_step(v, a, 1.0, lag_s, 0.1)
    way = way_of_stopping(np.linspace(0.0, 2.5, 26), 0.1, first, now, 6.0, rate, lag_s)
    wanted = [plant.step(1.0 if t == 0 else -6.0, 0.0, 0.1).x for t in range(25)]
    assert way[0] == 0.0
    assert way[1:] == pytest.approx(np.array(wanted), abs=0.01)


def test_without_a_lag_a_step_is_as_it_was() -> None:
    for v, a in ((8.0, -6.0), (0.2, -6.0), (3.0, 2.0)):
        assert lagging_step(v, 1.3, a, 0.0, 0.1) == (*step_onwards(v, a, 0.1), a)


@pytest.mark.parametrize(("knowledge", "lag_s"), [("known", 0.3), ("off", 0.0)])
def test_the_driver_is_told_the_lag_that_is_known(knowledge: Knowledge, lag_s: float) -> None:
    scene = make_scene([], actuation=Actuation(0.0, 0.3))
    adaptation = Adaptation(knowledge, probe=False)
    adaptation.reset(scene)
    assert adaptation.see(scene).lag_s == lag_s
