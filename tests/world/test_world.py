"""The world as a whole, on real SUMO traffic: it is repeatable, one at a time, and reports what happens."""

import hashlib
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rudc.errors import SimulationError, WorldBusyError
from rudc.geometry import rectangle_gaps
from rudc.network.network import load_network
from rudc.world.config import WorldConfig
from rudc.world.contact import Nearest
from rudc.world.kernels import overlapping
from rudc.world.scene import Scene
from rudc.world.world import World
from tests.plans import ALL_KINDS, PlanSource, event

BUSY = PlanSource(
    density=40.0,
    mix=ALL_KINDS,
    events=(
        event("pedestrian_crossing", arm="north", count=2, when={"simulation_time": {"above": 1}}),
        event("sensor_noise", position=0.5),
        event("accident", vehicles=[{"lane": "east_out_0", "at": 30, "heading_offset": 30}]),
    ),
)
FOLLOW = PlanSource(density=20.0, speed=(7.0, 7.0))


def follow(scene: Scene, wanted: float = 7.0) -> np.ndarray:
    """Along the path at a speed, whatever the others do."""
    ego = scene.ego
    x, y, _ = scene.route.path.pose(scene.ego_s + 3.0 + 0.5 * ego.v)
    bearing = (np.arctan2(y - ego.y, x - ego.x) - ego.psi + np.pi) % (2 * np.pi) - np.pi
    return np.array([np.clip(2.0 * (wanted - ego.v), -5.0, 2.0), np.clip(1.2 * bearing, -0.5, 0.5)])


def trajectory(world: World, seed: int, decisions: int = 60, source: PlanSource = BUSY) -> str:
    """Digest of everything that happens in an episode."""
    digest = hashlib.sha256()
    scene = world.reset(source.plan(seed))
    for _ in range(decisions):
        seen = world.perceived()
        for array in (scene.position, scene.heading, scene.velocity, scene.acceleration, scene.path_s):
            digest.update(array.tobytes())
        digest.update(seen.position.tobytes())
        digest.update(repr((scene.ids, scene.ego, scene.time_s)).encode())
        advance = world.advance(follow(scene, 3.0))
        digest.update(repr(advance).encode())
        scene = world.scene()
    return digest.hexdigest()


def test_same_plan_same_trajectories(world):
    first = trajectory(world, 3)
    assert trajectory(world, 4) != first
    assert trajectory(world, 3) == first


def test_only_one_world_a_process(world, four_way):
    before = world.reset(FOLLOW.plan(0))
    with pytest.raises(WorldBusyError, match="close it first"):
        World(four_way)
    world.advance(np.zeros(2))
    assert world.scene().time_s == pytest.approx(before.time_s + 0.1), "and the first one lives on"


def test_a_closed_world_makes_room_for_another(world_on, four_way):
    scene = world_on().reset(FOLLOW.plan(1))
    world_on.close()
    with World(load_network("t_junction")) as other:
        assert other.reset(replace(FOLLOW, network="t_junction").plan(1)).count > 0
    with World(four_way) as again:
        assert again.reset(FOLLOW.plan(1)) == scene


def test_needs_a_reset_first(world_on, four_way):
    world_on.close()
    with World(four_way) as fresh, pytest.raises(SimulationError, match="reset"):
        fresh.scene()


def test_an_unsafe_start_is_drawn_again_and_said_so(world):
    crowded = replace(FOLLOW, density=50.0)
    attempts = []
    for seed in range(12):
        scene = world.reset(crowded.plan(seed))
        attempts.append(world.plan.attempt)
        assert world.plan.seed == seed
        gaps = rectangle_gaps(
            scene.ego.x, scene.ego.y, scene.ego.psi, 5.0, 1.8, scene.position, scene.heading, scene.size
        )
        assert gaps.min() > 1.0
    assert max(attempts) > 0
    assert min(attempts) == 0


def test_no_safe_start_at_all_is_an_error(world, monkeypatch):
    monkeypatch.setattr("rudc.world.world.REDRAWS", 3)
    jammed = replace(FOLLOW, density=240.0, distance=(40.0, 40.0), warm_up_s=0.5)
    with pytest.raises(SimulationError, match="no safe start for the ego in 4 draws"):
        world.reset(jammed.plan(0))
    assert world.plan.attempt == 3
    with pytest.raises(SimulationError, match="does not fit on the arm"):
        world.reset(replace(FOLLOW, distance=(118.0, 118.0)).plan(0))


