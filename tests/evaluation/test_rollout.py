"""Real episodes: what a record says of them, that they repeat, and films and traces of them."""

import csv
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rudc.agents.base import Decision, unfiltered
from rudc.agents.correction import refuse_other_steps
from rudc.agents.registry import make_agent
from rudc.env.episode import Episode
from rudc.errors import AgentError
from rudc.evaluation.columns import COLUMNS, TIMING, is_intervention
from rudc.evaluation.film import Film
from rudc.evaluation.rollout import run_episode
from rudc.evaluation.runner import EpisodeRunner
from rudc.evaluation.sweep import run_sweep
from rudc.evaluation.tasks import SweepPlan
from rudc.evaluation.trace import Trace
from rudc.network.network import load_network
from rudc.scenario import find_scenarios, load_scenario
from rudc.world.config import EgoDriver, WorldConfig
from rudc.world.world import World


@pytest.fixture(scope="module")
def episode():
    with World(load_network("four_way")) as world:
        yield Episode(world)


def comparable(record):
    return [cell for name, cell in zip(COLUMNS, record.row(), strict=True) if name not in TIMING]


class Talks:
    """Says what it does."""

    name = "talks"
    ego_driver: EgoDriver = "agent"

    def reset(self, scene, seed):
        print("a new episode")

    def act(self, scene):
        print("full throttle")
        return Decision(np.array([3.0, 0.0]), np.array([3.0, 0.0]))


def test_what_an_agent_prints_is_no_result(episode, capsys):
    run_episode(episode, load_scenario("random_destination").plan(3), Talks())
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("a new episode\nfull throttle\n")


@pytest.mark.parametrize(
    "name", ["follower+ttcbf", "planner+ecbf", "rudc-t", "rudc-t+ttcbf:correction.dt=0.2"]
)
def test_a_filter_for_other_decisions_than_the_worlds_is_refused(name):
    slow: Any = SimpleNamespace(world=SimpleNamespace(config=WorldConfig(decision_s=0.2)))
    plan, told = load_scenario("random_destination").plan(3), "held for dt=0.1 s, but .* for 0.2 s"
    with pytest.raises(AgentError, match=told):
        run_episode(slow, plan, make_agent(name))


def test_a_filter_for_the_worlds_decisions_is_taken():
    refuse_other_steps(make_agent("follower+ttcbf:correction.dt=0.2"), 0.2)
    refuse_other_steps(make_agent("follower"), 0.2)


@pytest.mark.parametrize("name", ["sumo", "follower", "gap-acceptance", "gap-acceptance+ttcbf"])
def test_a_record_is_consistent_and_repeats(episode, name):
    plan, agent = load_scenario("random_destination").plan(3), make_agent(name)
    record = run_episode(episode, plan, agent)
    assert (record.scenario, record.agent, record.seed, record.error) == ("random_destination", name, 3, "")
    assert record.outcome in ("success", "frozen", "collision", "off_road", "wrong_way")
    assert record.number("duration_s") == pytest.approx(0.1 * record.number("steps"), abs=0.06)
    assert 0.0 <= record.number("route_completion") <= 1.0
    assert (record.number("route_completion") == 1.0) == (record.outcome == "success")
    assert 0.0 < record.number("decision_ms_mean") <= record.number("decision_ms_max")
    assert math.isnan(record.number("mean_sigma"))
    assert record.text("origin") in ("north", "east", "south", "west")
    assert record.text("priority") == ("major" if record.text("origin") in ("east", "west") else "minor")
    assert record.number("density") == pytest.approx(20.0, rel=0.2)
    if "+" not in name:
        counted = ("interventions", "engaged_steps", "mean_correction", "infeasible_steps")
        assert [record.number(column) for column in counted] == [0, 0, 0.0, 0]
    again = run_episode(episode, plan, make_agent(name))
    assert comparable(again) == comparable(record)


def test_places_in_a_trace_count_from_the_junctions_centre_as_in_scenario_files(
    episode, tmp_path, monkeypatch
):
    """Not from the origin of the network's file, which may be anywhere."""
    trace, there, plan = Trace(), [], load_scenario("random_destination").plan(2)

    def watch(scene, decision, result):
        trace.watch(scene, decision, result)
        there.append((scene.ego.x - 7.0, scene.ego.y + 2.0))

    monkeypatch.setattr(load_network("four_way"), "center", np.array([7.0, -2.0]))
    run_episode(episode, plan, make_agent("follower"), watch=watch)
    trace.save(tmp_path / "steps.csv")
    with (tmp_path / "steps.csv").open(newline="") as file:
        rows = [(float(row["x_m"]), float(row["y_m"])) for row in csv.DictReader(file)]
    np.testing.assert_allclose(rows, there, atol=1e-5)


