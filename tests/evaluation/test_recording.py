"""A recording says what the episode's own scenes and decisions say, to its stated step."""

import csv
import json
import math

import numpy as np
import pytest

from rudc.agents.registry import make_agent
from rudc.drawing.view import view_of
from rudc.env.episode import Episode
from rudc.evaluation.moments import Step, moments
from rudc.evaluation.recording import (
    ACTIVE,
    ANGLE,
    BRAKES,
    CONSTRAINED,
    HIDDEN,
    LENGTH,
    SERIES,
    Recording,
    road_shapes,
)
from rudc.evaluation.rollout import run_episode
from rudc.evaluation.trace import Trace
from rudc.network.network import load_network, shipped_networks
from rudc.scenario import load_scenario
from rudc.vehicle import EgoVehicle
from rudc.world.who_yields import who_yields
from rudc.world.world import World


def recorded(scenario, agent, seed):
    """The recording, after a way through JSON, and what a second watcher saw of the same episode."""
    plan, driver = load_scenario(scenario).plan(seed), make_agent(agent)
    seen = []
    with World(load_network(plan.network, plan.junction)) as world:
        episode = Episode(world)
        recording = Recording(episode, driver)

        def watch(scene, decision, result):
            recording.watch(scene, decision, result)
            seen.append((view_of(world, result.outcome), decision, result))

        record = run_episode(episode, plan, driver, watch=watch)
        return json.loads(json.dumps(recording.data(record), allow_nan=False)), seen, record


@pytest.fixture(scope="module")
def storm():
    return recorded("perfect_storm", "rudc-t", 1)


def test_tracks_are_where_everybody_was(storm):
    data, seen, _ = storm
    assert data["frames"] == len(seen) > 30
    ego = np.column_stack([np.cumsum(data["ego"][axis]) for axis in ("x", "y")]) * LENGTH
    was = np.array([[view.truth.ego.x, view.truth.ego.y] for view, _, _ in seen])
    assert np.abs(ego + seen[0][0].truth.network.center - was).max() <= 0.51 * LENGTH
    bodies = 0
    for track in data["tracks"]:
        x, y, psi = (np.cumsum(track["poses"][axis]) for axis in ("x", "y", "psi"))
        for i, flags in enumerate(track["state"]):
            view, decision, _ = seen[track["from"] + i]
            scene, row = view.truth, view.truth.ids.index(track["name"])
            place = scene.position[row] - scene.network.center
            assert np.abs(np.array([x[i], y[i]]) * LENGTH - place).max() <= 0.51 * LENGTH
            assert abs(math.remainder(psi[i] * ANGLE - scene.heading[row], 2 * math.pi)) <= 0.51 * ANGLE
            bits, name = int(flags, 16), f"veh:{track['name']}"
            assert bool(bits & HIDDEN) == (track["name"] in view.hidden)
            assert bool(bits & ACTIVE) == (name in decision.corrected.active)
            assert bool(bits & CONSTRAINED) == (name in decision.corrected.names)
            if scene.acceleration[row] < -1.0:
                assert bits & BRAKES
            bodies += 1
    assert bodies == sum(view.truth.count for view, _, _ in seen)


def test_series_are_the_numbers_of_the_decisions(storm):
    data, seen, _ = storm
    expected = {
        "time_s": [view.truth.time_s for view, _, _ in seen],
        "speed_mps": [view.truth.ego.v for view, _, _ in seen],
        "nominal_acceleration_mps2": [decision.u_rl[0] for _, decision, _ in seen],
        "safe_acceleration_mps2": [decision.u[0] for _, decision, _ in seen],
        "nominal_steering_rad": [decision.u_rl[1] for _, decision, _ in seen],
        "safe_steering_rad": [decision.u[1] for _, decision, _ in seen],
        "sigma": [decision.sigma for _, decision, _ in seen],
        "least_h_m2": [min(decision.corrected.h) for _, decision, _ in seen],
        "slack": [decision.corrected.slack for _, decision, _ in seen],
        "gap_m": [result.advance.min_dtc_m for _, _, result in seen],
        "reward": [result.reward for _, _, result in seen],
    }
    for name, values in expected.items():
        told = np.array(data["series"][name], dtype=float) * SERIES[name]
        assert np.abs(told - np.array(values)).max() <= 0.51 * SERIES[name], name
    assert data["sigma_low"] < data["sigma_high"]
    assert data["status"] == [decision.corrected.status for _, decision, _ in seen]


def test_events_and_sensors_are_told(storm):
    data, seen, record = storm
    happening = {event.number: event for event in seen[-1][0].events}
    assert {event["number"] for event in data["events"]} == set(happening)
    for event in data["events"]:
        assert event["begun_s"] == happening[event["number"]].begun_s
        assert event["visible_s"] == happening[event["number"]].visible_s
    assert len(data["event_lines"]) == 5  # of which one is not in this episode
    assert data["sensors"][0]["boxes"]
    assert any(decision["sensed"] for decision in data["decisions"])
    assert data["outcome"] == record.outcome
    assert data["row"]["min_dtc_m"] == record.text("min_dtc_m")


