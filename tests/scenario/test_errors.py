"""Wrong files: every problem at once, exactly where it is, in words, with what was meant."""

import re
import textwrap

import pytest

from rudc.errors import ScenarioError
from rudc.scenario import load_scenario


@pytest.fixture
def problems(tmp_path, monkeypatch):
    """Problems of a text, as `LINE:COLUMN: key.path: what`."""
    monkeypatch.chdir(tmp_path)

    def find(text: str, **overrides: object) -> list[str]:
        (tmp_path / "s.yaml").write_text(textwrap.dedent(text).lstrip("\n"), encoding="utf-8")
        with pytest.raises(ScenarioError) as caught:
            load_scenario("s.yaml", overrides)
        assert caught.value.exit_code == 2
        lines = str(caught.value).splitlines()
        return [line.removeprefix("s.yaml:") for line in lines]

    return find


def check(found: list[str], *expected: str) -> None:
    """Compare line by line; `...` in an expected line stands for anything."""
    assert len(found) == len(expected), "\n".join(found)
    for line, pattern in zip(found, expected, strict=True):
        assert re.fullmatch(".*".join(re.escape(part) for part in pattern.split("...")), line), line


def test_every_problem_of_a_file_at_once(problems):
    found = problems("""
        name: wrong
        network: four_wya
        ego:
          rout: random
          speed: fast
          distance: {uniform: [45, 35]}
        traffic:
          density: 500
          mix: {car: 1, lorry: 2}
          idm: {headway: {normal: [1, -2]}}
          warm_up: {unifrom: [2, 3]}
          speed: {uniform: [3]}
          impatience: {choice: [0.1, x, .inf]}
        events:
          - kind: accident
            vehicles: [{position: [2, 4], lane: x}, {lane: west_out_1, heading: 3, sped: 1}]
          - kind: hard_brak
          - {kind: slow_vehicle, vehicle: leadre, sped: 3}
          - kind: low_friction
            when: {}
          - kind: hard_brake
            when: {ego_distance_to_junction: 20, speed: {above: 3, below: 2}}
        episode: {timeout: 0}
        """)
    check(
        found,
        "2:10: network: no shipped network 'four_wya' (did you mean 'four_way'?)...",
        "4:3: ego.rout: unknown key (did you mean 'route'?)",
        "5:10: ego.speed: expected a number in m/s, {uniform: [low, high]}, ... got the text 'fast'",
        "6:24: ego.distance.uniform.0: low 45 is above high 35 (swap them?)",
        "8:12: traffic.density: 500 veh/km is not between 0 and 150 veh/km",
        "9:17: traffic.mix.lorry: unknown key; known here: car, truck, bus, motorcycle, bicycle",
        "10:31: traffic.idm.headway.normal.1: must be above 0, got -2 ...",
        "11:13: traffic.warm_up.unifrom: unknown distribution (did you mean 'uniform'?)",
        "12:20: traffic.speed.uniform: expected 2 values, got 1",
        "13:30: traffic.impatience.choice.1: expected a number...; got the text 'x'",
        "13:33: traffic.impatience.choice.2: expected a finite number, got inf",
        "16:16: events.0.vehicles.0: expected either `position` (and `heading`) or `lane` and `at`",
        "16:46: events.0.vehicles.1.lane: needs `at`, the distance from the junction in m",
        "16:64: events.0.vehicles.1.heading: goes with `position` only (did you mean 'heading_offset'?)",
        "16:76: events.0.vehicles.1.sped: unknown key; known here: ...",
        "17:11: events.1.kind: unknown kind of event 'hard_brak' (did you mean 'hard_brake'?)",
        "18:35: events.2.vehicle: expected one of leader, ...'leadre' (did you mean 'leader'?)",
        "18:43: events.2.sped: unknown key (did you mean 'speed'?)",
        "19:5: events.3.friction: is missing, and it is required",
        "20:11: events.3.when: no condition given; expected one or more of simulation_time, ...",
        "22:38: events.4.when.ego_distance_to_junction: expected a mapping (keys: above, below), got ...20",
        "22:57: events.4.when.speed.above: can never hold: `above` is not smaller than `below`",
        "23:20: episode.timeout: 0 s is not above 0 and at most 3600 s",
    )


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "1:1: the file is empty"),
        ("# only a comment\n", "1:1: the file is empty"),
        ("- a\n- b\n", "1:1: expected a mapping with keys such as `name` and `network`, got a list"),
        ("just words\n", "1:1: expected a mapping with keys ..., got the text 'just words'"),
        ("name: a\nego: {speed: 3\n", "3:1: not valid YAML..."),
        ("name: a\n\tego: 3\n", "2:1: not valid YAML...: a tab; YAML is indented with spaces"),
        (
            "name: a\nego: b: c\n",
            "2:7: not valid YAML: mapping values are not allowed here (a stray colon...)",
        ),
        ("name: a\n---\nname: b\n", "2:1: not valid YAML...but found another document"),
        ("name: a\nego: *nowhere\n", "2:6: not valid YAML...undefined alias..."),
        ("name: a\x07b\n", "1:8: not valid YAML: the character U+0007 is not allowed"),
    ],
)
def test_not_a_scenario_at_all(problems, tmp_path, text, expected):
    check(problems(text), expected)


