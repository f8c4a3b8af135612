"""Which surrounding vehicles (SVs) a selector names."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rudc.arrays import Array, Flags
from rudc.network.paths import PathTable
from rudc.scenario.selectors import ByArm
from rudc.world.scene import Kind, Scene

if TYPE_CHECKING:
    from rudc.network.network import Network

ASIDE_M = 2.0
"""m beside the ego's path up to which an SV counts as on it: SUMO's vehicles cut corners where they turn"""
ALONG = 0.7
"""two directions count as the same if the cosine of the angle between them is larger than this"""


def pick(scene: Scene, selector: str | ByArm, rng: np.random.Generator) -> list[int]:
    """Rows of the scene's SVs that a selector names; empty if there is none now.

    leader: the nearest ahead on the ego's path; follower: the nearest behind on it; oncoming and crossing:
    the SV that reaches its stop line first, of those from the opposite arm, or from the arms to the sides,
    and of these only those whose path crosses the ego's, if there are any; the same of those that come by a
    named arm (`ByArm`); nearest; random; all.
    """
    svs = np.flatnonzero(scene.path >= 0)
    if selector == "all" or svs.size == 0:
        return [int(i) for i in svs]
    if selector == "random":
        return [int(rng.choice(svs))]
    if selector == "nearest":
        return [int(svs[0])]
    if selector in ("leader", "follower"):
        return _in_line(scene, svs, ahead=selector == "leader")
    due = towards_junction(scene, selector)
    best = int(np.argmin(due))
    return [best] if np.isfinite(due[best]) else []


def _in_line(scene: Scene, svs: np.ndarray, ahead: bool) -> list[int]:
    near = [scene.route.path.project(x, y) for x, y in scene.position[svs].tolist()]
    best, which = np.inf, -1
    for i, (s, offset) in zip(svs, near, strict=True):
        gap = s - scene.ego_s if ahead else scene.ego_s - s
        along = scene.route.path.pose(s)[2]
        if 0 < gap < best and abs(offset) < ASIDE_M and np.cos(scene.heading[i] - along) > ALONG:
            best, which = gap, int(i)
    return [which] if which >= 0 else []


def towards_junction(scene: Scene, selector: str | ByArm) -> Array:
    """(N,) s until each SV that comes as the selector says (`comes_from`) reaches its stop line.

    inf for all others. If the path of any of these SVs crosses the ego's, inf also for those whose does not.
    """
    paths = scene.network.paths
    due = np.full(scene.count, np.inf)
    svs = np.flatnonzero(scene.path >= 0)
    rows = scene.path[svs]
    to_stop = paths.stop_s[rows] - scene.path_s[svs]
    speed = np.maximum(np.hypot(*scene.velocity[svs].T), 0.5)
    due[svs] = np.where((to_stop > 0) & comes_from(scene, selector)[rows], to_stop / speed, np.inf)
    if isinstance(selector, ByArm) and selector.type:
        due[scene.kind != Kind[selector.type.upper()]] = np.inf
    crosses = np.zeros(scene.count, dtype=bool)
    crosses[svs] = ~np.isnan(scene.network.conflict(scene.route)[rows, 0])
    return np.where(crosses, due, np.inf) if np.isfinite(due[crosses]).any() else due


def comes_from(scene: Scene, selector: str | ByArm) -> Flags:
    """(P,) which paths come by a named arm (`ByArm`), from the opposite arm (`oncoming`), or else from the
    arms to the sides (`crossing`). Only their headings at the stop line count, not how arms run farther out.
    Where no arm lies to a side, as on a crossing of two roads at an acute angle, all arms count but the ego's
    and the most opposite one.
    """
    if isinstance(selector, ByArm):
        return by_arm(scene.network, selector)
    return arrivals(scene.network.paths, scene.route.row, selector == "oncoming")


def by_arm(network: Network, selector: ByArm) -> Flags:
    """(P,) which paths come by the arm that is named, and turn as it says. Raises NetworkError where there is
    no such arm.
    """
    arm, found = network.arm(selector.origin).name, np.zeros(network.paths.count, dtype=bool)
    for movement in network.onward:
        if movement.origin == arm and selector.turn in (None, movement.turn):
            found[list(movement.rows)] = True
    return found


def arrivals(paths: PathTable, row: int, oncoming: bool) -> Flags:
    """The same for an ego on path `row`."""
    turned = np.cos(paths.stop_heading - paths.stop_heading[row])
    opposite, beside = turned < -ALONG, np.abs(turned) <= ALONG
    if oncoming or beside.any():
        return opposite if oncoming else beside
    facing = paths.origin[np.argmin(turned)] if opposite.any() else paths.origin[row]
    return (paths.origin != paths.origin[row]) & (paths.origin != facing)