def test_moments_lie_where_their_numbers_are(storm):
    data, seen, _ = storm
    found = {moment["kind"]: moment for moment in data["moments"]}
    gaps = [result.advance.min_dtc_m for _, _, result in seen]
    assert found["gap"]["frame"] == int(np.argmin(gaps))
    assert f"{min(gaps):.2f} m" in found["gap"]["text"]
    infeasible = [k for k, (_, decision, _) in enumerate(seen) if decision.corrected.infeasible]
    assert found["infeasible"]["frame"] == infeasible[0]
    assert f"of {len(infeasible)}" in found["infeasible"]["text"]
    changes = [np.abs(decision.corrected.correction).max() for _, decision, _ in seen]
    assert changes[found["correction"]["frame"]] > 0.1
    assert found["end"]["frame"] == len(seen) - 1
    frames = [moment["frame"] for moment in data["moments"]]
    assert frames == sorted(frames)


def test_what_asking_for_grip_changes_is_no_correction(storm):
    data, seen, _ = storm
    asking = [k for k, told in enumerate(data["decisions"]) if "asks_grip" in told]
    assert asking[0] == 0  # as an episode begins
    assert asking == [k for k, (_, d, _) in enumerate(seen) if d.asks_grip]
    assert all(seen[k][1].u[0] == pytest.approx(-6.0) for k in asking)
    for (_, decision, _), told in zip(seen, data["decisions"], strict=True):
        bounded = decision.u - decision.corrected.u
        assert told.get("bounded", [0.0, 0.0]) == pytest.approx(bounded, abs=1e-4)
    largest = next(moment for moment in data["moments"] if moment["kind"] == "correction")
    a = seen[largest["frame"]][1].corrected.correction[0]
    assert largest["text"].startswith(f"largest correction: {a:+.1f} m/s2")


@pytest.mark.parametrize(("status", "kinds"), [("", []), ("solved", ["correction"])])
def test_without_a_correction_no_change_is_one(status, kinds):
    series = dict.fromkeys(SERIES, math.nan) | dict.fromkeys(
        ("time_s", "nominal_acceleration_mps2", "nominal_steering_rad", "safe_steering_rad"), 0.0
    )
    step = Step({**series, "safe_acceleration_mps2": -6.0}, status, infeasible=False, outcome="")
    assert [moment["kind"] for moment in moments([step], [], EgoVehicle())] == kinds