def test_the_unit_of_a_number_is_said_where_it_has_one(problems):
    found = problems("""
        name: a
        ego: {speed: 50 km/h, distance: {uniform: [30 m, 40]}}
        traffic: {impatience: half, warm_up: {normal: [5 s, 1]}, density: [10, 20]}
        events:
          - {kind: hard_brake, vehicle: leader, deceleration: 7 m/s2, when: {simulation_time: {above: 1 min}}}
          - {kind: accident, vehicles: [{position: [2 m, 3]}]}
          - {kind: low_friction, friction: {choice: {values: [0.3], weights: [all]}}}
        """)
    check(
        found,
        "2:14: ego.speed: expected a number in m/s, {uniform...; got the text '50 km/h'",
        "2:44: ego.distance.uniform.0: expected a number in m; got the text '30 m'",
        "3:23: traffic.impatience: expected a number, {uniform...; got the text 'half'",
        "3:48: traffic.warm_up.normal.0: expected a number in s; got the text '5 s'",
        "3:67: traffic.density: expected a number in veh/km, {uniform...; got a list ...",
        "5:55: events.0.deceleration: expected a number in m/s2, {uniform...; got the text '7 m/s2'",
        "5:95: events.0.when.simulation_time.above: expected a number in s, ...; got the text '1 min'",
        "6:45: events.1.vehicles.0.position.0: expected a number in m, {uniform...; got the text '2 m'",
        "7:71: events.2.friction.choice.weights.0: expected a number; got the text 'all'",
    )


def test_not_utf8(tmp_path):
    path = tmp_path / "s.yaml"
    path.write_bytes(b"name: a\ndescription: caf\xe9\n")
    with pytest.raises(ScenarioError, match=r"s\.yaml:2:17: not valid UTF-8 text"):
        load_scenario(path)


