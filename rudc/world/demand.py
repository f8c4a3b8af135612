"""Demand: by which arm further surrounding vehicles (SVs) come, and where they turn."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from rudc.errors import NetworkError

if TYPE_CHECKING:
    from rudc.network.network import Movement, Network


class Demand:
    """Draws movements, first the arm, then one of its ways on.

    Without shares, arms count as many times as they have lanes, and an arm's movements are equally likely.
    """

    def __init__(
        self,
        network: Network,
        origins: Mapping[str, float] | None = None,
        turns: Mapping[str, float] | None = None,
    ) -> None:
        """`origins`: share of those who come by each arm (name, or id of an edge); by others comes nobody.
        `turns`: share of each turn among those who come by an arm; movements with the same turn have it in
        equal parts, and an arm with none of these turns sends nobody. Raises NetworkError if an arm is not
        known, or if nobody could come.
        """
        lanes = {arm.name: len(arm.in_lanes) for arm in network.arms}
        self._movements: dict[str, list[Movement]] = {}
        for movement in network.onward:
            if turns is None or turns.get(movement.turn):
                self._movements.setdefault(movement.origin, []).append(movement)
        self._turns = turns
        wanted: dict[str, float] = {} if origins else {name: lanes[name] for name in self._movements}
        for name, share in (origins or {}).items():
            arm = network.arm(name).name
            wanted[arm] = wanted.get(arm, 0.0) + share
        self._origins = sorted(name for name, share in wanted.items() if share and name in self._movements)
        if not self._origins:
            raise NetworkError(no_way(network, origins, turns))
        self._arms = _cumulative([wanted[name] for name in self._origins])

    def draw(self, closed: Collection[tuple[str, str]], rng: np.random.Generator) -> Movement:
        """One movement, none of those that are `closed` (origin, destination) where its arm has another."""
        choices = self._movements[self._origins[bisect_right(self._arms, rng.random())]]
        if closed:
            free = [m for m in choices if (m.origin, m.destination) not in closed]
            choices = free or choices
        if self._turns is None:
            return choices[rng.integers(len(choices))]
        alike = [movement.turn for movement in choices]
        shares = [self._turns[turn] / alike.count(turn) for turn in alike]
        return choices[bisect_right(_cumulative(shares), rng.random())]

    def takes(self, movement: Movement) -> bool:
        """Whether those who come by its arm may turn as a movement does."""
        return self._turns is None or bool(self._turns.get(movement.turn))


def no_way(network: Network, origins: Iterable[str] | None, turns: Iterable[str] | None) -> str:
    """Says that nobody comes by the arms (None: by any) with one of the turns (None: with any)."""
    names = [*(origins or ())]
    if names and not any(network.arm(name).in_lanes for name in names):
        which = "which is" if len(names) == 1 else "which are"
        return f"network {network.name}: nothing enters by {' or '.join(names)}, {which} one-way"
    how = "" if turns is None else f" {' or '.join(turns)}"
    where = f" from {' or '.join(names)}" if names else ""
    return f"network {network.name}: no way leads{how}{where}"


def _cumulative(shares: Sequence[float]) -> list[float]:
    """Cumulative shares, computed as `numpy.random.Generator.choice` does."""
    parts = np.array(shares, dtype=float)
    sums = np.cumsum(parts / parts.sum())
    return (sums / sums[-1]).tolist()
