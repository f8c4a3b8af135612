"""What in a scenario file does not fit its network is reported once, with its place in the file."""

import re
import textwrap
from pathlib import Path

import numpy as np
import pytest

from rudc.errors import ScenarioError
from rudc.evaluation.preflight import try_out
from rudc.network.build import build_network
from rudc.network.network import load_network
from rudc.scenario import load_scenario, shipped_scenarios
from rudc.scenario.distributions import distribution
from rudc.world.fitting import likely, misfits
from tests.world.networks import by_heading, with_pockets


@pytest.fixture
def problems(tmp_path, monkeypatch):
    """Problems of a text, as `LINE:COLUMN: key.path: what`."""
    monkeypatch.chdir(tmp_path)

    def find(text: str, **overrides: object) -> list[str]:
        (tmp_path / "s.yaml").write_text(textwrap.dedent(text).lstrip("\n"))
        try:
            load_scenario("s.yaml", overrides, misfits)
        except ScenarioError as error:
            return [line.removeprefix("s.yaml:") for line in str(error).splitlines()]
        return []

    return find


def check(found: list[str], *expected: str) -> None:
    """Compare line by line; `...` in an expected line stands for anything."""
    assert len(found) == len(expected), "\n".join(found)
    for line, pattern in zip(found, expected, strict=True):
        assert re.fullmatch(".*".join(re.escape(part) for part in pattern.split("...")), line), line


@pytest.mark.parametrize("name", shipped_scenarios())
def test_shipped_scenarios_fit(name):
    load_scenario(name, fit=misfits)


def test_together_with_all_other_problems_each_in_its_place(problems):
    found = problems("""
        name: wrong
        descripton: x
        ego: {route: {from: northeast}}
        events:
          - {kind: lane_closure, lane: west_in_5, at: 5, length: 10}
          - {kind: hard_break}
          - {kind: wrong_way, lane: east_in_0, at: {uniform: [5, 500]}}
          - kind: accident
            vehicles: [{lane: south_to_wst_0, at: 1}, {lane: south_to_west_0, at: 30}]
          - {kind: pedestrian_crossing, arm: nort}
          - {kind: low_friction, friction: 0.3, when: {reach_position: {lane: west_in_9, at: 3}}}
        """)
    check(
        found,
        "2:1: descripton: unknown key (did you mean 'description'?)",
        "3:21: ego.route.from: no arm 'northeast' in network four_way (did you mean 'north'?); there are: "
        "...; an arm can also be given by the id of one of its edges",
        "5:32: events.0.lane: no lane 'west_in_5' in network four_way; cars have west_in_0, west_in_1 there",
        "6:12: events.1.kind: unknown kind of event 'hard_break' (did you mean 'hard_brake'?)",
        "7:44: events.2.at: 500 m lies beyond 'east_in_0' of network four_way, which has 120.0 m",
        "9:23: events.3.vehicles.0.lane: no lane 'south_to_wst_0'...(did you mean 'south_to_west_0'?)",
        "9:75: events.3.vehicles.1.at: 30 m lies beyond 'south_to_west_0'..., which has 26.0 m",
        "10:38: events.4.arm: no arm 'nort' in network four_way (did you mean 'north'?); there are: "
        "...; an arm can also be given by the id of one of its edges; the ego's are ego_in and ego_out",
        "11:71: events.5.when.reach_position.lane: no lane 'west_in_9' ...",
    )


@pytest.mark.parametrize(
    ("section", "told"),
    [
        (
            "ego: {route: {from: souht, turn: leftt}}",
            ["ego.route.from: no arm 'souht'", "ego.route.turn: exp"],
        ),
        (
            "ego: {route: {from: souht, to: est}, distance: far}",
            ["ego.route.from", "ego.route.to", "ego.dist"],
        ),
        ("ego: {route: {from: {choice: [souht, north]}, turn: 3}}", ["ego.route.from", "ego.route.turn"]),
        ("ego: {route: {from: random, turn: leftt}, distance: 900}", ["ego.route.turn"]),
        ("traffic: {density: lots, from: {souht: 1}}", ["traffic.density", "traffic.from.souht: no arm"]),
        ("traffic: {turns: {leftt: 1}, from: {souht: 1}}", ["traffic.from.souht", "traffic.turns"]),
    ],
)
def test_arms_are_looked_up_beside_what_else_is_wrong_in_the_same_section(problems, section, told):
    found = sorted(line.partition(": ")[2] for line in problems(f"name: a\n{section}\n"))
    assert len(found) == len(told), found
    assert all(line.startswith(start) for line, start in zip(found, sorted(told), strict=True)), found


