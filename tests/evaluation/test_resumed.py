"""What a folder says that holds another sweep."""

from pathlib import Path

import pytest

from rudc.errors import SweepError
from rudc.evaluation.manifest import resumed


def _manifest(**agents):
    configuration = {"scenarios": {"a": {"values": {"x": 1}}}, "agents": agents, "episodes": 2, "seed": 0}
    return {"configuration": configuration, "versions": {"rudc": "1"}}


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
