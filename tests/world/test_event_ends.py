"""Events that overlap, end, or put things before the ego: what counts meanwhile, and what is left of each."""

import math
from dataclasses import replace
from itertools import pairwise

import libsumo
import numpy as np
import pytest

from rudc.agents.registry import make_agent
from rudc.env.episode import Episode
from rudc.env.tracking import steering
from rudc.evaluation.rollout import run_episode
from rudc.scenario import load_scenario
from rudc.scenario.distributions import Uniform
from rudc.scenario.events.event import WAITS_S
from tests.plans import event
from tests.world.test_events import CALM, LATER, STAND, run

LED = replace(CALM, density=10.0, origin="south", turn="straight", speed=(9.0, 9.0), distance=(60.0, 60.0))
"""the ego follows a leader"""


def test_of_several_events_one_counts_and_each_ends_for_itself(world):
    """The end of one undid the other: its vehicle drove off at its own speed. The last counts, of top speeds
    the lowest."""
    slow = [event("slow_vehicle", vehicle="leader", speed=v, duration=t) for v, t in ((2.0, 3.2), (3.0, 5.0))]
    dense = [
        event("density_surge", density=d, duration=t, when={"simulation_time": {"above": after}})
        for d, t, after in ((30.0, 3.0, 0.5), (40.0, 3.0, 2.0))
    ]
    heedless = [event("priority_violation", vehicle="leader", duration=t) for t in (1.0, 3.0)]
    source = replace(CALM, density=10.0, origin="south", turn="straight", events=(*slow, *heedless, *dense))
    scenes = run(world, source, 1.5, u=np.zeros(2))
    (name,) = world.happenings()[0].bodies
    assert name in world.stage.unlawful
    assert world.traffic.density == 30.0
    found = {}
    while scenes[-1].time_s < 6.5:
        world.advance(STAND)
        scenes.append(world.scene())
        if name in scenes[-1].ids:
            top, unlawful = libsumo.vehicle.getMaxSpeed(name), name in world.stage.unlawful
            found[round(scenes[-1].time_s, 1)] = top, unlawful, world.traffic.density
    assert found[2.8] == (2.0, True, 40.0), "the first of each but the heavier traffic is over"
    assert found[4.0] == (3.0, False, 40.0), "the lower top speed and the first surge are over, too"
    assert found[6.0] == (30.0, False, 10.0)


@pytest.mark.parametrize("warm_up_s", [5.0, 4.3])
def test_times_are_kept_to_the_decision_whatever_the_warm_up(world, warm_up_s):
    """Some events began or ended one decision off, by how SUMO's clock and ours were rounded."""
    surges = [
        event("density_surge", density=20.0, duration=t, when={"simulation_time": {"above": after}})
        for t, after in ((0.7, 0.55), (1.1, 1.0), (1.3, 2.0), (2.2, 1.05), (2.2, 3.0))
    ]
    ends: dict[str, float] = {}
    world.reset(replace(CALM, warm_up_s=warm_up_s, events=tuple(surges)).plan(0))
    for _ in range(60):
        before = world.scene().time_s
        world.advance(STAND)
        ends |= {h.name: before for h in world.happenings() if h.is_over and h.name not in ends}
    begun = [happening.begun_s for happening in world.happenings()]
    assert begun == [0.6, 1.1, 2.1, 1.1, 3.1]
    assert [*ends.values()] == [1.3, 2.2, 3.3, 3.4, 5.3]
    assert world.scene().time_s == 6.0


def test_what_stood_in_the_way_leaves_no_stand_in_that_comes_later(world):
    """Where an SV stood in its place SUMO let it onto the road when the thing was gone, for good."""
    stalled = [
        event(
            "stalled_vehicle", lane=f"{arm}_in_1", at=at, duration=1.0, when={"simulation_time": {"above": 3}}
        )
        for arm, at in (("west", 15), ("north", 5), ("east", 15))
    ]
    source = replace(CALM, density=30.0, origin="south", turn="left", events=tuple(stalled))
    for seed in range(8):
        run(world, source, 25.0, seed)
        assert all(happening.is_over for happening in world.happenings())
        assert not [name for name in libsumo.vehicle.getIDList() if name.startswith("block")]
        assert not [name for name in libsumo.simulation.getPendingVehicles() if name.startswith("block")]


