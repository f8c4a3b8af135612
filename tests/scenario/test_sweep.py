"""`sweep`: its grid, and which value is blamed for a point that is no scenario."""

import json
import textwrap

import pytest

from rudc.errors import ScenarioError
from rudc.evaluation.tasks import SweepPlan
from rudc.scenario import Scenario, find_scenarios, load_scenario, sweep_check
from rudc.scenario.base import FileModel
from rudc.scenario.fit import ASKED
from rudc.scenario.yaml_text import read_value


def load(tmp_path, text):
    (tmp_path / "s.yaml").write_text(textwrap.dedent(text).lstrip("\n"))
    return load_scenario(tmp_path / "s.yaml")


def problems(tmp_path, text):
    with pytest.raises(ScenarioError) as caught:
        load(tmp_path, text)
    return [line.split("s.yaml:", 1)[1] for line in str(caught.value).splitlines()]


def test_every_combination_in_order(tmp_path):
    scenario = load(
        tmp_path,
        """
        name: grid
        events: [{kind: hard_brake}]
        sweep:
          traffic.density: [10, 20.5]
          events.0.deceleration: [3, 4]
          network: [four_way, t_junction]
        """,
    )
    grid = scenario.grid()
    assert [tuple(point.values()) for point, _ in grid] == [
        (10, 3, "four_way"), (10, 3, "t_junction"), (10, 4, "four_way"), (10, 4, "t_junction"),
        (20.5, 3, "four_way"), (20.5, 3, "t_junction"), (20.5, 4, "four_way"), (20.5, 4, "t_junction"),
    ]  # fmt: skip
    assert scenario.points() == [point for point, _ in grid]
    point, at = grid[5]
    assert list(point) == ["traffic.density", "events.0.deceleration", "network"]
    assert (float(at.traffic.density), float(at.events[0].deceleration), at.network) == (
        20.5,
        3,
        "t_junction",
    )
    assert at.sweep == {}
    assert at.name == "grid"
    assert len({entry.digest for _, entry in grid}) == len(grid)
    # The scenario itself is as it was.
    assert float(scenario.traffic.density) == 20


def test_whole_numbers_stay_whole(tmp_path):
    scenario = load(tmp_path, "name: a\nsweep: {traffic.density: [10]}\n")
    assert repr(scenario.points()) == "[{'traffic.density': 10}]"


def test_true_and_false_can_be_swept_and_read_as_in_the_file(tmp_path):
    scenario = load(tmp_path, "name: a\nsweep: {ego.may_cross_centre: [true, false]}\n")
    again = Scenario.model_validate_json(json.dumps(scenario.data()))  # as a manifest keeps it
    for read in (scenario, again):
        assert [at.plan(0).ego.may_cross_centre for _, at in read.grid()] == [True, False]
    tasks = SweepPlan((again,), ("follower",), 1, 0).tasks()
    assert [str(task) for task in tasks] == [
        f"a, ego.may_cross_centre={value}, follower, seed 0" for value in ("true", "false")
    ]


@pytest.mark.parametrize("value", ["no", "on", "1"])
def test_a_truth_value_given_is_true_or_false_and_nothing_like_it(value):
    given = {"ego.may_cross_centre": read_value("true")}
    assert load_scenario("random_destination", given).ego.may_cross_centre is True
    with pytest.raises(ScenarioError, match=r"ego\.may_cross_centre: expected true or false, got the"):
        load_scenario("random_destination", {"ego.may_cross_centre": read_value(value)})


def test_without_a_sweep_the_grid_is_the_scenario(tmp_path):
    scenario = load(tmp_path, "name: a\n")
    assert scenario.grid() == [({}, scenario)]
    assert scenario.grid()[0][1] is scenario


def test_other_draws_stay_the_same_along_a_sweep():
    plans = [scenario.plan(3) for _, scenario in load_scenario("density_sweep").grid()]
    assert [plan.traffic.density for plan in plans] == [10, 20, 30, 40, 50]
    assert len({plan.ego for plan in plans}) == 1


