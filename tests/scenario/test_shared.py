"""`shared`: numbers that are drawn once an episode and stand in several places."""

import json
from textwrap import dedent

import numpy as np
import pytest
from pydantic import ValidationError

from rudc.errors import ScenarioError
from rudc.evaluation.preflight import never_happening
from rudc.evaluation.search.space import space_of
from rudc.scenario import load_scenario
from rudc.scenario.choices import possible_together
from rudc.world.fitting import misfits
from tests.scenario.test_errors import check, problems
from tests.scenario.test_json_schema import SCHEMA, valid
from tests.scenario.test_plan import scenario
from tests.scenario.test_sweep import problems as swept_problems

__all__ = ["problems"]

SECOND = {"shared": "gap", "times": 2, "plus": -3}
EVENTS = [
    {"kind": "lane_closure", "lane": "north_out_0", "at": {"shared": "gap"}, "length": 4},
    {"kind": "lane_closure", "lane": "north_out_1", "at": SECOND, "length": 4},
    {"kind": "hard_brake", "deceleration": {"shared": "hard"}, "when": {"probability": {"shared": "chance"}}},
]
SHARED = {"gap": {"uniform": [12, 20]}, "hard": {"choice": [4, 6]}, "chance": {"uniform": [0, 1]}}
GIVEN = {"shared": SHARED, "events": EVENTS, "traffic": {"density": {"shared": "gap", "plus": 1}}}


def test_one_draw_stands_in_all_places():
    read = scenario(**GIVEN)
    gaps = []
    for seed in range(20):
        plan = read.plan(seed)
        gap = float(plan.events[0].at)
        assert float(plan.events[1].at) == pytest.approx(2 * gap - 3)
        assert plan.traffic.density == pytest.approx(gap + 1)
        gaps.append(gap)
    assert len(set(gaps)) == 20
    assert 12 <= min(gaps) < 14 < 18 < max(gaps) <= 20


def test_the_same_seed_draws_the_same_and_other_draws_are_what_they_were():
    read = scenario(**GIVEN)
    assert read.plan(3) == read.plan(3)
    assert read.plan(3) != read.plan(3, attempt=1)
    without = scenario(events=[{**EVENTS[0], "at": 15}])
    shared = scenario(events=[EVENTS[0]], shared={"gap": 15})
    assert shared.plan(5).ego == without.plan(5).ego
    assert float(shared.plan(5).events[0].at) == 15.0
    assert shared.digest != without.digest


def test_whether_an_event_happens_does_not_depend_on_the_attempt():
    read = scenario(**GIVEN)
    happens = [[2 in (n - 1 for n in read.plan(s, a).event_numbers) for a in range(5)] for s in range(40)]
    assert all(len(set(attempts)) == 1 for attempts in happens)
    assert 8 < sum(attempts[0] for attempts in happens) < 32


def test_a_number_does_not_depend_on_the_others():
    """Neither on their order, which the digest does not know, nor on whether they are drawn."""
    turned = scenario(**{**GIVEN, "shared": dict(reversed(SHARED.items()))})
    read = scenario(**GIVEN)
    assert turned.digest == read.digest
    fixed = read.varied({"shared.hard": 5})
    more = scenario(**{**GIVEN, "shared": {"first": {"uniform": [0, 1]}, **SHARED}})
    for seed in range(5):
        assert turned.plan(seed).events == read.plan(seed).events
        assert fixed.plan(seed).events[0] == more.plan(seed).events[0] == read.plan(seed).events[0]


def test_a_name_may_be_a_number():
    read = scenario(shared={1: 7, " wide ": 8}, traffic={"density": {"shared": 1}},
                    episode={"timeout": {"shared": "wide"}})  # fmt: skip
    assert read.plan(0).traffic.density == 7.0
    assert read.plan(0).timeout_s == 8.0


def test_thresholds_of_one_number_that_contradict_each_other_are_refused():
    never = {"above": {"shared": "gap", "plus": 1}, "below": {"shared": "gap"}}
    with pytest.raises(ValidationError, match="can never hold"):
        scenario(shared=SHARED, events=[{"kind": "hard_brake", "when": {"speed": never}}])
    sometimes = {"above": {"shared": "gap"}, "below": {"shared": "gap", "plus": 1}}
    scenario(shared=SHARED, events=[{"kind": "hard_brake", "when": {"speed": sometimes}}])


