"""Which points of a sweep are set up before anything is run."""

import re

import pytest

from rudc.evaluation.preflight import TRIED, never_happening, tried_points, validated
from rudc.network.build import build_network
from rudc.network.network import load_network
from rudc.scenario import load_scenario, shipped_scenarios
from rudc.world.world import World

LARGE = """
name: large
extends: random_destination
sweep:
  traffic.density: [5, 10, 15]
  ego.speed: [5, 6, 7]
  episode.timeout: [10, 20, 30]
  traffic.warm_up: [1, 2, 3]
  traffic.speed_factor: [0.9, 1.0, 1.1]
  traffic.impatience: [0.2, 0.3, 0.4]
"""


@pytest.fixture
def written(tmp_path):
    def write(text):
        path = tmp_path / "own.yaml"
        path.write_text(text)
        return path

    return write


def test_a_large_sweep_is_set_up_at_a_few_points_that_show_every_value(written):
    scenario = load_scenario(written(LARGE))
    tried = tried_points(scenario)
    assert tried == tried_points(scenario)
    assert 3 <= len(tried) <= TRIED < len(scenario.points()) == 729
    assert all(point in scenario.points() for point in tried)
    for key, values in scenario.sweep.items():
        assert {point[key] for point in tried} == set(values)


def test_a_small_sweep_is_set_up_at_every_point(written):
    scenario = load_scenario(written("name: a\nsweep: {traffic.density: [5, 9], ego.speed: [5, 6, 7]}\n"))
    assert tried_points(scenario) == scenario.points()
    assert tried_points(load_scenario("random_destination")) == [{}]


def test_a_key_with_many_values_is_set_up_at_its_first_and_last(written):
    values = [5 + 0.5 * k for k in range(40)]
    scenario = load_scenario(written(f"name: a\nsweep: {{traffic.density: {values}}}\n"))
    tried = [point["traffic.density"] for point in tried_points(scenario)]
    assert len(tried) == TRIED
    assert {values[0], values[-1]} <= set(tried)


def test_a_value_that_is_not_set_up_is_checked_all_the_same(written):
    values = [5 + 0.5 * k for k in range(40)]
    values[1] = 500.0
    path = written(f"name: a\nsweep: {{traffic.density: {values}}}\n")
    scenario, problems = validated(path)
    assert scenario is None
    assert len(problems) == 1
    assert "own.yaml:2:" in problems[0]
    assert "500" in problems[0]


def test_only_those_points_cost_an_episode(written, monkeypatch):
    set_up = []
    reset = World.reset

    def counted(world, plan, *rest, **named):
        set_up.append(plan)
        return reset(world, plan, *rest, **named)

    monkeypatch.setattr(World, "reset", counted)
    scenario, problems = validated(written(LARGE))
    assert scenario is not None
    assert problems == []
    assert len(set_up) == len(tried_points(scenario))


def test_what_goes_wrong_in_some_episodes_only_is_said(written):
    """With the first seed in which it does; two bodies overlap in every fourth."""
    at = "{lane: east_out_0, at: 20, type: car}, {lane: east_out_0, at: {uniform: [22, 34]}, type: car}"
    events = f"[{{kind: accident, vehicles: [{at}]}}]"
    scenario, problems = validated(written(f"name: a\ntraffic: {{density: 0}}\nevents: {events}\n"))
    (told,) = problems
    seed = int(told.split("with seed=")[1].split(":")[0])
    placed = [float(scenario.plan(k).events[0].vehicles[1].at) for k in range(seed + 1)]
    assert min(placed) == placed[-1] < 25.0
    assert "overlap or touch" in told


def test_a_kind_of_the_mix_that_may_drive_nowhere_is_said(written, tmp_path):
    text = load_network("four_way").path.read_text(encoding="utf-8")
    closed = tmp_path / "closed.net.xml"
    closed.write_text(text.replace("<lane ", '<lane disallow="bicycle" '), encoding="utf-8")
    mixed = f"name: a\nnetwork: {closed}\ntraffic: {{mix: {{car: 1, bicycle: 1}}}}\n"
    (told,) = never_happening(load_scenario(written(mixed)))
    assert told.startswith("no bicycle of traffic.mix can appear")
    assert never_happening(load_scenario(written(mixed.replace("bicycle: 1", "bus: 1")))) == []


