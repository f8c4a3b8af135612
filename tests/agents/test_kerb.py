"""Near the road's edge the path is followed, and no corner is cut; elsewhere the command stays what it is."""

# ruff: noqa: F811 -- fixtures come by import
import math
from dataclasses import replace

import numpy as np
import pytest

from rudc.agents.kerb import OFF, SHARP, SHARPER, kept_on_road
from rudc.env.tracking import steering
from rudc.network.route import ReferencePath
from rudc.vehicle import Actuation
from rudc.world.borders import Borders
from rudc.world.ego import EgoPlant
from tests.world.conftest import four_way, make_scene  # noqa: F401 -- fixtures

PUSH = {2.0: -0.45, 5.0: -0.3, 9.0: -0.12}
"""m/s: rad to the right of what follows the path, which lead 1.5 m beside it in the end"""


def drive(scene, bound, push):
    """The scenes of 8 s in which the wheels are always turned by `push` from what follows the path."""
    plant, path = EgoPlant(scene.vehicle), scene.route.path
    plant.resume(scene.ego, Actuation())
    scenes = [scene]
    for _ in range(80):
        u = np.array([0.0, steering(scene) + push])
        a, delta = kept_on_road(scene, u) if bound else u
        ego = plant.step(float(a), float(delta), 0.1)
        s, offset = path.project(ego.x, ego.y, scene.ego_s)
        scene = replace(scene, ego=ego, ego_s=s, ego_offset=offset)
        scenes.append(scene)
    return scenes


def leaves_road(scene):
    borders = Borders(scene.network.surface, scene.vehicle, may_cross_centre=True)
    return borders.left(scene.ego)[0]


@pytest.mark.parametrize("v", [2.0, 5.0, 9.0])
def test_an_ego_that_is_pushed_towards_the_edge_stays_on_the_road(make_scene, v):
    scene = make_scene(front=-40.0, v=v)
    assert any(map(leaves_road, drive(scene, False, PUSH[v])))
    assert not any(map(leaves_road, drive(scene, True, PUSH[v])))


def beside_the_path(scene, offset):
    """The scene with an ego that far to the left of its path, along it."""
    ego = scene.ego
    x, y = ego.x - offset * math.sin(ego.psi), ego.y + offset * math.cos(ego.psi)
    return replace(scene, ego=replace(ego, x=x, y=y), ego_offset=offset)


def turning_off(scene, right_of_edge):
    """The scene of an ego on the lane to the right, with the corner of its front `right_of_edge` m from the
    edge, on a path that turns left with a radius of 4 m."""
    depth = scene.network.surface.depth
    ego, body = scene.ego, scene.vehicle
    cos, sin = math.cos(ego.psi), math.sin(ego.psi)
    corner = complex(cos, sin) * complex(0.5 * body.length, -0.5 * body.width)
    aside = depth(ego.x + corner.real, ego.y + corner.imag) - right_of_edge
    x, y = ego.x + aside * sin, ego.y - aside * cos
    angles = np.arange(-1.0, 1.5, 0.01)
    arc = 4.0 * (np.sin(angles) + 1j * (1.0 - np.cos(angles)))
    slip = math.asin(body.cg_to_rear / 4.0)
    line = complex(x, y) + arc * complex(cos, sin) * complex(math.cos(slip), math.sin(slip))
    path = ReferencePath(np.column_stack([line.real, line.imag]))
    s, offset = path.project(x, y)
    route = replace(scene.route, path=path)
    return replace(scene, ego=replace(ego, x=x, y=y), route=route, ego_s=s, ego_offset=offset)


def test_in_a_sharp_turn_the_front_does_not_swing_out(make_scene):
    scene = make_scene(front=-40.0, v=3.0)
    near, clear = turning_off(scene, 0.05), turning_off(scene, 0.4)
    assert abs(near.ego_offset) < OFF
    track = steering(near)
    assert track > SHARP
    sharply = np.array([1.0, track])
    assert kept_on_road(near, sharply).tolist() == [1.0, min(track + SHARPER, 0.6)]
    assert kept_on_road(clear, sharply) is sharply
    gently = np.array([1.0, 0.2])
    assert kept_on_road(near, gently) is gently
    on_its_lane = replace(near, route=scene.route, ego_s=scene.ego_s, ego_offset=-0.02)
    assert kept_on_road(on_its_lane, sharply) is sharply, "its path goes straight on"


def test_who_steers_back_already_is_let_and_so_is_who_has_room(make_scene):
    scene = make_scene(front=-40.0)
    near = beside_the_path(scene, -1.2)
    back = np.array([1.0, steering(near) + 0.05])
    out = np.array([1.0, steering(near) - 0.05])
    assert kept_on_road(near, back) is back
    np.testing.assert_allclose(kept_on_road(near, out), [1.0, steering(near)])
    for offset in (-0.5, -0.5 * OFF, 0.5 * OFF, 0.5):
        roomy = beside_the_path(scene, offset)
        assert kept_on_road(roomy, out) is out


def test_beyond_the_centre_line_is_no_edge(make_scene):
    """Going round on the other side of the road is not hindered."""
    scene = beside_the_path(make_scene(front=-40.0), 3.0)
    out = np.array([1.0, steering(scene) + 0.05])
    assert kept_on_road(scene, out) is out


def test_the_rear_does_not_cut_the_corner(make_scene):
    """In right turns, wherever on the inner side the ego sets off, with all its corners on the road."""
    cut = 0
    for origin in ("south", "west"):
        for front in np.arange(-2.0, 8.0, 1.0):
            straight = make_scene(origin=origin, turn="right", front=front, v=8.0)
            for offset in (-0.3, -0.6, -0.9, -1.2):
                scene = beside_the_path(straight, offset)
                if not Borders(scene.network.surface, scene.vehicle, True, 0.0).left(scene.ego)[0]:
                    cut += any(map(leaves_road, drive(scene, False, 0.0)))
                    assert not any(map(leaves_road, drive(scene, True, 0.0)))
    assert cut >= 4


def test_in_a_bend_the_command_stays_while_the_rear_stays_on_the_road(make_scene):
    scene = make_scene(turn="right", front=3.0, v=2.0)
    u = np.array([1.0, steering(scene)])
    assert kept_on_road(beside_the_path(scene, -0.1), u) is u
