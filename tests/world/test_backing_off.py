"""Who stands nose to nose with the ego goes back."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rudc.geometry import rectangle_gaps
from rudc.world import backing_off
from rudc.world.backing_off import CLEAR_M, PACE, PATIENCE_S, STOOD_S, BackingOff
from tests.world.standing import scenes_of_a_standing_ego

DECISION_S = 0.1
BEYOND = 6.0
"""m beyond its stop line where the ego's centre stands: in the way of those who turn left towards its arm"""


def longest_standoff(world):
    """s, for how long the ego and one SV stand in each other's way while the ego stands in the junction."""
    since, longest = {}, 0.0
    for scene in scenes_of_a_standing_ego(world, "left", BEYOND, 45.0):
        stand = {scene.ids[i] for i in backing_off._at_its_nose(scene).tolist() if _face_to_face(scene, i)}
        since = {name: since.get(name, scene.time_s) for name in stand}
        longest = max([longest, *(scene.time_s - began for began in since.values())])
    return longest


def _face_to_face(scene, i):
    return backing_off._in_its_way(scene, i, 0.25) and backing_off.bars(scene, i, 8.0)


def test_nobody_stands_for_ever_at_the_nose_of_the_ego(world, monkeypatch):
    assert longest_standoff(world) < STOOD_S + 5.0
    monkeypatch.setattr(backing_off, "STOOD_S", math.inf)
    assert longest_standoff(world) > 25.0, "neither can drive on"


@pytest.fixture
def nose_to_nose(make_scene, four_way):
    """A maker of scenes: an ego on its way straight on, and one who turns left before it, nose to nose."""
    row = four_way.route("north", "left").row
    ego = four_way.route("south", "straight")
    mine, theirs = (np.asarray(four_way.paths.xy[k]) for k in (ego.row, row))
    away = np.hypot(*(mine[:, None] - theirs[None]).transpose(2, 0, 1))
    at, its = np.unravel_index(away.argmin(), away.shape)  # where the two ways cross
    beyond = 0.5 * float(at) - ego.stop_line_s

    def make(*others, waited_s=STOOD_S, back=0.0, ego_back=0.0):
        them = {"row": row, "s": 0.5 * float(its) - 3.5 - back, "v": 0.0}
        return make_scene(them, *others, v=0.0, front=beyond - 0.5 - ego_back, waited_s=waited_s)

    return make


def gap_to_ego(scene):
    """m between the ego and the first of the others."""
    ego, body = scene.ego, scene.vehicle
    one = scene.position[:1], scene.heading[:1], scene.size[:1]
    return float(rectangle_gaps(ego.x, ego.y, ego.psi, body.length, body.width, *one)[0])


class Asked:
    """In SUMO's stead: notes what it is asked."""

    def __init__(self):
        self.places, self.let_go = [], []

    def place(self, vehicle, x, y, psi, v, length):
        assert v == 0.0
        self.places.append((vehicle, x, y))

    def slow_down(self, vehicle, speed, duration):
        self.let_go.append(vehicle)


def backing(overridden=0):
    drivers = {f"other{i}": SimpleNamespace(overridden=overridden) for i in range(3)}
    asked = Asked()
    return BackingOff(asked, SimpleNamespace(drivers=drivers)), asked


def test_who_stands_at_its_nose_goes_back_along_its_lane(nose_to_nose):
    scene, (one, asked) = nose_to_nose(), backing()
    assert _face_to_face(scene, 0)
    one.step(nose_to_nose(waited_s=STOOD_S - 0.1), DECISION_S)
    assert asked.places == []
    for _ in range(10):
        one.step(scene, DECISION_S)
    first, last = (np.array(asked.places[k][1:]) for k in (0, -1))
    assert np.hypot(*(last - first)) == pytest.approx(9 * PACE * DECISION_S, rel=0.1)
    assert (last - first) @ [np.cos(scene.heading[0]), np.sin(scene.heading[0])] < 0.0


@pytest.mark.parametrize("overridden", [0, 1])
def test_whom_an_event_commands_stays(nose_to_nose, overridden):
    one, asked = backing(overridden)
    one.step(nose_to_nose(), DECISION_S)
    assert bool(asked.places) == (not overridden)


