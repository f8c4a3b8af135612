"""Going round what blocks: the course that a driver is shown, and how fast it may drive beside bodies.

A course is a line round what blocks, for the same movement as the route that it replaces
(rudc/network/course.py). It is kept while it is clear. A new one is planned when it is not clear any more,
when those who came the wrong way, for whom it was chosen, have passed, and when all that it leads round has
been gone, in plain sight, for GONE_S s; at most once in AGAIN_S s. While no course is clear, the ego stops
SHORT m before what blocks: nearer, it could not pull out. After STUCK_S s a smaller gap is enough, too, and
an ego whose course is not clear any more goes back to its route, if that is free for longer. How fast it
drives beside bodies, rudc/agents/passing.py says. A car that has missed a bend, and is more than MISSED m off
its line, slows down until it creeps, and then gets a course back to it, if there is one.

Everywhere it drives at most TOLERATED times the speed limit of the lane that it is on; in the junction, that
of the lane before it.

Where a course enters ground that its route does not touch (the lane beside, the lane of oncoming traffic),
the ego gives way to all who drive there. Until the gap before them suffices (rudc/agents/gaps.py), it stops
before that ground or, if that lies in the junction, at the waiting point.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from rudc.agents.blocking import Blocking, Blocks
from rudc.agents.coming import not_passed
from rudc.agents.following import PULL_OUT
from rudc.agents.gaps import entering, suffices
from rudc.agents.hidden import sees
from rudc.agents.passing import is_narrow, speed_now, speeds_beside
from rudc.agents.patience import Patience
from rudc.agents.standoff import Standoff
from rudc.arrays import Array
from rudc.env.remembered import Remembered
from rudc.env.tracking import (
    COMFORT,
    RESPONSE_S,
    at_most,
    hardest,
    planned,
    slowing,
    slowing_for_limits,
    steering,
    stopping,
)
from rudc.geometry import Rectangles, rectangle_gaps
from rudc.network.course import CoursePlanner, gaps_along
from rudc.network.paths import SPACING
from rudc.network.route import Route
from rudc.world.scene import STANDING, Scene

LOOK = 60.0
"""m of the course ahead that are checked, or more where the ego needs more to stop"""
CLEAR = 0.25
"""m, a course with at least this gap to bodies is clear; less is enough if the ego is nearer to one now"""
ROOMY = 0.4
"""m, gap that is tried first when the ego stands"""
TIGHT, STUCK_S = 0.12, 5.0
"""m, s: the gap that is enough for an ego that has stood for the second and found no clear course"""
CLOSER, LEAST = 0.03, 0.1
"""m, m: by how much an ego that is nearer than CLEAR may come nearer still, and the gap that must be left"""
HERE = 1.0
"""m of way directly ahead of the ego that are not checked, since they are the same on every course"""
SHORT = 7.0
"""m before what blocks, where the ego stops while no course is clear"""
LEADER = 20.0
"""m ahead within which vehicles that stand for the moment are looked for, or more where the ego needs more"""
AGAIN_S, OUTS_S = 1.0, 1.5
"""s, s: time between two plannings, and what is added to it if the ego stands and may have to pull out"""
GONE_S, GONE = 2.0, 2.0
"""s, m: a body is gone if none has stood within the second of its place for the first: longer than those
whom sensors miss are remembered"""
TOLERATED = 1.2
"""factor on the speed limit: as fast as SUMO's fastest ordinary drivers"""
LEEWAY = 0.03
"""rad, by which the front wheels may then differ from those of a driver who follows the course"""
CREEPS, LOST = 2.0, 0.3
"""m/s, m: an ego that is slower than this and farther off its line than this may get a new course"""
BACK = 3.0
"""m of its route that must be free, besides SHORT, for an ego to go back to it, which has stood for STUCK_S
on a course that is not clear any more"""
MISSED = 2.5
"""m: an ego that is farther off its line than this slows down, and when it creeps gets a course back"""
HARDEST = 4.0
"""m/s2, braking with which the ego can still stop for others"""
JUST_PAST = 3.0
"""m: an ego that creeps and is past its waiting point by less stays there for somebody who comes the
wrong way
"""
ASIDE = 1.0
"""m, gap to the way of somebody who comes the wrong way that the ego keeps while it lets that vehicle pass"""
JUST_IN = 1.0
"""m: an ego that creeps, and whose front is on others' ground by less than this, still gives way there, but
for in the junction, where it would be in the way"""
AT_LINE = 0.3
"""m, kept before the place where the ego has to stop"""
STEEPEST = 0.6
"""rad, angles of the ego to the path beyond this count as this when a course is planned"""

