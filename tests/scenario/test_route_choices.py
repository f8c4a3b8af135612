"""The ego's route may be drawn: where it comes from, where it turns, where it goes."""

import json
from collections import Counter

import numpy as np
import pytest

from rudc.evaluation.preflight import never_happening
from rudc.network.network import load_network
from rudc.scenario.sections import Ego
from rudc.world.spawn import movements_of
from tests.scenario.test_errors import check
from tests.scenario.test_json_schema import SCHEMA, valid
from tests.scenario.test_plan import scenario
from tests.world.test_fitting import problems

__all__ = ["problems"]

EITHER = {
    "from": {"choice": ["north", "east"]},
    "turn": {"choice": {"values": ["left", "right"], "weights": [3, 1]}},
}


def test_a_route_is_drawn_with_its_weights_anew_for_each_episode():
    drawn = scenario(ego={"route": EITHER})
    egos = [drawn.plan(seed).ego for seed in range(400)]
    counts = Counter((ego.origin, ego.turn) for ego in egos)
    assert set(counts) == {(arm, turn) for arm in ("north", "east") for turn in ("left", "right")}
    assert abs(counts["north", "left"] + counts["east", "left"] - 300) < 35  # four standard deviations
    assert abs(counts["north", "left"] + counts["north", "right"] - 200) < 40
    assert all(ego.destination is None for ego in egos)
    to = scenario(ego={"route": {"from": "north", "to": {"choice": ["west", "south"]}}})
    assert {to.plan(seed).ego.destination for seed in range(20)} == {"west", "south"}
    perhaps = scenario(ego={"route": {"from": {"choice": ["north", "random"]}}})
    assert {perhaps.plan(seed).ego.origin for seed in range(20)} == {"north", None}


def test_a_route_that_is_fixed_draws_nothing():
    fixed, free = scenario(ego={"route": {"from": "north", "turn": "left"}}), scenario()
    drawn = scenario(ego={"route": EITHER})
    speeds = [[s.plan(seed).ego.speed_mps for seed in range(5)] for s in (fixed, free, drawn)]
    assert speeds[0] == speeds[1] != speeds[2]


def test_what_is_written_out_is_read_back_the_same_and_an_editor_takes_it():
    first = scenario(ego={"route": EITHER})
    assert scenario(**json.loads(json.dumps(first.data()))) == first
    assert valid({"name": "s", "ego": {"route": EITHER}}, SCHEMA)
    assert not valid({"name": "s", "ego": {"route": {"turn": {"choice": ["left", "back"]}}}}, SCHEMA)


def test_every_route_that_may_be_drawn_is_known():
    ego, network = Ego.model_validate({"route": EITHER}), load_network("four_way")
    plans = [one.plan(np.random.default_rng(0)) for one in ego.each()]
    found = {(m.origin, m.destination) for plan in plans for m in movements_of(network, plan)}
    assert found == {("north", "east"), ("north", "west"), ("east", "south"), ("east", "north")}


@pytest.mark.parametrize(
    ("route", "said"),
    [
        (
            "{from: {choice: [west, south]}, turn: {choice: [right, left]}}",
            "3:14: ego.route: network t_junction has no movement from west with `turn: left`; it has ...",
        ),
        (
            "{from: {choice: [west, norht]}, turn: right}",
            "3:21: ego.route.from: no arm 'norht' in network t_junction...",
        ),
        (
            "{from: {choice: [west, random]}, to: south}",
            "3:47: ego.route.to: does not go with `from: random`...",
        ),
        (
            "{from: west, turn: {choice: [right, back]}}",
            "...ego.route.turn.choice.1: expected one of left, straight, right, random; got the text 'back'",
        ),
    ],
)
def test_each_must_fit_the_network(problems, route, said):
    check(problems(f"name: a\nnetwork: t_junction\nego: {{route: {route}}}\n"), said)


@pytest.mark.parametrize(("arms", "warned"), [(["south"], True), (["south", "west"], False)])
def test_who_comes_from_nowhere_does_so_for_every_route(arms, warned):
    """From the stem of a T nobody comes towards the EV."""
    slow = {"kind": "slow_vehicle", "vehicle": "oncoming", "speed": 3}
    drawn = scenario(network="t_junction", ego={"route": {"from": {"choice": arms}}}, events=[slow])
    assert bool(never_happening(drawn)) == warned
