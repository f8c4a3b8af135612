"""How an ego meets a vehicle that should give way to it and does not look like it; on scenes made by hand."""

# ruff: noqa: F811 -- fixtures come by import
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from rudc.agents import not_yielding
from rudc.agents.gaps import crossing
from rudc.agents.not_yielding import NEEDED, SHARE, ready_for_not_yielding
from rudc.agents.registry import make_agent
from rudc.network.network import load_network
from rudc.vehicle import EgoVehicle
from rudc.world.ego import EgoPlant
from tests.world.conftest import four_way, make_scene  # noqa: F401 -- fixtures

FULL = np.array([3.0, 0.0])


@pytest.fixture(scope="module")
def minor(four_way):
    """A row from the south, straight on, which gives way to the ego from the west."""
    route = four_way.route("west", "straight")
    row = four_way.movement("south", "straight").rows[0]
    assert four_way.paths.yields[row, route.row]
    return row


def meets(four_way, make_scene, row, *, ego=16.0, v=7.0, other=16.0, speed=9.0, a=0.0, turn="straight"):
    """A scene: an ego `ego` m before the conflict at v m/s, an SV `other` m before it at `speed` m/s that
    accelerates at a m/s2."""
    route = four_way.route("west", turn)
    begin, _, its_begin, _ = four_way.conflict(route)[row].tolist()
    them = {"row": row, "s": its_begin - 2.5 - other, "v": speed}
    scene = make_scene(them, origin="west", turn=turn, front=begin - ego - route.stop_line_s, v=v)
    return replace(scene, acceleration=np.full(scene.count, float(a)))


def bounded(scene):
    """m/s2 that is left of full acceleration."""
    return float(ready_for_not_yielding(scene, FULL)[0])


def test_it_is_ready_to_stop_before_a_vehicle_that_does_not_brake(four_way, make_scene, minor):
    scene = meets(four_way, make_scene, minor, ego=6.0, other=8.0)
    assert not crossing(scene).yields.any()
    assert bounded(scene) < 0.0


def test_it_stops_before_that_vehicles_way_and_goes_on_once_it_is_gone(four_way, make_scene, minor):
    """Driven with full acceleration asked for: the other comes through at constant speed."""
    scene = meets(four_way, make_scene, minor)
    plant, s, end = EgoPlant(scene.vehicle), scene.ego_s, four_way.conflict(scene.route)[minor, 0]
    plant.resume(scene.ego, plant.actuation)
    half, gone = 0.5 * scene.vehicle.length, four_way.conflict(scene.route)[minor, 3] + 2.5
    fronts, speeds = [], []
    for t in range(60):
        x, y, psi = scene.route.path.pose(s)
        its_s = float(scene.path_s[0]) + 0.9 * t
        place, heading = four_way.paths.pose(np.array([minor]), np.array([its_s]))[:2], scene.heading
        now = replace(
            scene, ego=replace(plant.state, x=float(x), y=float(y), psi=float(psi)), ego_s=s,
            position=np.stack(place, axis=1), heading=heading, path_s=np.array([its_s]),
        )  # fmt: skip
        a = bounded(now)
        if its_s < gone - 1.0:
            fronts.append(s + half)
        else:
            assert a == FULL[0]
            break
        before = plant.state.v
        s += 0.05 * (before + plant.step(a, 0.0, 0.1).v)
        speeds.append(plant.state.v)
    assert max(fronts) < end
    assert min(speeds) < 6.0


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ({"a": -1.01 * SHARE * 9.0**2 / (2 * 16.0)}, "it brakes"),
        ({"other": 9.0**2 / (2 * 0.9 * NEEDED)}, "it is far away still"),
        ({"other": 40.0, "speed": 11.0, "ego": 2.0}, "the ego is gone long before"),
        ({"ego": 60.0, "v": 3.0, "other": 8.0}, "it is gone long before the ego comes"),
        ({"ego": 3.0, "v": 8.0, "other": 10.0}, "the ego cannot stop before its way any more"),
        ({"ego": 1.0, "v": 1.0, "other": 0.05, "speed": 1.0}, "who creeps can stop where it is"),
    ],
)
def test_the_command_stays_where_nothing_is_to_be_feared(four_way, make_scene, minor, given, why):
    scene = meets(four_way, make_scene, minor, **given)
    assert bounded(scene) == FULL[0], why


