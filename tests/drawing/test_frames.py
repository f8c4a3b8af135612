"""Frames: what is on them, in which place, and what an event, a filter or a sensor changes."""

import dataclasses

import numpy as np
import pytest

from rudc.data import data_folder
from rudc.drawing.frames import Renderer
from rudc.drawing.palette import ACTIVE, ASPHALT, EGO, EVENT, OUTCOMES, SENSED, TRAFFIC
from rudc.drawing.text import panel_height
from rudc.drawing.view import Driving, ShownEvent, View
from rudc.network.network import load_network, shipped_networks
from rudc.world.scene import Kind
from tests.drawing.pixels import count
from tests.plans import event

SCALE = 600 / 110
"""pixels per m"""
ROAD = slice(100, 600)
"""rows below the caption"""
ACCIDENT = event("accident", vehicles=[{"position": [2.0, 4.0]}])


@pytest.fixture(scope="module")
def renderer(network):
    return Renderer(network)


def on_route(scene, network, route, s):
    """The scene with its ego at s m on a route of another network."""
    x, y, psi = (float(v) for v in route.path.pose(s))
    ego = dataclasses.replace(scene.ego, x=x, y=y, psi=psi)
    return dataclasses.replace(
        scene, network=network, route=route, ego=ego, ego_s=s, destination_s=route.exit_s
    )


def road(renderer, scene, driving=None, **fields):
    """A frame without its caption."""
    return renderer.frame(View(scene, **fields), driving)[ROAD]


def test_frame_shows_the_ego_and_the_others(renderer, make_scene):
    scene = make_scene(others=[(2, 115.0, 5.0, 0.0), (9, 100.0, 5.0, 0.0)])
    frame = renderer.frame(View(scene))
    assert frame.shape == (600, 600, 3)
    assert frame.dtype == np.uint8
    car = 5.0 * 1.8 * SCALE**2
    assert 0.3 * car < count(frame[ROAD], EGO) - count(road(renderer, make_scene(s=1000.0)), EGO) < 2 * car
    assert 2 * 0.3 * car < count(frame[ROAD], TRAFFIC) < 2 * car
    assert count(road(renderer, make_scene()), TRAFFIC) == 0


def test_ego_is_where_it_is(renderer, make_scene, network):
    scene = make_scene("south", "straight", s=110.0)
    frame = renderer.frame(View(scene))
    middle = 0.5 * (panel_height(3, 600 / 41) + 600)
    column = round((scene.ego.x - network.center[0] + 55) * SCALE)
    row = round(middle + (network.center[1] - scene.ego.y) * SCALE)
    assert count(frame[row - 6 : row + 6, column - 3 : column + 3], EGO) > 10


def test_a_scenario_of_many_events_leaves_the_ego_in_view(renderer, make_scene):
    frame = renderer.frame(View(make_scene(), events=tuple(ShownEvent(i, ACCIDENT) for i in range(1, 61))))
    assert count(frame, EGO) > 0.3 * 5.0 * 1.8 * SCALE**2


def test_frames_do_not_draw_on_one_another(renderer, make_scene):
    first = renderer.frame(View(make_scene(s=100.0)))
    other = make_scene(s=104.0, others=[(2, 115.0, 5.0, 0.0)])
    renderer.frame(View(other, range_m=20.0, outcome="collision"))
    np.testing.assert_array_equal(renderer.frame(View(make_scene(s=100.0))), first)


@pytest.mark.parametrize("active", [("veh:v0",), ("road:left:cg",), ("road:right:front",)])
def test_what_the_filter_acts_on_is_marked(renderer, make_scene, active):
    scene = make_scene(others=[(2, 115.0, 5.0, 0.0)])
    marked = road(renderer, scene, Driving(active=active))
    assert count(road(renderer, scene), ACTIVE, 25) == 0
    assert count(marked, ACTIVE, 25) > 40


def test_who_is_only_constrained_is_marked_more_faintly(renderer, make_scene):
    scene = make_scene(others=[(2, 115.0, 5.0, 0.0)])
    plain = road(renderer, scene)
    constrained = road(renderer, scene, Driving(constrained=("veh:v0", "road:left:cg")))
    acts = road(renderer, scene, Driving(active=("veh:v0",), constrained=("veh:v0", "road:left:cg")))
    changed = [int(np.any(frame != plain, axis=-1).sum()) for frame in (constrained, acts)]
    assert 20 < changed[0] < 0.6 * changed[1]


