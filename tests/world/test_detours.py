"""Surrounding vehicles go round things that stand for good, or wait where they block nobody."""

from dataclasses import replace

import libsumo
import numpy as np
import pytest

from rudc.scenario import load_scenario
from rudc.world.brakes import Brakes
from rudc.world.detours import Detours
from rudc.world.sumo import Sumo
from rudc.world.traffic import BESIDE_M
from rudc.world.yielding_kernels import GROW_WIDTH
from tests.plans import PlanSource, event
from tests.world.networks import with_pockets

ACCIDENT = event(
    "accident",
    vehicles=[
        {"position": [-0.8, -4.2], "heading": 120},
        {"position": [2.0, 4.0], "heading": 40},
        {"lane": "west_out_1", "at": 12, "heading_offset": 25},
    ],
)


def stand_in_junction(world, plan, seconds=25.0):
    """How many vehicle-seconds SVs spend standing inside the junction, in an episode whose ego stands far
    off."""
    scene = world.reset(plan)
    paths, stood = world.network.paths, 0.0
    for _ in range(round(seconds * 10)):
        world.advance(np.array([-6.0, 0.0]))
        scene = world.scene()
        driven = scene.path >= 0
        rows, s = scene.path[driven], scene.path_s[driven]
        inside = (s + 2.5 > paths.stop_s[rows] + 1.0) & (s - 2.5 < paths.exit_s[rows])
        slow = np.hypot(*scene.velocity[driven].T) < 0.3
        stood += 0.1 * float((inside & slow).sum())
    return stood


def test_nobody_drives_into_a_block_and_stays_there(world, monkeypatch):
    plan = PlanSource(origin="south", turn="left", density=25.0, events=(ACCIDENT,))
    with_detours = sum(stand_in_junction(world, plan.plan(seed)) for seed in range(3))
    monkeypatch.setattr(Detours, "step", lambda *_: {})
    without = sum(stand_in_junction(world, plan.plan(seed)) for seed in range(3))
    assert without > 30.0
    assert with_detours < 0.35 * without


def test_on_a_free_road_traffic_is_as_without(world, monkeypatch):
    plan = PlanSource(density=25.0).plan(2)

    def places():
        world.reset(plan)
        for _ in range(60):
            world.advance(np.array([0.0, 0.0]))
        return world.scene().position

    with_detours = places()
    monkeypatch.setattr(Detours, "step", lambda *_: {})
    assert np.array_equal(with_detours, places())


def test_who_waits_before_a_block_brakes_no_harder_than_tyres_let_it(world, monkeypatch):
    """Who was a metre before its line when its way became blocked was to stop there: 320 m/s2."""
    asked, apply = [], Brakes.apply

    def note(brakes, wanted, *rest):
        asked.extend(deceleration for name, (_, deceleration) in wanted.items() if name == late)
        apply(brakes, wanted, *rest)

    ice = event("low_friction", friction=0.3)
    world.reset(PlanSource(density=25.0, events=(ice, ACCIDENT)).plan(0))
    late = world.scene().ids[0]
    monkeypatch.setattr(Brakes, "apply", note)
    monkeypatch.setattr(Detours, "step", lambda *_: {late: (8.0, 320.0)})
    world.advance(np.array([-6.0, 0.0]))
    assert asked == [pytest.approx(0.3 * 9.81)]


def test_nobody_who_is_past_one_block_drives_up_to_the_next(world):
    """Of several blocks on a row only the first was known."""
    stalled = [event("stalled_vehicle", lane=f"west_in_{k}", at=at) for k, at in ((0, 112.0), (1, 106.0))]
    beyond = event("accident", vehicles=[{"lane": f"west_to_east_{k}", "at": 11} for k in (0, 1)])
    plan = PlanSource(
        density=45.0, origin="south", turn="right", warm_up_s=0.1, distance=(60.0, 60.0),
        events=(*stalled, beyond),
    )  # fmt: skip
    rows, paths = list(world.network.movement("west", "east").rows), world.network.paths
    for seed in (5, 7):
        world.reset(plan.plan(seed))
        for _ in range(200):
            world.advance(np.array([-6.0, 0.0]))
        scene = world.scene()
        there = np.isin(scene.path, rows)
        past_line = (scene.path_s - paths.stop_s[scene.path])[there]
        assert not ((past_line > 0.0) & (past_line < 20.0)).any()


