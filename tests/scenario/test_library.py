"""Finding scenarios: names, paths, patterns, and what is said when there is none."""

import pytest

from rudc.errors import ScenarioError
from rudc.scenario import find_scenarios, load_scenario, scenario_template, shipped_scenarios
from rudc.scenario.library import overlooked


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("a", "b"):
        (tmp_path / f"{name}.yaml").write_text(f"name: {name}\n")
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "c.yml").write_text("name: c\n")
    return tmp_path


def names(*patterns):
    return [scenario.name for scenario in find_scenarios(patterns)]


def test_shipped_by_name():
    assert load_scenario("dense_left_turn").name == "dense_left_turn"
    assert load_scenario(shipped_scenarios()["dense_left_turn"]).name == "dense_left_turn"


def test_files_by_path(folder):
    assert load_scenario("a.yaml").path == folder / "a.yaml"
    assert load_scenario(folder / "sub" / "c.yml").name == "c"
    (folder / "plain").write_text("name: plain\n")
    assert load_scenario("plain").name == "plain"


def test_a_name_that_begins_with_a_tilde_may_be_no_user(folder):
    (folder / "~draft.yaml").write_text("name: draft\n")
    assert load_scenario("~draft.yaml").name == "draft"
    assert names("~dra*.yaml") == ["draft"]
    with pytest.raises(ScenarioError, match=r"^~no-such-user/a\.yaml: no such file"):
        load_scenario("~no-such-user/a.yaml")


def test_the_path_of_a_file_is_no_pattern(folder):
    (folder / "runs [1]").mkdir()
    (folder / "runs [1]" / "what?*.yaml").write_text("name: odd\n")
    assert names("runs [1]/what?*.yaml") == ["odd"]


def test_what_an_editor_keeps_beside_a_shipped_scenario_is_none(tmp_path, monkeypatch):
    for name in ("fog.yaml", ".fog.yaml"):
        (tmp_path / name).write_text("name: fog\n")
    for name in (".#fog.yaml", "gone.yaml"):
        (tmp_path / name).symlink_to("user@host.1")
    monkeypatch.setattr("rudc.scenario.library.data_folder", lambda name: tmp_path)
    assert shipped_scenarios() == {"fog": tmp_path / "fog.yaml"}


def test_patterns_each_once_in_order(folder):
    assert names("b.yaml", "*.yaml", "sub/c.yml", "./a.yaml") == ["b", "a", "c"]
    assert names("**/*.y*ml")[-1:] == ["c"]
    assert names("dense_left*") == ["dense_left_turn", "dense_left_turn_plain_traffic"]
    assert names("dense_left_turn", "*left_turn*")[0] == "dense_left_turn"
    assert names("*") == list(shipped_scenarios())
    assert names() == []


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("dense_left_tunr", "no shipped scenario ..., and no such file (did you mean 'dense_left_turn'?)"),
        ("zzz", "no shipped scenario ..., and no such file; shipped ones: blind_corner, "),
        ("sub/d.yml", "sub/d.yml: no such file (did you mean 'c.yml'?)"),
        ("b.yam", "b.yam: no shipped scenario ..., and no such file (did you mean 'b.yaml'?)"),
        ("dense_left_tun.yaml", "dense_left_tun.yaml: no such file (did you mean 'dense_left_turn'?)"),
        ("n" * 300, "n: no shipped scenario ..., and no such file"),
        ("n" * 300 + "/a.yaml", "n/a.yaml: no such file"),
        ("sub", "sub: is a folder; a scenario is a file (sub/*.yaml would take all of them)"),
    ],
)  # fmt: skip
def test_what_is_not_there(folder, source, message):
    for look in (load_scenario, lambda source: find_scenarios([source])):
        with pytest.raises(ScenarioError) as caught:
            look(source)
        assert all(part in str(caught.value) for part in message.split("..."))


def test_a_network_is_no_scenario(folder):
    """Of the text of a .net.xml it said that a mapping was expected."""
    (folder / "own.net.xml").write_text("<net/>")
    with pytest.raises(
        ScenarioError, match=r"^own.net.xml: this is a network: .* `network: own.net.xml`; `rudc"
    ):
        find_scenarios(["own.net.xml"])


def test_a_pattern_of_names_says_how_files_are_meant(folder):
    (folder / "zzz_own.yaml").write_text("name: zzz_own\n")
    with pytest.raises(ScenarioError, match=r"no scenario fits this pattern; zzz\*\.yaml would take files"):
        find_scenarios(["zzz*"])


def test_a_file_with_the_name_of_a_shipped_scenario_is_told(tmp_path, monkeypatch):
    """`rudc run fog` drove the shipped one without a word."""
    monkeypatch.chdir(tmp_path)
    assert overlooked(["fog", "fog"]) == []
    (tmp_path / "fog.yaml").write_text("name: fog\nnetwork: four_way\n")
    assert len(overlooked(["fog", "fog", "icy_junction", "./fog.yaml"])) == 1


def test_everything_missing_is_said_at_once(folder):
    with pytest.raises(ScenarioError) as caught:
        find_scenarios(["nope*", "a.yaml", "no.yaml"])
    assert [line.split(":")[0] for line in str(caught.value).splitlines()] == ["nope*", "no.yaml"]


def test_problems_of_all_files_come_at_once(folder):
    for name in ("a", "b"):
        (folder / f"{name}.yaml").write_text(f"name: {name}\nego: {{sped: 1}}\n")
    with pytest.raises(ScenarioError) as caught:
        find_scenarios(["*.yaml", "sub/c.yml"])
    assert [line[:10] for line in str(caught.value).splitlines()] == ["a.yaml:2:7", "b.yaml:2:7"]


def test_two_files_of_one_name_are_refused(folder):
    (folder / "b.yaml").write_text("name: a\n")
    with pytest.raises(ScenarioError, match=r"b\.yaml: name: 'a' is also the name of a\.yaml"):
        find_scenarios(["a.yaml", "b.yaml"])


def test_template_is_a_scenario(tmp_path):
    text = scenario_template("mine")
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    scenario = load_scenario(path)
    assert (scenario.name, scenario.network) == ("mine", "four_way")
    assert [event.kind for event in scenario.events] == ["hard_brake"]
    assert 8 <= len(text.splitlines()) <= 15


def test_template_points_editors_to_a_schema_if_there_is_one():
    assert "$schema" not in scenario_template("mine")
    first = scenario_template("mine", schema="scenario.schema.json").splitlines()[0]
    assert first == "# yaml-language-server: $schema=scenario.schema.json"


def test_a_name_is_short_enough_for_a_file():
    """A search drove all its episodes, and could not write what it had found."""
    assert load_scenario("fog", {"name": "n" * 100}).name == "n" * 100
    with pytest.raises(ScenarioError, match="at most 100 characters"):
        load_scenario("fog", {"name": "n" * 101})
