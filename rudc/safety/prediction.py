"""Where everybody will be, if each follows its own path: what the gate and the last resort look at.

Others follow their row of `network.paths`, straight on if they have none; the ego its route. All keep the
offset from the path, and the angle to it, that they have now.

Not `world.yielding`'s prediction, whose vehicles turn with the path between its stations and keep only their
offset to its side. The two differ by up to 0.1 m and 4 degrees in two seconds, so one for both would make
surrounding vehicles, or the filter, brake elsewhere than measured. `env.conflict` needs no poses: it looks
gaps up by arc length.
"""

from __future__ import annotations

import cmath
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rudc.arrays import Array, Complex, Flags, Index
from rudc.safety.kernels import drives_behind, follow, others_ahead
from rudc.world.scene import Scene

if TYPE_CHECKING:
    from rudc.network.network import Network, Route

GO_ACCELERATION = 2.0
"""m/s2, of an ego that goes on along its route"""
GO_SPEED = 9.0
"""m/s up to which it then accelerates, unless it is faster already"""
TAIL = 45.0
"""m behind the ego on its path, within which those who follow it are looked for"""
LANE = 1.5
"""m from the path within which one drives on it"""
ALONG = 0.7
"""cosine of the angle to the path up to which one drives along it"""


class Tracks(NamedTuple):
    """P lines with M stations at a common spacing, as kernels take them."""

    place: Complex
    """(P, M) m"""
    facing: Complex
    """(P, M) directions"""
    spacing: float
    """m"""


def _tracks(xy: Array, heading: Array, spacing: float) -> Tracks:
    return Tracks(xy[..., 0] + 1j * xy[..., 1], np.exp(1j * heading), spacing)


def bodies(scene: Scene) -> tuple[Array, Array, Array, Index, Array]:
    """What kernels take of the others: positions, headings, velocities, paths and arc lengths on them."""
    return scene.position, scene.heading, scene.velocity, scene.path, scene.path_s


class Predictor:
    """Predicts along paths; remembers the network and the route that it saw last."""

    def __init__(self) -> None:
        self._network: tuple[Network, Tracks] | None = None
        self._route: tuple[Route, Tracks] | None = None

    def ego(self, scene: Scene, way: Array) -> tuple[Complex, Complex]:
        """(T,) m and (T,): the ego after `way` (T,) m along its route."""
        ego = scene.ego
        here, heading = complex(ego.x, ego.y), cmath.exp(1j * ego.psi)
        return follow(*self.route(scene), 0, scene.ego_s, here, heading, way)

    def others(self, scene: Scene, who: Index, way: Array) -> tuple[Complex, Complex]:
        """(n, T) m and (n, T): the same of others `who` (n,) after `way` (n, T) m."""
        return others_ahead(*bodies(scene), *self.paths(scene), who, way)

    def following(self, scene: Scene, place: Complex, facing: Complex) -> Flags:
        """(n,) whether someone at `place` (n,) m, facing `facing` (n,), drives behind the ego on its path."""
        line, directions, spacing = self.route(scene)
        behind = [
            drives_behind(line, directions, spacing, scene.ego_s, TAIL, LANE, ALONG, here, heading)
            for here, heading in zip(place.tolist(), facing.tolist(), strict=True)
        ]
        return np.array(behind, dtype=np.bool_)

    def paths(self, scene: Scene) -> Tracks:
        """The ways through the junction."""
        if self._network is None or self._network[0] is not scene.network:
            paths = scene.network.paths
            self._network = scene.network, _tracks(paths.xy, paths.heading, paths.ds)
        return self._network[1]

    def route(self, scene: Scene) -> Tracks:
        """The ego's route, the only line."""
        if self._route is None or self._route[0] is not scene.route:
            path = scene.route.path
            spacing = float(path.s[1] - path.s[0])
            self._route = scene.route, _tracks(path.xy[None], path.heading[None], spacing)
        return self._route[1]
