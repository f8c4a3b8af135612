"""What a driver is shown: courses round what blocks, and the car that is there; on real episodes."""

# ruff: noqa: F811 -- fixtures come by import
import math
from dataclasses import replace

import numpy as np
import pytest

from rudc.agents.adaptation import Adaptation
from rudc.agents.base import Decision
from rudc.agents.blocking import IDLE, IMPASSE, LONG, PATIENCE, Blocking
from rudc.agents.courses import PULL_OUT, Courses, along
from rudc.agents.outlook import Outlook, OutlookAgent, OutlookSettings
from rudc.agents.registry import agent_settings, make_agent
from rudc.env.episode import Episode
from rudc.errors import AgentError
from rudc.safety.corrected import Corrected
from rudc.safety.plant import SUBSTEP_S
from rudc.safety.residual import trust
from rudc.scenario import load_scenario
from rudc.vehicle import Actuation, EgoVehicle
from rudc.world.ego import EgoPlant
from rudc.world.scene import Kind
from tests.plans import PlanSource, event
from tests.world.conftest import four_way, make_scene, world, world_on  # noqa: F401 -- fixtures


def drive(world, plan, agent):
    """The outcome, and what the agent did and was shown at each decision."""
    episode = Episode(world)
    scene = episode.reset(plan)
    agent.reset(scene, plan.seed)
    seen = []
    while episode.outcome is None:
        decision = agent.act(scene)
        seen.append((scene, decision))
        scene = episode.step(decision.u).scene
    return episode.outcome, seen


@pytest.mark.parametrize("scenario", ["stalled_truck", "road_works", "blocked_left_turn"])
def test_the_planner_gets_through_where_its_path_is_blocked(world_on, scenario):
    found = load_scenario(scenario)
    for seed in (0, 1):
        outcome, _ = drive(world_on(found.network), found.plan(seed), make_agent("planner"))
        assert outcome == "success"


def test_without_a_course_it_does_not(world_on):
    found = load_scenario("road_works")
    outcome, _ = drive(world_on(found.network), found.plan(0), make_agent("gap-acceptance"))
    assert outcome == "frozen"


def test_on_a_free_road_nothing_is_planned_and_nothing_changes(world):
    plan = PlanSource(origin="south", turn="left", density=15.0).plan(3)
    plain = drive(world, plan, make_agent("gap-acceptance"))
    planner = make_agent("planner")
    planned = drive(world, plan, planner)
    assert plain[0] == planned[0]
    assert all(np.array_equal(a.u, b.u) for (_, a), (_, b) in zip(plain[1], planned[1], strict=True))
    assert isinstance(planner, OutlookAgent)
    assert planner.outlook.courses is not None
    assert planner.outlook.courses.course is None


def test_a_queue_blocks_only_behind_somebody_who_goes_nowhere(make_scene, four_way):
    paths, row = four_way.paths, 0
    beyond = float(paths.exit_s[row]) + 20.0
    queue = [{"row": row, "s": beyond}, {"row": row, "s": beyond - 7.0}]
    inbound = [
        {"row": row, "s": float(paths.stop_s[row]) - 3.0},
        {"row": row, "s": float(paths.stop_s[row]) - 10.0},
    ]
    watch = Blocking()
    scene = make_scene(*queue, *inbound)
    waits = math.ceil(10 * PATIENCE)
    assert not any(watch.look(replace(scene, time_s=0.1 * k)).any for k in range(waits))
    for k in (0, 1):
        watch.look(replace(scene, time_s=0.1 * (waits + k)))
    blocks = watch.look(replace(scene, time_s=0.1 * (waits + 2)))
    assert blocks.standing.number == 2
    assert {tuple(p) for p in blocks.standing.position} == {tuple(p) for p in scene.position[:2]}


