"""Props: things on the road that SUMO does not move: accident vehicles, wrong-way drivers, pedestrians.

A prop stands, or follows a polyline. A vehicle that follows one stops before things that stand in its way,
before surrounding vehicles (SVs), before pedestrians unless they come towards it, and behind props that go
the same way, and goes on when the way is free. It stops for an ego below walking pace, but not for a faster
one, since it is meant to be a hazard. While it is itself slower than walking pace, it stops for any ego that
is before it or passes close by, and lets one pass that would have to brake hard for it. A pedestrian stops
only for what is there already, right before it, and walks past pedestrians who walk towards it. The yielding
layer makes SVs see all props.

A moving prop that has had to stand for long goes back and waits until its way is free. A pedestrian goes
back a step, and later to where they came from. One that somebody has run into may always go away from them,
on or back. A driver goes back until the other has room to drive off, and then stops for a moving ego, too.
One who drives against a lane gives up and backs out of the road if it is held up for long, or has gone back
to where it appeared. Without this, two that wait for each other would stand for good.
"""

from __future__ import annotations

import math

import numpy as np

from rudc.arrays import Array, Flags, Index
from rudc.geometry import rectangle_gaps
from rudc.scenario.events.stage import Halt
from rudc.world.scene import STANDING, Kind, Scene

BRAKING = 6.0
"""m/s2, with which a moving prop brakes; a vehicle with less if the road allows no more"""
ACCELERATION = 2.0
"""m/s2, with which it starts again"""
CLEARANCE_M = 0.8
"""m, least gap at which it stops before something"""
PATIENCE_S, BACK_M, BACK_SPEED = 3.0, 1.0, 0.5
"""s after which a prop that is held up goes back; how far (m) and how fast (m/s) a pedestrian does"""
LONG_S = 10.0
"""s of being held up, after which it goes back to where it came from; short times between, in which its way
is free, are not counted"""
DRIVER_BACK_M, DRIVER_BACK_SPEED = 8.0, 2.5
"""m, m/s: a driver goes back if less than this is free before it; how fast it goes back"""
FURTHER_M = 6.0
"""m that it goes back beyond DRIVER_BACK_M; else it would set off again and again before who creeps"""
ONWARD_M = 3.0
"""m: one that gets on by this much between is not held up for long"""
WALKING_PACE = 2.0
"""m/s, an ego slower than this is taken to be about to stop: a driver stops before it"""
NOTICES_S, GENTLY = 1.0, 3.0
"""s, m/s2: a driver who sets off takes the ego to notice it so late, and to brake so hard"""
LANE_M = 4.0
"""m that it then looks farther ahead, about the width of a lane: it is soon too fast to stop for the ego"""
PASSES_M = 0.5
"""m beside the way of a slow driver, within which an ego that moves is in it"""
SAME_WAY = math.cos(math.pi / 4)
"""cosine of the angle between their headings, above which a prop drives behind another as in a column"""
LATE_S = 0.7
"""s until others brake for a prop that appears: one pass of the yielding layer, and a little more"""
MORE_M = 0.1
"""m that must be free beyond the room a pedestrian has made by going back, before they go on"""


