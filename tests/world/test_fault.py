"""The rules of fault: a contact made by hand for each rule, and for the limits between rules."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rudc.agents.registry import make_agent
from rudc.env.episode import Episode
from rudc.evaluation.rollout import run_episode
from rudc.network.network import load_network
from rudc.scenario import load_scenario
from rudc.world.fault import IN_SIGHT_S, judge
from rudc.world.scene import Kind
from rudc.world.yielding import Yielding
from tests.benchmarks.yielding import awkward_poses, fair_moment
from tests.plans import PlanSource, event


def beside(scene, ahead, left, turned):
    """Pose of something `ahead` and `left` m of the ego, its heading turned against the ego's."""
    ego = scene.ego
    cos, sin = math.cos(ego.psi), math.sin(ego.psi)
    return ego.x + ahead * cos - left * sin, ego.y + ahead * sin + left * cos, ego.psi + turned


@pytest.fixture
def contact(make_scene):
    """Fault of a contact with something at (ahead m, left m, turned rad), driving at v m/s."""

    def find(
        ahead, left, turned, v, *, ego=None, unlawful=False, held=False, kind=Kind.CAR, row=None, **where
    ):
        scene = make_scene(v=8.0 if ego is None else ego, **where)
        scene = make_scene(
            {"at": beside(scene, ahead, left, turned), "v": v, "kind": kind}, v=scene.ego.v, **where
        )
        if row is not None:
            scene = replace(scene, path=np.array([row]))
        return judge(scene, 0, unlawful, held)

    return find


def test_running_into_what_stands_is_the_egos_fault(contact):
    assert contact(4.8, 0.3, 0.0, 0.0) == "ego"
    assert contact(4.0, 0.0, math.pi / 2, 0.0) == "ego"
    assert contact(3.0, 0.0, math.pi / 2, 1.4, kind=Kind.PEDESTRIAN) == "ego"


def test_whom_the_yielding_layer_holds_before_the_ego_is_asked_for_right_of_way_first(contact, four_way):
    own, yields = four_way.route("south", "straight").row, four_way.paths.yields
    major = next(row for row in range(len(yields)) if yields[own, row] and not yields[row, own])
    minor = next(row for row in range(len(yields)) if yields[row, own] and not yields[own, row])
    for row, fault in ((major, "ego"), (minor, "other")):
        assert contact(3.0, 0.0, math.pi / 2, 0.0, row=row, front=8.0, held=True) == fault
        assert contact(3.0, 0.0, math.pi / 2, 0.0, row=row, front=8.0) == "ego", "it stands by itself"
    assert contact(4.8, 0.3, 0.0, 0.0, row=minor, held=True) == "ego", "run into from behind"
    beside_its_path = {"ego_offset": 2.0, "front": 8.0}
    assert contact(3.0, 0.0, math.pi / 2, 0.0, row=minor, held=True, **beside_its_path) == "ego"


def test_what_touches_a_standing_ego_while_standing_is_shared(contact):
    assert contact(4.8, 0.0, 0.0, 0.0, ego=0.0) == "shared"


def test_an_ego_that_creeps_into_what_stands_is_at_fault_if_it_is_the_faster_one(contact):
    assert contact(4.8, 0.0, 0.0, 0.0, ego=0.3) == "ego"
    assert contact(3.0, 0.0, math.pi / 2, 0.0, ego=0.3, kind=Kind.PEDESTRIAN) == "ego"
    assert contact(3.0, 0.0, math.pi / 2, 1.4, ego=0.3, kind=Kind.PEDESTRIAN) == "shared"
    assert contact(4.8, 0.0, math.pi, 0.4, ego=0.2) == "shared"
    assert contact(4.8, 0.0, 0.0, 0.0, ego=0.02) == "shared"


def test_an_ego_that_waits_where_it_may_is_never_at_fault(contact):
    assert contact(3.0, 0.0, math.pi / 2, 6.0, ego=0.0, front=-1.0) == "other"
    assert contact(-4.8, 0.0, 0.0, 6.0, ego=0.0, front=20.0) == "other", "hit from behind, anywhere"


