"""The filter's kernels against the same formulas in numpy, and against brute force."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rudc.env.tracking import PREVIEW_S, steering, way_back_of
from rudc.geometry import separation
from rudc.network.paths import SPACING
from rudc.network.route import ReferencePath
from rudc.safety import barrier_kernels, kernels, last_resort_kernels, residual_kernels
from rudc.vehicle import EgoVehicle
from rudc.world.ego import EgoPlant
from tests.safety.scenes import crossing_paths, make_scene

RNG = np.random.default_rng


def lines():
    paths = crossing_paths().paths
    return paths.poses, paths.stations


def others(rng, n=30):
    """Position, heading, velocity, size, row and arc length of some on paths and some without."""
    heading = rng.uniform(-3, 3, n)
    speed = rng.uniform(0, 12, n)
    velocity = speed[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    size = np.stack([rng.uniform(1, 12, n), rng.uniform(0.5, 2.5, n)], axis=1)
    place, s = rng.uniform(-40, 40, (n, 2)), rng.uniform(-5, 210, n)
    return place, heading, velocity, size, rng.integers(-1, 3, n), s


def predicted(bodies, tracks, who, way):
    """`prediction`'s formula for all at once."""
    (position, heading, velocity, size, path, path_s), (poses, stations) = bodies, tracks
    poses = poses.reshape(-1, stations, 3)
    now, rows = position[who, 0] + 1j * position[who, 1], np.maximum(path[who], 0)[:, None]

    length = size[who, :1]

    def on_line(s):
        i = np.clip(s / SPACING, 0, stations - 2).astype(int)
        low, step = poses[rows, i], poses[rows, i + 1] - poses[rows, i]
        return (low + (s / SPACING - i)[..., None] * step)[..., :2] @ [1, 1j]

    def at(s):
        front, rear = on_line(s + 0.5 * length), on_line(s - 0.5 * length)
        along = (front - rear) / np.abs(front - rear)
        return front - 0.5 * length * along, along

    line, along = at(path_s[who, None] + way)
    start, first = at(path_s[who, None])
    ahead = line + (now[:, None] - start) * first.conj() * along
    turned = np.exp(1j * heading[who, None]) * first.conj() * along
    drift = velocity[who] @ [1, 1j]
    straight = now[:, None] + (drift / np.maximum(np.abs(drift), 1e-9))[:, None] * way
    free = path[who, None] < 0
    return np.where(free, straight, ahead), np.where(free, np.exp(1j * heading[who, None]), turned)


def test_others_follow_their_paths_and_who_has_none_goes_straight_on():
    rng, tracks = RNG(1), lines()
    bodies, who = others(rng), np.arange(30)[::-2].copy()
    way = np.concatenate([np.zeros((len(who), 1)), rng.uniform(0, 40, (len(who), 7))], axis=1)
    for got, wanted in zip(
        kernels.others_ahead(*bodies, *tracks, who, way), predicted(bodies, tracks, who, way), strict=True
    ):
        assert got == pytest.approx(wanted, abs=1e-9)


def test_ellipses_that_meet_are_those_of_the_formula():
    rng, tracks, times = RNG(2), lines(), np.linspace(0, 3, 16)
    bodies = others(rng, 200)
    speed = np.hypot(*bodies[2].T)
    ego = (np.linspace(-20, 4, 16) * np.array([[1.0], [1.6]])).astype(complex)
    facing = np.full(ego.shape, np.exp(0.3j))
    half = rng.uniform(0.4, 3, (2, 2, 200))
    short, stretch = np.minimum(*half) ** 2, np.maximum(*half) ** 2 - np.minimum(*half) ** 2
    place, turned = predicted(bodies, tracks, np.arange(200), speed[:, None] * times)
    r = ego[:, None] - place
    squared = np.abs(r) ** 2
    radii = [
        np.sqrt(short[k][:, None] + stretch[k][:, None] * (r * towards.conj()).real ** 2 / squared)
        for k, towards in ((0, facing[:, None]), (1, turned[None]))
    ]
    wanted = (np.abs(r) < radii[0] + radii[1] + 0.8).any(axis=(0, 2))
    got = kernels.meeting(*bodies, *tracks, ego, facing, times, 50.0, 0.8, short, stretch)
    assert 10 < wanted.sum() < 190
    assert (got == wanted).all()


