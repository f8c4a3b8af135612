"""Surrounding vehicles (SVs) do not stand for ever because of an ego that stands in nobody's way.

In SUMO a vehicle waits for anybody inside the junction whose lane there crosses its own, for as long as
that one is on it. So an ego that has stopped a little beyond its line and gives way there would hold up
those who have priority, and they the ego. The yielding layer knows better who must wait for the ego. Once
the ego has stood for STOOD_S, the SVs that need not give way to it by the right of way overlook it at
junctions in SUMO: those that stand and are not held by the layer, and those that come, from COMING_M before
their stop line on, if they can pass it. Once it has stood for LONG_S, those that stand and should give way to
it and can pass it do so, too: they take it that the ego lets them go first. Those that cannot pass it keep
waiting, since they would only drive up to its nose, where neither could go on. When the ego drives again,
those that stand or have not reached their stop line heed it again. One in the junction goes on overlooking
it: SUMO would have it brake hard, often for nothing, and the layer makes it brake if it must. An SV that
stands nose to nose with the ego goes back (rudc/world/backing_off.py).

SUMO takes a vehicle to be on the lane nearest to its front, so that an ego in a wide turn may count as
standing ahead of somebody who only drives past it. So who is free and stands in the junction, on another
path than the ego's, and can pass the ego where it stands, does not follow it either, until it is out of the
junction, or the ego drives again before it is past.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import TYPE_CHECKING

import numpy as np

from rudc.arrays import Flags
from rudc.world.backing_off import BackingOff, bars
from rudc.world.scene import STANDING
from rudc.world.vehicle_types import EGO

if TYPE_CHECKING:
    from rudc.world.scene import Scene
    from rudc.world.sumo import Sumo
    from rudc.world.traffic import Traffic

STOOD_S, LONG_S = 5.0, 12.0
"""s, s for which the ego must have stood, the second for those that should give way to it"""
COMING_M = 50.0
"""m before their stop lines, from which on those that come overlook the ego"""


class Unblocking:
    """Sets SVs free in one episode."""

    def __init__(self, sumo: Sumo, traffic: Traffic) -> None:
        self._sumo = sumo
        self._backing_off = BackingOff(sumo, traffic)
        self._free: set[str] = set()
        self._passing: set[str] = set()
        """those who do not follow the ego"""

    def step(self, scene: Scene, held: Collection[str], decision_s: float) -> None:
        """Once the ego has stood long enough, set free the SVs that stand and are not `held` by the yielding
        layer, and those that come with priority, and move those that go back. Once the ego drives, those that
        stand or have not reached their stop line heed it again.
        """
        self._backing_off.step(scene, decision_s)
        if self._passing:
            self._follow_again(scene)
        if scene.waited_s >= STOOD_S:
            owes = scene.network.paths.yields[scene.path, scene.route.row]
            wanted = _standing(scene, ~owes | (scene.waited_s >= LONG_S)) - self._free - set(held)
            comes = _coming(scene, ~owes) - self._free - wanted
            wanted |= {name for name in comes if not bars(scene, scene.ids.index(name), math.inf)}
            if scene.waited_s >= LONG_S:
                wanted -= _barred(scene, wanted)
            self._free |= wanted
        elif scene.waited_s == 0.0 and self._free:
            wanted = (_standing(scene, scene.path >= 0) | _coming(scene, scene.path >= 0)) & self._free
            self._free = (self._free - wanted).intersection(scene.ids)
        else:
            return
        for name in sorted(wanted):
            self._sumo.overlook(name, EGO if name in self._free else "")
        stuck = _standing(scene, scene.path >= 0) & _in_junction(scene) & self._free
        for name in sorted(stuck - self._passing - set(held)):
            if not bars(scene, scene.ids.index(name), math.inf):
                self._passing.add(name)
                self._sumo.overlook(name, EGO, ahead=True)

    def _follow_again(self, scene: Scene) -> None:
        """Have those follow the ego again who are out of the junction, and, once the ego drives, those who
        are not past it.
        """
        still = _in_junction(scene)
        if scene.waited_s == 0.0:
            still -= _before_ego(scene)
        for name in sorted((self._passing - still).intersection(scene.ids)):
            self._sumo.overlook(name, "", ahead=True)
        self._passing &= still


def _standing(scene: Scene, among: Flags) -> set[str]:
    """Names of the SVs that stand, `among` (N,) all."""
    stands = among & (scene.path >= 0) & (scene.speed < STANDING)
    return {scene.ids[i] for i in stands.nonzero()[0].tolist()}


def _coming(scene: Scene, among: Flags) -> set[str]:
    """Names of the SVs that drive and are less than COMING_M before their stop line, `among` (N,) all."""
    row, front = scene.path, scene.path_s + 0.5 * scene.size[:, 0]
    left = scene.network.paths.stop_s[row] - front
    comes = among & (row >= 0) & (scene.speed >= STANDING) & (left > 0.0) & (left < COMING_M)
    return {scene.ids[i] for i in comes.nonzero()[0].tolist()}


def _in_junction(scene: Scene) -> set[str]:
    """Names of the SVs that are in the junction, on other paths than the ego's."""
    there = scene.inside & (scene.path != scene.route.row)
    return {scene.ids[i] for i in there.nonzero()[0].tolist()}


def _before_ego(scene: Scene) -> set[str]:
    """Names of those who have the ego's middle ahead of their own."""
    to_ego = np.array([scene.ego.x, scene.ego.y]) - scene.position
    ahead = to_ego[:, 0] * np.cos(scene.heading) + to_ego[:, 1] * np.sin(scene.heading) > 0.0
    return {scene.ids[i] for i in ahead.nonzero()[0].tolist()}


def _barred(scene: Scene, names: Collection[str]) -> set[str]:
    """Of these SVs, those that should give way to the ego and could not pass it where it stands."""
    owing = scene.network.paths.yields[:, scene.route.row]
    return {
        name
        for i, name in enumerate(scene.ids)
        if name in names and owing[scene.path[i]] and bars(scene, i, math.inf)
    }