@pytest.mark.parametrize("sight_m", [math.inf, 15.0])
def test_a_course_ends_when_what_it_leads_round_is_gone_and_not_only_unseen(make_scene, four_way, sight_m):
    row, courses = four_way.movement("south", "straight").rows[0], Courses()
    x, y, psi = (float(v) for v in four_way.paths.pose(np.int64(row), four_way.paths.stop_s[row] - 10.0))
    wall = {"at": (x, y, psi), "kind": Kind.OBSTACLE, "size": (4.0, 2.0)}
    there, gone = (make_scene(*others, turn="straight", front=-35.0, v=0.0) for others in ((wall,), ()))
    courses.reset(there)
    found = []
    for k in range(120):
        scene = there if k < 60 else replace(gone, sight_m=sight_m)
        courses.see(replace(scene, time_s=0.1 * k))
        found.append(courses.course is not None)
    assert found[59]
    assert all(found[60:79]), "sensors may have missed it"
    assert found[-1] == (sight_m < 20.0)


@pytest.mark.parametrize("v", [9.0, 15.0])
def test_it_slows_down_in_time_for_who_stands_for_the_moment(make_scene, four_way, v):
    """At 15 m/s it began 20 m before, and came to stand too near to pull out."""
    row, courses = four_way.movement("south", "straight").rows[0], Courses()
    stop = float(four_way.paths.stop_s[row])
    plant, hardest = EgoPlant(four_way.vehicle), 0.0
    scene = make_scene({"row": row, "s": stop - 3.0}, turn="straight", front=-60.0, v=v)
    scene = replace(scene, route=replace(scene.route, limits=((-math.inf, 20.0),)))
    plant.resume(scene.ego, Actuation())
    courses.reset(scene)
    for k in range(55):
        u = courses.govern(courses.see(scene), np.zeros(2))
        hardest = min(hardest, float(u[0])) if scene.ego.v > 5.0 else hardest
        ego = plant.step(float(u[0]), 0.0, 0.1)
        s, offset = scene.route.path.project(ego.x, ego.y, scene.ego_s)
        scene = replace(scene, ego=ego, ego_s=s, ego_offset=offset, time_s=0.1 * k)
    assert hardest > -4.8
    assert stop - 5.5 - scene.ego_s - 2.5 > PULL_OUT - 0.3


def test_who_stands_in_the_junction_blocks_once_it_has_waited_for_nobody_or_too_long(make_scene, four_way):
    alone, busy = _waits_to_turn_left(make_scene, four_way)
    seen = [_standing_at(alone, PATIENCE + share * IDLE) for share in (0.1, 0.9, 1.2)]
    assert seen == [0, 0, 1]
    assert [_standing_at(busy, share * LONG) for share in (0.9, 1.1)] == [0, 1]


@pytest.mark.parametrize("decision_s", [0.05, 0.1, 0.5, 1.0])
def test_time_is_counted_however_long_a_decision_is(make_scene, four_way, decision_s):
    """Of a decision of 0.5 s, 0.2 s were counted: it took 12.5 s instead of 10."""
    scene, _ = _waits_to_turn_left(make_scene, four_way)
    watch, k = Blocking(), 0
    while not watch.look(replace(scene, time_s=k * decision_s)).any:
        k += 1
    assert k * decision_s == pytest.approx(PATIENCE + IDLE, abs=decision_s + 0.15)


def test_who_stands_in_a_bend_behind_somebody_who_moves_does_not_block(make_scene, four_way):
    """Who is before it was looked for straight on only, so that a queue in a bend counted as blocking."""
    alone, _ = _waits_to_turn_left(make_scene, four_way)
    row, s = int(alone.path[0]), float(alone.path_s[0])
    creeps = {"row": row, "s": s + 12.0, "v": 0.5}
    queue = make_scene({"row": row, "s": s}, creeps, origin="west", turn="straight")
    assert [_standing_at(scene, LONG) for scene in (alone, queue)] == [1, 0]


