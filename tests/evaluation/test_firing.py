"""Whether scripted events happen: counted over episodes, in what is shipped and where traffic is thin."""

import re
from itertools import chain

import numpy as np
import pytest
from typer.testing import CliRunner

from rudc.cli.commands import app
from rudc.errors import InputError, PartFailedError
from rudc.evaluation.firing import EARLY, NOBODY, UNFOLLOWED, Firing, drive_and_count
from rudc.evaluation.rollout import run_episode
from rudc.network.network import load_network
from rudc.scenario import load_scenario, shipped_scenarios
from rudc.world.events.conditions import each_holds
from rudc.world.props import Prop
from rudc.world.world import World

WAITING = [
    name
    for name in shipped_scenarios()
    if any(
        event.when is not None or getattr(event, "vehicle", None) is not None
        for event in load_scenario(name).events
    )
]


@pytest.mark.parametrize("name", WAITING)
def test_the_events_of_shipped_scenarios_happen(name):
    """In at least 95 % of the episodes that they are part of: here, with few episodes, in all of them."""
    firings, seeds, wrong, *_ = drive_and_count(load_scenario(name), range(2))
    assert wrong == []
    assert sorted(chain(*seeds.values())) == [0, 1]
    for firing in firings:
        assert firing.fired == firing.seen == firing.drawn, firing


@pytest.mark.parametrize("selector", ["leader", "oncoming", "crossing", "follower"])
@pytest.mark.parametrize("density", [0, 5, 40])
def test_whom_an_event_selects_is_there_whatever_the_traffic(selector, density):
    slow = {
        "kind": "slow_vehicle",
        "vehicle": selector,
        "speed": 4,
        "when": {"simulation_time": {"above": 0.5}},
    }
    scenario = load_scenario(
        "random_destination", {"events": [slow], "traffic.density": density, "episode.timeout": 5}
    )
    (firing,), *_ = drive_and_count(scenario, range(3))
    assert firing.fired == 3


def test_a_leader_is_there_though_a_lane_beyond_the_junction_is_closed():
    """Traffic takes the other lane as soon as it sees that; who leads the ego does so beyond the junction."""
    slow = {
        "kind": "slow_vehicle",
        "vehicle": "leader",
        "speed": 4,
        "when": {"simulation_time": {"above": 2}},
    }
    closed = {"kind": "lane_closure", "lane": "east_out_0", "at": 30, "length": 15}
    settings = {
        "events": [slow, closed],
        "traffic.density": 10,
        "ego.route": {"from": "west", "turn": "straight"},
        "episode.timeout": 5,
    }
    firings, *_ = drive_and_count(load_scenario("random_destination", settings), range(3))
    assert [firing.fired for firing in firings] == [3, 3]


def in_the_first(n):
    """It takes effect in so many episodes, from the start."""
    return dict.fromkeys(range(n), 0.0)


def test_counts_say_what_probability_left_out():
    assert (
        str(Firing(2, "hard_brake", 20, 20, 20, in_the_first(20)))
        == "event 2 (events.1) hard_brake: happens in 20 of 20 episodes"
    )
    assert str(Firing(1, "speeding", 20, 11, 9, in_the_first(10), why_not={14: EARLY})) == (
        "event 1 (events.0) speeding: happens in 10 of 20 episodes (its probability lets it in 11), "
        "and the ego meets it in 9; not with seed 14: its trigger did not come true before the episode "
        "ended, with planner driving"
    )
    lonely = str(Firing(1, "speeding", 9, 9, 3, in_the_first(3), why_not={8: NOBODY, 4: EARLY, 7: NOBODY}))
    assert lonely.endswith(
        "; not with seed 4: its trigger did not come true before the episode ended, with planner driving"
        "; not with seeds 7, 8: there was nobody for it to act on while its trigger held"
    )


def test_counts_say_when_it_happens():
    def said(*begun_s):
        return str(Firing(1, "fog", 2, 2, 2, begun_s=dict(enumerate(begun_s)))).partition("episodes")[2]

    assert said(0.0, 0.0) == ""
    assert said(3.2, 3.2) == ", at 3.2 s"
    assert said(4.0, 0.0) == ", at 0.0 to 4.0 s"