@pytest.mark.parametrize("front", [-30.0, 40.0])
def test_head_on_on_an_arm_who_is_over_the_middle_is_at_fault_whoever_goes_first(contact, four_way, front):
    """The junction's right of way decided 30 m away from it."""
    own, paths = four_way.route("south", "straight").row, four_way.paths
    rows = [row for row in range(paths.count) if paths.yields[own, row] != paths.yields[row, own]]
    assert {bool(paths.yields[own, row]) for row in rows} == {True, False}
    for row in rows:
        head_on = {"row": row, "front": front}
        assert contact(4.9, 0.5, math.pi - 0.1, 8.0, ego_offset=4.6, **head_on) == "ego"
        assert contact(4.9, 0.5, math.pi - 0.1, 8.0, **head_on) == "shared"


def test_an_ego_that_faces_backwards_is_as_wide_as_any(make_scene):
    """Its width counted as negative: over the middle by 0.3 m it counted as 1.5 m short of it."""
    scene = make_scene({"row": 0, "s": 10.0, "v": 8.0}, front=-20.0)
    meets = replace(scene, heading=np.array([scene.ego.psi]))
    ego = replace(scene.ego, psi=scene.ego.psi + math.pi)
    for offset, fault in ((4.7, "ego"), (4.0, "shared")):
        assert judge(replace(meets, ego=ego, ego_offset=offset), 0, unlawful=False) == fault


def test_an_ego_that_stands_beside_its_path_is_judged_as_any(make_scene, contact):
    scene = make_scene(v=0.0, front=-1.0, ego_offset=2.0)
    scene = make_scene(
        {"at": beside(scene, 3.0, 0.0, math.pi / 2), "v": 6.0}, v=0.0, front=-1.0, ego_offset=2.0
    )
    assert judge(scene, 0, unlawful=True) == "other"
    yields = scene.network.paths.yields
    crossing = next(row for row in range(len(yields)) if yields[scene.route.row, row])
    assert judge(replace(scene, path=scene.path * 0 + crossing), 0, unlawful=False) == "ego"


def test_in_line_the_one_behind_is_at_fault(contact):
    assert contact(4.9, 0.2, 0.1, 6.0) == "ego"
    assert contact(-4.9, -0.2, 0.1, 10.0) == "other"
    assert contact(1.0, 1.7, 0.1, 8.0) == "shared", "side by side"


@pytest.mark.parametrize(
    ("own", "theirs", "lane", "fault"),
    [
        ("right", "straight", -2.3, "ego"),
        ("right", "straight", 2.3, None),
        ("right", "straight", -0.9, None),
        ("right", "right", -2.3, None),
        ("straight", "right", 2.3, "other"),
        ("straight", "left", -5.8, "other"),
        ("left", "straight", 5.8, "ego"),
        ("left", "straight", 0.0, None),
    ],
)
def test_who_turns_over_the_way_of_who_drives_beside_it_is_at_fault(make_scene, own, theirs, lane, fault):
    """As a car that turns right over a cycle lane; whoever is run into, and at any angle. `lane`: m from the
    middle of the lane that a row begins in."""
    scene = make_scene({"row": 0, "s": 10.0, "v": 6.0}, v=6.0, front=6.0, turn=own)
    ego, paths = scene.ego, scene.network.paths
    row = scene.network.route("south", theirs).row
    for ahead, turned in ((0.5, 0.3), (-4.0, 0.2), (0.5, 1.2)):
        at = paths.stop_s[row] + scene.front_s - scene.route.stop_line_s - 2.0 + ahead
        x, y, psi = (float(value) for value in paths.pose(np.array(row), np.array(at)))
        place = np.array([[x - lane * math.sin(psi), y + lane * math.cos(psi)]])
        towards = ego.psi + turned
        meets = replace(
            scene, path=np.array([row]), path_s=np.array([at]), position=place, heading=np.array([towards])
        )
        alone = judge(replace(meets, path=np.array([-1])), 0, unlawful=False)
        found = judge(meets, 0, unlawful=False)
        assert found == fault if fault else found in {"shared", alone}, (ahead, turned)


def test_before_the_stop_line_nobody_turns_yet(make_scene):
    """A cyclist who ran into the rear of a car that would turn right 30 m later was excused."""
    scene = make_scene({"row": 0, "s": 10.0, "v": 9.0}, v=6.0, front=-30.0, turn="right")
    ego, row = scene.ego, scene.network.route("south", "straight").row
    x, y, _ = beside(scene, -4.0, -1.8, 0.0)
    at = scene.network.paths.stop_s[row] - 34.0
    meets = replace(
        scene, path=np.array([row]), path_s=np.array([at]), position=np.array([[x, y]]),
        heading=np.array([ego.psi]),
    )  # fmt: skip
    assert judge(meets, 0, unlawful=False) == "other"