def test_a_kind_that_could_only_turn_back_is_said(written, tmp_path):
    ends = {"n": (0, 100), "e": (100, 0), "s": (0, -100)}
    nodes = [f'<node id="{k}" x="{x}" y="{y}"/>' for k, (x, y) in {"c": (0, 0), **ends}.items()]
    edges = [f'<edge id="{a}{b}" from="{a}" to="{b}"/>' for k in ends for a, b in ((k, "c"), ("c", k))]
    ways = [
        f'<connection from="{a}c" to="c{b}" fromLane="0" toLane="0" disallow="{refused}"/>'
        for a in ends for b in ends for refused in [("truck", "tram")[a == b]]
    ]  # fmt: skip
    for tag, parts in (("nodes", nodes), ("edges", edges), ("connections", ways)):
        (tmp_path / f"back.{tag[:3]}.xml").write_text(f"<{tag}>{''.join(parts)}</{tag}>", encoding="utf-8")
    path = build_network(tmp_path)
    network = load_network(str(path))
    open_to = [m.turn for m in network.movements if "truck" not in network.refused[m.origin, m.destination]]
    assert {*open_to} == {"u_turn"}
    mixed = f"name: a\nnetwork: {path}\ntraffic: {{mix: {{car: 1, truck: 1}}}}\n"
    (told,) = never_happening(load_scenario(written(mixed)))
    assert told.startswith("no truck of traffic.mix can appear")


LATE = """
name: late
extends: random_destination
events:
  - {kind: low_friction, friction: 0.5, when: {simulation_time: {above: 39}}}
  - {kind: low_friction, friction: 0.4, when: {simulation_time: {above: {uniform: [60, 90]}}}}
  - {kind: low_friction, friction: 0.3, when: {simulation_time: {above: {uniform: [50, 90]}}}}
  - {kind: low_friction, friction: 0.2, when: {simulation_time: {below: 99}}}
  - {kind: low_friction, friction: 0.1}
"""


def test_an_event_that_waits_for_a_time_beyond_the_limit_never_happens(written):
    scenario = load_scenario(written(LATE + "episode: {timeout: {choice: [40, 60]}}\n"))
    assert never_happening(scenario) == [
        "event 2 (events.1) low_friction can never happen: it waits for simulation_time above 60 s, and "
        "episodes end at 60 s (episode.timeout)"
    ]
    assert never_happening(load_scenario(written(LATE + "episode: {timeout: 61}\n"))) == []
    after = "  - {kind: sensor_noise, position: 1, when: {event_state: {event: 0, above: 61}}}\n"
    (told,) = never_happening(load_scenario(written(LATE + after + "episode: {timeout: 61}\n")))
    assert "event 6 (events.5) sensor_noise can never happen: it waits for event_state above 61 s" in told


def test_warnings_are_in_the_order_of_events(written):
    text = """
name: ordered
network: four_way
ego: {speed: 39}
events:
  - {kind: pedestrian_crossing, arm: ego_out, at: 80}
  - {kind: low_friction, friction: 0.5, when: {simulation_time: {above: 50}}}
  - {kind: pedestrian_crossing, arm: north, pause: {after: 60, duration: 2}}
  - {kind: low_friction, friction: 0.5, when: {probability: 0}}
"""
    told = never_happening(load_scenario(written(text)))
    assert [line.partition(" (")[0] for line in told[-4:]] == [f"event {k}" for k in (1, 2, 3, 4)]
    assert all(not line.startswith("event") for line in told[:-4])


def test_an_event_that_waits_for_what_the_ego_cannot_do_never_happens(written):
    text = """
name: vain
extends: random_destination
episode: {timeout: 40}
events:
  - {kind: low_friction, friction: 0.5, when: {speed: {above: 14.9}, traveled_distance: {above: 590}}}
  - {kind: low_friction, friction: 0.4, when: {speed: {above: 15}}}
  - {kind: low_friction, friction: 0.3, when: {traveled_distance: {above: 600}, probability: 0.5}}
"""
    assert [told.partition(" can never happen: it waits for ")[2] for told in
            never_happening(load_scenario(written(text)))] == [
        "speed above 15 m/s, and the ego drives at most 15 m/s",
        "traveled_distance above 600 m, and the ego drives at most 15 m/s, and episodes end at 40 s "
        "(episode.timeout)",
    ]  # fmt: skip