def test_room_is_the_least_separation_less_what_is_allowed():
    rng, tracks, times = RNG(3), lines(), np.linspace(0, 2.5, 26)
    bodies = others(rng, 60)
    size = bodies[3]
    acceleration = rng.uniform(-3, 1, 60)
    line = tracks[0][: tracks[1]]  # northwards through the origin, which is at 100 m
    bodies[0][:6], bodies[1][:6] = [[0.3 * k - 0.8, 5.0 * k - 5] for k in range(6)], np.pi / 2
    reached = *bodies, acceleration, *tracks, -10 + 0j, 15.0, times, 0.5, 1.0, line, 97.0, 1.5, 0.7, -9.0, 2.0
    who, place, facing, half, still = last_resort_kernels.in_reach(*reached)
    speed = np.hypot(*bodies[2].T)
    assert half.tolist() == (0.5 * size[who]).tolist()
    assert still.tolist() == (speed[who] < 2.0).tolist()
    assert 0 < still.sum() < len(still)
    fastest = speed + np.where(acceleration > 0.5, acceleration, 0.0)
    near = np.hypot(*(bodies[0] - [-10, 0]).T) < fastest * 2.5 + 15 + 0.5 * size.sum(axis=1)
    first = np.flatnonzero(near)
    late = first[np.abs(acceleration[first]) > 0.5]
    ahead = 100 + bodies[0][:, 1] - 0.5 * size[:, 0]
    lead = np.array([k for k in first if k < 6 and 100 + bodies[0][k, 1] > 97.0 and ahead[k] < 113.0])
    assert who.tolist() == [*first, *late, *lead]
    assert len(lead) > 1
    a = np.concatenate([acceleration[late], np.full(len(lead), -9.0)])[:, None]
    v = speed[[*late, *lead], None]
    assert acceleration[late].min() < -0.5 < 0.5 < acceleration[late].max()
    fine = np.linspace(0, 2.5, 2501)
    speeds = np.where(a < 0, np.maximum(v + a * fine, 0.0), v + a * np.minimum(fine, 1.0))
    changed = np.concatenate([0 * a, np.cumsum(0.0005 * (speeds[:, 1:] + speeds[:, :-1]), axis=1)], axis=1)
    way = np.concatenate([speed[first, None] * times, changed[:, ::100]])
    wanted = predicted(bodies, tracks, who, way)
    assert place == pytest.approx(wanted[0], abs=1e-3)
    assert facing == pytest.approx(wanted[1], abs=1e-3)
    after = np.maximum(times - 0.1, 0.0)  # 0.5 m in the first 0.1 s, then braking from 5 m/s with 6 m/s2
    way = np.where(times > 0, 0.5 + np.where(after < 5 / 6, 5 * after - 3 * after**2, 25 / 12), 0.0)
    stopping = last_resort_kernels.way_of_stopping(times, 0.1, 0.5, 5.0, 6.0, 0.0, 0.0)
    assert stopping == pytest.approx(way, abs=1e-12)
    ego, towards = last_resort_kernels.on_arc(-10 + 0j, 0.2, way, 0.1, 0.1, 1.4)
    margin = np.where(still, 0.1, 0.3)
    away, shares = place - ego, np.linspace(0.0, 1.0, 101)
    r = away[:, :-1, None] + shares * np.diff(away, axis=1)[:, :, None]
    nearer = np.arange(len(times) - 1)[:, None] + (shares > 0.5)
    body = np.array([2.5, 0.9])
    apart = separation(r, towards[nearer], facing[:, nearer], body, half[:, None, None])
    allowed = np.minimum(margin, apart[:, 0, 0])
    room = apart.min(axis=(1, 2)) - allowed
    got = last_resort_kernels.room_left(place, facing, half, still, ego, towards, *body, 0.3, 0.1)
    near = np.isfinite(got)
    assert (got[near] > room[near] - 0.01).all(), "places 0.2 m apart: at most 0.1 m is missed"
    assert (got[near] < room[near] + 0.11).all()
    assert (room[~near] > 0.0).all()
    at_instants = separation(away, towards, facing, body, half[:, None]).min(axis=1) - allowed
    assert (got[near] <= at_instants[near] + 1e-9).all()
    least = last_resort_kernels.room_to_stop(
        *reached, 0.2, 0.1, 0.5, 5.0, 6.0, 0.0, 0.0, 0.1, 0.1, 1.4, 2.5, 0.9, 0.3, 0.1
    )
    assert least == got.min()
    assert (got < 0).any()
    assert np.isinf(got).any()


