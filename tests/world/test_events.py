"""Every kind of event has the effect that it describes, on real traffic; so have triggers and selectors."""

import math
from dataclasses import replace
from itertools import pairwise

import libsumo
import numpy as np
import pytest

from rudc.geometry import rectangle_gaps
from rudc.world.events.selection import pick
from rudc.world.scene import Kind
from rudc.world.sumo import HEEDLESS
from tests.plans import PlanSource, event

CALM = PlanSource(density=25.0, speed=(0.0, 0.0))
"""the ego stands on its arm and watches"""
STAND = np.array([-6.0, 0.0])
LATER = {"simulation_time": {"above": 1.0}}


def run(world, source, seconds, seed=0, u=STAND, ego_driver="agent"):
    """Scenes of an episode, its first included."""
    scenes = [world.reset(source.plan(seed), ego_driver=ego_driver)]
    for _ in range(round(seconds / 0.1)):
        world.advance(u)
        scenes.append(world.scene())
    return scenes


def speeds(scene):
    return dict(zip(scene.ids, np.hypot(scene.velocity[:, 0], scene.velocity[:, 1]), strict=True))


def gap_to_ego_free(scene, i, others):
    """Least gap between the scene's `i` and `others`, row numbers."""
    return rectangle_gaps(
        *scene.position[i], scene.heading[i], *scene.size[i],
        scene.position[others], scene.heading[others], scene.size[others],
    ).min(initial=np.inf)  # fmt: skip


def test_accident_stands_where_it_was_placed_and_is_driven_around_or_waited_for(world, four_way):
    accident = event(
        "accident",
        vehicles=[
            {"position": [2.0, 4.0], "heading": 40},
            {"lane": "west_out_1", "at": 12, "heading_offset": 25, "lateral": 0.5, "type": "truck"},
        ],
    )
    touched = []
    for seed in range(3):
        scenes = run(world, replace(CALM, density=35.0, events=(accident,)), 20.0, seed)
        for scene in scenes:
            props = np.flatnonzero(scene.path < 0)
            svs = np.flatnonzero(scene.path >= 0)
            assert len(props) == 2
            touched += [gap_to_ego_free(scene, i, svs) == 0 for i in props]
        stuck = [v < 0.1 for v in speeds(scenes[-1]).values()]
        assert 2 < sum(stuck) < len(stuck), "some wait, others pass"
    assert not any(touched)
    car = scenes[-1].ids.index("accident0:0")
    assert scenes[-1].position[car] == pytest.approx([2.0, 4.0])
    assert scenes[-1].heading[car] == pytest.approx(math.radians(40))
    truck = scenes[-1].ids.index("accident0:1")
    x, y, psi = four_way.place_on_lane("west_out_1", 12.0, 0.5, math.radians(25))
    assert (*scenes[-1].position[truck], scenes[-1].heading[truck]) == pytest.approx((x, y, psi))
    assert scenes[-1].kind[truck] == Kind.TRUCK


def test_stalled_vehicle_on_a_lane_stands_and_leaves(world):
    stalled = event("stalled_vehicle", lane="east_in_0", at=40, type="bus", duration=5)
    scenes = run(world, replace(CALM, events=(stalled,)), 8.0)
    assert [i for i in scenes[30].ids if i.startswith("stalled")]
    assert not [i for i in scenes[-1].ids if i.startswith("stalled")]


def test_stalled_vehicle_picked_from_traffic_stops_and_goes_on(world):
    stalled = event("stalled_vehicle", vehicle="nearest", duration=4, when=LATER)
    source = PlanSource(density=5.0, origin="north", turn="left", speed=(8.0, 8.0), events=(stalled,))
    for seed in range(4):
        scenes = run(world, source, 14.0, seed, u=np.zeros(2) if seed else STAND)
        assert world.happenings()[0].begun_s is not None
        stood = [
            [speeds(scene)[name] < 0.1 for scene in scenes if name in scene.ids] for name in scenes[10].ids
        ]
        assert any(sum(flags) * 0.1 == pytest.approx(4.0, abs=0.35) and not flags[-1] for flags in stood)