def test_an_event_of_no_probability_or_below_all_there_is_never_happens(written):
    text = """
name: nothing
extends: random_destination
events:
  - {kind: low_friction, friction: 0.5, when: {speed: {below: 0}}}
  - kind: low_friction
    friction: 0.4
    when: {time_headway: {below: {choice: {values: [0, 2], weights: [1, 0]}}}}
  - {kind: low_friction, friction: 0.3, when: {ego_distance_to_junction: {below: 0}, speed: {below: 0.1}}}
  - {kind: low_friction, friction: 0.2, when: {probability: 0}}
"""
    nothing = "below 0, and there is nothing below that"
    assert [told.partition(" can never happen: ")[::2] for told in
            never_happening(load_scenario(written(text)))] == [
        ("event 1 (events.0) low_friction", f"it waits for speed {nothing}"),
        ("event 2 (events.1) low_friction", f"it waits for time_headway {nothing}"),
        ("event 4 (events.3) low_friction", "its probability is 0"),
    ]  # fmt: skip


def test_an_event_that_waits_for_the_end_of_one_without_end_never_happens(written):
    text = """
name: endless
extends: random_destination
events:
  - {kind: density_surge, density: 40}
  - {kind: low_friction, friction: 0.4}
  - {kind: low_friction, friction: 0.5, when: {event_state: {event: 0, state: over}}}
  - {kind: sensor_dropout, range: 20, when: {event_state: {event: 1, state: over}}}
  - {kind: sensor_noise, position: 1, when: {event_state: {event: 3, state: over}}}
  - {kind: speeding, vehicle: leader, factor: 1.3, when: {event_state: {event: 3, state: begun}}}
  - {kind: density_surge, density: 40, when: {event_state: {event: 5, state: over}}}
  - {kind: stalled_vehicle, lane: south_in_0, at: 60}
  - {kind: actuator_delay, delay: 0.1, when: {event_state: {event: 7, state: over}}}
  - {kind: stalled_vehicle, vehicle: oncoming}
  - {kind: speeding, vehicle: leader, factor: 1.2, when: {event_state: {event: 9, state: over}}}
"""
    assert [told.partition(": ")[2] for told in never_happening(load_scenario(written(text)))] == [
        "it waits for the end of event 1 (events.0) density_surge, which has no duration",
        "it waits for the end of event 4 (events.3) sensor_dropout, which has no duration",
        "it waits for the end of event 8 (events.7) stalled_vehicle, which has no duration",
        "it waits for the end of event 10 (events.9) stalled_vehicle, which has no duration",
    ]  # another event of low_friction may end the first; a vehicle that speeds may leave
    alone = """
name: alone
extends: random_destination
events:
  - {kind: low_friction, friction: 0.4}
  - {kind: low_friction, friction: 0.5, when: {event_state: {event: 0, state: over}}}
"""
    assert len(never_happening(load_scenario(written(alone)))) == 1  # nobody else ends the first


def test_a_destination_that_no_episode_comes_to_is_warned_of(written):
    text = """
name: hasty
ego: {route: {from: south, turn: straight}, distance: {uniform: [40, 60]}, destination: 30}
"""
    (told,) = never_happening(load_scenario(written(text + "episode: {timeout: 5}\n")))
    assert told.startswith("the ego can never arrive: its way is ")
    assert told.endswith(" m at least, it drives at most 15 m/s, and episodes end at 5 s (episode.timeout)")
    way = float(told.split()[8])
    assert 90 < way < 110
    at_last = f"episode: {{timeout: {{choice: [1, {way / 15 + 0.1}]}}}}\n"
    assert never_happening(load_scenario(written(text + at_last))) == []


def test_of_a_sweep_it_is_said_with_which_values(written):
    told = never_happening(load_scenario(written(LATE + "sweep: {episode.timeout: [20, 70, 80]}\n")))
    assert [text.partition(" can never")[0] for text in told] == [
        f"with episode.timeout=20: event {k} (events.{k - 1}) low_friction" for k in (1, 2, 3)
    ]


def test_no_shipped_event_waits_too_long():
    assert [text for name in shipped_scenarios() for text in never_happening(load_scenario(name))] == []


def test_a_time_at_which_nothing_is_decided_never_comes(written):
    text = """
name: between
extends: random_destination
events:
  - {kind: low_friction, friction: 0.5}
  - {kind: low_friction, friction: 0.4, when: {event_state: {event: 0, below: 0.1}}}
  - {kind: low_friction, friction: 0.3, when: {event_state: {event: 0, below: 0.11}}}
  - {kind: low_friction, friction: 0.2, when: {simulation_time: {above: 0.31, below: {uniform: [0.3, 0.4]}}}}
  - {kind: low_friction, friction: 0.2, when: {simulation_time: {above: 0.29, below: {uniform: [0.3, 0.4]}}}}
  - {kind: low_friction, friction: 0.1, when: {simulation_time: {below: 0.05}, traveled_distance: {above: 1}}}
"""
    assert never_happening(load_scenario(written(text))) == [
        f"event {number} low_friction can never happen: it waits for {name} above {above} s and below "
        f"{below} s, and no decision falls between: there is one every 0.1 s"
        for number, name, above, below in (
            ("2 (events.1)", "event_state", 0, 0.1),
            ("4 (events.3)", "simulation_time", 0.31, 0.4),
        )
    ]