_planners: Remembered[Route, CoursePlanner] = Remembered()
_planners_across: Remembered[Route, CoursePlanner] = Remembered()
"""planners for egos that may cross the centre line"""


class Courses:
    """Chooses the courses of one agent; call `reset` at the start of each episode."""

    def reset(self, scene: Scene) -> None:
        """Begin a new episode on the route itself."""
        self._blocking = Blocking()
        self._standoff, self._patience = Standoff(), Patience()
        self.course: Route | None = None
        """the course driven at present; None for the route itself"""
        self._strays = frozenset[str]()
        """names of those who came the wrong way when the course was chosen"""
        self._round = np.zeros((0, 2))
        """(n, 2) m, places of the bodies on the route that the course leads round"""
        self._there_s = -math.inf
        """s, when one of them was there last, or hidden"""
        self._again_s = -math.inf
        self._outs: Iterator[tuple[Route | None, float]] = iter(())
        self._blocks: Blocks | None = None
        self._stop: float = math.inf
        self._least = CLEAR
        """m, gap from which on a course is clear: CLEAR or TIGHT"""
        self._free_s = scene.time_s
        """s, when the ego moved last, or had a clear course"""

    def see(self, scene: Scene) -> Scene:
        """The scene as seen by an ego that follows its course; chooses a new course if one is needed."""
        self._route = scene.route
        blocks = self._blocks = self._blocking.look(scene)
        shown = scene if self.course is None else along(scene, self.course)
        self._stop = math.inf
        over = self._gone(scene, blocks) or (bool(self._strays) and not not_passed(scene, self._strays))
        missed = scene.ego.v < CREEPS and abs(shown.ego_offset) > MISSED
        if not (blocks.any or over or missed):
            self._least, self._free_s = CLEAR, scene.time_s
            return shown
        if scene.time_s > self._free_s + STUCK_S:
            self._least = TIGHT
        elif self._least < CLEAR and _first_hit(shown, blocks, CLEAR) > LEADER:
            self._least = CLEAR
        wait, clear = _wait(shown, blocks), _clear(scene, blocks, self._least)
        hit = _first_hit(shown, blocks, clear)
        if scene.ego.v >= STANDING or hit == math.inf:
            self._free_s = scene.time_s
        if hit == math.inf and not over and not _astray(shown, blocks) and not missed:
            self._stop = wait
            return shown
        for course, least in self._candidates(scene, blocks, clear):
            tried = scene if course is None else along(scene, course)
            if _first_hit(tried, blocks, least) == math.inf:
                self.course, self._stop = course, _wait(tried, blocks)
                self._strays = blocks.strays if course else frozenset()
                self._round = _on_route(scene, blocks, clear) if course else np.zeros((0, 2))
                self._there_s = self._free_s = scene.time_s
                self._outs = iter(())
                return tried
        if self.course is not None and scene.time_s > self._free_s + STUCK_S:
            own = _first_hit(scene, blocks, clear)
            if own > max(hit, SHORT + BACK) and abs(scene.ego_offset) < MISSED:
                self.course, self._strays, self._round = None, frozenset(), np.zeros((0, 2))
                hit, wait, shown = own, _wait(scene, blocks), scene
        self._stop = min(hit - SHORT, wait)
        return shown

    def _gone(self, scene: Scene, blocks: Blocks) -> bool:
        """Whether all that the course leads round has been gone, in plain sight, for GONE_S."""
        if not len(self._round):
            return False
        away = np.hypot(*(self._round[:, None] - blocks.standing.position[None]).transpose(2, 0, 1))
        if (away < GONE).any() or not sees(scene, self._round).all():
            self._there_s = scene.time_s
        return scene.time_s > self._there_s + GONE_S

    def urge(self, scene: Scene, u: Array) -> Array:
        """(2,) a policy's proposal u (2,), m/s2 and rad, changed to set off if the ego has stood too long and
        the rules would go (rudc/agents/patience.py).
        """
        return self._patience.urge(scene, u)

    def govern(self, scene: Scene, u: Array, *, onwards: bool = False) -> Array:
        """(2,) m/s2 and rad, the command `u` (2,), no faster than course and bodies allow; close beside
        bodies the ego steers along its course.

        `scene` as shown by `see`; `onwards`: the ego stops for nobody.
        """
        u = self._standoff.end(scene, u)
        blocks = self._blocks
        if blocks is None:
            return u
        if not onwards:
            u = _kept_short(scene, blocks, _limited(scene, u))
            if abs(scene.ego_offset) > MISSED:
                slower = (0.5 * CREEPS - scene.ego.v) / RESPONSE_S
                u = at_most(u, max(slower, -planned(scene, HARDEST)))
        if not (blocks.any or self.course):
            return u
        stop, delta = self._stop, float(u[1])
        speed = math.inf
        if self.course is not None or self._least < CLEAR:
            profile = speeds_beside(scene, blocks.standing, _look(scene))
            stop = min(stop, _entry(scene, self._route, profile))
            speed = speed_now(scene, profile, _look(scene))
            if is_narrow(scene, blocks.standing):
                track = steering(scene)
                delta = min(max(delta, track - LEEWAY), track + LEEWAY)
        wanted = max((speed - scene.ego.v) / RESPONSE_S, scene.vehicle.a_min)
        if stop < math.inf and not onwards:
            wanted = min(wanted, slowing(scene, stop, 0.0, planned(scene, COMFORT)))
        return np.array([min(float(u[0]), wanted), delta])

    def _candidates(self, scene: Scene, blocks: Blocks, clear: float) -> Iterator[tuple[Route | None, float]]:
        """Courses to try, each with the gap (m) that it must have; None stands for the route itself.

        Once in AGAIN_S s: the route, if the ego has a course but is near its line, and courses round the
        bodies on its own carriageway and, where these may be used, on the lanes of oncoming traffic.
        After that, if the ego stands: the courses on which it pulls out, one in each decision, until all
        have been tried.
        """
        stands = scene.ego.v < STANDING
        if not stands:
            self._outs = iter(())
        out = next(self._outs, None)
        if out is not None and out[0] is not None:
            yield out
        if out is not None or scene.time_s < self._again_s:
            return
        self._again_s = scene.time_s + AGAIN_S
        if self.course is not None and abs(scene.ego_offset) < CLEAR:
            yield None, clear
        ego, made = scene.ego, list[Route]()
        for planner in _planners_of(scene):
            turned = planner.angle(scene.ego_s, ego.psi)
            slope = math.tan(min(max(turned, -STEEPEST), STEEPEST))
            course = planner.plan(scene.ego_s, scene.ego_offset, slope, blocks.standing, *blocks.coming)
            if course is not None:
                made.append(course)
                yield course, ROOMY if stands else clear
        if stands:
            self._again_s += OUTS_S
            self._outs = _outs(scene, blocks, clear, made)