def test_a_byte_order_mark_is_no_problem(tmp_path):
    path = tmp_path / "s.yaml"
    path.write_bytes(b"\xef\xbb\xbfname: a\n")
    assert load_scenario(path).name == "a"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("name: a\nname: b\n", ["2:1: name: given twice, first in line 1"]),
        ("name: a\nego:\n  speed: 3\n  speed: 4\n", ["4:3: ego.speed: given twice, first in line 3"]),
        ("name: a\nego: &e {speed: 3}\nepisode: {<<: *e}\n", ["3:11: episode.<<: YAML's merge key ..."]),
        ("name: !!python/object:os.system a\n", ["1:7: name: the YAML tag !!python/object:os.system ..."]),
        ("name: a\nego: !thing {speed: 3}\n", ["2:6: ego: the YAML tag !thing is not understood here"]),
        (
            "name: a\nevents: &e [*e]\n",
            ["2:9: events.0: refers to itself"],
        ),
        ("name: a\n? [1, 2]\n: 3\n", ["2:3: a key must be a word"]),
        ("name: !!int x\n", ["1:7: name: 'x' is not a value of the type 'int'"]),
        (
            "name: a\ntraffic:\n  density:\n",
            ["3:11: traffic.density: no value given; without one, leave the key out"],
        ),
        ("name: a\nevents:\n", ["2:8: events: no value given; without one, leave the key out"]),
        ("name:\n", ["1:6: name: no value given, and it is required"]),
        ("network: four_way\n", ["1:1: name: is missing, and it is required"]),
        ("nane: a\n", ["1:1: nane: unknown key (did you mean 'name'?)"]),
        ('"na\\nme": a\nname: b\n', ["1:1: 'na\\nme': unknown key (did you mean 'name'?)"]),
        ("name: 3\n", ["1:7: name: expected text, got the number 3"]),
        ("name: on\ndescription: yes\n", None),
        ("name: a/b\n", ["1:7: name: expected a name of unaccented letters, ...; got 'a/b'"]),
        ("name: ''\n", ["1:7: name: must not be empty"]),
        ("name: a\nego: [1]\n", ["2:6: ego: expected a mapping (keys: route, ...), got a list"]),
        ("name: a\nevents: {kind: accident}\n", ["2:9: events: expected a list, got a mapping"]),
        (
            "name: a\nsweep: {traffic: {density: [1]}}\n",
            [
                "2:18: sweep.traffic: expected a list of values, got a mapping; the key is written "
                "`traffic.density`"
            ],
        ),
        (
            "name: a\nevents: [accident]\n",
            ["2:10: events.0: expected an event, ...; got the text 'accident'"],
        ),
        (
            "name: a\nevents: [{vehicle: leader}]\n",
            ["2:10: events.0.kind: is missing, and it is required; one of ..."],
        ),
        ("name: a\ntimeout: 30\n", ["2:1: timeout: unknown key (did you mean 'episode.timeout'?)"]),
        (
            "name: a\nego: {density: 3}\n",
            ["2:7: ego.density: unknown key (did you mean 'traffic.density'?)"],
        ),
        (
            "name: a\ntraffic: {density: [10, 20]}\n",
            ["2:20: traffic.density: expected ...; got a list (`sweep: {traffic.density: [10, 20]}` ..."],
        ),
        ("name: a\nevents: [{kin: accident}]\n", ["2:11: events.0.kin: unknown key (did you mean 'kind'?)"]),
        (
            "name: a\nevents: [{kind: 3}]\n",
            ["2:17: events.0.kind: expected a kind of event, got the number 3"],
        ),
        ("name: a\nego: {speed: on}\n", ["2:14: ego.speed: expected a number...; got the text 'on'"]),
        (
            "name: a\nego: {speed: true}\n",
            ["2:14: ego.speed: expected a number...; got the truth value true"],
        ),
        ("name: a\nego: {speed: .nan}\n", ["2:14: ego.speed: expected a finite number, got nan"]),
        ("name: a\nego: {speed: '7'}\n", ["2:14: ego.speed: expected a number...; got the text '7'"]),
        (
            "name: a\nego: {speed: [6, 10]}\n",
            ["2:14: ego.speed: expected a number...; got a list (`sweep: {ego.speed: [6, 10]}` ..."],
        ),
        (
            "name: a\nego: {speed: {uniform: [1, 2], normal: [1, 2]}}\n",
            ["2:14: ego.speed: expected a number...; got uniform and normal"],
        ),
        (
            "name: a\nego: {speed: {uniform: [1, 2, 3]}}\n",
            ["2:24: ego.speed.uniform: expected 2 values, got 3"],
        ),
        (
            "name: a\nego: {speed: {uniform: [6, 10], x: 1}}\n",
            ["2:33: ego.speed.x: unknown key; known here: uniform"],
        ),
        (
            "name: a\nego: {speed: {normal: [6]}}\n",
            ["2:23: ego.speed.normal: expected [mean, std], got 1 values..."],
        ),
        (
            "name: a\nego: {speed: {normal: {mean: 6}}}\n",
            ["2:23: ego.speed.normal.std: is missing, and it is required"],
        ),
        (
            "name: a\nego: {speed: {normal: {mean: 60, std: 1}}}\n",
            ["2:30: ego.speed.normal.mean: 60 m/s is not ..."],
        ),
        ("name: a\nego: {speed: {choice: [6, 60]}}\n", ["2:27: ego.speed.choice.1: 60 m/s is not ..."]),
        (
            "name: a\nego: {route: left}\n",
            ["2:14: ego.route: expected random, {from: ARM, turn: TURN} or ..."],
        ),
        (
            "name: a\nego: {route: {turn: left, to: E}}\n",
            ["2:27: ego.route.to: does not go with `turn`...", "2:27: ego.route.to: needs `from`, ..."],
        ),
        (
            "name: a\nego: {route: {from: random, to: E}}\n",
            ["2:29: ego.route.to: does not go with `from: random`: name the arm or edge it comes from; ..."],
        ),
        (
            "name: a\nego: {route: {from: south, turn: lef}}\n",
            ["2:34: ego.route.turn: expected one of left, straight, right, random or {choice: [...]}; ..."],
        ),
        (
            "name: a\ntraffic: {mix: {car: {choice: [0, 1]}, truck: {choice: [0, 1]}}}\n",
            ["2:16: traffic.mix: all shares can be drawn as 0 in the same episode; one at least must ..."],
        ),
        ("name: a\ntraffic: {mix: {}}\n", ["2:16: traffic.mix: one share at least must be above 0, ..."]),
        ("name: a\ntraffic: {mix: {car: -1}}\n", ["2:22: traffic.mix.car: -1 is not between 0 and 1e+06"]),
        (
            "name: a\nevents:\n- {kind: stalled_vehicle, vehicle: leader, type: bus}\n",
            ["3:44: events.0.type: goes with `lane` only"],
        ),
        (
            "name: a\nevents:\n- {kind: stalled_vehicle}\n",
            ["3:3: events.0: expected either `lane` and `at` or `vehicle`"],
        ),
        (
            "name: a\nevents:\n- {kind: sensor_noise}\n",
            ["3:3: events.0: expected one or more of `position`, ..."],
        ),
        (
            "name: a\nevents:\n- {kind: accident, vehicles: []}\n",
            ["3:30: events.0.vehicles: an accident involves ..."],
        ),
        (
            "name: a\nevents:\n- {kind: pedestrian_crossing, arm: south, count: 1.5}\n",
            ["3:50: events.0.count: expected a whole number, got 1.5"],
        ),
        (f"name: a\nnetwork: {'n' * 300}.net.xml\n", ["2:10: network: no such file: ...nnn.net.xml"]),
        ("name: a\nnetwork: nowhere/x.net.xml\n", ["2:10: network: no such file: ...nowhere/x.net.xml"]),
    ],
)
def test_one_problem(problems, tmp_path, text, expected):
    if expected is None:
        (tmp_path / "s.yaml").write_text(text)
        assert load_scenario(tmp_path / "s.yaml").description == "yes"
    else:
        check(problems(text), *expected)


