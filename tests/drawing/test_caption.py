import math
from typing import get_args

import pytest

from rudc.drawing.caption import (
    GAP,
    REMARKS,
    UNITS,
    conditions,
    correction_line,
    describe,
    events_lines,
    remark,
    state_line,
    title,
)
from rudc.drawing.palette import TEXT
from rudc.drawing.text import fitted, font, wrapped
from rudc.drawing.view import Driving, ShownEvent, View
from rudc.safety.filter import Status
from rudc.scenario.distributions import distribution
from rudc.scenario.events.vehicle_crossing import VehicleCrossing
from rudc.scenario.triggers import Conditions
from tests.plans import event

BRAKE = event("hard_brake", when={"simulation_time": {"above": 3}})
WET = event("low_friction", friction=0.5)


def test_who_drives_where(make_scene):
    view = View(make_scene(), scenario="fog", seed=3)
    assert title(view, Driving(agent="rudc-t")).split() == ["fog", "rudc-t", "seed", "3"]
    assert title(View(make_scene()), Driving()) == ""


def test_who_takes_part_in_two_events_has_both_numbers(make_scene):
    events = (
        ShownEvent(1, BRAKE, bodies=frozenset({"v0"})),
        ShownEvent(3, BRAKE, bodies=frozenset({"v0", "v1"})),
    )
    assert View(make_scene(), events=events).numbers == {"v0": "1,3", "v1": "3"}


def test_how_the_ego_moves(make_scene):
    scene = make_scene(v=8.04)
    assert state_line(scene, Driving()).split("  ")[0] == "time 3.0 s"
    assert "speed 8.0 m/s" in state_line(scene, Driving())
    assert "accel. +0.0 m/s2" in state_line(scene, Driving())
    assert "sigma" not in state_line(scene, Driving(sigma=math.nan))
    assert "sigma 0.43" in state_line(scene, Driving(sigma=0.432))


def test_every_status_of_a_correction_has_words():
    learnt = {"unrolled", "recovery", "projected"}
    assert REMARKS.keys() == {*get_args(Status), *learnt}


@pytest.mark.parametrize(
    ("driving", "words"),
    [
        (Driving(), ""),
        (Driving(agent="follower"), "no correction"),
        (Driving(status="nominal"), "correction: none needed"),
        (
            Driving(status="solved", correction=(-1.23, 0.02),
                    active=("veh:v0", "road:left:cg", "road:left:third")),
            "correction: -1.2 m/s2, +1.1 deg because of car (2), left road edge",
        ),
        (
            Driving(status="relaxed", correction=(-1.23, 0.0), active=("veh:v0",)),
            "correction: -1.2 m/s2 because of car (2); no action keeps all constraints",
        ),
        (Driving(status="recovered", correction=(-3.0, 0.0)), "correction: -3.0 m/s2; recovered"),
        (Driving(active=("veh:v1", "veh:v2")), "correction: because of 2 x car"),
    ],
)  # fmt: skip
def test_what_the_correction_does(make_scene, driving, words):
    scene = make_scene(others=[(2, 115.0, 5.0, 0.0), (3, 115.0, 5.0, 0.0), (4, 115.0, 5.0, 0.0)])
    view = View(scene, events=(ShownEvent(2, BRAKE, 1.0, bodies=frozenset({"v0"})),))
    assert correction_line(view, driving) == words


def test_events_say_whether_they_happened():
    shown = (
        ShownEvent(1, BRAKE),
        ShownEvent(2, BRAKE, begun_s=3.1),
        ShownEvent(4, BRAKE, begun_s=3.1, is_over=True),
        ShownEvent(5, BRAKE, begun_s=0.0),
        ShownEvent(6, BRAKE, begun_s=3.1, bodies=frozenset({"v0"})),
        ShownEvent(7, BRAKE, begun_s=3.1, visible_s=3.3, bodies=frozenset({"v0"})),
    )
    assert [line.split(GAP) for line in events_lines(shown)] == [
        ["(1) hard brake: waits", "(2) hard brake: since 3.1 s"],
        ["(4) hard brake: over", "(5) hard brake"],
        ["(6) hard brake: since 3.1 s, unseen", "(7) hard brake: since 3.1 s"],
    ]
    assert events_lines((ShownEvent(1, event("hard_brake", name="lorry")),)) == ["(1) lorry: waits"]
    assert events_lines(()) == []


@pytest.mark.parametrize(
    ("shown", "words"),
    [
        (
            ShownEvent(1, BRAKE),
            "not drawn: waits until the time is above 3 s, its vehicle (leader) is chosen then",
        ),
        (ShownEvent(1, WET), "not drawn: begins with the first decision"),
        (ShownEvent(1, WET, refused=True), "not drawn: waits for something to act on"),
        (ShownEvent(1, BRAKE, refused=True), "not drawn: waits for a vehicle (leader) to act on"),
        (ShownEvent(1, BRAKE, refused=True, no_room=True), "not drawn: waits for room on the road"),
        (ShownEvent(1, BRAKE, begun_s=0.0, bodies=frozenset({"v0"})), ""),
        (ShownEvent(1, BRAKE, begun_s=3.1, bodies=frozenset({"v0"})), "since 3.1 s"),
        (ShownEvent(1, BRAKE, begun_s=3.1), "since 3.1 s, nothing to draw"),
        (ShownEvent(1, BRAKE, begun_s=3.1, is_over=True), "begun at 3.1 s, and over"),
    ],
)
def test_previews_say_what_has_become_of_an_event(shown, words):
    assert remark(shown) == words


