"""What drivers reckon with on poor roads and in cars that lag, against the plant that drives there."""

# ruff: noqa: F811 -- fixtures come by import
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from rudc.agents.adaptation import Adaptation
from rudc.agents.approach import PLANNED
from rudc.agents.gap_acceptance import GapAcceptance
from rudc.agents.gaps import ACCELERATION, driving_on
from rudc.env.tracking import planned, slowing, speeds_on_road, steering
from rudc.vehicle import Actuation
from rudc.world.ego import EgoPlant
from rudc.world.scene import Scene
from tests.world.conftest import four_way, make_scene  # noqa: F401 -- fixtures

DT = 0.1


def driven(scene: Scene, act: Callable[[Scene], np.ndarray]) -> Iterator[tuple[Scene, Scene]]:
    """The scene as the driver is shown it and as it is, decision by decision; the car is known."""
    plant, adaptation = EgoPlant(scene.vehicle), Adaptation("known", probe=False)
    plant.resume(scene.ego, scene.actuation)
    adaptation.reset(scene)
    while True:
        shown = adaptation.see(scene)
        yield shown, scene
        u = adaptation.govern(shown, act(shown))
        ego = plant.step(float(u[0]), float(u[1]), DT)
        s, offset = scene.route.path.project(ego.x, ego.y, scene.ego_s)
        scene = replace(scene, time_s=scene.time_s + DT, ego=ego, ego_s=s, ego_offset=offset, last_u=u)


@pytest.mark.parametrize("v", [0.0, 5.0])
@pytest.mark.parametrize("turn", ["left", "straight", "right"])
@pytest.mark.parametrize(
    "car",
    [{}, {"friction": 0.4}, {"friction": 0.3}, {"friction": 0.2}, {"lag_s": 0.3}, {"lag_s": 0.6}],
    ids=str,
)
def test_the_ego_is_through_when_its_driver_reckons(make_scene, car, turn, v):
    """On ice it left conflicts up to 2 s later than reckoned, with lags of 0.6 s and more by that lag."""
    driver, actuation = GapAcceptance(), Actuation(**car)
    scene = replace(make_scene(turn=turn, front=-1.0 - v, v=v), actuation=actuation)
    route = scene.route
    through = 0.5 * (route.stop_line_s + route.exit_s) + 8.0
    for k, (shown, now) in enumerate(driven(scene, lambda shown: driver.act(shown).u)):
        if k == 0:
            most = min(ACCELERATION, shown.vehicle.a_max)
            ahead, time, _ = driving_on(shown, speeds_on_road(shown), most)
            reckoned = float(np.interp(through - shown.ego_s, ahead, time))
        if now.ego_s > through:
            break
    assert -0.4 < k * DT - reckoned < 0.75


@pytest.mark.parametrize("lag_s", [0.0, 0.1, 0.3, 0.6])
@pytest.mark.parametrize(("v", "way"), [(4.0, 12.0), (8.5, 30.0), (12.0, 70.0)])
def test_however_late_the_brakes_the_ego_stops_where_it_is_to_stop(make_scene, lag_s, v, way):
    """With a lag of 0.6 s it was too fast for its brakes before that place: 7 m/s 3 m before it."""
    scene = make_scene(turn="straight", front=-75.0, v=v)
    scene, goal = replace(scene, actuation=Actuation(lag_s=lag_s)), scene.ego_s + way

    def act(shown: Scene) -> np.ndarray:
        a = slowing(shown, goal - shown.ego_s, 0.0, planned(shown, PLANNED))
        return np.array([min(a, (v - shown.ego.v) / 0.4, 2.0), steering(shown)])

    for shown, _ in islice(driven(scene, act), 400):
        assert shown.ego.v**2 / (2.0 * -shown.vehicle.a_min) <= goal - shown.ego_s + 0.6
    assert abs(goal - shown.ego_s) < 0.6


@pytest.mark.parametrize("lag_s", [0.5, 1.0, 3.0])
def test_late_brakes_are_asked_for_all_where_the_room_is_short(make_scene, lag_s):
    """What the lag leaves of 8 m takes full braking from 6 m/s."""
    scene = replace(make_scene(turn="straight", front=-60.0, v=6.0), lag_s=lag_s)
    assert slowing(scene, 8.0 if lag_s == 0.5 else 6.0, 0.0, 2.0) <= -3.5
    assert slowing(scene, 6.0 * lag_s + 3.0, 0.0, 2.0) == scene.vehicle.a_min
    assert slowing(scene, 60.0, 0.0, 2.0) > 0.0