@pytest.mark.parametrize(("duration", "waits"), [(8.0, True), (18.0, False)])
def test_svs_wait_for_what_is_soon_taken_away_and_take_another_way_otherwise(world, duration, waits):
    """What stood for 8 s sent them elsewhere from 100 m away."""
    stalled = [event("stalled_vehicle", lane=f"north_out_{k}", at=8.0, duration=duration) for k in (0, 1)]
    world.reset(PlanSource(origin="west", turn="right", density=25.0, events=tuple(stalled)).plan(0))
    wanted, there = {name: driver.destination for name, driver in world.traffic.drivers.items()}, 0
    while world.stage.props:
        assert (("south", "north") in world.traffic._closed) != waits
        there = max(there, list(wanted.values()).count("north"))
        world.advance(np.array([-6.0, 0.0]))
        now = {name: driver.destination for name, driver in world.traffic.drivers.items()}
        assert not waits or all(wanted.get(name, end) == end for name, end in now.items())
        wanted = now
    assert (there > 0) == waits
    world.advance(np.array([-6.0, 0.0]))
    assert not world.traffic._closed


def test_nobody_drives_into_a_ring_whose_exit_is_blocked_for_a_while(world_on):
    """Who queued behind the exit, where there was room for a part of it, stood in the ring with the rest."""
    world = world_on("roundabout")
    paths = world.network.paths
    stalled = event("stalled_vehicle", lane="north_out_0", at=20.0, duration=12.0)
    plan = PlanSource(
        network="roundabout", origin="west", turn="right", density=40.0, mix={"bus": 1.0}, warm_up_s=1.0,
        origins={"south": 1.0}, turns={"straight": 1.0}, events=(stalled,),
    )  # fmt: skip
    world.reset(plan.plan(0))

    def inside():
        scene = world.scene()
        half, rows = 0.5 * scene.size[:, 0], scene.path
        within = (scene.path_s + half > paths.stop_s[rows]) & (scene.path_s - half < paths.exit_s[rows])
        return {scene.ids[i] for i in np.flatnonzero((rows >= 0) & within)}

    while world.stage.props:
        assert not inside()
        world.advance(np.array([-6.0, 0.0]))
    came = set()
    for _ in range(50):
        came |= inside()
        world.advance(np.array([-6.0, 0.0]))
    assert came


def test_long_vehicles_do_not_take_a_way_on_which_only_short_ones_have_room(world):
    """Rows were tried with a car: buses drove up to a wreck in the bend, and stood in the junction."""
    in_the_bend = event("accident", vehicles=[{"position": [5.5, 6.5], "heading": 45}])
    plan = PlanSource(origin="south", turn="straight", density=20.0, events=(in_the_bend,))
    assert stand_in_junction(world, replace(plan, mix={"bus": 1.0}).plan(4)) < 10.0
    world.reset(replace(plan, mix={"car": 0.5, "bus": 0.5}).plan(4))
    (row,) = world.network.movement("north", "east").rows
    assert np.isfinite(world._detours._end[:, row]).tolist() == [False, True]


def test_a_lane_that_is_blocked_is_left_for_the_other(world):
    closed = event("lane_closure", lane="west_out_1", at=10.0, length=20.0)
    plan = PlanSource(origin="south", turn="right", density=25.0, events=(closed,))
    world.reset(plan.plan(0))
    passed = set()
    for _ in range(250):
        world.advance(np.array([-6.0, 0.0]))
        scene = world.scene()
        arm = scene.position[:, 0] < -45.0
        west = np.abs(np.cos(scene.heading) + 1.0) < 0.1
        passed |= {scene.ids[i] for i in np.flatnonzero(arm & west & (scene.path >= 0))}
    assert len(passed) >= 3
    assert len(world.traffic.drivers) > 0


