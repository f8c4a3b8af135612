import copy
import math
import pickle

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from rudc.errors import InputError, NetworkError
from rudc.network.check import waiting_gap
from rudc.network.network import load_network, shipped_networks
from rudc.network.paths import SPACING
from rudc.network.polyline import wrap
from rudc.network.route import ReferencePath
from rudc.network.route_builder import fits
from rudc.vehicle import EgoVehicle
from rudc.world.ego import EgoPlant

NETWORKS = sorted(shipped_networks())
STEERING_LIMIT = np.tan(0.5) / 2.8


def routes(name):
    network = load_network(name)
    for movement in network.movements:
        for lane in sorted({network.inbound_lane(row).index for row in movement.rows}):
            yield network, network.route(movement.origin, movement.destination, lane)


@pytest.mark.parametrize("name", NETWORKS)
def test_paths_are_smooth_drivable_and_on_the_road(name):
    for network, route in routes(name):
        for path in (route.path, *route.alternatives):
            steps = np.hypot(*np.diff(path.xy, axis=0).T)
            assert steps.max() < 0.55
            assert steps.min() > 0.45
            assert np.abs(np.diff(path.heading)).max() < 0.5 * STEERING_LIMIT
            assert np.abs(path.curvature).max() <= STEERING_LIMIT
            assert fits(network, path, network.vehicle, margin=0.1)


@pytest.mark.parametrize("name", NETWORKS)
@settings(max_examples=60)
@given(data=st.data())
def test_project_undoes_pose(name, data):
    network = load_network(name)
    movement = data.draw(st.sampled_from(network.movements))
    route = network.route(movement.origin, movement.destination)
    s = data.draw(st.floats(-10.0, route.length + 10.0))
    x, y, _ = (float(v) for v in route.path.pose(s))
    if movement.turn != "u_turn":
        found, offset = route.path.project(x, y)
        assert found == pytest.approx(s, abs=1e-6)
        assert offset == pytest.approx(0.0, abs=1e-9)
    hint = s + data.draw(st.floats(-5.0, 5.0))
    found, offset = route.path.project(x, y, hint)
    assert found == pytest.approx(s, abs=1e-6)
    assert offset == pytest.approx(0.0, abs=1e-9)


@settings(max_examples=100)
@given(st.sampled_from(("left", "straight", "right")), st.floats(5.0, 250.0), st.floats(-3.0, 3.0))
@example("right", 120.0, -1.0)
@example("right", 122.375, -3.0)
@example("left", 125.0, 2.0)
def test_a_point_beside_the_path_has_its_offset(turn, s, offset):
    """From wherever the search starts: the foot is where it should be, and no other is nearer."""
    path = load_network("four_way").route("south", turn).path
    x, y, psi = (float(v) for v in path.pose(s))
    px, py = x - offset * np.sin(psi), y + offset * np.cos(psi)
    bend = path.curvature[int(s / SPACING)]

    def distance(at):
        there = path.pose(at)
        return np.hypot(px - there[0], py - there[1])

    nearest = distance(s + np.arange(-2.0, 2.0, 0.005)).min()
    for start in (s + 2.0, s - 3.0, None):
        found, measured = path.project(px, py, start)
        assert (
            abs(found - s) * (1.0 - offset * bend) <= 0.086
        )  # the same angle is more of s towards a bend's centre
        assert measured == pytest.approx(offset, abs=0.05)
        assert distance(found) == pytest.approx(abs(measured), abs=1e-6)
        assert abs(measured) <= nearest + 0.005


@pytest.mark.parametrize("name", NETWORKS)
def test_places_along_a_route_come_in_order(name):
    for network, route in routes(name):
        assert 0 < route.stop_line_s <= route.waiting_s < route.exit_s < route.length
        assert route.stop_line_s <= route.zone_start_s <= route.zone_end_s <= route.exit_s
        row = network.paths
        np.testing.assert_allclose(
            np.stack(route.path.pose(route.stop_line_s)[:2]),
            np.stack(row.pose(np.array(route.row), row.stop_s[route.row])[:2]),
            atol=0.1,
        )


@pytest.mark.parametrize("name", NETWORKS)
def test_a_route_turns_by_its_movements_angle(name):
    for network, route in routes(name):
        movement = network.movement(route.origin, route.destination)
        turned = route.path.heading[-1] - route.path.heading[0]
        assert wrap(turned - movement.angle) == pytest.approx(0.0, abs=0.02)
        assert route.task == {"left": 0, "u_turn": 0, "straight": 1, "right": 2}[route.turn]


@pytest.mark.parametrize("name", NETWORKS)
def test_the_canonical_angle_brings_every_arm_to_the_south(name):
    for _, route in routes(name):
        heading = route.path.heading[20] - route.canonical_angle
        assert wrap(heading - np.pi / 2) == pytest.approx(0.0, abs=0.25 if name == "roundabout" else 0.01)