def test_a_part_of_a_distribution_can_be_swept(tmp_path):
    scenario = load(
        tmp_path, "name: a\nego: {speed: {uniform: [1, 2]}}\nsweep: {ego.speed.uniform.1: [3, 5]}\n"
    )
    assert [at.ego.speed.uniform for _, at in scenario.grid()] == [(1, 3), (1, 5)]


@pytest.mark.parametrize(
    ("sweep", "expected"),
    [
        ("{traffic.densty: [1, 2]}", "2:9: sweep.traffic.densty: unknown key (did you mean 'density'?)"),
        ("{trafic.density: [1]}", "2:9: sweep.trafic.density: trafic: unknown key (did you mean 'traffic'?)"),
        (
            "{traffic.density: [10, 500]}",
            "2:31: sweep.traffic.density.1: 500 veh/km is not between 0 and 150 veh/km",
        ),
        ("{traffic.density: [10, many]}", "2:31: sweep.traffic.density.1: expected a number"),
        ("{traffic.density: []}", "2:26: sweep.traffic.density: there is no value to sweep over"),
        ("{traffic.density: 10}", "2:26: sweep.traffic.density: expected a list, got the number 10"),
        ("{traffic.density: [1, 2, 1]}", "2:33: sweep.traffic.density.2: 1 is given twice"),
        ('{ego.route.from: [south, "south "]}', "2:33: sweep.ego.route.from.1: 'south ' is given twice"),
        (
            "{traffic.density: [{uniform: [1, 2]}]}",
            "2:27: sweep.traffic.density.0: a swept value is a number, a name, true or false",
        ),
        ("{traffic.density: [true]}", "2:27: sweep.traffic.density.0: expected a number"),
        (
            "{ego.may_cross_centre: [true, no]}",
            "2:38: sweep.ego.may_cross_centre.1: expected true or false, got the text 'no'",
        ),
        (
            "{ego.may_cross_centre: [true, 1]}",
            "2:38: sweep.ego.may_cross_centre.1: expected true or false, got the number 1",
        ),
        (
            "{ego.may_cross_centre: [true, true]}",
            "2:38: sweep.ego.may_cross_centre.1: true is given twice",
        ),
        ("{name: [b]}", "2:9: sweep.name: cannot be swept"),
        (
            "{network.x: [1]}",
            "2:9: sweep.network.x: network is 'four_way', which has no part 'x'",
        ),
        (
            "{events.1.friction: [1]}",
            "2:9: sweep.events.1.friction: events is a list whose entries are numbered",
        ),
        (
            "{network: [four_way, five_way]}",
            "2:29: sweep.network.1: no shipped network 'five_way' (did you mean 'four_way'?)",
        ),
        (
            "{events.0.kind: [low_friction, hard_brake]}",
            "2:39: sweep.events.0.kind.1: events.0.friction: unknown",
        ),
        ("{..: [1]}", "2:9: sweep...: expected a dotted key"),
    ],
)
def test_wrong_sweeps(tmp_path, sweep, expected):
    text = f"name: a\nsweep: {sweep}\nnetwork: four_way\nevents: [{{kind: low_friction, friction: 0.5}}]\n"
    found = problems(tmp_path, text)
    assert len(found) == 1, found
    assert found[0].startswith(expected), found


@pytest.mark.parametrize("events", ["", "events: []\n"])
def test_a_swept_key_of_an_event_that_is_not_there(tmp_path, events):
    found = problems(tmp_path, f"name: a\nsweep: {{ego.speed: [5], events.0.speed: [1, 2]}}\n{events}")
    assert found == ["2:25: sweep.events.0.speed: there is no event 0; the file has none"]