def _outs(
    scene: Scene, blocks: Blocks, clear: float, made: list[Route]
) -> Iterator[tuple[Route | None, float]]:
    """Courses for an ego that stands, and the gap (m) that each must have: those on which it pulls out, and
    then those `made` before once more, now with the smaller gap `clear`.
    """
    ego = scene.ego
    for planner in _planners_of(scene):
        for course in planner.pull_outs(ego.x, ego.y, ego.psi, blocks.standing, clear):
            yield course, clear
    for course in made:
        yield course, clear


def _planners_of(scene: Scene) -> Iterator[CoursePlanner]:
    network, route, body = scene.network, scene.route, scene.vehicle
    yield _planners.get(route, lambda: CoursePlanner(network, route, body))
    if scene.may_cross_centre:
        yield _planners_across.get(route, lambda: CoursePlanner(network, route, body, may_cross_centre=True))


def along(scene: Scene, course: Route) -> Scene:
    """The scene as seen by an ego that follows `course`."""
    path = course.path
    s, offset = path.project(scene.ego.x, scene.ego.y)
    x, y, _ = scene.route.path.pose(scene.goal_s)
    end, _ = path.project(float(x), float(y))
    return replace(scene, route=course, ego_s=s, ego_offset=offset, destination_s=end)


def _limited(scene: Scene, u: Array) -> Array:
    """(2,) the command u (2,), m/s2 and rad, slowed down to TOLERATED times the speed limit."""
    here = slowing(scene, 0.0, TOLERATED * scene.route.limit_at(scene.ego_s), COMFORT)
    return at_most(u, min(here, slowing_for_limits(scene, TOLERATED, COMFORT)))


def _kept_short(scene: Scene, blocks: Blocks, u: Array) -> Array:
    """(2,) the command u (2,), m/s2 and rad, slowed down so that the ego stops far enough behind a
    vehicle that stands in its lane to pull out if that vehicle turns out to block.
    """
    if not blocks.resting.number:
        return u
    braking = planned(scene, HARDEST)
    end = scene.ego_s + max(LEADER, PULL_OUT + stopping(scene, braking))
    s, gap = gaps_along(scene.route.path, scene.ego_s, end, scene.vehicle, blocks.resting)
    hit = np.flatnonzero(gap <= 0.0)
    if not len(hit):
        return u
    return at_most(u, slowing(scene, float(s[hit[0]]) - scene.ego_s - PULL_OUT, 0.0, braking))


