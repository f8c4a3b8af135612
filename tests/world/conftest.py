"""Scenes made by hand, and a world that all tests of a file share."""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest

from rudc.network.network import Network, load_network
from rudc.vehicle import EgoVehicle
from rudc.world.config import WorldConfig
from rudc.world.scene import EgoState, Kind, Scene
from rudc.world.world import World

SceneMaker = Callable[..., Scene]


@pytest.fixture(scope="session")
def four_way() -> Network:
    return load_network("four_way")


class Worlds:
    """The one world of this process: on the network last asked for."""

    def __init__(self) -> None:
        self._world: World | None = None
        self._asked: object = None

    def __call__(
        self,
        name: str = "four_way",
        config: WorldConfig | None = None,
        vehicle: EgoVehicle | None = None,
    ) -> World:
        """That world, closed and opened anew only where another is asked for."""
        if self._world is None or self._asked != (name, config, vehicle):
            self.close()
            self._world = World(load_network(name, vehicle=vehicle), config)
            self._asked = (name, config, vehicle)
        return self._world

    def close(self) -> None:
        if self._world is not None:
            self._world.close()
        self._world = None


@pytest.fixture(scope="module")
def world_on() -> Iterator[Worlds]:
    worlds = Worlds()
    yield worlds
    worlds.close()


@pytest.fixture
def world(world_on: Worlds) -> World:
    return world_on()


@pytest.fixture(scope="session")
def make_scene(four_way: Network) -> SceneMaker:
    """Scene of an ego `front` m beyond its stop line, among others given as dicts.

    Of each: `row` and `s` on `paths`, or `at` = (x m, y m, heading rad); `v` m/s; `kind`; `size` m.
    """

    def make(
        *others: dict,
        origin: str = "south",
        turn: str = "straight",
        front: float = -10.0,
        v: float = 8.0,
        network: Network = four_way,
        **changes,
    ) -> Scene:
        route = network.route(origin, turn)
        s = route.stop_line_s + front - 2.5
        x, y, psi = (float(value) for value in route.path.pose(s))
        count = len(others)
        position, heading, velocity = np.zeros((count, 2)), np.zeros(count), np.zeros((count, 2))
        size, kind = np.tile([5.0, 1.8], (count, 1)), np.zeros(count, dtype=np.int64)
        path, path_s = np.full(count, -1), np.zeros(count)
        for i, other in enumerate(others):
            if "row" in other:
                path[i], path_s[i] = other["row"], other["s"]
                pose = network.paths.pose(path[i], path_s[i])
            else:
                pose = other["at"]
            position[i], heading[i] = pose[:2], pose[2]
            velocity[i] = other.get("v", 0.0) * np.array([math.cos(heading[i]), math.sin(heading[i])])
            size[i], kind[i] = other.get("size", size[i]), other.get("kind", Kind.CAR)
        scene = Scene(
            time_s=3.0,
            timeout_s=40.0,
            ego=EgoState(x, y, psi, v, 0.0, 0.0, 0.0, 0.0),
            vehicle=EgoVehicle(),
            route=route,
            ego_s=s,
            ego_offset=0.0,
            waited_s=0.0,
            last_u=np.zeros(2),
            network=network,
            ids=tuple(f"other{i}" for i in range(count)),
            position=position,
            heading=heading,
            velocity=velocity,
            acceleration=np.zeros(count),
            size=size,
            kind=kind,
            path=path,
            path_s=path_s,
        )
        return replace(scene, **changes)

    return make
