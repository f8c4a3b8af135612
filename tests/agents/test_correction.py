"""The seat of corrections: settings by kind, and what a correction is given."""

import math
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np
import pytest
from pydantic import BaseModel

from rudc.agents.base import Decision
from rudc.agents.correction import (
    CORRECTIONS,
    CbfSettings,
    CorrectionSettings,
    NoCorrection,
    make_correction,
    read_correction,
)
from rudc.agents.filtered import FilteredAgent
from rudc.agents.follower import Follower
from rudc.agents.learned import LearnedAgent
from rudc.agents.seat import ADJUSTMENT, CorrectionKind, Proposal
from rudc.errors import InputError, PartFailedError
from rudc.safety.corrected import Corrected
from rudc.safety.rules import Ecbf
from tests.agents.learners import arrays_of, small
from tests.safety.scenes import Other, make_scene


def test_a_name_or_a_mapping_says_which_is_meant():
    assert read_correction("none") == NoCorrection()
    given = {"kind": "cbf", "rule": "ecbf", "ecbf_rate1": 2.0, "slack": {"gain": 0.5}, "residual": True}
    found = read_correction(given)
    assert isinstance(found, CbfSettings)
    assert (found.rule_settings, found.slack.gain, found.residual) == (Ecbf(rate1=2.0), 0.5, True)
    for wrong, said in (
        ("cfb", "correction: there is no 'cfb' .did you mean 'cbf'"),
        ({"kind": "none", "d_safe": 0.2}, "correction: there is no setting 'd_safe'"),
        ({"kind": "cbf", "ecbf_rate1": 2.0}, "ecbf_rate1: has no effect with rule=ttcbf"),
        ({"kind": "cbf", "d_saf": 0.3}, r"no setting 'd_saf' \(did you mean 'd_safe'\?\)"),
        ({"kind": "cbf", "slack": {"gan": 1}}, r"no setting 'slack\.gan' \(did you mean 'slack\.gain'\?\)"),
        (
            {"kind": "cbf", "slack": {"gain": -1}},
            r"correction: slack\.gain: must be (at least|greater than) 0",
        ),
    ):
        with pytest.raises(InputError, match=said):
            read_correction(wrong)


def test_a_field_takes_any_kind_and_gives_it_back():
    class Settings(BaseModel):
        correction: CorrectionSettings = NoCorrection()

    given = {"kind": "cbf", "max_added_acceleration": math.inf, "slack": {"gain": 0.5}}
    found = Settings.model_validate({"correction": given})
    assert Settings.model_validate_json(found.model_dump_json()) == found
    assert found.model_dump(mode="json")["correction"]["max_added_acceleration"] == "inf"


@pytest.mark.parametrize("rule", ["ttcbf", "ecbf"])
def test_one_gain_accepts_the_same_h_at_rest_under_both_rules(rule: str):
    """An ego stands nearer to a lorry than the rows allow: what it may do depends on h and the gain alone."""
    scene = make_scene([Other(4.2, 0.0, math.pi / 2, 0.0, 8.0, 2.5)], v=0.0)
    gamma = {"ttcbf_gamma": 0.0} if rule == "ttcbf" else {}  # ECBF has no such margin
    settings = {"rule": rule, "constrained": "all", "road": False, "last_resort": False, **gamma}
    standing, sigma, percentiles = np.zeros(2), 3.0, (5.0, 6.0)

    def status(gain: float) -> tuple[str, float]:
        correction = CbfSettings.preset(**settings, slack={"gain": gain}).make({}, percentiles)
        answer = correction.correct(scene, Proposal(standing, sigma=sigma), None)
        return answer.status, float(answer.h[0])

    _, h = status(0.0)
    assert -2.0 < h < -0.5
    accepted = -h / (percentiles[0] - sigma)
    assert status(1.001 * accepted)[0] == "nominal"
    assert status(0.999 * accepted)[0] == "relaxed"


class Halved(CorrectionKind):
    """Half the proposed acceleration: a correction that is no filter, made of what the seat offers alone."""

    kind: Literal["halved"] = "halved"
    share: float = 0.5

    def make(self, arrays, percentiles=None, action="adjustment"):
        return Halving(self.share)


