"""Predicted conflicts: against direct simulation with exact rectangles, integrated IDM, cases by hand."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rudc.env import conflict, kernels
from rudc.env.conflict import ACCELERATIONS, FEATURES, conflict_features, idm
from rudc.env.kernels import FARTHEST, UNIT, code, table_gaps
from rudc.env.route_tables import RouteTables
from rudc.geometry import rectangle_gaps
from rudc.network.paths import SPACING
from rudc.vehicle import EgoVehicle
from rudc.world.scene import Kind

TIMES = np.arange(0.25, 5.01, 0.25)


def named(scene):
    values = conflict_features(scene)
    assert values.shape == (len(FEATURES),) == (41,)
    return dict(zip(FEATURES, values.tolist(), strict=True))


def free_way(v, v0):
    """m, way under IDM on a free road at `TIMES`."""
    solved = solve_ivp(
        lambda _, y: [y[1], conflict.IDM_ACCEL * (1 - (y[1] / v0) ** 4)],
        (0, 5),
        [0, v],
        t_eval=TIMES,
        rtol=1e-9,
    )
    return solved.y[0]


def ego_way(v, a, limit):
    way, speed, result = 0.0, v, []
    for _ in range(5000):
        new = min(max(speed + a * 0.001, 0.0), max(limit, v))
        way += 0.001 * (speed + new) / 2
        speed = new
        result.append(way)
    return np.array(result)[(TIMES * 1000).astype(int) - 1]


@pytest.mark.parametrize("v", [0.0, 0.4, 3.0, 9.0, 10.0, 14.0])
def test_free_road_is_idm(make_scene, v):
    scene = make_scene(others=[(2, 80.0, v, -1.0)])
    rows = np.full((scene.network.paths.count, 5), 10.0)
    table = conflict._U_MOST, conflict._TAU, conflict._U, conflict._Y
    motion = scene.path, scene.path_s, scene.velocity, scene.acceleration
    s = kernels.others_s(np.array([0]), rows, *motion, conflict.IDM_ACCEL, *table, TIMES)
    np.testing.assert_allclose(s[0, 0] - 80.0, free_way(v, max(v, 10.0)), atol=5e-3)


@pytest.mark.parametrize(("v", "a"), [(8.0, -3.0), (8.0, 0.0), (5.0, 1.5), (0.0, -2.0)])
def test_braking_keeps_the_deceleration_until_standstill(v, a):
    way = [kernels.braking_way(v, a, float(t)) for t in TIMES]
    stop = v / -a if a < 0 else math.inf
    t = np.minimum(TIMES, stop)
    np.testing.assert_allclose(way, v * t + 0.5 * min(a, 0.0) * t**2, atol=1e-4)


@pytest.mark.parametrize("v", [0.0, 3.0, 9.5, 12.0])
def test_the_egos_futures(make_scene, v):
    scene = make_scene(v=v)
    limit = scene.route.speed_limit
    ways = kernels.ego_s(scene.ego_s, v, max(limit, v), np.array(ACCELERATIONS), TIMES) - scene.ego_s
    for k, a in enumerate(ACCELERATIONS):
        np.testing.assert_allclose(ways[k], ego_way(v, a, limit), atol=0.02)


def body_on(network, row, s, length):
    """(2, n) m and (n,) rad, centres and headings of vehicles on a way; cars have their centre on it, longer
    vehicles both ends."""
    if length > 6.0:
        centre, heading = network.paths.body_pose(np.full(len(s), row), s, length)
        return centre.T, heading
    x, y, heading = network.paths.pose(np.full(len(s), row), s)
    return np.array([x, y]), heading


@pytest.mark.parametrize("seed", range(12))
def test_gaps_are_those_of_a_direct_simulation(make_scene, network, seed):
    rng = np.random.default_rng(seed)
    turn = ["left", "straight", "right"][seed % 3]
    start = float(rng.uniform(85, 130))
    probe = make_scene("south", turn, s=start)
    meets = np.flatnonzero(np.isfinite(network.conflict(probe.route)[:, 0]))
    meets = meets[network.paths.origin[meets] != network.paths.origin[probe.route.row]]
    row = int(rng.choice(meets))
    enters = float(network.conflict(probe.route)[row, 2])
    other = (row, enters - float(rng.uniform(0, 30)), float(rng.uniform(0, 11)), float(rng.uniform(-3, 1)))
    size = [(5.0, 1.8), (12.0, 2.5), (2.2, 0.9)][seed % 3]
    scene = make_scene("south", turn, s=start, v=float(rng.uniform(0, 10)), others=[other], size=size)
    values = named(scene)
    limit = float(network.paths.speed_limit[row])
    braking = np.array([kernels.braking_way(other[2], other[3], float(t)) for t in TIMES])
    ways = {"free": free_way(other[2], max(limit, other[2])), "braking": braking}
    for a in ACCELERATIONS:
        ours = scene.ego_s + ego_way(scene.ego.v, a, scene.route.speed_limit)
        x, y, psi = scene.route.path.pose(ours)
        for hypothesis, way in ways.items():
            (px, py), heading = body_on(network, row, other[1] + way, size[0])
            gaps = [
                rectangle_gaps(
                    pose[0], pose[1], pose[2], 5.0, 1.8, np.array([[qx, qy]]), np.array([h]), np.array([size])
                )[0]
                for *pose, qx, qy, h in zip(x, y, psi, px, py, heading, strict=True)
            ]
            least = min(min(gaps), 10.0)
            assert 10 * values[f"gap_{hypothesis}_{a:g}"] == pytest.approx(least, abs=0.5)
            time = 5 * values[f"time_{hypothesis}_{a:g}"]
            assert np.min(gaps, where=time - 0.01 > TIMES, initial=10.0) > 0.3 - 0.5
            if min(gaps) > 0.8:
                assert time == 5.0


@pytest.mark.parametrize("size", [(5.0, 1.8), (12.0, 2.5)])
def test_route_tables_hold_the_gaps(network, size):
    """A bus stood with its centre on its way, along the tangent: more than a metre off in a turn."""
    route = network.route("south", "left")
    tables = RouteTables(network, route)
    rows = np.flatnonzero(np.isfinite(network.conflict(route)[:, 0]))
    rng = np.random.default_rng(0)
    for row in rows:
        ours = np.rint(rng.uniform(80, 160, 50) * 2) / 2
        theirs = np.rint(rng.uniform(80, 160, 50) * 2) / 2
        gaps, entries = tables.find(EgoVehicle(), np.array([code(int(row), *size)]))
        looked_up = np.full((1, 1, 50), FARTHEST)
        table_gaps(gaps, entries, SPACING, ours[None], theirs[None, None], looked_up)
        x, y, psi = route.path.pose(ours)
        centre, heading = body_on(network, int(row), theirs, size[0])
        for k in range(50):
            gap = rectangle_gaps(
                x[k], y[k], psi[k], 5.0, 1.8, centre[None, :, k], heading[k : k + 1], np.array([size])
            )
            assert looked_up[0, 0, k] == pytest.approx(min(gap[0], FARTHEST), abs=UNIT)


def test_limits_of_the_ego_need_no_table_of_their_own(network):
    """An outlook shows the ego with the limits that the road gives, which change in an episode."""
    route = network.route("south", "left")
    tables, row = RouteTables(network, route), np.flatnonzero(np.isfinite(network.conflict(route)[:, 0]))[0]
    codes = np.array([code(int(row), 5.0, 1.8)])
    first, weaker, wider = (
        tables.find(body, codes)[1][0, 0]
        for body in (EgoVehicle(), EgoVehicle(a_min=-2.0, a_max=1.0), EgoVehicle(width=2.2))
    )
    assert first == weaker != wider


def test_whoever_follows_does_not_count(make_scene, network):
    route = network.route("south", "straight")
    scene = make_scene("south", "straight", s=100.0, v=5.0, others=[(route.row, 90.0, 9.0, 0.0)])
    values = named(scene)
    assert all(value == 1.0 for name, value in values.items() if name.startswith(("gap_", "time_")))
    assert values["leader_gap"] == 1.0
    ahead = make_scene("south", "straight", s=90.0, v=9.0, others=[(route.row, 102.0, 3.0, 0.0)])
    assert named(ahead)["time_braking_2.5"] < 1.0


def test_leader(make_scene, network):
    route = network.route("south", "straight")
    scene = make_scene("south", "straight", s=80.0, v=9.0, others=[(route.row, 100.0, 4.0, 0.0)])
    values = named(scene)
    assert 50 * values["leader_gap"] == pytest.approx(15.0, abs=0.3)
    assert 10 * values["leader_speed"] == pytest.approx(-5.0)
    assert 6 * values["leader_idm"] == pytest.approx(idm(9.0, 10.0, 15.0, 5.0), abs=0.1)
    fast = dataclasses.replace(scene, route=dataclasses.replace(scene.route, limits=((-np.inf, 25.0),)))
    assert 6 * named(fast)["leader_idm"] == pytest.approx(idm(9.0, 15.0, 15.0, 5.0), abs=0.1)
    beside = make_scene("south", "straight", s=80.0, others=[(14, 95.0, 4.0, 0.0)])  # in the lane beside
    assert named(beside)["leader_gap"] == 1.0


def test_idm_is_treiber_hennecke_and_helbing():
    assert idm(0.0, 10.0) == pytest.approx(conflict.IDM_ACCEL)
    assert idm(10.0, 10.0) == pytest.approx(0.0)
    wanted = conflict.IDM_GAP + 5 * conflict.IDM_HEADWAY
    assert idm(5.0, 10.0, wanted, 0.0) == pytest.approx(-conflict.IDM_ACCEL / 16)


def test_obstacles_and_others_without_a_path(make_scene, network):
    route = network.route("south", "left")
    x, y, psi = (float(value) for value in route.path.pose(130.0))
    scene = make_scene(s=112.0, v=8.0, others=[(-1, (x, y, psi + 1.0), 0.0, 0.0)])
    values = named(dataclasses.replace(scene, kind=np.array([int(Kind.OBSTACLE)])))
    assert values["gap_free_0"] == values["gap_braking_0"] == 0.0
    assert 0.2 < values["time_free_2.5"] < values["time_free_0"] < 1.0
    assert values["gap_free_-4"] > 0.4
    assert 8 < 50 * values["leader_gap"] < 14
    walker = make_scene(s=112.0, v=8.0, others=[(-1, (x + 6.0, y, math.pi), 2.0, 0.0)], size=(0.5, 0.5))
    assert named(walker)["gap_free_0"] < 0.2
    away = make_scene(s=112.0, v=8.0, others=[(-1, (x + 9.0, y + 9.0, 0.0), 2.0, 0.0)], size=(0.5, 0.5))
    assert named(away)["gap_free_0"] > 0.2


def test_occupancy_of_the_conflict_zone(make_scene, network, row_of):
    row = row_of("west", "east")
    route = network.route("south", "left")
    enters, leaves = network.conflict(route)[row, 2:]
    scene = make_scene(others=[(row, float(enters) - 22.5, 10.0, 0.0)])  # front there after 2 s
    values = named(scene)
    through = (min(leaves, network.paths.exit_s[row]) - enters + 25.0) / 10.0
    expected = [1.0 if (k + 1) * 0.5 > 2.0 and k * 0.5 + 0.25 < through else 0.0 for k in range(10)]
    assert [values[f"occupied_{k}"] for k in range(10)] == expected
    assert 5 * values["first_occupied"] == pytest.approx(2.0)
    assert values["first_free"] == 0.0
    on_it = named(make_scene(others=[(row, float(enters), 0.0, 0.0)]))
    assert on_it["first_occupied"] == 0.0
    assert on_it["first_free"] > 0.0


def test_alone(make_scene):
    values = named(make_scene())
    assert all(value == 1.0 for name, value in values.items() if name.startswith(("gap_", "time_")))
    assert not any(values[f"occupied_{k}"] for k in range(10))
    assert (values["first_free"], values["first_occupied"]) == (0.0, 1.0)
    assert (values["leader_gap"], values["leader_speed"]) == (1.0, 0.0)


def test_progress_and_waiting(make_scene, network):
    route = network.route("east", "left")
    at_line = make_scene("east", "left", s=route.stop_line_s - 2.5, v=0.0, waited_s=4.0, time_s=10.0)
    values = named(at_line)
    assert values["to_stop_line"] == pytest.approx(0.0)
    assert 50 * values["to_waiting_point"] == pytest.approx(route.waiting_s - route.stop_line_s)
    assert 50 * values["to_zone_end"] == pytest.approx(route.zone_end_s - route.stop_line_s + 5.0)
    assert (values["waited"], values["priority"], values["elapsed"]) == (0.4, 1.0, 0.25)
    assert named(make_scene("south", "left"))["priority"] == 0.0


def test_those_who_have_passed_do_not_count(make_scene, network, row_of):
    row = row_of("west", "east")
    leaves = network.conflict(network.route("south", "left"))[row, 3]
    scene = make_scene(s=115.0, v=5.0, others=[(row, float(leaves) + 12.0, 8.0, 0.0)])
    assert named(scene)["gap_braking_2.5"] == 1.0