def test_counts_say_how_near_they_come():
    """While the event is in effect: who was slow for a moment, far away, comes nearer only later."""
    truck = {"kind": "stalled_vehicle", "lane": "south_in_0", "at": 3, "type": "truck"}
    slow = {"kind": "slow_vehicle", "vehicle": "oncoming", "speed": 3, "duration": 0.2}
    settings = {
        "events": [slow, {**slow, "duration": 20}, truck, {"kind": "low_friction", "friction": 0.5}],
        "traffic.density": 0, "episode.timeout": 12,
        "ego": {"route": {"from": "south", "turn": "left"}, "distance": 30, "speed": 5},
    }  # fmt: skip
    brief, lasting, ahead, felt = drive_and_count(
        load_scenario("random_destination", settings), range(2)
    ).firings
    for seed in range(2):
        assert lasting.nearest_m[seed] < brief.nearest_m[seed] - 10.0
        assert ahead.nearest_m[seed] < 8.0
    assert felt.nearest_m == {}
    assert "m from the ego" in str(ahead)
    assert "m from the ego" not in str(felt)
    near = Firing(1, "accident", 2, 2, 2, begun_s=in_the_first(2), nearest_m={0: 0.4, 1: 34.2})
    assert str(near).endswith("at the nearest 0.4 to 34 m from the ego")
    touching = Firing(1, "accident", 2, 2, 2, begun_s=in_the_first(2), nearest_m={0: 0.048, 1: 0.1})
    assert str(touching).endswith("at the nearest 0.05 to 0.1 m from the ego")
    gaps = dict(enumerate([51.0, 6.4, 15.0, 20.0]))
    spread = str(Firing(1, "accident", 4, 4, 4, begun_s=in_the_first(4), nearest_m=gaps))
    assert spread.endswith("at the nearest 6.4 to 51 m from the ego (in half of them at most 15)")


def test_where_it_never_happens_there_are_no_others():
    never = str(Firing(1, "speeding", 2, 2, why_not={0: EARLY, 1: EARLY}))
    assert never.endswith("happens in 0 of 2 episodes: " + EARLY)


def test_conditions_that_did_not_hold_are_named():
    """Each by itself, and whether they did not hold at once; who is picked by chance stays the same."""
    late = {"simulation_time": {"above": 0.5}, "speed": {"above": 59}}
    either = [{"stand_still": {"above": 9}}, {"traveled_distance": {"above": 5}}]
    apart = {"simulation_time": {"below": 0.3}, "any": either}
    chance = {"relative_distance": {"vehicle": "random", "below": 0.1}}
    slippery = {"kind": "low_friction", "friction": 0.5}
    settings = {"traffic.density": 20, "ego.speed": 8, "episode.timeout": 2}
    events = [{**slippery, "when": when} for when in (late, apart, chance)]
    driven = drive_and_count(load_scenario("random_destination", {**settings, "events": events}), range(2))
    first, second, third = driven.firings
    assert first.held == {seed: {"simulation_time": True, "speed": False} for seed in range(2)}
    assert str(first).endswith(f": {EARLY} (simulation_time held in 2 of 2, speed in 0 of 2)")
    assert str(second).endswith(
        f": {EARLY} (simulation_time held in 2 of 2, any.0.stand_still in 0 of 2, any.1.traveled_distance in "
        "2 of 2, but not at once)"
    )
    assert str(third).endswith(f": {EARLY} (relative_distance held in 0 of 2)")


def test_conditions_of_a_single_episode_are_counted():
    once = Firing(1, "fog", 1, 1, why_not={0: EARLY}, held={0: {"speed": False, "stand_still": True}})
    assert str(once).endswith(" (speed held in 0 of 1, stand_still in 1 of 1)")


def test_conditions_are_looked_at_without_drawing_anything():
    when = {"relative_distance": {"vehicle": "random", "below": 0.1}}
    slow = {"kind": "slow_vehicle", "vehicle": "random", "speed": 1, "when": when}
    plan = load_scenario("random_destination", {"events": [slow], "traffic.density": 20}).plan(0)
    with World(load_network("four_way")) as world:
        world.reset(plan)
        world.advance(np.zeros(2))
        before = world.stage.rng.bit_generator.state
        assert each_holds(plan.events[0].when, world.scene(), world.stage) == {("relative_distance",): False}
        assert world.stage.rng.bit_generator.state == before