def test_who_crosses_fast_is_hit_between_two_instants():
    """A car that crosses at 15 m/s has its rear in the ego's way for 0.02 s, between two instants."""
    times = np.arange(0.0, 0.35, 0.1)
    ego, east = -5.0 + 8.0 * times + 0j, np.ones(len(times), complex)
    car = -1.5 + 1j * (15.0 * (times - 0.27) + 3.4)  # its rear leaves the ego's lane at 0.27 s
    half, still = np.array([[2.5, 0.9]]), np.array([False])
    least = {}
    for fine in (1, 100):
        t = np.linspace(0.0, 0.3, 3 * fine + 1)
        away = -1.5 + 1j * (15.0 * (t - 0.27) + 3.4) - (-5.0 + 8.0 * t)
        ones = np.ones(len(t), complex)
        apart = separation(away, ones, 1j * ones, np.array([2.5, 0.9]), half[0])
        least[fine] = apart.min() - min(0.3, apart[0])
    got = last_resort_kernels.room_left(
        car[None], 1j * east[None], half, still, ego, east, 2.5, 0.9, 0.3, 0.1
    )
    assert least[1] > least[100] + 0.2
    assert got == pytest.approx(least[100], abs=0.11)


def test_an_arc_is_what_small_steps_make_of_it():
    slip, back, way = 0.12, 1.4, np.linspace(0, 12, 13)
    place, facing = last_resort_kernels.on_arc(1 + 2j, 0.7, way, slip, slip, back)
    psi, here, step = 0.7, 1 + 2j, 12 / 120_000
    for _ in range(120_000):
        here += step * np.exp(1j * (psi + slip))
        psi += step * np.sin(slip) / back
    assert place[0] == 1 + 2j
    assert place[-1] == pytest.approx(here, abs=1e-3)
    assert facing[-1] == pytest.approx(np.exp(1j * psi), abs=1e-9)


@pytest.mark.parametrize("delta", [-0.3, 0.0, 0.25])
def test_a_stop_along_a_path_is_the_plants_that_follows_it(delta):
    """Of an ego that was turned away from its path for a step, and brakes at 6 m/s2."""
    angle = np.linspace(0, 1.6, 400)
    path, body, dt = (
        ReferencePath(12 * np.column_stack([np.sin(angle), 1 - np.cos(angle)])),
        EgoVehicle(),
        0.1,
    )
    plant = EgoPlant(body)
    plant.reset(0.0, 0.0, 0.0, 8.0)
    states, s, offset = [plant.state, plant.step(0.0, delta, dt)], 0.0, 0.0
    scene = make_scene([])
    for _ in range(20):
        ego = replace(states[-1], slip=0.0)
        s, offset = path.project(ego.x, ego.y, s)
        now = replace(
            scene, ego=ego, ego_s=s, ego_offset=offset, route=replace(scene.route, path=path), vehicle=body
        )
        after = replace(now, ego=replace(ego, v=max(ego.v - 6.0 * dt, 0.0)))  # steers at the speed after it
        states.append(plant.step(-6.0, steering(after), dt))
    place = np.array([ego.x + 1j * ego.y for ego in states])
    facing = np.exp(1j * np.array([ego.psi for ego in states]))
    v = np.array([ego.v for ego in states])
    way = np.append(0.0, np.cumsum(0.5 * dt * (v[1:] + v[:-1])))
    got = last_resort_kernels.steering_along(
        path.poses, path.curvature, 0.0, place, facing, way, dt, PREVIEW_S, *way_back_of(body),
        body.wheelbase, body.cg_to_rear, body.delta_max, 100.0,
    )  # fmt: skip
    assert got[0] == pytest.approx(place, abs=0.02)
    assert np.angle(got[1] / facing) == pytest.approx(np.zeros(22), abs=0.01)