@pytest.mark.parametrize(("from_line", "goes"), [(-12.0, True), (-4.0, True), (0.02, False)])
def test_who_has_not_reached_its_stop_line_goes_back_too_but_nobody_goes_back_over_it(
    make_scene, four_way, from_line, goes
):
    """The ego, which overtakes on the lane of oncoming traffic, stands before its nose."""
    route, row = four_way.route("south", "straight"), four_way.route("north", "straight").row
    them = {"row": row, "s": float(four_way.paths.stop_s[row]) + from_line - 2.5, "v": 0.0}
    scene = make_scene(them, front=30.0, v=0.0, waited_s=STOOD_S)
    psi, away = float(scene.heading[0]), 6.0
    x, y = scene.position[0] + away * np.array([math.cos(psi), math.sin(psi)])
    ego_s, offset = route.path.project(float(x), float(y), route.exit_s)
    ego = replace(scene.ego, x=float(x), y=float(y), psi=psi + math.pi)
    one, asked = backing()
    one.step(replace(scene, ego=ego, ego_s=ego_s, ego_offset=offset), DECISION_S)
    assert bool(asked.places) == goes


@pytest.mark.parametrize(("turned", "goes"), [(math.pi, True), (0.0, False)])
def test_who_has_left_the_junction_goes_back_before_an_ego_that_faces_it(make_scene, four_way, turned, goes):
    """Behind who passes a closure on the lane of oncoming traffic they stood for ever; an ego that drives
    ahead in their lane is none of their business.
    """
    route, row = four_way.route("south", "straight"), four_way.route("north", "straight").row
    s = float(four_way.paths.exit_s[row]) + 8.0
    scene = make_scene({"row": row, "s": s, "v": 0.0}, v=0.0, front=-30.0, waited_s=STOOD_S)
    position, heading = four_way.paths.pose(np.int64(row), np.float64(s + 7.0))[:2], float(scene.heading[0])
    x, y = (float(v) for v in position)
    station, offset = (float(v) for v in route.path.project(x, y))
    ego = replace(scene.ego, x=x, y=y, psi=heading + turned)
    one, asked = backing()
    one.step(replace(scene, ego=ego, ego_s=station, ego_offset=offset), DECISION_S)
    assert bool(asked.places) == goes


@pytest.mark.parametrize("third", [True, False])
def test_three_that_wait_for_each_other_in_a_circle(make_scene, four_way, third):
    """A circle of three: the ego barred one who turns left, who barred a bus, which barred the ego."""
    paths, route = four_way.paths, four_way.route("south", "straight")
    bus, left = four_way.route("east", "straight").row, four_way.route("north", "left").row
    along = {row: np.arange(float(paths.stop_s[row]), float(paths.exit_s[row]), 0.25) for row in (bus, left)}
    position = {row: paths.body_pose(np.full(len(s), row), s, 5.0)[0] for row, s in along.items()}
    s_left = along[left][np.hypot(*(position[left] - (-0.5, 6.0)).T).argmin()]
    s_bus = along[bus][np.abs(position[bus][:, 0] - 5.2).argmin()]
    others = [{"row": bus, "s": float(s_bus), "v": 0.0}, {"row": left, "s": float(s_left), "v": 0.0}]
    scene = make_scene(*others[: 1 + third], v=0.0, waited_s=STOOD_S)
    x, y = 3.2, -0.2
    ego_s, offset = (float(v) for v in route.path.project(x, y))
    ego = replace(scene.ego, x=x, y=y, psi=0.5 * math.pi)
    scene = replace(scene, ego=ego, ego_s=ego_s, ego_offset=offset)
    assert backing_off._in_its_way(scene, 0, 0.25)
    assert not backing_off.bars(scene, 0, 8.0, beyond=True)
    one, asked = backing()
    one.step(scene, DECISION_S)
    assert [name for name, *_ in asked.places] == ["other0"] * third


def test_nobody_goes_back_into_who_is_behind(nose_to_nose):
    scene = nose_to_nose()
    (x, y), psi, length = scene.position[0], scene.heading[0], scene.size[0, 0]
    for gap, goes in ((CLEAR_M + 0.6, True), (0.5 * CLEAR_M, False)):
        one, asked = backing()
        away = length + gap
        one.step(nose_to_nose({"at": (x - away * np.cos(psi), y - away * np.sin(psi), psi)}), DECISION_S)
        assert bool(asked.places) == goes


