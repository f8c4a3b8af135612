"""Which others the filter constrains: those whose predicted path meets the ego's.

The barrier assumes that others keep their velocity, so that a vehicle which turns off before the ego, or
oncoming traffic on its own lane, looks like a threat. The gate asks first whether the two meet when each
follows its own path at its present speed: others along their row of `network.paths` (straight on if they have
none), the ego along its route, both keeping the offset from the path that they have now. A vehicle is let
through to the rows if at some instant within the horizon

    |r| < rho_e + rho_o + gate_distance

with the ellipses' support radii (see `barrier`) at the predicted poses.

Not let through is who drives behind the ego on the ego's own path: that distance is theirs to keep. The
barrier has the two push each other apart, so that a vehicle coming up from behind at constant speed makes a
waiting ego drive into the one ahead.
"""

from __future__ import annotations

import cmath
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rudc.safety.barrier import CLOSEST, Array, Complex
from rudc.safety.config import FilterConfig
from rudc.world.scene import Scene

if TYPE_CHECKING:
    from rudc.world.network import Network, Route

TAIL = 45.0
"""m behind the ego on its path, within which those who follow it are looked for"""
LANE = 1.5
"""m from the path within which one drives on it"""
ALONG = 0.7
"""cosine of the angle to the path up to which one drives along it"""


class _Tracks:
    """Lines with stations at a common spacing, as complex numbers, for asking where one is after s metres."""

    def __init__(self, xy: Array, heading: Array, spacing: float) -> None:
        """`xy` (P, M, 2) m, `heading` (P, M) rad, `spacing` m."""
        self.place: Complex = xy[..., 0] + 1j * xy[..., 1]
        self.facing: Complex = np.exp(1j * heading)
        self.spacing = spacing
        self._stations = xy.shape[1]
        self._step: Complex = np.diff(self.place, append=self.place[:, -1:]).ravel()
        self._place, self._facing = self.place.ravel(), self.facing.ravel()

    def at(self, rows: NDArray[np.int64] | int, s: Array) -> tuple[Complex, Complex]:
        """Places (...) m and directions (...) at arc lengths `s` (...) m; straight on beyond the ends."""
        stations = s * (1.0 / self.spacing)
        i = np.minimum(np.maximum(stations, 0.0), self._stations - 2.0).astype(np.int64)
        part = stations - i
        i += rows * self._stations
        return self._place[i] + part * self._step[i], self._facing[i]


class Gate:
    """Picks the others that the ego may meet."""

    def __init__(self, config: FilterConfig) -> None:
        steps = int(np.ceil(config.gate_horizon / config.gate_step - 1e-9))
        self._times: Array = np.linspace(0.0, config.gate_horizon, steps + 1)
        self._horizon = config.gate_horizon
        self._gap = config.gate_distance
        self._network: tuple[Network, _Tracks] | None = None
        self._route: tuple[Route, _Tracks] | None = None

    def meeting(self, scene: Scene, short: Array, stretch: Array) -> NDArray[np.int64]:
        """Indices, nearest first, of those whose ellipse comes closer to the ego's than the gate distance.

        `short` and `stretch` (2, N) m2: squares of the half axes across, and along minus across, of ego and
        others.
        """
        now: Complex = scene.position[:, 0] + 1j * scene.position[:, 1]
        drift: Complex = scene.velocity[:, 0] + 1j * scene.velocity[:, 1]
        speed: Array = np.abs(drift)
        longest: Array = np.sqrt(short + np.maximum(stretch, 0.0)).sum(axis=0)
        reach = (speed + scene.ego.v) * self._horizon + longest + self._gap
        who = np.flatnonzero(np.abs(now - complex(scene.ego.x, scene.ego.y)) < reach)
        if not len(who):
            return who
        now = now[who]
        place, facing = self._ego(scene)
        others, turned = self._others(scene, who, now, drift[who], speed[who])
        r = place - others
        along, own = r * facing.conj(), r * turned.conj()
        squared = np.maximum(along.real**2 + along.imag**2, CLOSEST)
        ego_radius = np.sqrt(short[0, who, None] + stretch[0, who, None] * (along.real**2 / squared))
        radius = np.sqrt(short[1, who, None] + stretch[1, who, None] * (own.real**2 / squared))
        meet = np.flatnonzero((np.sqrt(squared) < ego_radius + radius + self._gap).any(axis=1))
        if not len(meet):
            return meet
        return who[meet[~self._following(scene, now[meet], turned[meet, 0])]]

    def _path(self, scene: Scene) -> _Tracks:
        if self._route is None or self._route[0] is not scene.route:
            path = scene.route.path
            spacing = float(path.s[1] - path.s[0])
            self._route = scene.route, _Tracks(path.xy[None], path.heading[None], spacing)
        return self._route[1]

    def _ego(self, scene: Scene) -> tuple[Complex, Complex]:
        """(T,) m and (T,): where the ego is and which way it faces at the instants looked at."""
        path, along = self._path(scene).at(0, scene.ego_s + scene.ego.v * self._times)
        start = complex(along[0]).conjugate()
        offset = (complex(scene.ego.x, scene.ego.y) - complex(path[0])) * start
        return path + offset * along, (cmath.exp(1j * scene.ego.psi) * start) * along

    def _others(
        self, scene: Scene, who: NDArray[np.int64], now: Complex, drift: Complex, speed: Array
    ) -> tuple[Complex, Complex]:
        """(n, T) m and (n, T): the same of others `who` (n,), at `now` m with velocity `drift` m/s."""
        if self._network is None or self._network[0] is not scene.network:
            paths = scene.network.paths
            self._network = scene.network, _Tracks(paths.xy, paths.heading, paths.ds)
        rows = scene.path[who]
        s = scene.path_s[who, None] + speed[:, None] * self._times
        path, along = self._network[1].at(np.maximum(rows, 0)[:, None], s)
        start = along[:, 0].conj()
        heading: Complex = np.exp(1j * scene.heading[who])
        ahead = path + ((now - path[:, 0]) * start)[:, None] * along
        turned = (heading * start)[:, None] * along
        free = rows < 0
        if free.any():
            ahead[free] = now[free, None] + drift[free, None] * self._times
            turned[free] = heading[free, None]
        return ahead, turned

    def _following(self, scene: Scene, place: Complex, facing: Complex) -> NDArray[np.bool_]:
        """(n,) whether someone at `place` (n,) m, facing `facing` (n,), drives behind the ego on its path."""
        path = self._path(scene)
        here = int(scene.ego_s / path.spacing)
        tail = slice(max(here - int(TAIL / path.spacing), 0), max(here - int(2.0 / path.spacing), 1), 2)
        away = place[:, None] - path.place[0, tail]
        nearest = (away.real**2 + away.imag**2).argmin(axis=1)
        along = path.facing[0, tail][nearest].conj()
        seen = away[np.arange(len(place)), nearest] * along
        return (np.abs(seen.imag) < LANE) & (np.abs(seen.real) < 1.0) & ((facing * along).real > ALONG)