def test_who_takes_part_in_an_event_is_coloured_and_numbered(renderer, make_scene):
    scene = make_scene(others=[(2, 115.0, 5.0, 0.0)])
    involved = ShownEvent(3, ACCIDENT, begun_s=1.0, bodies=frozenset({"v0"}))
    frame = road(renderer, scene, events=(involved,))
    assert count(frame, TRAFFIC) == 0
    assert count(frame, EVENT) > 100
    waiting = ShownEvent(3, ACCIDENT, places=((2.0, 4.0),))
    assert np.any(road(renderer, scene, events=(waiting,)) != road(renderer, scene, events=()))
    other = ShownEvent(4, ACCIDENT, begun_s=1.0, bodies=frozenset({"v0"}))
    assert np.any(road(renderer, scene, events=(other,)) != frame), "the number itself differs"


def test_events_that_mark_one_place_share_a_badge(renderer, make_scene):
    def marked(*places):
        events = [ShownEvent(number, ACCIDENT, places=(place,)) for number, place in enumerate(places, 1)]
        return road(renderer, make_scene(), events=events)

    bare = marked()
    one, both, swapped, apart = (
        marked(*places)
        for places in (
            [(2.0, 4.0)],
            [(2.0, 4.0), (2.3, 4.0)],
            [(2.0, 4.0), (2.0, 4.3)],
            [(2.0, 4.0), (2.0, 9.0)],
        )
    )
    drawn = [int((picture != bare).any(axis=2).sum()) for picture in (one, both, apart)]
    assert drawn[0] < drawn[1] < drawn[2], "one badge, but a wider one"
    assert (both == swapped).all(), "where the first is, not one over the other"


def test_what_is_long_is_drawn_and_numbered_though_its_middle_is_not_in_view(renderer, make_scene, network):
    """A closure 100 m long whose near end is 24 m from the junction's centre; its number stands beside it."""
    x, y = network.center
    scene = make_scene(others=[(-1, (x - 74.0, y + 5.0, np.pi), 0.0, 0.0)], size=(100.0, 3.1))
    scene = dataclasses.replace(scene, kind=np.array([int(Kind.OBSTACLE)]))
    frame = road(renderer, scene)
    assert count(frame, TRAFFIC) > 0.4 * 30.0 * 3.1 * SCALE**2, "30 m of it are in view"
    closure = event("lane_closure", lane="west_out_1", at=10, length=100)
    numbered = [
        road(renderer, scene, events=(ShownEvent(number, closure, begun_s=0.0, bodies=frozenset({"v0"})),))
        for number in (1, 2)
    ]
    assert np.any(numbered[0] != numbered[1])


def test_the_hidden_are_pale_and_the_misjudged_outlined(renderer, make_scene):
    scene = make_scene(others=[(2, 115.0, 5.0, 0.0)])
    nobody = make_scene()
    assert count(road(renderer, scene, perceived=nobody), TRAFFIC) < 20
    assert count(road(renderer, scene, perceived=scene), TRAFFIC) > 50
    moved = dataclasses.replace(scene, position=scene.position + 2.0)
    outlined = count(road(renderer, scene, perceived=moved), SENSED)
    assert outlined > count(road(renderer, scene, perceived=scene), SENSED) + 20


@pytest.mark.parametrize("outcome", sorted(OUTCOMES))
def test_ends_are_announced(renderer, make_scene, outcome):
    colour = OUTCOMES[outcome][1]
    assert count(road(renderer, make_scene(), outcome=outcome), colour, 25) > 2000
    assert count(road(renderer, make_scene()), colour, 25) < 200


@pytest.mark.parametrize("kind", list(Kind))
def test_every_kind_can_be_drawn(renderer, make_scene, kind):
    size = (0.6, 0.6) if kind is Kind.PEDESTRIAN else (5.0, 1.8)
    scene = make_scene(others=[(2, 115.0, 5.0, -3.0)], size=size)
    frame = road(renderer, dataclasses.replace(scene, kind=np.array([int(kind)])))
    assert count(frame, TRAFFIC) > (8 if kind is Kind.PEDESTRIAN else 50)


@pytest.mark.parametrize("name", sorted(shipped_networks()))
def test_every_network_can_be_drawn(name, make_scene):
    network = load_network(name)
    movement = next(m for m in network.movements if m.turn == "left")
    route = network.route(movement.origin, movement.destination)
    frame = Renderer(network, size=300).frame(View(on_route(make_scene(), network, route, 50.0)))
    assert frame.shape == (300, 300, 3)
    assert count(frame, EGO) > 20
    assert count(frame, ASPHALT) > 3000


def test_far_from_the_junction_there_is_road_too(make_scene):
    """On an arm 234 m long, at its end and on the way in: one lane each way, 85 m of it in view at least."""
    network = load_network(data_folder("results") / "held-out-16" / "networks" / "ridgefarm.net.xml")
    renderer, route = Renderer(network), network.route("west", "straight")
    for s in (5.0, 60.0, 110.0):
        scene = on_route(make_scene(), network, route, s)
        assert np.hypot(*(scene.ego_position - network.center)) > 150.0
        assert count(road(renderer, scene), ASPHALT) > 0.8 * 85.0 * 6.8 * SCALE**2