def test_who_stands_beside_where_its_way_has_it_goes_back_too(nose_to_nose):
    """In bends SUMO puts vehicles some cm beside our paths; whose first step back would bring it nearer to
    the ego than it was stood for ever.
    """
    nearer = (nose_to_nose(back=-way) for way in np.arange(0.0, 4.0, 0.05))
    scene = next(scene for scene in nearer if 0.0 < gap_to_ego(scene) < 0.5 * CLEAR_M)
    away = np.array([scene.ego.x, scene.ego.y]) - scene.position[0]
    shifted = replace(scene, position=scene.position - 0.15 * away / np.hypot(*away))
    assert gap_to_ego(shifted) > gap_to_ego(scene) + PACE * DECISION_S
    one, asked = backing()
    one.step(shifted, DECISION_S)
    assert asked.places
    ahead = np.array(asked.places[0][1:]) - scene.position[0]
    assert ahead @ [np.cos(scene.heading[0]), np.sin(scene.heading[0])] < 0.0


def test_nobody_is_put_into_another_though_its_way_leads_there(nose_to_nose):
    """SUMO has it beside the ego, its way has it in the ego."""
    ways = np.arange(0.0, 4.0, 0.01)
    into = next(way for way in ways if gap_to_ego(nose_to_nose(back=-way)) == 0.0)
    scene = nose_to_nose(back=-into - 0.06)
    away = np.array([scene.ego.x, scene.ego.y]) - scene.position[0]
    shifted = replace(scene, position=scene.position - 0.15 * away / np.hypot(*away))
    assert gap_to_ego(shifted) > 0.0
    one, asked = backing()
    one.step(shifted, 0.1 * DECISION_S)
    assert asked.places == []


def test_two_that_stand_rear_to_rear_wait_for_nobody(nose_to_nose, monkeypatch):
    """Each stood right behind the other, and who goes first was looked for without end."""
    monkeypatch.setattr(backing_off, "_right_behind", lambda _, i: 1 - i)
    monkeypatch.setattr(backing_off, "_may_go_back", lambda *_: False)
    one, _ = backing()
    scene = nose_to_nose({"at": (200.0, 0.0, 0.0)})
    assert one._who_first(scene, 0, 0.05) is None


def test_it_waits_until_the_ego_is_gone_or_its_patience_ends_and_does_it_once(nose_to_nose):
    one, asked = backing()
    scene = nose_to_nose()
    one.step(scene, DECISION_S)
    one.step(replace(scene, time_s=scene.time_s + PATIENCE_S - 0.1), DECISION_S)
    assert asked.let_go == []
    one.step(replace(scene, time_s=scene.time_s + PATIENCE_S), DECISION_S)
    assert asked.let_go == ["other0"]
    before = len(asked.places)
    one.step(replace(scene, time_s=scene.time_s + 2 * PATIENCE_S), DECISION_S)
    assert len(asked.places) == before, "once"
    one, asked = backing()
    one.step(scene, DECISION_S)
    one.step(nose_to_nose(waited_s=0.0, ego_back=15.0), DECISION_S)
    assert asked.let_go == ["other0"], "the ego is out of its way"


def test_who_has_room_enough_stands(nose_to_nose):
    one, asked = backing()
    one.step(nose_to_nose(), DECISION_S)
    far = nose_to_nose(back=4.0)
    one.step(far, DECISION_S)
    assert asked.places[-1][1:] == pytest.approx(tuple(far.position[0]))


@pytest.mark.parametrize(("queue", "goes"), [(backing_off.QUEUE, True), (1, False)])
def test_who_stands_right_behind_goes_back_first(nose_to_nose, four_way, monkeypatch, queue, goes):
    """Two who turned left stood in the junction, the ego before the first: nobody moved any more."""
    monkeypatch.setattr(backing_off, "QUEUE", queue)
    row, gap = four_way.route("north", "left").row, 0.5
    first = nose_to_nose()
    begun = {"other0": float(first.path_s[0]), "other1": float(first.path_s[0] - first.size[0, 0]) - gap}
    now, moved, (one, asked) = dict(begun), [], backing()
    for _ in range(60):
        behind = {"row": row, "s": now["other1"], "v": 0.0}
        asked.places.clear()
        scene = nose_to_nose(behind, back=begun["other0"] - now["other0"])
        one.step(scene, DECISION_S)
        for name, x, y in asked.places:
            s = now[name] - PACE * DECISION_S
            (there,), _ = four_way.paths.body_pose(np.array([row]), np.array([s]), 5.0)
            if np.hypot(*(there - (x, y))) < 0.01:
                now[name] = s
                moved.append(name)
    assert moved[:1] == (["other1"] if goes else [])
    assert all((begun[name] - now[name] > 1.0) == goes for name in now)
