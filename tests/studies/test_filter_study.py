"""The filter study: which variants there are, and how their episodes are put together."""

import math

import pytest

from rudc.agents.checkpoint import load_learnt, save_learnt
from rudc.agents.registry import agent_settings, make_agent
from rudc.agents.route_sigma import ROUTE, fit
from rudc.errors import AgentError, InputError
from rudc.evaluation.sweep import Silent
from rudc.studies.base import Order
from rudc.studies.filter_pairs import compare, pairs, pairs_markdown
from rudc.studies.filter_study import INSIDE, OUTSIDE, aggregate, as_markdown, run
from rudc.studies.filter_variants import LEVELS, RATES, Variant, variants_of
from tests.agents.test_route_sigma import drives

ALWAYS = 1 + 2 * (len(LEVELS) + len(RATES))
"""off, and the constants, of an agent that states sigma"""


def test_full_grid_of_a_trained_agent(trained):
    variants = variants_of(str(trained), (0.1, 0.3, 0.5, 0.8))
    assert len(variants) == len({v.agent for v in variants}) == ALWAYS + 40
    assert len({v.setting for v in variants}) == ALWAYS + 40
    paper = [v for v in variants[1:] if " " not in v.kind]
    found = {(v.kind, v.constrained, v.d_safe): agent_settings(v.agent)["correction"] for v in paper}
    assert agent_settings(variants[0].agent)["correction"] == {"kind": "none"}
    for (kind, constrained, d_safe), settings in found.items():
        assert settings["residual"] is (kind in ("residual", "both", "last_resort"))
        assert settings["slack"]["gain"] == (0.4 if kind in ("slack", "both", "last_resort") else 0.0)
        assert (settings["constrained"], settings["d_safe"]) == (constrained, d_safe)
        assert settings["last_resort"] is (kind == "last_resort")


def test_settings_given_are_kept_and_the_slacks_gain_is_taken(trained):
    variants = variants_of(f"{trained}:correction.slack.gain=0.2,correction.ttcbf_rate=0.2", (0.5,))
    assert len(variants) == ALWAYS + 10
    for variant in variants[1:]:
        settings = agent_settings(variant.agent)["correction"]
        assert settings["ttcbf_rate"] == 0.2
        assert settings["slack"]["gain"] == (0.2 if variant.kind in ("slack", "both", "last_resort") else 0.0)


def test_slack_by_route_and_constants_are_tried_at_the_agents_own_d_safe(trained):
    learnt = load_learnt(trained)
    usual = {f"{ROUTE}/{name}": value for name, value in fit(drives(3)).items()}
    save_learnt(trained, learnt._replace(arrays=learnt.arrays | usual))
    variants = [v for v in variants_of(str(trained), (0.1, 0.8)) if v.kind in ("level_route", "rate_route")]
    assert {(v.kind, v.constrained, v.d_safe) for v in variants} == {
        (kind, constrained, 0.5) for kind in ("level_route", "rate_route") for constrained in ("gated", "all")
    }
    for variant in variants:
        settings = agent_settings(variant.agent)
        slack = settings["correction"]["slack"]
        assert (settings["sigma"], slack["gain"]) == ("route", 0.4)
        assert slack["kind"] == variant.kind.removesuffix("_route")
    (constant,) = [v for v in variants_of(str(trained), ()) if (v.kind, v.constrained) == ("rate 0.5", "all")]
    slack = agent_settings(constant.agent)["correction"]["slack"]
    assert slack == {"kind": "rate", "gain": 0.0, "constant": 0.5}


def test_slack_of_the_agent_is_tried_at_its_own_d_safe_too(trained):
    """There the others are driven that it is compared with."""
    for distances, expected in (((0.1, 0.8), [0.1, 0.8, 0.5]), ((0.5, 0.8), [0.5, 0.8])):
        variants = variants_of(str(trained), distances)
        tried = [v.d_safe for v in variants if (v.kind, v.constrained) == ("both", "all")]
        assert tried == expected


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
    ("name", "off"),
    [
        ("gap-acceptance+ttcbf:outlook.plant=estimated", "gap-acceptance:outlook.plant=estimated"),
        (
            "gap-acceptance+ttcbf:correction.d_safe=0.4,outlook.course=true",
            "gap-acceptance:outlook.course=true",
        ),
        ("examples/own_agent.py:Patient(speed=3)+ttcbf", "examples/own_agent.py:Patient(speed=3)"),
        (
            "rudc-t:outlook.course=false,correction.ttcbf_rate=0.2",
            "rudc-t:outlook.course=false,correction.kind=none",
        ),
    ],
)
def test_without_its_filter_the_driver_is_the_same(name, off):
    """What is set besides the filter is set in every variant, so that none but the filter differs."""
    variants = variants_of(name, (0.3,))
    assert variants[0].agent == off
    assert len({str(agent_settings(v.agent)["outlook"]) for v in variants}) == 1


