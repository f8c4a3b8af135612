"""Frames: what is on them, and the window."""

import dataclasses
import sys

import numpy as np
import pytest

from rudc.env.rendering import EGO, KINDS, Renderer
from rudc.env.window import Window
from rudc.errors import SimulationError
from rudc.network.network import load_network, shipped_networks
from rudc.world.scene import Kind


def count(frame, colour, tolerance=12):
    """Pixels of about that colour."""
    return int(np.sum(np.all(np.abs(frame.astype(int) - colour[:3]) <= tolerance, axis=-1)))


@pytest.fixture(scope="module")
def renderer(network):
    return Renderer(network)


def test_frame_shows_the_ego_and_the_others(renderer, make_scene):
    scene = make_scene(others=[(2, 115.0, 5.0, 0.0), (9, 100.0, 5.0, 0.0)])
    frame = renderer.frame(scene)
    assert frame.shape == (600, 600, 3)
    assert frame.dtype == np.uint8
    car = 5.0 * 1.8 * (600 / 110) ** 2
    assert 0.3 * car < count(frame, EGO) - count(renderer.frame(make_scene(s=1000.0)), EGO) < 2 * car
    assert 2 * 0.3 * car < count(frame, KINDS[Kind.CAR]) < 2 * car
    alone = renderer.frame(make_scene())
    assert count(alone, KINDS[Kind.CAR]) == 0


def test_ego_is_where_it_is(renderer, make_scene, network):
    scene = make_scene("south", "straight", s=110.0)
    frame = renderer.frame(scene)
    scale = 600 / 110
    column = round((scene.ego.x - network.center[0] + 55) * scale)
    row = round((network.center[1] + 55 - scene.ego.y) * scale)
    assert count(frame[row - 3 : row + 3, column - 3 : column + 3], EGO) > 10


def test_frames_do_not_draw_on_one_another(renderer, make_scene):
    first = renderer.frame(make_scene(s=100.0))
    renderer.frame(make_scene(s=104.0, others=[(2, 115.0, 5.0, 0.0)]), outcome="collision")
    np.testing.assert_array_equal(renderer.frame(make_scene(s=100.0)), first)


@pytest.mark.parametrize("active", [("veh:v0",), ("road:left:cg",), ("road:right:front",)])
def test_active_constraints_are_marked(renderer, make_scene, active):
    scene = make_scene(others=[(2, 115.0, 5.0, 0.0)])
    plain, marked = renderer.frame(scene), renderer.frame(scene, active=active)
    assert count(marked, (235, 64, 52), 40) > count(plain, (235, 64, 52), 40) + 40


def test_the_unseen_are_faint_and_ends_are_announced(renderer, make_scene):
    scene = make_scene(others=[(2, 115.0, 5.0, 0.0)])
    assert count(renderer.frame(scene, seen=set()), KINDS[Kind.CAR]) < 20
    assert count(renderer.frame(scene, seen={"v0"}), KINDS[Kind.CAR]) > 50
    assert count(renderer.frame(scene, outcome="collision"), (214, 52, 44)) > 3000


@pytest.mark.parametrize("kind", list(Kind))
def test_every_kind_can_be_drawn(renderer, make_scene, kind):
    scene = make_scene(
        others=[(2, 115.0, 5.0, -3.0)], size=(0.6, 0.6) if kind is Kind.PEDESTRIAN else (5.0, 1.8)
    )
    frame = renderer.frame(dataclasses.replace(scene, kind=np.array([int(kind)])))
    assert count(frame, KINDS[kind]) > (8 if kind is Kind.PEDESTRIAN else 50)


@pytest.mark.parametrize("name", sorted(shipped_networks()))
def test_every_network_can_be_drawn(name, make_scene):
    network = load_network(name)
    movement = next(m for m in network.movements if m.turn == "left")
    route = network.route(movement.origin, movement.destination)
    x, y, psi = (float(v) for v in route.path.pose(50.0))
    scene = make_scene()
    ego = dataclasses.replace(scene.ego, x=x, y=y, psi=psi)
    scene = dataclasses.replace(
        scene, network=network, route=route, ego=ego, ego_s=50.0, destination_s=route.exit_s
    )
    frame = Renderer(network, size=300).frame(scene)
    assert frame.shape == (300, 300, 3)
    assert count(frame, EGO) > 20
    assert count(frame, (82, 87, 95)) > 3000


def test_window(monkeypatch, renderer, make_scene):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    pytest.importorskip("pygame")
    window = Window("test", 1000.0)
    window.show(renderer.frame(make_scene()))
    window.close()
    window.close()


def test_without_pygame_the_error_is_clear(monkeypatch):
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(SimulationError, match="pip install pygame-ce"):
        Window("test", 10.0)