def test_each_gap_that_it_lets_go_by_counts(make_scene, four_way):
    scene, coming = _waits_to_turn_left(make_scene, four_way)
    watch, seen = Blocking(), []
    for k in range(math.ceil(10 * LONG)):
        busy = k % 30 < 5
        seen.append(watch.look(replace(coming if busy else scene, time_s=0.1 * k)).standing.number)
    assert seen[math.ceil(10 * (PATIENCE + IDLE))] == 0
    assert seen[-1] == 1


def test_who_waits_for_an_ego_that_waits_for_it_blocks_soon(make_scene, four_way):
    paths, own = four_way.paths, make_scene(turn="left").route
    row = four_way.route("north", "straight").row
    table = four_way.conflict(own)[row]
    other = {"row": row, "s": float(table[2]) - 3.0}
    scene = make_scene(other, turn="left", front=float(table[0]) - own.stop_line_s + 2.0, v=0.0)
    waiting = replace(scene, waited_s=2 * IMPASSE)
    assert paths.origin[row] != paths.origin[own.row]
    assert [_standing_at(s, 1.2 * IMPASSE) for s in (scene, waiting)] == [0, 1]
    assert _standing_at(replace(make_scene(other, turn="left", front=1.0), waited_s=9.0), 1.2 * IMPASSE) == 0


def _waits_to_turn_left(make_scene, four_way):
    """One who waits in the junction, with nobody coming, and with somebody whom it lets pass."""
    paths = four_way.paths
    own = make_scene(origin="west", turn="straight").route.row
    left = next(
        r for r in range(paths.count) if paths.origin[r] == paths.origin[own] and paths.yields[r].any()
    )
    oncoming = next(
        r for r in range(paths.count) if paths.yields[left, r] and paths.origin[r] != paths.origin[left]
    )
    waiting = {"row": left, "s": float(paths.stop_s[left]) + 6.0}
    coming = {"row": oncoming, "s": float(paths.stop_s[oncoming]) - 30.0, "v": 8.0}
    west = {"origin": "west", "turn": "straight"}
    return make_scene(waiting, **west), make_scene(waiting, coming, **west)


def _standing_at(scene, time_s):
    """Bodies that block after the same scene was watched for so long (s)."""
    watch = Blocking()
    for k in range(math.ceil(10 * time_s)):
        blocks = watch.look(replace(scene, time_s=0.1 * k))
    return blocks.standing.number


def test_an_empty_road_blocks_nothing(make_scene):
    assert not Blocking().look(make_scene()).any


def test_what_has_no_way_blocks_at_once_and_a_pedestrian_never(make_scene):
    pose = (0.0, 0.0, 0.3)
    scene = make_scene(
        {"at": pose}, {"at": pose, "kind": Kind.PEDESTRIAN}, {"at": pose, "kind": Kind.OBSTACLE}
    )
    assert Blocking().look(scene).standing.number == 2


def test_the_scene_along_a_course_keeps_place_and_destination(make_scene, four_way):
    scene = make_scene(origin="south", turn="left")
    other = four_way.route("south", "left")
    again = along(scene, other)
    assert again.ego_s == pytest.approx(scene.ego_s, abs=1e-9)
    assert again.ego_offset == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("actuation", [Actuation(0.3, 0.2), Actuation(0.2, 0.1, 0.3)])
def test_it_decides_where_the_car_will_be_when_the_command_acts(make_scene, actuation):
    scene = make_scene(v=9.0, actuation=actuation)
    adaptation = Adaptation("known", probe=False)
    adaptation.reset(scene)
    plant = EgoPlant(scene.vehicle)
    plant.reset(scene.ego.x, scene.ego.y, scene.ego.psi, scene.ego.v, actuation)
    rng = np.random.default_rng(0)
    given, shown = np.zeros(2), []
    for _ in range(30):
        here = replace(scene, ego=plant.state, last_u=given, time_s=scene.time_s + 0.1 * len(shown))
        shown.append((adaptation.see(here).ego, plant.state))
        given = np.array([rng.uniform(-3.0, 3.0), rng.uniform(-0.1, 0.1)])
        for _ in range(2):
            plant.step(float(given[0]), float(given[1]), SUBSTEP_S)
    late = round(actuation.delay_s / 0.1)
    for k in range(10, 30 - late):
        predicted, true = shown[k][0], shown[k + late][1]
        assert math.hypot(predicted.x - true.x, predicted.y - true.y) < 0.02
        assert predicted.v == pytest.approx(true.v, abs=0.02)


