"""Staying on the road where grip is gone and the ego too fast."""

# ruff: noqa: F811 -- fixtures come by import
from dataclasses import replace

import numpy as np
import pytest

from rudc.agents.adaptation import USABLE, Adaptation
from rudc.agents.slide import Slide
from rudc.env.tracking import steering
from rudc.geometry import rectangle_gaps
from rudc.safety.plant import PlantEstimate
from rudc.vehicle import Actuation
from rudc.world.borders import Borders
from rudc.world.ego import GRAVITY, EgoPlant
from tests.world.conftest import four_way, make_scene  # noqa: F401 -- fixtures


def adapted(scene, friction):
    """An adaptation that knows how well the road grips."""
    adaptation = Adaptation("known", probe=False)
    adaptation.reset(scene)
    adaptation.estimate = PlantEstimate(Actuation(friction=friction), unusual=True)
    return adaptation


def driven(scene, friction, seconds=15.0):
    """Where a driver who follows the line and wants to go on comes to, and whether it stays on the road."""
    adaptation, plant = adapted(scene, friction), EgoPlant(scene.vehicle)
    plant.resume(scene.ego, Actuation(friction=friction))
    usable = USABLE * friction * GRAVITY  # as `see` shows it
    scene = replace(scene, vehicle=replace(scene.vehicle, a_min=-usable, a_max=min(usable, 3.0)))
    borders = Borders(scene.network.surface, scene.vehicle, may_cross_centre=False)
    for _ in range(round(seconds / 0.1)):
        u = adaptation.govern(scene, np.array([2.0, steering(scene)]))
        ego = plant.step(float(u[0]), float(u[1]), 0.1)
        s, offset = scene.route.path.project(ego.x, ego.y, scene.ego_s)
        scene = replace(scene, ego=ego, ego_s=s, ego_offset=offset, time_s=scene.time_s + 0.1)
        if any(borders.left(ego)):
            return scene, False
    return scene, True


@pytest.mark.parametrize(
    ("turn", "front", "v", "friction", "arrives"),
    [("right", 1.0, 11.0, 0.4, True), ("left", 5.0, 9.0, 0.25, True), ("right", 5.0, 9.0, 0.25, False)],
)
def test_a_turn_begun_too_fast_for_the_grip_found_then_does_not_end_off_the_road(
    make_scene, monkeypatch, turn, front, v, friction, arrives
):
    scene = make_scene(turn=turn, front=front, v=v)
    end, stayed = driven(scene, friction)
    assert stayed
    assert (end.ego_s > scene.route.exit_s + 20.0) == arrives
    monkeypatch.setattr(Slide, "hold", lambda self, scene, u, *known: u)
    assert not driven(scene, friction)[1]


def test_an_ego_that_keeps_to_its_line_is_left_alone(make_scene):
    scene = make_scene(turn="right", front=-20.0, v=6.0)
    u = np.array([0.5, 0.01])
    profile = np.full(len(scene.route.path.s), 5.0)
    assert Slide().hold(scene, u, 4.0, 0.0, profile) is u


def test_a_slide_does_not_end_in_somebody(make_scene):
    """A car stands where the ego would run on to."""
    setting = {"turn": "right", "front": 1.0, "v": 12.0}
    free, _ = driven(make_scene(**setting), 0.4, 2.0)
    pose = free.ego.x, free.ego.y, free.ego.psi
    end, stayed = driven(make_scene({"at": pose}, **setting), 0.4, 2.0)
    body = np.array([end.vehicle.length, end.vehicle.width])
    gap = rectangle_gaps(
        end.ego.x, end.ego.y, end.ego.psi, *body, end.position, end.heading, np.array([body])
    )
    assert stayed
    assert gap[0] > 0.0


def test_who_comes_fast_counts_from_farther_away(make_scene):
    """Only those within 50 m counted: this one meets the ego after 2 s."""
    setting, v = {"turn": "right", "front": 1.0, "v": 11.0}, 25.0
    free = make_scene(**setting)
    there = driven(free, 0.4, 2.0)[0].ego
    x, y = there.x + 2.0 * v * np.cos(there.psi), there.y + 2.0 * v * np.sin(there.psi)
    coming = make_scene({"at": (x, y, there.psi + np.pi), "v": v}, **setting)
    assert np.hypot(*(coming.position[0] - coming.ego_position)) > 60.0
    steered = [adapted(s, 0.4).govern(s, np.array([2.0, steering(s)]))[1] for s in (free, coming)]
    assert steered[0] < steered[1] - 0.02


def test_an_ego_with_no_way_back_stands(make_scene):
    """Its nose is at the kerb."""
    scene = make_scene(turn="right", front=3.0, v=0.0)
    x = scene.ego.x
    while scene.network.surface.depth(x + 0.5 * scene.vehicle.length, scene.ego.y) > 0.1:
        x += 0.05
    s, offset = scene.route.path.project(x, scene.ego.y)
    there = replace(scene, ego=replace(scene.ego, x=x, psi=0.0, v=0.05), ego_s=s, ego_offset=offset)
    profile = np.zeros(len(scene.route.path.s))
    assert Slide().hold(there, np.array([2.0, 0.0]), 3.0, 0.0, profile)[0] < 0.0