def test_lane_closure_makes_vehicles_change_lanes(world, four_way):
    closure = event("lane_closure", lane="west_in_1", at=20, length=15)
    wall = four_way.place_on_lane("west_in_1", 27.5)
    passed, entered = 0, 0
    for seed in range(4):
        scenes = run(world, replace(CALM, density=30.0, events=(closure,)), 20.0, seed)
        lane = [set(), set()]
        for scene in scenes:
            for i in np.flatnonzero(scene.path >= 0):
                x, y = scene.position[i] - wall[:2]
                if abs(x) < 7.5 and abs(y) < 5.0 and math.cos(scene.heading[i] - wall[2]) > 0.9:
                    lane[int(abs(y) > 1.75)].add(scene.ids[i])
        entered += len(lane[0])
        passed += len(lane[1])
    assert entered == 0
    assert passed > 4


def test_hard_brake_brakes_as_hard_as_it_says(world):
    source = replace(CALM, density=30.0, speed=(8.0, 8.0), distance=(60.0, 60.0))
    brake = event("hard_brake", vehicle="nearest", deceleration=7, duration=2, when=LATER)
    hardest = []
    for events in ((), (brake,)):
        scenes = [speeds(scene) for scene in run(world, replace(source, events=events), 6.0, seed=2)]
        pairs = [(a[name], b[name]) for a, b in pairwise(scenes) for name in a.keys() & b.keys()]
        hardest.append(max(before - after for before, after in pairs) / 0.1)
    assert hardest[0] < 5.0
    assert hardest[1] == pytest.approx(7.0, abs=0.5)


@pytest.mark.parametrize("kind", ["hard_brake", "stalled_vehicle"])
def test_on_ice_nobody_brakes_harder_than_the_road_lets_it(world, kind):
    """Whom an event had brake did: with 7 and 3 m/s2."""
    ice, brake = event("low_friction", friction=0.1), event(kind, vehicle="nearest", when=LATER)
    source = replace(CALM, density=30.0, speed=(8.0, 8.0), distance=(60.0, 60.0), events=(ice, brake))
    scenes = run(world, source, 6.0, seed=2)
    assert world.happenings()[1].begun_s is not None
    seen = [speeds(scene) for scene in scenes]
    pairs = [(a[name], b[name]) for a, b in pairwise(seen) for name in a.keys() & b.keys()]
    assert max(before - after for before, after in pairs) / 0.1 == pytest.approx(0.981, abs=0.03)


@pytest.mark.parametrize("first", [True, False])
def test_on_ice_a_wrong_way_driver_brakes_no_harder_than_the_road_lets_it(world, first):
    wrong = event("wrong_way", lane="west_out_1", at=70, speed=7, when=LATER)
    ice = event("low_friction", friction=0.1, when={"simulation_time": {"above": 0.5 if first else 2.0}})
    run(world, replace(CALM, density=0.0, origin="east", events=(wrong, ice)), 3.0)
    (driver,) = world.stage.props
    driver._free = False
    before = driver.speed
    driver.step(0.1)
    assert before - driver.speed == pytest.approx(0.0981)
    assert driver._needed() > 0.5 * driver.speed**2 / 0.981, "and looks out as far as it needs to stop"


def test_priority_violation_drives_into_the_junction_without_looking(world):
    """On the minor road, those who would wait for the major road's traffic do not."""
    source = replace(CALM, density=35.0, origin="east")
    heedless = event("priority_violation", vehicle="all")
    waited = {}
    for name, events in (("lawful", ()), ("heedless", (heedless,))):
        waited[name] = sum(
            sum(v < 0.5 for v in speeds(scene).values())
            for seed in range(3)
            for scene in run(world, replace(source, events=events), 10.0, seed)
        )
    assert waited["heedless"] < 0.6 * waited["lawful"]
    assert world.stage.unlawful


