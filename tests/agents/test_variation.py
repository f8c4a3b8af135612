"""Settings behind agents' names: parsed, applied, and refused with a hint."""

import re

import pytest

from rudc.agents.correction import CbfSettings
from rudc.agents.registry import agent_settings, make_agent
from rudc.agents.variation import parse, split, vary
from rudc.errors import AgentError
from tests.agents.learners import small


def test_settings_stand_behind_the_last_colon():
    text = "correction.d_safe=0.3,correction.residual=off"
    assert split(f"rudc-t:{text}") == ("rudc-t", text)
    assert split("rudc-t") == ("rudc-t", "")
    assert split("out/a:b") == ("out/a:b", "")


def test_values_are_read_as_in_files():
    text = (
        "correction.residual=off, correction.slack.gain=0.02, correction.constrained=all, action.kind=direct"
    )
    assert parse(text) == {
        "correction.residual": "off",
        "correction.slack.gain": 0.02,
        "correction.constrained": "all",
        "action.kind": "direct",
    }


@pytest.mark.parametrize("off", ["off", "false"])
def test_off_is_a_word_and_switches_off(off):
    """In YAML 1.1 `off` is false; here it is what `outlook.plant` calls it, and what a switch takes."""
    varied = vary(
        small("rudc-t", correction="cbf"), parse(f"correction.residual={off},correction.last_resort={off}")
    )
    assert isinstance(varied.correction, CbfSettings)
    assert (varied.correction.residual, varied.correction.last_resort) == (False, False)
    assert make_agent("gap-acceptance:outlook.plant=off,outlook.course=on").name.startswith("gap-acceptance")
    assert parse("outlook.plant=off") == {"outlook.plant": "off"}


def test_a_learnt_agents_configuration_is_varied():
    config = small("rudc-e", correction={"kind": "cbf", "rule": "ecbf", "d_safe": 0.4, "max_vehicles": 3})
    changes = {"correction.d_safe": 0.1, "correction.residual": True, "correction.slack.gain": 0.5}
    varied = vary(config, changes).correction
    assert isinstance(varied, CbfSettings)
    written = varied.model_dump()
    assert (varied.rule, written["d_safe"], written["max_vehicles"]) == ("ecbf", 0.1, 3)
    assert (varied.residual, varied.slack.gain) == (True, 0.5)
    assert vary(config, {"correction.kind": "none"}).correction.make({}) is None
    assert config.model_dump()["correction"]["d_safe"] == 0.4


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("gap-acceptance+ttcbf:correction.d_saf=0.3", "did you mean 'correction.d_safe'"),
        ("gap-acceptance+ttcbf:correction.d_safe=much", "correction.d_safe: expected a number"),
        ("gap-acceptance+ttcbf:correction.d_safe=-1", "correction.d_safe: must be at least 0"),
        ("gap-acceptance+ttcbf:correction.constrained=some", "expected 'gated' or 'all'"),
        ("gap-acceptance+ttcbf:correction.ecbf_rate1=1", "ecbf_rate1: has no effect with rule=ttcbf"),
        ("gap-acceptance+ttcbf:correction.d_safe=1,correction.d_safe=2", "given twice"),
        ("gap-acceptance+ttcbf:correction.d_safe=[", "is not a value as in a YAML file"),
        ("gap-acceptance+ttcbf:correction.slack.gain=1", "no effect with +ttcbf: slack by sigma needs"),
        ("rudc-t+ecbf:correction.slack.gain=1", "which only its own filter has"),
        ("gap-acceptance+ttcbf:correction.rule=ecbf", "is said by +ttcbf"),
        ("gap-acceptance:correction.d_safe=1", "has no filter"),
        ("rudc-wo-cbf:correction.d_safe=1", "there is no setting 'correction.d_safe'"),
        (
            "follower+ttcbf:correction.pedroom=1",
            "'correction.pedroom' with correction.kind=cbf; a barrier of your own comes with `rudc --",
        ),
        ("rudc-t:learner.n_step=1", "give it to `rudc train --set`"),
        ("rudc-t:action.adjustment=0.5", "decides what is learnt"),
        ("rudc-t:d_safe=1", "did you mean 'correction.d_safe'"),
        ("rudc-t:filter=off", "it is called correction.kind"),
        ("rudc-t:slack_gain=0", "it is called correction.slack.gain"),
        ("rudc-t:", "agent 'rudc-t:': KEY=VALUE expected after the colon"),
        ("rudc-t:correction.d_safe", "KEY=VALUE expected after the colon"),
        ("follower+ttcbf:", "KEY=VALUE expected after the colon"),
        ("", "the name of an agent is empty"),
        ("gap-aceptance+ttcbf:correction.d_safe=1", "did you mean 'gap-acceptance+ttcbf'"),
    ],
)
def test_what_cannot_be_is_refused_with_a_hint(name, said):
    with pytest.raises(AgentError, match=re.escape(said)):
        make_agent(name)


def test_the_whole_name_stands_in_tables_and_settings_in_manifests():
    name = "follower+ttcbf:correction.d_safe=0.25,correction.constrained=all"
    assert make_agent(name).name == name
    settings = agent_settings(name)
    assert (settings["correction"]["d_safe"], settings["correction"]["constrained"]) == (0.25, "all")
    assert agent_settings("follower+ttcbf")["correction"]["d_safe"] == 0.5