@pytest.mark.parametrize("name", NETWORKS)
def test_edges_enclose_the_path_and_are_lines(name):
    for network, route in routes(name):
        for edge, width, side in (
            (route.left_edge, route.left_width, 1.0),
            (route.right_edge, route.right_width, -1.0),
        ):
            assert width.min() > 1.0
            assert edge.shape == route.path.xy.shape
            np.testing.assert_allclose(np.hypot(*(edge - route.path.xy).T), width, atol=1e-9)
            normal = np.column_stack([-np.sin(route.path.heading), np.cos(route.path.heading)])
            np.testing.assert_allclose(
                np.sum((edge - route.path.xy) * normal, axis=1), side * width, atol=1e-9
            )
            assert np.hypot(*np.diff(edge, axis=0).T).max() < 2.0
            assert np.abs(np.diff(width)).max() <= 0.25 + 1e-9
            assert network.surface.signed_distance(edge).min() > -0.15


def test_on_an_arm_the_left_edge_is_the_divider_and_the_right_edge_the_kerb():
    route = load_network("four_way").route("south", "left")
    before = route.path.s < route.stop_line_s - 5.0
    np.testing.assert_allclose(route.left_edge[before][:, 0], 0.0, atol=0.02)
    np.testing.assert_allclose(route.right_edge[before][:, 0], 7.0, atol=0.02)
    after = route.path.s > route.exit_s + 5.0
    np.testing.assert_allclose(route.left_edge[after][:, 1], 0.0, atol=0.02)
    np.testing.assert_allclose(route.right_edge[after][:, 1], 7.0, atol=0.02)


@pytest.mark.parametrize("name", ["four_way", "four_way_equal", "t_junction", "skewed_four_way"])
def test_left_turns_turn_late_on_an_arc_of_their_radius(name):
    for _, route in routes(name):
        if route.turn == "left":
            assert np.abs(route.path.curvature).max() == pytest.approx(1 / 10.5, rel=0.03)


def test_two_opposing_left_turners_never_overlap_wherever_they_wait():
    network = load_network("four_way")
    for one, other in (("south", "north"), ("east", "west")):
        a, b = network.route(one, "left"), network.route(other, "left")
        assert waiting_gap(a, b) > 3.0
        gap = np.hypot(*(a.path.xy[:, None] - b.path.xy[None]).transpose(2, 0, 1)).min()
        assert gap > 1.8 + 1.5


@pytest.mark.parametrize("name", NETWORKS)
def test_a_car_at_its_waiting_position_is_clear_of_all_it_must_yield_to(name):
    for network, route in routes(name):
        paths = network.paths
        s = np.arange(route.stop_line_s - 5.0, route.waiting_s, 0.25)
        x, y, psi = route.path.pose(s)
        left = np.column_stack([x - 0.9 * np.sin(psi), y + 0.9 * np.cos(psi)])
        right = np.column_stack([x + 0.9 * np.sin(psi), y - 0.9 * np.cos(psi)])
        body = np.concatenate([left, right])
        for rival in np.flatnonzero(paths.yields[route.row] & (paths.origin != paths.origin[route.row])):
            along = np.arange(paths.stop_s[rival], paths.exit_s[rival], 0.25)
            u, v, _ = paths.pose(np.full(len(along), rival), along)
            gap = np.hypot(body[:, :1] - u, body[:, 1:] - v).min()
            assert gap > 1.5 or route.waiting_s == route.stop_line_s


def test_a_major_left_turner_waits_inside_and_a_major_straight_one_has_no_reason_to():
    network = load_network("four_way")
    left, straight = network.route("east", "left"), network.route("east", "straight")
    assert left.waiting_s > left.stop_line_s + 7.0
    assert straight.waiting_s == straight.stop_line_s
    assert left.major
    assert straight.major
    assert not network.route("south", "left").major


@pytest.mark.parametrize("name", NETWORKS)
def test_conflicts_are_where_centre_lines_come_close(name):
    for network, route in routes(name):
        table = network.conflict(route)
        paths = network.paths
        assert table.shape == (paths.count, 4)
        assert network.conflict(route.path) is table
        for row in range(0, paths.count, 3):
            s = SPACING * np.arange(int(paths.length[row] / SPACING) + 1)
            xy = paths.xy[row, : len(s)]
            close = np.hypot(*(route.path.xy[:, None] - xy[None]).transpose(2, 0, 1)) < 2.2
            if not close.any():
                assert np.isnan(table[row]).all()
                continue
            ours, theirs = np.flatnonzero(close.any(axis=1)), np.flatnonzero(close.any(axis=0))
            expected = [route.path.s[ours[0]], route.path.s[ours[-1]], s[theirs[0]], s[theirs[-1]]]
            np.testing.assert_allclose(table[row], expected)