class Halving:
    def __init__(self, share: float) -> None:
        self.share, self.seen = share, []

    def load(self, arrays: Mapping, percentiles) -> None: ...

    def reset(self, scene, seed: int) -> None:
        self.seen.clear()

    def correct(self, scene, proposal, critics) -> Corrected:
        if critics is not None:  # any other action may be asked about
            assert critics.quantiles(proposal.observation, np.zeros(2, np.float32)).ndim == 2
        self.seen.append((proposal, critics))
        u = proposal.u * [self.share, 1.0]
        return Corrected(u, u - proposal.u, "halved")


class Odd(CorrectionKind):
    """Answers what a test says."""

    kind: Literal["odd"] = "odd"
    answer: Any = None
    """or what is raised"""

    def make(self, arrays, percentiles=None, action=ADJUSTMENT) -> Any:
        def correct(scene, proposal, critics):
            if isinstance(self.answer, Exception):
                raise self.answer
            return self.answer

        return SimpleNamespace(
            load=lambda arrays, percentiles: None, reset=lambda scene, seed: None, correct=correct
        )


NAN, ZERO = np.array([np.nan, 0.0]), np.zeros(2)


@pytest.mark.parametrize(
    ("answer", "told"),
    [
        (Corrected(NAN, ZERO, "x"), "answered Corrected(u=array([nan, 0.])"),
        (Corrected(ZERO, NAN, "x"), "answered Corrected(u=array([0., 0.]), correction=array([nan, 0.])"),
        (Corrected(np.zeros(3), ZERO, "x"), "answered Corrected(u=array([0., 0., 0.])"),
        (Corrected(ZERO, ZERO, 3), "answered Corrected(u="),  # pyright: ignore[reportArgumentType]
        (ZERO, "answered array([0., 0.]); expected a `Corrected` with two finite numbers"),
        (None, "answered None; expected a `Corrected`"),
        (ValueError("mine"), "raised ValueError: mine (test_correction.py:"),
    ],
)
def test_a_correction_that_answers_no_action(monkeypatch, scene_on, answer, told):
    """Without a check the ego drove on with nan, and the row said `collision`."""
    monkeypatch.setitem(CORRECTIONS, "odd", Odd)
    config = small(correction=Odd(answer=answer))
    agent = LearnedAgent("mine", config, arrays_of(config))
    scene = scene_on("south", "left", 50.0, 4.0)
    agent.reset(scene, 0)
    with pytest.raises(PartFailedError) as caught:
        agent.act(scene)
    assert str(caught.value).startswith(f"correction odd at {scene.time_s:.1f} s: correct {told}")


def test_a_correction_is_cut_to_what_the_vehicle_can(scene_on):
    scene = scene_on("south", "left", 50.0, 4.0)
    u = np.array([1.0, 0.1])
    for answer, able in (([99.0, -9.0], [3.0, -0.6]), ([2.5, 0.2], [2.5, 0.2])):
        made = Odd(answer=Corrected(answer, answer - u, "x"))  # pyright: ignore[reportArgumentType]
        done = make_correction(made, {}).correct(scene, Proposal(u), None)  # pyright: ignore
        assert done.u.tolist() == able
        assert done.correction == pytest.approx(able - u)


@pytest.mark.parametrize(("asked", "answer", "fits"), [(1.0, 1.0, True), (9.0, 3.0, True), (1.0, 0.5, False)])
def test_what_is_said_to_stand_is_what_was_proposed(scene_on, asked, answer, fits):
    """Steps counted as not corrected where the action was another."""
    scene, u = scene_on("south", "left", 50.0, 4.0), np.array([asked, 0.1])
    said = np.array([answer, 0.1])
    one = make_correction(Odd(answer=Corrected(said, said - u, "nominal")), {})
    if fits:
        assert one.correct(scene, Proposal(u), None).status == "nominal"  # pyright: ignore
        return
    with pytest.raises(
        PartFailedError, match=r"correct answered \[0\.5 0\.1\] with status nominal; expected \[1\."
    ):
        one.correct(scene, Proposal(u), None)  # pyright: ignore