def test_a_second_event_that_ends_leaves_the_first_at_work(world):
    """Who is made to brake while it drives without looking goes on without looking."""
    heedless = event("priority_violation", vehicle="all")
    brief = event("hard_brake", vehicle="all", duration=1)
    source = replace(CALM, density=35.0, events=(heedless, brief))
    run(world, source, 3.0)
    unlawful = world.stage.unlawful & set(world.traffic.drivers)
    assert unlawful
    for name in unlawful:
        assert world.traffic.drivers[name].overridden == 0
        assert libsumo.vehicle.getSpeedMode(name) == HEEDLESS


def test_speeding_and_slow_vehicle_change_the_speed_they_drive_at(world):
    fastest = {}
    for kind, fields in (
        ("none", None),
        ("speeding", {"factor": 1.6, "duration": 8}),
        ("slow_vehicle", {"speed": 3, "duration": 8}),
    ):
        events = (event(kind, vehicle="all", **fields),) if fields else ()
        scenes = run(world, replace(CALM, density=10.0, events=events), 12.0, seed=3)
        there = set(scenes[0].ids)
        fastest[kind] = max(v for scene in scenes[25:75] for n, v in speeds(scene).items() if n in there)
        fastest[kind + " after"] = max((v for n, v in speeds(scenes[-1]).items() if n in there), default=0.0)
    assert fastest["none"] < 10.6
    assert fastest["speeding"] > 13.0
    assert fastest["speeding after"] < 11.5
    assert fastest["slow_vehicle"] < 3.3
    assert fastest["slow_vehicle after"] > 6.0


def test_wrong_way_driver_comes_the_wrong_way_and_is_yielded_to(world, four_way):
    came = 0
    for seed in range(3):
        wrong = event("wrong_way", lane="west_out_1", at=70, speed=7, when=LATER)
        scenes = run(world, replace(CALM, density=30.0, origin="east", events=(wrong,)), 15.0, seed)
        for scene in scenes:
            if "wrong_way0:0" in scene.ids:
                i = scene.ids.index("wrong_way0:0")
                direction = four_way.surface.direction(*scene.position[i])
                if not math.isnan(direction) and np.hypot(*scene.position[i]) > 20:
                    came += math.cos(direction - scene.heading[i]) < -0.99
                assert gap_to_ego_free(scene, i, np.flatnonzero(scene.path >= 0)) > 0
        assert world.stage.unlawful == {"wrong_way0:0"}
    assert came > 30


def test_density_surge_fills_the_road_and_drains(world):
    surge = event("density_surge", density=50, duration=12, when=LATER)
    scenes = run(world, replace(CALM, density=10.0, events=(surge,)), 30.0)
    road_km = world.network.road_km
    assert scenes[0].count / road_km < 13
    assert scenes[125].count / road_km > 40
    assert scenes[-1].count < scenes[125].count


def test_pedestrians_cross_and_are_waited_for(world, four_way):
    """From the side they were asked to start from, over the whole road, untouched."""
    for side in ("left", "right"):
        walkers = event("pedestrian_crossing", arm="west", at=6, count=2, from_side=side, when=LATER)
        for seed in range(2):
            scenes = run(world, replace(CALM, density=30.0, origin="east", events=(walkers,)), 25.0, seed)
            sides, yielded = [], False
            for scene in scenes:
                for i in np.flatnonzero(scene.kind == Kind.PEDESTRIAN):
                    assert gap_to_ego_free(scene, i, np.flatnonzero(scene.path >= 0)) > 0
                    sides.append(scene.position[i, 1])
                yielded |= any(v < 0.5 for v in speeds(scene).values())
            # Traffic towards the junction heads east on the west arm: its right is the south.
            assert (sides[0] < 0) == (side == "right")
            assert min(sides) < -7.0
            assert max(sides) > 7.0
            assert yielded