def test_names_that_are_not_there_are_refused_and_those_that_nobody_uses_told():
    with pytest.raises(ScenarioError, match=r"no shared number is called 'gop' \(did you mean 'gap'\?\)"):
        scenario(**GIVEN).varied({"shared.gop": 3})
    with pytest.raises(ScenarioError, match="called 'gap'; the scenario has no section `shared`"):
        scenario().varied({"shared.gap": 3})
    with pytest.raises(ScenarioError, match="no shared number is called 'gop'"):
        load_scenario("fog", {"shared.gop": 3})
    (told,) = never_happening(scenario(shared={"gap": 3}))
    assert told == "nothing names the shared number 'gap': {shared: gap} would"
    assert never_happening(scenario(**{**GIVEN, "events": EVENTS[:2], "shared": {"gap": 3}})) == []


def test_it_is_written_as_it_was_read():
    read = scenario(**GIVEN)
    assert read.data()["shared"]["gap"] == {"uniform": [12.0, 20.0]}
    assert read.data()["shared"]["hard"] == {"choice": {"values": [4.0, 6.0]}}
    assert read.data()["events"][0]["at"] == {"shared": "gap"}
    assert read.data()["events"][1]["at"] == {"shared": "gap", "times": 2.0, "plus": -3.0}
    again = scenario(**json.loads(json.dumps(read.data())))
    assert again == read
    assert again.plan(4) == read.plan(4)
    assert "shared" not in scenario().data()
    assert valid({"name": "a", **GIVEN}, SCHEMA)
    assert not valid({"name": "a", "traffic": {"density": {"shared": "gap", "pluss": 1}}}, SCHEMA)


def test_it_may_be_swept_and_varied():
    read = scenario(**GIVEN, sweep={"shared.gap": [13, 14]})
    assert [float(one.plan(0).events[1].at) for _, one in read.grid()] == [23.0, 25.0]
    assert float(scenario(**GIVEN).varied({"events.0.at": 7}).plan(0).events[0].at) == 7.0


def test_who_extends_gives_one_of_them_anew(tmp_path):
    (tmp_path / "parent.yaml").write_text(json.dumps({"name": "parent", **GIVEN}))
    (tmp_path / "child.yaml").write_text(
        json.dumps({"name": "child", "extends": "parent", "shared": {"gap": 13}})
    )
    child = load_scenario(str(tmp_path / "child.yaml"))
    assert float(child.plan(0).events[1].at) == 23.0
    assert set(child.shared) == {"gap", "hard", "chance"}


def test_a_search_varies_the_shared_number_itself():
    read = scenario(**{**GIVEN, "traffic": {}})
    space = space_of(read, {})
    assert "shared.gap" in space.axes
    assert not any(key.startswith("events") for key in space.axes)
    values = space.values(np.zeros(len(space.axes)))
    assert values["shared.gap"] == pytest.approx(16.0)
    plan = space.fixed(read, values).plan(1)
    assert float(plan.events[0].at) == pytest.approx(16.0)
    assert float(plan.events[1].at) == pytest.approx(29.0)


CORNERS = {
    "shared": {"corner": {"choice": {"values": [0, 1], "weights": [3, 1]}}, "wait": {"uniform": [1, 2]}},
    "ego": {"route": {"from": {"choice": ["south", "north"], "shared": "corner"}, "turn": "left"}},
    "events": [
        {
            "kind": "stalled_vehicle",
            "lane": {"choice": ["east_out_0", "west_out_0"], "shared": "corner"},
            "at": {"choice": [25, 12], "shared": "corner"},
        },
        {"kind": "pedestrian_crossing", "arm": {"choice": ["east", "west"], "shared": "corner"}, "at": 10},
    ],
}


def test_a_shared_number_says_which_value_of_several_choices_it_is():
    read = scenario(**CORNERS)
    drawn = []
    for seed in range(60):
        plan = read.plan(seed)
        van, walker = plan.events
        drawn.append((plan.ego.origin, van.lane, float(van.at), walker.arm))
    together = {("south", "east_out_0", 25.0, "east"), ("north", "west_out_0", 12.0, "west")}
    assert set(drawn) == together
    assert 5 < sum(origin == "north" for origin, *_ in drawn) < 25, "one in four"
    fixed = read.varied({"shared.corner": 1})
    assert {fixed.plan(seed).events[1].arm for seed in range(8)} == {"west"}
    at = read.events[0].at
    assert at.support == (12.0, 25.0)
    assert at.mean == pytest.approx(0.75 * 25 + 0.25 * 12)
    assert never_happening(scenario(**CORNERS)) == [
        "nothing names the shared number 'wait': {shared: wait} would"
    ]
    assert read.data()["events"][0]["lane"] == {
        "choice": {"values": ["east_out_0", "west_out_0"]},
        "shared": "corner",
    }
    assert scenario(**read.data()).digest == read.digest
    assert valid({"name": "a", **CORNERS}, SCHEMA)