def test_every_wrong_value_is_reported_once_though_it_has_many_points(tmp_path):
    found = problems(
        tmp_path, "name: a\nsweep: {traffic.density: [10, -1, -2], ego.speed: [5, 6, 99]}\nego: {sped: 3}\n"
    )
    assert [line.split(":")[:3] for line in found] == [
        ["2", "31", " sweep.traffic.density.1"],
        ["2", "35", " sweep.traffic.density.2"],
        ["2", "58", " sweep.ego.speed.2"],
        ["3", "7", " ego.sped"],
    ]


def test_a_mistake_in_one_key_hides_none_in_another(tmp_path):
    sweep = (
        "{traffic.densty: [1], ego.speed: [], network: [five_way], traffic.density: [-1], episode.timeout: 5}"
    )
    found = problems(tmp_path, f"name: a\nsweep: {sweep}\n")
    assert sorted(line.split(": ")[1] for line in found) == [
        "sweep.ego.speed",
        "sweep.episode.timeout",
        "sweep.network.0",
        "sweep.traffic.density.0",
        "sweep.traffic.densty",
    ]


def test_only_a_combination_may_be_wrong(tmp_path):
    found = problems(
        tmp_path,
        """
        name: a
        ego: {speed: {uniform: [1, 2]}}
        sweep: {ego.speed.uniform.0: [1, 4], ego.speed.uniform.1: [3, 5]}
        """,
    )
    assert found == ["3:34: sweep.ego.speed.uniform.0.1: low 4 is above high 3 (swap them?)"]


def test_a_grid_without_end_is_refused(tmp_path):
    values = list(range(1, 150))
    found = problems(tmp_path, f"name: a\nsweep: {{traffic.density: {values}, episode.timeout: {values}}}\n")
    assert found == ["2:8: sweep: has 22201 combinations; 10000 at most are allowed"]


def test_varied_says_what_is_wrong():
    with pytest.raises(ScenarioError, match=r"random_destination: traffic\.densty: unknown key"):
        load_scenario("random_destination").varied({"traffic.densty": 3})
    with pytest.raises(ScenarioError, match="no part 'x'"):
        load_scenario("random_destination").varied({"network.x": 3})


def test_values_given_are_swept_if_they_are_lists():
    (plain, swept) = find_scenarios(
        ["random_destination", "density_sweep"],
        overrides={"traffic.density": [15, 25], "episode.timeout": 30},
    )
    assert plain.points() == swept.points() == [{"traffic.density": 15}, {"traffic.density": 25}]
    assert [float(scenario.episode.timeout) for _, scenario in plain.grid()] == [30, 30]


def test_a_list_given_to_a_key_that_takes_one_is_its_value():
    place = "events.4.when.reach_position.position"
    (storm,) = find_scenarios(["perfect_storm"], overrides={place: [10, 0], f"{place}.1": [-3, -2]})
    assert [*storm.points()] == [{f"{place}.1": -3}, {f"{place}.1": -2}]
    assert float(storm.events[4].when.reach_position.position[0]) == 10
    assert find_scenarios(["perfect_storm"], overrides={"events": []})[0].events == ()


def test_a_value_given_is_not_swept_over_by_the_files_own():
    (scenario,) = find_scenarios(["density_sweep"], overrides={"traffic.density": 15})
    assert scenario.sweep == {}
    assert float(scenario.traffic.density) == 15