def test_in_conflict_is_who_meets_at_speed_or_speeding_up_and_does_not_follow():
    rng, tracks, times = RNG(8), lines(), np.linspace(0, 3, 16)
    bodies = others(rng, 400)
    bodies[0][:9] = np.stack([np.full(9, 0.5), np.linspace(-27, -23, 9)], axis=1)  # some are behind
    bodies[1][:9], bodies[2][:9] = 1.5, [0.7, 10.0]
    line, s, ego = tracks[0][: tracks[1]], 80.0, (0.5 - 20j, np.exp(1.5j))
    half, who = np.full((2, 400), 1.5), np.arange(400)[::-3].copy()
    rising = np.minimum(times, (9.0 - 7.0) / 2.0)
    ways = 7.0 * times, 7.0 * times + 2.0 * rising * (times - 0.5 * rising)
    met = [
        kernels.meeting(
            *bodies, *tracks, *(a[None] for a in kernels.follow(line, len(line), 0, s, *ego, way)), times,
            40.0, 0.0, half, half,
        )
        for way in ways
    ]  # fmt: skip
    behind = kernels.driving_behind(*bodies, *tracks, line, s, 45.0, 1.5, 0.7, who)
    got = kernels.in_conflict(
        *bodies, *tracks, line, s, *ego, 7.0, 2.0, 9.0, times, half, half, who, 45.0, 1.5, 0.7
    )
    assert (met[1] & ~met[0]).any()
    assert ((met[0] | met[1])[who] & behind).any()
    assert got.tolist() == ((met[0] | met[1])[who] & ~behind).tolist()


def test_behind_is_who_follows_on_the_line_within_the_tail():
    poses, stations = lines()
    line = poses[:stations]  # northwards through the origin, which is at 100 m

    def behind(here, heading=1j):
        return kernels.drives_behind(line, 100.0, 45.0, 1.5, 0.7, here, heading)

    assert behind(-10j)
    assert behind(1.4 - 30j)
    assert not behind(1.6 - 30j)
    assert not behind(-50j)
    assert not behind(10j)
    assert not behind(-10j, 1 + 0j)
    begun = line[:170]  # ends 15 m before the ego; what lies behind it in memory is no part of it
    assert kernels.drives_behind(begun, 100.0, 45.0, 1.5, 0.7, -20j, 1j)
    assert not kernels.drives_behind(begun, 100.0, 45.0, 1.5, 0.7, -10j, 1j)


def test_the_nearest_place_on_an_edge_is_the_best_of_all_its_pieces():
    rng = RNG(4)
    x = 0.5 * np.arange(120)
    edges = np.stack([x + 1j * (4 + np.sin(x / 9)), x - 1j * (3 + np.cos(x / 7))])
    edges[1, 50:53] = edges[1, 50]  # stations that coincide
    ahead, heading = np.array([-1.4, 0.0, 1.9]), np.exp(0.2j)
    for s in rng.uniform(10, 50, 20):
        position = s + 1j * rng.uniform(-2, 2)
        got = barrier_kernels.to_edges(edges, 0.5, 8.0, position, heading, ahead, float(s))
        share = np.linspace(0, 1, 400)
        fine = (edges[:, :-1, None] + np.diff(edges)[..., None] * share).reshape(2, -1)
        away = (position + ahead * heading)[None, :, None] - fine[:, None]
        assert np.abs(got) == pytest.approx(np.abs(away).min(axis=2).ravel(), abs=1e-4)