def test_many_events_take_no_more_than_eight_lines_and_those_that_are_over_go_first():
    shown = tuple(ShownEvent(i, BRAKE, begun_s=3.1, is_over=i <= 2) for i in range(1, 18))
    assert len(events_lines(shown[:16])) == 8
    parts = GAP.join(lines := events_lines(shown)).split(GAP)
    assert len(lines) == 8
    assert parts[0].startswith("(3) ")
    assert parts[-2:] == ["(17) hard brake: since 3.1 s", "and 2 more"]


def test_numbers_of_events_and_conditions_have_their_units():
    noise = event("sensor_noise", position=0.5, speed=1, heading=2, own_acceleration=0.3)
    assert describe(noise) == (
        "sensor noise, position 0.5 m, speed 1 m/s, heading 2 deg, own acceleration 0.3 m/s2"
    )
    surge = event("density_surge", density=30, duration=5)
    assert describe(surge) == "density surge, density 30 veh/km, duration 5 s"
    either = VehicleCrossing.model_validate(
        {"kind": "vehicle_crossing", "arm": {"choice": ["north", "east"]}, "speed": {"choice": [3, 4]}}
    )
    assert "arm north or east, " in describe(either)
    assert "speed 3 m/s or 4 m/s" in describe(either)
    rarely = either.model_copy(
        update={"speed": distribution({"choice": {"values": [3, 4, 5], "weights": [3, 0, 1]}})}
    )
    assert "speed 3 m/s (75 %) or 5 m/s (25 %)" in describe(rarely)
    hesitates = event("pedestrian_crossing", arm="north", pause={"after": 4, "duration": 1.5})
    assert describe(hesitates).endswith(", pause after 4 m duration 1.5 s")
    bed = event("vehicle_crossing", name="bed", arm="north", size=[2.2, 1])
    assert describe(bed).startswith("bed, vehicle crossing, arm north, ")
    assert "size 2.2 x 1 m, " in describe(bed)
    far = event("lane_closure", lane="north_in_0", at=1000, length=20)
    assert "at 1000 m, length 20 m" in describe(far)
    late = event("hard_brake", when={"traveled_distance": {"above": 999.7}})
    assert conditions(late) == "the ego has driven above 1000 m"
    then = event("hard_brake", when={"event_state": {"event": 1, "state": "over", "above": 2}})
    assert conditions(then) == "the time since (2) was over is above 2 s"
    assert UNITS.keys() == Conditions.model_fields.keys()


def test_arms_and_groups_of_conditions_are_said_in_words():
    turning = {"from": "north", "turn": "left"}
    groups = [
        {"speed": {"above": 3}, "stand_still": {"below": 1}},
        {"time_headway": {"vehicle": turning, "below": 2}},
    ]
    when = {"ego_distance_to_junction": {"below": 20}, "any": groups}
    early = event("hard_brake", vehicle=turning, when=when)
    assert describe(early).startswith("hard brake, vehicle from north turn left, ")
    assert conditions(early) == (
        "the ego's distance to its stop line is below 20 m and (the ego's speed is above 3 m/s and the ego "
        "has stood for below 1 s or the ego's headway (from north turn left) is below 2 s)"
    )
    others = {
        "speed": {"vehicle": "leader", "below": 1},
        "reach_position": {"vehicle": "leader", "lane": "ego_in", "at": 20},
        "relative_distance": {"event": 0, "below": 5},
    }
    assert conditions(event("hard_brake", when=others)) == (
        "the ego's distance to event 1 is below 5 m and a vehicle (leader) reaches lane ego_in at 20 m "
        "tolerance 2 m and the speed of a vehicle (leader) is below 1 m/s"
    )
    for where, said in (({"lane": "ego_out", "at": 8}, "ego_out at 8 m"), ({"position": [4, -2]}, "[4, -2]")):
        past = event("hard_brake", when={"ego_distance_to_place": where | {"below": -5}})
        assert conditions(past) == f"the ego's distance along its path to {said} is below -5 m"
    alone = event("hard_brake", when={"any": groups[:1]})
    assert conditions(alone) == "the ego's speed is above 3 m/s and the ego has stood for below 1 s"


def test_a_line_of_events_fits():
    longest = event("pedestrian_crossing", arm="ego_in")
    shown = tuple(ShownEvent(i, longest, 33.1, bodies=frozenset("v")) for i in (10, 11))
    (line,) = events_lines(shown)
    assert line.endswith("(11) pedestrian crossing: since 33.1 s, unseen")
    assert fitted(line, 600.0, 600.0 / 41.0) == line


def test_texts_fit():
    long = "a scenario of so long a name that it does not fit"
    assert fitted(long, 1000.0, 15.0) == long
    assert fitted(long, 150.0, 15.0).endswith("...")
    assert font(15.0).getlength(fitted(long, 150.0, 15.0)) <= 150.0
    lines = wrapped(((long, TEXT),), 150.0, 15.0)
    texts = ["".join(text for text, _ in line) for line in lines]
    assert len(lines) > 2
    assert all(font(15.0).getlength(text.rstrip()) <= 150.0 for text in texts)
    assert " ".join(" ".join(texts).split()) == long
    width = font(15.0).getlength("a word")
    assert fitted("a word ", width, 15.0) == "a word ", "a space at the end may stick out"
