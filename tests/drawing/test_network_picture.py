import re

import numpy as np
import pytest

from rudc.data import data_folder
from rudc.drawing.canvas import Canvas
from rudc.drawing.map import LEFT_PX, SIDE_PX, name_arms, new_map, ticks
from rudc.drawing.network_picture import draw_network
from rudc.drawing.palette import ASPHALT, GROUND, MARK, PAVEMENT, RESERVED, TURNS
from rudc.evaluation.recording import road_shapes
from rudc.network.network import Network, load_network, shipped_networks
from rudc.network.polyline import offset_polyline, resample
from tests.drawing.pixels import count
from tests.world.networks import bent


@pytest.mark.parametrize("name", sorted(shipped_networks()))
def test_asphalt_is_drawn_where_the_road_is_and_ground_where_not(name):
    network = load_network(name)
    canvas = new_map(network, 40.0)
    image = np.asarray(canvas.image).astype(int)[::4, ::4]
    side = image.shape[0]
    place = (np.arange(side) + 0.125) / side * 80.0 - 40.0
    x, y = np.meshgrid(place, -place)
    distance = network.surface.signed_distance(np.stack([x, y], axis=-1) + network.center)
    is_ground = np.abs(image - GROUND[:3]).sum(axis=-1) < 12
    assert is_ground[distance < -1.6].mean() > 0.97, "all but the grid"
    assert is_ground[distance > 0.6].mean() < 0.01
    is_asphalt = np.abs(image - ASPHALT[:3]).sum(axis=-1) < 12
    assert is_asphalt[distance > 0.6].mean() > 0.8, "all but marks and the grid"
    assert is_asphalt[distance < -0.6].mean() < 0.01


@pytest.mark.parametrize("name", sorted(shipped_networks()))
def test_names_of_arms_stay_off_the_road(name):
    network = load_network(name)
    plain, named = new_map(network, 70.0), new_map(network, 70.0)
    name_arms(named, network, 70.0)
    rows, columns = np.nonzero(np.any(np.asarray(plain.image) != np.asarray(named.image), axis=-1))
    assert len(rows) > 500 * len(network.arms)
    xy = np.column_stack([named.left + columns / named.scale, named.top - rows / named.scale])
    assert network.surface.signed_distance(xy).max() < 0.0


def test_a_grid_counts_from_the_junctions_centre():
    assert ticks(70.0) == [10.0 * k for k in range(-7, 8)]
    assert len(ticks(300.0)) <= 17
    canvas = new_map(load_network("four_way"), 70.0)
    x, y = canvas.pixels(load_network("four_way").center + np.array([30.0, 40.0])).tolist()
    near = np.asarray(canvas.image)[int(y) - 3 : int(y) + 3, int(x) + 20]
    assert np.any(near != GROUND[:3]), "a line passes 40 m north of the centre"


def test_every_turn_is_drawn_in_its_colour():
    picture = draw_network(load_network("t_junction"))
    assert picture.width == LEFT_PX + SIDE_PX
    body = np.asarray(picture)[100:]
    for turn in ("left", "straight", "right"):
        assert count(body, TURNS[turn]) > 200


def closed_to_cars(path, name, lane, users):
    """A shipped network with a lane that only `users` may use."""
    text, begin = load_network(name).path.read_text(), f'<lane id="{lane}"'
    assert begin in text
    path.write_text(text.replace(begin, f'{begin} allow="{users}"' if users else f'{begin} disallow="all"'))
    return Network(path)


@pytest.mark.parametrize(
    ("lane", "users", "colour"),
    [("west_in_0", "bus bicycle", RESERVED), ("south_out_0", "taxi", RESERVED),
     ("west_out_0", "bicycle pedestrian", RESERVED), ("north_out_0", "pedestrian", PAVEMENT),
     ("south_out_0", "", GROUND)],
)  # fmt: skip
def test_lanes_closed_to_cars_are_drawn_and_are_no_road(tmp_path, lane, users, colour):
    whole, network = load_network("four_way"), closed_to_cars(tmp_path / "n.net.xml", "four_way", lane, users)
    middle = whole.lanes[lane].xy.mean(axis=0) + 0.3
    assert whole.surface.signed_distance(middle) > 1.0
    assert network.surface.signed_distance(middle) < -1.0
    canvas = new_map(network, 75.0)
    x, y = canvas.pixels(middle).astype(int)
    assert count(np.asarray(canvas.image)[y - 3 : y + 3, x - 3 : x + 3], colour, 0) == 36
    filled = {shape[0] for shape in road_shapes(network) if shape[1] == 0}
    layers = {RESERVED: {"reserved"}, PAVEMENT: {"pavement"}, GROUND: set()}[colour]
    assert filled == {"asphalt", "mark"} | layers, "replays show the same"


