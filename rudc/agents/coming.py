"""Those who come the wrong way, and their lanes: the ground that they will drive over within LANE_S s."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from rudc.arrays import Array, Flags, Index
from rudc.geometry import NO_RECTANGLES, Rectangles
from rudc.network.paths import SPACING
from rudc.world.scene import Scene

LANE_S = 12.0
"""s, how far ahead these lanes are predicted"""
AGAINST = -0.5
"""somebody drives against the ego's line if the cosine of the angle between them is below this"""
ALONG, PIECE = 0.35, 4.0
"""rad: up to this angle to the line, somebody who drives against it is taken to follow its bends; m,
length of the pieces that such a lane is made of"""
MEETING_S, PACE = 4.0, 4.0
"""s, time that passes at a place between the ego and somebody who comes the wrong way; m/s, least speed that
the ego is assumed to have"""
BACKS_S = 2.0
"""s: an ego that has stood for so long does not wait until who backs away is gone"""
FAR_BESIDE = 8.0
"""m from the ego's line beyond which nobody is on its road"""


class Lanes(NamedTuple):
    """The ground that those who come the wrong way drive over within LANE_S s. A course must leave it
    free.
    """

    outside: Rectangles
    """ground to leave free before the junction and beyond it"""
    inside: Rectangles
    """ground to leave free in the junction: that of those who go through it along the ego's line, where this
    leads straight on"""


NOBODY = Lanes(NO_RECTANGLES, NO_RECTANGLES)


def strays(scene: Scene, who: Flags) -> Index:
    """(n,) indices of those of the others `who` (N,) that drive against the ego's line, ahead on its road.
    Who backs away makes room, and is none of them.
    """
    found = [i for i in np.flatnonzero(who).tolist() if _against(scene, i) and not _backs(scene, i)]
    return np.array(found, dtype=np.int64)


def not_passed(scene: Scene, names: frozenset[str]) -> bool:
    """Whether any of these faces the ego's line, ahead on its road: comes, stands or, while the ego has not
    stood for BACKS_S, backs."""
    waits = scene.waited_s >= BACKS_S
    faces = [i for i, name in enumerate(scene.ids) if name in names and _against(scene, i)]
    return any(not (waits and _backs(scene, i)) for i in faces)


def lanes_of(scene: Scene, who: Index, speed: Array) -> Lanes:
    """The lanes of the others `who` (n,) at their `speed` (n,) m/s."""
    if not len(who):
        return NOBODY
    through = np.array([_goes_through(scene, i) for i in who.tolist()], dtype=np.bool_)
    inside = _taken(scene, who[through], speed[through], through[through])
    return Lanes(_taken(scene, who, speed, through), inside)


def swept(scene: Scene, who: Index, way: Array) -> Rectangles:
    """The ground that the others `who` (n,) drive over on a straight way of (n,) m."""
    if not len(who):
        return NO_RECTANGLES
    course = np.stack([np.cos(scene.heading[who]), np.sin(scene.heading[who])], axis=1)
    return Rectangles(
        scene.position[who] + 0.5 * way[:, None] * course,
        scene.heading[who],
        scene.size[who] + way[:, None] * (1.0, 0.0),
    )


def _taken(scene: Scene, who: Index, speed: Array, through: Flags) -> Rectangles:
    """The ground that the others `who` (n,), who drive against the ego's line, drive over at `speed` (n,) m/s
    within LANE_S: a lane as far beside the line as they are now, in pieces that follow its bends, or straight
    on for those who head elsewhere. The lane ends at the junction, except for those who go `through` it (n,).

    Where they drive on the same stretch of road as the ego, the lane also ends at the place that they reach
    MEETING_S after the ego: the ego has passed everything before that place by then.
    """
    path, route, here = scene.route.path, scene.route, scene.ego_s
    beyond, pace = scene.front_s > route.exit_s, max(scene.ego.v, PACE)
    pieces: list[tuple[float, float, float, float, float]] = []
    ahead = list[int]()
    for k, i in enumerate(who.tolist()):
        s, offset = path.project(*scene.position[i].tolist())
        turned = float(scene.heading[i]) - float(path.pose(s)[2]) + math.pi
        if abs(math.remainder(turned, 2 * math.pi)) > ALONG:
            ahead.append(k)
            continue
        theirs = float(speed[k])
        last = max(s - theirs * LANE_S, route.exit_s if s > route.exit_s and not through[k] else 0.0)
        if beyond or s <= route.exit_s or through[k]:
            # (s - meeting) / theirs = (meeting - here) / pace + MEETING_S
            meeting = (s * pace + here * theirs - MEETING_S * theirs * pace) / (pace + theirs)
            last = max(last, meeting)
        cuts = np.linspace(s, min(last, s), max(math.ceil((s - last) / PIECE), 1) + 1)
        length, width = scene.size[i].tolist()
        for near, far in pairwise(cuts.tolist()):
            x, y, psi = (float(v) for v in path.pose(0.5 * (near + far)))
            at = x - offset * math.sin(psi), y + offset * math.cos(psi)
            pieces.append((*at, psi, length + near - far, width))
    straight = swept(scene, who[ahead], speed[ahead] * LANE_S)
    if not pieces:
        return straight
    table = np.array(pieces)
    return Rectangles(
        np.concatenate([straight.position, table[:, :2]]),
        np.concatenate([straight.heading, table[:, 2]]),
        np.concatenate([straight.size, table[:, 3:]]),
    )


def _goes_through(scene: Scene, i: int) -> bool:
    """Whether somebody who drives against the ego's line goes through the junction along it, straight on."""
    path, route = scene.route.path, scene.route
    s, _ = path.project(*scene.position[i].tolist())
    if s < route.stop_line_s:
        return False
    theirs = path.heading_at(route.exit_s) if s > route.exit_s else float(scene.heading[i]) + math.pi
    first, last = (int(place / SPACING) for place in (route.stop_line_s, min(s, route.exit_s)))
    return bool((np.cos(path.heading[first : last + 1] - theirs) > math.cos(ALONG)).all())


def _against(scene: Scene, i: int) -> bool:
    """Whether somebody ahead on the ego's road faces against its line."""
    path = scene.route.path
    s, offset = path.project(*scene.position[i].tolist())
    if not scene.ego_s < s < path.length or abs(offset) > FAR_BESIDE:
        return False
    return math.cos(float(scene.heading[i]) - float(path.pose(s)[2])) < AGAINST


def _backs(scene: Scene, i: int) -> bool:
    """Whether somebody drives backwards."""
    heading, (vx, vy) = float(scene.heading[i]), scene.velocity[i].tolist()
    return vx * math.cos(heading) + vy * math.sin(heading) < 0.0
