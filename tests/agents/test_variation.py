"""Settings behind agents' names: parsed, applied, and refused with a hint."""

import re

import pytest

from rudc.agents.algorithms import DriverConfig
from rudc.agents.registry import agent_settings, make_agent
from rudc.agents.variation import parse, split, vary
from rudc.errors import AgentError


def test_settings_stand_behind_the_last_colon():
    assert split("rudc-t:d_safe=0.3,residual=off") == ("rudc-t", "d_safe=0.3,residual=off")
    assert split("rudc-t") == ("rudc-t", "")
    assert split("out/a:b") == ("out/a:b", "")


def test_values_have_the_type_of_their_setting():
    text = "filter=on, residual=off, slack_gain=0.02, constrained=all, max_vehicles=5, d_safe=0.3, road=off"
    assert parse(text, learnt=True) == {
        "filter": True,
        "residual": False,
        "slack_gain": 0.02,
        "constrained": "all",
        "max_vehicles": 5,
        "d_safe": 0.3,
        "road": False,
    }


def test_a_learnt_agents_configuration_is_varied():
    config = DriverConfig(algorithm="rudc-e", filter_settings={"d_safe": 0.4, "road": False})
    varied = vary(config, {"d_safe": 0.1, "residual": True, "slack_gain": 0.5})
    assert varied.filter_settings == {"d_safe": 0.1, "road": False}
    assert (varied.residual, varied.slack_gain) == (True, 0.5)
    assert varied.filter is not None
    assert (varied.filter.rule, varied.filter.d_safe) == ("ecbf", 0.1)
    assert vary(config, {"filter": False}).filter is None
    assert config.filter_settings["d_safe"] == 0.4


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("gap-acceptance+ttcbf:d_saf=0.3", "did you mean 'd_safe'"),
        ("gap-acceptance+ttcbf:d_safe=much", "correction.d_safe: Input should be a valid number"),
        ("gap-acceptance+ttcbf:d_safe=-1", "correction.d_safe: Input should be greater than or equal to 0"),
        ("gap-acceptance+ttcbf:constrained=some", "correction.constrained: Input should be 'gated' or 'all'"),
        ("gap-acceptance+ttcbf:road=perhaps", "correction.road: Input should be a valid boolean"),
        ("gap-acceptance+ttcbf:max_vehicles=2.5", "correction.max_vehicles: Input should be a valid integer"),
        ("gap-acceptance+ttcbf:d_safe=1,d_safe=2", "given twice"),
        ("gap-acceptance+ttcbf:slack_gain=1", "no setting 'slack_gain'"),
        ("gap-acceptance:d_safe=1", "has no filter"),
        ("rudc-wo-cbf:slack_gain=1", "slack_gain needs a filter"),
        ("gap-aceptance+ttcbf:d_safe=1", "did you mean 'gap-acceptance+ttcbf'"),
    ],
)
def test_what_cannot_be_is_refused_with_a_hint(name, said):
    with pytest.raises(AgentError, match=re.escape(said)):
        make_agent(name)


def test_the_whole_name_stands_in_tables_and_settings_in_manifests():
    name = "follower+ttcbf:d_safe=0.25,constrained=all"
    assert make_agent(name).name == name
    settings = agent_settings(name)
    assert (settings["correction"]["d_safe"], settings["correction"]["constrained"]) == (0.25, "all")
    assert agent_settings("follower+ttcbf")["correction"]["d_safe"] == 0.5
