"""Whose fault a collision of the ego is, by the rules below; the first rule that fits decides.

0. An event put the other where it is, so near that the ego could not stop, or sent it less than 4 s ago into
   the ego's way, so near that the ego could neither stop nor drive past before it: the other's fault.
1. The other stands (below 0.5 m/s) or is a pedestrian: the ego's fault if the ego drove at 0.5 m/s or more,
   or more slowly but faster than the other; else shared. Where an ego that moves on its reference path hits
   a car that the yielding layer makes brake or stand for the ego, and that has not stood for IN_SIGHT_S yet,
   this rule does not apply: rules 3 to 9 decide.
2. The ego stands (below 0.5 m/s) on its reference path, and either is not beyond the point up to which it may
   wait, or has stood for IN_SIGHT_S and has the other behind it, heading the same way: the other's fault.
3. They come by the same arm beside each other (by BESIDE_M or more), one of them is past its stop line, and
   one turns over the way of the other, as a car does that turns right over a cycle lane: the fault of the
   one that turns (by ALIKE more than the other); in a roundabout, of the one that leaves it first.
4. The two head the same way (within 45 degrees): the fault of the one behind; side by side, shared. Of two
   that came by different arms this holds only within 15 degrees, and only for one squarely behind.
5. The other drives on no path (against its lane, or across the road): the other's fault.
6. They meet head-on (within 45 degrees) where the ego's whole body is before its stop line or beyond the
   junction: the ego's fault if it is over the left edge of its carriageway, else shared.
7. One of the two had to yield to the other by the junction's right of way: the fault of that one. In a
   roundabout each may have to yield at its own entry; then it is the fault of the one that has driven less
   far beyond its stop line.
8. An event makes the other disregard the right of way: the other's fault.
9. Otherwise shared.
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np

from rudc.network.line_kernels import between
from rudc.network.paths import SPACING, PathTable
from rudc.world.scene import STANDING, Kind, Scene

Fault = Literal["ego", "other", "shared"]
IN_SIGHT_S = 3.0
"""s after which who stands, for whatever reason, is one that the other could have seen standing"""
MOVES = 0.05
"""m/s, up to which the ego does not move"""
MERGING = math.pi / 12
"""rad between the headings of two that merge, up to which one drives behind the other"""

BESIDE_M = 1.5
"""m between the middles of two lanes of an arm, from which on two drive beside each other in them"""
TURNS_OVER = math.pi / 4
"""rad by which the directions in which two leave the junction differ at least if one turns over the other's
way"""
ALIKE = math.pi / 12
"""rad; of two that turn as far as each other but for this, neither is the one that turns"""


class Collision(NamedTuple):
    """The ego's contact with something."""

    other: str
    kind: Kind
    fault: Fault
    sudden: bool = False
    """whether an event put or sent it so near that the ego could not but meet it (rule 0)"""