def test_an_episode_that_cannot_be_set_up_leaves_no_scene(world, monkeypatch):
    monkeypatch.setattr(World, "_enter_ego", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        world.reset(FOLLOW.plan(0))
    with pytest.raises(SimulationError, match="no episode"):
        world.scene()


@pytest.mark.parametrize("name", ["four_way", "t_junction", "skewed_four_way", "roundabout"])
def test_sumos_own_driver_keeps_to_the_reference_path(world_on, name):
    """Its centre lies on the path on the arms (the ego's late left turns cut the junction differently)."""
    world, aside = world_on(name), []
    for seed in range(4):
        scene = world.reset(PlanSource(network=name, density=5.0).plan(seed), ego_driver="sumo")
        while scene.ego_s < scene.destination_s - 5.0:
            world.advance(np.zeros(2))
            scene = world.scene()
            if not scene.route.stop_line_s - 2.0 < scene.ego_s + 2.5 < scene.route.exit_s + 8.0:
                aside.append(abs(scene.ego_offset))
    on_line, in_next_lane = np.array(aside) < 0.25, np.abs(np.array(aside) - 3.5) < 0.25
    assert len(aside) > 100
    assert (on_line | in_next_lane).all()
    assert on_line.mean() > 0.5


def test_sumo_sees_the_ego_where_the_plant_is(world):
    scene = world.reset(FOLLOW.plan(5))
    for _ in range(80):
        world.advance(follow(scene))
        scene = world.scene()
        x, y, psi = world._sumo.pose("ego", 5.0)
        assert (x, y) == pytest.approx((scene.ego.x, scene.ego.y), abs=1e-6)
        assert np.cos(psi - scene.ego.psi) == pytest.approx(1.0)


def test_others_are_on_the_paths_they_are_said_to_be_on(world, four_way):
    scene, off = world.reset(FOLLOW.plan(2), ego_driver="sumo"), []
    for _ in range(100):
        world.advance(np.zeros(2))
        scene = world.scene()
        x, y, psi = four_way.paths.pose(scene.path, scene.path_s)
        off.append(np.hypot(scene.position[:, 0] - x, scene.position[:, 1] - y))
        assert (np.cos(psi - scene.heading) > 0.9).all()
    assert np.median(np.concatenate(off)) < 0.01
    assert np.mean(np.concatenate(off) < 0.6) > 0.95, (
        "all but those on a lane that does not lead where they go"
    )


def test_nearest_first(world):
    scene = world.reset(FOLLOW.plan(2))
    for _ in range(20):
        world.advance(np.zeros(2))
        scene = world.scene()
        away = np.hypot(scene.position[:, 0] - scene.ego.x, scene.position[:, 1] - scene.ego.y)
        assert (np.diff(away) >= 0).all()


@pytest.mark.parametrize("density", [10.0, 30.0, 50.0])
def test_density_holds(world, density):
    found = []
    for seed in range(3):
        world.reset(replace(FOLLOW, density=density).plan(seed), ego_driver="sumo")
        found += [world.advance(np.zeros(2)).density for _ in range(150)]
    assert np.mean(found) == pytest.approx(density, rel=0.05)
    road_km = world.network.road_km
    assert min(found) * road_km > round(density * road_km) - 2.5, "two are on their way in at most"


@pytest.mark.parametrize(
    "name", ["four_way", "four_way_equal", "t_junction", "skewed_four_way", "roundabout"]
)
def test_traffic_of_all_kinds_flows_without_overlaps(world_on, name):
    world, source = world_on(name), PlanSource(network=name, density=30.0, mix=ALL_KINDS)
    for seed in range(2):
        scene = world.reset(source.plan(seed), ego_driver="sumo")
        seen, collisions = set(scene.ids), 0
        for _ in range(200):
            collisions += world.advance(np.zeros(2)).sv_collisions
            scene = world.scene()
            seen |= set(scene.ids)
            assert len(overlapping(scene.position, scene.heading, scene.size)) == 0
        assert collisions == 0
        assert len(seen) > scene.count + 2, "some left and others came"
        assert len(set(scene.kind.tolist())) > 2


def test_smallest_gap_is_that_of_all_pairs(world):
    checked = 0
    for seed in range(6):
        scene = world.reset(FOLLOW.plan(seed))
        for _ in range(60):
            advance = world.advance(follow(scene))
            scene, ego = world.scene(), world.scene().ego
            gaps = rectangle_gaps(ego.x, ego.y, ego.psi, 5.0, 1.8, scene.position, scene.heading, scene.size)
            assert advance.gap_m == pytest.approx(gaps.min(), abs=1e-9)
            assert advance.min_dtc_m <= advance.gap_m
            checked += 1
            if advance.collision:
                break
    assert checked > 200


def test_a_collision_is_seen_in_the_sub_step_it_happens_in(world):
    """Driving on blindly, in sub-steps of 0.05 s: the ego never gets deeper than one of them."""
    found, mid = 0, 0
    for seed in range(14):
        scene = world.reset(replace(FOLLOW, density=40.0, speed=(9.0, 9.0)).plan(seed))
        for _ in range(150):
            before = scene.time_s
            advance = world.advance(follow(scene, 9.0))
            scene = world.scene()
            if advance.collision:
                found += 1
                mid += round((scene.time_s - before) / 0.05) == 1
                index, ego = scene.ids.index(advance.collision.other), scene.ego
                assert advance.min_dtc_m == 0.0
                back = 0.05 * (ego.v + np.hypot(*scene.velocity[index]) + 1.0)
                shrunk = scene.size[index : index + 1] - 2 * back
                assert (shrunk < 0).any() or rectangle_gaps(
                    ego.x, ego.y, ego.psi, 5.0, 1.8, scene.position[[index]], scene.heading[[index]], shrunk
                )[0] > 0
                assert advance.collision.fault in ("ego", "other", "shared")
                break
            if advance.off_road or scene.ego_s > scene.destination_s:
                break
    assert found >= 3
    assert mid >= 1


def test_leaving_the_road_and_the_wrong_side_are_noticed(world):
    scene = world.reset(PlanSource(density=0.0, speed=(8.0, 8.0)).plan(0))
    advance = world.advance(np.zeros(2))
    assert not advance.off_road
    assert not advance.wrong_way
    assert advance.min_dtc_m == np.inf
    right = [world.advance(np.array([0.0, -0.2])) for _ in range(15)]
    assert right[-1].off_road
    scene = world.put_ego(scene.ego.x, scene.ego.y, scene.ego.psi, 8.0)
    x, y, psi = (float(v) for v in scene.route.path.pose(scene.ego_s))
    world.put_ego(x - 7.0 * np.sin(psi), y + 7.0 * np.cos(psi), psi, 5.0)
    advance = world.advance(np.zeros(2))
    assert advance.wrong_way
    assert not advance.off_road


def test_an_ego_that_is_put_elsewhere_has_neither_waited_nor_acted(world):
    scene = world.reset(PlanSource(density=0.0, speed=(8.0, 8.0)).plan(0))
    for _ in range(30):
        world.advance(np.array([-6.0, 0.1]))
    assert world.scene().waited_s > 0.5
    scene = world.put_ego(scene.ego.x, scene.ego.y, scene.ego.psi, 8.0)
    assert scene.waited_s == 0.0
    assert scene.last_u.tolist() == [0.0, 0.0]


@pytest.mark.parametrize("substep", [0.1, 0.05, 0.025])
def test_sub_steps_are_configurable(world_on, substep):
    world = world_on(config=WorldConfig(substep_s=substep))
    scene = world.reset(FOLLOW.plan(1))
    world.advance(follow(scene))
    assert world.scene().time_s == pytest.approx(scene.time_s + 0.1)


@pytest.mark.parametrize(
    ("decision", "calm", "moving"), [(0.05, 6, 15), (0.1, 6, 15), (0.25, 6, 12), (0.5, 6, 6)]
)
def test_the_yielding_layer_looks_twice_a_second_however_long_a_decision_is(
    world_on, monkeypatch, decision, calm, moving
):
    """It looked at every fifth decision; five times a second while pedestrians move about."""
    world, looks = world_on(config=WorldConfig(decision_s=decision)), []
    walk = event("pedestrian_crossing", arm="north")
    brake = world._brake
    monkeypatch.setattr(World, "_brake", lambda _, scene, s: (looks.append(scene), brake(scene, s)))
    for events, wanted in (((), calm), ((walk,), moving)):
        world.reset(replace(FOLLOW, events=events).plan(1))
        looks.clear()
        for _ in range(round(3.0 / decision)):
            world.advance(np.array([-6.0, 0.0]))
        assert len(looks) == wanted


def test_a_decision_is_a_whole_number_of_sub_steps():
    with pytest.raises(ValueError, match="whole multiple"):
        WorldConfig(substep_s=0.03)


def test_waiting_time_and_last_action_are_told(world):
    scene = world.reset(PlanSource(density=0.0, speed=(1.0, 1.0)).plan(0))
    assert scene.waited_s == 0.0
    for _ in range(10):
        world.advance(np.array([-2.0, 0.0]))
    scene = world.scene()
    assert scene.ego.v == 0.0
    assert scene.waited_s == pytest.approx(0.7, abs=0.06), "below 0.5 m/s since second 0.25"
    assert scene.last_u.tolist() == [-2.0, 0.0]


def test_a_driver_that_has_left_the_road_collides_with_nobody(world):
    scene = world.reset(replace(FOLLOW, density=40.0).plan(1), ego_driver="sumo")
    advances = []
    while scene.time_s < 39.0:
        advances.append(world.advance(np.zeros(2)))
        scene = world.scene()
    assert scene.ego_s > scene.destination_s
    assert not any(advance.collision for advance in advances)


def test_what_the_vehicle_cannot_do_is_cut_in_the_scene_too(world):
    """`last_u` is what reward and observation look at."""
    world.reset(PlanSource(density=0.0, turn="left", speed=(7.0, 7.0)).plan(1))
    body = world.vehicle
    for u, cut in (
        ([-1e300, 30.0], [body.a_min, body.delta_max]),
        ([1e300, -30.0], [body.a_max, -body.delta_max]),
    ):
        world.advance(np.array(u))
        assert world.scene().last_u.tolist() == cut


def test_what_sumos_driver_does_is_the_action_of_its_scene(world):
    scene = world.reset(PlanSource(density=0.0, turn="left", speed=(7.0, 7.0)).plan(1), ego_driver="sumo")
    actions = []
    while scene.ego_s < scene.destination_s:
        before = scene
        world.advance(np.array([9.0, 9.0]))
        scene = world.scene()
        actions.append(scene.last_u)
        if scene.ego_s < scene.destination_s:
            assert scene.last_u[0] == pytest.approx((scene.ego.v - before.ego.v) / 0.1, abs=1e-6)
    acceleration, steering = np.array(actions).T
    assert acceleration.max() > 0.5
    assert acceleration.min() > -7.0
    assert 0.1 < steering.max() < 0.5, "it turns left"
    assert steering.min() > -0.1


def test_a_hit_counts_although_the_other_has_left_since(world, monkeypatch):
    world.reset(FOLLOW.plan(2))
    other = world.scene().ids[0]

    def hit_and_gone(*_):
        world._sumo.remove(other)
        world._sumo.step()
        return Nearest(0.0, other)

    monkeypatch.setattr(world, "_drive", hit_and_gone)
    collision = world.advance(np.zeros(2)).collision
    assert collision is not None
    assert collision.other == other
    assert other not in world.scene().ids


def test_nothing_lies_about_while_a_world_runs(world, monkeypatch, tmp_path):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    world.reset(FOLLOW.plan(0))
    assert not list(tmp_path.iterdir()), "so a process that is killed leaves nothing"


def test_no_room_for_temporary_files_is_said(world, monkeypatch, tmp_path):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "gone"))
    with pytest.raises(SimulationError, match="TMPDIR"):
        world.reset(FOLLOW.plan(0))
    monkeypatch.undo()
    world.reset(FOLLOW.plan(0))


@pytest.mark.parametrize("folder", ["a,b", "a${HOME}b"])
def test_sumo_takes_paths_with_commas_and_dollars(world_on, monkeypatch, tmp_path, folder):
    expected = world_on().reset(FOLLOW.plan(0)).position
    (tmp_path / folder).mkdir()
    path = shutil.copy(world_on().network.path, tmp_path / folder)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / folder))
    for _ in range(2):
        scene = world_on(path).reset(replace(FOLLOW, network=path).plan(0))
        np.testing.assert_array_equal(scene.position, expected)
    Path(path).unlink()
    with pytest.raises(SimulationError, match=r"cannot read .*four_way\.net\.xml: No such file"):
        world_on(path).reset(replace(FOLLOW, network=path).plan(0))
