"""Finds those in sight who do not behave like ordinary traffic, which drivers who keep to the rules expect.

    off the lanes   it is on no path through the junction, as somebody who drives against a lane
    fast            it drives faster than TOLERATED times the limit plus SPARE
    brakes          it brakes by more than BRAKES in two decisions in a row
    slow            for LASTS_S it drives at less than SLOW times the limit and does not speed up, with nobody
                    and no stop line within ROOM before it; bicycles are excepted, and the limit counts as
                    lowered for bends (rudc/world/bends.py) as on a road of LEAST friction, whatever it has
    stands          for LASTS_S it stands, with nobody and no stop line within NEXT before it

Whoever has done so once counts as unusual as long as it is seen. SUMO's ordinary drivers do none of these,
except in an emergency now and then. This is a monitor for studies and records: no agent acts on it.
"""

from __future__ import annotations

import math

import numpy as np

from rudc.arrays import Array, Flags
from rudc.env.remembered import Remembered
from rudc.network.network import Network
from rudc.network.paths import SPACING
from rudc.scenario.events.checked_stage import LEAST
from rudc.world.bends import curvatures, limits_in_bends
from rudc.world.ego import GRAVITY
from rudc.world.scene import STANDING, Kind, Scene

TOLERATED, SPARE = 1.2, 1.0
"""factor on the limit, m/s; SUMO's fastest ordinary drivers drive at the first"""
BRAKES = 5.0
"""m/s2; ordinary drivers brake at 4.5"""
SLOW, SETTING_OFF = 0.5, 0.3
"""factor on the limit; m/s2, acceleration from which on a slow vehicle counts as speeding up"""
LASTS_S = 2.0
"""s, how long a vehicle must be slow or stand"""
ROOM, NEXT = 25.0, 6.0
"""m, m: free way before the front bumper of one that is slow, and of one that stands"""
BESIDE = 2.5
"""m to each side within which somebody counts as before it"""
_ordinary: Remembered[Network, tuple[Array, Array]] = Remembered()


class Conduct:
    """Watches the others in one episode."""

    def __init__(self) -> None:
        self._unusual = set[str]()
        self._braked = set[str]()
        self._dawdles: dict[str, float] = {}
        """name of each that is slow or stands -> since when (s)"""

    def look(self, scene: Scene) -> Flags:
        """(N,) whether each other has been seen to behave unlike ordinary traffic; call it once a
        decision.
        """
        on, s = scene.path >= 0, scene.path_s
        most, least = _ordinary.get(scene.network, lambda: _speeds(scene.network))
        centre, front = (
            np.clip(np.rint(at / SPACING), 0, most.shape[1] - 1).astype(np.int64)
            for at in (s, s + 0.5 * scene.size[:, 0])
        )
        limit = np.maximum(most[scene.path, centre], most[scene.path, front])
        speed = scene.speed
        brakes = scene.acceleration < -BRAKES
        slow = (
            (speed < SLOW * least[scene.path, centre])
            & (scene.acceleration < SETTING_OFF)
            & (scene.kind != Kind.BICYCLE)
        )
        room = self._room(scene, on & slow)
        dawdles = on & ((slow & (room > ROOM)) | ((speed < STANDING) & (room > NEXT)))
        since = self._dawdles
        self._dawdles = {name: since.get(name, scene.time_s) for name in _named(scene, dawdles)}
        lasting = {name for name, then in self._dawdles.items() if scene.time_s - then >= LASTS_S}
        braked, self._braked = self._braked, _named(scene, brakes)
        new = _named(scene, ~on | (speed > TOLERATED * limit + SPARE)) | lasting | (braked & self._braked)
        self._unusual = (self._unusual & set(scene.ids)) | new
        return np.array([name in self._unusual for name in scene.ids], dtype=np.bool_)

    def _room(self, scene: Scene, who: Flags) -> Array:
        """(N,) m of free way before each of `who` (N,), up to its stop line or somebody else; 0 for all
        others and for those in the junction.
        """
        paths, room, ego = scene.network.paths, np.zeros(scene.count), scene.ego
        place = np.vstack([scene.position, (ego.x, ego.y)])
        half = 0.5 * np.append(scene.size[:, 0], scene.vehicle.length)
        for i in np.flatnonzero(who).tolist():
            front, row = float(scene.path_s[i]) + half[i], scene.path[i]
            if paths.stop_s[row] < front < paths.exit_s[row]:
                continue
            away, psi = place - scene.position[i], float(scene.heading[i])
            ahead = away @ (math.cos(psi), math.sin(psi))
            beside = np.abs(away @ (-math.sin(psi), math.cos(psi)))
            before = (ahead > 0.0) & (beside < BESIDE)
            gap = float((ahead - half)[before].min(initial=math.inf)) - half[i]
            to_stop = float(paths.stop_s[row]) - front
            room[i] = min(gap, to_stop) if to_stop >= 0.0 else gap
        return room


def _speeds(network: Network) -> tuple[Array, Array]:
    """(P, M) m/s and (P, M) m/s at each station of each row of `network.paths`: the highest limit there, and
    the lowest there and on the next ROOM m. Where two lanes meet, the highest is that of the faster one, and
    in the junction that of the inner lane if it is higher. The lowest is cut for a lane's tightest bend as on
    a road of LEAST friction, so on a lane with a sharp bend hardly anybody who moves is slow.
    """
    paths = network.paths
    s = SPACING * np.arange(paths.stations, dtype=np.float64)
    bends = limits_in_bends(curvatures(network), LEAST * GRAVITY)
    most = np.stack([paths.highest_limit(np.full(len(s), row), s, s) for row in range(paths.count)])
    least = most.copy()
    for row, spans in enumerate(paths.spans):
        for name, (begin, end) in spans.items():
            there = row, slice(int(begin / SPACING), int(end / SPACING) + 2)
            if name in network.lanes:
                most[there] = np.maximum(most[there], network.lanes[name].speed)
            if name in bends:
                least[there] = np.minimum(least[there], bends[name])
    ahead = int(ROOM / SPACING)
    padded = np.pad(least, ((0, 0), (0, ahead)), mode="edge")
    return most, np.lib.stride_tricks.sliding_window_view(padded, ahead + 1, axis=1).min(axis=-1)


def _named(scene: Scene, who: Flags) -> set[str]:
    return {scene.ids[i] for i in np.flatnonzero(who).tolist()}
