"""Which others the filter constrains: those whose predicted path meets the ego's.

The barrier assumes that others keep their velocity, so that a vehicle which turns off before the ego, or
oncoming traffic on its own lane, looks like a threat. The gate asks first whether the two meet when each
follows its own path (see `prediction`) at its present speed. A vehicle is let through to the rows if at some
instant within the horizon

    |r| < rho_e + rho_o + gate_distance

with the ellipses' support radii (see `barrier`) at the predicted poses.

Of those that are constrained, the ones in conflict come first where no action satisfies all rows: their
ellipses meet the ego's, without any distance added, if it goes on at its present speed or if it accelerates
along its route. A car that passes on the next lane is constrained, but not in conflict.

Who stands is let through only if the rectangles on the ego's way say so, since nothing is to be predicted of
it: an ellipse and a distance around it would close a gap of a metre and a half.

Not let through, and in no conflict, is who drives behind the ego on the ego's own path: that distance is
theirs to keep. The barrier has the two push each other apart, so that a vehicle coming up from behind at
constant speed makes a waiting ego drive into the one ahead.
"""

from __future__ import annotations

import math

import numpy as np

from rudc.arrays import Array, Complex, Flags, Index
from rudc.geometry import separation
from rudc.safety.prediction import GO_ACCELERATION, GO_SPEED, Predictor
from rudc.safety.road_points import CLOSEST
from rudc.world.scene import Scene

CONFLICT_TIMES: Array = np.linspace(0.0, 3.0, 16)
"""(T,) s, when conflicts are looked for"""

STILL = 0.2
"""m/s, below which somebody stands"""
PASSING = 0.3
"""m beside the ego's rectangle on its way, with which somebody who stands is passed"""
SLOWEST = 3.0
"""m/s, at least, of an ego that is taken to pass"""
PASSING_STATIONS = 40
"""places on that way that are looked at"""


class Gate:
    """Picks the others that the ego may meet."""

    def __init__(self, horizon: float, step: float, distance: float, predictor: Predictor) -> None:
        """`horizon` s, looked at every `step` s at most; `distance` m between the ellipses."""
        self._times: Array = np.linspace(0.0, horizon, math.ceil(horizon / step - 1e-9) + 1)
        self._horizon = horizon
        self._gap = distance
        self._predictor = predictor

    def meeting(self, scene: Scene, short: Array, stretch: Array) -> Index:
        """Indices, nearest first, of those whose ellipse comes closer to the ego's than the gate distance.

        `short` and `stretch` (2, N) m2: squares of the half axes across, and along minus across, of ego and
        others.
        """
        now: Complex = scene.position[:, 0] + 1j * scene.position[:, 1]
        speed: Array = np.hypot(scene.velocity[:, 0], scene.velocity[:, 1])
        longest: Array = np.sqrt(short + np.maximum(stretch, 0.0)).sum(axis=0)
        reach = (speed + scene.ego.v) * self._horizon + longest + self._gap
        who = np.flatnonzero(np.abs(now - complex(scene.ego.x, scene.ego.y)) < reach)
        if not len(who):
            return who
        met, turned = self._meet(
            scene, who, (scene.ego.v * self._times,), self._times, self._gap, short, stretch
        )
        meet = np.flatnonzero(met)
        if not len(meet):
            return meet
        found = who[meet[~self._predictor.following(scene, now[who[meet]], turned[meet])]]
        return found[~self._passed(scene, found, speed[found])]

    def _passed(self, scene: Scene, who: Index, speed: Array) -> Flags:
        """(n,) which of the others `who`, at `speed` (n,) m/s, stand and are passed: rectangles tell."""
        passed = speed < STILL
        rows = np.flatnonzero(passed)
        if len(rows):
            body = scene.vehicle
            half = np.array([0.5 * body.length, 0.5 * body.width])
            way = np.linspace(0.0, self._horizon * max(scene.ego.v, SLOWEST), PASSING_STATIONS)
            place, facing = self._predictor.ego(scene, way)
            others, turned = self._predictor.others(scene, who[rows], np.zeros((len(rows), 1)))
            apart = separation(others - place, facing, turned, half, 0.5 * scene.size[who[rows], None])
            passed[rows] = apart.min(axis=1) >= PASSING
        return passed

    def in_conflict(self, scene: Scene, who: Index, short: Array, stretch: Array) -> Flags:
        """(n,) which of the others `who` (n,) are in conflict with the ego; `short` and `stretch` (2, N) as
        for `meeting`.
        """
        times, v = CONFLICT_TIMES, scene.ego.v
        rising = np.minimum(times, max(GO_SPEED - v, 0.0) / GO_ACCELERATION)
        going = v * times + GO_ACCELERATION * rising * (times - 0.5 * rising)
        met, facing = self._meet(scene, who, (v * times, going), times, 0.0, short, stretch)
        now: Complex = scene.position[who, 0] + 1j * scene.position[who, 1]
        return met & ~self._predictor.following(scene, now, facing)

    def _meet(
        self,
        scene: Scene,
        who: Index,
        ways: tuple[Array, ...],
        times: Array,
        gap: float,
        short: Array,
        stretch: Array,
    ) -> tuple[Flags, Complex]:
        """(n,) whether the ellipses of ego and others `who` (n,) come closer than `gap` m at any of the
        `times` (T,) s if the ego is one of `ways` (T,) m along its route then; (n,) others' directions now.
        """
        speed: Array = np.hypot(scene.velocity[who, 0], scene.velocity[who, 1])
        others, turned = self._predictor.others(scene, who, speed[:, None] * times)
        met: Flags = np.zeros(len(who), dtype=np.bool_)
        for way in ways:
            place, facing = self._predictor.ego(scene, way)
            r = place - others
            along, own = r * facing.conj(), r * turned.conj()
            squared = np.maximum(along.real**2 + along.imag**2, CLOSEST)
            ego_radius = np.sqrt(short[0, who, None] + stretch[0, who, None] * (along.real**2 / squared))
            radius = np.sqrt(short[1, who, None] + stretch[1, who, None] * (own.real**2 / squared))
            met |= np.asarray((np.sqrt(squared) < ego_radius + radius + gap).any(axis=1))
        return met, turned[:, 0]