@pytest.mark.parametrize(("fired", "seen", "said"), [(2, 2, "2"), (2, 0, "0"), (0, 0, "")])
def test_whether_the_ego_comes_onto_a_slippery_patch_is_always_said(fired, seen, said):
    text = str(Firing(1, "slippery_patch", 2, 2, seen, in_the_first(fired)))
    assert text.endswith(f", and the ego meets it in {said}" if said else "of 2 episodes")


def test_no_room_on_the_road_is_not_blamed_on_the_trigger(monkeypatch):
    monkeypatch.setattr(Prop, "has_room", lambda prop, scene: False)
    riders = {"kind": "vehicle_crossing", "arm": "north", "count": 2}
    settings = {"events": [riders], "traffic.density": 0, "episode.timeout": 1}
    (firing,), *_ = drive_and_count(load_scenario("random_destination", settings), range(2))
    assert str(firing).endswith("happens in 0 of 2 episodes: there was no room for it on the road")


def test_who_follows_an_event_that_did_not_happen_is_not_told_that_its_own_trigger_failed():
    first = {"kind": "density_surge", "density": 30, "when": {"probability": 0.5}}
    second = {"kind": "low_friction", "friction": 0.5, "when": {"event_state": {"event": 0}}}
    never = {"kind": "low_friction", "friction": 0.4, "when": {"event_state": {"event": 1, "state": "over"}}}
    settings = {"events": [first, second, never], "traffic.density": 0, "episode.timeout": 1}
    surge, slippery, after = drive_and_count(load_scenario("random_destination", settings), range(6)).firings
    assert 0 < surge.fired < 6
    left_out = [seed for seed in range(6) if seed not in surge.begun_s]
    assert slippery.why_not == dict.fromkeys(left_out, UNFOLLOWED)
    named = f"{'s' * (len(left_out) > 1)} {', '.join(map(str, left_out))}"
    assert str(slippery).endswith(f"; not with seed{named}: the event that it waits for did not happen")
    assert after.why_not == {seed: UNFOLLOWED if seed in left_out else EARLY for seed in range(6)}


OVERLAP = """
name: overlap
ego: {route: {from: south, turn: left}}
episode: {timeout: 3}
events:
  - {kind: accident, vehicles: [{lane: west_out_1, at: 24}]}
  - {kind: stalled_vehicle, lane: west_out_1, at: {uniform: [4, 28]}}
"""


def test_seeds_that_cannot_be_set_up_are_said_and_the_others_driven(tmp_path):
    path = tmp_path / "overlap.yaml"
    path.write_text(OVERLAP, encoding="utf-8")
    firings, seeds, wrong, *_ = drive_and_count(load_scenario(path), range(6))
    assert 0 < len(wrong) < 6
    assert all("seed " in text and "would overlap or touch" in text for text in wrong)
    assert firings[0].episodes == len([*chain(*seeds.values())]) == 6 - len(wrong)
    brief = tmp_path / "brief.yaml"
    brief.write_text("name: brief\nextends: sudden_brake\nepisode: {timeout: 3}\n", encoding="utf-8")
    which = ["--seed", wrong[0].removeprefix("seed ").partition(":")[0], "--seeds", "1"]
    result = CliRunner().invoke(app, ["scenario", "validate", str(path), str(brief), *which])
    assert f"{path}: {wrong[0]}" in str(result.exception)
    assert f"{brief}: ok (1 event)" in result.stdout


@pytest.mark.parametrize("kind", [InputError, PartFailedError])
def test_an_episode_that_goes_wrong_on_the_way_does_not_keep_the_others_from_being_driven(kind, monkeypatch):
    real = run_episode

    def failing(episode, plan, agent, **watched):
        if plan.seed == 0:
            raise kind("a part failed at 0.5 s")
        return real(episode, plan, agent)

    monkeypatch.setattr("rudc.evaluation.firing.run_episode", failing)
    driven = drive_and_count(load_scenario("random_destination", {"episode.timeout": 1}), range(2))
    assert driven.wrong == ["seed 0: a part failed at 0.5 s"]
    assert list(driven.seeds.values()) == [[1]]


