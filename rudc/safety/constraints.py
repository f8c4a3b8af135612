"""From a `Scene` to the filter's `Constraints`: what all its barriers find in the scene, in one table."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rudc.arrays import Array, Flags
from rudc.env.tracking import steering
from rudc.imports import is_own
from rudc.safety.barrier import Barrier, Found, Terms
from rudc.safety.barriers import BARRIERS
from rudc.safety.clearance import Bodies, Clearance, clearance_terms, ego_pose
from rudc.safety.config import FilterConfig
from rudc.safety.guarded import GuardedBarrier, GuardedClearance, barrier_of, refuse_alike
from rudc.safety.rows import RowWeights, affine_rows
from rudc.world.scene import Scene


class Part(NamedTuple):
    """The constraints of one barrier."""

    barrier: Barrier
    found: Found
    rows: slice
    """which of the K they are"""


@dataclass(frozen=True, slots=True, eq=False)
class Constraints:
    """K constraints, barrier by barrier; those of barriers that keep a distance come first."""

    names: tuple[str, ...]
    """(K,) `veh:ID`, `road:left:cg` and the like"""
    parts: tuple[Part, ...]
    """the constraints of each barrier"""
    bodies: Bodies
    """what to keep clear of, for the first of the K constraints"""
    mode: Array
    """(K,) 0 for those with the rates and the violation weight of road edges, 1 for the others"""

    @property
    def count(self) -> int:
        """The number K of constraints."""
        return len(self.names)

    def terms(self, scene: Scene) -> Terms:
        """h and its derivatives, (K,) each, of all constraints."""
        terms, near = clearance_terms(*ego_pose(scene), self.bodies), len(self.bodies.offset)
        for barrier, found, rows in self.parts:
            if rows.stop > near:
                terms = _joined(terms, barrier.terms(scene, found))
        return terms

    def lacking(
        self, scene: Scene, weights: RowWeights, relief: Array, a: tuple[float, float]
    ) -> Array | None:
        """(K,) m2 per step, the largest violation of each row, with these weights and this `relief` (K,), by
        an ego that follows its path (see `Barrier.on_path`) at an acceleration anywhere between the two in
        `a` (2,) m/s2. It is 0 for the rows of barriers that know no such ego; None if none knows one.
        """
        lacks: Array | None = None
        for barrier, found, rows in self.parts:
            followed = barrier.on_path(scene)
            if followed is not None:
                lacks = np.zeros(self.count) if lacks is None else lacks
                z = math.tan(steering(followed))
                terms = barrier.terms(followed, found)
                A, b = affine_rows(terms, weights.of(rows), a[0], z, relief[rows])  # exact in a at this z
                lacks[rows] = (b - A[:, 1] * z - np.outer(a, A[:, 0])).max(axis=0, initial=0.0)
        return lacks

    def in_conflict(self, scene: Scene) -> Flags:
        """(K,) whether each constraint is in conflict with the ego (see `Barrier.in_conflict`)."""
        return np.concatenate([barrier.in_conflict(scene, found) for barrier, found, _ in self.parts])


class ConstraintBuilder:
    """Builds the constraints of one instant."""

    def __init__(self, config: FilterConfig) -> None:
        barriers = [barrier_of(BARRIERS[name], name, settings) for name, settings in config.barriers.items()]
        self._clearances = [
            GuardedClearance(barrier) if is_own(barrier) else barrier
            for barrier in barriers if isinstance(barrier, Clearance)
        ]  # fmt: skip
        self._others = [
            GuardedBarrier(barrier) if is_own(barrier) else barrier
            for barrier in barriers if not isinstance(barrier, Clearance)
        ]  # fmt: skip
        self._has_own = any(map(is_own, barriers))

    def build(self, scene: Scene) -> Constraints:
        """The constraints of this scene."""
        names: tuple[str, ...] = ()
        parts = list[Part]()
        for barrier in (*self._clearances, *self._others):
            found = barrier.find(scene)
            parts.append(Part(barrier, found, slice(len(names), len(names) + len(found.names))))
            names += found.names
        if self._has_own and len({*names}) < len(names):
            refuse_alike(scene, [part.barrier for part in parts], names)
        near = sum(len(part.found.names) for part in parts[: len(self._clearances)])
        bodies, mode = Bodies.empty(near), np.zeros(len(names))
        for barrier, (_, found, rows) in zip(self._clearances, parts, strict=False):
            if found.names:
                barrier.fill(scene, found, bodies.part(rows))
        for barrier, _, rows in parts:
            if not barrier.as_road:
                mode[rows] = 1.0
        return Constraints(names, tuple(parts), bodies, mode)


def _joined(first: Terms, second: Terms) -> Terms:
    """The terms of `first`, followed by those of `second`."""
    zeros = np.zeros(len(first.h)), np.zeros(len(second.h))
    pairs = zip(first, second, strict=True)
    return Terms._make(
        np.concatenate([a if a is not None else zeros[0], b if b is not None else zeros[1]]) for a, b in pairs
    )