def test_what_is_beyond_the_destination_is_warned_of(written):
    text = """
name: beyond
extends: random_destination
ego: {destination: {uniform: [20, 30]}}
events:
  - {kind: pedestrian_crossing, arm: ego_out, at: 34}
  - {kind: pedestrian_crossing, arm: ego_out, at: {uniform: [36, 60]}}
  - {kind: pedestrian_crossing, arm: ego_in, at: 50}
  - kind: accident
    vehicles: [{lane: ego_out, at: 20, type: car}, {lane: ego_out, at: 45, type: car}]
  - {kind: lane_closure, lane: ego_out, at: 40, length: 5}
  - {kind: stalled_vehicle, lane: ego_out, at: 90}
  - {kind: stalled_vehicle, vehicle: leader}
  - {kind: pedestrian_crossing, arm: {choice: [north, ego_out]}, at: 50}
  - {kind: stalled_vehicle, lane: {choice: [ego_out_0, ego_out]}, at: 50}
"""
    told = never_happening(load_scenario(written(text)))
    assert [line.partition(": the ego never comes to ")[::2] for line in told] == [
        (f"event {number}", f"{what} m along its exit, since it arrives 30 m along it (ego.destination)")
        for number, what in (
            ("2 (events.1) pedestrian_crossing", "it, 36"),
            ("4 (events.3) accident", "vehicles.1, 45"),
            ("5 (events.4) lane_closure", "it, 40"),
            ("6 (events.5) stalled_vehicle", "it, 90"),
            ("9 (events.8) stalled_vehicle", "it, 50"),
        )
    ]


def test_who_comes_from_nowhere_and_what_the_ego_never_does_is_warned_of(written):
    text = """
name: nobody
network: t_junction
ego: {route: {from: south, turn: left}, speed: 18, destination: 30}
events:
  - {kind: hard_brake, vehicle: oncoming}
  - {kind: hard_brake, vehicle: crossing, when: {ego_distance_to_junction: {below: -200}}}
  - {kind: hard_brake, vehicle: crossing, when: {ego_distance_to_junction: {below: -30}}}
  - {kind: hard_brake, vehicle: leader, when: {stand_still: {above: 50}}}
  - {kind: hard_brake, vehicle: leader, when: {relative_distance: {vehicle: oncoming, below: 20}}}
  - {kind: hard_brake, vehicle: leader, when: {ego_distance_to_place: {lane: ego_out, at: 20, below: -40}}}
  - {kind: hard_brake, vehicle: leader, when: {ego_distance_to_place: {lane: ego_out, at: 20, below: -5}}}
  - {kind: hard_brake, vehicle: leader, when: {ego_distance_to_place: {lane: east_out_0, at: 60, below: 5}}}
"""
    told = never_happening(load_scenario(written(text)))
    starts = [line.partition(" (ego.destination)")[0] for line in told]
    assert len(told) == 7
    past = "hard_brake can never happen: it waits for ego_distance_to_place, and no way of the ego leads to"
    assert told[5].startswith(f"event 6 (events.5) {past}")
    assert told[6].startswith(f"event 8 (events.7) {past}")
    assert told[0].startswith("the ego starts at 10 m/s at most, not at 18 (ego.speed)")
    assert told[1].startswith(
        "event 1 (events.0) hard_brake can never happen: no arm lies opposite the ego's"
    )
    assert re.fullmatch(
        r"event 2 .* never happen: .* below -200 m, and the ego has arrived \d+ m .*", starts[2]
    )
    assert re.fullmatch(r"event 4 .* never happen: it waits for stand_still above 50 s, and .*", starts[3])
    assert told[4].startswith(
        "event 5 (events.4) hard_brake can never happen: no arm lies opposite the ego's"
    )
    main = text.replace("south, turn: left", "west, turn: straight").replace("speed: 18", "speed: 10")
    found = [line[:7] for line in never_happening(load_scenario(written(main)))]
    assert found == ["event 2", "event 4", "event 6", "event 8"]
