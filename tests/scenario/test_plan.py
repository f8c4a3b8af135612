"""From a scenario and a seed to an episode: what is drawn, and what that does not depend on."""

import os
import pickle
import subprocess
import sys

import numpy as np
import pytest
from pydantic import ValidationError

from rudc.errors import InputError
from rudc.scenario import Scenario, distribution, load_scenario
from rudc.scenario.base import FileModel
from rudc.scenario.distributions import Constant, Distribution


def scenario(**sections) -> Scenario:
    return Scenario.model_validate({"name": "s", **sections})


BRAKE = {"kind": "hard_brake", "deceleration": {"uniform": [3, 9]}}
RARE_BRAKE = {**BRAKE, "when": {"speed": {"above": {"uniform": [1, 3]}}, "probability": 0.3}}


def test_the_same_seed_draws_the_same_episode():
    first, again = (load_scenario("perfect_storm").plan(7) for _ in range(2))
    assert first == again
    assert first != load_scenario("perfect_storm").plan(8)
    assert first.world_seed != load_scenario("perfect_storm").plan(8).world_seed


def test_the_same_in_another_process():
    code = "from rudc.scenario import load_scenario as l; s = l('perfect_storm'); print(s.digest, s.plan(11))"
    there = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True,
        env={**os.environ, "PYTHONHASHSEED": "1"},
    )  # fmt: skip
    here = load_scenario("perfect_storm")
    assert there.stdout == f"{here.digest} {here.plan(11)}\n"


def test_a_redrawn_episode_is_another_and_repeatable():
    plan = load_scenario("random_destination").plan(3)
    redrawn = plan.redrawn()
    assert (redrawn.seed, redrawn.attempt) == (3, 1)
    assert redrawn.ego.distance_m != plan.ego.distance_m
    assert redrawn.world_seed != plan.world_seed
    assert redrawn == load_scenario("random_destination").plan(3, attempt=1)
    assert redrawn.redrawn().attempt == 2


def test_no_two_of_many_seeds_draw_alike():
    plans = [load_scenario("random_destination").plan(seed, a) for seed in range(300) for a in range(2)]
    assert len({plan.ego.distance_m for plan in plans}) == 600
    assert len({plan.world_seed for plan in plans}) == 600


def test_defaults():
    plan = scenario().plan(0)
    assert plan.network == "four_way"
    assert (plan.ego.origin, plan.ego.turn, plan.ego.destination) == (None, None, None)
    assert plan.ego.destination_m == 30
    assert (plan.traffic.density, plan.traffic.impatience, plan.traffic.minor_gap_s) == (20, 0.6, 0.6)
    assert plan.traffic.warm_up_s == 5
    assert plan.traffic.mix == {"car": 1.0}
    assert plan.timeout_s == 40
    assert plan.events == ()


@pytest.mark.parametrize(
    ("route", "expected"),
    [
        ("random", (None, None, None)),
        ({"from": "south", "turn": "left"}, ("south", "left", None)),
        ({"from": "random", "turn": "left"}, (None, "left", None)),
        ({"turn": "right"}, (None, "right", None)),
        ({"from": "south"}, ("south", None, None)),
        ({"from": "E1", "to": "E2"}, ("E1", None, "E2")),
        ({"from": -12, "to": 34}, ("-12", None, "34")),
    ],
)
def test_routes(route, expected):
    ego = scenario(ego={"route": route}).plan(0).ego
    assert (ego.origin, ego.turn, ego.destination) == expected


def test_numbers_of_the_episode_are_drawn_and_those_of_vehicles_are_not():
    plan = scenario(
        ego={"speed": {"uniform": [1, 2]}, "distance": {"choice": [20, 30]}},
        traffic={
            "density": {"uniform": [10, 20]},
            "speed": {"uniform": [6, 10]},
            "idm": {"headway": {"normal": [1, 0.2]}},
        },
        episode={"timeout": {"uniform": [20, 30]}},
    ).plan(5)
    assert 1 <= plan.ego.speed_mps <= 2
    assert plan.ego.distance_m in (20, 30)
    assert 10 <= plan.traffic.density <= 20
    assert 20 <= plan.timeout_s <= 30
    assert plan.traffic.speed == distribution({"uniform": [6, 10]})
    assert plan.traffic.headway_s.mean == pytest.approx(1, abs=0.01)


