"""sigma by route: what is usual at a place is found and taken out, and nothing else."""

import math

import numpy as np
import pytest

from rudc.agents.checkpoint import load_learnt, save_learnt
from rudc.agents.correction import CbfCorrection
from rudc.agents.learned import LearnedAgent
from rudc.agents.registry import agent_settings, make_agent
from rudc.agents.route_sigma import (
    ROUTE,
    STOP,
    Heard,
    Place,
    RouteSigma,
    explained,
    fit,
    out_of_sample,
    place_of,
)
from rudc.data import data_folder
from rudc.errors import AgentError, SimulationError
from rudc.learning.uncertainty import Uncertainty
from tests.agents.learners import arrays_of, small


def usual(places: np.ndarray) -> np.ndarray:
    """log sigma of an invented agent: higher before the stop line, on the minor road, and for left turns."""
    stop, go, task, major = places.T
    return 1.0 - 0.02 * np.abs(stop - 5.0) + 0.01 * np.minimum(go, 60.0) + 0.4 * (task == 0) - 0.3 * major


def drives(count: int, noise: float = 0.2, seed: int = 0) -> list[Heard]:
    """Episodes from 40 m before the stop line to the destination 35 m behind it."""
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        stop = np.linspace(38.0, -33.0, 90)
        task, major = (np.full(90, float(rng.integers(n))) for n in (3, 2))
        places = np.column_stack([stop, stop + 35.0, task, major])
        total = np.exp(usual(places) + noise * rng.standard_normal(90))
        found.append(Heard(places, np.outer(total, [0.1, 0.9, 1.0])))
    return found


def test_what_is_usual_is_taken_out():
    episodes = drives(60)
    fitted = RouteSigma(fit(episodes))
    for fresh in drives(10, noise=0.0, seed=1):
        left = np.log(fitted.of_heard(fresh))
        assert np.ptp(left[:, 2]) < 0.2  # of 1.2 and more before
        assert left[:, 1] - left[:, 2] == pytest.approx(math.log(0.9), abs=1e-3)
    assert explained(episodes) == pytest.approx(1 - 0.04 / (0.04 + np.var(_logs(drives(60, 0.0)))), abs=0.03)


def _logs(episodes: list[Heard]) -> np.ndarray:
    return np.concatenate([np.log(heard.sigmas[:, 2]) for heard in episodes])


def test_it_stays_in_units_of_reward():
    """At an ordinary place sigma by route is sigma itself: the mean of the logarithm is the same."""
    episodes = drives(60)
    fitted = RouteSigma(fit(episodes))
    by_route = np.concatenate([fitted.of_heard(heard)[:, 2] for heard in episodes])
    assert np.log(by_route).mean() == pytest.approx(_logs(episodes).mean(), abs=0.01)


def test_five_of_a_hundred_fresh_decisions_are_above_sigma_l():
    fitted = RouteSigma(fit(drives(80)))
    fresh = np.concatenate([fitted.of_heard(heard)[:, 2] for heard in drives(80, seed=9)])
    low, high = fitted.percentiles
    assert np.mean(fresh > low) == pytest.approx(0.05, abs=0.01)
    assert np.mean(fresh > high) == pytest.approx(0.025, abs=0.007)


def test_percentiles_are_out_of_sample():
    """With few episodes the fit follows their noise; sigma_l must not be that of what was fitted."""
    few = drives(6, noise=0.5)
    inside = RouteSigma(fit(few))
    own = np.log(np.concatenate([inside.of_heard(heard)[:, 2] for heard in few]))
    assert np.var(np.log(out_of_sample(few)[:, 2])) > 1.02 * np.var(own)
    assert len(out_of_sample(few[:1])) == 90


def test_what_was_never_driven_is_judged_by_what_all_share():
    """A right turn where only left turns from the minor road were seen; and beyond the outer knots."""
    only = [heard._replace(places=heard.places * [1, 1, 0, 0]) for heard in drives(40)]
    fitted = RouteSigma(fit(only))
    there = np.array([fitted.excess(Place(*way, 2, 1))[2] for way in ((0.0, 35.0), (15.0, 50.0))])
    seen = np.array([fitted.excess(Place(*way, 0, 0))[2] for way in ((0.0, 35.0), (15.0, 50.0))])
    assert np.all(np.isfinite(there))
    assert np.sign(there[1] - there[0]) == np.sign(seen[1] - seen[0])
    far = [fitted.excess(Place(*way, 0, 1)) for way in ((STOP[-1], 200.0), (500.0, 900.0))]
    np.testing.assert_array_equal(far[0], far[1])


def test_others_arrays_are_refused():
    arrays = fit(drives(3))
    assert sum(value.nbytes for value in arrays.values()) < 4000
    with pytest.raises(AgentError, match="usual along the route"):
        RouteSigma({**arrays, "go": arrays["go"][:, :4]})
    assert RouteSigma.among({"policy/out.bias": np.zeros(3)}) is None