def test_who_goes_first_is_none_of_its_business(four_way, make_scene):
    """The ego from the south gives way itself: that is the approach's."""
    route = four_way.route("south", "straight")
    row = four_way.movement("west", "straight").rows[0]
    begin, _, its_begin, _ = four_way.conflict(route)[row].tolist()
    them = {"row": row, "s": its_begin - 18.0, "v": 9.0}
    scene = make_scene(them, origin="south", front=begin - 18.0 - route.stop_line_s, v=7.0)
    assert crossing(scene).yields.all()
    assert bounded(scene) == FULL[0]


def test_on_a_slippery_road_it_begins_to_brake_earlier(four_way, make_scene, minor):
    dry = meets(four_way, make_scene, minor, ego=20.0, other=20.0)
    icy = replace(dry, vehicle=replace(dry.vehicle, a_min=-2.0, a_max=2.0))
    assert bounded(icy) < bounded(dry)


def test_on_a_slippery_road_a_slow_vehicle_that_does_not_brake_is_met_too(four_way, make_scene, minor):
    """It needs 1 m/s2: on a dry road it may still brake late; on ice it would have begun."""
    dry = meets(four_way, make_scene, minor, ego=10.0, v=6.0, other=8.0, speed=4.0)
    icy = replace(dry, vehicle=replace(dry.vehicle, a_min=-3.0))
    assert bounded(dry) == FULL[0]
    assert bounded(icy) < 1.0, "it no longer accelerates fully"
    brakes = replace(icy, acceleration=np.full(icy.count, -0.6))
    assert bounded(brakes) == FULL[0]


def test_weak_brakes_do_not_make_the_road_slippery(make_scene):
    """How the others begin to brake was read off the ego's brakes."""
    network = load_network("four_way", vehicle=EgoVehicle(a_min=-3.0))
    row = network.movement("south", "straight").rows[0]
    own = partial(make_scene, network=network, vehicle=network.vehicle)
    dry = meets(network, own, row, ego=10.0, v=6.0, other=8.0, speed=4.0)
    icy = replace(dry, vehicle=replace(dry.vehicle, a_min=-1.9))
    assert bounded(dry) == FULL[0]
    assert bounded(icy) < FULL[0]


def test_agents_are_bounded_by_it_with_approach_only(four_way, make_scene, minor):
    scene = meets(four_way, make_scene, minor, ego=6.0, other=8.0)
    held = {}
    for approach in ("true", "false"):
        agent = make_agent(f"gap-acceptance:outlook.course=true,outlook.approach={approach}")
        layer = agent
        while not hasattr(layer, "outlook"):
            layer = layer.inner
        layer.outlook.reset(scene)
        shown = layer.outlook.see(scene)
        held[approach] = float(layer.outlook.govern(shown, FULL)[0])
    assert held["true"] < held["false"] - 1.0


def test_the_quick_look_overlooks_nobody(four_way, make_scene, monkeypatch):
    """With and without it the same bounds, in scenes at random."""
    rng, bounds = np.random.default_rng(3), []
    scenes = []
    for _ in range(1000):
        others = [
            {"row": int(row), "s": float(rng.uniform(95, 125)), "v": float(rng.uniform(4, 12))}
            for row in rng.integers(0, four_way.paths.count, 10)
        ]
        turn = str(rng.choice(["left", "straight", "right"]))
        origin, front, v = str(rng.choice(["west", "south"])), rng.uniform(-8, 4), rng.uniform(2, 7)
        scene = make_scene(*others, origin=origin, turn=turn, front=float(front), v=float(v))
        body = replace(scene.vehicle, a_min=float(rng.choice([-6.0, -2.0])))
        scenes.append(replace(scene, vehicle=body, acceleration=rng.uniform(-3.0, 1.0, scene.count)))
    for look in (not_yielding._may_heed, lambda *_: True):
        monkeypatch.setattr(not_yielding, "_may_heed", look)
        bounds.append([bounded(scene) for scene in scenes])
    assert bounds[0] == bounds[1]
    assert 20 < sum(a < FULL[0] for a in bounds[0]) < 980