def test_shares_of_the_mix_add_up_to_one():
    mix = scenario(traffic={"mix": {"car": 3, "truck": 1, "bus": 0}}).plan(0).traffic.mix
    assert mix == {"car": 0.75, "truck": 0.25}


@pytest.mark.parametrize("car", [1, {"uniform": [0, 1]}, {"normal": [0.1, 1]}, {"choice": [0.5, 1]}])
def test_a_mix_may_leave_a_type_out_of_some_episodes(car):
    several = scenario(traffic={"mix": {"car": car, "truck": {"choice": [0, 1]}}})
    mixes = [several.plan(seed).traffic.mix for seed in range(20)]
    assert all("car" in mix for mix in mixes)
    assert {"truck" in mix for mix in mixes} == {True, False}


def distributions_in(value) -> list[Distribution]:
    if isinstance(value, Distribution):
        return [value]
    if isinstance(value, tuple):
        return [found for item in value for found in distributions_in(item)]
    if isinstance(value, FileModel):
        return [
            found for name in type(value).model_fields for found in distributions_in(getattr(value, name))
        ]
    return []


def test_every_number_of_an_event_is_fixed():
    events = (
        RARE_BRAKE,
        {
            "kind": "accident",
            "vehicles": [{"position": [{"uniform": [1, 2]}, 3], "heading": {"normal": [0, 90]}}],
        },
        {"kind": "pedestrian_crossing", "arm": "south", "count": {"choice": [2, 3]}},
        {
            "kind": "occlusion",
            "boxes": [{"lane": "a", "at": {"uniform": [1, 2]}, "size": [{"uniform": [1, 2]}, 1]}],
        },
    )
    plan = next(
        plan for seed in range(50) if len((plan := scenario(events=events).plan(seed)).events) == len(events)
    )
    numbers = [number for event in plan.events for number in distributions_in(event)]
    assert len(numbers) >= 15
    assert all(isinstance(number, Constant) for number in numbers)
    brake, accident, walkers, occlusion = plan.events
    assert 3 <= float(brake.deceleration) <= 9
    assert 1 <= float(brake.when.speed.above) <= 3
    assert 1 <= float(accident.vehicles[0].position[0]) <= 2
    assert len(range(walkers.count)) in (2, 3)
    assert 1 <= float(occlusion.boxes[0].size[0]) <= 2


def test_probability_decides_once_an_episode():
    happened = [len(scenario(events=[RARE_BRAKE]).plan(seed).events) for seed in range(1_000)]
    assert np.mean(happened) == pytest.approx(0.3, abs=0.05)
    always, never = ({**BRAKE, "when": {"probability": p}} for p in (1, 0))
    assert all(len(scenario(events=[always, never]).plan(seed).events) == 1 for seed in range(100))


def test_an_episode_that_is_drawn_again_keeps_the_events_that_happen_in_it():
    """With other numbers; else events that make starts hard would happen less often than the file says."""
    event = {"kind": "low_friction", "friction": {"uniform": [0.1, 0.9]}, "when": {"probability": 0.5}}
    source = scenario(events=[event])
    for seed in range(40):
        plans = [source.plan(seed, attempt) for attempt in range(4)]
        assert len({plan.event_numbers for plan in plans}) == 1
        frictions = {float(event.friction) for plan in plans for event in plan.events}
        assert len(frictions) in (0, 4)


def test_events_keep_their_number_in_the_file():
    never = {**BRAKE, "when": {"probability": 0}}
    assert scenario(events=[never, BRAKE, never, BRAKE]).plan(0).event_numbers == (2, 4)