def test_an_agent_states_the_one_that_is_set(scene_on):
    scene = scene_on("south", "left", 42.0, 6.0)
    place = place_of(scene)
    assert place.task == scene.route.task
    assert place.stop == pytest.approx(scene.route.stop_line_s - 42.0 - 0.5 * scene.vehicle.length)
    arrays = {f"{ROUTE}/{name}": value for name, value in fit(drives(20)).items()}
    config = small()
    paper = LearnedAgent("a", config, arrays_of(config) | arrays).act(scene)
    assert paper.uncertainty is not None
    assert paper.sigma == paper.uncertainty.total
    route = LearnedAgent("a", small(sigma="route"), arrays_of(config) | arrays).act(scene)
    fitted = RouteSigma.among(arrays)
    assert fitted is not None
    assert route.by_route is not None
    assert route.uncertainty is not None
    shares = np.exp(-np.array(fitted.excess(place)))
    assert route.by_route == pytest.approx(Uncertainty(*(np.array(route.uncertainty) * shares)))
    assert route.uncertainty == paper.uncertainty
    assert route.sigma == route.by_route.total != paper.sigma
    untaught = LearnedAgent("a", small(sigma="route"), arrays_of(config)).act(scene)
    assert untaught.by_route is None
    assert untaught.uncertainty is not None
    assert untaught.sigma == untaught.uncertainty.total


def test_the_slack_has_the_percentiles_of_the_sigma_that_is_stated():
    arrays = {f"{ROUTE}/{name}": value for name, value in fit(drives(20)).items()}
    changes = {"algorithm": "rudc-t", "correction": {"kind": "cbf", "slack": {"gain": 0.5}}}
    fitted = RouteSigma.among(arrays)
    assert fitted is not None
    for kind, wanted in (("paper", (3.0, 4.0)), ("route", fitted.percentiles)):
        config = small(**changes, sigma=kind)
        agent = LearnedAgent("a", config, arrays_of(config) | arrays, (3.0, 4.0))
        assert isinstance(agent.correction, CbfCorrection)
        assert agent.correction.slack is not None
        assert (agent.correction.slack.low, agent.correction.slack.high) == pytest.approx(wanted)


def test_without_what_is_usual_the_name_is_refused_and_says_what_to_do(tmp_path):
    learnt = load_learnt(data_folder("results/checkpoints") / "rudc-wo-cbf")
    bare = {name: value for name, value in learnt.arrays.items() if not name.startswith(f"{ROUTE}/")}
    save_learnt(tmp_path / "bare", learnt._replace(arrays=bare))
    with pytest.raises(AgentError, match=rf"rudc agent calibrate {tmp_path / 'bare'} --write"):
        make_agent(f"{tmp_path / 'bare'}:sigma=route")
    with pytest.raises(AgentError, match="state no sigma"):
        make_agent("sac:sigma=route")
    own = {f"{ROUTE}/{name}": value for name, value in fit(drives(3)).items()}
    save_learnt(tmp_path / "taught", learnt._replace(arrays=bare | own))
    assert agent_settings(f"{tmp_path / 'taught'}:sigma=route")["sigma"] == "route"


def test_an_episode_that_froze_is_not_usual():
    """It has four times the decisions of another, at one place, and would move sigma_l."""
    from rudc.training.calibration import measured

    fine = drives(40)
    stuck = Heard(np.tile(fine[0].places[40], (400, 1)), np.full((400, 3), 30.0), succeeded=False)
    alone, both = measured(fine), measured([*fine, stuck])
    assert both.percentiles == alone.percentiles
    np.testing.assert_array_equal(both.arrays[f"{ROUTE}/stop"], alone.arrays[f"{ROUTE}/stop"])
    assert measured([stuck]).percentiles == (30.0, 30.0)


def test_calibrating_leaves_out_episodes_that_fail(monkeypatch):
    from rudc.training import calibration

    answers: list[Heard | None] = []

    def hear(*_):
        answer = answers.pop(0)
        if answer is None:
            raise SimulationError("no safe start")
        return answer

    def calibrate(*these: Heard | None) -> calibration.Calibration:
        answers.extend(these)
        return calibration.calibrate(
            data_folder("results/checkpoints") / "rudc-wo-cbf", ("dense_left_turn",), len(these), advance=int,
        )  # fmt: skip

    monkeypatch.setattr(calibration, "hear", hear)
    one, two, three = drives(3)
    found = calibrate(one, None, two, three)
    assert (found.episodes, found.left_out) == (3, 1)
    assert found.kinds == calibrate(one, two, three).kinds
    with pytest.raises(AgentError, match="none of 2 episodes can be driven: no safe start"):
        calibrate(None, None)