def test_each_lane_and_arm_that_may_be_drawn_must_fit(problems):
    found = problems("""
        name: wrong
        events:
          - {kind: pedestrian_crossing, arm: {choice: [north, norht, ego_out]}}
          - {kind: stalled_vehicle, lane: {choice: [north_in_0, ego_in]}, at: 119, type: {choice: [car, bus]}}
          - {kind: stalled_vehicle, lane: {choice: [south_to_west_0, north_in_0]}, at: 60}
          - kind: accident
            vehicles: [{lane: {choice: {values: [west_in_0, west_in_7], weights: [1, 0]}}, at: 5}]
        """)
    check(
        found,
        "3:38: events.0.arm: no arm 'norht' in network four_way (did you mean 'north'?)...",
        "5:80: events.2.at: 60 m lies beyond 'south_to_west_0' of network four_way, which has ...",
    )


def test_what_may_reach_beyond_its_lane_but_not_with_its_middle_is_told_where_that_is(problems):
    text = "name: a\nevents: [{{kind: slippery_patch, lane: east_in_0, at: {}, length: 40, friction: 0.3}}]\n"
    assert problems(text.format(95)) == []
    check(
        problems(text.format(105)),
        "2:67: events.0.length: the middle of 105 to 145 m, 125 m, lies beyond 'east_in_0' of network...",
    )
    check(problems(text.format(130)), "...events.0.at: 130 m lies beyond 'east_in_0'...")


def test_ways_across_an_arm_fit_that_arm_also_if_its_lanes_ids_are_names_of_others(problems, tmp_path):
    path = by_heading(tmp_path)
    text = f"name: a\nnetwork: {path.name}\nevents: [{{{{kind: pedestrian_crossing, arm: {{}}, at: 90}}}}]\n"
    assert problems(text.format("north")) == []
    check(problems(text.format("south")), "...events.0.at: 90 m lies beyond 'south' of network heading, ...")


def test_a_normal_place_is_judged_by_what_will_be_drawn(problems):
    text = "name: a\nevents: [{{kind: wrong_way, lane: east_in_0, at: {{normal: [{}, 5]}}}}]\n"
    assert problems(text.format(90)) == []
    check(problems(text.format(100)), "2:49: events.0.at: 125 m lies beyond...")
    assert likely(distribution({"normal": {"mean": 100, "std": 5, "high": 110}})) == (75.0, 110.0)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        # wrong whatever is swept: once, in its own place
        (
            """
            name: a
            events: [{kind: pedestrian_crossing, arm: nort}]
            sweep: {traffic.density: [10, 20, 30], network: [four_way, t_junction]}
            """,
            "2:43: events.0.arm: no arm 'nort' in network four_way...",
        ),
        # wrong on one of the swept networks: there
        (
            """
            name: a
            events: [{kind: pedestrian_crossing, arm: north}]
            sweep: {ego.distance: [30, 40], network: [four_way, t_junction]}
            """,
            "3:53: sweep.network.1: events.0.arm: no arm 'north' in network t_junction...",
        ),
        # swept itself: at the value
        (
            """
            name: a
            ego: {route: {from: south, turn: left}}
            sweep: {ego.route.turn: [left, straight], network: [t_junction]}
            """,
            "3:32: sweep.ego.route.turn.1: ego.route: network t_junction has no movement from south with "
            "`turn: straight`; it has south>...",
        ),
    ],
)
def test_swept_values_are_blamed_only_for_what_they_cause(problems, text, expected):
    check(problems(text), expected)


def test_two_problems_at_one_value_are_both_laid_on_it(problems):
    """Vehicle 2 stands in both others on `four_way`, and beside them on `skewed_four_way`."""
    found = problems(
        """
        name: a
        events:
          - kind: accident
            vehicles: [{position: [-22, -5]}, {position: [-27, -5]}, {lane: west_in_0, at: 10}]
        sweep: {network: [four_way, skewed_four_way]}
        """
    )
    check(found, *(f"5:19: sweep.network.0: events.0.vehicles.2: ...vehicles.{i}..." for i in (0, 1)))


