"""Outcomes and metrics: with a world made by hand, and a real one."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest

from rudc.env.episode import Episode, Outcome
from rudc.errors import InputError, SimulationError
from rudc.network.network import load_network
from rudc.scenario import load_scenario
from rudc.world.fault import Collision
from rudc.world.scene import Kind
from rudc.world.world import Advance, World

U = np.array([0.0, 0.0])
CALM = Advance(None, False, False, 9.0, 0, 20.0)
CRASH = CALM._replace(collision=Collision("v0", Kind.TRUCK, "other"), min_dtc_m=0.0)


class Script:
    """A world that plays back scenes and what happened on the way to them."""

    def __init__(self, *played):
        self.scenes, self.advances = [scene for scene, _ in played], [advance for _, advance in played]
        self.at = 0
        self.plan = SimpleNamespace(attempt=2, scripted=())

    def reset(self, plan, *, ego_driver="agent", options=()):
        self.at = 0
        return self.scenes[0]

    def scene(self):
        return self.scenes[self.at]

    perceived = scene

    def happenings(self):
        return ()

    def advance(self, u):
        self.at += 1
        return self.advances[self.at]


@pytest.fixture
def drive(make_scene):
    """Episode whose ego is at each of the arc lengths in turn; the last decision ends with `advance`."""

    def make(*places, advance=CALM, **changes):
        scenes = [make_scene(s=s, v=4.0 + k, time_s=0.1 * k) for k, s in enumerate(places)]
        scenes[-1] = dataclasses.replace(scenes[-1], **changes)
        played = [(scene, CALM) for scene in scenes[:-1]] + [(scenes[-1], advance)]
        episode = Episode(Script(*played))
        episode.reset(None)
        return episode, [episode.step(U) for _ in places[1:]]

    return make


@pytest.mark.parametrize(
    ("advance", "outcome"),
    [
        (CALM, None),
        (CRASH, Outcome.COLLISION),
        (CALM._replace(off_road=True), Outcome.OFF_ROAD),
        (CALM._replace(wrong_way=True), Outcome.WRONG_WAY),
        (CRASH._replace(off_road=True), Outcome.COLLISION),
    ],
)
def test_violations(drive, advance, outcome):
    episode, results = drive(90.0, 91.0, advance=advance)
    assert results[-1].outcome is outcome is episode.outcome
    assert episode.metrics().violation == (outcome or "")
    assert episode.metrics().outcome == (outcome or "")


def test_success_frozen_and_what_comes_first(drive, network):
    goal = network.route("south", "left").exit_s + 20.0
    assert drive(90.0, goal + 0.1)[0].outcome is Outcome.SUCCESS
    assert drive(90.0, goal - 0.1)[0].outcome is None
    assert drive(90.0, goal + 0.1, ego_offset=8.0)[0].outcome is None  # some other arm
    assert drive(90.0, 91.0, time_s=40.0)[0].outcome is Outcome.FROZEN
    assert drive(90.0, goal + 0.1, time_s=40.0)[0].outcome is Outcome.SUCCESS
    assert drive(90.0, goal + 0.1, advance=CRASH)[0].outcome is Outcome.COLLISION


def test_rewards_of_the_ends(drive, network):
    goal = network.route("south", "left").exit_s + 20.0
    _, (calm, arrived) = drive(90.0, goal - 1.0, goal + 1.0)
    assert calm.reward == pytest.approx(sum(calm.terms.values()))
    assert arrived.terms["arrive_goal"] == 50.0
    _, (crashed,) = drive(90.0, 91.0, advance=CRASH)
    assert crashed.terms["collision"] == -50.0
    assert crashed.cost >= 5.0
    _, (left,) = drive(90.0, 91.0, advance=CALM._replace(off_road=True))
    assert left.terms["rule_violation"] == -50.0
    assert left.terms["collision"] == 0.0


def test_metrics(drive, network):
    goal = network.route("south", "left").exit_s + 20.0
    half = 90.0 + (goal - 90.0) / 2
    last = CRASH._replace(sv_collisions=2, density=30.0)
    episode, results = drive(90.0, half, half - 5.0, advance=last)
    metrics = episode.metrics()
    assert metrics.route_completion == pytest.approx(0.5)  # the farthest, not the last
    assert metrics.mean_speed_mps == pytest.approx(5.5)
    assert metrics.episode_reward == pytest.approx(sum(result.reward for result in results))
    assert metrics.episode_cost == pytest.approx(sum(result.cost for result in results))
    assert (metrics.min_dtc_m, metrics.sv_collisions, metrics.density) == (0.0, 2, 25.0)
    assert (metrics.fault, metrics.hit, metrics.redraws, metrics.steps) == ("other", "truck", 2, 2)
    assert metrics.duration_s == pytest.approx(0.2)
    arrived, _ = drive(90.0, goal + 0.4)
    assert arrived.metrics().route_completion == 1.0
    back, _ = drive(90.0, 80.0)
    assert back.metrics().route_completion == 0.0


def test_metrics_before_the_first_decision(make_scene):
    episode = Episode(Script((make_scene(v=7.0), CALM)))
    episode.reset(None)
    metrics = episode.metrics()
    assert (metrics.steps, metrics.mean_speed_mps, metrics.min_dtc_m) == (0, 7.0, math.inf)
    assert math.isnan(metrics.density)


def test_steps_are_refused_before_and_after(drive, make_scene):
    with pytest.raises(SimulationError, match="reset"):
        Episode(Script((make_scene(), CALM))).step(U)
    with pytest.raises(SimulationError, match="reset"):
        Episode(Script((make_scene(), CALM))).metrics()
    episode, _ = drive(90.0, 91.0, advance=CRASH)
    with pytest.raises(SimulationError, match="over"):
        episode.step(U)
    episode.reset(None)
    assert episode.outcome is None
    assert episode.metrics().steps == 0


def test_a_reset_that_fails_leaves_no_episode(drive, monkeypatch):
    def fail(plan, **more):
        raise SimulationError("it cannot be set up")

    episode, _ = drive(90.0, 91.0)
    monkeypatch.setattr(episode.world, "reset", fail)
    with pytest.raises(SimulationError, match="set up"):
        episode.reset(None)
    with pytest.raises(SimulationError, match=r"call reset\(plan\) first"):
        episode.step(U)
    for none in (episode, Episode(episode.world)):
        with pytest.raises(SimulationError, match=r"call reset\(plan\) first"):
            _ = none.distances


@pytest.mark.parametrize("driver", ["agent", "sumo"])
def test_with_a_real_world(driver):
    """A coasting ego ends in some way; SUMO's own driver gets along without violating anything."""
    scenario = load_scenario("random_destination")
    with World(load_network("four_way")) as world:
        episode = Episode(world)
        for seed in range(3):
            scene = episode.reset(scenario.plan(seed), ego_driver=driver)
            start = scene.ego_s
            results = []
            while episode.outcome is None:
                results.append(episode.step(np.array([0.5, 0.0])))
            metrics = episode.metrics()
            assert metrics.steps == len(results)
            assert metrics.duration_s == pytest.approx(results[-1].scene.time_s)
            assert metrics.min_dtc_m <= min(result.distances.vehicle_m for result in results)
            assert 0.0 <= metrics.route_completion <= 1.0
            assert metrics.outcome == results[-1].outcome
            assert episode.truth.ego_s >= start
            if driver == "sumo":
                assert metrics.outcome in ("success", "frozen")