def test_whom_the_ego_hit_and_whose_fault_it_was_is_said():
    riders = {"kind": "vehicle_crossing", "arm": "ego_in", "count": 3, "at": 10, "speed": 5}
    near = {**riders, "when": {"ego_distance_to_junction": {"below": 13}}}
    settings = {"events": [near], "traffic.density": 0, "ego.distance": 30, "ego.speed": 12}
    driven = drive_and_count(load_scenario("random_destination", settings), range(3))
    hit = driven.seeds["collision"]
    assert driven.hits == dict.fromkeys(hit, ("bicycle", "other", True, "event 1"))
    said = "; ".join(
        f"{seed}: bicycle of event 1, fault other (put or sent too near to avoid)" for seed in hit
    )
    assert f"{len(hit)} collision (seed{'s' * (len(hit) > 1)} {said})" in driven.ends


def test_where_the_ego_left_the_road_and_how_fast_is_said():
    ice = {"kind": "low_friction", "friction": 0.03, "when": {"ego_distance_to_junction": {"below": 1}}}
    route = {"from": "south", "turn": "right"}
    settings = {"events": [ice], "traffic.density": 0, "ego.route": route, "ego.speed": 9}
    driven = drive_and_count(load_scenario("random_destination", settings), range(1))
    (astray,) = driven.astray.values()
    assert 5.0 < astray.past_stop_m < 15.0
    assert 5.0 < astray.speed_mps < 9.0
    said = f"{astray.past_stop_m:.0f} m past its stop line at {astray.speed_mps:.1f} m/s"
    assert driven.ends == f"planner drives 1 episode: 1 off_road (seed 0: {said})"


def test_what_an_event_put_too_near_to_stop_is_said():
    """It read as a failure of the driver."""
    when = {"ego_distance_to_junction": {"below": 15}}
    thing = {"lane": "ego_in", "at": 8, "type": "truck"}
    lorry = {"kind": "accident", "name": "lorry", "vehicles": [thing], "when": when}
    settings = {"events": [lorry], "traffic.density": 0, "ego.distance": 30, "ego.speed": 12}
    driven = drive_and_count(load_scenario("random_destination", settings), range(1))
    assert driven.hits == {0: ("truck", "other", True, "lorry")}
    assert "1 collision (seed 0: truck of lorry, fault other (put or sent too near to avoid))" in driven.ends


def test_how_episodes_end_is_said():
    driven = drive_and_count(load_scenario("blocked_left_turn", {"episode.timeout": 0.1}), range(2))
    assert driven.outcomes == {"frozen": 2}
    assert driven.ends == "planner drives 2 episodes: 2 frozen (seeds 0, 1)"
    result = CliRunner().invoke(app, ["scenario", "validate", "random_destination", "--seeds", "1"])
    assert "random_destination: ok (0 events)\n  planner drives 1 episode: 1 success" in result.stdout


def test_an_event_beyond_what_blocks_the_way_happens():
    """A driver who stays behind the block would never see it."""
    stalled = load_scenario("stalled_truck").events[0].model_dump(exclude_none=True)
    beyond = {"kind": "low_friction", "friction": 0.5, "when": {"ego_distance_to_junction": {"below": -50}}}
    firings, *_ = drive_and_count(load_scenario("stalled_truck", {"events": [stalled, beyond]}), range(1))
    assert [firing.fired for firing in firings] == [1, 1]


def test_validate_says_how_often_events_happen():
    result = CliRunner().invoke(app, ["scenario", "validate", "sudden_brake", "--seeds", "3"])
    assert result.exit_code == 0
    *first, last = result.stdout.splitlines()
    assert first == ["sudden_brake: ok (1 event)", "  planner drives 3 episodes: 3 success"]
    counted = "  event 1 (events.0) hard_brake: happens in 3 of 3 episodes"
    assert re.fullmatch(
        re.escape(counted)
        + r", at \d\.\d to \d\.\d s, at the nearest \d\.\d to \d\.\d m from the ego \(.* at most \d\.\d\)",
        last,
    ), last
