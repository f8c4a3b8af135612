"""What a folder says that holds another sweep, or rows of several versions, and how it is written."""

import json
from pathlib import Path

import pytest

from rudc.errors import SweepError
from rudc.evaluation.folder import read_sweep
from rudc.evaluation.manifest import as_json, resumed, version_changes
from rudc.evaluation.sweep import run_sweep


def _manifest(**agents):
    configuration = {"scenarios": {"a": {"values": {"x": 1}}}, "agents": agents, "episodes": 2, "seed": 0}
    return {"configuration": configuration, "versions": {"rudc": "1"}}


def test_a_manifest_has_one_line_for_each_scenario_and_agent():
    made = _manifest(one={"filter": {"rate": 0.5}}, other={}) | {"none": {}}
    text = as_json(made)
    assert json.loads(text) == made
    starts = [line.split(":")[0].strip(' {}",') for line in text.splitlines()]
    outer = "configuration scenarios a agents one other episodes seed versions rudc none"
    assert [name for name in starts if name] == outer.split()


def test_agents_of_one_side_are_named_and_not_listed_setting_by_setting():
    there = _manifest(both={"speed": 3}, gone={"speed": 1, "more": {"many": 2}})
    here = _manifest(both={"speed": 4}, come={"speed": 1})
    with pytest.raises(SweepError) as caught:
        resumed(there, here, Path("out"))
    assert str(caught.value).splitlines()[1:-1] == [
        "  agents: gone only there",
        "  agents: come only here",
        "  agents.both.speed: 3 there, 4 here",
    ]


def test_the_same_agents_in_another_number_are_another_sweep():
    with pytest.raises(SweepError, match="agents: more only here"):
        resumed(_manifest(one={}), _manifest(one={}, more={}), Path("out"))
    assert resumed(_manifest(one={}), _manifest(one={}), Path("out")) == _manifest(one={})


def _on_network(path, digest):
    made = _manifest(one={})
    made["configuration"]["scenarios"]["a"] = {"digest": digest, "values": {"network": path}}
    return made


def test_a_network_may_lie_elsewhere_now_but_is_the_same():
    there = _on_network("/before/own.net.xml", "12ab")
    assert resumed(there, _on_network("/now/own.net.xml", "12ab"), Path("out")) == there
    with pytest.raises(SweepError, match=r'digest: what is in "/now/own\.net\.xml" has changed'):
        resumed(there, _on_network("/now/own.net.xml", "34cd"), Path("out"))
    with pytest.raises(SweepError, match=r'digest: what is in "/before/own\.net\.xml" has changed'):
        resumed(there, _on_network("/before/own.net.xml", "34cd"), Path("out"))


def test_where_something_else_differs_it_is_not_told_where_a_network_lies_now():
    there, here = _on_network("/before/own.net.xml", "12ab"), _on_network("/now/own.net.xml", "34cd")
    here["configuration"]["scenarios"]["a"]["values"]["traffic"] = {"density": 30}
    with pytest.raises(SweepError, match=r"traffic\.density: absent there, 30 here") as caught:
        resumed(there, here, Path("out"))
    assert "own.net.xml" not in str(caught.value)


def test_each_change_of_versions_is_told_once():
    """Also one that was taken back later; a package that was not asked for at first has not changed."""
    known = {**_manifest(one={}), "versions": {"code": "a", "numpy": "1"}}
    assert version_changes(known) == []
    later = [
        {"code": "b", "numpy": "1"},
        {"code": "a", "numpy": "2"},
        {"code": "b", "numpy": "2", "new": "1"},
        {"code": "a", "numpy": "1", "new": "1"},
    ]
    assert version_changes({**known, "resumed_with": later}) == [
        "code a -> b",
        "code b -> a",
        "numpy 1 -> 2",
        "numpy 2 -> 1",
    ]


def test_a_digest_that_is_no_scenario_s_is_told_like_any_other_value():
    """Code of a plug-in with a module of that name had changed."""
    there, here = _manifest(one={}), _manifest(one={})
    for made, digest in ((there, "12ab"), (here, "34cd")):
        made["configuration"]["plugins"] = {"mine": {"mine.digest": digest}}
    with pytest.raises(SweepError, match=r'plugins\.mine\.mine\.digest: "12ab" there, "34cd" here'):
        resumed(there, here, Path("out"))


def test_a_folder_may_be_given_as_text(fakes, make_plan, tmp_path):
    rows = run_sweep(make_plan(episodes=1), str(tmp_path / "out"), fakes.Runner).rows
    assert read_sweep(str(tmp_path / "out"))[0] == rows