def test_metrics_say_whether_the_scripted_events_happened():
    brake = {
        "kind": "slow_vehicle",
        "vehicle": "random",
        "speed": 2,
        "when": {"simulation_time": {"above": 0.5}},
    }
    never = {**brake, "when": {"probability": 0}}
    found = {}
    with World(load_network("four_way")) as world:
        episode = Episode(world)
        for name, events in (("none", []), ("absent", [never]), ("one", [never, brake])):
            episode.reset(load_scenario("random_destination", {"events": events}).plan(0))
            for _ in range(10):
                episode.step(U)
            metrics = episode.metrics()
            found[name] = (metrics.events_fired, metrics.first_event_s, metrics.first_event_visible_s)
    assert found["none"][0] is None
    assert found["absent"][0] == 0
    assert math.isnan(found["absent"][1])
    assert found["one"] == (1, pytest.approx(0.6, abs=0.11), pytest.approx(0.7, abs=0.11))


@pytest.mark.parametrize("where", ["advance", "perceived"])
def test_a_decision_that_is_cut_off_ends_the_episode(monkeypatch, where):
    """After Ctrl-C in a notebook, `step` went on from the middle of a decision."""
    plan = load_scenario("random_destination").plan(0)

    def interrupted(*_):
        raise KeyboardInterrupt

    with World(load_network("four_way")) as world:
        episode = Episode(world)
        episode.reset(plan)
        episode.step(U)
        for wrong in (np.array([np.nan, 0.0]), np.zeros(3)):  # refused before anything moves
            with pytest.raises(InputError, match="is not acceleration"):
                episode.step(wrong)
        episode.step(U)
        with monkeypatch.context() as patched:
            patched.setattr(world, where, interrupted)
            with pytest.raises(KeyboardInterrupt):
                episode.step(U)
        for use in (lambda: episode.step(U), lambda: episode.truth, episode.metrics):
            with pytest.raises(SimulationError, match="cut off in the middle of a decision; call reset"):
                use()
        episode.reset(plan)
        assert episode.step(U).scene.time_s == pytest.approx(0.1)
