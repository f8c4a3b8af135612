"""The filter study: which variants there are, and how their episodes are put together."""

import math

import pytest

from rudc.agents.registry import agent_settings, make_agent
from rudc.errors import AgentError, InputError
from rudc.studies.filter_study import (
    INSIDE,
    OUTSIDE,
    Variant,
    aggregate,
    as_markdown,
    variants_of,
)


def test_full_grid_of_a_trained_agent(trained):
    variants = variants_of(str(trained), (0.1, 0.3, 0.5, 0.8))
    assert len(variants) == len({v.agent for v in variants}) == 41
    assert len({v.setting for v in variants}) == 41
    found = {(v.kind, v.constrained, v.d_safe): agent_settings(v.agent)["correction"] for v in variants[1:]}
    assert agent_settings(variants[0].agent)["correction"] == {"kind": "none"}
    for (kind, constrained, d_safe), settings in found.items():
        assert settings["residual"] is (kind in ("residual", "both", "last_resort"))
        assert settings["slack"]["gain"] == (0.4 if kind in ("slack", "both", "last_resort") else 0.0)
        assert (settings["constrained"], settings["d_safe"]) == (constrained, d_safe)
        assert settings["last_resort"] is (kind == "last_resort")


def test_settings_given_are_kept_and_the_slacks_gain_is_taken(trained):
    variants = variants_of(f"{trained}:correction.slack.gain=0.2,correction.ttcbf_rate=0.2", (0.3,))
    assert len(variants) == 11
    for variant in variants[1:]:
        settings = agent_settings(variant.agent)["correction"]
        assert settings["ttcbf_rate"] == 0.2
        assert settings["slack"]["gain"] == (0.2 if variant.kind in ("slack", "both", "last_resort") else 0.0)


def test_a_distance_in_the_name_is_the_only_one():
    variants = variants_of("gap-acceptance+ttcbf:correction.d_safe=0.4", (0.1, 0.8))
    assert [v.kind for v in variants] == ["off", "fixed", "residual", "fixed", "residual"]
    for variant in variants[1:]:
        assert variant.d_safe == 0.4
        assert agent_settings(variant.agent)["correction"]["d_safe"] == 0.4


def test_a_filter_behind_a_driver_has_no_slack():
    variants = variants_of("gap-acceptance+ttcbf", (0.3,))
    assert [v.kind for v in variants] == ["off", "fixed", "residual", "fixed", "residual"]
    assert variants[0].agent == "gap-acceptance"
    for variant in variants:
        make_agent(variant.agent)


@pytest.mark.parametrize(
    ("name", "error", "text"),
    [
        ("gap-acceptance", InputError, "no safety filter"),
        ("rudc-wo-cbf", InputError, r"rudc-wo-cbf\+ttcbf"),
        ("gap-acceptance+ttcbf:correction.constrained=all", InputError, "constrained; leave that out"),
        ("gap-acceptance+ttcbf:correction.d_safe=near", AgentError, "d_safe"),
        ("nobody", AgentError, "no agent"),
    ],
)
def test_what_cannot_be_varied_is_refused(name, error, text):
    with pytest.raises(error, match=text):
        variants_of(name, (0.3,))


def row(
    agent: str,
    seed: int,
    outcome: str,
    *,
    scenario: str = "fog",
    steps: int = 10,
    busy: int = 0,
    error: str = "",
):
    """A row of episodes.csv."""
    outcome = "collision" if outcome == "violation" else outcome
    return {
        "agent": agent, "scenario": scenario, "seed": str(seed), "outcome": outcome, "steps": str(steps),
        "interventions": str(busy), "engaged_steps": str(2 * busy), "mean_correction": str(0.1 * bool(busy)),
        "infeasible_steps": str(busy // 2), "error": error,
    }  # fmt: skip


def variants_of_two_seeds() -> list[Variant]:
    return [
        Variant(f"{name}:{kind}", name, "a", kind, *(() if kind == "off" else ("gated", 0.3)))
        for name in ("a", "a-seed1")
        for kind in ("off", "fixed")
    ]


def test_training_seeds_are_pooled_and_episodes_compared_in_pairs():
    rows = [
        row("a:off", 0, "violation"), row("a:off", 1, "success"),
        row("a:fixed", 0, "success", steps=30, busy=6), row("a:fixed", 1, "success"),
        row("a-seed1:off", 0, "violation"), row("a-seed1:off", 1, "violation"),
        row("a-seed1:fixed", 0, "frozen"), row("a-seed1:fixed", 1, "", error="no"),
    ]  # fmt: skip
    lines = aggregate({INSIDE: [], OUTSIDE: rows}, variants_of_two_seeds())
    pooled = [line for line in lines if line["scenario"] == "all"]
    assert [(line["variant"], line["episodes"], line["errors"]) for line in pooled] == [
        ("off", 4, 0),
        ("fixed", 3, 1),
    ]
    off, fixed = pooled
    assert (off["VR"], off["VR_least_seed"], off["VR_largest_seed"]) == (75.0, 50.0, 100.0)
    assert math.isnan(off["VR_change"])
    assert off["training_seeds"] == 2
    assert (fixed["SR"], fixed["FR"]) == pytest.approx((200 / 3, 100 / 3))
    assert fixed["VR_change"] == pytest.approx(-200 / 3)
    assert fixed["FR_change"] == pytest.approx(100 / 3)
    assert fixed["interventions_percent"] == pytest.approx(100 * 6 / 50)
    assert fixed["engaged_percent"] == pytest.approx(100 * 12 / 50)
    assert fixed["mean_correction"] == pytest.approx(0.1 * 30 / 50)
    assert fixed["infeasible_steps"] == 3
    assert [line["scenario"] for line in lines] == ["all", "all", "fog", "fog"]
    text = as_markdown(lines)
    assert len(text.splitlines()) == 4
    assert "| out of distribution | gated       | fixed   |" in text