def test_words_that_name_the_same_number_are_combined_only_as_it_says():
    """By south and east-straight, which no episode has, would be refused if nobody could drive so."""
    read = scenario(**CORNERS)
    assert [(route.origin, route.turn) for route in read.ego.route.each()] == [
        ("south", "left"),
        ("north", "left"),
    ]
    one, other = (read.events[0].lane, read.events[1].arm)
    assert possible_together(one, other) == [("east_out_0", "east"), ("west_out_0", "west")]
    free = {"choice": ["left", "right"]}
    both = scenario(events=[{**CORNERS["events"][1], "from_side": free}], shared=CORNERS["shared"]).events[0]
    assert len(possible_together(both.arm, both.from_side)) == 4


def test_what_cannot_say_which_value_is_refused(problems):
    found = problems("""
        name: wrong
        shared: {two: {choice: [0, 2]}, any: {uniform: [0, 1]}, half: 0.5}
        events:
          - {kind: pedestrian_crossing, arm: {choice: [north, south], shared: two}, at: 10}
          - {kind: pedestrian_crossing, arm: north, at: {choice: [4, 8], shared: any}}
          - {kind: pedestrian_crossing, arm: {choice: [north, south], shared: haf}, at: 10}
          - {kind: pedestrian_crossing, arm: north, from_side: {choice: [left, right], shared: half}}
          - {kind: pedestrian_crossing, arm: north, at: {choice: {values: [4], weights: [1]}, shared: half}}
        """)
    which = "says which of 2 values this is, 0 the first, so it must be a whole number from 0 to 1"
    check(
        found,
        f"4:71: events.0.arm.shared: 'two' {which}, or a {{choice: [...]}} of such; it may be 0, 2",
        f"5:74: events.1.at.shared: 'any' {which}, or a {{choice: [...]}} of such",
        "6:71: events.2.arm.shared: no shared number is called 'haf' (did you mean 'half'?); there are: two, "
        "any, half",
        f"7:88: events.3.from_side.shared: 'half' {which}, or a {{choice: [...]}} of such; it may be 0.5",
        "8:81: events.4.at.choice.weights: has no effect beside `shared`, whose number says which value it "
        "is",
    )


def fitted(tmp_path, text):
    """The scenario of a file, checked with its network."""
    file = tmp_path / "given.yaml"
    file.write_text("name: given\n" + dedent(text))
    return load_scenario(str(file), None, misfits)


def test_only_what_a_shared_number_says_is_checked_and_what_goes_together(tmp_path):
    """A place far out on an arm was taken to be on the ring, too, a route that nobody drives was refused, and
    lists of two lengths ended in an IndexError."""
    read = fitted(
        tmp_path,
        """
        network: roundabout
        shared: {which: {choice: [0, 1]}}
        ego: {route: {from: {choice: [south, north, nowhere], shared: which},
                      turn: {choice: [left, straight], shared: which}}}
        events:
          - {kind: slippery_patch, lane: {choice: [north_out_0, ring_south_0], shared: which},
             at: {choice: [60, 3], shared: which}, length: 4, friction: 0.3}
          - {kind: hard_brake, vehicle: {from: {choice: [east, west], shared: which}, turn: left}}
        """,
    )
    assert {(p.ego.origin, p.ego.turn) for p in map(read.plan, range(8))} == {
        ("south", "left"),
        ("north", "straight"),
    }
    with pytest.raises(ScenarioError, match=r"events\.0\.at: 60 m lies beyond 'ring_south_0'"):
        fitted(
            tmp_path,
            """
            network: roundabout
            shared: {which: {choice: [0, 1]}}
            events:
              - {kind: slippery_patch, lane: {choice: [north_out_0, ring_south_0], shared: which},
                 at: {choice: [3, 60], shared: which}, length: 4, friction: 0.3}
            """,
        )


@pytest.mark.parametrize("place", ["lane: north_out_0, at: {shared: far}", "position: [{shared: far}, 3]"])
def test_a_shared_number_that_is_wrong_is_reported_once(tmp_path, place):
    with pytest.raises(ScenarioError) as caught:
        fitted(
            tmp_path,
            f"""
            shared: {{far: {{uniform: [5]}}}}
            ego: {{distance: {{shared: far}}}}
            events:
              - {{kind: accident, vehicles: [{{{place}}}]}}
            """,
        )
    assert str(caught.value).endswith("shared.far.uniform: expected 2 values, got 1")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("which", ["{shared: w}", "{choice: [0, 1]}", "{choice: [1, 0], shared: w}"])