@pytest.mark.parametrize("state", ["m", "s", "w"])
def test_a_stop_sign_has_a_stop_line_and_no_teeth(tmp_path, state):
    """Also where the other arms have priority."""
    text = load_network("four_way").path.read_text()
    found = re.findall(r'<connection from="south_in" .*? fromLane="0" .*? state="m"', text)
    for link in found:
        text = text.replace(link, link.replace('state="m"', f'state="{state}"'))
    (tmp_path / "stop.net.xml").write_text(text)
    network = Network(tmp_path / "stop.net.xml")
    assert {arm.name for arm in network.arms if arm.major} == {"east", "west"}
    assert network.stopping == (set() if state == "m" else {"south_in_0"})
    canvas, ends = new_map(network, 30.0), [network.lanes[f"south_in_{k}"].xy[-1] for k in (0, 1)]
    shares = []
    for end in ends:
        x, y = canvas.pixels(end).astype(int)
        half = int(1.5 * canvas.scale)
        shares.append(count(np.asarray(canvas.image)[y : y + 2, x - half : x + half], MARK) / (4 * half))
    assert (shares[0] > 0.95) == (state != "m")
    assert shares[1] < 0.95


@pytest.mark.parametrize(("node_type", "most"), [("allway_stop", 1.0), ("right_before_left", 0.6)])
def test_stop_lines_are_drawn_where_all_must_stop_not_where_the_right_goes_first(tmp_path, node_type, most):
    network = Network(bent(tmp_path, node_type))
    canvas, end = new_map(network, 30.0), network.lanes["south_in_0"].xy[-1]
    x, y = canvas.pixels(end).astype(int)
    half = int(1.5 * canvas.scale)
    share = count(np.asarray(canvas.image)[y : y + 2, x - half : x + half], MARK) / (4 * half)
    assert most - 0.3 < share <= most


def test_the_lanes_of_a_ring_are_told_apart():
    network = Network(data_folder("results") / "held-out-18" / "networks" / "oval" / "oval.net.xml")
    canvas, outer = new_map(network, 40.0), network.lanes["ring_north_0"]
    between = offset_polyline(outer.xy, 0.5 * outer.width)
    x, y = canvas.pixels(resample(between, np.arange(1.0, 23.0, 0.1))).astype(int).T
    marked = np.abs(np.asarray(canvas.image)[y, x].astype(int) - MARK[:3]).sum(axis=-1) < 60
    assert 0.2 < marked.mean() < 0.7, "a broken line"


def test_a_cycle_lane_on_a_roundabouts_ring_is_drawn(tmp_path):
    text, inner = load_network("roundabout").path.read_text(), "11.0,5.5 9.0,9.0 5.5,11.0"
    begin = text.index('<lane id="ring_east_north_0"')
    end = text.index("/>", begin) + 2
    more = f'<lane id="ring_east_north_1" index="1" allow="bicycle" speed="8" length="8" shape="{inner}"/>'
    (tmp_path / "ring.net.xml").write_text(text[:end] + more + text[end:])
    (lane,) = Network(tmp_path / "ring.net.xml").reserved
    assert not lane.is_pavement
    assert np.abs(lane.area - [9.0, 9.0]).max() < 6.0


def test_a_route_is_drawn_from_each_lane_that_it_may_begin_on(monkeypatch):
    """Of two lanes that lead straight on only one was drawn."""
    network, drawn = load_network("four_way"), []
    monkeypatch.setattr(
        "rudc.drawing.network_picture.draw_route", lambda _, route, **_more: drawn.append(route)
    )
    draw_network(network)
    begins = {(route.origin, route.destination, network.inbound_lane(route.row).index) for route in drawn}
    assert begins == {
        (movement.origin, movement.destination, network.inbound_lane(row).index)
        for movement in network.onward
        for row in movement.rows
    }
    assert len(begins) == len(drawn) > len(network.onward)


def test_a_dot_where_it_waits_is_drawn_only_of_routes_that_yield(monkeypatch):
    """The table of `network check` leaves the others blank."""
    network, dots = load_network("t_junction"), []
    monkeypatch.setattr(Canvas, "dot", lambda self, x, y, radius, colour: dots.append((x, y)))
    draw_network(network)
    waits = [
        network.route(movement.origin, movement.destination, network.inbound_lane(row).index)
        for movement in network.onward
        for row in movement.rows
        if not movement.major
    ]
    assert set(dots) == {tuple(map(float, route.path.pose(route.waiting_s)[:2])) for route in waits}