def test_scalars_are_those_of_yaml_1_2(tmp_path):
    path = tmp_path / "s.yaml"
    path.write_text("name: no\nego: {speed: 1e1, route: {from: 0123, to: -456}}\nepisode: {timeout: 4.e+1}\n")
    scenario = load_scenario(path)
    assert scenario.name == "no"
    assert float(scenario.ego.speed) == 10.0
    assert float(scenario.episode.timeout) == 40.0
    assert (scenario.ego.route.origin, scenario.ego.route.to) == ("0123", "-456")


def test_braces_in_a_message_stay_as_they_are(problems):
    check(problems("name: '{message}'\n"), "1:7: name: ...; got '{message}'")


def test_no_other_exception_leaks(problems):
    assert problems("name: a\nevents: [[{}], {kind: {}}, 3, [], {kind: occlusion, boxes: 3}]\nsweep: 3\n")


class TestOverrides:
    def test_take_the_place_of_values(self):
        values = {"traffic.density": 30, "ego.speed": {"uniform": [1, 2]}, "episode.timeout": 10}
        scenario = load_scenario("random_destination", values)
        assert scenario.traffic.density.mean == 30
        assert scenario.ego.speed.mean == 1.5
        assert scenario.episode.timeout.mean == 10

    def test_reach_into_lists_and_absent_sections(self, tmp_path):
        (tmp_path / "s.yaml").write_text("name: a\nevents: [{kind: low_friction, friction: 0.5}]\n")
        scenario = load_scenario(tmp_path / "s.yaml", {"events.0.friction": 0.2, "traffic.idm.headway": 2})
        assert float(scenario.events[0].friction) == 0.2
        assert float(scenario.traffic.idm.headway) == 2

    def test_are_blamed_by_their_key(self, problems):
        wrong = {"traffic.densty": 3, "ego.speed": -1, "name.x": 3, "sweep.traffic.density": [1]}
        check(
            problems("name: a\nego: {speed: 3}\n", **wrong),
            "override: name.x: name is 'a', which has no part 'x'",
            "override: sweep.traffic.density: is not a key; give traffic.density itself a list",
            "override: ego.speed: -1 m/s is not between 0 and 40 m/s",
            "override: traffic.densty: unknown key (did you mean 'density'?)",
        )

    def test_part_of_a_random_route_is_given(self):
        route = load_scenario("random_destination", {"ego.route.turn": "left"}).ego.route
        assert (route.turn, route.origin) == ("left", load_scenario("random_destination").ego.route.origin)

    def test_in_sections_that_nobody_knows_are_blamed_too(self, problems):
        check(
            problems("name: a\n", **{"trafic.density": 10, "ego.sped.low": 3}),
            "override: ego.sped: unknown key (did you mean 'speed'?)",
            "override: trafic: unknown key (did you mean 'traffic'?)",
        )
        found = problems("name: a\ntrafic: {mix: 3}\n", **{"trafic.density": 10})
        check(found, "2:1: trafic: unknown key (did you mean 'traffic'?)")

    @pytest.mark.parametrize("key", ["extends", "extends.0"])
    def test_cannot_change_what_a_file_extends(self, problems, key):
        found = problems("name: a\nextends: icy_junction\nego: {speed: -1}\n", **{key: "no_such"})
        check(
            found,
            "3:14: ego.speed: -1 m/s is not between 0 and 40 m/s",
            f"override: {key}: cannot be set: a file is read with what it extends; write a file with ...",
        )

    def test_that_are_lists_are_for_a_sweep(self, problems):
        given = {"traffic.density": [10, 20], "ego.route.turn": ["left", "right"], "ego.speed": "fast"}
        check(
            problems("name: a\n", **given),
            "override: ego.route.turn: expected one of ...; got a list (`rudc sweep` takes one, ...)",
            "override: ego.speed: expected a number in m/s, ...; got the text 'fast'",
            "override: traffic.density: expected a number in veh/km, ...; got a list (`rudc sweep` takes...",
        )

    def test_leave_positions_of_the_rest_alone(self, problems):
        found = problems("name: a\nego: {speed: -3, distance: -1}\n", **{"ego.distance": 40})
        check(found, "2:14: ego.speed: -3 m/s is not between 0 and 40 m/s")

    def test_name_list_entries_that_exist(self, problems):
        check(
            problems("name: a\nevents: [{kind: accident}]\n", **{"events.3.kind": "x"}),
            "2:10: events.0: an accident involves ...",
            "override: events.3.kind: events is a list whose entries are numbered (0 to 0); there is no '3'",
        )