def test_who_is_the_same_may_be_drawn(tmp_path, which):
    read = fitted(
        tmp_path,
        f"""
        shared: {{w: {{choice: [0, 1]}}}}
        events:
          - {{kind: hard_brake}}
          - {{kind: hard_brake, vehicle: oncoming}}
          - {{kind: hard_brake, vehicle: same, when: {{event_state: {{event: {which}}}}}}}
        """,
    )
    assert {float(read.plan(seed).events[2].when.event_state.event) for seed in range(12)} == {0.0, 1.0}


def test_shares_that_a_shared_number_makes_0_in_turn_are_none_that_are_all_0(tmp_path):
    shares = {"east": {"choice": [0, 1], "shared": "w"}, "west": {"choice": [1, 0], "shared": "w"}}
    assert scenario(shared={"w": {"choice": [0, 1]}}, traffic={"from": shares}).plan(1)
    with pytest.raises(ValidationError, match="all shares can be drawn as 0"):
        scenario(shared={"w": {"choice": [0, 1]}}, traffic={"from": {"east": shares["east"]}})


def test_what_does_not_fit_the_network_is_said_at_its_place_beside_a_shared_number(tmp_path):
    file = tmp_path / "typo.yaml"
    file.write_text(
        "name: typo\nshared: {far: {uniform: [10, 20]}}\nevents:\n"
        "  - {kind: stalled_vehicle, lane: norht_in_0, at: {shared: far}}\n"
    )
    with pytest.raises(ScenarioError, match=r"4:35: events\.0\.lane: no lane 'norht_in_0'"):
        load_scenario(str(file), None, misfits)


def test_what_is_wrong_is_said_at_its_place(problems):
    found = problems("""
        name: wrong
        shared:
          gap: {uniform: [12, 20]}
          open: {normal: [3, 1]}
          other: {shared: gap}
          odd: {unifrm: [1, 2]}
        events:
          - {kind: lane_closure, lane: north_out_0, at: {shared: gop}, length: {shared: gap, pluss: 3}}
          - {kind: lane_closure, lane: north_out_1, at: {shared: gap, times: -1}, length: {shared: open}}
          - {kind: hard_brake, deceleration: {shared: odd}, when: {speed: {above: {sharde: gap}}}}
          - {kind: pedestrian_crossing, arm: north, count: {shared: gap}}
          - {kind: hard_brake, when: {speed: {above: {shared: odd}, below: 3},
                                     event_state: {event: {shared: odd}}}}
        """)
    check(
        found,
        "4:18: shared.open.normal: give `low` and `high`, too: {normal: {mean: m, std: s, low: l, high: h}}",
        "5:19: shared.other.shared: a shared number cannot name another one",
        "6:9: shared.odd.unifrm: unknown distribution (did you mean 'uniform'?)",
        "8:58: events.0.at.shared: no shared number is called 'gop' (did you mean 'gap'?); there are: gap, "
        "open, other, odd",
        "8:86: events.0.length.pluss: unknown key (did you mean 'plus'?)",
        "9:49: events.1.at: -12 m is not between 0 and 1000 m",
        "10:76: events.2.when.speed.above.sharde: unknown distribution (did you mean 'shared'?)",
        "11:52: events.3.count: expected a whole number or {choice: [...]} of whole numbers",
    )


def test_without_the_section_no_number_is_shared(problems):
    found = problems("""
        name: wrong
        traffic: {density: {shared: gap}}
        """)
    check(
        found,
        "2:29: traffic.density.shared: no shared number is called 'gap'; the scenario has no section "
        "`shared`",
    )


def test_shared_numbers_are_checked_with_all_who_name_them(tmp_path):
    found = swept_problems(
        tmp_path,
        """
        name: shared
        shared: {gap: 12}
        traffic: {density: {shared: gap, times: 0.1}}
        events:
          - {kind: lane_closure, lane: north_out_0, at: {shared: gap, plus: 3}, length: 4}
        sweep:
          shared.gap: [10, 999]
          events.0.at.plus: [0, 5]
          events.0.length: [4, 1000]
          ego.speed: [5, 200]
        """,
    )
    assert [line.split(": ", 2)[1:] for line in found] == [
        ["sweep.events.0.at.plus.1", "events.0.at: 1004 m is not between 0 and 1000 m"],
        ["sweep.events.0.length.1", "1000 m is not above 0 and at most 500 m"],
        ["sweep.ego.speed.1", "200 m/s is not between 0 and 40 m/s"],
    ]
