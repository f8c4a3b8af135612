"""Where two ways through the junction come too close: the conflict table, zones and waiting positions.

Two centre lines are in conflict where they come closer than CONFLICT_WIDTH: two cars of 1.8 m, 0.4 m between.
Arc lengths in the table are those of vehicles' centres; whoever reads it adds half a vehicle's length.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

from rudc.arrays import Array, Flags, Index
from rudc.geometry import gaps_between
from rudc.network.paths import SPACING, PathTable
from rudc.network.polyline import crossing_cosines
from rudc.network.route import ReferencePath
from rudc.network.widening import AROUND
from rudc.vehicle import EgoVehicle

CONFLICT_WIDTH = 2.2
"""m between centre lines below which they are in conflict"""
SWEPT_HALF_WIDTH = 1.0
"""m to each side of a lane's centre line that its traffic sweeps"""
WAITING_GAP = 0.75
"""m that a waiting vehicle keeps from the swept paths of traffic it must yield to"""
MERGED = 6.0
"""m beyond the start of a merge after which its vehicles follow one another"""
COS_ALONG = np.cos(np.radians(30.0))
"""two ways lead in the same direction where the cosine of the angle between them is above this"""
BACK = 5.0
"""m: a second stretch begins where, from one station to the next, the other way's nearest point jumps back
by more than this"""
CAR = EgoVehicle()
"""an ordinary car: the ego and the others count as such where bodies are compared"""
PASSING = 0.25
"""m beside a car that waits, with which another can just pass"""


def conflict_table(
    path: ReferencePath, paths: PathTable, stations: Flags | None = None, rows: Iterable[int] | None = None
) -> Array:
    """(P, 4) m: s_ego_in, s_ego_out, s_sv_in, s_sv_out of the path's conflict with each row; nan if there is
    none. Only those `stations` (M,) of the path and only those `rows` count."""
    table = np.full((paths.count, 4), np.nan)
    s_of_path, xy_of_path = (path.s, path.xy) if stations is None else (path.s[stations], path.xy[stations])
    if not len(s_of_path):
        return table
    tree = KDTree(xy_of_path)
    for row in range(paths.count) if rows is None else rows:
        s = SPACING * np.arange(int(paths.length[row] / SPACING) + 1)
        xy = paths.xy[row, : len(s)]
        gap, _ = tree.query(xy, distance_upper_bound=CONFLICT_WIDTH)
        theirs = np.flatnonzero(np.isfinite(gap))
        if not len(theirs):
            continue
        gap, _ = KDTree(xy[theirs]).query(xy_of_path, distance_upper_bound=CONFLICT_WIDTH)
        ours = np.flatnonzero(np.isfinite(gap))
        table[row] = s_of_path[ours[0]], s_of_path[ours[-1]], s[theirs[0]], s[theirs[-1]]
    return table


class Crossings(NamedTuple):
    """Where a path meets each of the P ways, and where it meets them once more.

    Two ways through a roundabout can meet twice: where the one enters the ring, and where the other does.
    """

    table: Array
    """(P, 4) m, as `conflict_table`; of two stretches the first along the path"""
    again: Array
    """(P, 4) m, the same for the second stretch; nan where there is none"""
    merges: Flags
    """(P,) whether both go on in one lane from there, even if they part again later"""
    merges_again: Flags
    """(P,) the same for the second stretch"""
    any_silent: bool
    """whether it meets any of which the right of way says nothing (`silent`)"""


def crossings(path: ReferencePath, paths: PathTable, twice: Flags, table: Array, silent: Array) -> Crossings:
    """The crossings of a path with a conflict `table` (P, 4); where `silent` (P, 4), as that function gives
    it, is not nan, it counts instead. `twice` (P,): the ways that the path may meet twice."""
    first, again = np.where(np.isfinite(silent), silent, table), np.full_like(table, np.nan)
    for row in np.flatnonzero(twice).tolist():
        line = paths.xy[row, : int(paths.length[row] / SPACING) + 1]
        gap, theirs = KDTree(line).query(path.xy, distance_upper_bound=CONFLICT_WIDTH)
        met = np.flatnonzero(np.isfinite(gap))
        ends = np.flatnonzero(SPACING * np.diff(np.asarray(theirs)[met]) < -BACK)
        if len(ends):
            begins = path.s <= path.s[met[ends[0]]]
            first[row] = conflict_table(path, paths, begins, [row])[row]
            again[row] = conflict_table(path, paths, ~begins, [row])[row]
    merges, merges_again = _merges(path, paths, first), _merges(path, paths, again)
    return Crossings(first, again, merges, merges_again, bool(np.isfinite(silent[:, 0]).any()))