@pytest.mark.parametrize("friction", [0.2, 0.5])
def test_ice_is_found_out_and_speed_and_brakes_fit_it(world, friction):
    plan = PlanSource(
        origin="south", turn="left", density=5.0, events=(event("low_friction", friction=friction),)
    )
    agent = make_agent("gap-acceptance:outlook.plant=estimated")
    outcome, seen = drive(world, plan.plan(0), agent)
    assert outcome == "success"
    assert isinstance(agent, OutlookAgent)
    assert agent.outlook.adaptation is not None
    assert agent.outlook.adaptation.estimate.actuation.friction == pytest.approx(friction, rel=0.2)
    late = [scene for scene, _ in seen[15:]]
    lateral = max(scene.ego.v * abs(scene.ego.yaw_rate) for scene in late)
    assert lateral < friction * 9.81


def test_the_probe_is_short_on_a_dry_road_and_can_be_left_out(world):
    plan = PlanSource(origin="south", turn="straight", density=5.0).plan(1)
    hardest = {}
    for text in ("true", "false"):
        _, seen = drive(world, plan, make_agent(f"follower:outlook.plant=estimated,outlook.probe={text}"))
        hardest[text] = [float(decision.u[0]) for _, decision in seen]
    assert sum(a < -5.9 for a in hardest["true"]) == 1
    assert min(hardest["false"]) > -3.0


@pytest.mark.parametrize(
    ("plant", "friction", "counts"), [("known", None, 1.0), ("known", 0.3, 0.0), ("off", 0.3, 1.0)]
)
def test_residuals_do_not_count_where_more_is_asked_than_ice_is_known_to_give(
    make_scene, plant, friction, counts
):
    scene = make_scene(v=9.0, actuation=Actuation(friction=friction))
    outlook = Outlook(OutlookSettings(plant=plant))
    outlook.reset(scene)
    assert trust(outlook.see(scene).vehicle, 9.0, np.array([-6.0, 0.3]), EgoVehicle()) == counts


def test_settings_are_those_of_the_one_tree():
    assert agent_settings("planner")["outlook"] == {"course": True, "approach": False, "plant": "off"}
    assert agent_settings("planner:outlook.course=false")["outlook"] == {"course": False, "plant": "off"}
    assert OutlookSettings(plant="known", course=True).make() is not None
    assert OutlookSettings().make() is None
    assert agent_settings("rudc-t:outlook.plant=off,outlook.course=off")["outlook"]["plant"] == "off"
    for name, says in (
        ("gap-acceptance:outlook.cuorse=true", "outlook.course"),
        ("gap-acceptance:outlook.probe=false", "nothing is estimated"),
        ("gap-acceptance:outlook.plant=guessed", "outlook.plant"),
        ("sumo:outlook.course=true", "SUMO itself drives"),
    ):
        with pytest.raises(AgentError, match=says):
            make_agent(name)


def test_an_ego_that_is_fast_looks_for_bodies_farther_ahead(make_scene, four_way):
    """It looked 60 m ahead at any speed: too late for this one, beside which nothing is clear."""
    fast, courses = replace(four_way.vehicle, v_max=30.0), Courses()
    route = four_way.route("south", "straight")
    wall = {"at": tuple(map(float, route.path.pose(150.0))), "size": (2.0, 40.0)}
    scene = make_scene(wall, front=-50.0, v=25.0, vehicle=fast)
    scene = replace(scene, route=replace(route, limits=((-math.inf, 30.0),)))
    courses.reset(scene)
    assert 150.0 - scene.ego_s > 80.0
    assert courses.govern(courses.see(scene), np.zeros(2))[0] < -1.0


