"""`extends`: what is inherited, what is replaced, what differs, and where problems are laid."""

import textwrap
from typing import get_origin

import pytest

from rudc.errors import ScenarioError
from rudc.scenario import find_scenarios, load_scenario
from rudc.scenario.base import FileModel
from rudc.scenario.inheritance import SECTIONS
from rudc.scenario.model import Scenario

PARENT = """
    name: parent
    description: The parent.
    out_of_distribution: It is rare.
    ego:
      route: {from: south, turn: left}
      speed: {uniform: [6, 10]}
    traffic:
      density: 30
      mix: {car: 0.5, truck: 0.5}
      idm: {headway: 2}
    events:
      - {kind: low_friction, friction: 0.5}
      - {kind: hard_brake}
    sweep: {traffic.density: [10, 20]}
    """


@pytest.fixture
def write(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def put(name: str, text: str) -> str:
        (tmp_path / name).write_text(textwrap.dedent(text).lstrip("\n"))
        return name

    put("parent.yaml", PARENT)
    return put


def test_values_not_given_are_the_parents(write):
    child = load_scenario(write("child.yaml", "name: child\nextends: parent\n"))
    parent = load_scenario("parent.yaml")
    assert (child.ego, child.traffic, child.events, child.sweep) == (
        parent.ego,
        parent.traffic,
        parent.events,
        parent.sweep,
    )


def test_a_name_that_reads_as_a_number_is_a_name(write):
    write("2024.yaml", "name: '2024'\ntraffic: {density: 40}\n")
    child = load_scenario(write("child.yaml", "name: child\nextends: 2024\n"))
    assert float(child.traffic.density) == 40


def test_name_and_remarks_are_its_own(write):
    child = load_scenario(write("child.yaml", "name: child\nextends: parent\n"))
    assert (child.name, child.description, child.out_of_distribution) == ("child", "", None)
    with pytest.raises(ScenarioError, match=r"nameless\.yaml:1:1: name: is missing"):
        load_scenario(write("nameless.yaml", "extends: parent\n"))


def test_sections_merge_and_values_are_replaced_whole(write):
    child = load_scenario(
        write(
            "child.yaml",
            """
            name: child
            extends: parent
            ego:
              route: {from: A, to: B}
              speed: {normal: [8, 1]}
            traffic:
              density: 30
              mix: {bus: 1}
              idm: {min_gap: 3}
            events: [{kind: hard_brake}]
            """,
        )
    )
    assert (child.ego.route.origin, child.ego.route.to, child.ego.route.turn) == ("A", "B", "random")
    assert child.ego.speed.mean == pytest.approx(8)
    assert child.plan(0).traffic.mix == {"bus": 1.0}
    assert (float(child.traffic.idm.headway), float(child.traffic.idm.min_gap)) == (2, 3)
    assert [event.kind for event in child.events] == ["hard_brake"]


def test_an_empty_value_takes_back_the_parents(write):
    child = load_scenario(
        write("child.yaml", "name: child\nextends: parent\nsweep:\nevents: null\ntraffic: {density: ~}\n")
    )
    assert child.sweep == {}
    assert child.events == ()
    assert float(child.traffic.density) == 20


def test_an_empty_value_given_takes_back_the_files(write):
    path = write("child.yaml", "name: child\nextends: parent\njunction: J5\nego: {route: {turn: left}}\n")
    taken = ["junction", "sweep", "traffic.density", "events", "ego.route.turn"]
    (child,) = find_scenarios([str(path)], overrides=dict.fromkeys(taken))
    assert (child.junction, child.sweep, child.events) == (None, {}, ())
    assert (float(child.traffic.density), child.ego.route.turn) == (20, "random")
    for key in ("traffic.impatienc", "trafic.impatience", "ego.route.via"):
        with pytest.raises(ScenarioError, match=rf"override: {key}: no value given; without"):
            load_scenario(path, {key: None})
    with pytest.raises(ScenarioError, match="override: name: is missing, and it is required"):
        load_scenario(path, {"name": None})


def test_an_empty_value_given_takes_back_what_the_file_only_sweeps(write):
    path = write("swept.yaml", "name: swept\nsweep: {ego.speed: [5, 6], traffic.density: [10, 20]}\n")
    scenario = load_scenario(path, {"ego.speed": None})
    assert [*scenario.sweep] == ["traffic.density"]
    assert scenario.ego == Scenario(name="plain").ego


def test_an_empty_value_given_leaves_files_that_say_nothing_there(write):
    write("plain.yaml", "name: plain\n")
    write("swept.yaml", "name: swept\nsweep: {ego.speed: [5, 6], traffic.density: [10, 20]}\n")
    taken = ["events", "ego.route.turn", "ego", "traffic.mix.truck"]
    parent, plain, swept = find_scenarios(["[ps]*.yaml"], overrides=dict.fromkeys(taken))
    assert parent.events == ()
    assert plain.digest == load_scenario("plain.yaml").digest
    assert [*swept.sweep] == ["traffic.density"]
    assert all(scenario.ego == plain.ego for scenario in (parent, swept))


def test_a_value_for_what_the_parent_sweeps_ends_that_sweep(write):
    write("wide.yaml", "name: wide\nsweep: {traffic.density: [10, 20], ego.speed: [5, 6]}\n")
    scenario = load_scenario(write("child.yaml", "name: child\nextends: wide\ntraffic: {density: 33}\n"))
    assert [(point, varied.traffic.density.support[0]) for point, varied in scenario.grid()] == [
        ({"ego.speed": 5}, 33),
        ({"ego.speed": 6}, 33),
    ]
    own = "name: own\nextends: wide\ntraffic: {density: 33}\nsweep: {traffic.density: [40]}\n"
    assert load_scenario(write("own.yaml", own)).points() == [{"traffic.density": 40}]


@pytest.mark.parametrize(
    ("swept", "child"),
    [
        ("traffic.mix.truck: [0, 1]", "traffic: {mix: {car: 1}}"),
        ("events.0.friction: [0.3, 0.5]", "events: [{kind: hard_brake}]"),
        ("events.0.friction: [0.3, 0.5]", "events:"),
        ("ego.route.turn: [left, right]", "ego: {route: random}"),
        ("ego.route.turn: [left, right]", "ego: {route: {from: A, to: B}}"),
        ("traffic.density: [10, 20]", "traffic: {density: ~}"),
        ("traffic.idm.headway: [1, 2]", "traffic: {idm: ~}"),
    ],
)  # fmt: skip
def test_a_value_for_the_whole_ends_sweeps_of_its_parts(write, swept, child):
    text = PARENT.replace("traffic.density: [10, 20]", f"{swept}, ego.distance: [30, 40]")
    write("wide.yaml", text)
    scenario = load_scenario(write("child.yaml", f"name: child\nextends: wide\n{child}\n"))
    assert scenario.points() == [{"ego.distance": 30}, {"ego.distance": 40}]


def test_a_value_beside_what_the_parent_sweeps_leaves_that_sweep(write):
    child = load_scenario(
        write("child.yaml", "name: child\nextends: parent\ntraffic: {mix: {bus: 1}, idm: {headway: 1}}\n")
    )
    assert child.points() == [{"traffic.density": 10}, {"traffic.density": 20}]


def test_generations(write):
    write("child.yaml", "name: child\nextends: parent\ntraffic: {density: 40}\n")
    grandchild = load_scenario(
        write("grandchild.yaml", "name: g\nextends: child.yaml\nepisode: {timeout: 9}\n")
    )
    assert float(grandchild.traffic.density) == 40
    assert float(grandchild.traffic.idm.headway) == 2
    assert float(grandchild.episode.timeout) == 9
    assert grandchild.extends == "child.yaml"


def test_a_sibling_comes_before_a_shipped_one(write):
    write("random_destination.yaml", "name: mine\nepisode: {timeout: 9}\n")
    child = load_scenario(write("child.yaml", "name: child\nextends: random_destination\n"))
    assert float(child.episode.timeout) == 9


def test_a_file_that_is_named_like_the_shipped_one_it_extends(write):
    text = "name: mine\nextends: random_destination\nepisode: {timeout: 9}\n"
    child = load_scenario(write("random_destination.yaml", text))
    assert float(child.episode.timeout) == 9
    assert child.ego == load_scenario("random_destination").ego


def test_problems_of_the_parent_are_laid_on_the_parent(write):
    write("bad.yaml", "name: bad\nego:\n  speed: -1\n  distance: -2\ntraffic: {densty: 3}\n")
    with pytest.raises(ScenarioError) as caught:
        load_scenario(write("child.yaml", "name: child\nextends: bad\nego: {distance: 30, destination: 0}\n"))
    assert str(caught.value).splitlines() == [
        "child.yaml:3:34: ego.destination: 0 m is not above 0 and at most 1000 m",
        "bad.yaml:3:10: ego.speed: -1 m/s is not between 0 and 40 m/s",
        "bad.yaml:5:11: traffic.densty: unknown key (did you mean 'density'?)",
    ]


def test_a_parent_that_cannot_be_read_hides_no_problem_of_the_child(write):
    write("bad.yaml", "name: bad\nego: {speed: 3\n")
    with pytest.raises(ScenarioError) as caught:
        load_scenario(write("child.yaml", "name: child\nextends: bad\nego: {sped: 3}\n"))
    bad, child = sorted(str(caught.value).splitlines())
    assert bad.startswith("bad.yaml:3:1: not valid YAML")
    assert child == "child.yaml:3:7: ego.sped: unknown key (did you mean 'speed'?)"


@pytest.mark.parametrize(
    ("extends", "message"),
    [
        ("parnt", "child.yaml:2:10: extends: no scenario 'parnt' beside ... (did you mean 'parent'?)"),
        ("dense_left_tunr", "child.yaml:2:10: extends: ... none shipped (did you mean 'dense_left_turn'?)"),
        ("n" * 300, "child.yaml:2:10: extends: no scenario ...nnn' beside this file, and none shipped"),
        ("child", "child.yaml:2:10: extends: the file extends itself; ... beside it, and none shipped"),
        ("one", "two.yaml:2:10: extends: goes round in a circle: one.yaml -> two.yaml -> one.yaml"),
        ("[a]", "child.yaml:2:10: extends: expected text, got a list"),
    ],
)  # fmt: skip
def test_parents_that_are_none(write, extends, message):
    write("one.yaml", "name: one\nextends: two\n")
    write("two.yaml", "name: two\nextends: one\n")
    write("childs.yaml", "name: childs\n")
    with pytest.raises(ScenarioError) as caught:
        load_scenario(write("child.yaml", f"name: child\nextends: {extends}\n"))
    start, _, end = message.partition("...")
    assert str(caught.value).startswith(start)
    assert str(caught.value).endswith(end)


def test_paths_to_networks_are_seen_from_the_file_that_names_them(write, tmp_path):
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "own.net.xml").write_text("<net/>")
    write("sub/base.yaml", "name: base\nnetwork: own.net.xml\n")
    child = load_scenario(write("child.yaml", "name: child\nextends: sub/base.yaml\n"))
    assert child.network == str(tmp_path / "sub" / "own.net.xml")
    with pytest.raises(ScenarioError, match=r"own\.yaml:2:10: network: no such file"):
        load_scenario(write("own.yaml", "name: own\nnetwork: own.net.xml\n"))


def test_sections_are_sections():
    for path in SECTIONS:
        model: type = Scenario
        for key in path:
            model = model.model_fields[key].annotation
            assert get_origin(model) is dict or issubclass(model, FileModel)


def test_a_part_given_ends_the_files_sweep_of_the_whole(tmp_path):
    (tmp_path / "x.yaml").write_text(
        "name: x\nsweep: {traffic.density: [10, 20], episode.timeout: [30, 40]}\n"
    )
    (scenario,) = find_scenarios([str(tmp_path / "x.yaml")], overrides={"traffic.density.uniform": [12, 15]})
    assert [*scenario.points()] == [{"episode.timeout": 30}, {"episode.timeout": 40}]
    assert scenario.model_dump(mode="json")["traffic"]["density"] == {"uniform": [12, 15]}


@pytest.mark.parametrize("order", [1, -1], ids=["before", "after"])
def test_a_part_of_what_is_swept_cannot_be_given_too(order):
    given = [("traffic.density", [10, 20]), ("traffic.density.uniform", [30, 40])][::order]
    with pytest.raises(ScenarioError, match=r"traffic.density.uniform: lies within traffic.density, which"):
        find_scenarios(["random_destination"], overrides=dict(given))