@pytest.mark.parametrize(
    ("given", "left"),
    [
        ({"traffic": {"density": 5}}, ["events.0.friction", "traffic.idm.headway"]),
        ({"traffic": {"impatience": 0.2}}, ["traffic.density", "events.0.friction", "traffic.idm.headway"]),
        ({"traffic": {"density": 5, "idm": {"headway": 2}}}, ["events.0.friction"]),
        ({"events.0": {"kind": "low_friction", "friction": 0.9}}, ["traffic.density", "traffic.idm.headway"]),
        ({"events": [{"kind": "low_friction", "friction": 0.9}]}, ["traffic.density", "traffic.idm.headway"]),
        ({"events": [{"kind": "hard_brake"}]}, ["traffic.density", "traffic.idm.headway"]),
    ],
)
def test_a_section_given_ends_the_sweeps_of_what_it_says(tmp_path, given, left):
    (tmp_path / "s.yaml").write_text(
        "name: a\nevents: [{kind: low_friction, friction: 0.5}]\n"
        "sweep: {traffic.density: [10, 30], events.0.friction: [0.1, 0.3], traffic.idm.headway: [1, 2]}\n"
    )
    scenario = load_scenario(tmp_path / "s.yaml", given)
    assert [*scenario.sweep] == left
    if "traffic.density" not in left:
        assert float(scenario.traffic.density) == 5


@pytest.mark.parametrize("given", [{"traffic.mix": {"car": 1}}, {"traffic": {"mix": {"car": 1}}}])
def test_a_mix_given_ends_the_sweep_of_its_parts(tmp_path, given):
    (tmp_path / "s.yaml").write_text(
        "name: a\ntraffic: {mix: {car: 1, truck: 1}}\nsweep: {traffic.mix.truck: [0, 1], ego.speed: [5, 6]}\n"
    )
    scenario = load_scenario(tmp_path / "s.yaml", given)
    assert [*scenario.sweep] == ["ego.speed"]
    assert all(at.given["traffic"]["mix"].get("truck", 0) == 0 for _, at in scenario.grid())


@pytest.mark.parametrize(
    ("overrides", "said"),
    [
        ({"traffic.densty": [10, 20]}, r"override: traffic\.densty: .*did you mean 'density'"),
        ({"traffic.speed.uniform": [5, 8, 9]}, r"^override: traffic\.speed\.uniform: expected 2 values"),
        ({"traffic.speed.uniform": [[5, 6], 8]}, r": traffic\.speed\.uniform\.0: .* got a list$"),
        ({"traffic.density": [10, "many"]}, "many"),
        ({"traffic.density": []}, "sweep"),
    ],
)
def test_a_grid_that_cannot_be_is_refused(overrides, said):
    with pytest.raises(ScenarioError, match=said) as caught:
        find_scenarios(["density_sweep"], overrides=overrides)
    assert str(caught.value).startswith("override: ")


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("30", 30), ("1e3", 1000.0), ("on", "on"), ("no", "no"), ("12:30", "12:30"), ("null", None),
        ("", None), ("[1, 2.5]", [1, 2.5]), ("{uniform: [6, 10]}", {"uniform": [6, 10]}),
        ("'30'", "30"), ("true", True),
    ],
)  # fmt: skip
def test_a_single_value_reads_as_in_a_file(text, value):
    assert read_value(text) == value
    assert type(read_value(text)) is type(value)


@pytest.mark.parametrize("text", ["[1", "{a: 1, a: 2}", "!!python/object:os.system x", "a: b: c"])
def test_a_single_value_that_cannot_be_is_refused_in_words(text):
    with pytest.raises(ValueError, match=r"is not a value|given twice|not understood"):
        read_value(text)


LARGE = """
name: large
events: [{kind: hard_brake}, {kind: speeding, factor: 1.1}]
sweep:
  traffic.density: [5, 10, 500, 20, 25, 30, 35, 40, 45, 50]
  traffic.impatience: [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 7]
  ego.distance: [30, 31, 32, 33, 34, 35, 36, 37, 38, -1]
  events.0.deceleration: [4, 5, 6, 7]
  events.1.factor: [1.2, 1.4]
"""