@pytest.mark.parametrize(("name", "commands"), [("sumo", False), ("follower", True)])
def test_a_trace_says_how_the_ego_speeds_up_and_has_no_commands_where_sumo_drives(
    episode, tmp_path, name, commands
):
    """It wrote the zeros that the world ignores."""
    agent = make_agent(name)
    trace = Trace(agent.ego_driver)
    run_episode(episode, load_scenario("random_destination").plan(2), agent, watch=trace.watch)
    trace.save(tmp_path / "steps.csv")
    with (tmp_path / "steps.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    speed = np.array([float(row["speed_mps"]) for row in rows])
    felt = np.array([float(row["ego_acceleration_mps2"]) for row in rows])
    assert np.corrcoef(felt[1:], np.diff(speed))[0, 1] > 0.8
    assert np.median(np.abs(felt[1:] - np.diff(speed) / 0.1)) < 0.1
    assert abs(felt).max() > 0.5
    told = ("proposed_acceleration_mps2", "proposed_steering_rad", "acceleration_mps2", "steering_rad")
    assert {bool(row[key]) for row in rows for key in told} == {commands}


def test_watching_sees_every_decision_and_changes_nothing(episode, tmp_path):
    plan, agent = (
        load_scenario("blocked_left_turn", {"episode.timeout": 15}).plan(1),
        make_agent("follower+ttcbf"),
    )
    bare = run_episode(episode, plan, agent)
    trace = Trace()
    film = Film(episode, size=120)
    decisions = []

    def watch(scene, decision, result):
        trace.watch(scene, decision, result)
        film.watch(scene, decision, result)
        decisions.append(decision)

    record = run_episode(episode, plan, agent, watch=watch)
    assert comparable(record) == comparable(bare)
    frames = [decision.corrected for decision in decisions]
    assert len(frames) == record.number("steps")
    assert record.number("engaged_steps") == sum(f.status != "nominal" for f in frames)
    assert record.number("infeasible_steps") == sum(f.infeasible for f in frames)
    half_range = np.array([4.5, 0.6])
    sizes = [float(np.hypot(*(f.correction / half_range))) for f in frames]
    assert record.number("mean_correction") == pytest.approx(np.mean(sizes), abs=1e-6)
    changed = [abs(f.correction[0]) > 0.1 or abs(f.correction[1]) > 0.005 for f in frames]
    assert record.number("interventions") == sum(changed) == sum(map(is_intervention, decisions)) > 0

    trace.save(tmp_path / "steps.csv")
    with (tmp_path / "steps.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == record.number("steps")
    assert sum(float(row["reward"]) for row in rows) == pytest.approx(
        record.number("episode_reward"), abs=1e-3
    )
    assert {row["filter_status"] for row in rows} >= {"nominal", "solved"}
    film.save(tmp_path / "film.gif")
    assert (tmp_path / "film.gif").read_bytes()[:4] == b"GIF8"


@pytest.mark.parametrize(
    ("acceleration", "steering", "counts"), [(0.09, 0.004, False), (-0.11, 0.0, True), (0.0, 0.006, True)]
)
def test_a_correction_too_small_to_feel_is_no_intervention(acceleration, steering, counts):
    proposed = np.array([1.0, 0.1])
    assert is_intervention(Decision(proposed + np.array([acceleration, steering]), proposed)) is counts


def test_a_runner_goes_from_network_to_network_and_survives_what_fails(tmp_path, monkeypatch, episode):
    episode.world.close()
    tasks = SweepPlan(
        tuple(find_scenarios(["random_destination", "roundabout_crossing"])), ("follower",), 2, 0
    ).tasks()
    runner = EpisodeRunner()
    first = [runner(task) for task in tasks]
    assert not any(record.error for record in first)
    with monkeypatch.context() as patch:
        patch.setattr("rudc.evaluation.runner.run_episode", lambda *_, **__: 1 / 0)
        record = runner(tasks[0])
    assert record.error.startswith("ZeroDivisionError: division by zero (test_rollout.py:")
    backwards = [runner(task) for task in reversed(tasks)]
    assert [comparable(r) for r in backwards] == [comparable(r) for r in reversed(first)]
    runner.close()


def test_a_real_sweep_is_the_same_with_one_worker_and_with_two(tmp_path):
    plan = SweepPlan(
        tuple(find_scenarios(["random_destination", "fog"])), ("sumo", "gap-acceptance+ecbf"), 1, 5
    )
    one = run_sweep(plan, tmp_path / "one", EpisodeRunner, workers=1)
    two = run_sweep(plan, tmp_path / "two", EpisodeRunner, workers=2)
    assert not one.errors
    for a, b in zip(one.rows, two.rows, strict=True):
        assert {k: v for k, v in a.items() if k not in TIMING} == {
            k: v for k, v in b.items() if k not in TIMING
        }
    assert (tmp_path / "one" / "metrics.csv").read_bytes() == (tmp_path / "two" / "metrics.csv").read_bytes()


@pytest.mark.parametrize(
    ("every", "steps", "drawn", "rate"),
    [(1, 6, [0, 1, 2, 3, 4, 5], 10.0), (1, 10, [0, 2, 4, 6, 8, 9], 5.0), (2, 30, [0, 8, 16, 24, 29], 1.25)],
)
def test_a_film_of_a_long_episode_has_fewer_frames_a_second(episode, monkeypatch, every, steps, drawn, rate):
    """At most 6 here; it takes as long, and ends with the end."""
    saved = []
    monkeypatch.setattr("rudc.evaluation.film.MOST", 6)
    monkeypatch.setattr("rudc.evaluation.film.save_film", lambda *given: saved.append(given))
    monkeypatch.setattr("rudc.evaluation.film.view_of", lambda *_: None)
    film = Film(episode, size=60, every=every)
    for step in range(steps):
        picture = np.full((4, 4, 3), step, dtype=np.uint8)
        film._renderer = SimpleNamespace(frame=lambda *_, picture=picture: picture)
        film.watch(
            None, unfiltered(0.0, 0.0), SimpleNamespace(outcome="frozen" if step == steps - 1 else None)
        )
    film.save("film.gif")
    ((frames, _, told),) = saved
    assert [int(one[0, 0, 0]) for one in frames] == drawn
    assert told == pytest.approx(rate)