def test_probability_is_no_condition():
    event = scenario(events=[{**BRAKE, "when": {"probability": 1}}]).plan(0).events[0]
    assert event.when is None
    plans = (scenario(events=[RARE_BRAKE]).plan(seed) for seed in range(50))
    event = next(plan for plan in plans if plan.events).events[0]
    assert event.when.probability is None
    assert list(event.when.conditions) == ["speed"]


def test_sections_do_not_disturb_each_other():
    base = scenario(events=[BRAKE]).plan(9)
    other = scenario(
        events=[BRAKE, {"kind": "low_friction", "friction": {"uniform": [0.1, 0.5]}}],
        traffic={"density": {"uniform": [1, 40]}},
        episode={"timeout": {"uniform": [1, 40]}},
    ).plan(9)
    assert other.ego == base.ego
    assert other.events[0] == base.events[0]
    assert other.world_seed == base.world_seed


def test_a_changed_probability_leaves_an_events_numbers():
    likely = {**RARE_BRAKE, "when": {**RARE_BRAKE["when"], "probability": 0.9}}
    seeds = [seed for seed in range(60) if scenario(events=[RARE_BRAKE]).plan(seed).events]
    assert seeds
    for seed in seeds:
        assert scenario(events=[RARE_BRAKE]).plan(seed).events == scenario(events=[likely]).plan(seed).events


@pytest.mark.parametrize(("seed", "attempt", "what"), [(-1, 0, "a seed"), (0, -1, "an attempt")])
def test_negative_seeds_are_refused(seed, attempt, what):
    with pytest.raises(InputError, match=f"{what} cannot be negative, got -1"):
        scenario().plan(seed, attempt)


def test_pickled_and_back():
    original = load_scenario("perfect_storm")
    copy = pickle.loads(pickle.dumps(original))
    assert copy == original
    assert (copy.digest, copy.path) == (original.digest, original.path)
    assert copy.plan(4) == original.plan(4)
    plan = pickle.loads(pickle.dumps(original.plan(4)))
    assert plan.redrawn() == original.plan(4).redrawn()


def test_scenarios_are_frozen():
    with pytest.raises(ValidationError, match="frozen"):
        scenario().network = "t_junction"
    with pytest.raises(ValidationError, match="frozen"):
        scenario().ego.speed = Constant(value=1.0)


class TestDigest:
    def test_ignores_remarks_and_how_it_is_written(self):
        one = scenario(description="One.", ego={"speed": {"normal": [7, 1]}}, traffic={"density": 20})
        other = scenario(
            out_of_distribution="Rare.", ego={"speed": {"normal": {"mean": 7, "std": 1}}, "route": "random"}
        )
        assert one.digest == other.digest
        assert len(one.digest) == 16

    @pytest.mark.parametrize(
        "change",
        [
            {"name": "t"},
            {"network": "t_junction"},
            {"junction": "J"},
            {"ego": {"destination": 31}},
            {"traffic": {"idm": {"decel": 4}}},
            {"events": [BRAKE]},
            {"episode": {"timeout": 41}},
            {"sweep": {"traffic.density": [10]}},
        ],
    )
    def test_changes_with_everything_else(self, change):
        assert scenario(**change).digest != scenario().digest

    def test_sees_the_inside_of_a_network_file_and_not_where_it_lies(self, tmp_path):
        digests = []
        for folder, text in (("a", "<net/>"), ("b", "<net/>"), ("c", "<net></net>")):
            (tmp_path / folder).mkdir()
            path = tmp_path / folder / "x.net.xml"
            path.write_text(text)
            digests.append(scenario(network=str(path), sweep={"network": [str(path)]}).digest)
        assert digests[0] == digests[1] != digests[2]


def test_drawn_shares_of_arms_do_not_depend_on_the_order_of_the_file():
    arms = {"north": {"uniform": [1, 2]}, "east": {"uniform": [3, 5]}, "west": 1}
    one, other = (scenario(traffic={"from": given}) for given in (arms, dict(reversed(arms.items()))))
    assert one.digest == other.digest
    assert one.plan(3).traffic.origins == other.plan(3).traffic.origins
