"""A predictive yielding layer: surrounding vehicles (SVs) look 2 s ahead for what SUMO does not see.

Paper, Sec. "Simulation Environment": each SV predicts heading and position for the next 2 s and yields to potential collisions
according to road priority. Among SVs, SUMO's right of way already does this, so the layer looks only at pairs of an SV and

    an obstacle (accident, pedestrian, wrong-way driver): always yielded to;
    the ego where it stands in the SV's way now, whoever has priority;
    the ego's predicted path, if the SV has the lower priority, or if the ego has left its lane or its heading,
        or if the ego is committed: its front is past the point where it could still wait.

An ego that waits where it should (before its stop line, or at its waiting point inside the junction) is in none of these cases.

SVs are predicted along their own lanes at constant speed, the ego along its reference path (straight ahead when off it), each at
0.25 s steps, as slightly enlarged rectangles. An SV that must yield brakes with b = v^2 / (2 d), d the way it can go before the
first overlap, once b exceeds a threshold; it is released as soon as no overlap is predicted.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rudc.world.scene import Array, Scene

HORIZON_S = 0.25 * np.arange(9)
"""(9,) s, the instants looked at; the first is now"""
GROW_LENGTH = 1.0
"""m, added to an SV's length"""
GROW_WIDTH = 0.4
"""m, added to an SV's width"""
BRAKE_FROM = 1.5
"""m/s2, needed deceleration at which an SV begins to brake"""
BRAKE_MOST = 9.0
"""m/s2"""
CREEP = 1.0
"""m/s, speed at which a standing SV is taken to set off"""
STANDING = 1.0
"""m/s, below which the ego counts as standing in the way"""
REACH = 30.0
"""m, SVs farther from the ego and from every obstacle need not be looked at"""


class Yielding(NamedTuple):
    """What m of the scene's vehicles must do."""

    index: np.ndarray
    """(m,) rows of the scene"""
    deceleration: Array
    """(m,) m/s2, positive"""


NOBODY = Yielding(np.zeros(0, dtype=int), np.zeros(0))


def must_yield(scene: Scene, *, ego_present: bool = True) -> Yielding:
    """Which SVs must brake, and how hard. Before the ego is on the road, only obstacles count."""
    driven = scene.path >= 0
    obstacles = np.flatnonzero(~driven)
    near = _near(scene, obstacles, ego_present) & driven
    rows = np.flatnonzero(near)
    if rows.size == 0:
        return NOBODY
    speed = np.maximum(np.hypot(*scene.velocity[rows].T), CREEP)
    ahead = scene.path_s[rows, None] + speed[:, None] * HORIZON_S
    x, y, psi = scene.network.paths.pose(scene.path[rows, None], ahead)
    others_x, others_y, others_psi, others_size = _others(scene, obstacles)
    overlap = boxes_overlap(
        (x[:, None], y[:, None], psi[:, None]),
        0.5 * (scene.size[rows] + [GROW_LENGTH, GROW_WIDTH])[:, None, None],
        (others_x, others_y, others_psi),
        0.5 * others_size[:, None],
    )
    overlap[:, 0] &= ego_present and scene.ego.v < STANDING
    overlap[:, 1] &= (_heeds_prediction(scene, rows) & ego_present)[:, None]
    hit = overlap.any(axis=1)
    # An overlap that is there already cannot be braked away, and the SV may be driving out of it.
    first = np.argmax(hit[:, 1:], axis=1) + 1
    yields = hit[:, 1:].any(axis=1) & ~(hit[:, 0] & ~hit[:, 1:].all(axis=1))
    free = np.maximum(speed * HORIZON_S[first - 1] - 0.3, 0.05)
    need = speed**2 / (2 * free)
    chosen = yields & ((need > BRAKE_FROM) | (first <= 2))
    return Yielding(rows[chosen], np.minimum(need[chosen], BRAKE_MOST))