def test_occlusion_hides_from_the_ego_and_from_nobody_else(world, four_way):
    x, y, _ = four_way.place_on_lane("south_in_0", 20.0)
    wall = event("occlusion", boxes=[{"position": [x + 8.0, y + 10.0], "heading": 90, "size": [30, 4]}])
    source = replace(CALM, origin="south", density=40.0, distance=(25.0, 25.0))
    hidden = sum(s.count for s in perceived(world, replace(source, events=(wall,))))
    assert 0 < hidden < sum(s.count for s in perceived(world, source))
    truths = [run(world, replace(source, events=events), 5.0)[-1].position for events in ((), (wall,))]
    assert np.array_equal(*truths)
    for where in ({"position": [0, 0], "size": [5, 5]}, {"position": [40, 12], "size": [3, 50]}):
        on_road = event("occlusion", boxes=[where])
        with pytest.raises(Exception, match="reaches onto the road"):
            world.reset(replace(source, events=(on_road,)).plan(0))


def perceived(world, source):
    world.reset(source.plan(0))
    for _ in range(30):
        world.advance(STAND)
        yield world.perceived()


def test_sensor_noise_and_dropout_are_in_what_is_perceived(world):
    noise = event("sensor_noise", position=1.0, speed=1.0, heading=10)
    dropout = event("sensor_dropout", probability=0.5, range=60)
    run(world, replace(CALM, events=(noise,)), 1.0)
    seen, true = world.perceived(), world.scene()
    assert seen.ids == true.ids
    assert world.perceived() is seen, "one decision, one look"
    assert not np.allclose(seen.position, true.position, atol=0.1)
    assert not np.allclose(seen.heading, true.heading, atol=0.01)
    dropped = replace(CALM, events=(dropout,))
    assert 0.1 < np.mean([seen.count for seen in perceived(world, dropped)]) / true.count < 0.5


def test_low_friction_binds_the_ego_and_the_others(world):
    ice = event("low_friction", friction=0.15)
    source = replace(CALM, density=35.0, speed=(8.0, 8.0), events=(ice,))
    scenes = run(world, source, 12.0)
    assert min(scene.ego.acceleration for scene in scenes) == pytest.approx(-0.15 * 9.81, abs=1e-6)
    hardest = min(scene.acceleration.min() for scene in scenes)
    assert hardest > -0.15 * 9.81 - 0.1
    melted = event("low_friction", friction=0.15, when=LATER)
    later = run(world, replace(source, events=(melted,)), 12.0)
    assert min(scene.ego.acceleration for scene in later[:10]) == pytest.approx(-6.0, abs=1e-6)
    assert min(scene.acceleration.min() for scene in later[30:]) > -0.15 * 9.81 - 0.1


def test_actuator_delay_delays_and_smooths(world):
    late = event("actuator_delay", delay=0.3, lag=0.2)
    scenes = run(world, replace(CALM, density=0.0, speed=(8.0, 8.0), events=(late,)), 1.0)
    pushes = [scene.ego.acceleration for scene in scenes[1:]]
    assert pushes[:3] == [0.0] * 3
    assert 0 > pushes[3] > pushes[4] > pushes[9] > -6.0


@pytest.mark.parametrize(
    ("when", "at"),
    [
        ({"simulation_time": {"above": 1.5}}, lambda scene: scene.time_s > 1.5),
        ({"speed": {"below": 5}}, lambda scene: scene.ego.v < 5),
        ({"ego_distance_to_junction": {"below": 30}}, lambda s: s.route.stop_line_s - s.ego_s - 2.5 < 30),
        ({"traveled_distance": {"above": 6}}, lambda scene: scene.ego_s > 75 + 6),
        (
            {"simulation_time": {"above": 0.5}, "speed": {"below": 6}},
            lambda scene: scene.time_s > 0.5 and scene.ego.v < 6,
        ),
        ({"relative_distance": {"vehicle": "nearest", "below": 500}}, lambda scene: True),
        ({"time_headway": {"vehicle": "nearest", "below": 500}}, lambda scene: True),
    ],
)
def test_triggers_fire_at_the_first_scene_that_satisfies_them(world, when, at):
    source = replace(
        CALM, speed=(8.0, 8.0), distance=(42.5, 42.5), events=(event("density_surge", density=50, when=when),)
    )
    scene = world.reset(source.plan(0))
    while world.traffic.density < 50 and scene.time_s < 5:
        expected = at(scene)
        world.advance(np.array([-1.5, 0.0]))
        assert (world.traffic.density == 50) == expected, scene.time_s
        scene = world.scene()
    assert world.traffic.density == 50


