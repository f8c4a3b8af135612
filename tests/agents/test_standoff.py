"""Ending a standoff in the junction."""

# ruff: noqa: F811 -- fixtures come by import
from dataclasses import replace

import numpy as np
import pytest

from rudc.agents.standoff import PATIENCE, Standoff
from tests.world.conftest import four_way, make_scene  # noqa: F401 -- fixtures


@pytest.fixture
def waiting(make_scene, four_way):
    """A left-turning ego that stands past its waiting point, and one from ahead that stands before it."""

    def make(speed=0.0, before=12.0):
        scene = make_scene(turn="left", front=0.0)
        route = scene.route
        row = four_way.route("north", "straight").row
        table = four_way.conflict(route)[row]
        front = route.waiting_s - route.stop_line_s + 1.0
        other = {"row": row, "s": float(table[2]) - before, "v": speed}
        return replace(make_scene(other, turn="left", front=front, v=0.0), waited_s=PATIENCE + 1.0)

    return make


def ended(scene):
    return Standoff().end(scene, np.array([-2.0, 0.0]))


def test_where_all_stand_the_ego_goes_first(waiting):
    assert ended(waiting())[0] > 0.5


def test_not_before_it_has_waited_nor_while_somebody_comes(waiting):
    assert ended(replace(waiting(), waited_s=1.0))[0] == -2.0
    assert ended(waiting(speed=8.0))[0] == -2.0


def test_not_through_somebody(waiting, make_scene):
    scene = waiting()
    x, y, psi = (float(v) for v in scene.route.path.pose(scene.ego_s + 6.0))
    blocked = replace(
        scene,
        position=np.vstack([scene.position, [(x, y)]]),
        heading=np.append(scene.heading, psi),
        velocity=np.vstack([scene.velocity, np.zeros((1, 2))]),
        acceleration=np.zeros(2),
        size=np.vstack([scene.size, [(5.0, 1.8)]]),
        kind=np.zeros(2, dtype=np.int64),
        path=np.append(scene.path, -1),
        path_s=np.append(scene.path_s, 0.0),
        ids=(*scene.ids, "block"),
    )
    assert ended(blocked)[0] == -2.0


@pytest.mark.parametrize(("gap", "goes"), [(0.5, True), (0.1, False)])
def test_not_where_it_all_but_touches_somebody_itself(waiting, gap, goes):
    """Turned from its path, its front corner is nearer to who stands there than its path says."""
    scene = waiting()
    ego = replace(scene.ego, psi=scene.ego.psi - 0.2)
    along = np.array([np.cos(ego.psi), np.sin(ego.psi)])
    aside = np.array([along[1], -along[0]])
    bollard = [ego.x, ego.y] + 2.4 * along + (0.9 + gap + 0.1) * aside
    beside = replace(
        scene,
        ego=ego,
        position=np.vstack([scene.position, bollard]),
        heading=np.append(scene.heading, ego.psi),
        velocity=np.vstack([scene.velocity, np.zeros((1, 2))]),
        acceleration=np.zeros(2),
        size=np.vstack([scene.size, [(0.2, 0.2)]]),
        kind=np.zeros(2, dtype=np.int64),
        path=np.append(scene.path, -1),
        path_s=np.append(scene.path_s, 0.0),
        ids=(*scene.ids, "bollard"),
    )
    assert (ended(beside)[0] > 0.5) == goes


def test_a_queue_before_the_stop_line_is_no_standoff(make_scene):
    scene = replace(make_scene(turn="left", front=-1.0, v=0.0), waited_s=20.0)
    assert ended(scene)[0] == -2.0
