"""Road edges in a bend: rows take them for straight, and yet neither steer out of the bend nor let go."""

from __future__ import annotations

import numpy as np
import pytest

from rudc.env.tracking import close_to_path, steering
from rudc.network.route import ReferencePath
from rudc.safety.filter import FilterConfig, SafetyFilter
from rudc.safety.road_points import RoadPoints
from rudc.world.ego import EgoPlant
from rudc.world.scene import Scene
from tests.safety.scenes import Road, make_scene

RADIUS, RAMP, BEGIN = 6.0, 9.0, 30.0
"""m; m in which the curvature comes and goes; m of straight road before the bend"""
END = BEGIN + RAMP + 0.5 * np.pi * RADIUS
"""m"""
RULES = pytest.mark.parametrize("rule", ["ecbf", "ttcbf"])


def right_turn() -> Road:
    """From the origin eastwards, then south; the inner edge closes in on the path from 2.6 to 1.4 m."""
    s = np.arange(0.0, END + 40.0, 0.05)
    bend = np.interp(s, [BEGIN, BEGIN + RAMP, END - RAMP, END], [0.0, 1.0, 1.0, 0.0]) / RADIUS
    turned = 0.05 * np.cumsum(bend)
    path = ReferencePath(np.cumsum(0.05 * np.column_stack([np.cos(turned), -np.sin(turned)]), axis=0))
    normal = np.column_stack([-np.sin(path.heading), np.cos(path.heading)])
    inner = np.interp(path.s, [BEGIN - 6.0, BEGIN], [2.6, 1.4])
    return Road(path, path.xy + 2.2 * normal, path.xy - inner[:, None] * normal)


ROAD = right_turn()


def on_road(plant: EgoPlant, s: float) -> Scene:
    """The scene about an ego that was at s (m) a moment ago."""
    s, offset = ROAD.path.project(plant.state.x, plant.state.y, s)
    return make_scene(route=ROAD, ego=plant.state, ego_s=s, ego_offset=offset)


def drive(rule: str, v: float, adjustment: float, *, filtered: bool = True) -> tuple[float, float]:
    """rad, m: largest change to the steering of an ego that turns right at v m/s, steering by so much (rad)
    besides following its path; and the least distance of its axis from the inner edge.
    """
    correct = SafetyFilter(FilterConfig.preset(rule, max_steering_correction=np.inf))
    plant, scene = EgoPlant(make_scene().vehicle), make_scene(route=ROAD)
    plant.reset(BEGIN - 10.0, 0.0, 0.0, v)
    points = RoadPoints(scene.route, scene.vehicle)
    largest, least, s = 0.0, np.inf, BEGIN - 10.0
    while s < END + 5.0:
        scene = on_road(plant, s)
        s, ego = scene.ego_s, scene.ego
        away = points.away(complex(ego.x, ego.y), complex(np.cos(ego.psi), np.sin(ego.psi)), s)
        least = min(least, float(np.abs(away[3:]).min()))
        u = np.array([0.0, steering(scene) + adjustment])
        taken = correct.filter(scene, u).u if filtered else u
        largest = max(largest, abs(float(taken[1] - u[1])))
        for _ in range(2):
            plant.step(max(float(taken[0]), (3.0 - ego.v) / 0.1), float(taken[1]), 0.05)
    return largest, least


@RULES
@pytest.mark.parametrize("v", [4.0, 6.0, 7.0])
def test_who_follows_the_path_is_not_steered_out_of_the_bend(rule: str, v: float) -> None:
    largest, _ = drive(rule, v, 0.0)
    assert largest < 0.005


@RULES
def test_who_cuts_the_corner_is_kept_off_its_inner_edge(rule: str) -> None:
    _, without = drive(rule, 8.0, -0.14, filtered=False)
    _, least = drive(rule, 8.0, -0.14)
    assert without < 0.05, "with half of the car beyond it"
    assert least > 0.6, "rows know nothing of slip"


@pytest.mark.parametrize(
    ("offset", "angle"), [(0.0, 0.2), (0.05, -0.1), (0.8, 0.0), (-0.5, 0.3), (0.02, 0.01)]
)
def test_close_to_the_path_is_who_stays_there_by_following_it(offset: float, angle: float) -> None:
    beginning = make_scene(y=offset, psi=angle, v=9.0)
    near = close_to_path(beginning, 0.1)
    plant, farthest = EgoPlant(near.vehicle), 0.0
    plant.reset(near.ego.x, near.ego.y, near.ego.psi, near.ego.v)
    for _ in range(300):
        ego = plant.state
        scene = make_scene(x=ego.x, y=ego.y, psi=ego.psi, v=ego.v)
        farthest = max(farthest, abs(scene.ego_offset))
        plant.step(0.0, steering(scene), 0.01)
    assert farthest < 0.1 + 1e-6
    assert near is beginning or farthest > 0.04, "not much nearer than it need be"