def test_nobody_leaves_a_free_lane_for_a_blocked_one_just_before_its_line(world, monkeypatch):
    """SUMO had one change lanes at its line, and stand before the accident for good."""
    plan = load_scenario("blocked_left_turn").plan(1000005)
    assert stand_in_junction(world, plan, seconds=15.0) == 0.0
    monkeypatch.setattr(Detours, "_stay", lambda *_: None)
    assert stand_in_junction(world, plan, seconds=15.0) > 5.0


@pytest.mark.parametrize(("at", "goes"), [(40.0, True), (8.0, False)])
def test_a_leader_whose_exit_is_blocked_changes_lanes_behind_the_junction(world_on, at, goes):
    """It was sent another way, which began on a lane that it may not change to, and stood there."""
    stalled = event("stalled_vehicle", lane="east_out_0", at=at)
    leads = event("slow_vehicle", vehicle="leader", speed=9.0, duration=0.5)
    world = world_on("t_junction")
    plan = PlanSource("t_junction", 0.0, "south", "right", events=(stalled, leads)).plan(0)
    world.reset(plan)
    (leader,) = [name for name, driver in world.traffic.drivers.items() if driver.keeps_lane]
    for _ in range(150):
        world.advance(np.array([-6.0, 0.0]))
    scene = world.scene()
    (row,) = [i for i, name in enumerate(scene.ids) if name == leader]
    beyond = scene.position[row, 0] > 14.25 + at + 5.0
    assert beyond == goes  # else it waits before the stop line, where it holds up nobody in the junction
    assert goes or scene.position[row, 1] < -14.25


def test_on_ice_who_waits_before_a_block_stops_before_its_line(world_on):
    """It began to brake once it needed 2.5 m/s2, where the road gave 1 m/s2, and slid past."""
    ice, stalled = event("low_friction", friction=0.1), event("stalled_vehicle", lane="east_out_0", at=8.0)
    leads = event("slow_vehicle", vehicle="leader", speed=9.0, duration=0.5)
    source = PlanSource("t_junction", 0.0, "south", "right", events=(ice, stalled, leads))
    world = world_on("t_junction")
    world.reset(replace(source, speed=(6.0, 6.0), distance=(60.0, 60.0)).plan(0))
    for _ in range(250):
        world.advance(np.array([-6.0, 0.0]))
    scene = world.scene()
    (row,) = np.flatnonzero(scene.path >= 0)
    front = scene.path_s[row] + 0.5 * scene.size[row, 0]
    assert -2.0 < front - scene.network.paths.stop_s[scene.path[row]] < 0.0


def test_on_an_arm_of_several_edges_it_is_the_lane_of_the_edge_where_they_are(
    world_on, tmp_path, monkeypatch
):
    """They were asked for the free lane's index at the stop line: of three, where they had but two."""
    asked = []

    def note(_, vehicle, lane, duration):
        asked.append((lane, libsumo.edge.getLaneNumber(libsumo.vehicle.getRoadID(vehicle))))

    monkeypatch.setattr(Sumo, "ask_lane", note)
    parked = event("accident", vehicles=[{"lane": f"east_in_{k}", "at": 15} for k in (0, 1)])
    plan = PlanSource(origin="south", turn="right", density=40.0, events=(parked,)).plan(0)
    world = world_on(str(with_pockets(tmp_path, 2)))
    world.reset(plan)
    for _ in range(50):
        world.advance(np.array([-6.0, 0.0]))
    assert (1, 2) in asked
    assert all(lane < lanes for lane, lanes in asked)