@pytest.mark.parametrize(
    ("name", "error", "text"),
    [
        ("gap-acceptance", InputError, "no safety filter"),
        ("rudc-wo-cbf", InputError, r"rudc-wo-cbf\+ttcbf"),
        ("gap-acceptance+ttcbf:correction.constrained=all", InputError, "constrained; leave that out"),
        ("rudc-t:correction.slack.constant=4", InputError, "slack.constant; leave that out"),
        ("gap-acceptance+ttcbf:correction.d_safe=near", AgentError, "d_safe"),
        ("nobody", AgentError, "no agent"),
    ],
)
def test_what_cannot_be_varied_is_refused(name, error, text):
    with pytest.raises(error, match=text):
        variants_of(name, (0.3,))


def test_agents_that_are_one_without_their_filters_are_refused_together(tmp_path):
    order = Order(tmp_path / "x", agents=("gap-acceptance+ttcbf", "gap-acceptance+ecbf"), budget="quick")
    with pytest.raises(InputError, match=r"the variant gap-acceptance in common.*one by one"):
        run(order, lambda _: Silent())
    assert not order.out.exists()


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
        variant
        for name in ("a", "a-seed1")
        for variant in (
            Variant(f"{name}:off", name, "a", "off"),
            Variant(f"{name}:fixed", name, "a", "fixed", "gated", 0.3),
        )
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
    assert "mean correction" not in text, "off has none by definition, and it counts more than the filter's"
    assert "| out of distribution | gated       | fixed   |" in text


def test_the_oracle_has_no_filter_where_that_succeeds():
    variants = [
        Variant("a:off", "a", "a", "off"),
        Variant("a:w", "a", "a", "residual", "all", 0.5),
    ]
    rows = [
        row("a:off", 0, "success"), row("a:w", 0, "frozen"),
        row("a:off", 1, "violation"), row("a:w", 1, "success"),
        row("a:off", 2, "violation"), row("a:w", 2, "frozen"),
    ]  # fmt: skip
    lines = {(m["variant"], m["scenario"]): m for m in aggregate({INSIDE: rows}, variants)}
    best = lines["oracle", "all"]
    assert (best["SR"], best["FR"], best["VR"]) == pytest.approx((200 / 3, 100 / 3, 0.0))
    assert (best["constrained"], best["d_safe_m"], best["episodes"]) == ("all", 0.5, 3)


def test_an_adaptive_variant_is_compared_with_each_constant_in_the_same_episodes():
    kinds = ("both", "residual", "level 4")
    variants = [Variant(f"a:{kind}", "a", "a", kind, "all", 0.5) for kind in kinds]
    rows = [row(f"a:{kind}", k, "success") | {"mean_speed_mps": "6"} for kind in kinds for k in range(30)]
    for k in range(20):
        rows[30 + k]["outcome"] = "frozen"  # residual
    rows[60]["error"] = "no"
    lines = pairs({INSIDE: rows}, variants)
    assert [(m["adaptive"], m["constant"], m["episodes"]) for m in lines] == [
        ("both", "residual", 30),
        ("both", "level 4", 29),
    ]
    first, second = lines
    assert first["FR_change"] == pytest.approx(-200 / 3)
    assert first["FR_high"] < 0
    assert (first["speed_change"], first["speed_low"], first["VR_change"]) == (0.0, 0.0, 0.0)
    assert (first["dominates"], second["dominates"]) == (True, False)
    worse = {("a", "fog", str(k)): row("a", k, "violation") | {"mean_speed_mps": "7"} for k in range(3)}
    assert not compare(worse, {key: {**r, "outcome": "frozen"} for key, r in worse.items()})["dominates"]
    heading, _, first_line, _ = pairs_markdown(lines).splitlines()
    assert "| VR change (points) |" in heading
    assert first_line.split("|")[6].strip() == "0.5", "d_safe tells rows apart"