def test_a_road_that_is_dry_again_lets_all_brake(world):
    wet = event("low_friction", friction=0.1)
    dry = event("low_friction", friction=1.0, when={"simulation_time": {"above": 1}})
    run(world, replace(CALM, events=(wet,)), 0.5)
    slipping = [libsumo.vehicle.getEmergencyDecel(name) for name in world.traffic.drivers]
    assert slipping == [pytest.approx(0.981)] * len(slipping)
    run(world, replace(CALM, events=(wet, dry)), 2.0)
    present = set(libsumo.vehicle.getIDList()) & set(world.traffic.drivers)
    assert {libsumo.vehicle.getEmergencyDecel(name) for name in present} == {9.0}


def test_the_road_holds_an_ego_that_sumo_drives_as_it_does_others(world):
    wet = event("low_friction", friction=0.2)
    later = event("low_friction", friction=0.1, when={"simulation_time": {"above": 1}})
    run(world, replace(CALM, events=(wet,)), 0.3, ego_driver="sumo")
    assert libsumo.vehicle.getEmergencyDecel("ego") == pytest.approx(0.2 * 9.81)
    run(world, replace(CALM, events=(wet, later)), 2.0, ego_driver="sumo")
    assert libsumo.vehicle.getEmergencyDecel("ego") == pytest.approx(0.981)
    run(world, CALM, 0.3, ego_driver="sumo")
    assert libsumo.vehicle.getEmergencyDecel("ego") == 9.0


@pytest.mark.parametrize(
    "blocks",
    [
        event("accident", vehicles=[{"lane": "east_in_0", "at": 20}], duration=3),
        event("lane_closure", lane="east_in_0", at=20, length=10, duration=3),
    ],
    ids=["accident", "lane_closure"],
)
def test_what_blocks_a_lane_for_a_while_is_then_taken_away(world, blocks):
    """Also for SUMO, whose vehicles wait on a lane that is closed: traffic passes there afterwards."""
    source = replace(CALM, density=40.0, events=(blocks,))
    scenes = run(world, source, 15.0)
    x, y, _ = world.network.place_on_lane("east_in_0", 20.0)

    def passers(some):
        near = (
            scene.ids[i]
            for scene in some
            for i in (np.hypot(*(scene.position - (x, y)).T) < 2.0).nonzero()[0]
        )
        return {name for name in near if not name.startswith(blocks.kind)}

    assert any(name.startswith(blocks.kind) for name in scenes[25].ids)
    assert not passers(scenes[:29])
    assert not any(name.startswith(blocks.kind) for name in scenes[32].ids)
    assert passers(scenes[32:])


@pytest.mark.parametrize("standing", [False, True])
def test_what_begins_in_one_decision_does_not_appear_in_one_place(world, standing):
    """Neither saw the other, since the scene that both looked at had none of them."""
    at = {"lane": "west_out_0", "at": 40}
    when = {"simulation_time": {"above": 0.5}}
    first = event("accident", vehicles=[at], when=when) if standing else event("wrong_way", **at, when=when)
    near = {**at, "at": 46} if standing else at  # m before it, but less than it needs to stop
    second = event("wrong_way", **near, speed=6.0, when=when)
    scenes = run(world, replace(CALM, density=0.0, events=(first, second)), 6.0)
    together = [np.hypot(*np.subtract(*scene.position)) for scene in scenes if scene.count == 2]
    assert min(together, default=np.inf) > 4.0
    assert bool(together) != standing, "it never has room where the other stands for good"


@pytest.mark.parametrize("stays", [False, True])
@pytest.mark.parametrize(
    ("kind", "before_m", "v"),
    [
        ("accident", 4.0, 0.0),
        ("lane_closure", 4.0, 0.0),
        ("stalled_vehicle", 4.0, 0.0),
        ("accident", 12.0, 10.0),
    ],
)
def test_what_stands_waits_for_who_is_in_its_place_but_not_for_ever(world, kind, before_m, v, stays):
    """It appeared on top of surrounding vehicles, or so near before them that they drove through it. Its
    trigger holds for one decision only."""
    place = {"lane": "west_in_0", "at": 20}
    fields = {"accident": {"vehicles": [place]}, "lane_closure": {**place, "length": 5}}.get(kind, place)
    later = event(kind, **fields, when={"simulation_time": {"above": 0.05, "below": 0.15}})
    run(world, replace(CALM, density=0.0, events=(later,)), 0.1)
    alone = world.scene()
    x, y, psi = world.network.place_on_lane("west_in_0", 20)
    one = replace(
        alone, ids=("there",), position=np.array([[x - before_m, y]]), velocity=np.array([[v, 0.0]]),
        heading=np.array([psi]), acceleration=np.zeros(1), size=np.array([[5.0, 1.8]]),
        kind=np.zeros(1, int), path=np.zeros(1, int), path_s=np.zeros(1),
    )  # fmt: skip
    begun = []
    for time_s in (0.1, 0.2, WAITS_S, WAITS_S + 0.1):
        scene = one if stays or time_s < 0.3 else alone
        begun += [time_s for _ in world._script.step(replace(scene, time_s=time_s))]
    assert begun == [WAITS_S + 0.1 if stays else WAITS_S]


