"""Scenes made by hand on the shipped four-way junction, for tests that need no simulation."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from rudc.network.network import Network, load_network
from rudc.vehicle import EgoVehicle
from rudc.world.scene import EgoState, Kind, Scene
from tests.agents.conftest import scene_on  # noqa: F401  # a fixture of both

SceneMaker = Callable[..., Scene]


@pytest.fixture(scope="session")
def network() -> Network:
    return load_network("four_way")


@pytest.fixture(scope="session")
def make_scene(network: Network) -> SceneMaker:
    """Scene of the ego at arc length s on a route, among others given as (row, s, speed, acceleration).

    A row of -1 with s = (x, y, heading) is somebody without a path.
    """

    def make(
        origin: str = "south",
        turn: str = "left",
        s: float = 90.0,
        v: float = 8.0,
        offset: float = 0.0,
        turned: float = 0.0,
        others: list[tuple] = (),
        size: tuple[float, float] = (5.0, 1.8),
        **changes: object,
    ) -> Scene:
        route = network.route(origin, turn)
        x, y, psi = (float(value) for value in route.path.pose(s))
        x, y = x - offset * math.sin(psi), y + offset * math.cos(psi)
        poses, rows, along = [], [], []
        for row, place, *_ in others:
            if row >= 0:
                px, py, heading = (
                    float(value) for value in network.paths.pose(np.int64(row), np.float64(place))
                )
            else:
                px, py, heading = place
            poses.append((px, py, heading))
            rows.append(row)
            along.append(place if row >= 0 else 0.0)
        poses = np.array(poses, dtype=float).reshape(-1, 3)
        order = np.argsort(np.hypot(poses[:, 0] - x, poses[:, 1] - y))
        speed = np.array([other[2] for other in others], dtype=float)[order]
        acceleration = np.array([other[3] for other in others], dtype=float)[order]
        heading = poses[order, 2]
        fields = {
            "time_s": 3.0,
            "timeout_s": 40.0,
            "ego": EgoState(x, y, psi + turned, v, 0.0, 0.0, 0.0, 0.0),
            "vehicle": EgoVehicle(),
            "route": route,
            "ego_s": s,
            "ego_offset": offset,
            "waited_s": 0.0,
            "last_u": np.zeros(2),
            "network": network,
            "ids": tuple(f"v{i}" for i in order),
            "position": poses[order, :2],
            "heading": heading,
            "velocity": speed[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=1),
            "acceleration": acceleration,
            "size": np.tile(size, (len(others), 1)).astype(float),
            "kind": np.full(len(others), int(Kind.CAR)),
            "path": np.array(rows, dtype=np.int64)[order],
            "path_s": np.array(along, dtype=float)[order],
            "destination_s": route.exit_s + 20.0,
        }
        return Scene(**(fields | changes))

    return make


@pytest.fixture(scope="session")
def random_others(network: Network) -> Callable[..., list[tuple]]:
    """n others anywhere on the paths."""

    def draw(rng: np.random.Generator, n: int) -> list[tuple]:
        rows = rng.integers(0, network.paths.count, n)
        return [
            (int(row), float(s), float(v), float(a))
            for row, s, v, a in zip(
                rows, rng.uniform(40, 220, n), rng.uniform(0, 11, n), rng.uniform(-3, 2, n), strict=True
            )
        ]

    return draw


@pytest.fixture(scope="session")
def row_of(network: Network) -> Callable[[str, str], int]:
    """First row of the paths from one arm to another."""

    def find(origin: str, destination: str) -> int:
        names = [arm.name for arm in network.arms]
        a, b = names.index(origin), names.index(destination)
        return int(np.flatnonzero((network.paths.origin == a) & (network.paths.destination == b))[0])

    return find