@pytest.mark.parametrize(
    ("route", "asked"),
    [
        ("{from: south, turn: straight}", "from south with `turn: straight`; it has south>..."),
        ("{from: south, to: south}", "from south to south; it has south>..."),
    ],
)
def test_a_movement_that_is_not_there_is_named_as_it_was_asked_for(problems, route, asked):
    found = problems(f"name: a\nnetwork: t_junction\nego: {{route: {route}}}\n")
    check(found, f"3:14: ego.route: network t_junction has no movement {asked}")


def test_overrides_are_named_as_such(problems):
    found = problems("name: a\n", **{"ego.route": {"from": "sout"}})
    check(found, "override: ego.route.from: no arm 'sout' in network four_way (did you mean 'south'?)...")


def test_lanes_about_the_ego_must_be_there_on_every_route_it_may_be_given(problems):
    text = """
        name: a
        ego: {{route: {}}}
        events: [{{kind: stalled_vehicle, lane: {}, at: 10}}]
        """
    for lane in ("ego_in", "ego_out", "left_of_ego"):
        assert problems(text.format("random", lane)) == []
    assert problems(text.format("{from: south, turn: left}", "right_of_ego")) == []
    for route in ("random", "{from: south, turn: right}"):
        found = problems(text.format(route, "right_of_ego"))
        check(found, "3:40: events.0.lane: right_of_ego: on the way from ... has no lane to its right")


def test_a_network_or_junction_that_cannot_be_read_is_said_where_it_is_named(problems, tmp_path):
    (tmp_path / "broken.net.xml").write_text("<net>")
    check(problems("name: a\nnetwork: broken.net.xml\n"), "2:10: network: ...not a SUMO network...")
    check(problems("name: a\njunction: J7\n"), "2:11: junction: ...no junction 'J7'...")
    text = load_network("four_way").path.read_text(encoding="utf-8")
    (tmp_path / "left.net.xml").write_text(text.replace("<net ", '<net lefthand="true" '), encoding="utf-8")
    check(
        problems("name: a\nnetwork: left.net.xml\njunction: centre\n"),
        "2:10: network: ...left-hand traffic...",
    )


def test_an_unknown_key_hides_nothing_beside_it(problems):
    found = problems("""
        name: both
        ego: {route: {from: norht}, sped: 3}
        events:
          - {kind: lane_closure, lane: west_in_5, at: 5, length: 10, colour: red}
        """)
    check(
        found,
        "2:21: ego.route.from: no arm 'norht' ... (did you mean 'north'?)...",
        "2:29: ego.sped: unknown key (did you mean 'speed'?)",
        "4:32: events.0.lane: no lane 'west_in_5' ...",
        "4:62: events.0.colour: unknown key; known here: ...",
    )


def test_a_position_far_from_any_road_is_a_mistake(problems):
    found = problems("""
        name: astray
        events:
          - {kind: accident, vehicles: [{position: [500, 0]}, {position: [30, 30]}]}
          - {kind: accident, vehicles: [{position: [{uniform: [0, 500]}, 40]}]}
          - {kind: low_friction, friction: 0.3, when: {reach_position: {position: [0, -600], tolerance: 5}}}
        """)
    check(
        found,
        "3:44: events.0.vehicles.0.position: [500, 0] lies 3... m from the nearest road of network ...",
        "5:75: events.2.when.reach_position.position: [0, -600] lies 4...",
    )


def test_the_ego_must_have_room_on_its_arm(problems):
    check(
        problems("name: a\nego: {distance: {uniform: [30, 300]}}\n"),
        "2:17: ego.distance: 300 m do not fit on arm ... of network four_way, which has 115.0 m for it: "
        "the ego's path to ... begins 120.0 m before the stop line, and the car takes the rest",
    )


def test_of_an_arm_without_room_the_error_says_which_have_room(problems, tmp_path):
    """It said that the arm has -3.2 m for it."""
    nodes = {"c": "0,0", "east": "13,0", "west": "-120,0", "south": "0,-11", "north": "0,120"}
    rows = "".join('<node id="{}" x="{}" y="{}"/>'.format(name, *at.split(",")) for name, at in nodes.items())
    (tmp_path / "own.nod.xml").write_text(f"<nodes>{rows}</nodes>", encoding="utf-8")
    rows = "".join(
        f'<edge id="{way}_{arm}" from="{a}" to="{b}" speed="10"/>'
        for arm in list(nodes)[1:]
        for way, a, b in (("in", arm, "c"), ("out", "c", arm))
    )
    (tmp_path / "own.edg.xml").write_text(f"<edges>{rows}</edges>", encoding="utf-8")
    path = build_network(tmp_path)
    check(
        problems(f"name: a\nnetwork: {path}\nego: {{distance: 45}}\n"),
        "3:17: ego.distance: 45 m do not fit on arm 'south' of network own, which has no room for it: the "
        "ego's path to ... begins ... m before the stop line, and the car takes the rest; there is room with "
        "`route: {from: {choice: [north, west]}}`",
    )