@pytest.mark.parametrize(
    ("state", "sudden"),
    [((), False), (("low_friction", {"friction": 0.2}), True), (("actuator_delay", {"delay": 1.5}), True)],
)
def test_sudden_is_what_the_ego_cannot_stop_before_on_that_road_with_that_car(world, state, sudden):
    """16 m before an ego at 9 m/s: on ice, or with late brakes, it could not stop, and was at fault."""
    road = [event(state[0], **state[1])] if state else []
    stalled = event("stalled_vehicle", lane="ego_in", at=10, when={"simulation_time": {"above": 0.15}})
    start = {"distance": (30.0, 30.0), "speed": (9.0, 9.0)}
    world.reset(replace(CALM, density=0.0, events=(*road, stalled), **start).plan(0))
    for _ in range(3):
        world.advance(np.array([0.0, 0.0]))
    assert bool(world.stage.sudden) == sudden


def test_sudden_is_all_up_to_where_the_ego_stops(world):
    """The last part of its way, up to half a metre, was left out."""
    world.reset(replace(LED, density=0.0).plan(0))
    stage, ego = world.stage, world.scene().ego
    stage.scene = world.scene()
    for nearer in (0.01, -0.01):
        away = 0.5 * world.vehicle.length + ego.v**2 / (2.0 * stage._braking()) - nearer + 1.0
        x, y = ego.x + away * math.cos(ego.psi), ego.y + away * math.sin(ego.psi)
        assert stage._too_near((x, y, ego.psi), (2.0, 2.0)) is (nearer > 0.0)


@pytest.mark.parametrize(("lane", "at", "sudden"), [("south_in_0", 6, True), ("south_out_1", 12, False)])
def test_sudden_is_what_appears_in_the_way_until_the_ego_has_stood(world, lane, at, sudden):
    """Beside the ego, in the lane of oncoming traffic, it is not."""
    near = event(
        "accident", vehicles=[{"lane": lane, "at": at}], when={"ego_distance_to_junction": {"below": 15}}
    )
    source = replace(CALM, density=0.0, origin="south", turn="straight", speed=(10.0, 10.0), events=(near,))
    scene = world.reset(source.plan(0))
    while not world.happenings()[0].begun_s:
        world.advance(np.array([0.0, steering(scene)]))
        scene = world.scene()
    assert bool(world.stage.sudden) == sudden
    while world.scene().ego.v > 0.0:
        world.advance(STAND)
    world.advance(STAND)
    assert not world.stage.sudden


def test_drivers_keep_their_own_speed_factors_whatever_is_set_besides(world):
    """SUMO gives a vehicle its type's with the first value of its own, and with every other type."""
    quick = Uniform(uniform=(0.8, 1.2))
    wet = event("low_friction", friction=0.3, when={"simulation_time": {"above": 0.3}})
    slow = event("slow_vehicle", vehicle="all", speed=3.0, duration=0.5, when=LATER)
    for events in ((wet,), (slow,), (wet, slow)):
        run(world, replace(CALM, speed_factor=quick, events=events), 2.0)
        present = set(libsumo.vehicle.getIDList()) & set(world.traffic.drivers)
        own = {name: world.traffic.drivers[name].speed_factor for name in present}
        assert {name: libsumo.vehicle.getSpeedFactor(name) for name in present} == pytest.approx(own)
        assert len({round(factor, 2) for factor in own.values()}) > 5