def _merges(path: ReferencePath, paths: PathTable, table: Array) -> Flags:
    """(P,) whether the path shares a lane with each way, from MERGED m into the conflict on."""
    met = np.isfinite(table[:, 0])
    begin, end, its_begin, its_end = np.where(met[:, None], table, 0.0).T
    x, y, psi = path.pose(begin + MERGED)
    its_x, its_y, its_psi = paths.pose(np.arange(paths.count), its_begin + MERGED)
    along = (np.cos(psi - its_psi) > COS_ALONG) & (np.hypot(x - its_x, y - its_y) < CONFLICT_WIDTH)
    _, _, last = path.pose(end)
    _, _, its_last = paths.pose(np.arange(paths.count), its_end)
    on = (its_end > paths.exit_s + MERGED) & (np.cos(last - its_last) > COS_ALONG)
    return met & (on | (along & (end > begin + MERGED)))


def departure_table(course: ReferencePath, paths: PathTable) -> Array:
    """`conflict_table`, but only of the stretches of a course that lie off its route."""
    return conflict_table(course, paths, course.departs)


def silent(path: ReferencePath, paths: PathTable, row: int) -> Array:
    """(P, 4) m, a conflict table, as `conflict_table`, of the rows from other arms that a car on a path over
    `row` meets at the junction although by the right of way neither must yield; nan for all others. Examples
    are opposite ways straight on in a junction so skewed or narrow that bodies on them overlap, and turns so
    tight that they swing out into the way of others.

    Here the bodies decide: two cars meet where less than PASSING is left between them. So a stretch begins
    where the front is when that begins, and ends where the tail is when it ends. A course counts only where
    it is on its route: off it, the ego gives way to all (`departure_table`).
    """
    neither = ~(paths.yields[row] | paths.yields[:, row]) & (paths.origin != paths.origin[row])
    table, half = np.full((paths.count, 4), np.nan), 0.5 * CAR.length
    around = (path.s > paths.stop_s[row] - AROUND) & (path.s < paths.exit_s[row] + AROUND)
    near = path.s[around & ~path.departs]
    xy, psi = path.body_pose(near, CAR)
    for other in np.flatnonzero(neither).tolist():
        s = np.arange(paths.stop_s[other] - CAR.length, paths.exit_s[other] + AROUND, SPACING)
        ours, theirs = _close(xy, psi, *paths.body_pose(np.full(len(s), other), s, CAR.length))
        if len(ours):
            at, its = near[ours], s[theirs]
            table[other] = at.min() + half, at.max() - half, its.min() + half, its.max() - half
    return table


def undecided(paths: PathTable) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
    """The pairs of rows from different arms of which neither must yield although they meet in the junction:
    first those on which cars meet head-on, so that each stops before the other and both stand for good, and
    then those that cross or merge.
    """
    lines, cars = [], []
    for row in range(paths.count):
        s = np.arange(paths.stop_s[row], paths.exit_s[row] + CAR.length, 2 * SPACING)
        cars.append(paths.body_pose(np.full(len(s), row), s, CAR.length))
        lines.append(paths.xy[row, int(paths.stop_s[row] / SPACING) : int(s[-1] / SPACING) + 1])
    against, across = list[tuple[int, int]](), list[tuple[int, int]]()
    neither = ~(paths.yields | paths.yields.T) & (paths.origin[:, None] != paths.origin)
    for row, other in np.argwhere(np.triu(neither)).tolist():
        if (crossing_cosines(lines[row], lines[other]) > -COS_ALONG).any():
            across.append((row, other))
            continue
        (xy, psi), (its_xy, its_psi) = cars[row], cars[other]
        ours, theirs = _close(xy, psi, its_xy, its_psi, 0.0)
        if (np.cos(psi[ours] - its_psi[theirs]) < -COS_ALONG).any():
            against.append((row, other))
    return against, across


