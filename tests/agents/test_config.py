"""How a learnt agent's settings fit together."""

from typing import Literal

import pytest
from pydantic import ValidationError

from rudc.agents.config import AgentConfig, observation_layout
from rudc.agents.correction import CbfSettings
from rudc.env.observation import observation_size
from rudc.learning.algorithms import LagrangianConfig
from rudc.learning.config import EnsembleConfig
from rudc.settings import changed
from tests.agents.learners import small


@pytest.mark.parametrize("kind", ["paper", "conflict"])
def test_layout_is_that_of_the_observation(kind: Literal["paper", "conflict"]):
    assert observation_layout(kind).size == observation_size(kind)
    problem = small(observation=kind).problem(seed=3)
    assert (problem.layout.size, problem.actions, problem.seed) == (observation_size(kind), 2, 3)


def test_the_learner_has_its_algorithms_settings():
    assert type(AgentConfig(algorithm="rudc-t").learner) is EnsembleConfig
    assert type(AgentConfig(algorithm="sac-lagrangian").learner) is LagrangianConfig
    values = {"algorithm": "sac-lagrangian", "learner": {"cost_limit": 0.5}}
    config = AgentConfig.model_validate(values)
    assert AgentConfig.model_validate_json(config.model_dump_json()) == config
    assert config.model_dump()["learner"]["cost_limit"] == 0.5
    with pytest.raises(ValidationError, match=r"learner\.members"):
        AgentConfig.model_validate({"algorithm": "sac", "learner": {"members": 3}})
    with pytest.raises(ValidationError, match="there is no algorithm 'sak'"):
        AgentConfig.model_validate({"algorithm": "sak"})


def test_what_follows_from_other_settings_is_not_stored():
    stored = small().model_dump_json()
    for derived in ("layout", "seed", "actions", "schedule", "embedding", "learns_from"):
        assert f'"{derived}"' not in stored


def test_a_slack_needs_critics_that_say_how_sure_they_are():
    with pytest.raises(ValidationError, match="those of 'sac' do not say"):
        AgentConfig.model_validate(
            {"algorithm": "sac", "correction": {"kind": "cbf", "slack": {"gain": 0.1}}}
        )


def test_another_kind_brings_its_own_settings():
    config = small("rudc-t", correction={"kind": "cbf", "d_safe": 0.3, "ttcbf_rate": 0.2})
    assert changed(config, {"correction.kind": "none"}, "x").model_dump()["correction"] == {"kind": "none"}
    back = changed(config, {"correction.kind": "cbf"}, "x").correction
    assert isinstance(back, CbfSettings)
    assert back.model_dump()["d_safe"] == 0.3
    other = changed(config, {"correction.rule": "ecbf"}, "x").correction  # its rate is forgotten
    written = other.model_dump()
    assert (written["rule"], written["d_safe"]) == ("ecbf", 0.3)
    assert "ttcbf_rate" not in written
    again = changed(changed(config, {"correction.rule": "ecbf"}, "x"), {"correction.rule": "ttcbf"}, "x")
    assert again.correction.model_dump()["ttcbf_rate"] == 0.1