@pytest.mark.parametrize(
    ("own", "theirs", "lane", "fault"),
    [("east", "north", -2.3, "ego"), ("north", "east", 2.3, "other"), ("north", "west", -2.3, "ego")],
)
def test_in_a_ring_who_leaves_over_the_way_of_who_goes_on_is_at_fault(make_scene, own, theirs, lane, fault):
    """By how far they turn in all, who goes on round the ring turned more."""
    network = load_network("roundabout")
    route, paths = network.route("south", own), network.paths
    row = network.movement("south", theirs).rows[0]
    ego_s = route.stop_line_s + 8.0
    x, y, psi = (float(value) for value in route.path.pose(ego_s))
    scene = make_scene({"row": 0, "s": 10.0, "v": 6.0}, v=6.0)
    at = paths.stop_s[row] + 7.0
    there = [float(value) for value in paths.pose(np.array(row), np.array(at))]
    place = [there[0] - lane * math.sin(there[2]), there[1] + lane * math.cos(there[2])]
    meets = replace(
        scene, network=network, route=route, ego=replace(scene.ego, x=x, y=y, psi=psi), ego_s=ego_s,
        ego_offset=0.0, path=np.array([row]), path_s=np.array([at]), position=np.array([place]),
        heading=np.array([psi + 0.3]),
    )  # fmt: skip
    assert judge(meets, 0, unlawful=False) == fault


def test_where_ways_merge_the_right_of_way_decides_unless_one_drives_behind(contact, four_way):
    own, yields = four_way.route("south", "right").row, four_way.paths.yields
    major = next(row for row in range(len(yields)) if yields[own, row] and not yields[row, own])
    where = {"front": 8.0, "turn": "right", "row": major}
    assert contact(1.0, 1.7, 0.7, 8.0, **where) == "ego", "at 40 degrees it owed the way"
    assert contact(4.9, 0.2, 0.7, 6.0, **where) == "ego"
    assert contact(-4.9, -0.2, 0.7, 10.0, **where) == "ego"
    assert contact(-4.9, -0.2, 0.1, 10.0, **where) == "other", "hit from behind"
    assert contact(1.0, 1.7, 0.1, 8.0, **where) == "ego", "side by side"
    where["row"] = next(
        row
        for row in range(len(yields))
        if yields[own, row] == yields[row, own] and four_way.paths.origin[row] != four_way.paths.origin[own]
    )
    assert contact(1.0, 1.7, 0.7, 8.0, unlawful=True, **where) == "other"
    assert contact(1.0, 1.7, 0.7, 8.0, **where) == "shared"


def test_an_ego_that_stops_at_the_last_instant_does_not_stand(contact):
    assert contact(-1.0, 1.8, 0.1, 8.0, ego=0.0, front=20.0) == "shared"
    assert contact(-1.0, 1.8, 0.1, 8.0, ego=0.0, front=20.0, waited_s=IN_SIGHT_S) == "other"


def test_who_drives_against_the_rules_is_at_fault(contact):
    assert contact(4.9, 0.0, math.pi, 6.0) == "other", "it has no path: it drives against its lane"


def test_who_breaks_the_rules_is_at_fault_unless_the_ego_owed_it_the_way(contact, four_way):
    own, yields = four_way.route("south", "straight").row, four_way.paths.yields
    for row in range(len(yields)):
        fault = contact(3.0, 0.0, math.pi / 2, 6.0, unlawful=True, row=row, front=8.0)
        assert fault == ("ego" if yields[own, row] and not yields[row, own] else "other")


def test_else_the_right_of_way_decides(contact, four_way):
    own, yields = four_way.route("south", "straight").row, four_way.paths.yields
    major = next(row for row in range(len(yields)) if yields[own, row] and not yields[row, own])
    minor = next(row for row in range(len(yields)) if yields[row, own] and not yields[own, row])
    assert contact(3.0, 0.0, math.pi / 2, 6.0, row=major, front=8.0) == "ego"
    assert contact(3.0, 0.0, -math.pi / 2, 6.0, row=minor, front=8.0) == "other"
    neither = next(
        row for row in range(len(yields)) if row != own and not yields[own, row] and not yields[row, own]
    )
    assert contact(3.0, 0.0, -math.pi / 2, 6.0, row=neither, front=8.0) == "shared"