def _close(
    xy: Array, psi: Array, its_xy: Array, its_psi: Array, least: float = PASSING
) -> tuple[Index, Index]:
    """(K,) and (K,): the pairs of cars at xy (n, 2) m, heading psi (n,) rad, and at its_xy (m, 2) m, heading
    its_psi (m,) rad, between which at most `least` m are left."""
    size = np.array([CAR.length, CAR.width])
    reach = math.hypot(*size) + least
    i, j = np.nonzero(np.hypot(*(xy[:, None] - its_xy[None]).transpose(2, 0, 1)) < reach)
    meet = gaps_between(xy[i], psi[i], size, its_xy[j], its_psi[j], size) <= least
    return i[meet], j[meet]


def through_waiting(path: ReferencePath, paths: PathTable, row: int) -> Flags:
    """(P,) the rows from other arms whose vehicles, where they wait at their stop line, leave a car that
    drives a path over `row` less than PASSING beside them: its turn is too tight for the narrow arm that it
    enters.
    """
    near = path.s[(path.s > paths.stop_s[row] - AROUND) & (path.s < paths.exit_s[row] + AROUND)]
    rows = np.flatnonzero(paths.origin != paths.origin[row])
    waits, heading = paths.body_pose(rows, paths.stop_s[rows] - 0.5 * CAR.length, CAR.length)
    found = np.zeros(paths.count, dtype=np.bool_)
    found[rows[_close(*path.body_pose(near, CAR), waits, heading)[1]]] = True
    return found


@lru_cache(maxsize=4096)
def meeting(paths: PathTable, row: int, other: int) -> tuple[float, float, float, float] | None:
    """m, m, m, m: begin and end of the stretch where a row meets another, along the row and then along the
    other; None if they never meet."""
    lines = [paths.xy[k, : int(paths.length[k] / SPACING) + 1] for k in (row, other)]
    gap, _ = KDTree(lines[1]).query(lines[0], distance_upper_bound=CONFLICT_WIDTH)
    its_gap, _ = KDTree(lines[0]).query(lines[1], distance_upper_bound=CONFLICT_WIDTH)
    ours, theirs = (np.flatnonzero(np.isfinite(found)) * SPACING for found in (gap, its_gap))
    return (ours[0], ours[-1], theirs[0], theirs[-1]) if len(ours) else None


def waiting_bumper(
    path: ReferencePath, paths: PathTable, rivals: Flags, stop: float, exit_s: float, width: float
) -> float:
    """m, farthest arc length of the front bumper, `width` m wide, clear of the swept paths of the rows
    `rivals` (P,)."""
    if not rivals.any():
        return stop
    step = SPACING / 2
    bumper = np.arange(stop, exit_s, step)
    x, y, psi = path.pose(bumper)
    normal = np.stack([-np.sin(psi), np.cos(psi)], axis=-1)
    sides = np.array([-width / 2, 0.0, width / 2])[:, None, None]
    corners = np.stack([x, y], axis=-1)[None] + sides * normal
    tree = KDTree(np.concatenate([_beyond_stop(paths, int(rival)) for rival in np.flatnonzero(rivals)]))
    gap, _ = tree.query(corners)
    clear = gap.min(axis=0) >= SWEPT_HALF_WIDTH + WAITING_GAP
    blocked = np.flatnonzero(~clear)
    farthest = len(bumper) - 1 if not len(blocked) else int(blocked[0]) - 1
    return float(bumper[max(farthest, 0)])


def _beyond_stop(paths: PathTable, row: int) -> Array:
    """(K, 2) m, stations of the row from its stop line to 10 m beyond the junction."""
    first, last = int(paths.stop_s[row] / SPACING), int((paths.exit_s[row] + 10.0) / SPACING)
    return paths.xy[row, first:last]
