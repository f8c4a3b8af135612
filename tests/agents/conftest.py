"""Scenes made by hand on shipped networks, for drivers that look at one scene at a time."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest

from rudc.network.network import load_network
from rudc.vehicle import EgoVehicle
from rudc.world.scene import EgoState, Kind, Scene


class Other(NamedTuple):
    """Somebody on a row of the network's paths, or (row -1) at a place (x, y, heading)."""

    row: int
    s: float
    speed: float
    place: tuple[float, float, float] = (0.0, 0.0, 0.0)
    kind: Kind = Kind.CAR


def _size(kind: Kind) -> tuple[float, float]:
    return (0.5, 0.5) if kind == Kind.PEDESTRIAN else (5.0, 1.8)


@pytest.fixture(scope="session")
def scene_on() -> Callable[..., Scene]:
    """The ego at arc length s of a route, at v m/s, among others."""

    def make(
        origin: str,
        towards: str,
        s: float,
        v: float,
        others: tuple[Other, ...] = (),
        *,
        network_name: str = "four_way",
        offset: float = 0.0,
        state: EgoState | None = None,
        waited_s: float = 0.0,
    ) -> Scene:
        network = load_network(network_name)
        route = network.route(origin, towards)
        if state is None:
            x, y, psi = (float(value) for value in route.path.pose(s))
            state = EgoState(
                x - offset * math.sin(psi), y + offset * math.cos(psi), psi, v, 0.0, 0.0, 0.0, 0.0
            )
        n = len(others)
        poses = np.array(
            [
                o.place
                if o.row < 0
                else [float(p) for p in network.paths.pose(np.int64(o.row), np.float64(o.s))]
                for o in others
            ]
        ).reshape(n, 3)
        speed = np.array([o.speed for o in others])
        return Scene(
            time_s=5.0, timeout_s=40.0, ego=state, vehicle=EgoVehicle(), route=route, ego_s=s,
            ego_offset=offset, waited_s=waited_s, last_u=np.zeros(2), network=network,
            ids=tuple(f"o{i}" for i in range(n)),
            position=poses[:, :2], heading=poses[:, 2],
            velocity=speed[:, None] * np.stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])], axis=1),
            acceleration=np.zeros(n),
            size=np.array([_size(o.kind) for o in others]).reshape(n, 2),
            kind=np.array([int(o.kind) for o in others], dtype=np.int64),
            path=np.array([o.row for o in others], dtype=np.int64), path_s=np.array([o.s for o in others]),
        )  # fmt: skip

    return make