def test_who_leads_the_ego_changes_lanes_only_where_there_is_room(world):
    """When it was asked to leave a closed lane it did so at once, into whoever was beside it."""
    events = [
        {"kind": "lane_closure", "lane": "ego_in", "at": 8, "length": 10},
        {"kind": "slow_vehicle", "vehicle": "leader", "speed": 6},
        {"kind": "slow_vehicle", "vehicle": "follower", "speed": 9},
    ]
    route = {"from": "south", "turn": "straight"}
    changed = {"traffic.density": 45, "ego.route": route, "ego.distance": 55, "events": events}
    changed["episode.timeout"] = 10  # it did so within 1 s
    scenario, episode = load_scenario("random_destination", changed), Episode(world)
    for seed in (1, 6, 8):
        record = run_episode(episode, scenario.plan(seed), make_agent("planner"))
        assert record.values["sv_collisions"] == 0, seed


def test_a_vehicle_slows_down_without_hurry(world):
    """Its top speed fell at once, and SUMO braked it from 9 to 3 m/s as hard as it can."""
    slow = event("slow_vehicle", vehicle="leader", speed=3.0, when=LATER)
    scenes = run(world, replace(LED, events=(slow,)), 4.0, u=np.zeros(2))
    (name,) = world.happenings()[0].bodies
    speeds = np.array([np.hypot(*s.velocity[s.ids.index(name)]) for s in scenes if name in s.ids])
    assert speeds[0] == pytest.approx(9.0, abs=0.1)
    assert speeds[-1] == pytest.approx(3.0, abs=0.1)
    assert np.diff(speeds).min() == pytest.approx(-0.3, abs=0.01)


@pytest.mark.parametrize("kinds", [("hard_brake", "stalled_vehicle"), ("stalled_vehicle", "hard_brake")])
def test_who_is_slowed_down_by_two_events_brakes_as_the_harder_one_says(world, kinds):
    """The event that began last counted: who stalled while braking hard braked at 3 m/s2."""
    events = tuple(event(kind, vehicle="leader", when=LATER) for kind in kinds)
    scenes = run(world, replace(LED, events=events), 2.0, u=np.zeros(2))
    (name,) = world.happenings()[0].bodies
    speeds = np.array([np.hypot(*s.velocity[s.ids.index(name)]) for s in scenes if name in s.ids])
    assert np.diff(speeds).min() == pytest.approx(-0.7, abs=0.01)
    assert len(speeds) == len(scenes)


@pytest.mark.parametrize("slow", [1.0, 8.0])
def test_who_slows_down_yields_none_the_less(world, slow):
    """Slowing down would take the place of harder braking before the ego."""
    run(
        world, replace(LED, events=(event("slow_vehicle", vehicle="leader", speed=slow),)), 0.1, u=np.zeros(2)
    )
    (name,) = world.happenings()[0].bodies
    before = world.stage.speed(name)
    world._brakes.apply({name: (before, 6.0)}, 0.5)
    for _ in range(3):
        world.advance(np.zeros(2))
        world.scene()
    assert world.stage.brakes.asked == {name: 6.0}
    assert before - libsumo.vehicle.getSpeed(name) > 1.7


@pytest.mark.parametrize("by_event", [0.5, 7.0])
def test_whom_an_event_brakes_brakes_harder_where_it_must(world, by_event):
    """It braked for nothing else: at 0.5 m/s2 it ran over pedestrians."""
    brake = event("hard_brake", vehicle="leader", deceleration=by_event, duration=20.0)
    run(world, replace(LED, events=(brake,)), 0.1, u=np.zeros(2))
    (name,) = world.happenings()[0].bodies
    speeds = [libsumo.vehicle.getSpeed(name)]
    world.stage.slow_down(name, by_event)
    world._brakes.apply({name: (speeds[0], 3.0)}, 0.2)
    for _ in range(3):
        world.advance(np.zeros(2))
        speeds.append(libsumo.vehicle.getSpeed(name))
    harder = max(by_event, 3.0)
    assert np.diff(speeds) == pytest.approx(-0.1 * np.array([harder, harder, by_event]), abs=0.01)