def test_nobody_waits_before_the_line_for_a_lane_that_begins_behind_it(world_on, tmp_path, monkeypatch):
    """On an arm of one lane they stood for good: no lane before the line was that of the free way alone."""
    waiting, step = [], Detours.step

    def note(detours, *given):
        waits = step(detours, *given)
        waiting.extend(waits)
        return waits

    monkeypatch.setattr(Detours, "step", note)
    stalled = event("stalled_vehicle", lane="north_out_0", at=15)
    plan = PlanSource(origin="west", turn="right", density=40.0, events=(stalled,)).plan(0)
    world = world_on(str(with_pockets(tmp_path, pocket=0)))
    world.reset(plan)
    for _ in range(150):
        world.advance(np.array([-6.0, 0.0]))
    assert not waiting


@pytest.mark.parametrize(("mix", "closes"), [({"car": 1.0}, 1.1), ({"car": 0.9, "bus": 0.1}, 1.45)])
@pytest.mark.parametrize("beside", [-0.2, -0.05, 0.05, 0.2])
def test_a_lane_is_closed_exactly_where_its_way_counts_as_blocked(world, mix, closes, beside):
    """SUMO's stand-in closed a lane up to 1.35 m beside its centre line, its way was blocked up to 1.05 m."""
    aside = closes + beside
    parked = event("accident", vehicles=[{"lane": "west_in_0", "at": 40, "lateral": -(aside + 0.9)}])
    world.reset(PlanSource(origin="south", density=20.0, mix=mix, events=(parked,)).plan(0))
    world.advance(np.array([-6.0, 0.0]))
    (row,) = world.network.movement("west", "south").rows
    assert bool(world.stage._stand_ins) == (beside < 0.0)
    assert (np.isfinite(world._detours._end[:, row]) == (beside < 0.0)).all()


@pytest.mark.parametrize(("mix", "closes"), [({"car": 1.0}, 0.27), ({"car": 0.9, "bus": 0.1}, 0.97)])
@pytest.mark.parametrize("beside", [-0.2, -0.05, 0.05, 0.2])
def test_a_road_of_one_lane_is_closed_exactly_where_nobody_has_room_within_it(world_on, mix, closes, beside):
    aside = closes + beside
    parked = event("accident", vehicles=[{"lane": "west_in_0", "at": 40, "lateral": -(aside + 0.9)}])
    world = world_on("roundabout")
    world.reset(PlanSource("roundabout", 20.0, "south", mix=mix, events=(parked,)).plan(0))
    world.advance(np.array([-6.0, 0.0]))
    (row,) = world.network.movement("west", "south").rows
    assert bool(world.stage._stand_ins) == (beside < 0.0)
    assert bool(world.stage.obstructed.passable) == (beside > 0.0)
    assert (np.isfinite(world._detours._end[:, row]) == (beside < 0.0)).all()


def test_nobody_queues_for_good_behind_what_leaves_room_to_pass(world):
    """A car 1.2 m beside the centre line closed the lane for SUMO alone: who turns right stood for 32 s."""
    parked = event("accident", vehicles=[{"lane": "west_in_0", "at": 5, "lateral": -2.1}])
    plan = PlanSource(origin="south", turn="right", density=30.0, warm_up_s=0.1, events=(parked,))
    world.reset(plan.plan(2))
    stood: dict[str, float] = {}
    for _ in range(400):
        world.advance(np.array([-6.0, 0.0]))
        scene = world.scene()
        before = (np.abs(scene.position[:, 1] + 5.25) < 0.5) & (scene.position[:, 0] < -15.0)
        slow = np.hypot(*scene.velocity.T) < 0.3
        for i in np.flatnonzero(before & slow & (scene.path >= 0)):
            stood[scene.ids[i]] = stood.get(scene.ids[i], 0.0) + 0.1
    assert max(stood.values(), default=0.0) < 8.0


def test_what_must_be_free_beside_vehicles_is_what_the_yielding_layer_looks_at():
    assert pytest.approx(0.5 * GROW_WIDTH) == BESIDE_M