def test_another_correction_takes_the_same_seat(monkeypatch, scene_on):
    monkeypatch.setitem(CORRECTIONS, "halved", Halved)
    correction = read_correction({"kind": "halved", "share": 0.25}).make({})
    assert isinstance(correction, Halving)
    scene = scene_on("south", "left", 50.0, 4.0)
    agent = FilteredAgent(Follower(), "follower, halved", correction)
    agent.reset(scene, 0)
    decision = agent.act(scene)
    assert decision.u == pytest.approx(decision.u_rl * [0.25, 1.0])
    assert decision.u_rl[0] > 0
    proposal, critics = correction.seen[0]
    assert (proposal.action, critics) == (None, None)

    config = small()
    learnt = LearnedAgent("mine", config, arrays_of(config))
    learnt.correction = correction
    learnt.reset(scene, 0)
    choice = learnt.choose(scene)
    assert choice.decision.u == pytest.approx(choice.decision.u_rl * [0.25, 1.0])
    assert choice.executed == pytest.approx(config.action.normalised(choice.decision.u, scene), abs=1e-6)
    proposal, _ = correction.seen[0]
    assert proposal.sigma == choice.decision.sigma
    np.testing.assert_array_equal(proposal.action, choice.proposed)
    np.testing.assert_array_equal(proposal.observation, choice.observation)


def test_behind_a_correction_another_keeps_what_it_says(scene_on):
    """Going on was hidden from the outlook, and the time of the first was lost."""
    scene, hastens = scene_on("south", "left", 50.0, 4.0), np.array([3.0, 0.0])

    def drives(status, u, **parts):
        decision = Decision(u, u, corrected=Corrected(u, 0.0 * u, status), **parts)
        return SimpleNamespace(act=lambda scene: decision, reset=lambda scene, seed: None)

    for status, share, onwards in (
        ("onwards", 1.0, True),
        ("onwards", 0.5, False),
        ("last_resort", 1.0, False),
    ):
        inner = drives(status, hastens, timing_ms={"policy": 1.0, "correction": 1000.0})
        agent = FilteredAgent(inner, "two", Halving(share))
        decision = agent.act(scene)
        assert decision.onwards is onwards
        assert decision.corrected.status == "halved", "the result of the outer one"
        assert decision.timing_ms["correction"] > 1000.0
        third = FilteredAgent(agent, "three", Halving(1.0))
        assert third.act(scene).onwards is onwards


def test_a_constant_is_given_whatever_sigma_is_and_behind_any_driver():
    scene = make_scene([Other(4.2, 0.0, math.pi / 2, 0.0, 8.0, 2.5)], v=0.0)
    settings = {"constrained": "all", "road": False, "last_resort": False, "ttcbf_gamma": 0.0}
    for constant, status in ((3.0, "nominal"), (0.1, "relaxed")):
        correction = CbfSettings.preset("ttcbf", **settings, slack={"constant": constant}).make({})
        answer = correction.correct(scene, Proposal(np.zeros(2)), None)
        assert (answer.status, answer.slack) == (status, pytest.approx(0.1 * constant))


def test_as_a_rate_the_slack_gives_nothing_away_at_rest_and_a_factor_else():
    """Below h = 0 no sigma lets it stand; above, the h that may be lost in a step grows by exp(delta)."""
    settings = {"constrained": "all", "road": False, "last_resort": False, "ttcbf_gamma": 0.0}
    near, far = (make_scene([Other(x, 0.0, math.pi / 2, 0.0, 8.0, 2.5)], v=v) for x, v in ((4.2, 0), (13, 6)))

    def braking(gain: float, sigma: float, scene) -> float:
        slack = {"kind": "rate", "gain": gain} if gain else {}
        correction = CbfSettings.preset("ttcbf", **settings, slack=slack).make({}, (5.0, 6.0))
        return float(correction.correct(scene, Proposal(np.zeros(2), sigma=sigma), None).u[0])

    fixed = braking(0.0, 3.0, far)
    assert fixed < -0.5
    assert braking(0.5, 3.0, far) > fixed
    assert braking(0.5, 5.0, far) == pytest.approx(fixed, abs=1e-6)
    assert braking(0.5, 7.0, far) < fixed
    correction = CbfSettings.preset("ttcbf", **settings, slack={"kind": "rate", "gain": 9.0})
    answer = correction.make({}, (5.0, 6.0)).correct(near, Proposal(np.zeros(2), sigma=0.0), None)
    assert answer.h[0] < 0
    assert answer.status == "relaxed"
    with pytest.raises(InputError, match="has no effect with gain=0"):
        read_correction({"kind": "cbf", "slack": {"kind": "rate"}})


def test_residuals_of_another_step_are_refused():
    """w of a step of 0.1 s was added to rows of any other step."""
    with pytest.raises(InputError, match=r"residuals are predicted for steps of 0\.1 s, not of dt=0\.2"):
        read_correction({"kind": "cbf", "dt": 0.2, "residual": True})
    assert read_correction({"kind": "cbf", "dt": 0.2}).model_dump()["dt"] == 0.2