def test_who_is_let_through_meets_does_not_follow_and_is_not_passed():
    rng, tracks, times = RNG(5), lines(), np.linspace(0, 3, 16)
    bodies = others(rng, 300)
    size = bodies[3]
    bodies[2][::4] *= 0.01  # some stand
    bodies[0][:9] = np.stack([np.full(9, 0.5), np.linspace(-24.5, -22.5, 9)], axis=1)  # some are behind
    bodies[0][12:40:4], size[12:40:4] = [3.5, -10.0], 2.0  # and some stand beside
    bodies[1][:40] = 1.5
    bodies[0][40], size[40], bodies[1][40] = [-1.65, -23.0], [2.0, 1.8], 1.5  # and one nearer already
    bodies[0][41:60], bodies[1][41:60], bodies[4][41:60] = [-2.7, -19.0], -1.6, 0  # and some come towards it
    bodies[5][41:60], size[41:60] = 81.0, np.linspace([4.0, 1.6], [4.0, 3.6], 19)
    line = tracks[0][: tracks[1]]
    s, here, heading, half = 80.0, 0.5 - 20j, np.exp(1.5j), np.full((2, 300), 2.0)
    ego = here, heading, 7.0
    way = np.linspace(0, 21, 40)
    got = kernels.let_through(
        *bodies,
        *tracks,
        line,
        s,
        *ego,
        2.0,
        12.0,
        times,
        0.8,
        half,
        half,
        45.0,
        1.5,
        0.7,
        0.2,
        0.3,
        way,
        2.5,
        0.9,
    )
    place, facing = (a[None] for a in kernels.follow(line, len(line), 0, s, here, heading, 7.0 * times))
    met = kernels.meeting(*bodies, *tracks, place, facing, times, 21.0, 0.8, half, half)
    centre, turned = bodies[0] @ [1, 1j], np.exp(1j * bodies[1])
    behind = kernels.driving_behind(*bodies, *tracks, line, s, 45.0, 1.5, 0.7, np.arange(300)).tolist()
    place, facing = kernels.follow(line, len(line), 0, s, here, heading, way)
    apart = separation(
        centre[:, None] - place, facing, turned[:, None], np.array([2.5, 0.9]), size[:, None] / 2
    )
    least, now = apart.min(axis=1), apart[:, 0]
    nearer = (least < 0.3) & (least >= np.maximum(now - kernels.CLOSER, np.minimum(now, kernels.LEAST)))
    passed = (np.hypot(*bodies[2].T) < 0.2) & ((least >= 0.3) | nearer) & (now > 0.0)
    assert (met & passed & nearer).any()
    assert (met & behind).any()
    going = 7.0 * times + 2.0 * np.minimum(times, 2.5) * (times - 0.5 * np.minimum(times, 2.5))
    past = (bodies[4] >= 0) & (np.hypot(*bodies[2].T) >= 0.2)
    for ways in (7.0 * times, going):
        place, facing = kernels.follow(line, len(line), 0, s, here, heading, ways)
        for i in np.flatnonzero(past):
            its, turned_as = kernels.other_ahead(*bodies, *tracks, i, np.hypot(*bodies[2][i]) * times)
            far = separation(its - place, facing, turned_as, np.array([2.5, 0.9]), size[i] / 2)
            k = far.argmin()
            past[i] = far[k] >= 0.8 and (facing[k] * turned_as[k].conjugate()).real < -kernels.OPPOSITE
    assert (met & past).any()
    assert (met & passed).any()
    assert got.tolist() == np.flatnonzero(met & ~np.array(behind) & ~passed & ~past).tolist()


def test_the_residuals_network_is_its_formula():
    rng = RNG(6)
    layers = [rng.normal(size=shape).astype(np.float32) for shape in ((5, 16), 16, (16, 16), 16, 16)]
    xi, low, high = rng.normal(size=(9, 5)), np.full(5, -1, np.float32), np.full(5, 1.5, np.float32)

    def gelu(x):
        return 0.5 * x * (1 + np.tanh(np.sqrt(2 / np.pi) * (x + 0.044715 * x**3)))

    w1, b1, w2, b2, w3 = layers
    wanted = gelu(gelu(np.clip(xi, low, high) @ w1 + b1) @ w2 + b2) @ w3 + 0.25
    wanted = wanted * np.minimum(3.0 * xi[:, 2], 1.0)
    got = residual_kernels.network(xi, low, high, *layers, np.float32(0.25), 2, 3.0)
    assert got == pytest.approx(wanted, abs=2e-4)


def test_ellipses_are_those_of_half_sizes_and_a_margin():
    size = RNG(7).uniform(1, 12, (30, 2))
    short, stretch = barrier_kernels.ellipses(size, 2.5, 1.0, 0.1, 1e-6)
    across = 0.5 * size[:, 1] + 0.1
    assert (short[0] == 1.0 + 1e-6).all()
    assert (stretch[0] == 2.5**2 - 1.0).all()
    assert np.sqrt(short[1] - 1e-6) == pytest.approx(across, rel=1e-12)
    assert np.sqrt(stretch[1] + across**2) == pytest.approx(0.5 * size[:, 0], rel=1e-12)