def test_crossing_paths_conflict_at_the_crossing_only():
    network = load_network("four_way")
    row = network.movement("west", "straight").rows[0]
    s_in, s_out, other_in, other_out = network.conflict(network.route("south", "straight"))[row]
    assert 3.0 < s_out - s_in < 5.0
    assert 3.0 < other_out - other_in < 5.0


def test_alternatives_lead_to_the_other_lane():
    network = load_network("four_way")
    for turn, lane in (("left", "west_out_0"), ("straight", "north_out_1"), ("right", "east_out_1")):
        (other,) = network.route("south", turn).alternatives
        assert np.hypot(*(other.xy[-1] - network.lane(lane).xy[-1])) < 1.0
    assert load_network("roundabout").route("south", "left").alternatives == ()


def test_the_inbound_lane_can_be_chosen_and_is_checked():
    network = load_network("four_way")
    assert network.inbound_lane(network.route("south", "straight").row).index == 0
    assert network.inbound_lane(network.route("south", "straight", lane=1).row).index == 1
    with pytest.raises(NetworkError, match=r"not permitted from lane 0, only from 1"):
        network.route("south", "left", lane=0)


def test_a_pickled_route_is_the_same_route():
    route = load_network("skewed_four_way").route("south", "left")
    data = pickle.dumps((route, load_network("skewed_four_way")))
    assert len(data) < 2000
    again, network = pickle.loads(data)
    assert again is route
    assert network is load_network("skewed_four_way")


def test_routes_are_those_of_a_vehicle():
    wide = EgoVehicle(width=2.6, length=8.0)
    ordinary, network = load_network("four_way"), load_network("four_way", vehicle=wide)
    assert load_network("four_way", vehicle=EgoVehicle()) is ordinary
    assert load_network("four_way", vehicle=EgoVehicle(width=2.6, length=8.0)) is network
    route = network.route("south", "left")
    assert route.waiting_s < ordinary.route("south", "left").waiting_s
    assert fits(network, route.path, wide)
    again = pickle.loads(pickle.dumps((route, network)))
    assert again[0] is route
    assert again[1] is network
    assert copy.deepcopy(route) is route


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"length": math.nan}, r"length=nan is no finite number"),
        ({"width": "2"}, r"width='2' is no finite number"),
        ({"v_max": math.inf}, r"v_max=inf is no finite number"),
        ({"width": 0.0}, r"it must be that length > 0, width > 0, v_max > 0, .* width=0\.0"),
        ({"cg_to_rear": 2.8}, r"it must be that 0 < cg_to_rear < wheelbase"),
        ({"a_min": 6.0}, r"it must be that a_min < 0 < a_max"),
        ({"delta_max": 35.0}, r"it must be that 0 < delta_max < pi/2"),
    ],
)
def test_a_vehicle_that_no_car_is_has_no_routes(values, said):
    with pytest.raises(InputError, match=said):
        load_network("four_way", vehicle=EgoVehicle(**values))


@pytest.mark.parametrize("turn", ["left", "right"])
def test_a_car_that_turns_in_wide_circles_gets_no_arc_that_it_cannot_drive(turn):
    """Arcs were drawn down to 5.2 m whatever the car, and its wheels were taken to turn by 0.5 rad."""
    long = EgoVehicle(length=6.0, wheelbase=4.0, cg_to_rear=2.0, delta_max=0.4)
    path = load_network("t_junction", vehicle=long).route("south", turn).path
    assert np.abs(path.curvature).max() < long.tightest < 0.85 * math.tan(0.4) / 4.0
    assert EgoVehicle().tightest == math.tan(0.5) / 2.8, "of which a part is kept for corrections"


@pytest.mark.parametrize("bend", [-0.18, -0.05, 0.1, 0.19])
def test_the_body_on_a_path_stands_as_the_plant_does(bend):
    """Driven with the steering of its curvature, the plant's heading stays that of `body_pose`."""
    angle = np.arange(0.0, 2.0, 0.001)
    path = ReferencePath(np.column_stack([np.sin(angle), np.sign(bend) * (1 - np.cos(angle))]) / abs(bend))
    body, start = EgoVehicle(), 1.5
    (x, y), psi = path.body_pose(np.array(start), body)
    plant = EgoPlant(body)
    plant.reset(float(x), float(y), float(psi), 3.0)
    slip = math.asin(body.cg_to_rear * bend)
    steering = math.atan(body.wheelbase / body.cg_to_rear * math.tan(slip))
    for _ in range(10):
        state = plant.step(0.0, steering, 0.1)
    (x, y), psi = path.body_pose(np.array(start + 3.0), body)
    assert (state.x, state.y, state.psi) == pytest.approx((float(x), float(y), float(psi)), abs=0.01)