def test_steps_say_what_was_known_of_the_car(storm, tmp_path):
    _, seen, _ = storm
    trace = Trace()
    for view, decision, result in seen:
        trace.watch(view.truth, decision, result)
    trace.save(tmp_path / "steps.csv")
    with (tmp_path / "steps.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["asks_grip"] == "true" for row in rows] == [decision.asks_grip for _, decision, _ in seen]
    truth = seen[-1][0].truth.actuation
    assert float(rows[-1]["true_friction"]) == pytest.approx(truth.friction, abs=1e-6)
    assert float(rows[-1]["friction"]) == pytest.approx(truth.friction, rel=0.25)
    assert float(rows[-1]["delay_s"]) == pytest.approx(truth.delay_s, abs=0.1)


def test_steps_name_who_behaves_unlike_ordinary_traffic(tmp_path):
    _, seen, _ = recorded("jaywalkers", "follower", 0)
    trace = Trace()
    for view, decision, result in seen:
        trace.watch(view.truth, decision, result)
    trace.save(tmp_path / "steps.csv")
    with (tmp_path / "steps.csv").open(newline="") as file:
        named = {name for row in csv.DictReader(file) for name in row["unusual"].split()}
    assert named
    assert all(name.startswith("pedestrian") for name in named)


def test_a_driver_without_filter_and_sigma_has_none_of_their_numbers():
    data, _, _ = recorded("random_destination", "follower", 0)
    for name in ("sigma", "least_h_m2", "friction", "delay_s"):
        assert set(data["series"][name]) == {None}
    assert set(data["status"]) == {""}
    assert not {"correction", "infeasible", "sigma", "h"} & {moment["kind"] for moment in data["moments"]}


def test_ways_of_others_say_who_yields(storm):
    data, seen, _ = storm
    network, own = seen[0][0].truth.network, seen[0][0].truth.route.row
    for row, path in data["paths"].items():
        last = np.array([sum(path["xy"][0::2]), sum(path["xy"][1::2])]) * LENGTH + network.center
        assert np.hypot(*(network.paths.xy[int(row)] - last).T).min() < 0.02
        assert (path["yields"] == "ego") == bool(network.paths.yields[own, int(row)])
    for track in data["tracks"]:
        for k, row in track["path"]:
            scene = seen[k][0].truth
            assert scene.path[scene.ids.index(track["name"])] == row
            assert row < 0 or str(row) in data["paths"]
    assert {"ego", ""} <= {path["yields"] for path in data["paths"].values()}


def test_tracks_say_whom_somebody_yields_to_since_when():
    data, seen, _ = recorded("mixed_traffic", "planner", 4)
    told = [{} for _ in seen]
    for track in data["tracks"]:
        frames = range(track["from"], track["from"] + len(track["state"]))
        assert [k for k, _ in track["yields"]] == sorted({k for k, _ in track["yields"]} & set(frames))
        for k in frames:
            whom = [name for since, name in track["yields"] if since <= k]
            if whom and whom[-1] is not None:
                told[k][track["name"]] = whom[-1]
    assert told == [who_yields(view.truth, view.heedless) for view, _, _ in seen]
    assert {"ego"} < {whom for one in told for whom in one.values()}


def test_who_disregards_the_right_of_way_is_known_from_when_it_begins():
    """`who_yields` took such a driver to yield to the ego that it was about to hit."""
    data, seen, _ = recorded("ignored_priority", "follower", 1)
    (event,) = data["events"]
    heedless = [view.heedless for view, _, _ in seen]
    assert [len(names) for names in heedless] == [
        int(0.1 * k > event["begun_s"] - 0.05) for k in range(len(seen))
    ]


@pytest.mark.parametrize("name", list(shipped_networks()))
def test_the_road_of_every_network_is_small(name):
    shapes = road_shapes(load_network(name))
    assert {layer for layer, *_ in shapes} == {"verge", "asphalt", "mark"}
    assert len(json.dumps(shapes)) < 100_000


def test_who_turns_blinks_to_that_side_from_before_the_stop_line_to_the_exit(storm):
    data, seen, _ = storm
    network, route = load_network("four_way"), seen[0][0].truth.route
    sides = {"left": "left", "u_turn": "left", "right": "right"}
    assert data["route"]["blinks"] == pytest.approx(
        [sides[route.turn], route.stop_line_s - 30.0, route.exit_s], abs=0.1
    )
    for row, path in data["paths"].items():
        turn = next(m.turn for m in network.movements if int(row) in m.rows)
        if turn == "straight":
            assert path["blinks"] is None
        else:
            side, begin, end = path["blinks"]
            assert side == sides[turn]
            assert (begin, end) == pytest.approx(
                (network.paths.stop_s[int(row)] - 30.0, path["exit_m"]), abs=0.1
            )


def test_out_of_a_roundabout_everybody_turns_right():
    data, _, _ = recorded("roundabout_crossing", "follower", 0)
    ways = [data["route"], *data["paths"].values()]
    assert {way["blinks"][0] for way in ways} == {"right"}
    assert all(way["blinks"][2] - way["blinks"][1] == pytest.approx(15.0, abs=0.2) for way in ways)


def recorded_with(folder, *events):
    """`sudden_brake` with other events, driven by `follower`, as `recorded` gives it."""
    file = folder / "events.yaml"
    lines = "".join(f"  - {event}\n" for event in events)
    file.write_text(f"name: events\nextends: sudden_brake\nevents:\n{lines}")
    return recorded(str(file), "follower", 0)


def test_events_that_are_no_part_of_the_episode_are_named(tmp_path):
    data, _, _ = recorded_with(
        tmp_path,
        "{kind: hard_brake, vehicle: leader, deceleration: 6, when: {probability: 0}}",
        "{kind: low_friction, friction: 0.5}",
    )
    assert data["absent"] == [{"number": 1, "kind": "hard_brake"}]
    assert [event["number"] for event in data["events"]] == [2]


def test_an_event_that_another_replaces_for_a_while_is_over_meanwhile(tmp_path):
    data, *_ = recorded_with(
        tmp_path,
        "{kind: sensor_noise, position: 0.1}",
        "{kind: sensor_noise, speed: 1, duration: 0.5, when: {simulation_time: {above: 0.95}}}",
    )
    lasting, short = data["events"]
    ((begin, end),) = lasting["over"]
    assert (end - begin, short["over"]) == (5, [[end, None]])


def test_tracks_say_in_which_events_somebody_takes_part_since_when(tmp_path):
    data, seen, _ = recorded_with(
        tmp_path,
        "{kind: hard_brake, vehicle: leader, deceleration: 1, duration: 1}",
        "{kind: hard_brake, vehicle: leader, deceleration: 3, when: {simulation_time: {above: 1}}}",
    )
    told = [{} for _ in seen]
    for track in data["tracks"]:
        for k in range(track["from"], track["from"] + len(track["state"])):
            numbers = [text for since, text in track["events"] if since <= k]
            if numbers and numbers[-1] is not None:
                told[k][track["name"]] = numbers[-1]
    assert told == [
        {name: text for name, text in view.numbers.items() if name in view.truth.ids} for view, _, _ in seen
    ]
    assert {"1", "1,2"} <= {text for one in told for text in one.values()}