def _clear(scene: Scene, blocks: Blocks, usual: float) -> float:
    """m, gap from which on a course is clear: `usual` (m) or, if the ego is nearer to a body, about that."""
    ego, body, (place, heading, size) = scene.ego, scene.vehicle, blocks.standing
    now = rectangle_gaps(ego.x, ego.y, ego.psi, body.length, body.width, place, heading, size)
    return min(usual, max(float(now.min(initial=math.inf)) - CLOSER, LEAST))


def _look(scene: Scene) -> float:
    """m of the course ahead that are checked: the ego can stop SHORT m before whatever comes into them."""
    return max(LOOK, SHORT + stopping(scene, planned(scene, HARDEST)))


def _first_hit(scene: Scene, blocks: Blocks, clear: float) -> float:
    """m from the ego to the first place on the next `_look` m of its way to its destination, without the
    first HERE m, that has a gap of less than `clear` m; inf if there is none.
    """
    route, body, here = scene.route, scene.vehicle, scene.ego_s + HERE
    lanes = blocks.coming
    hits, end = math.inf, min(here + _look(scene), scene.destination_s)
    stretches = (
        (blocks.standing, here, end),
        (lanes.outside, here, min(route.stop_line_s, end)),
        (lanes.inside, max(here, route.stop_line_s), min(route.exit_s, end)),
        (lanes.outside, max(here, route.exit_s), end),
    )
    for rectangles, first, last in stretches:
        s, gap = gaps_along(route.path, first, last, body, rectangles)
        hit = np.flatnonzero(gap < clear)
        if len(hit):
            hits = min(hits, float(s[hit[0]]) - scene.ego_s)
    return hits


def _on_route(scene: Scene, blocks: Blocks, clear: float) -> Array:
    """(n, 2) m, places of the bodies that stand and block on the next `_look` m of the ego's path."""
    path, here, look = scene.route.path, scene.ego_s + HERE, _look(scene)
    found = np.zeros(blocks.standing.number, dtype=np.bool_)
    for i in range(blocks.standing.number):
        one = Rectangles(*(part[i : i + 1] for part in blocks.standing))
        found[i] = (gaps_along(path, here, here + look, scene.vehicle, one)[1] < clear).any()
    return blocks.standing.position[found]


def _wait(scene: Scene, blocks: Blocks) -> float:
    """m to where the ego must wait if somebody is about to come through the junction the wrong way. It is the
    stop line, else the waiting point, else the last place that is clear of their way: the first of these at
    which the ego can still stop. An ego that creeps waits beside their way wherever it is. inf if nobody
    comes, or if the ego cannot stop any more.
    """
    route, body = scene.route, scene.vehicle
    if not blocks.soon.number:
        return math.inf
    _, gap = gaps_along(route.path, route.waiting_s, route.exit_s, body, blocks.soon)
    if not (gap < CLEAR).any():
        return math.inf
    front, least = scene.front_s, scene.ego.v**2 / (2 * hardest(scene, HARDEST))
    s, gap = gaps_along(route.path, scene.ego_s, route.exit_s, body, blocks.later)
    near = np.flatnonzero(gap < ASIDE)
    clear = float(s[near[0]]) - SPACING - scene.ego_s if len(near) else math.inf
    creeps = scene.ego.v < CREEPS and len(gap) > 0 and gap[0] >= CLEAR
    if creeps and 0.0 <= front - route.waiting_s < JUST_PAST:
        return 0.0
    rooms = (route.stop_line_s - front, route.waiting_s - front, clear)
    return next((room for room in rooms if room >= least), max(clear, 0.0) if creeps else math.inf)


def _astray(scene: Scene, blocks: Blocks) -> bool:
    """Whether the ego creeps, has left its line, and passes close beside a body."""
    return scene.ego.v < CREEPS and abs(scene.ego_offset) > LOST and is_narrow(scene, blocks.standing)


def _entry(scene: Scene, route: Route, profile: Array) -> float:
    """m from the front bumper to where the ego has to stop for those on whose ground its course comes and its
    `route` does not; inf if it may go, or cannot stop any more.
    """
    found = entering(scene, route)
    if found is None:
        return math.inf
    least = scene.ego.v**2 / (2 * hardest(scene, HARDEST))
    front, stop, exit_s = scene.front_s, scene.route.stop_line_s, scene.route.exit_s
    begun = JUST_IN if scene.ego.v < CREEPS and not stop < front < exit_s else 0.0
    rooms = found.ego_in[~suffices(scene, found, profile) & (found.ego_in > least - begun)]
    if not len(rooms):
        return math.inf
    room = float(rooms.min())
    waiting = scene.route.waiting_s - front
    if stop < front + room < exit_s and waiting > least - AT_LINE:
        room = min(room, waiting)
    return max(room - AT_LINE, 0.0)