ON_TOP = """
name: on_top
ego: {route: {from: south, turn: left}, distance: 40}
traffic: {density: 10}
events:
  - {kind: accident, vehicles: [{lane: ego_in, at: 30}], when: {traveled_distance: {above: 4.0}}}
"""


def test_what_is_put_nearer_than_the_ego_could_stop_is_not_its_fault(world_on, tmp_path):
    (tmp_path / "on_top.yaml").write_text(ON_TOP, encoding="utf-8")
    scenario = load_scenario(tmp_path / "on_top.yaml")
    for place, fault in ((30, "other"), (8, "ego")):
        plan = scenario.varied({"events.0.vehicles.0.at": place}).plan(0)
        record = run_episode(Episode(world_on(scenario.network)), plan, make_agent("follower"))
        assert [record.values[name] for name in ("outcome", "hit", "fault")] == ["collision", "car", fault]


@pytest.mark.parametrize("first", ["accident", "low_friction"])
def test_what_appears_together_with_ice_is_as_sudden_in_either_order(world, first):
    """Whose fault it was to hit it depended on which of the two the file named first."""
    when = {"traveled_distance": {"above": 4.0}}
    events = [
        event("accident", vehicles=[{"lane": "ego_in", "at": 12}], when=when),
        event("low_friction", friction=0.1, when=when),
    ]
    events.sort(key=lambda one: one.kind != first)
    source = PlanSource(density=0.0, turn="left", distance=(40.0, 40.0), speed=(8.0, 8.0))
    world.reset(replace(source, events=tuple(events)).plan(0))
    hit = None
    while hit is None and world.scene().time_s < 10.0:
        hit = world.advance(np.zeros(2)).collision
    assert hit is not None
    assert hit.fault == "other"


def test_in_a_roundabout_who_enters_owes_the_way_to_who_is_in_it(make_scene):
    """From the south to the west and from the north to the east each enters before the other."""
    network = load_network("roundabout")
    route, paths = network.route("south", "west"), network.paths
    other = network.movement("north", "east").rows[0]
    assert paths.yields[route.row, other]
    assert paths.yields[other, route.row]

    def fault(beyond, its):
        ego_s = route.stop_line_s + beyond
        x, y, psi = (float(value) for value in route.path.pose(ego_s))
        scene = make_scene({"at": (x + 2.0, y, psi + math.pi / 2), "v": 6.0}, v=6.0)
        ego = replace(scene.ego, x=x, y=y, psi=psi)
        at = np.array([paths.stop_s[other] + its])
        scene = replace(
            scene, network=network, route=route, ego=ego, ego_s=ego_s, ego_offset=0.0, path=np.array([other]),
            path_s=at,
        )  # fmt: skip
        return judge(scene, 0, unlawful=False)

    assert fault(beyond=4.0, its=30.0) == "ego"
    assert fault(beyond=30.0, its=4.0) == "other"


def test_who_stands_in_sight_for_a_while_does_so_by_itself(four_way, world):
    """The yielding layer holds a car before an ego that stands across its way; the ego then hits it."""
    world.reset(PlanSource(density=30.0, origin="west", turn="straight", speed=(0.0, 0.0)).plan(0))
    pose, faults = awkward_poses(four_way, "west")["in the junction, at 45 degrees"], set()
    assert fair_moment(world, pose)
    world.put_ego(*pose)
    for _ in range(150):
        world.advance(np.zeros(2))
        scene = world.scene()
        moving = replace(scene, ego=replace(scene.ego, v=3.0))
        for name in world._for_ego.intersection(scene.ids):
            stood = world._sumo.stood(name)
            if stood > 0.0:
                faults.add((stood < IN_SIGHT_S, world._collision(name, moving, moving).fault))
    assert faults == {(True, "shared"), (False, "ego")}


@pytest.mark.parametrize("for_ego", [True, False])
def test_who_brakes_for_something_else_than_the_ego_is_not_held_before_it(world, monkeypatch, for_ego):
    """Whose fault it was to run into it depended on the right of way, as if it had braked for the ego."""
    name = world.reset(PlanSource(density=25.0).plan(0)).ids[0]
    found = Yielding([0], [1.0], [0] * for_ego)
    monkeypatch.setattr("rudc.world.world.must_yield", lambda *_, **__: found)
    monkeypatch.setattr("rudc.world.world.judge", lambda scene, index, unlawful, held, sudden: held)
    world.advance(np.zeros(2))
    scene = world.scene()
    assert world._collision(name, scene, scene).fault is for_ego