def test_reach_position_and_time_to_collision(world, four_way):
    x, y, _ = four_way.place_on_lane("south_in_0", 30.0)
    source = replace(CALM, origin="south", turn="straight", speed=(8.0, 8.0), distance=(45.0, 45.0))
    reach = event("density_surge", density=50, when={"reach_position": {"position": [x, y], "tolerance": 3}})
    scene = world.reset(replace(source, events=(reach,)).plan(0))
    while world.traffic.density < 50 and scene.time_s < 5:
        last = scene
        world.advance(np.zeros(2))
        scene = world.scene()
    assert math.hypot(last.ego.x - x, last.ego.y - y) < 3.0 < math.hypot(last.ego.x - x, last.ego.y - 0.8 - y)
    block = tuple(event("stalled_vehicle", lane=f"south_in_{lane}", at=5) for lane in (0, 1))
    scene = world.reset(replace(source, density=0.0, events=block).plan(0))
    assert scene.count == 2
    assert pick(scene, "leader", np.random.default_rng(0)) == [], "an obstacle is nobody's leader"
    when = {"time_to_collision": {"vehicle": "leader", "below": 3}}
    crash = event("density_surge", density=50, when=when)
    run(world, replace(source, density=0.0, events=(*block, crash)), 6.0, u=np.zeros(2))
    assert world.traffic.density == 50, "the leader that is put ahead stops behind the obstacle"


def test_selectors_pick_whom_they_say(world):
    rng = np.random.default_rng(0)
    found = dict.fromkeys(("leader", "follower", "oncoming", "crossing"), 0)
    for seed in range(10):
        source = replace(CALM, density=45.0, origin="south", turn="straight", speed=(6.0, 6.0))
        scene = run(world, source, 1.0, seed, u=np.zeros(2))[-1]
        here = scene.position - (scene.ego.x, scene.ego.y)
        ahead = here @ (math.cos(scene.ego.psi), math.sin(scene.ego.psi))
        for name in found:
            rows = pick(scene, name, rng)
            found[name] += len(rows)
            for i in rows:
                turned = math.cos(scene.heading[i] - scene.ego.psi)
                assert {
                    "leader": ahead[i] > 0 and turned > 0.7,
                    "follower": ahead[i] < 0 and turned > 0.7,
                    "oncoming": ahead[i] > 0 and turned < -0.7,
                    "crossing": abs(turned) < 0.7,
                }[name], name
        assert pick(scene, "all", rng) == list(range(scene.count))
        assert pick(scene, "nearest", rng) == [0]
        assert pick(scene, "random", rng)[0] in range(scene.count)
    assert all(number > 1 for number in found.values()), found


def test_an_event_waits_for_somebody_to_act_on(world):
    source = PlanSource(density=0.0, speed=(0.0, 0.0), events=(event("hard_brake", vehicle="nearest"),))
    run(world, source, 1.0)
    assert world.happenings()[0].begun_s is None


def test_sumos_driver_in_the_egos_seat_sees_obstacles_too(world):
    """In the junction SUMO does not: it would drive into pedestrians and accident vehicles."""
    accident = event("accident", vehicles=[{"position": [0, 0]}, {"position": [4, -4], "heading": 90}])
    walkers = event("pedestrian_crossing", arm="north", at=4, count=6, speed=1.0)
    for seed in range(6):
        source = PlanSource(density=10.0, turn="left" if seed % 2 else None, events=(accident, walkers))
        world.reset(source.plan(seed), ego_driver="sumo")
        hits = [world.advance(np.zeros(2)).collision for _ in range(200)]
        assert not any(hits), seed