def _near(scene: Scene, obstacles: np.ndarray, ego_present: bool) -> np.ndarray:
    """(N,) whether an SV is within reach of the ego or of an obstacle."""
    gap = scene.position - (scene.ego.x, scene.ego.y)
    near = (np.einsum("ij,ij->i", gap, gap) < REACH**2) & ego_present
    if obstacles.size:
        gaps = scene.position[:, None] - scene.position[obstacles]
        near |= (np.einsum("ijk,ijk->ij", gaps, gaps) < REACH**2).any(axis=1)
    return near


def _others(scene: Scene, obstacles: np.ndarray) -> tuple[Array, Array, Array, Array]:
    """Poses over the horizon, (2 + m, 9) each, and sizes (2 + m, 2): the ego now, the ego predicted, m obstacles."""
    ego = scene.ego
    steps = HORIZON_S.size
    x = np.empty((2 + obstacles.size, steps))
    y, psi = np.empty_like(x), np.empty_like(x)
    x[0], y[0], psi[0] = ego.x, ego.y, ego.psi
    if off_path(scene):
        course = ego.psi + ego.slip
        x[1] = ego.x + ego.v * np.cos(course) * HORIZON_S
        y[1] = ego.y + ego.v * np.sin(course) * HORIZON_S
        psi[1] = ego.psi
    else:
        x[1], y[1], psi[1] = scene.route.path.pose(scene.ego_s + ego.v * HORIZON_S)
    x[2:] = scene.position[obstacles, 0, None] + scene.velocity[obstacles, 0, None] * HORIZON_S
    y[2:] = scene.position[obstacles, 1, None] + scene.velocity[obstacles, 1, None] * HORIZON_S
    psi[2:] = scene.heading[obstacles, None]
    size = np.concatenate([[(scene.vehicle.length, scene.vehicle.width)] * 2, scene.size[obstacles]])
    return x, y, psi, size


def off_path(scene: Scene) -> bool:
    """Whether the ego is more than 1 m or 30 degrees off its reference path, so that its route says little of its future."""
    if abs(scene.ego_offset) > 1.0:
        return True
    along = scene.route.path.pose(scene.ego_s)[2]
    return bool(np.cos(scene.ego.psi - along) < np.cos(np.pi / 6))


def _heeds_prediction(scene: Scene, rows: np.ndarray) -> np.ndarray:
    """(n,) whether each SV heeds where the ego will be, not only where it is."""
    route = scene.route
    front = scene.ego_s + 0.5 * scene.vehicle.length
    if off_path(scene) or (front > route.waiting_s + 1.0 and scene.ego.v > 0.5):
        return np.ones(rows.size, dtype=bool)
    if route.row < 0:
        return np.zeros(rows.size, dtype=bool)
    return scene.network.paths.yields[scene.path[rows], route.row]


def boxes_overlap(
    a: tuple[Array, Array, Array], half_a: Array, b: tuple[Array, Array, Array], half_b: Array
) -> np.ndarray:
    """Whether rectangles overlap, by separating axes; a and b are x, y (m) and heading (rad), half sizes (..., 2) m, all broadcast."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    cos_a, sin_a = np.cos(a[2]), np.sin(a[2])
    cos_b, sin_b = np.cos(b[2]), np.sin(b[2])
    cos_d, sin_d = np.abs(cos_a * cos_b + sin_a * sin_b), np.abs(sin_b * cos_a - cos_b * sin_a)
    la, wa, lb, wb = half_a[..., 0], half_a[..., 1], half_b[..., 0], half_b[..., 1]
    return (
        (np.abs(dx * cos_a + dy * sin_a) <= la + lb * cos_d + wb * sin_d)
        & (np.abs(dy * cos_a - dx * sin_a) <= wa + lb * sin_d + wb * cos_d)
        & (np.abs(dx * cos_b + dy * sin_b) <= lb + la * cos_d + wa * sin_d)
        & (np.abs(dy * cos_b - dx * sin_b) <= wb + la * sin_d + wa * cos_d)
    )