def judge(scene: Scene, index: int, unlawful: bool, held: bool = False, sudden: bool = False) -> Fault:
    """Whose fault a contact between the ego and row `index` of the scene's others is. `unlawful`: an event
    makes the other disregard the right of way; `held`: the yielding layer makes it brake for the ego or has
    just made it stand; `sudden`: an event put or sent it so near that the ego could not but meet it."""
    if sudden:
        return "other"
    ego = scene.ego
    dx, dy = scene.position[index] - (ego.x, ego.y)
    other_speed = math.hypot(*scene.velocity[index])
    stands = scene.kind[index] == Kind.PEDESTRIAN or other_speed < STANDING
    on_path = abs(scene.ego_offset) < 1.0
    if stands and not (held and ego.v >= STANDING and on_path):
        return "ego" if ego.v >= STANDING or ego.v > max(other_speed, MOVES) else "shared"
    turn = math.cos(scene.heading[index] - ego.psi)
    ahead = dx * math.cos(ego.psi) + dy * math.sin(ego.psi)
    stood = scene.waited_s >= IN_SIGHT_S and turn > math.cos(math.pi / 4) and ahead < 0
    if ego.v < STANDING and on_path and (_may_wait(scene) or stood):
        return "other"
    row, own, paths = int(scene.path[index]), scene.route.row, scene.network.paths
    merge = row >= 0 and paths.origin[row] != paths.origin[own]
    if row >= 0 and not merge and on_path and (turning := _turning_over(scene, index)):
        return turning
    if turn > math.cos(MERGING if merge else math.pi / 4):
        if abs(ahead) >= 0.25 * (scene.vehicle.length + scene.size[index, 0]):
            return "ego" if ahead > 0 else "other"
        if not merge:
            return "shared"
    if row < 0:
        return "other"
    if turn < -math.cos(math.pi / 4) and _on_an_arm(scene):
        return "ego" if _over_the_middle(scene) else "shared"
    yields = paths.yields
    if yields[own, row] != yields[row, own]:
        return "ego" if yields[own, row] else "other"
    if yields[own, row] and scene.network.is_roundabout:
        ours = scene.front_s - scene.route.stop_line_s
        its = scene.path_s[index] + 0.5 * scene.size[index, 0] - paths.stop_s[row]
        return "ego" if ours < its else "other"
    return "other" if unlawful else "shared"


def _turning_over(scene: Scene, index: int) -> Fault | None:
    """Whose fault it is that of two from the same arm, beside each other, one turns over the other's way;
    None where neither does. A bicycle in its lane, beside the row of its movement, counts where it drives."""
    row, own, paths = int(scene.path[index]), scene.route.row, scene.network.paths
    turned = [_turned(paths, k) for k in (row, own)]
    if abs(turned[0] - turned[1]) < TURNS_OVER:
        return None
    x, y, angle = _pose(paths, row, scene.path_s[index])
    dx, dy = scene.position[index] - (x, y)
    left = dy * math.cos(angle) - dx * math.sin(angle)
    theirs, ours = _pose(paths, row, paths.stop_s[row]), _pose(paths, own, paths.stop_s[own])
    cos, sin = math.cos(ours[2]), math.sin(ours[2])
    left += (theirs[1] - ours[1]) * cos - (theirs[0] - ours[0]) * sin
    past = float(scene.path_s[index]) + 0.5 * float(scene.size[index, 0]) - paths.stop_s[row]
    before = max(past, scene.front_s - scene.route.stop_line_s) <= 0.0
    if before or abs(left) < BESIDE_M or (turned[0] > turned[1]) == (left > 0):
        return None
    if scene.network.is_roundabout:
        return "other" if turned[0] < turned[1] else "ego"
    more = abs(turned[0]) - abs(turned[1])
    return None if abs(more) < ALIKE else "other" if more > 0.0 else "ego"


def _turned(paths: PathTable, row: int) -> float:
    """rad by which a row turns in the junction, left positive."""
    last = paths.heading[row, int(paths.exit_s[row] / SPACING)]
    return float(last - paths.stop_heading[row])


def _pose(paths: PathTable, row: int, s: float) -> tuple[float, float, float]:
    """x m, y m and heading rad at arc length `s` m of a row."""
    x, y, heading = paths.pose(np.array(row), np.array(s))
    return float(x), float(y), float(heading)


def _may_wait(scene: Scene) -> bool:
    return scene.front_s <= scene.route.waiting_s + 0.5


def _on_an_arm(scene: Scene) -> bool:
    half = 0.5 * scene.vehicle.length
    return scene.front_s < scene.route.stop_line_s or scene.ego_s - half > scene.route.exit_s


def _over_the_middle(scene: Scene) -> bool:
    body, path = scene.vehicle, scene.route.path
    turned = scene.ego.psi - path.heading_at(scene.ego_s)
    leftmost = 0.5 * (body.length * abs(math.sin(turned)) + body.width * abs(math.cos(turned)))
    return scene.ego_offset + leftmost > between(scene.route.left_width, scene.ego_s)
