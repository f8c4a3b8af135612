"""Whose fault a collision of the ego is, by a rule that can be stated in a sentence each; the first that fits
decides.

0. An event put the other where it is, nearer than the ego could have stopped: the other's.
1. The other stands or is a pedestrian: the ego's if it drove, else shared. A car that the yielding layer
   holds in the way of an ego on its reference path is asked for its right of way first: rules 3 to 6.
2. The ego stands (below 0.5 m/s) on its reference path, either before the point up to which it may wait or
   with the other behind it: the other's.
3. The two head the same way (within 45 degrees): the one behind is at fault; side by side, shared.
4. The other drives against its lane, or an event has it break the rules: the other's.
5. One had to yield to the other by the junction's right of way: that one's. In a roundabout each may have to
   yield at its own entry; then it is the fault of the one that has driven less far beyond its stop line.
6. Otherwise shared.
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

from rudc.world.scene import STANDING, Kind, Scene

Fault = Literal["ego", "other", "shared"]


class Collision(NamedTuple):
    """The ego's contact with something."""

    other: str
    kind: Kind
    fault: Fault


def judge(scene: Scene, index: int, unlawful: bool, held: bool = False, sudden: bool = False) -> Fault:
    """Fault of a contact between the ego and the scene's vehicle `index`; `unlawful`: an event has it break
    the rules; `held`: the yielding layer has it brake or stand; `sudden`: it appeared too near to stop."""
    if sudden:
        return "other"
    ego = scene.ego
    dx, dy = scene.position[index] - (ego.x, ego.y)
    other_speed = math.hypot(*scene.velocity[index])
    stands = scene.kind[index] == Kind.PEDESTRIAN or other_speed < STANDING
    on_path = abs(scene.ego_offset) < 1.0
    if stands and not (held and ego.v >= STANDING and on_path):
        return "ego" if ego.v >= STANDING else "shared"
    turn = math.cos(scene.heading[index] - ego.psi)
    ahead = dx * math.cos(ego.psi) + dy * math.sin(ego.psi)
    if ego.v < STANDING and on_path and (_may_wait(scene) or (turn > math.cos(math.pi / 4) and ahead < 0)):
        return "other"
    if turn > math.cos(math.pi / 4):
        reach = 0.25 * (scene.vehicle.length + scene.size[index, 0])
        if abs(ahead) < reach:
            return "shared"
        return "ego" if ahead > 0 else "other"
    if unlawful or scene.path[index] < 0:
        return "other"
    yields = scene.network.paths.yields
    row, own = int(scene.path[index]), scene.route.row
    if yields[own, row] != yields[row, own]:
        return "ego" if yields[own, row] else "other"
    if yields[own, row] and scene.network.is_roundabout:
        ours = scene.ego_s + 0.5 * scene.vehicle.length - scene.route.stop_line_s
        its = scene.path_s[index] + 0.5 * scene.size[index, 0] - scene.network.paths.stop_s[row]
        return "ego" if ours < its else "other"
    return "shared"


def _may_wait(scene: Scene) -> bool:
    front = scene.ego_s + 0.5 * scene.vehicle.length
    return front <= scene.route.waiting_s + 0.5
