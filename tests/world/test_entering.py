"""Where surrounding vehicles (SVs) enter the road, and how fast."""

from collections import Counter
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from rudc.data import data_folder
from rudc.errors import SimulationError
from rudc.network.route import ReferencePath
from rudc.vehicle import Actuation
from rudc.world.entering import ego_against
from rudc.world.kernels import overlapping
from rudc.world.spawn import fastest_start, safe_to_start
from tests.plans import ALL_KINDS, PlanSource, event
from tests.world.networks import PIECES, in_pieces

STAND = np.array([-6.0, 0.0])
VILLAGE = data_folder("results") / "held-out-35/networks/mountain_village/mountain_village.net.xml"


@pytest.mark.parametrize(
    "blocked",
    [
        event("stalled_vehicle", lane="west_in_0", at=117),
        event("lane_closure", lane="west_in_0", at=103, length=17),
    ],
)
def test_density_holds_where_something_stands_at_a_lanes_outer_end(world, blocked):
    """SVs were asked for there, never got onto the road, and counted as present."""
    source = PlanSource(density=30.0, origin="south", events=(blocked,))
    for seed in range(2):
        world.reset(source.plan(seed))
        found = [world.advance(STAND).density for _ in range(400)]
        assert found[-1] == pytest.approx(30.0, rel=0.05)
        assert not world.traffic.waiting


def test_who_enters_behind_an_ego_at_the_outer_end_can_stop_behind_it(world):
    """They came as if the lane were free, and some hit it."""
    source = PlanSource(density=45.0, origin="south", distance=(95.0, 112.0), speed=(0.0, 3.0))
    came = 0
    for seed in (0, 3, 4, 7, 15, 18):
        scene = world.reset(source.plan(seed))
        for _ in range(30):
            known, ego = set(scene.ids), scene.ego
            world.advance(np.array([-1.0, 0.0]))
            scene = world.scene()
            ahead = (scene.position - (ego.x, ego.y)) @ (np.cos(ego.psi), np.sin(ego.psi))
            beside = np.abs(scene.position[:, 0] - ego.x) > 1.5
            new = (ahead < 0.0) & ~beside & [name not in known for name in scene.ids]
            gap, speed = -ahead[new] - 5.0, np.hypot(*scene.velocity[new].T)
            assert (speed**2 - ego.v**2 < 2 * 2.5 * gap).all(), "at the usual deceleration"
            came += len(gap)
    assert came >= 3


def test_nobody_enters_where_the_ego_comes_against_them(world):
    """They appeared 2 m before an ego in the lane of oncoming traffic: SUMO took it to be in its own lane."""
    x, y, psi = world.network.place_on_lane("west_in_0", 108)
    elsewhere = 0
    for seed in range(4):
        world.reset(PlanSource(density=60.0, origin="south").plan(seed))
        for v in (8.0, 0.0):
            world.put_ego(x, y, psi + np.pi, v)
            world.traffic.density = 200.0
            for _ in range(15):
                known = set(world.scene().ids)
                world.advance(np.array([-4.0 if v else 0.0, 0.0]))
                scene = world.scene()
                new = np.array([name not in known for name in scene.ids], bool)
                in_lane = new & (np.abs(scene.position[:, 1] - y) < 1.0) & (scene.position[:, 0] < x)
                gap = scene.ego.x - scene.position[in_lane, 0] - 5.0
                speed, stops = np.hypot(*scene.velocity[in_lane].T), scene.ego.v**2 / 8.0
                assert (speed**2 < 2 * 4.0 * (gap - stops)).all()
                elsewhere += int(new.sum() - in_lane.sum())
    assert elsewhere > 0


def test_on_ice_an_ego_that_comes_against_them_needs_a_longer_way(world):
    x, y, psi = world.network.place_on_lane("west_in_0", 90)
    world.reset(PlanSource(origin="south").plan(0))
    world.put_ego(x, y, psi + np.pi, 8.0)
    ((lane, dry, _),) = ego_against(world.traffic, world._plant)
    world._plant.actuation = Actuation(friction=0.2)
    ((_, icy, _),) = ego_against(world.traffic, world._plant)
    assert lane == "west_in_0"
    assert dry - icy == pytest.approx(8.0**2 / 2 * (1 / (0.2 * 9.81) - 1 / 4.0))