class Prop:
    """One prop; angles in rad, lengths in m, speeds in m/s."""

    def __init__(
        self,
        name: str,
        kind: Kind,
        size: tuple[float, float],
        way: Array,
        heading: float = 0.0,
        wanted: float = 0.0,
    ) -> None:
        """`size`: length and width; `way`: (K, 2) m, the polyline its centre follows at speed `wanted`.

        For a prop that stands (`wanted` is 0), one point is enough, and `heading` is its heading.
        """
        self.name = name
        self.kind = kind
        self.length, self.width = size
        self.wanted = wanted
        self.speed = wanted
        self.travelled = 0.0
        """m along the way"""
        self.beyond_m = 0.0
        """m that it goes straight on beyond its way's end"""
        self.appeared_m = 0.0
        """m along its way, where it appeared: before its begin if negative"""
        self.may_back_out = False
        """whether it gives up when it is held up for long or has gone back to where it appeared; it is gone
        once it has backed to the begin of its way"""
        self.halt: Halt | None = None
        """where it stops on its way, and for how many s it still stands; not counted as being held up"""
        self.grip = math.inf
        """m/s2, how hard the road lets a vehicle brake and accelerate"""
        self.look_s = 0.1
        """s until a driver looks again: a decision"""
        self._follow(way)
        if not self.moves:
            self._headings = np.array([heading])
        self._free, self._back_is_free, self._gives_up = True, False, False
        self._stepped_back = 0.0
        self._held_s, self._long_s = 0.0, 0.0
        """s that it has been held up: one that falls again while its way is free, PATIENCE_S and a step at
        most, and one that counts on until the first has fallen to 0 or it has got on by ONWARD_M"""
        self._held_at = 0.0
        """m along its way, where the second began to count"""

    def _follow(self, way: Array) -> None:
        """Follow a way (K, 2) m from its begin."""
        moved = np.append(True, np.hypot(*np.diff(way, axis=0).T) > 0.0)
        self._way = way[moved]  # a leg of no length has no direction
        legs = np.diff(self._way, axis=0)
        self._ends = np.cumsum(np.hypot(legs[:, 0], legs[:, 1]))
        self._headings = np.arctan2(legs[:, 1], legs[:, 0])

    @property
    def moves(self) -> bool:
        """Whether it follows its way."""
        return self.wanted > 0

    @property
    def finished(self) -> bool:
        """Whether it has come `beyond_m` m beyond the end of its way, or has backed out of it."""
        backed_out = self._gives_up and self.travelled <= 0.0
        return self.moves and (self.travelled >= self._ends[-1] + self.beyond_m or backed_out)

    def look_out(self, scene: Scene) -> None:
        """Decide, by what is around it in the scene, whether to go on, to stop, or to go back."""
        self._free = not self.moves or (not self._gives_up and self._is_free(scene, self._needed()))
        if self._is_held_up:
            if self._walks:
                room = min(self._room_back, BACK_M)
                wanted = room > 0.0
            else:
                room = CLEARANCE_M + self.speed**2 / (2 * self._braking) + abs(self.speed) * self.look_s
                enough = DRIVER_BACK_M + (FURTHER_M if self.speed < 0.0 else 0.0)
                wanted = self._gives_up or not self._is_free(scene, enough)
            self._back_is_free = wanted and self._is_free(scene, -room)

    def step(self, dt: float) -> None:
        """Move for dt s."""
        if not self.moves:
            return
        if self._held_s == 0.0 or self.travelled > self._held_at + ONWARD_M:
            self._long_s, self._held_at = 0.0, self.travelled
        halts = self._halts(dt)
        if self._free or halts:
            self._held_s = max(self._held_s - dt, 0.0)
        else:
            self._held_s = min(self._held_s + dt, PATIENCE_S + dt)
            self._long_s = min(self._long_s + dt, LONG_S + dt)
        if self.may_back_out and (self._long_s > LONG_S or self.travelled < self.appeared_m):
            self._gives_up = True
        goes_back = self._is_held_up and self._back_is_free and not self._free
        if self._walks and goes_back:
            self.speed = -BACK_SPEED
        else:
            goes_on = self._free and not halts
            wanted = -DRIVER_BACK_SPEED if goes_back else self.wanted if goes_on else 0.0
            self.speed = self._towards(wanted, dt)
        self.travelled += self.speed * dt
        self._stepped_back = max(self._stepped_back - self.speed * dt, 0.0)

    def _halts(self, dt: float) -> bool:
        """Whether it stops, or stands, in the next dt s because of its `halt`."""
        halt = self.halt
        if halt is None or self.travelled - self.appeared_m < halt.after_m:
            return False
        left = halt.duration_s - (dt if self.speed == 0.0 else 0.0)
        self.halt = halt._replace(duration_s=left) if left > 0.0 else None
        if halt.turns_back and self.halt is None:
            self._turn_back()
        return True

    def _turn_back(self) -> None:
        """Turn round, to where it appeared; it is gone if it is there."""
        if self.travelled <= self.appeared_m:
            self._gives_up, self._free = True, False
            return
        passed = self._way[1:-1][self._ends[:-1] < self.travelled]
        here, there = self.pose()[:2], self.pose(self.appeared_m - self.travelled)[:2]
        self.travelled = self.appeared_m = self.beyond_m = 0.0
        self._held_s = self._long_s = self._held_at = self._stepped_back = 0.0
        self._follow(np.array([here, *passed[::-1], there]))

    def _towards(self, wanted: float, dt: float) -> float:
        """m/s, its speed `dt` s later, if it speeds up or brakes until it drives `wanted` m/s."""
        faster = (ACCELERATION if self._walks else min(ACCELERATION, self.grip)) * dt
        braked = self._braking * dt
        low, high = (braked, faster) if self.speed >= 0.0 else (faster, braked)
        if self.speed * wanted < 0.0:  # it turns round: it stops first
            wanted = 0.0
        elif self.speed == 0.0:
            low = faster
        return min(max(wanted, self.speed - low), self.speed + high)

    @property
    def _room_back(self) -> float:
        """m that a pedestrian still goes back."""
        return self.travelled - self.appeared_m if self._long_s > LONG_S else BACK_M - self._stepped_back

    @property
    def _walks(self) -> bool:
        return self.kind == Kind.PEDESTRIAN

    @property
    def _braking(self) -> float:
        """m/s2, with which it brakes."""
        return BRAKING if self._walks else min(BRAKING, self.grip)

    @property
    def _is_slow(self) -> bool:
        """Whether it is a driver slower than walking pace, who stops for any ego."""
        return not self._walks and self.speed < min(WALKING_PACE, self.wanted)

    @property
    def _is_held_up(self) -> bool:
        return self._held_s > PATIENCE_S and self.travelled > min(self.appeared_m, 0.0)

    def pose(self, ahead: float = 0.0) -> tuple[float, float, float]:
        """Its centre (m, m) and heading (rad), now or `ahead` m along its way."""
        if not self.moves:
            return float(self._way[0, 0]), float(self._way[0, 1]), float(self._headings[0])
        at = self.travelled + ahead
        leg = min(int(np.searchsorted(self._ends, at, side="right")), len(self._headings) - 1)
        psi = float(self._headings[leg])
        back = float(self._ends[leg]) - at
        x, y = self._way[leg + 1]
        return float(x) - back * math.cos(psi), float(y) - back * math.sin(psi), psi

    def _needed(self) -> float:
        """m before it that must be free: the way in which it can stop. After going back it needs more: a
        pedestrian the way that it went back, a driver the room that it has made.
        """
        back = self._stepped_back > 0.0
        reach = CLEARANCE_M + self.speed**2 / (2 * self._braking)
        if self._walks:
            return reach + (self._stepped_back + MORE_M if back else 0.0)
        reach += abs(self.speed) * self.look_s
        return max(reach, DRIVER_BACK_M + FURTHER_M + CLEARANCE_M) if back else reach

    def has_room(self, scene: Scene) -> bool:
        """Whether it can appear: nobody is where it is and where it needs to stop, nor must come there, even
        if the others notice it LATE_S later.
        """
        return self._is_clear(scene, self.room(), LATE_S)

    def room(self) -> tuple[float, float, float, float, float]:
        """The rectangle from its rear to where it can stop: x, y (m), heading (rad), length, width (m)."""
        needed = self._needed()
        return (*self.pose(0.5 * needed), self.length + needed, self.width)

    def _is_free(self, scene: Scene, reach: float) -> bool:
        """Whether `reach` m of its way before its front are free (behind its rear if negative). Somebody who
        has run into it is ignored if this way leads away from their middle.
        """
        if reach > 0.0 and self._lets_pass(scene, reach + LANE_M):
            return False
        middle = 0.5 * (math.copysign(self.length, reach) + reach)
        x, y, heading = self.pose()
        behind = (scene.position - (x, y)) @ (math.cos(heading), math.sin(heading)) * reach < 0.0
        now = (x, y, heading, self.length, self.width)
        touched = behind.copy()
        rows = np.flatnonzero(behind)
        touched[rows] = gaps_to_ways(scene, rows, np.zeros(len(rows)), now) <= 0.0
        return self._is_clear(scene, (*self.pose(middle), abs(reach), self.width), self.look_s, touched)

    def _lets_pass(self, scene: Scene, reach: float) -> bool:
        """Whether it stands, or has just set off, and the ego would have to brake hard not to come where it
        drives on its next `reach` m. One that is in the ego's way already had better go on.
        """
        ego, body = scene.ego, scene.vehicle
        if not self._is_slow or ego.v < STANDING:
            return False
        way = ego.v * NOTICES_S + ego.v**2 / (2 * GENTLY)
        x, y = ego.x + 0.5 * way * math.cos(ego.psi), ego.y + 0.5 * way * math.sin(ego.psi)
        swept = np.array([[x, y]]), np.array([ego.psi]), np.array([[body.length + way, body.width]])
        here = *self.pose(), self.length, self.width
        ahead = *self.pose(0.5 * (self.length + reach)), reach, self.width
        gaps = [rectangle_gaps(*box, *swept)[0] for box in (here, ahead)]
        return bool(gaps[1] <= PASSES_M < gaps[0])

    def _is_clear(
        self, scene: Scene, box: tuple[float, float, float, float, float], late_s: float,
        ignored: Flags | None = None,
    ) -> bool:  # fmt: skip
        """Whether a box on its way (x m, y m, heading rad, length m, width m) is free of all but those who
        are `ignored` (N,).

        For a driver: free of things that stand, of SVs, of pedestrians who do not come towards it and of
        props that go the same way on all the way that they need to stop, after `late_s` s in which they drive
        on, and of an ego for which it stops. For a pedestrian: free of everything that is there now, except
        pedestrians who walk towards it: they walk past each other.
        """
        walks = self._walks
        ego, body = scene.ego, scene.vehicle
        slow = self._is_slow
        if walks or slow or ego.v < WALKING_PACE or self._stepped_back > 0.0:
            here, facing = np.array([[ego.x, ego.y]]), np.array([ego.psi])
            gaps = rectangle_gaps(*box, here, facing, np.array([[body.length, body.width]]))
            if (gaps <= (PASSES_M if slow and ego.v >= STANDING else 0.0)).any():
                return False
        speed = scene.speed
        way = np.zeros_like(speed) if walks else stopping_way(scene, late_s, self._braking)
        heeded = np.array([name != self.name for name in scene.ids], dtype=np.bool_)
        if ignored is not None:
            heeded &= ~ignored
        along, walkers = np.cos(scene.heading - box[2]), scene.kind == Kind.PEDESTRIAN
        if walks:
            heeded &= ~walkers | (speed == 0.0) | (along > -SAME_WAY)
        else:
            crossing = walkers & (along > -SAME_WAY)
            heeded &= (scene.path >= 0) | (speed < STANDING) | (along > SAME_WAY) | crossing
        away = scene.position - box[:2]
        reach = box[3] + way + 0.5 * np.hypot(scene.size[:, 0], scene.size[:, 1]) + 10.0
        rows = np.flatnonzero(heeded & (np.hypot(away[:, 0], away[:, 1]) < reach))
        return bool((gaps_to_ways(scene, rows, way[rows], box) > 0.0).all())


def stopping_way(scene: Scene, late_s: float, braking: float) -> Array:
    """(N,) m that each body of the scene needs to stop, if it brakes with `braking` m/s2 `late_s` s later."""
    return scene.speed * late_s + scene.speed**2 / (2 * braking)


def gaps_to_ways(
    scene: Scene, rows: Index, way: Array, box: tuple[float, float, float, float, float]
) -> Array:
    """(K,) m between a box (x m, y m, heading rad, length m, width m) and what bodies of the scene, those of
    `rows` (K,), cover on the next `way` (K,) m straight on."""
    heading = scene.heading[rows]
    position = scene.position[rows] + 0.5 * way[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])
    return rectangle_gaps(*box, position, heading, scene.size[rows] + way[:, None] * (1.0, 0.0))


def standing(name: str, kind: Kind, x: float, y: float, heading: float, length: float, width: float) -> Prop:
    """A prop that never moves."""
    return Prop(name, kind, (length, width), np.array([[x, y]]), heading)
