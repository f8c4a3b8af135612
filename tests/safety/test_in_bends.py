"""Who leads and who follows in a bend, where the body of a long vehicle is beside its path."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rudc.env.tracking import steering
from rudc.geometry import gaps_between
from rudc.network.line_kernels import body_on_line
from rudc.network.route import ReferencePath
from rudc.safety.filter import FilterConfig, SafetyFilter
from rudc.safety.last_resort import LastResort
from rudc.safety.prediction import following
from rudc.vehicle import EgoVehicle
from rudc.world.ego import EgoPlant, EgoState
from rudc.world.scene import Scene
from tests.safety.scenes import Network, Other, Paths, Road, make_scene, straight_road

SIZES = {"car": (5.0, 1.8), "bus": (12.0, 2.5), "lorry": (16.5, 2.55)}
FILTERS = {"ttcbf": FilterConfig(road=False), "no rows": FilterConfig(max_vehicles=0, road=False)}


def bend(radius: float) -> Road:
    """100 m eastwards, a quarter of a circle to the right, 80 m southwards."""
    angle = np.linspace(0.0, math.pi / 2, 60)
    arc = radius * np.stack([np.sin(angle), np.cos(angle) - 1.0], axis=1)
    path = ReferencePath(np.vstack([[[-100.0, 0.0]], arc, [[radius, -radius - 80.0]]]))
    up = np.array([0.0, 50.0])
    return Road(path, path.xy + up, path.xy - up)


def among(road: Road, ego: EgoState, ego_s: float, s: float, speed: float, kind: str, a: float) -> Scene:
    """The ego and somebody at `s` m of its path."""
    path, (length, width) = road.path, SIZES[kind]
    network = Network(Paths(path.xy[None], path.heading[None]))
    here, facing = body_on_line(network.paths.poses, network.paths.stations, 0, s, length)
    other = Other(here.real, here.imag, float(np.angle(facing)), speed, length, width, 0, s)
    scene = make_scene([other], route=road, network=network, acceleration=np.array([a]))
    ego_s, offset = path.project(ego.x, ego.y, ego_s)
    return replace(scene, ego=ego, ego_s=ego_s, ego_offset=offset)


def gap(scene: Scene) -> float:
    """m, between the ego and the other."""
    ego, size = scene.ego, np.array([scene.vehicle.length, scene.vehicle.width])
    own = np.array([[ego.x, ego.y]]), np.array([ego.psi]), size
    return float(gaps_between(*own, scene.position, scene.heading, scene.size)[0])


def at_rest_behind(kind: str, radius: float, speed: float, brakes_at: float, config: FilterConfig) -> float:
    """Least gap (m) of an ego that drives full throttle along its path, at most 9 m/s, behind somebody who at
    `brakes_at` m brakes from `speed` m/s with 8 m/s2."""
    road, filter, plant = bend(radius), SafetyFilter(config), EgoPlant(EgoVehicle())
    s, ego_s, least, a = 85.0, 85.0 - 0.5 * SIZES[kind][0] - 10.5, math.inf, 0.0
    plant.reset(*map(float, road.path.pose(ego_s)), speed)
    ego = plant.state
    while speed > 0.0 or ego.v > 0.01:
        scene = among(road, ego, ego_s, s, speed, kind, a)
        ego_s, least = scene.ego_s, min(least, gap(scene))
        if least <= 0.0:
            break
        answer = filter.filter(scene, np.array([min(3.0, (9.0 - ego.v) / 0.4), steering(scene)]))
        a = -8.0 if s >= brakes_at and speed > 0.0 else 0.0
        for _ in range(2):
            ego = plant.step(*map(float, answer.u), 0.05)
            after = max(speed + a * 0.05, 0.0)
            s, speed = s + 0.025 * (speed + after), after
        if speed == 0.0 and ego.v < 0.01:
            break
    return least


@pytest.mark.parametrize("config", FILTERS.values(), ids=FILTERS.keys())
@pytest.mark.parametrize(
    ("kind", "radius", "speed", "brakes_at"),
    [
        ("car", 12, 8.0, 107),
        ("bus", 8, 5.0, 110),
        ("bus", 12, 8.0, 110),
        ("lorry", 8, 5.0, 107),
        ("lorry", 12, 5.0, 110),
    ],
)
def test_a_leader_that_brakes_in_a_bend_is_not_hit(kind, radius, speed, brakes_at, config):
    """A long one was not known for a leader, for its centre is beside the path; and full braking steered into
    the bend, and into it, although the stop that the action before relied on went straight on."""
    assert at_rest_behind(kind, radius, speed, brakes_at, config) > 0.0


@pytest.mark.parametrize("kind", SIZES)
@pytest.mark.parametrize("radius", [8, 12])
def test_who_drives_behind_in_a_bend_does(kind, radius):
    """The ego that braked before a bus was told to go on."""
    road, half = bend(radius), 0.5 * SIZES[kind][0]
    for at in (103.0, 109.0, 115.0, 118.0):
        for away in (3.0, 8.0):
            x, y, psi = map(float, road.path.pose(at))
            ego = EgoState(x, y, psi, 2.0, 0.0, 0.0, 0.0, 0.0)
            scene = among(road, ego, at, at - 2.5 - away - half, 5.0, kind, 0.0)
            assert following(scene, np.array([0])).all(), (at, away)
            assert SafetyFilter(FILTERS["no rows"]).filter(scene, np.array([-6.0, 0.0])).status == "nominal"


@pytest.mark.parametrize("turned", [0.4, 0.5, 0.6])
def test_before_a_bend_it_can_stop_along_its_road_for_those_who_move(turned: float) -> None:
    """Held, the wheels lead into the other lane, where somebody comes; its own lane has a slow leader."""
    oncoming = Other(15.6 * math.sin(turned), 15.6 * math.cos(turned) - 12.0, math.pi - turned, 0.6)
    leader = Other(12.0 * math.sin(1.15), 12.0 * math.cos(1.15) - 12.0, -1.15, 0.6)
    judge, weak = LastResort(FILTERS["no rows"]), EgoVehicle(a_min=-3.0)
    for road, brakes in ((bend(12.0), False), (straight_road(), True)):
        scene = make_scene([oncoming, leader], x=-2.0, v=7.0, route=road, vehicle=weak)
        instead = judge.instead_of(scene, np.array([1.0, 0.0]))
        assert (instead is not None and not instead.onwards) is brakes