def test_at_first_traffic_stands_all_along_arms_of_several_edges(world_on, tmp_path):
    """It stood on their outermost edges, and driving away on their innermost ones only."""
    path = in_pieces(tmp_path)
    world = world_on(str(path))
    source = PlanSource(str(path), density=40.0, mix=ALL_KINDS, warm_up_s=0.1)
    found: Counter[str] = Counter()
    for seed in range(12):
        scene = world.reset(source.plan(seed))
        assert len(world.traffic.drivers) == world.traffic.target == len(world._reader.names)
        assert not len(overlapping(scene.position, scene.heading, scene.size))
        found.update(world._reader.motion.lane)
        assert world.advance(STAND).sv_collisions == 0
    per_m = sum(found.values()) / (2 * sum(places[-1] for places in PIECES.values()))
    long = [
        (arm, i, b - a) for arm, at in PIECES.items() for i, (a, b) in enumerate(pairwise(at)) if b - a > 50
    ]
    for arm, i, length in long:
        for way in ("in", "out"):
            assert 0.4 < found[f"{arm}_{way}{i}_0"] / (per_m * length) < 1.8


@pytest.mark.parametrize(("friction", "safe"), [(None, True), (0.9, True), (0.2, False)])
def test_a_start_is_safe_if_the_road_lets_the_ego_stop_behind_its_leader(make_scene, friction, safe):
    """22 m behind a leader at 3 m/s, at 10 m/s: on ice the ego needs 30 m; a dry road was reckoned with."""
    scene = make_scene(front=-40.0, v=10.0, actuation=Actuation(friction=friction))
    row = scene.route.row
    leader = {"row": row, "s": scene.ego_s + 27.0, "v": 3.0}
    assert safe_to_start(make_scene(leader, front=-40.0, v=10.0, actuation=scene.actuation)) == safe


def test_after_a_start_that_failed_there_is_no_episode(world):
    """The scene was that of the episode before."""
    world.reset(PlanSource().plan(0))
    with pytest.raises(SimulationError, match="does not fit"):
        world.reset(PlanSource(distance=(1000.0, 1000.0)).plan(0))
    with pytest.raises(SimulationError, match="no episode yet"):
        world.scene()


@pytest.mark.parametrize(
    ("radius", "before", "grip", "fastest"),
    [(20.0, 0.0, 99.0, 12.2), (20.0, 30.0, 99.0, 19.6), (300.0, 0.0, 99.0, 44.7), (20.0, 30.0, 2.0, 12.6)],
)
def test_an_ego_starts_so_that_it_can_take_the_bends_before_its_line(
    make_scene, radius, before, grip, fastest
):
    """Straight on for 60 m, then a quarter of a circle: three quarters of the grip, 8.8 m/s2 at most, across;
    before it as much as the grip gives, 4 m/s2 at most, for the brakes."""
    turned = np.linspace(0.0, 0.5 * np.pi, 500)[1:]
    bend = np.column_stack([60.0 + radius * np.sin(turned), radius * (1.0 - np.cos(turned))])
    path = ReferencePath(np.vstack([np.column_stack([np.linspace(0.0, 60.0, 300), np.zeros(300)]), bend]))
    route = replace(make_scene().route, path=path, stop_line_s=path.length)
    assert fastest_start(route, 60.0 - before, grip) == pytest.approx(fastest, rel=0.04)
    assert fastest_start(replace(route, stop_line_s=50.0), 45.0, grip) > 30.0


def test_on_ice_an_ego_starts_before_a_bend_more_slowly(world_on):
    world, speeds = world_on(str(VILLAGE)), {}
    for friction in (0.9, 0.4):
        ice = event("low_friction", friction=friction)
        source = PlanSource(density=0.0, origin="northeast", distance=(60, 60), speed=(11, 11), events=(ice,))
        speeds[friction] = world.reset(source.plan(0)).ego.v
    assert 8.0 < speeds[0.9] < 11.0
    assert 5.0 < speeds[0.4] < 0.8 * speeds[0.9]