def test_nothing_clear_means_stopping_well_before(world_on):
    found = load_scenario("stalled_truck")
    events = tuple(
        event("stalled_vehicle", lane=f"east_out_{lane}", at=20.0, type="truck") for lane in (0, 1)
    )
    plan = replace(found.plan(0), events=events, event_numbers=(0, 1))
    agent = make_agent("follower:outlook.course=true")
    outcome, seen = drive(world_on(found.network), plan, agent)
    assert outcome == "frozen"
    scene = seen[-1][0]
    trucks = [i for i, name in enumerate(scene.ids) if name.startswith("stalled_vehicle")]
    gap = np.hypot(*(scene.position[trucks] - scene.ego_position).T).min() - 0.5 * (5.0 + 7.5)
    assert 4.0 < gap < 11.0


@pytest.mark.parametrize(("beyond", "asked"), [(-4.0, False), (4.0, True)])
def test_what_stands_beyond_the_destination_blocks_nothing(make_scene, four_way, beyond, asked):
    """A wall across the road, whose middle is so many m from where the ego's front arrives."""
    scene = make_scene(turn="straight", front=-30.0, v=8.0)
    destination = scene.ego_s + 8.0
    x, y, psi = scene.route.path.pose(destination + 0.5 * scene.vehicle.length + beyond)
    wall = {"at": (x, y, psi), "size": (2.0, 30.0)}
    scene = make_scene(wall, turn="straight", front=-30.0, v=8.0, destination_s=destination)
    courses = Courses()
    courses.reset(scene)
    u = courses.govern(courses.see(scene), np.array([1.0, 0.0]))
    assert (u[0] == 1.0) == asked
    onwards = courses.govern(courses.see(scene), np.array([1.0, 0.0]), onwards=True)
    assert onwards[0] == 1.0, "who is hit where it stops is not stopped for later"


class GoesOn:
    """Says of its action that it goes on because stopping would be worse."""

    name, ego_driver = "goes-on", "agent"

    def __init__(self, status):
        self.status = status

    def reset(self, scene, seed):
        pass

    def act(self, scene):
        u = np.array([3.0, 0.0])
        return Decision(u, u, corrected=Corrected(u, np.zeros(2), self.status))


def test_who_goes_on_since_it_would_be_hit_is_held_back_by_bends_only(make_scene):
    scene = make_scene(turn="left", front=-50.0, v=8.0)
    held = {}
    for status in ("nominal", "onwards"):
        outlook = Outlook(OutlookSettings(course=True, plant="known"))
        agent = OutlookAgent(GoesOn(status), "", outlook)
        icy = replace(scene, actuation=Actuation(friction=0.2))
        agent.reset(icy, 0)
        held[status] = agent.act(icy).u[0]
    assert held["nominal"] < 0.0 < held["onwards"]


def test_courses_forget_the_last_episode(make_scene):
    courses = Courses()
    courses.reset(make_scene())
    courses.course = make_scene().route
    courses.reset(make_scene())
    assert courses.course is None


@pytest.mark.parametrize("gap", [1.5, 2.2, 5.0])
def test_it_stops_far_enough_behind_who_stands_to_pull_out_and_creeps_no_nearer(make_scene, four_way, gap):
    def asked(v):
        scene = make_scene({"row": row, "s": s, "v": v}, turn="straight", front=-30.0, v=1.0)
        courses = Courses()
        courses.reset(scene)
        return courses.govern(courses.see(scene), np.array([1.0, 0.0]))[0]

    row = four_way.route("south", "straight").row
    s = float(four_way.paths.stop_s[row]) - 30.0 + 2.5 + gap
    creeps = asked(v=0.0)
    assert creeps < 0.0 if gap <= PULL_OUT else creeps == 1.0
    assert asked(v=3.0) == 1.0