def test_only_the_lane_that_the_ego_starts_on_must_have_room(problems, tmp_path):
    with_pockets(tmp_path)
    only = '<connection from="west_in_far" to="west_in" fromLane="0" toLane="0"/>'  # none into the pocket
    (tmp_path / "pockets.con.xml").write_text(f"<connections>{only}</connections>", encoding="utf-8")
    network = load_network(build_network(tmp_path))
    straight = network.movement("west", "straight")
    assert (
        network.paths.stop_s[list(straight.rows)].min() < 60.0 < network.route("west", "straight").stop_line_s
    )
    route = "{from: west, turn: straight}"
    assert problems(f"name: a\nnetwork: {network.path}\nego: {{route: {route}, distance: 60}}\n") == []


def test_what_stands_in_the_same_place_is_refused_with_both_places(problems):
    found = problems("""
        name: a
        ego: {route: {from: south, turn: left}, distance: 30}
        events:
          - kind: accident
            vehicles: [{lane: west_out_1, at: 12}, {lane: west_out_1, at: 15, heading_offset: 90}]
          - {kind: stalled_vehicle, lane: west_out_1, at: 13, type: truck}
          - {kind: stalled_vehicle, lane: west_out_1, at: 13, type: truck, duration: 3}
          - {kind: lane_closure, lane: ego_in, at: 28, length: 5}
          - {kind: lane_closure, lane: north_to_east_0, at: 2, length: 20}
        """)
    check(
        found,
        "5:44: events.0.vehicles.1: stands where events.0.vehicles.0 stands, at (...) m; move one of them",
        "6:5: events.1: stands where events.0.vehicles.0 stands, ...",
        "6:5: events.1: stands where events.0.vehicles.1 stands, ...",
        "8:5: events.3: stands 0.0 m from where the ego starts (ego.distance); 2 m are needed",
    )


def test_a_box_that_hides_things_may_not_reach_onto_the_road(problems):
    found = problems("""
        name: a
        events:
          - kind: occlusion
            boxes: [{position: [-16, -16], size: [8, 8]}, {position: [1, 1], size: [3, 3]}]
          - kind: occlusion
            boxes: [{lane: ego_in, at: 30, size: [3, 3]}]
          - kind: occlusion
            boxes: [{position: [40, 12], heading: 90, size: [50, 3]}]
        sweep: {traffic.density: [10, 20]}
        """)
    check(
        found,
        "4:51: events.0.boxes.1: at (1.0, 1.0) m: it reaches onto the road; ...",
        "6:13: events.1.boxes.0: at (...) m: it reaches onto the road; ...",
        "8:13: events.2.boxes.0: at (40.0, 12.0) m: it reaches onto the road; ...",
    )


def test_places_are_said_as_files_count_them(problems, tmp_path):
    """From the junction's centre, wherever the network has its origin."""
    sources = Path(__file__).parents[2] / "examples" / "osm_crossing"
    built = build_network(sources, tmp_path / "crossing.net.xml")
    assert np.linalg.norm(load_network(str(built)).center) > 100
    found = problems("""
        name: a
        network: crossing.net.xml
        events: [{kind: accident, vehicles: [{position: [2, -3]}, {position: [2, -3]}]}]
        """)
    check(found, "3:59: events.0.vehicles.1: stands where ... stands, at (2.0, -3.0) m; move one of them")


def test_places_that_are_drawn_are_looked_at_when_the_episode_is_set_up(problems, tmp_path):
    text = """
        name: a
        ego: {route: {from: south, turn: left}}
        events:
          - {kind: stalled_vehicle, lane: west_out_1, at: {uniform: [12, 12.5]}}
          - {kind: accident, vehicles: [{lane: ego_out, at: 14}]}
        """
    assert problems(text) == []
    (said,) = try_out(load_scenario(tmp_path / "s.yaml"))
    assert "stalled_vehicle0:0 and accident1:0 (kind, number in `events`, and the thing's" in said
    assert "would overlap or touch, at (-2" in said