def test_points_of_a_large_sweep_are_checked_part_by_part(tmp_path, monkeypatch):
    """8,000 points, each value of which is checked; 10 x 10 + 10 + 4 + 2 combinations are looked at."""
    real, looked = sweep_check._point_reports, []
    monkeypatch.setattr(sweep_check, "_point_reports", lambda *given: looked.append(1) or real(*given))
    found = problems(tmp_path, LARGE)
    assert len(looked) == 116
    assert [line.partition(" sweep.")[2].partition(":")[0] for line in found] == [
        "traffic.density.2", "traffic.impatience.9", "ego.distance.9",
    ]  # fmt: skip


def test_no_rule_is_about_two_parts_of_a_file():
    """Or its points could not be checked part by part; `shared` is checked with all who name it."""
    assert Scenario.misfits.__func__ is FileModel.misfits.__func__
    assert set(Scenario.__pydantic_decorators__.model_validators) == {"_every_problem", "_sharing"}


def test_of_many_combinations_a_network_is_asked_about_some(tmp_path):
    asked = []
    (tmp_path / "s.yaml").write_text(
        f"name: many\nsweep: {{ego.distance: {list(range(20, 100))}, ego.speed: [5, 6, 7]}}\n"
    )
    load_scenario(tmp_path / "s.yaml", fit=lambda parts: asked.append(parts) or [])
    assert len(asked) == ASKED
    assert {float(parts.ego.speed) for parts in asked} == {5, 6, 7}
    assert {20, 99} <= {float(parts.ego.distance) for parts in asked}


def test_a_value_given_twice_is_named_among_many(tmp_path):
    values = [20 + k / 100 for k in range(3000)]
    (line,) = problems(tmp_path, f"name: a\nsweep: {{ego.distance: {[*values, 20]}}}\n")
    assert "sweep.ego.distance.3000: 20 is given twice" in line


MIX = "name: a\nsweep: {traffic.mix.truck: [0.2, 1.0]}\n"


def test_a_swept_value_means_what_it_means_when_given_alone(tmp_path):
    """Defaults of the section that it lies in stay out: of a mix, those not named are none."""
    for point, scenario in load(tmp_path, MIX).grid():
        alone = load_scenario(tmp_path / "s.yaml", point)
        assert scenario.traffic == alone.traffic
        assert {kind for kind, share in scenario.traffic.mix.model_dump().items() if share} == {"truck"}


@pytest.mark.parametrize(
    "text",
    [
        "ego: {route: {from: south}}\nsweep: {ego.route.to: [east, west]}",
        "extends: dense_left_turn\nego: {route: {from: west}}\nsweep: {ego.route.to: [east, north]}",
        "events: [{kind: hard_brake, vehicle: leader}]\n"
        "sweep: {events.0.kind: [hard_brake, stalled_vehicle]}",
        "sweep: {traffic.speed.normal.mean: [6, 8], traffic.speed.normal.std: [1]}",
        "events: [{kind: hard_brake, deceleration: {normal: [7, 1]}}]\n"
        "sweep: {events.0.deceleration.normal.0: [5, 6]}",
        "ego: {speed: {choice: [5, 8]}}\nsweep: {ego.speed.choice.0: [6, 7]}",
    ],
)
def test_what_a_file_may_sweep_has_a_grid(tmp_path, text):
    assert len(load(tmp_path, f"name: a\n{text}\n").grid()) == 2


def test_a_kept_scenario_has_the_grid_that_it_had(tmp_path):
    """As a sweep's manifest says it, which holds all values."""
    scenario = load(tmp_path, MIX)
    told = json.loads(json.dumps({"values": scenario.data(), "given": scenario.given}))
    kept = Scenario.model_validate(told["values"]).read_from(None, told["given"])
    assert [point.digest for _, point in kept.grid()] == [point.digest for _, point in scenario.grid()]


def test_a_swept_key_within_another_is_refused(tmp_path):
    found = problems(tmp_path, "name: a\nsweep: {ego.route: [random], ego.route.from: [south, west]}\n")
    assert found == [
        "2:30: sweep.ego.route.from: lies within ego.route, which is swept, too; leave one of them out"
    ]