@pytest.mark.parametrize("first", [False, True])
@pytest.mark.parametrize(
    ("kind", "lasts", "passes"),
    [
        ("low_friction", {"friction": 0.5}, {"friction": 0.1}),
        ("sensor_dropout", {"range": 80.0}, {"probability": 1.0}),
        ("sensor_noise", {"position": 0.1}, {"speed": 2.0, "own_acceleration": 1.0}),
        ("actuator_delay", {"delay": 0.1}, {"lag": 0.5}),
    ],
)
def test_a_fault_with_a_duration_passes_and_the_one_that_it_replaced_is_back(
    world, kind, lasts, passes, first
):
    def faults():
        world.advance(STAND)
        known = world.sensors()
        sensors = known.miss, known.range_m, known.position_std, known.speed_std, known.own_acceleration_std
        return world.scene().actuation, sensors, world.traffic.grip

    later = event(kind, **passes, duration=0.5, when={"simulation_time": {"above": 0.55}})
    events = (event(kind, **lasts), later) if first else (later,)
    world.reset(replace(CALM, density=10.0, events=events).plan(0))
    before, *_, during, _ = [faults() for _ in range(8)]
    after = [faults() for _ in range(6)][-1]
    assert during != before == after
    over = [happening.is_over for happening in world.happenings()]
    assert over == ([False, True] if first else [True])


@pytest.mark.parametrize("ends", ["the event", "the dry road"])
def test_who_brakes_hard_to_yield_goes_on_when_an_event_or_the_dry_road_ends(world, monkeypatch, ends):
    """Until the yielding layer looked again, up to 0.4 s later, it braked comfortably."""
    brake = event("hard_brake", vehicle="leader", deceleration=0.5, duration=0.2)
    run(world, replace(LED, events=(brake,)), 0.1, u=np.zeros(2))
    (name,) = world.happenings()[0].bodies
    asked = 8.0 if ends == "the event" else 4.9  # that the wet road still gives
    monkeypatch.setattr(
        world,
        "_brake",
        lambda scene, s: world._brakes.apply({name: (libsumo.vehicle.getSpeed(name), asked)}, s),
    )
    world._brakes.apply({name: (libsumo.vehicle.getSpeed(name), asked)}, 0.5)
    if ends == "the dry road":
        run_on(world, 2)
        world.stage.set_friction(0.5)
    speeds = run_on(world, 4, name)
    assert np.diff(speeds) == pytest.approx(-0.1 * asked, abs=0.02)


def test_whom_an_event_braked_harder_brakes_on_to_yield_when_it_ends(world, monkeypatch):
    """What the yielding layer wanted was forgotten: the car sped up until the layer looked again."""
    brake = event("hard_brake", vehicle="leader", deceleration=6.0, duration=0.2)
    run(world, replace(LED, events=(brake,)), 0.1, u=np.zeros(2))
    (name,) = world.happenings()[0].bodies
    monkeypatch.setattr(world, "_brake", lambda scene, s: None)
    world.stage.slow_down(name, 6.0)
    world._brakes.apply({name: (libsumo.vehicle.getSpeed(name), 3.0)}, 0.5)
    speeds = run_on(world, 5, name)
    assert np.diff(speeds[1:]) == pytest.approx(-0.3, abs=0.02)


def run_on(world, decisions, name=None):
    """m/s of a vehicle before and after each of so many decisions."""
    speeds = [] if name is None else [libsumo.vehicle.getSpeed(name)]
    for _ in range(decisions):
        world.advance(np.zeros(2))
        speeds += [] if name is None else [libsumo.vehicle.getSpeed(name)]
    return speeds


def test_events_are_over_when_all_their_vehicles_have_left(world):
    """Lines and pictures said of them that they were still on."""
    events = (event("speeding", vehicle="leader", factor=1.5), event("priority_violation", vehicle="leader"))
    run(world, replace(CALM, density=10.0, origin="south", turn="straight", events=events), 2.0)
    (name,) = world.happenings()[0].bodies
    while name in world.scene().ids:
        world.advance(STAND)
    world.advance(STAND)
    assert all(happening.is_over for happening in world.happenings())
    assert not world.stage.unlawful


def test_nobody_is_let_off_the_brakes_when_the_last_pedestrian_leaves(world, monkeypatch):
    """The yielding layer then looks less often, and its next look was up to 0.4 s after its last ended."""
    looks, brake = [], world._brake
    monkeypatch.setattr(world, "_brake", lambda scene, s: (looks.append((scene.time_s, s)), brake(scene, s)))
    walk = event("pedestrian_crossing", arm="north", speed=4.5)
    world.reset(replace(CALM, events=(walk,)).plan(0))
    looks.clear()  # those before the ego was there
    for _ in range(60):
        world.advance(STAND)
    assert {lasts for _, lasts in looks} == {0.2, 0.5}
    assert all(begun + lasts >= following - 1e-6 for (begun, lasts), (following, _) in pairwise(looks))
